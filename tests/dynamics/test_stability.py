"""Floquet multipliers against exact answers, DOP853 and the fold. A wrong "stable" is the worst
error.
"""

import math
import re
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hydrolab import (
    HarmonicBalance,
    RungeKutta,
    floquet,
    follow,
    integrate,
    load_machine,
    reduce,
    rpm,
)
from hydrolab.dynamics.branches import orbits_at
from hydrolab.dynamics.following import Arclength
from hydrolab.dynamics.stability import floquet_all
from hydrolab.errors import BadInput
from hydrolab.machine.pull import CircularPull
from tests.reference.any_machine import all_multipliers


def leading(matrix, count=4):
    mu = np.linalg.eigvals(matrix)
    return mu[np.argsort(-np.abs(mu))][:count]


def apart(found, expected):
    """Largest distance of an expected multiplier from the nearest one found."""
    return max(np.abs(found - mu).min() for mu in expected)


def by_dop853(orbit, rtol=1e-10):
    """Monodromy matrix in (q, v) by integrating the disturbance, written here on the model's own
    coordinates.
    """
    model, n = orbit.model, orbit.model.size
    inverse = np.linalg.inv(model.M)
    D = model.C + orbit.speed * model.G

    def rate(t, s):
        q, v = s.reshape(2, n, 2 * n)
        _, slope, _ = model.law.linearise(orbit.positions(np.array([orbit.speed * t]))
                                       - orbit.centre[:, None])
        pull = model.selection.T @ slope[:, :, 0] @ model.selection
        return np.concatenate([v, inverse @ ((pull - model.K) @ q - D @ v)]).ravel()

    found = solve_ivp(rate, (0, 2 * math.pi / orbit.speed), np.eye(2 * n).ravel(), "DOP853",
                      rtol=rtol, atol=1e-12)
    return found.y[:, -1].reshape(2 * n, 2 * n)


# ------------------------------------------------------------------ exact answers

def corotating(model, orbit, radial, tangential):
    """Exact multipliers of a centred circular whirl of an isotropic 2-DOF rotor.

    In axes that turn with the whirl the slope of the pull is constant, `radial` along e and
    `tangential` across.
    """
    m, c, k, W = model.M[0, 0], model.C[0, 0], model.K[0, 0], orbit.speed
    J = np.array([[0.0, 1.0], [-1.0, 0.0]])  # turns with the spin: x' = W z, z' = −W x in (x, z)
    e = orbit.positions(np.zeros(1))[:, 0]
    along = np.outer(e, e) / (e @ e)
    slope = radial * along + tangential * (np.eye(2) - along)
    damping = c / m * np.eye(2) + 2 * W * J
    stiffness = (k * np.eye(2) - slope) / m - W**2 * np.eye(2) + c / m * W * J
    first_order = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]])
    return np.exp(np.linalg.eigvals(first_order) * 2 * math.pi / W)


@pytest.mark.parametrize("radius", [2e-4, 2e-3, 5e-3])
def test_centred_whirl(make_jeffcott, speed, radius):
    model = make_jeffcott(radius=radius).model()
    room = 1 - (radius / model.gap) ** 2
    tangential = model.law.stiffness * room**-1.5
    # The exact circle, z + ix = w e^{iΩt}; for the same unbalance there may be smaller ones, hence
    # it is the start.
    w = model.unbalance_cos[1] * speed**2 / (model.K[0, 0] - tangential - model.M[0, 0] * speed**2
                                             + 1j * speed * model.C[0, 0])
    small = HarmonicBalance(1).solve(model, speed)
    start = replace(small, local=np.array([[0, w.real, w.imag], [0, -w.imag, w.real]]))
    orbit = HarmonicBalance(1).solve(model, speed, start=start)
    assert orbit.amplitudes[:, 0] == pytest.approx([radius, radius])
    radial = tangential * (1 + 3 * (radius / model.gap) ** 2 / room)
    exact = corotating(model, orbit, radial, tangential)
    found = floquet(orbit)
    largest = np.abs(exact).max()  # at 5 mm nearly 300
    assert apart(found.multipliers, exact) < 1e-3 * max(1, largest)
    assert apart(floquet(orbit, steps=256).multipliers, exact) < 1e-7 * max(1, largest)
    assert apart(found.multipliers, exact) < found.error + 1e-9 * max(1, largest)
    assert found.verdict == ("stable" if np.abs(exact).max() < 1 else "unstable")


