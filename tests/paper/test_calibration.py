"""The calibrated unit and its family: the shipped data file agrees with the code that makes it."""

from __future__ import annotations

import numpy as np
import pytest

from hydrolab import BadInput, HarmonicBalance, load_machine
from hydrolab.dynamics.batch import Outcome, newton_batch, stack
from hydrolab.paper.calibration import (
    AMPLITUDE,
    DEPTH_RANGE,
    FOLD_RANGE,
    FREE,
    SPEED,
    Verdicts,
    build,
    calibrate,
    first_fold,
    load_family,
    member_of,
    sensitivity,
    tally,
    unbalance_scale,
)
from tests.reference.full_balance import solve_full


@pytest.fixture(scope="module")
def family():
    return load_family()


def test_family_is_large_and_covers_both_readings(family):
    assert len(family.members) >= 50
    assert {m.reading for m in family.members} == {"with field", "without field"}
    for member in family.members:
        assert FOLD_RANGE[0] <= member.fold <= FOLD_RANGE[1]
        assert DEPTH_RANGE[0] < member.bearing_depth < DEPTH_RANGE[1]
        assert all(FREE[key].low <= value <= FREE[key].high for key, value in member.free.items())


@pytest.mark.parametrize("number", [3, 40, 77])
def test_stated_data_stay_as_stated(family, number):
    member = family.members[number]
    machine = member.machine()
    assert machine.shaft.length == 9.04 and set(machine.shaft.diameter) == {0.71}
    assert len(machine.shaft.nodes) == 13
    assert machine.bodies[0].offset == -0.472
    assert [b.stiffness[0, 0] for b in machine.bearings] == [1.37e9, 1.64e9]
    assert machine.thrust_bearings[0].tilt_stiffness[0, 0] == 5e7
    model = machine.model().with_field(1.0 if member.reading == "with field" else 0.0)
    # 200 µm by a solver that shares nothing with the exact circle
    full = model.selection @ solve_full(model, SPEED, 0.0, 2, 64)
    assert np.hypot(full[:, 1], full[:, 2]) == pytest.approx([AMPLITUDE, AMPLITUDE], rel=1e-6)


def test_shipped_unit_is_a_member_and_firm(family):
    unit = load_machine("kaplan-150rpm")
    assert 0.0890 <= first_fold(unit.model()) <= 0.0895
    near = min(family.members, key=lambda m: abs(m.free["generator_mass"]
                                                 - unit.body("generator").mass)
               + 1e4 * (m.reading != "with field"))
    changes = sensitivity(near)
    assert max(abs(changes[key]) for key in FREE
               if key.endswith(("_mass", "_gyration", "_shape"))) <= 0.1
    assert changes["guide_bearing_depth"] == pytest.approx(-0.3, abs=0.1)
    orbit = HarmonicBalance().solve(unit.model(), unit.speed)
    assert orbit.amplitudes[:, 0] == pytest.approx([AMPLITUDE, AMPLITUDE], rel=1e-4)


def test_equal_elements_do_not_fit():
    """Bearings on the nodes of equal elements are far too stiff (0.753 m) or too soft (1.507 m)."""
    free = load_family().members[0].free
    stiff = first_fold(build(free, 9.04 / 12, 50.0).model())
    soft = first_fold(build(free, 9.04 / 6, 50.0).model())
    assert stiff > 0.12 or np.isnan(stiff)
    assert soft < 0.02


def test_a_draw_that_cannot_be_calibrated_says_why(family, monkeypatch):
    monkeypatch.setattr("hydrolab.paper.calibration.DEPTH_RANGE", (0.70, 0.72))
    assert "no guide bearing between 0.7 and 0.72 m" in calibrate(family.members[0].free,
                                                                  "with field")


def test_unbalance_scale_refuses_an_anisotropic_machine():
    with pytest.raises(BadInput, match="not axisymmetric"):
        unbalance_scale(load_machine("three-disc").model(), SPEED, 1e-4, with_field=False)


def test_members_of_a_kind_are_counted(family):
    a, b, c = family.members[:3]
    verdicts = [Verdicts(a, "plain", {1: True, 2: False}), Verdicts(b, "S-shaped", {2: True}),
                Verdicts(c, "S-shaped", {2: True})]
    assert tally(verdicts, 2) == {"plain": {"agree": 0, "of": 1}, "S-shaped": {"agree": 2, "of": 2}}


def test_the_family_as_one_batch_equals_its_members_one_by_one(family):
    def at(members, static_eccentricity):
        """Coefficients of x and z, m, (members, 2, 9), and outcomes, raised to it in ten steps."""
        batch = stack([HarmonicBalance().equations(machine.model(), machine.speed)
                       for machine in (member.machine() for member in members)])
        y, outcome = batch.linear, np.zeros(len(batch))
        for share in np.linspace(0, 1, 11):
            y, now = newton_batch(batch, y, share * static_eccentricity * batch.law.gap * [1, 0])
            outcome = np.where(outcome == Outcome.CONVERGED, now, outcome)
        return batch.length[:, None, None] * y.reshape(len(y), 2, -1), outcome

    coefficients, outcome = at(family.members, 0.05)
    assert (outcome == Outcome.CONVERGED).all()
    for i in (0, 31, 79):
        machine = family.members[i].machine()
        alone = HarmonicBalance().solve(machine.model(), machine.speed, 0.05)
        assert np.abs(coefficients[i] - alone.coefficients).max() < 1e-12
    assert (at(family.members[:3], 0.2)[1] != Outcome.CONVERGED).all()


def test_a_member_can_be_read_back_from_its_machine(family):
    member = family.members[24]
    again = member_of(member.machine(), member.reading)
    assert again.free == pytest.approx(dict(member.free), rel=1e-12)
    assert (again.bearing_depth, again.unbalance) == pytest.approx((member.bearing_depth,
                                                                    member.unbalance), rel=1e-12)
