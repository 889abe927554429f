"""Stability of whole branches of the shipped unit and its kind: other methods, other people's
traps, and time itself.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hydrolab import (
    HarmonicBalance,
    ShapedPull,
    branch_stability,
    floquet,
    follow,
    orbits_at,
    reduce,
    stable_orbits_at,
)
from hydrolab.dynamics import branches, stability
from hydrolab.dynamics.branches import BranchStability
from hydrolab.dynamics.ensemble import split
from hydrolab.dynamics.following import Arclength
from hydrolab.dynamics.stability import floquet_all, moved, multipliers
from hydrolab.errors import NoConvergence


@pytest.fixture(scope="module")
def branch(shipped, speed):
    return follow(shipped, speed=speed, method=Arclength(HarmonicBalance(8), max_folds=3))


@pytest.fixture(scope="module")
def judged(branch):
    return branch.stability


def linear_part(model, speed):
    """ẋ = A x + push f for x = (q, q̇), and the rows that see the generator."""
    n, inverse = model.size, np.linalg.inv(model.M)
    A = np.block([[np.zeros((n, n)), np.eye(n)],
                  [-inverse @ model.K, -inverse @ (model.C + speed * model.G)]])
    return A, np.vstack([np.zeros((n, 2)), inverse
                         @ model.selection.T]), np.hstack([model.selection, 0 * model.selection])


def slope_at(orbit, phase):
    """∂F/∂e along an orbit, (2, 2, len(phase))."""
    return orbit.model.law.linearise(orbit.positions(phase) - orbit.centre[:, None])[1]


def by_dop853(orbit, modes):
    """Multipliers on that many modes, all of the disturbance integrated together, largest first."""
    small, w = reduce(orbit.model, modes, gyroscopic=True), orbit.speed
    A, push, watch = linear_part(small, w)
    n = len(A)

    def rate(t, s):
        s = s.reshape(n, n)
        return (A @ s + push @ (slope_at(orbit, np.array([w * t]))[:, :, 0] @ (watch @ s))).ravel()

    found = solve_ivp(rate, (0, 2 * math.pi / w), np.eye(n).ravel(), "DOP853", rtol=1e-9,
                      atol=1e-12)
    mu = np.linalg.eigvals(found.y[:, -1].reshape(n, n))
    return mu[np.argsort(-np.abs(mu))]


def by_hill(orbit, modes, harmonics):
    """Multipliers from Hill's matrix of the first-order form, x = e^{λt} Σ c_k e^{ikωt}; largest
    first.

    Of the copies λ + ikω those are taken whose mean harmonic Σ k |c_k|² lies nearest to 0 (Moore
    2005), not those with the smallest imaginary part.
    """
    small, w = reduce(orbit.model, modes, gyroscopic=True), orbit.speed
    A, push, watch = linear_part(small, w)
    n, samples = len(A), 16 * harmonics
    waves = np.fft.fft(slope_at(orbit, 2 * math.pi * np.arange(samples) / samples),
                       axis=-1) / samples
    ks = np.arange(-harmonics, harmonics + 1)
    matrix = np.zeros((len(ks), n, len(ks), n), dtype=complex)
    for a, k in enumerate(ks):
        for b, l in enumerate(ks):
            matrix[a, :, b] = push @ waves[:, :, k - l] @ watch
        matrix[a, :, a] += A - 1j * k * w * np.eye(n)
    values, vectors = np.linalg.eig(matrix.reshape(len(ks) * n, -1))
    weight = (np.abs(vectors.reshape(len(ks), n, -1)) ** 2).sum(axis=1)
    mean = np.abs((ks @ weight) / weight.sum(axis=0))
    mu = np.exp(values[np.argsort(mean)][:n] * 2 * math.pi / w)
    return mu[np.argsort(-np.abs(mu))]


def apart(found, expected):
    """Largest distance of an expected multiplier from the nearest one found."""
    return max(np.abs(found - mu).min() for mu in expected)


# ------------------------------------------------------------------ the shipped unit

def test_the_legs_of_the_shipped_unit(branch, judged):
    """First leg stable to its fold, the way back not, the second leg between two flips and again
    just before its end.
    """
    assert isinstance(judged, BranchStability)
    assert "unknown" not in judged.verdicts
    folds = [f.value for f in branch.folds]
    assert folds == pytest.approx([0.08925, 0.06934, 0.10789], abs=1e-5)
    first, second, third = (f.after for f in branch.folds)
    on_second = [c for c in judged.crossings if c.after > second]
    assert [c.kind.split(",")[0] for c in on_second] == ["flip", "flip", "flip", "Neimark–Sacker"]
    low, high, _, torus = (c.value for c in on_second)
    assert [low, high, torus] == pytest.approx([0.080682, 0.106612, 0.107691], abs=1e-6)
    for i, (value, verdict) in enumerate(zip(branch.values, judged.verdicts, strict=True)):
        inside = second < i <= third and (low < value < high or value > torus)
        assert verdict == ("stable" if i <= first or inside else "unstable"), (i, value)
    assert "flip at 8.068" in str(judged)
    assert str(judged).startswith(f"{judged.verdicts.count('stable')} stable, ")


def test_the_last_stable_window_in_time(branch):
    """Between the Neimark–Sacker point and the third fold, two hundredths of a per cent: pushed, it
    comes back.
    """
    orbit = orbits_at(branch, 0.1078)[0]
    assert floquet(orbit).verdict == "stable"
    below = orbits_at(branch, 0.1072)[0]
    assert floquet(below).verdict == "unstable"
    away = follow_in_time([orbit, below], 100, 256, 2e-5)
    assert away[90:, 0].max() < 3e-6
    assert not (away[90:, 1] < 1e-4).all()


def test_stable_orbits_at_one_eccentricity(branch):
    assert [len(stable_orbits_at(branch, e)) for e in (0.05, 0.075, 0.088, 0.1, 0.107)] == [1, 1,
                                                                                            2, 1, 0]
    low, high = stable_orbits_at(branch, 0.088)
    assert abs(low.mean[0]) < abs(high.mean[0])
    assert len(orbits_at(branch, 0.088)) == 3


@pytest.mark.parametrize("value", [0.03, 0.0885, 0.1])
def test_against_dop853(branch, value):
    """All orbits there; the integration runs on 12 modes, the verdict on what `floquet` chose."""
    for orbit in orbits_at(branch, value):
        truth = by_dop853(orbit, 12)
        found = floquet(orbit)
        largest = max(1.0, abs(truth[0]))
        assert apart(found.multipliers, truth[:3]) < 1e-3 * largest
        assert found.largest == pytest.approx(abs(truth[0]), abs=1e-4 * largest)
        assert found.verdict == ("stable" if abs(truth[0]) < 1 else "unstable")


def test_steps_do_not_matter_to_the_whole_set(branch):
    """Same basis, DOP853 on one side, Strang's splitting with Richardson on the other: every
    multiplier.
    """
    orbit = orbits_at(branch, 0.088)[2]
    values, error = multipliers(split(orbit.model, orbit.speed, 6), orbit.coefficients[None],
                                orbit.centre[None], 128)
    truth = by_dop853(orbit, 6)
    assert len(truth) == values.shape[1]
    assert apart(values[0], truth) < 1e-6
    assert error[0] < 1e-6


@pytest.mark.parametrize("value", [0.05, 0.075, 0.088, 0.106])
def test_against_hill(branch, value):
    """Hill's matrix with 2H harmonics, nothing shared with the splitting but the basis."""
    for orbit in orbits_at(branch, value):
        if abs(floquet(orbit).largest) > 10:
            continue  # the far leg, where Hill needs far more
        truth = by_hill(orbit, 4, 16)
        assert apart(floquet(orbit).multipliers, truth[:2]) < 1e-3
        assert (floquet(orbit).verdict == "stable") == (abs(truth[0]) < 1)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_plus_one_on_the_folds(shipped, speed, number):
    """µ = +1 to 1e-6, on orbits of 16 harmonics. Without the gyroscopic deflections 12 modes miss
    it by 6e-6.
    """
    fine = follow(shipped, speed=speed, method=Arclength(HarmonicBalance(16), max_folds=3, tail=0))
    orbit = fine.at_fold(number)
    values, _ = multipliers(split(shipped, speed, 12), orbit.coefficients[None],
                            orbit.centre[None], 256)
    assert np.abs(values[0] - 1).min() < 1e-6
    assert floquet(orbit).verdict != "stable"