@dataclass(frozen=True)
class CubicPull(CircularPull):
    """F = a |e|² e: on a circle its slope is 3a r² along e and a r² across, Yang's k_m (1 ± ½) with
    k_m = 2a r².
    """

    def force(self, e, *rest):
        return self.stiffness * (e * e).sum(axis=0) * e

    def linearise(self, e, *rest):
        slope = 2 * self.stiffness * e[:, None] * e
        slope[0, 0] += self.stiffness * (e * e).sum(axis=0)
        slope[1, 1] += self.stiffness * (e * e).sum(axis=0)
        return self.force(e), slope, None


@pytest.mark.parametrize("damping", [0.0, 2e4])
@pytest.mark.parametrize("place", [0.2, 0.8, 0.96, 1.04, 1.5, 1.96, 2.04, 3.0])
def test_parametric_band_of_a_two_pole_field(make_jeffcott, damping, place):
    """A stiffness k − k_m that turns with 2ω as ∓ k_m/2 is unstable between √((k − 1.5 k_m)/m) and
    √((k − 0.5 k_m)/m).

    place: 1 is the lower end of that band, 2 the upper.
    """
    m, k, km, radius = 1.5e5, 2.7e8, 6e7, 2e-3
    low, high = math.sqrt((k - 1.5 * km) / m), math.sqrt((k - 0.5 * km) / m)
    omega = low + (place - 1) * (high - low)  # unstable for place in (1, 2)
    base = make_jeffcott(mass=m, stiffness=k).model()
    # makes the circle exact
    force = radius * (k - 0.5 * km - m * omega**2 + 1j * damping * omega) / omega**2
    model = replace(base, law=CubicPull(km / 2 / radius**2, base.gap), C=damping * np.eye(2),
                    unbalance_cos=np.array([force.imag, force.real]),
                    unbalance_sin=np.array([force.real, -force.imag]))
    circle = np.array([[0.0, radius, 0.0], [0.0, 0.0, radius]])
    orbit = replace(HarmonicBalance(1).solve(base, omega),
                    equations=HarmonicBalance(1).equations(model, omega),
                    local=circle)
    assert np.abs(orbit.equations.residual(circle.ravel() / model.gap, np.zeros(2))).max() < 1e-13
    exact = corotating(model, orbit, 1.5 * km, 0.5 * km)
    (found,) = floquet_all([orbit], steps=64, quick=True)
    assert apart(found.multipliers, exact) < 1e-7
    if damping == 0.0:
        unstable = np.abs(exact).max() > 1 + 1e-9
        assert unstable == (1 < place < 2)
        assert (found.largest > 1 + 1e-6) == unstable


def test_constant_slope_gives_the_eigenvalues_of_a_softer_machine(unit, speed):
    """Rest in the middle of the gap: no time dependence, all modes."""
    still = unit.with_unbalance(0.0)
    orbit = HarmonicBalance().solve(still, speed)
    soft = still.K - still.law.stiffness * still.selection.T @ still.selection
    inverse = np.linalg.inv(still.M)
    n = still.size
    first_order = np.block([[np.zeros((n, n)), np.eye(n)],
                            [-inverse @ soft, -inverse @ still.velocity_matrix(speed)]])
    exact = np.exp(np.linalg.eigvals(first_order) * 2 * math.pi / speed)
    exact = exact[np.argsort(-np.abs(exact))][:8]
    found = floquet(orbit)
    assert found.verdict == "stable"
    assert apart(found.multipliers, exact[:4]) < 1e-3
    (finer,) = floquet_all([orbit], modes=24, quick=True)
    assert apart(finer.multipliers, exact) < 1e-6


# ------------------------------------------------------------------ the benchmark that peers were
# measured on

def test_peer_multipliers(peer, speed):
    orbit = HarmonicBalance().solve(peer, speed, 0.05)
    found = floquet(orbit)
    # by DOP853 and AUTO-07p
    assert np.abs(found.multipliers) == pytest.approx([0.8439132] * 4, abs=1e-6)
    assert apart(found.multipliers, np.linalg.eigvals(by_dop853(orbit))) < 1e-6
    assert found.verdict == "stable"
    # Liouville: the trace of the first-order matrix is −2c/m whatever the pull does
    det = np.exp(-2 * peer.C[0, 0] / peer.M[0, 0] * 2 * math.pi / speed)
    assert np.prod(found.multipliers).real == pytest.approx(det, rel=1e-10)


