"""A branch moved with its model against the same branch followed from scratch."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hydrolab import (
    HarmonicBalance,
    ShapedPull,
    follow,
    load_machine,
    orbits_at,
    sweep,
    update_branch,
    vary,
)
from hydrolab.dynamics.following import MOVED, Arclength
from hydrolab.errors import BadInput

THREE = Arclength(max_folds=3)  # as far as a slider's branch goes


@pytest.fixture(scope="module")
def machine():
    return load_machine("kaplan-150rpm")


@pytest.fixture(scope="module")
def branch(machine):
    return follow(machine.model(), speed=machine.speed, method=THREE)


CHANGES = [("field", lambda m: m.air_gap.field * 1.01), ("unbalance", lambda m: 1.05),
           ("bodies.generator.mass", lambda m: m.bodies[0].mass * 1.005),
           ("bearings.generator guide bearing.stiffness", lambda m: 1.35e9)]


@pytest.mark.parametrize(("key", "value"), CHANGES, ids=[key for key, _ in CHANGES])
def test_moved_is_followed(machine, branch, key, value):
    """Folds to 1e-9, and every point a steady state of the new machine; the points themselves need
    not be the same.
    """
    model = vary(machine, {key: value(machine)}).model()
    moved, fresh = update_branch(branch, model), follow(model, speed=machine.speed, method=THREE)
    assert moved.stopped == MOVED
    assert len(moved) == len(branch)
    assert np.abs(moved.values - branch.values).max() > 1e-4  # the machine did change
    assert len(fresh.folds) == 3
    for a, b in zip(moved.folds, fresh.folds, strict=True):
        assert a.value == pytest.approx(b.value, abs=1e-9)
        assert np.abs(a.unknowns - b.unknowns).max() < 1e-6
    eq = moved.equations
    assert eq.model is model
    for orbit, y in zip(moved, moved.unknowns, strict=True):
        assert np.abs(eq.residual(y, orbit.centre)).max() < 1e-9
    assert moved.values[0] == pytest.approx(0, abs=1e-15)
    again = HarmonicBalance().solve(model, machine.speed, float(moved.values[8]))
    assert np.abs(again.coefficients - moved[8].coefficients).max() < 1e-9 * model.gap
    assert (np.diff([f.after for f in moved.folds]) > 0).all()


def test_a_slider_back_and_forth(machine, branch):
    """Twenty small moves there and back: no drift, no leg lost."""
    model = machine.model()
    moving = branch
    ratios = 1 + 0.03 * np.sin(np.linspace(0, 2 * math.pi, 21))
    for ratio in ratios:
        moving = update_branch(moving, model.with_field(float(ratio)))
        fresh = follow(model.with_field(float(ratio)), speed=machine.speed, method=THREE)
        assert [f.value for f in moving.folds] == pytest.approx([f.value for f in fresh.folds],
                                                                abs=1e-9)


def test_another_speed(machine, branch):
    model = machine.model()
    moved = update_branch(branch, model, speed=1.002 * machine.speed)
    fresh = follow(model, speed=1.002 * machine.speed, method=THREE)
    assert moved[0].speed == 1.002 * machine.speed
    assert [f.value for f in moved.folds] == pytest.approx([f.value for f in fresh.folds], abs=1e-9)


def test_topology_changes_are_followed_from_scratch(machine, branch):
    """With 9 % more field the first two folds have almost met; with 15 % other legs have come and
    gone.
    """
    model = machine.model()
    for ratio in (1.2, 0.7):
        changed = model.with_field(ratio)
        found = update_branch(branch, changed)
        fresh = follow(changed, speed=machine.speed, method=THREE)
        assert found.stopped != MOVED
        assert len(found) == len(fresh)
        assert found.values == pytest.approx(fresh.values, abs=1e-9)
        assert [f.value for f in found.folds] == pytest.approx([f.value for f in fresh.folds],
                                                               abs=1e-12)


def test_the_leg_it_began_on_is_kept(machine):
    """A branch that began on the far leg is taken up there, also when it is followed from scratch.
    """
    model = machine.model()
    far = orbits_at(follow(model, speed=machine.speed), 0.085)[2]
    branch = follow(model, speed=machine.speed, start=far, to=0.2,
                    method=Arclength(max_folds=1, tail=0))
    found = update_branch(branch, model.with_field(0.97))
    # as if a fold had appeared
    fresh = update_branch(replace(branch, special_points=()), model.with_field(0.97))
    assert MOVED not in fresh.stopped
    assert np.abs(fresh[0].mean - found[0].mean).max() < 1e-9 * model.gap
    assert fresh.folds[0].value == pytest.approx(found.folds[0].value, abs=1e-9)


def test_gaps_of_another_shape_are_followed(machine, branch):
    model = machine.model()
    shaped = replace(model, law=ShapedPull(model.law.stiffness, model.gap, np.full(96, model.gap)))
    found = update_branch(replace(branch, method=Arclength(max_folds=1, tail=0)), shaped)
    assert found.folds[0].value == pytest.approx(branch.folds[0].value, abs=1e-9)


def test_closed_branches_stay_closed(peer, speed):
    whole = follow(peer, to=0.2, speed=speed,
                   method=Arclength(max_folds=60, max_points=3000, past_start=True))
    moved = update_branch(whole, peer.with_unbalance(1.0005))
    if moved.stopped == MOVED:
        assert moved.closed
    assert len(moved.folds) == 10


def test_only_branches_along_eccentricity(unit, speed):
    along_field = follow(unit, "field", to=1.02, speed=speed, static_eccentricity=0.03)
    with pytest.raises(BadInput, match="the branch runs along field"):
        update_branch(along_field, unit)


def test_a_sweep_is_moved_too(unit, speed):
    values = [0.0, 0.02, 0.05]
    moved = update_branch(sweep(unit, HarmonicBalance(), values, speed=speed),
                          unit.with_field(0.97))
    assert moved.stopped == MOVED
    for point in moved:
        own = HarmonicBalance().solve(unit.with_field(0.97), speed, point.static_eccentricity)
        assert point.local == pytest.approx(own.local, abs=1e-9 * unit.gap)
