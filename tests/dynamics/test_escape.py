"""Arrivals past a fold and the integrity of a leg: against another integrator and other knobs."""

import math

import numpy as np
import pytest

from hydrolab import (
    Arclength,
    Newmark,
    arrivals,
    basins,
    follow,
    integrate,
    integrity,
    orbits_at,
)
from hydrolab.dynamics.ensemble import CONTACT, OTHER
from hydrolab.dynamics.escape import Jump
from hydrolab.dynamics.reduction import reduce
from hydrolab.errors import BadInput
from tests.machines import MACHINES


def touches_by_runge_kutta(orbit, turns, centres, revolutions, steps):
    """Whether motions touch that begin on an orbit and whose stator is moved to `centres`, (2, n),
    at their own times `turns`, (n,), in revolutions. Classical Runge–Kutta, another basis.
    """
    model, w = orbit.model, orbit.speed
    small = reduce(model, 3, gyroscopic=True)
    r, inverse, watch = small.size, np.linalg.inv(small.M), small.selection
    shaft, k = orbit.shaft, np.arange(1, orbit.harmonics + 1)
    project = np.linalg.solve(small.M, small.shaft_map.T @ model.M @ model.shaft_map)
    q = project @ (shaft[:, 0] + shaft[:, 2::2].sum(axis=1))
    x = np.repeat(np.concatenate([q, project @ (shaft[:, 1::2] @ (w * k))])[:, None], len(turns), 1)
    h = 2 * math.pi / w / steps

    def rate(t, x, centre):
        force = watch.T @ model.law.force(watch @ x[:r] - centre)
        force += w**2 * (small.unbalance_sin * math.sin(w * t)
                         + small.unbalance_cos * math.cos(w * t))[:, None]
        return np.concatenate([x[r:], inverse @ (force - small.velocity_matrix(w) @ x[r:]
                                                 - small.K @ x[:r])])

    with np.errstate(over="ignore", invalid="ignore"):
        for step in range(revolutions * steps):
            t = step * h
            centre = np.where((step + 0.5) / steps < turns, orbit.centre[:, None], centres)
            a = rate(t, x, centre)
            b = rate(t + h / 2, x + h / 2 * a, centre)
            c = rate(t + h / 2, x + h / 2 * b, centre)
            x = x + h / 6 * (a + 2 * b + 2 * c + rate(t + h, x + h * c, centre))
    return ~np.isfinite(x).all(axis=0)


@pytest.fixture(scope="module")
def arrived(branch):
    return arrivals(branch, revolutions=100)


def test_about_one_arrival_in_six_touches(arrived):
    """Going up across 8.925 %; all others settle on the large orbit."""
    assert arrived.ends.size == 1000
    assert arrived.share(CONTACT) == pytest.approx(0.18, abs=0.03)
    assert arrived.share(0) == pytest.approx(1 - arrived.share(CONTACT))
    (large,) = arrived.orbits
    assert 1e6 * np.hypot(*large.mean) == pytest.approx(1950, abs=5)
    low, high = arrived.interval(CONTACT)
    # Wilson's interval by hand
    n, p, z = 1000, arrived.share(CONTACT), 1.959964
    middle, half = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + (z / (2 * n)) ** 2)
    assert (low, high) == pytest.approx(((middle - half) / (1 + z * z / n),
                                         (middle + half) / (1 + z * z / n)), abs=1e-6)
    assert f"{100 * p:.1f} % ({100 * low:.1f} to {100 * high:.1f} %) touch" in str(arrived)


def test_single_arrivals_by_runge_kutta(branch, shipped):
    """Which of them touch, motion by motion. At the default steps one in twelve, nearest to a
    boundary, ends otherwise; the share is the same.
    """
    found = arrivals(branch, sizes=[1e-4, 3e-4, 1e-3], phases=40, steps=4096, revolutions=35)
    beyond = branch.folds[0].value + np.repeat(found.sizes, 40)
    centres = np.stack([beyond * shipped.gap, 0 * beyond])
    theirs = touches_by_runge_kutta(branch.at_fold(), found.phases.ravel() / (2 * math.pi), centres,
                                    35, 320)
    ours = found.ends.ravel() == CONTACT
    assert 8 < ours.sum() < 40
    assert np.mean(ours == theirs) > 0.97


