"""The three shipped units that are not the paper's: what must balance, by hand."""

import math

import numpy as np
import pytest

from hydrolab import HarmonicBalance, critical_speeds, floquet, load_machine, modes, rpm
from hydrolab.dynamics import equilibrium
from hydrolab.dynamics.winding import with_slopes

UNITS = ("francis-three-guides", "pump-turbine", "pelton-horizontal")


@pytest.mark.parametrize("name", UNITS)
def test_a_unit_runs_and_every_number_says_where_it_comes_from(name):
    machine = load_machine(name)
    assert {entry.source for entry in machine.provenance.values()} <= {
        "assumed", "derived", "literature"}
    orbit = HarmonicBalance(4).solve(machine.model(), machine.speed, 0.02)
    assert floquet(orbit).verdict == "stable"
    for body in machine.bodies:  # balanced to G 6.3: the mass centre moves with 6.3 mm/s
        assert body.unbalance * machine.speed / body.mass == pytest.approx(6.3e-3, rel=0.05)


def test_the_lying_unit_carries_its_weight_and_rests_in_the_middle_of_its_gap():
    machine = load_machine("pelton-horizontal")
    shaft, model = machine.shaft, machine.model().with_field(0.0)
    weight = 9.81 * (np.sum(7850 * math.pi / 4 * shaft.diameter**2 * np.diff(shaft.nodes))
                     + 78e3 + 11e3)
    forces = HarmonicBalance(2).solve(model, machine.speed).bearing_forces
    total = sum(force.static for force in forces.values())
    assert total == pytest.approx([190e3, -weight], rel=1e-9)
    assert abs(equilibrium(model, 0.0).local[1]) < 1e-7


def test_the_pump_turbine_s_margin_is_where_its_modes_meet_the_speed():
    """Forward modes of the machine as it is at each speed, against 1X."""
    model = load_machine("pump-turbine").model()
    pull = model.law.linearise(np.zeros(2))[1]
    for there, given in ((model, False), (with_slopes(model, pull), True)):
        def beyond(speed, there=there):
            found = modes(there, speed)
            forward = [w for w, d, r in zip(found.frequencies, found.direction,
                                            found.damping_ratios, strict=True)
                       if d == "forward" and r < 0.3]
            return min(forward) / speed - 1

        low, high = rpm(600), rpm(880)
        for _ in range(40):
            middle = (low + high) / 2
            low, high = (middle, high) if beyond(middle) > 0 else (low, middle)
        found = critical_speeds(model, pull=given).of("forward")[0]
        # |Ω| of the critical speed and Im λ differ with the square of the damping ratio
        assert found == pytest.approx(low, rel=0.004)
