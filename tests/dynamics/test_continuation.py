"""Pseudo-arclength continuation on curves whose shape is known, and on rotors against other
methods.
"""

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.optimize import brentq, root

from hydrolab import HarmonicBalance, follow, orbits_at, sweep
from hydrolab.dynamics.continuation import arclength, correct, locate_fold
from hydrolab.dynamics.following import Arclength
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.pull import CircularPull, LinearPull

RADIUS = 0.7


def circle(y, parameter):
    """y² + λ² = R²: folds at λ = ±R."""
    return (np.array([y[0] ** 2 + parameter**2 - RADIUS**2]), np.array([[2 * y[0]]]),
            np.array([2 * parameter]))


def test_walk_around_a_circle():
    walk = arclength(circle, np.array([RADIUS]), 0.0, step=0.01, max_step=0.05)
    steps = list(itertools.islice(walk, 150))
    angles = np.unwrap([math.atan2(s.parameter, s.y[0]) for s in steps])
    assert (np.diff(angles) > 0).all()  # never turns back
    assert angles[-1] > 2 * math.pi  # and passes where it began
    for s in steps:
        assert math.hypot(s.y[0], s.parameter) == pytest.approx(RADIUS, abs=1e-10)
        assert s.tangent @ [s.y[0], s.parameter] == pytest.approx(0, abs=1e-10)
        assert s.tangent @ s.tangent == pytest.approx(1)
    turns = [np.sign(a.tangent[-1]) != np.sign(b.tangent[-1]) for a, b in itertools.pairwise(steps)]
    folds = [locate_fold(circle, steps[i], steps[i + 1]).parameter for i in np.flatnonzero(turns)]
    assert folds[:2] == pytest.approx([RADIUS, -RADIUS], abs=1e-12)


def test_walk_the_other_way():
    walk = arclength(circle, np.array([RADIUS]), 0.0, toward=-1.0)
    assert next(walk).parameter == pytest.approx(0)
    assert next(walk).parameter < 0


def test_steps_grow_where_it_is_straight_and_shrink_where_it_turns():
    def parabola(y, parameter):
        return np.array([parameter - 0.3 + 20
                         * y[0] ** 2]), np.array([[40 * y[0]]]), np.array([1.0])
    steps = list(itertools.islice(arclength(parabola, np.array([-0.5]), -4.7, step=1e-3,
                                            max_step=0.2), 120))
    z = np.array([[*s.y, s.parameter] for s in steps])
    length = np.linalg.norm(np.diff(z, axis=0), axis=1)
    at_fold = np.argmax(z[:, 1])
    assert length.max() == pytest.approx(0.2, rel=0.1)
    assert length[at_fold] < 0.03
    turns = [math.acos(min(1.0, a.tangent @ b.tangent)) for a, b in itertools.pairwise(steps)]
    assert max(turns) < 0.31
    assert z[at_fold, 1] <= 0.3


def test_correct_returns_to_the_plane_or_gives_none():
    start, tangent = np.array([0.72, 0.05]), np.array([0.0, 1.0])
    step = correct(circle, start, tangent)
    assert step.parameter == pytest.approx(0.05, abs=1e-15)
    assert step.y[0] == pytest.approx(math.sqrt(RADIUS**2 - 0.05**2), rel=1e-12)
    assert correct(circle, np.array([0.1, 0.9]), tangent) is None  # no circle in this plane
    assert correct(lambda y, p: (np.array([math.nan]), np.eye(1), np.ones(1)), start,
                   tangent) is None


def test_a_walk_ends_where_the_curve_ends():
    def cut(y, parameter):
        r, dy, dp = circle(y, parameter)
        return (r if parameter < 0.5 else r * math.nan), dy, dp
    steps = list(arclength(cut, np.array([RADIUS]), 0.0, min_step=1e-6))
    assert 0.5 - 1e-5 < steps[-1].parameter < 0.5
    assert not list(arclength(cut, np.array([RADIUS]), 0.6))


# ------------------------------------------------------------------ rotors

@pytest.fixture(scope="module")
def branch(unit, speed):
    return follow(unit, to=0.2, speed=speed)


@pytest.mark.parametrize("which", ["peer", "unit"])
def test_first_leg_is_what_a_solver_finds(request, speed, which):
    """Each point against harmonic balance from the linear response, which knows no neighbour."""
    model = request.getfixturevalue(which)
    branch = follow(model, to=0.2, speed=speed)
    values = branch.static_eccentricity[branch.first_leg][:-1]
    natural = sweep(model, HarmonicBalance(), values, speed=speed)
    assert len(natural) == len(values)
    assert np.abs(natural.coefficients - branch.coefficients[:len(values)]).max() < 1e-10 * 2e-3
    alone = HarmonicBalance().solve(model, speed, values[5])
    assert np.abs(alone.coefficients - branch[5].coefficients).max() < 1e-10 * 2e-3