def test_folds_do_not_move_with_the_harmonics(shipped, speed, branch):
    finer = follow(shipped, speed=speed, method=Arclength(HarmonicBalance(16), max_folds=3, tail=0))
    for a, b in zip(branch.folds, finer.folds, strict=True):
        assert a.value == pytest.approx(b.value, abs=1e-6)


# ------------------------------------------------------------------ crossings

def test_crossings_are_where_dop853_sees_them(branch, judged):
    kinds = [c.kind.split(",")[0] for c in judged.crossings]
    assert kinds == ["flip"] * 4 + ["Neimark–Sacker"]
    assert (*branch.flips, *branch.neimark_sackers) == judged.crossings
    for crossing in judged.crossings:
        orbit = branch.orbit(crossing.value, crossing.unknowns, 0.0)
        mu = by_dop853(orbit, 10)
        nearest = mu[np.argmin(np.abs(np.abs(mu) - 1))]
        assert abs(abs(nearest) - 1) < 2e-5
        if crossing.kind == "flip":
            assert abs(nearest + 1) < 2e-5
        else:
            angle = float(crossing.kind.split(",")[1].split("°")[0])
            assert math.degrees(abs(np.angle(nearest))) == pytest.approx(angle, abs=0.06)
            assert abs(nearest.imag) > 0.1