@pytest.fixture(scope="module")
def far_branch(peer, speed):
    return follow(peer, to=0.2, speed=speed,
                  method=Arclength(HarmonicBalance(8), max_folds=2, tail=0))


def test_the_trap_orbit(peer, speed, far_branch):
    """The orbit that Hill's method with symmetry sorting calls stable: largest multiplier 29.56
    by integration.
    """
    leg = range(far_branch.folds[0].after + 1, far_branch.folds[1].after)
    near = min(leg, key=lambda i: abs(far_branch.static_eccentricity[i] - 0.0198)
               + abs(far_branch[i].mean[0] + 2e-3))
    orbit = HarmonicBalance(16).solve(peer, speed, 0.0198, start=far_branch[near])
    truth = leading(by_dop853(orbit))
    assert truth[0].real == pytest.approx(29.56, abs=0.05)
    found = floquet(orbit)
    assert found.verdict == "unstable"
    assert found.kind == "fold"
    assert apart(found.multipliers, truth) < 1e-3
    coarse = HarmonicBalance(4).solve(peer, speed, 0.0198, start=far_branch[near])
    assert floquet(coarse).verdict == "unstable"
    # four harmonics say 34: it looks again, more finely
    assert apart(floquet(coarse).multipliers, truth[:1]) < 0.03


def test_no_orbit_of_the_unstable_leg_comes_out_stable(peer, speed, far_branch):
    leg = range(far_branch.folds[0].after + 1, far_branch.folds[1].after, 4)
    orbits = [far_branch[i] for i in leg]
    assert len(orbits) > 8
    for orbit in orbits:
        assert floquet(orbit).verdict != "stable"
        assert floquet(orbit, steps=8).verdict != "stable"
        assert np.abs(leading(by_dop853(orbit, 1e-7)))[0] > 1


def test_the_whole_multiplier_set_against_dop853(far_branch):
    k = far_branch.folds[0].after
    for orbit in (far_branch[k - 2], far_branch[k + 6]):
        truth = np.linalg.eigvals(by_dop853(orbit))
        assert apart(floquet(orbit).multipliers, truth) < 1e-4


# ------------------------------------------------------------------ folds and the full machine

@pytest.mark.parametrize("number", [0, 1, 2])
def test_plus_one_on_the_fold(unit, speed, number):
    """With enough harmonics, modes and steps a multiplier is 1 where the branch turns."""
    branch = follow(unit, to=0.2, speed=speed, method=Arclength(HarmonicBalance(16)))
    orbit = branch.at_fold(number)
    (found,) = floquet_all([orbit], modes=24, steps=256, quick=True)
    assert apart(found.multipliers, [1.0]) < 1e-5
    assert floquet(orbit).verdict != "stable"


def test_plus_one_on_the_fold_of_the_peer(peer, speed):
    branch = follow(peer, to=0.2, speed=speed, method=Arclength(HarmonicBalance(16), max_folds=1))
    (found,) = floquet_all([branch.at_fold(0)], steps=128, quick=True)
    assert apart(found.multipliers, [1.0]) < 1e-6
    before, after = branch[branch.folds[0].after - 1], branch[branch.folds[0].after + 3]
    assert floquet(before).verdict == "stable"
    assert floquet(after).verdict == "unstable"
    assert floquet(after).kind == "fold"


def test_the_unit_against_dop853(unit, speed):
    """Six modes in time, written here; and the same modes and all of them through `floquet`."""
    orbit = HarmonicBalance(8).solve(reduce(unit, 4), speed, 0.1)
    truth = leading(by_dop853(orbit, 1e-9), 6)
    assert apart(floquet(orbit).multipliers, truth) < 1e-3
    assert apart(floquet(orbit, steps=128).multipliers, truth) < 1e-6


@pytest.mark.parametrize("eccentricity", [0.0, 0.05, 0.09, 0.103])
def test_defaults_are_as_good_as_they_say(unit, speed, eccentricity):
    """Against 24 modes and 1024 steps on the orbit of 16 harmonics."""
    found = floquet(HarmonicBalance().solve(unit, speed, eccentricity))
    fine = HarmonicBalance(16).solve(unit, speed, eccentricity)
    (truth,) = floquet_all([fine], modes=24, steps=256, quick=True)
    assert apart(found.multipliers, truth.multipliers[:4]) < 1e-3
    assert found.verdict == "stable"
    assert truth.largest < 1


