"""A record beside a model: what the reading says is what was put in."""

import math

import numpy as np

from hydrolab import HarmonicBalance, load_machine, made_up_record
from hydrolab.dynamics.harmonics import long_axis
from hydrolab.figures import record_picture

UNIT = load_machine("kaplan-150rpm")


def test_a_record_beside_its_own_orbit_and_alone():
    orbit = HarmonicBalance(4).solve(UNIT.model(), UNIT.speed, 0.05)
    record = made_up_record(orbit, ["generator", "turbine guide bearing"], noise=3e-6, seed=1,
                            name="unit 3")
    for beside, panels in ((orbit, 4), (None, 4)):
        picture = record_picture(record, beside)
        assert len(picture.figure.axes) == panels
        assert "unit 3, 32 revolutions at 150 rpm" in picture.reading
        assert ("by the model" in picture.reading) == (beside is not None)
    said = float(picture.reading.split("1X is ")[1].split()[0])
    assert math.isclose(said, 1e6 * long_axis(orbit.coefficients), abs_tol=0.4)
    assert "½X is nowhere clear of the noise" in picture.reading


def test_a_half_order_is_named():
    """A motion that repeats every two revolutions, of 5 µm."""
    orbit = HarmonicBalance(4).solve(UNIT.model(), UNIT.speed, 0.05)
    record = made_up_record(orbit, ["generator"], noise=3e-6, seed=1)
    for probe in record.probes:
        probe.samples[:] += 5e-6 * np.cos(record.phase / 2 - probe.angle)
    assert "½X stands clear of the noise at the generator" in record_picture(record).reading
    assert math.isclose(record.order("generator", 0.5)[0], 5e-6, rel_tol=0.1)