def test_crossings_do_not_move(shipped, speed, judged):
    """Located to 1e-6 of the gap: with twice the harmonics, 12 modes and eight times the steps they
    stay.
    """
    finer = follow(shipped, speed=speed, method=Arclength(HarmonicBalance(16), max_folds=3, tail=3))
    again = branch_stability(finer, modes=12, steps=256, quick=True)
    assert [c.value for c in judged.crossings] == pytest.approx([c.value for c in again.crossings],
                                                                abs=1e-7)


def test_neimark_sacker_on_another_machine(make_jeffcott, speed):
    """A light, softly held rotor that loses stability by a pair before anything else."""
    for stiffness in np.linspace(2.2e8, 4e8, 10):
        model = make_jeffcott(stiffness=stiffness, radius=8e-4).model()
        leg = follow(model, to=0.3, speed=speed, method=Arclength(HarmonicBalance(8), max_folds=2))
        found = branch_stability(leg)
        for crossing in found.crossings:
            orbit = leg.orbit(crossing.value, crossing.unknowns, 0.0)
            A, push, watch = linear_part(model, speed)

            def rate(t, s, orbit=orbit, A=A, push=push, watch=watch):
                s = s.reshape(4, 4)
                return (A @ s + push @ (slope_at(orbit, np.array([speed * t]))[:, :, 0]
                                        @ (watch @ s))).ravel()

            end = solve_ivp(rate, (0, 2 * math.pi / speed), np.eye(4).ravel(), "DOP853",
                            rtol=1e-11, atol=1e-13)
            mu = np.linalg.eigvals(end.y[:, -1].reshape(4, 4))
            assert np.abs(np.abs(mu) - 1).min() < 1e-6


# ------------------------------------------------------------------ 200 orbits, pushed and
# integrated

def follow_in_time(orbits, revolutions, steps, push, modes=6):
    """Distance of disturbed motions from their orbits after each revolution, in gaps, (revolutions,
    orbits).

    Classical Runge–Kutta on all orbits at once, written here: no splitting, no multiplier, the full
    nonlinear pull.
    """
    model, w = orbits[0].model, orbits[0].speed
    small = reduce(model, modes, gyroscopic=True)
    A, load, watch = linear_part(small, w)
    r, inverse = small.size, np.linalg.inv(small.M)
    shaken = np.zeros((2, 2 * r))
    shaken[:, r:] = w**2 * np.stack([inverse @ small.unbalance_sin, inverse @ small.unbalance_cos])
    project = np.linalg.solve(small.M, small.shaft_map.T @ model.M)
    k = np.arange(1, orbits[0].harmonics + 1)
    begin = np.array([np.concatenate([project @ (o.shaft[:, 0] + o.shaft[:, 2::2].sum(axis=1)),
                                      project @ (o.shaft[:, 1::2] @ (w * k))]) for o in orbits]).T
    away = np.random.default_rng(5).normal(size=begin.shape)
    away[r:] *= w
    away *= push * model.gap / np.abs(watch @ away).max(axis=0)
    x, centre = begin + away, np.array([o.centre for o in orbits]).T
    there = np.hstack([o.positions(np.zeros(1)) for o in orbits])
    h, out = 2 * math.pi / w / steps, []

    def rate(t, x):
        force = (math.sin(w * t) * shaken[0] + math.cos(w * t) * shaken[1])[:, None]
        return A @ x + load @ model.law.force(watch @ x - centre) + force

    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(revolutions):
            for n in range(steps):
                t = n * h
                a = rate(t, x)
                b = rate(t + h / 2, x + h / 2 * a)
                c = rate(t + h / 2, x + h / 2 * b)
                x = x + h / 6 * (a + 2 * b + 2 * c + rate(t + h, x + h * c))
            out.append(np.abs(watch @ x - there).max(axis=0) / model.gap)
    return np.array(out)