def test_every_point_solves_the_equations(branch, unit):
    assert len(branch.folds) == 5  # two of them beyond the leg that a machine can be on
    assert branch.stopped == "It came back to 0 %, where it began."
    eq = branch.equations
    for orbit in branch:
        y = orbit.coefficients.ravel() / eq.length
        assert np.abs(eq.residual(y, orbit.centre)).max() < 1e-10
        assert orbit.residual <= 1e-10 * eq.force
    assert branch.smallest_gaps.min() > 0.3 * unit.gap


@pytest.mark.parametrize("which", ["peer", "unit"])
def test_folds_solve_a_bordered_system(request, speed, which):
    """F = 0, F_y v = 0, |v| = 1 (Seydel), written here, with differences for everything but F and
    F_y.
    """
    model = request.getfixturevalue(which)
    branch = follow(model, to=0.2, speed=speed)
    eq, n = branch.equations, 18
    for fold in branch.folds:
        def bordered(w):
            y, v, value = w[:n], w[n:2 * n], w[-1]
            residual, jacobian = eq.linearise(y, model.centre(value))
            return np.concatenate([residual, jacobian @ v, [v @ v - 1]])

        singular = np.linalg.svd(eq.linearise(fold.unknowns, model.centre(fold.value))[1])
        assert singular[1][-1] < 1e-8
        start = np.concatenate([fold.unknowns + 1e-6, singular[2][-1], [fold.value - 1e-6]])
        w = start
        for _ in range(8):
            step = 1e-7
            jacobian = np.array([(bordered(w + step * e) - bordered(w - step * e)) / (2 * step)
                                 for e in np.eye(2 * n + 1)]).T
            w = w - np.linalg.solve(jacobian, bordered(w))
        assert np.abs(bordered(w)).max() < 1e-12
        assert fold.value == pytest.approx(w[-1], abs=1e-10)
        assert abs(w[-1] - (fold.value - 1e-6)) > 1e-7  # the Newton of this test did move


def test_static_fold_of_a_balanced_rotor(make_jeffcott, speed):
    """Without unbalance the steady state is a rotor at rest, and its fold has a formula."""
    model = make_jeffcott(stiffness=1.6 * 1.65037e8).model().with_unbalance(0.0)
    kappa = model.K[0, 0] / model.law.stiffness
    eps = brentq(lambda e: (1 + 2 * e**2) / (1 - e**2) ** 2.5 - kappa, 0.01, 0.9)
    formula = eps - eps / (kappa * (1 - eps**2) ** 1.5)
    branch = follow(model, to=0.5, speed=speed, method=Arclength(max_folds=1))
    assert branch.folds[0].value == pytest.approx(formula, rel=1e-11)
    assert branch.at_fold(0).smallest_gap == pytest.approx((1 - eps) * model.gap, rel=1e-7)


def test_folds_lie_where_the_branch_turns(branch):
    e = branch.static_eccentricity
    for fold in branch.folds:
        here = e[fold.after:fold.after + 2]
        away = e[max(fold.after - 4, 0):fold.after + 5]
        assert abs(fold.value - here).max() < 2e-3
        is_maximum = away.mean() < fold.value
        assert (away <= fold.value).all() if is_maximum else (away >= fold.value).all()


def test_a_fold_that_is_not_there_is_a_sentence(branch, peer, speed):
    with pytest.raises(BadInput, match="number is 5; this branch has 5 folds, counted from 0"):
        branch.at_fold(5)
    with pytest.raises(BadInput, match=r"has no folds, counted from 0\. It reached 1 % as asked"):
        follow(peer, to=0.01, speed=speed).at_fold()


def test_a_fold_is_printed_in_per_cent(branch):
    assert str(branch.folds[0]).startswith("fold at 10.3")
    assert "folds: 10.3" in str(branch)


def test_follow_goes_the_other_way(unit, speed):
    up = follow(unit, to=0.05, speed=speed)
    down = follow(unit, to=-0.05, speed=speed)
    assert down.static_eccentricity[-1] == -0.05
    # the mirror image at the origin: a half turn of the machine, so odd harmonics keep, even ones
    # change sign
    one = HarmonicBalance().solve(unit, speed, up.static_eccentricity[-1])
    two = HarmonicBalance().solve(unit, speed, -up.static_eccentricity[-1])
    phase = np.linspace(0, 6, 9)
    assert two.positions(phase + math.pi) == pytest.approx(-one.positions(phase), abs=1e-12)


