"""Many harmonic balances in one call against each of them alone."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from hydrolab import HarmonicBalance, ShapedPull, follow, orbits_at
from hydrolab.dynamics.batch import Outcome, newton_batch, solve_each, stack
from hydrolab.errors import BadInput


@pytest.fixture(scope="module")
def machines(make_kaplan, make_jeffcott):
    """Machines of different size, field, mass and speed: nothing in common but the number of
    harmonics.
    """
    models = [make_kaplan(elements, mass=mass, field=field).model() for elements, mass, field in
              itertools.product((4, 12), (5e4, 7e4), (0.4, 0.5))]
    return [*models, make_jeffcott().model(), make_jeffcott(stiffness=5e8, radius=5e-4).model()]


def start(eq):
    """Where `HarmonicBalance.solve` begins."""
    return eq.linear.ravel()


def test_batch_is_what_each_finds_alone(machines, speed):
    cases = [(model, speed * factor, e, angle) for model in machines
             for factor, e, angle in ((1.0, 0.0, 0.3), (0.8, 0.02, 1.6), (1.1, 0.04, 4.0))]
    balance = HarmonicBalance()
    systems = [balance.equations(model, w) for model, w, _, _ in cases]
    centres = np.array([model.centre(e, angle) for model, _, e, angle in cases])
    y, outcome = newton_batch(stack(systems), np.stack([start(eq) for eq in systems]), centres)
    assert (outcome == Outcome.CONVERGED).all()
    for found, (model, w, e, angle) in zip(y, cases, strict=True):
        alone = balance.solve(model, w, e, direction=angle)
        assert np.abs(model.gap * found - alone.coefficients.ravel()).max() < 1e-12 * model.gap


def test_a_whole_leg_at_once(unit, speed):
    """Up to 1e-4 of the fold and still the first leg; 1e-12 wherever the single one is as good as
    that.
    """
    branch = follow(unit, to=0.2, speed=speed)
    fold = branch.folds[0].value
    values = fold * (1 - np.geomspace(1e-4, 0.9, 30))
    rows = branch.first_leg
    guess = np.stack([np.interp(values, branch.values[rows], column)
                      for column in branch.unknowns[rows].T], axis=1)
    batch = stack([branch.equations]).take(np.zeros(len(values), dtype=int))
    y, outcome = newton_batch(batch, guess, np.array([unit.centre(v) for v in values]))
    assert (outcome == Outcome.CONVERGED).all()
    for found, value in zip(y, values, strict=True):
        alone = orbits_at(branch, value)[0]
        assert np.abs(unit.gap * found - alone.coefficients.ravel()).max() < 1e-12 * unit.gap


def test_those_that_fail_leave_the_others_alone(unit, peer, speed):
    """Beyond the fold there is nothing; a start outside the gap is no start; the rest must not
    notice.
    """
    branch = follow(unit, to=0.2, speed=speed, )
    eq, other = branch.equations, HarmonicBalance().equations(peer, speed)
    good = start(eq)
    far = good.copy()
    far[0] += 1.5
    lost = np.full_like(good, np.nan)
    systems = [eq, eq, other, eq, eq, other]
    centres = np.array([unit.centre(e) for e in (0.05, 0.05, 0.05, 0.3, 0.05, 0.3)])
    y, outcome = newton_batch(stack(systems),
                              np.stack([good, far, start(other), good, lost, start(other)]),
                              centres)
    assert outcome.tolist() == [Outcome.CONVERGED, Outcome.OUTSIDE, Outcome.CONVERGED,
                                Outcome.STALLED,
                                Outcome.OUTSIDE, Outcome.STALLED]
    calm, calm_outcome = newton_batch(stack([eq, other]), np.stack([good, start(other)]),
                                      centres[[0, 2]])
    assert (calm_outcome == Outcome.CONVERGED).all()
    assert y[[0, 2]] == pytest.approx(calm, abs=1e-15)
    assert y[1] == pytest.approx(far)  # left where it was


def test_a_singular_member_does_not_stop_the_others():
    """One exactly singular matrix makes LAPACK refuse the whole batch."""
    random = np.random.default_rng(1)
    matrices, right = random.normal(size=(5, 4, 4)), random.normal(size=(5, 4))
    matrices[2] = 0.0
    found = solve_each(matrices, right)
    assert np.isnan(found[2]).all()
    for i in (0, 1, 3, 4):
        assert matrices[i] @ found[i] == pytest.approx(right[i], abs=1e-12)


def test_a_member_whose_jacobian_is_singular(peer, speed):
    """Λ = 0 and no pull: stalled where it stands, while its neighbour converges."""
    eq = HarmonicBalance().equations(peer, speed)
    free = replace(eq, stiffness=0 * eq.stiffness, model=peer.with_field(0.0))
    shifted = replace(free, stiffness=np.diag(np.r_[0.0, np.ones(len(eq.stiffness) - 1)]))
    y0 = np.stack([start(eq), 0.1 + start(eq), 1e-3 + start(eq)])
    centres = np.array([peer.centre(0.05), np.zeros(2), np.zeros(2)])
    y, outcome = newton_batch(stack([eq, shifted, eq]), y0, centres)
    assert outcome.tolist() == [Outcome.CONVERGED, Outcome.STALLED, Outcome.CONVERGED]
    assert np.isfinite(y).all()


def test_steps_allowed(unit, speed):
    """Without steps nothing converges but what already is; that is said, not hidden."""
    eq = HarmonicBalance().equations(unit, speed)
    centre = unit.centre(0.05)[None]
    y, outcome = newton_batch(stack([eq]), start(eq)[None], centre, max_steps=0)
    assert outcome[0] == Outcome.STALLED
    assert y[0] == pytest.approx(start(eq))
    y, outcome = newton_batch(stack([eq]), start(eq)[None], centre)
    same, outcome = newton_batch(stack([eq]), y, centre, max_steps=0)
    assert outcome[0] == Outcome.CONVERGED
    assert same == pytest.approx(y, abs=1e-13)


def test_what_cannot_be_stacked(unit, speed):
    four, eight = HarmonicBalance(4).equations(unit, speed), HarmonicBalance(8).equations(unit,
                                                                                          speed)
    with pytest.raises(BadInput, match="same number of harmonics"):
        stack([four, eight])
    shaped = replace(unit, law=ShapedPull(unit.law.stiffness, unit.gap, np.full(64, unit.gap)))
    with pytest.raises(BadInput, match="circular gaps only"):
        stack([HarmonicBalance().equations(shaped, speed)])
