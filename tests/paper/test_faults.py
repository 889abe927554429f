"""The table of faults: its rows are steady states, it reads as the orbits do, and its picture says
what stands out.
"""

from dataclasses import replace

import numpy as np
import pytest

from hydrolab import BadInput, HarmonicBalance, RungeKutta, integrate, load_machine, reduce, rpm
from hydrolab.dynamics.harmonics import ellipse
from hydrolab.figures.fault_figure import fault_picture, sizes
from hydrolab.paper.faults import Fault, fault_table, typical_faults

UNIT = load_machine("kaplan-150rpm")


@pytest.fixture(scope="module")
def table():
    return fault_table(UNIT, speeds=(UNIT.speed,))


def test_a_row_says_what_its_orbit_does(table):
    for row in table.rows:
        first = ellipse(row.orbit.coefficients, 1)
        assert row.size(1) == first.major and row.shape == first
        assert row.mean == pytest.approx(np.hypot(*row.orbit.mean))
        assert f"{1e6 * row.size(2):7.1f}" in str(row) and row.verdict in str(row)
    assert table.row("none").orbit.coefficients == pytest.approx(
        HarmonicBalance(24).solve(UNIT.model(), UNIT.speed, 0.02).coefficients, abs=1e-12)


def test_loose_pads_in_time(table):
    """The orbit that was reached by opening a preload is where a motion in time stays."""
    fault = next(f for f in typical_faults(UNIT) if f.name == "pad clearance")
    orbit = table.row("pad clearance").orbit
    model = reduce(fault.machine.model(), 10)
    richer = HarmonicBalance(32).solve(model, UNIT.speed, 0.02, start=orbit)
    motion = integrate(model, RungeKutta(1e-8, 1e-11), speed=UNIT.speed, static_eccentricity=0.02,
                       revolutions=1, modes=None, start=richer)
    assert np.abs(motion.coefficients(3)
                  - richer.coefficients[:, :7]).max() < 2e-5 * richer.amplitudes.max()
    for k in (1, 2, 3):
        assert ellipse(motion.coefficients(3),
                       k).major == pytest.approx(table.row("pad clearance").size(k), rel=1e-3)


def test_without_the_field_no_fault_of_a_vertical_machine_makes_harmonics(table):
    for fault in table.faults:
        off = table.row(fault, 0.0)
        assert off.size(2) + off.size(3) + off.mean < 1e-9 < off.size(1)
    assert table.row("breathing crack").size(2) > 3 * table.row("none").size(2)


def test_a_fault_without_a_steady_state_says_why():
    loose = next(f for f in typical_faults(UNIT) if f.name == "oil film").machine
    film = replace(loose.films[0], clearance=5e-4)
    table = fault_table(UNIT, [Fault("wide film", replace(loose, films=(film,)), 0.05)],
                        speeds=(UNIT.speed,))
    row = table.row("wide film")
    assert row.orbit is None and row.shape is None and np.isnan(row.size(1))
    assert "no steady state found" in str(table)
    assert "wide film" in fault_picture(table).reading or "No fault" in fault_picture(table).reading


def test_picture_and_reading(table):
    picture = fault_picture(table)
    assert "2X is largest with slot" in picture.reading and "pad clearance" in picture.reading
    assert picture.reading.count("field off") == 1 and "nan" not in picture.reading
    orbits, bars = picture.figure.subfigs
    assert [axes.get_title() for axes in orbits.axes] == list(table.faults)
    heights = [bar.get_height() for bar in bars.axes[0].containers[0]]
    assert heights == pytest.approx([1e6 * table.row(f).mean for f in table.faults])
    assert len(picture.png()) > 10_000


def test_picture_and_reading_of_two_speeds(table):
    kept = [row for row in table.rows if row.fault in ("none", "breathing crack")]
    faults = [fault for fault in typical_faults(UNIT) if fault.name in ("none", "breathing crack")]
    slow = fault_table(UNIT, faults, fields=(1.0,), speeds=(rpm(120),))
    both = replace(table, rows=(*kept, *slow.rows))
    picture = fault_picture(both)
    shares = [slow.row(f.name, 1.0, rpm(120)).size(2) / table.row(f.name).size(2) for f in faults]
    assert (f"At 120 rpm with the field on 2X is {shares[0]:.2f} (none) to {shares[1]:.2f} "
            "(breathing crack) times that at "
            "150 rpm.") in picture.reading
    marks = [line for line in picture.figure.subfigs[1].axes[0].lines if line.get_marker() == "D"]
    assert [line.get_ydata()[1] for line in marks] == pytest.approx(
        [1e6 * v for v in sizes(slow.row("breathing crack", 1.0, rpm(120)))])


def test_bad_requests(table):
    with pytest.raises(BadInput, match="no row has fault 'rust'"):
        table.row("rust")
    with pytest.raises(BadInput, match="no row has fault 'none'"):
        table.row("none", speed=rpm(100))
    with pytest.raises(BadInput, match="no typical faults"):
        typical_faults(load_machine("jeffcott"))