def test_verdicts_are_what_time_integration_does(peer, speed, far_branch):
    """A small push dies out on one orbit and grows on the other by the leading multiplier,
    revolution by revolution.
    """
    k = far_branch.folds[0].after
    for orbit, grows in ((far_branch[k - 3], False), (far_branch[k + 4], True)):
        # start on the true periodic motion: the push is a difference of two runs
        options = {"speed": speed, "static_eccentricity": orbit.static_eccentricity,
                   "start": orbit, "revolutions": 3}
        calm = integrate(peer, RungeKutta(1e-11, 1e-16, 16), **options)
        pushed = integrate(peer, RungeKutta(1e-11, 1e-16, 16), disturbance=(1e-7, 5e-8), **options)
        gap = np.hypot(*(pushed.positions - calm.positions))[::16]
        assert (gap[-1] > 2 * gap[0]) == grows
        assert floquet(orbit).verdict == ("unstable" if grows else "stable")


# ------------------------------------------------------------------ words and refusals

def test_too_few_steps_and_modes_are_noticed(unit, speed):
    orbit = HarmonicBalance(8).solve(unit, speed, 0.1)
    (rough,) = floquet_all([orbit], modes=12, steps=8, quick=True)
    (fine,) = floquet_all([orbit], modes=12, steps=256, quick=True)
    assert fine.error < 1e-6 < rough.error
    assert apart(rough.multipliers, fine.multipliers[:4]) < 10 * rough.error


def test_it_prints_its_verdict(peer, speed):
    found = floquet(HarmonicBalance().solve(peer, speed, 0.05))
    # two pairs of one modulus: either may lead
    assert re.match(r"stable: leading multiplier -0\.(51913 ± 0\.66535|77609 ± 0\.33148) i, "
                    r"modulus 0\.84391, known to", str(found))
    assert str(found).endswith("none outside the unit circle, counted on the whole machine")
    assert str(floquet(HarmonicBalance().solve(peer, speed, 0.05), quick=True)).startswith(
        "stable at a quick look on a few modes: leading multiplier")
    assert found.kind == "Neimark–Sacker"


def test_steps_are_checked(peer, speed):
    with pytest.raises(BadInput, match="at least 8"):
        floquet(HarmonicBalance().solve(peer, speed), steps=4)


def test_a_machine_with_every_multiplier_twice_keeps_them_all():
    """Without field a disc on two equal springs is one damped oscillator, twice (by hand)."""
    model, speed = load_machine("jeffcott").model(), rpm(150)
    orbit = HarmonicBalance(harmonics=4).solve(model.with_field(0.0), speed)
    decay, square = model.C[0, 0] / (2 * model.M[0, 0]), model.K[0, 0] / model.M[0, 0]
    swing = np.sqrt(square - decay**2)
    by_hand = np.exp((-decay + 1j * swing) * 2 * np.pi / speed)
    found = floquet(orbit).multipliers
    assert len(found) == 4
    wanted = np.where(found.imag * by_hand.imag > 0, by_hand, by_hand.conj())
    assert np.abs(found - wanted).max() < 1e-9


@pytest.mark.parametrize("name", ["jeffcott", "kaplan-150rpm"])
def test_a_machine_without_damping_gets_a_verdict(name):
    """On the first leg nothing grows, on the second something does, by all degrees of freedom."""
    model = load_machine(name).model()
    model = replace(model, C=0 * model.C)
    method = Arclength(HarmonicBalance(8), max_folds=2)
    branch = follow(model, to=0.2, speed=rpm(150), method=method)
    value = branch.folds[0].value - 2e-3
    for orbit, verdict in zip(orbits_at(branch, value), ("stable", "unstable"), strict=False):
        truth, known = all_multipliers(orbit)
        assert (abs(truth[0]) < 1 + max(10 * known, 1e-6)) == (verdict == "stable")
        found = floquet(orbit)
        assert found.verdict == verdict
        assert found.growth > 0
        assert found.outside == np.sum(np.abs(truth) > 1 + 1e-4)
        assert "grow nor die out" in str(found)