@pytest.mark.parametrize("which", ["shipped", "unit"])
def test_a_hundred_verdicts_in_time(request, speed, which):
    """A random hundred of the orbits of each of two units, all legs: pushed by 2e-5 of the gap and
    left to time.

    Those nearer to the unit circle than 3 % have not decided in 80 revolutions and are counted
    apart, as are those whose verdict is "unknown".
    """
    model = request.getfixturevalue(which)
    branch = follow(model, speed=speed, to=0.3,
                    method=Arclength(HarmonicBalance(8), max_step=0.005, max_folds=3, tail=0))
    rows = np.sort(np.random.default_rng(3).choice(len(branch), 100, replace=False))
    orbits = [branch[i] for i in rows]
    verdicts = floquet_all(orbits)
    away = follow_in_time(orbits, 80, 256, 2e-5)
    returned = (away[70:] < 5e-6).all(axis=0)  # false for nan: contact
    left = ~(away[60:] < 1e-5).all(axis=0)
    apart = 0
    for f, back, gone, orbit in zip(verdicts, returned, left, orbits, strict=True):
        if f.verdict == "unknown" or abs(f.largest - 1) < 0.03:
            apart += 1
            continue
        assert (f.verdict == "stable") == back, (str(f), orbit.static_eccentricity)
        assert (f.verdict == "unstable") == gone, (str(f), orbit.static_eccentricity)
    assert apart <= 6
    counts = [f.verdict for f in verdicts]
    assert counts.count("stable") > 12
    assert counts.count("unstable") > 15


# ------------------------------------------------------------------ in doubt

def test_coarse_orbits_are_never_wrongly_stable(shipped, speed):
    """Two harmonics, one mode, eight steps: it may look again or say unknown, but a "stable" must
    be one.
    """
    coarse = follow(shipped, speed=speed, method=Arclength(HarmonicBalance(2), max_folds=3, tail=4))
    orbits = [coarse[i] for i in range(0, len(coarse), 4)]
    wrong_alone = 0
    for orbit, found in zip(orbits, floquet_all(orbits, modes=1, steps=8), strict=True):
        try:
            better = HarmonicBalance(16).solve(shipped, speed, orbit.static_eccentricity,
                                               start=orbit)
        except NoConvergence:  # two harmonics put the fold elsewhere: there is no such orbit
            assert found.verdict != "stable"
            continue
        values, _ = multipliers(split(shipped, speed, 12), better.coefficients[None],
                                better.centre[None], 128)
        truth = abs(values[0, 0])
        alone, _ = multipliers(split(shipped, speed, 1), orbit.coefficients[None],
                               orbit.centre[None], 8)
        wrong_alone += (abs(alone[0, 0]) < 1) != (truth < 1) or abs(abs(alone[0, 0])
                                                                    - truth) > 0.05 * truth
        if found.verdict == "unknown":
            continue
        assert (found.verdict == "stable") == (truth < 1)
        assert found.largest == pytest.approx(truth, rel=2e-3)
    assert wrong_alone >= 2  # a few modes and steps alone would have been wrong


def test_a_crossing_that_is_not_found_is_said(branch, monkeypatch):
    def lost(*_):
        raise NoConvergence("lost")

    monkeypatch.setattr(branches, "_locate", lost)
    found = branch_stability(branch)
    assert not found.crossings
    assert "not located, between 7.7" in str(found)