def test_follow_from_a_given_orbit(unit, speed, branch):
    start = HarmonicBalance().solve(unit, speed, 0.09)
    later = follow(unit, to=0.2, speed=speed, start=start)
    assert later.static_eccentricity[0] == 0.09
    assert later.folds[0].value == pytest.approx(branch.folds[0].value, abs=1e-12)
    assert "came back to 9 %" in later.stopped


@pytest.mark.parametrize(("parameter", "to"), [
    ("static_eccentricity", 0.05), ("static_eccentricity", 0.10354), ("speed", 20.0),
    ("field", 0.0), ("unbalance", 0.0),
    ("direction", 2.0), ("bearings.guide.stiffness", 1.2e9)])
def test_it_ends_on_the_value_asked_for(unit, speed, parameter, to):
    """The last point is the steady state at `to`, solved for alone, and no point lies beyond;
    10.354 % is under the fold.
    """
    name = next(iter(unit.supports))
    found = follow(unit, parameter.replace("guide", name), to=to, speed=speed,
                   static_eccentricity=0.0 if parameter == "static_eccentricity" else 0.03)
    assert found.values[-1] == pytest.approx(to, rel=1e-15)
    assert "as asked" in found.stopped and not found.folds
    away = np.sign(to - found.values[0]) * (found.values - to)
    assert (away <= 1e-15 * abs(to)).all() and (np.diff(away) > 0).all()
    last = found[-1]
    alone = HarmonicBalance().solve(last.model, last.speed, last.static_eccentricity,
                                    start=found[-2],
                                    direction=math.atan2(*last.centre) if parameter == "direction"
                                    else math.pi / 2)
    assert np.abs(alone.coefficients - last.coefficients).max() < 1e-10 * unit.gap
    assert len(orbits_at(found, found.values[-1])) == 1


def test_it_does_not_step_over_a_value_just_below_a_fold(peer, speed):
    """One long step may go over the value, round the fold, and come back below it."""
    fold = follow(peer, to=0.2, speed=speed).folds[0].value
    walk = Arclength(step=0.02, max_turn=1.0)
    for to in (fold - 1e-3, fold - 1e-5, fold - 1e-8):
        found = follow(peer, to=to, speed=speed, method=walk)
        assert found.values[-1] == pytest.approx(to, abs=1e-15) and not found.folds
        alone = HarmonicBalance().solve(peer, speed, to, start=found[-2])
        assert np.abs(alone.coefficients - found[-1].coefficients).max() < 1e-6 * peer.gap
    past = follow(peer, to=fold + 1e-6, speed=speed, method=walk)
    assert past.folds[0].value == pytest.approx(fold, abs=1e-9)


# ------------------------------------------------------------------ why it stops

@dataclass(frozen=True)
class EndsEarly(CircularPull):
    """The pull, known only up to 30 % of the gap."""

    def linearise(self, e, *rest):
        force, slope, _ = super().linearise(e)
        known = np.where(np.hypot(*e) < 0.3 * self.gap, 1.0, np.nan)
        return known * force, known * slope, None


@pytest.mark.parametrize(("to", "options", "words"), [
    (0.05, {}, "It reached 5 % as asked"),
    (0.2, {"max_points": 7}, "It has the 7 points that were allowed"),
    (0.2, {"max_folds": 2}, "It passed 2 folds"),
    (0.2, {"smallest_gap": 0.8}, "smallest gap is down to .* % of the nominal one"),
    (0.2, {"max_folds": 20}, "It came back to 0 %, where it began"),
])
def test_why_it_stops(peer, speed, to, options, words):
    from re import search
    branch = follow(peer, to=to, speed=speed, method=Arclength(**options))
    assert search(words, branch.stopped)
    if "max_points" in options:
        assert len(branch) == 7
    if "max_folds" in options and options["max_folds"] == 2:
        assert len(branch.folds) == 2
        assert len(branch) - 1 - branch.folds[1].after == 1 + Arclength().tail
    if "smallest_gap" in options:
        assert branch[-1].smallest_gap <= 0.8 * peer.gap < branch[-2].smallest_gap
    assert branch.stopped in str(branch)


def test_it_stops_at_contact(peer, speed):
    linear = replace(peer, law=LinearPull(0.9 * peer.law.stiffness, peer.gap))
    branch = follow(linear, to=0.9, speed=speed)
    assert "touches the stator" in branch.stopped
    assert branch.smallest_gaps[-1] <= 0 < branch.smallest_gaps[-2]