def test_another_basis_gives_the_same_share(branch, arrived):
    other = arrivals(branch, steps=512, modes=8, seed=5, phases=10, revolutions=60)
    low, high = other.interval(CONTACT)
    assert low < arrived.share(CONTACT) < high


def test_arrivals_refuse_and_keep_what_was_done(branch, shipped, speed):
    with pytest.raises(BadInput, match="counted from 0"):
        arrivals(branch, fold=7)
    with pytest.raises(BadInput, match="larger than 0"):
        arrivals(branch, sizes=[0.0])
    field = follow(shipped, "field", to=1.1, speed=speed, static_eccentricity=0.05)
    with pytest.raises(BadInput, match="runs along field"):
        arrivals(field)
    with pytest.raises(BadInput, match="runs along field"):
        integrity(field)

    def stop(done, whole):
        if done == 4:
            raise KeyboardInterrupt
    cut = arrivals(branch, sizes=[1e-4], phases=5, steps=64, progress=stop)
    assert cut.revolutions == 3
    assert (cut.ends == OTHER).all()


# ------------------------------------------------------------------ integrity

@pytest.fixture(scope="module")
def eroded(branch):
    return integrity(branch, np.linspace(0, 0.0885, 6), displacement=np.linspace(-7e-3, 7e-3, 24),
                     velocity=np.linspace(-0.12, 0.12, 24), revolutions=60)


def test_the_basin_shrinks_long_before_the_fold(eroded):
    assert eroded.safe[0] == eroded.returning[0] == 1.0
    assert (np.diff(eroded.safe[1:]) < 0).all()
    assert 0.04 < eroded.falls_to(0.5) < 0.06  # the fold is at 8.925 %
    assert eroded.safe[-1] < 0.12
    assert eroded.returning[-1] < 0.5 * eroded.safe[-1]  # the rest has gone to the large orbit
    assert eroded.reach[0] > 0.4 > 0.1 > eroded.reach[-1]
    assert f"to half of it at {100 * eroded.falls_to(0.5):.3g} % and" in str(eroded)
    assert "the fold is at 8.925 %" in str(eroded)


def test_the_same_starts_as_a_basin(branch, eroded):
    """One value of the curve is one picture of basins, on other knobs."""
    value = float(eroded.values[3])
    picture = basins([orbits_at(branch, value)[0]], eroded.displacement, eroded.velocity,
                     revolutions=150, steps=256, modes=8)
    assert np.mean(picture.ends == eroded.ends[3]) > 0.985
    assert np.mean(eroded.ends[3] != CONTACT) == pytest.approx(1 - picture.share(CONTACT), abs=0.01)


def test_integrity_refuses_and_keeps_what_was_done(branch):
    with pytest.raises(BadInput, match=r"first leg, from 0 to 8\.925 %"):
        integrity(branch, [0.09])

    def stop(done, whole):
        if done == 2:
            raise KeyboardInterrupt
    cut = integrity(branch, [0.0, 0.03, 0.06], displacement=[0.0, 1e-3], velocity=[0.0],
                    revolutions=5, progress=stop)
    assert len(cut.values) == len(cut.ends) == 2
    assert "interrupted after 2 of 3" in str(cut)


@pytest.mark.parametrize("name", ["film", "crack"])
def test_over_an_edge_with_forces_that_are_solved_for(name):
    """From the orbit at the fold, moved on at phase 0, against Newmark on fine steps."""
    machine = MACHINES[name]()
    model, speed = machine.model(), machine.speed
    start = follow(model, speed=speed, to=0.3, method=Arclength(max_folds=1, tail=0)).at_fold()
    value = start.static_eccentricity + 0.002
    jump = Jump(start, value, [], [], members=3, most=5)
    assert jump.work() and jump.made == 5 and np.isnan(jump.contact).all()
    flight = jump.flight(0)
    true = integrate(model, Newmark(2048), speed=speed, static_eccentricity=value, start=start,
                     revolutions=5, modes=6)
    turns = true.times * speed / (2 * np.pi)
    mine = np.array([np.interp(turns, flight.times, column) for column in flight.path.T])
    inside = (turns > 0.5) & (turns < 4.5)
    moved = np.abs(true.positions - start.positions(2 * np.pi * turns))[:, inside].max()
    assert np.abs(mine - true.positions)[:, inside].max() < 0.1 * moved