def test_an_orbit_that_is_lost_with_more_harmonics_is_unknown(shipped, speed, monkeypatch):
    """Two harmonics still have an orbit a little beyond the true fold; with four there is none."""
    orbit = HarmonicBalance(4).solve(shipped, speed, 0.05)
    monkeypatch.setattr(stability, "_with_harmonics", lambda eq, local, centres, factor: (
        eq, local, np.zeros(len(local), dtype=bool)))
    found = floquet(orbit)
    assert found.verdict == "unknown"
    assert found.error == math.inf


def test_an_orbit_that_is_no_solution_is_not_judged_by_itself(shipped, speed):
    """A shifted copy is solved again first: the verdict is that of the steady state nearby, or
    unknown.
    """
    orbit = HarmonicBalance().solve(shipped, speed, 0.08)
    wrong = replace(orbit, local=1.02 * orbit.local)
    assert abs(floquet(wrong).largest - floquet(orbit).largest) < 1e-3
    far = replace(orbit, local=orbit.local + 3e-3)
    assert floquet(far).verdict in ("unknown", floquet(orbit).verdict)


def test_outside_the_gap_is_unknown(shipped, speed):
    orbit = HarmonicBalance().solve(shipped, speed, 0.08)
    outside_it = replace(orbit, local=orbit.local + 0.02)
    (found,) = floquet_all([outside_it], quick=True)
    assert found.verdict == "unknown"
    good, bad = floquet_all([orbit, outside_it])
    assert good.verdict == "stable"  # one that is lost does not disturb the other
    assert bad.verdict == "unknown"


def test_nothing_is_stable_within_the_margin():
    """A multiplier that is nearer to the unit circle than ten times its error decides nothing."""
    said = [stability._verdict(np.array([mu + 0j, 0.3]), error) for mu, error in (
        (0.9995, 1e-4), (0.9995, 1e-5), (0.98, 5e-3), (1.02, 1e-5), (7000.0, 10.0))]
    assert said == ["unknown", "stable", "unknown", "unstable", "unstable"]


def test_sets_of_multipliers_are_compared_both_ways():
    one = np.array([[1.1 + 0j, 0.95, 0.2]])
    # one that is missing
    assert moved(one, np.array([[1.1 + 0j, 0.2, 0.1]]))[0] == pytest.approx(0.15)
    assert moved(np.array([[0.9 + 0j, 0.2]]),
                 np.array([[1.2 + 0j, 0.9, 0.1]]))[0] == pytest.approx(0.3)  # or too many
    assert moved(one, np.array([[1.1 + 0j, 0.95, 0.5]]))[0] == 0.0  # 0.2 or 0.5: both decided


def test_number_outside(branch, judged):
    """Between two folds the number of multipliers outside changes by the fold's one and the flips'
    one each.
    """
    counts = [p.outside for p in judged.points]
    assert all(p.how == "counted" for p in judged.points)
    assert counts[0] == 0
    first, second = branch.folds[0].after, branch.folds[1].after
    assert counts[first + 2] == 1
    assert max(counts[first + 1:second]) == 2  # a flip on the way back
    assert 0 in counts[second:]


def test_other_gaps_are_judged_one_by_one(shipped, speed):
    """A law that the batch does not take goes through the single solver, with the same answer."""
    orbit = HarmonicBalance().solve(shipped, speed, 0.07)
    law = ShapedPull(shipped.law.stiffness, shipped.gap, np.full(128, shipped.gap))
    same = HarmonicBalance().solve(replace(shipped, law=law), speed, 0.07)
    assert floquet(same).largest == pytest.approx(floquet(orbit).largest, abs=1e-6)
    assert floquet(same).verdict == "stable"


def test_the_quick_look_is_good_to_a_thousandth(branch, judged):
    """What a moving slider shows, from a few modes: moduli within 1e-3, and the same verdicts or
    unknown.
    """
    quick = branch_stability(branch, quick=True, locate=False)
    for a, b in zip(quick.points, judged.points, strict=True):
        assert a.largest == pytest.approx(b.largest, rel=1e-3)
        assert a.verdict in (b.verdict, "unknown")
    assert quick.verdicts.count("unknown") <= 3