def test_it_stops_where_no_point_is_found(peer, speed):
    short = replace(peer, law=EndsEarly(peer.law.stiffness, peer.gap))
    branch = follow(short, to=0.2, speed=speed)
    assert "No further point was found near 7." in branch.stopped
    # the last point is where |e| reaches 30 %, at one of the AFT's samples
    last = branch[-1]
    eq = last.equations
    e = last.coefficients @ (eq.synthesis / eq.length) - last.centre[:, None]
    assert np.hypot(*e).max() == pytest.approx(0.3 * peer.gap, rel=1e-4)


# ------------------------------------------------------------------ refusals

@pytest.mark.parametrize(("options", "words"), [
    ({"step": 0.0}, "step is 0; it must be larger than 0"), ({"max_step": math.nan}, "max_step"),
    ({"max_turn": -1.0}, "max_turn"), ({"max_points": 1}, "at least 2"),
    ({"max_folds": 0}, "at least 1"),
    ({"tail": -1}, "tail"), ({"max_points": 10.0}, "whole number"),
    ({"smallest_gap": 1.0}, "fraction of the gap"),
    ({"step": "small"}, "step is 'small'; it must be a number"),
    ({"max_turn": 5.0}, "at most 1 is allowed, a radian"),
    ({"max_folds": True}, "max_folds is True"), ({"balance": 4}, "must be a HarmonicBalance")])
def test_options_are_checked(options, words):
    with pytest.raises(BadInput, match=words):
        Arclength(**options)


def test_arguments_are_checked(peer, unit, speed):
    with pytest.raises(BadInput, match="what can be followed is static_eccentricity, direction"):
        follow(peer, "colour", speed=speed)
    with pytest.raises(BadInput, match="to is missing"):
        follow(peer, "field", speed=speed)
    with pytest.raises(BadInput, match=r"12 % is 0\.12"):
        follow(peer, to=12.0, speed=speed)
    with pytest.raises(BadInput, match="where the branch starts"):
        follow(peer, to=0.0, speed=speed)
    with pytest.raises(BadInput, match="speed is"):
        follow(peer, speed=-3.0)
    with pytest.raises(BadInput, match=r"speed is '150'; it must be a number in rad/s \(rpm"):
        follow(peer, speed="150")
    with pytest.raises(BadInput, match=r"to is '0\.1'; it must be a number"):
        follow(peer, to="0.1", speed=speed)
    with pytest.raises(BadInput, match="must be an Arclength"):
        follow(peer, speed=speed, method=HarmonicBalance(8))
    other = HarmonicBalance(harmonics=6).solve(peer, speed, 0.01)
    with pytest.raises(BadInput, match="6 harmonics, the method 4"):
        follow(peer, speed=speed, start=other)
    with pytest.raises(BadInput, match="no air gap"):
        follow(replace(peer, gap=math.inf, law=CircularPull(0.0, math.inf)), speed=speed)


def test_a_start_that_is_no_steady_state(unit, peer, speed):
    foreign = HarmonicBalance().solve(peer, speed, 0.07)
    huge = replace(foreign, local=50 * foreign.local)
    with pytest.raises(NoConvergence, match="No branch begins"):
        follow(unit, speed=speed, start=huge)


def test_a_lost_fold_is_a_sentence():
    walk = arclength(circle, np.array([RADIUS]), 0.0, step=0.3, max_step=0.3, max_turn=1.0)
    steps = list(itertools.islice(walk, 12))
    before, after = next((a, b) for a, b in itertools.pairwise(steps)
                         if a.tangent[-1] > 0 > b.tangent[-1])

    def broken(y, parameter):
        r, dy, dp = circle(y, parameter)
        return r * math.nan, dy, dp
    with pytest.raises(NoConvergence, match="lost between two of its points"):
        locate_fold(broken, before, after)
    assert locate_fold(circle, before, after).parameter == pytest.approx(RADIUS, abs=1e-12)


def test_scipy_agrees_on_a_point_past_the_fold(peer, speed):
    """On the second leg natural continuation never comes; hybr started near it finds the same
    point.
    """
    branch = follow(peer, to=0.2, speed=speed)
    k = branch.folds[0].after + 8
    eq, centre = branch.equations, branch[k].centre
    found = root(lambda y: eq.residual(y, centre), branch.unknowns[k] * (1 + 1e-4),
                 method="krylov", tol=1e-12)
    assert found.success
    assert found.x == pytest.approx(branch.unknowns[k], abs=1e-9)
