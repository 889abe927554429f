"""Several laws at several nodes, laws of velocity and phase, and periods of several revolutions,
against other methods.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hydrolab import (
    BadInput,
    CentralDifference,
    HarmonicBalance,
    Newmark,
    RungeKutta,
    basins,
    floquet,
    follow,
    integrate,
)
from hydrolab.machine.pull import ForceLaw, Placed, SeveralLaws
from tests.reference.full_balance import solve_full


@dataclass(frozen=True)
class Film(ForceLaw):
    """A cubic spring and a damper that grows with the square of the displacement, stirred at a
    multiple of the rotation.
    """

    spring: float
    damper: float
    stirring: float = 0.0
    order: float = 2.0
    moving, magnetic, gap = True, False, np.inf

    def linearise(self, e, velocity=None, phase=0.0, speed=0.0):
        square = (e * e).sum(axis=0)
        one = np.eye(2).reshape(2, 2, *(1,) * (e.ndim - 1))
        stir = self.stirring * np.cos(self.order * phase + 0 * square)
        force = (-self.spring * square * e - self.damper * square * velocity
                 + stir * np.stack([e[1], e[0]]))
        slope = -self.spring * (square * one + 2 * e[:, None]
                                * e) - 2 * self.damper * velocity[:, None] * e
        slope[0, 1] += stir
        slope[1, 0] += stir
        return force, slope, -self.damper * square * one * np.ones_like(slope)


def with_film(model, node, film):
    """The model with a film at a shaft node beside its pull."""
    rows = np.eye(model.size)[4 * node:4 * node + 2]
    laws = SeveralLaws((Placed(model.law, slice(0, 2)), Placed(film, slice(2, 4))))
    return replace(model, selection=np.vstack([model.selection, rows]), law=laws)


@pytest.fixture(scope="module")
def machine(unit):
    """The trial unit with a strong film half way down its shaft, stirred twice a revolution."""
    return with_film(unit, 4, Film(1e14, 1e12, stirring=1e7))


def test_jacobian_of_the_balance(machine, speed):
    eq = HarmonicBalance(5).equations(machine, speed)
    rng = np.random.default_rng(1)
    y, centre = 0.02 * rng.standard_normal(4 * 11), machine.centre(0.05)
    slope = eq.linearise(y, centre)[1]
    for j in range(len(y)):
        h = 1e-5 * np.eye(len(y))[j]
        difference = (eq.residual(y + h, centre) - eq.residual(y - h, centre)) / 2e-5
        assert np.abs(difference - slope[:, j]).max() < 1e-6 * np.abs(slope).max()


def test_the_film_matters(machine, unit, speed):
    plain, filmed = (HarmonicBalance(6).solve(m, speed, 0.05) for m in (unit, machine))
    assert np.abs(plain.coefficients - filmed.coefficients[:, :13]).max() > 1e-5


def test_all_dofs(machine, speed):
    """The twin without elimination, 52 DOFs."""
    orbit = HarmonicBalance(4, samples=64).solve(machine, speed, 0.05)
    full = solve_full(machine, speed, 0.05)
    assert np.abs(machine.selection @ full - orbit.local).max() < 1e-10 * np.abs(full).max()
    assert np.abs(full - orbit.shaft).max() < 1e-10 * np.abs(full).max()


@pytest.mark.parametrize(("method", "tolerance"), [(RungeKutta(1e-11), 3e-6), (Newmark(1024), 2e-3),
                                                   (CentralDifference(1024), 2e-3)],
                         ids=["dop853", "newmark", "central"])
def test_in_time(machine, speed, method, tolerance):
    orbit = HarmonicBalance(12).solve(machine, speed, 0.05)
    motion = integrate(machine, method, speed=speed, static_eccentricity=0.05, revolutions=6,
                       start=orbit)
    away = np.abs(motion.coefficients(4) - orbit.coefficients[:, :9]).max()
    assert away < tolerance * np.abs(orbit.coefficients[:, 1:]).max()


@pytest.mark.parametrize("method", [Newmark, CentralDifference])
def test_second_order_with_velocities(machine, speed, method):
    exact = integrate(machine, RungeKutta(1e-12), speed=speed, static_eccentricity=0.05,
                      revolutions=1, modes=4)
    errors = [np.abs(integrate(machine, method(n), speed=speed, static_eccentricity=0.05,
                               revolutions=1,
                               modes=4).positions[:, -1] - exact.positions[:, -1]).max()
              for n in (256, 512, 1024)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.15)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.15)


def test_multipliers(machine, speed):
    """Against the variational equations of the same reduced machine by DOP853."""
    from hydrolab.dynamics.ensemble import split
    from hydrolab.dynamics.stability import multipliers

    orbit = HarmonicBalance(10).solve(machine, speed, 0.05)
    small = split(machine, speed, 3)
    found, _ = multipliers(small, orbit.local[None], orbit.centre[None], 128)
    model, r = small.model, small.model.size
    turn = speed * np.arange(1, orbit.harmonics + 1)

    def rate(t, s):
        s = s.reshape(2 * r, -1)
        sine, cosine = np.sin(turn * t), np.cos(turn * t)
        u = orbit.local[:, 0] + orbit.local[:, 1::2] @ sine + orbit.local[:, 2::2] @ cosine
        v = orbit.local[:, 1::2] @ (turn * cosine) - orbit.local[:, 2::2] @ (turn * sine)
        u[:2] -= orbit.centre
        _, slope, damping = model.law.linearise(u, v, speed * t, speed)
        S = model.selection
        force = S.T @ (slope @ S @ s[:r] + damping @ S
                       @ s[r:]) - model.K @ s[:r] - model.velocity_matrix(speed) @ s[r:]
        return np.vstack([s[r:], np.linalg.solve(model.M, force)]).ravel()

    period = 2 * np.pi / speed
    end = solve_ivp(rate, (0, period), np.eye(2 * r).ravel(), method="DOP853", rtol=1e-10,
                    atol=1e-10)
    true = np.linalg.eigvals(end.y[:, -1].reshape(2 * r, 2 * r))
    assert np.abs(found[0]).max() == pytest.approx(np.abs(true).max(), rel=1e-6)
    assert max(np.abs(true - mu).min() for mu in found[0] if abs(mu) > 0.5) < 1e-6
    assert floquet(orbit).verdict == "stable"


def test_a_branch_with_two_laws(machine, speed):
    branch = follow(machine, speed=speed, to=0.06)
    for orbit in branch:
        eq = orbit.equations
        assert np.abs(eq.residual(orbit.local.ravel() / eq.length, orbit.centre)).max() < 1e-8
    by_speed = follow(machine, "speed", speed=speed, to=1.05 * speed, static_eccentricity=0.05)
    there = HarmonicBalance().solve(machine, float(by_speed.values[-1]), 0.05)
    assert np.abs(there.local - by_speed[-1].local).max() < 1e-9


@pytest.mark.parametrize("parameter", ["speed", "field", "unbalance"])
def test_slopes_of_paths(machine, speed, parameter):
    from hydrolab.dynamics.paths import path

    along = path(machine, parameter, HarmonicBalance(5), speed, 0.05, np.pi / 2)
    system, scaled = along.system(), along.first / along.scale
    y = HarmonicBalance(5).solve(machine, speed, 0.05).local.ravel() / machine.gap
    slope, h = system(y, scaled)[2](), 1e-3 * scaled
    near, far = (system(y, scaled + k * h)[0] - system(y, scaled - k * h)[0] for k in (1, 2))
    difference = (8 * near - far) / (12 * h)  # of fourth order
    assert np.abs(difference - slope).max() < 1e-6 * np.abs(slope).max()


def test_only_the_pull_goes_with_the_field(machine):
    e, v = np.full((4, 3), 1e-4), np.full((4, 3), 1e-3)
    dark = machine.with_field(0).law
    assert np.abs(dark.force(e, v, 0.0, 10.0)[:2]).max() == 0
    assert np.array_equal(dark.force(e, v, 0.0, 10.0)[2:],
                          machine.law.force(e, v, 0.0, 10.0)[2:])


def test_many_motions_at_once(machine, speed):
    orbit = HarmonicBalance(8).solve(machine, speed, 0.05)
    found = basins([orbit], [0.0, 1e-5], [0.0], revolutions=2)
    assert (found.ends == 0).all()


# ------------------------------------------------------------------ periods of several revolutions

def test_the_same_orbit_in_a_longer_period(unit, speed):
    one = HarmonicBalance(4).solve(unit, speed, 0.08)
    two = HarmonicBalance(8, samples=128, revolutions=2).solve(unit, speed, 0.08)
    phase = np.linspace(0, 4 * np.pi, 50)
    assert np.abs(two.positions(phase) - one.positions(phase)).max() < 1e-12
    assert np.abs(two.velocities(phase) - one.velocities(phase)).max() < 1e-10
    assert "2 revolutions" in str(two) and "0.5X" in str(two)
    assert two.smallest_gap == pytest.approx(one.smallest_gap, rel=1e-6)
    squares, twice = floquet(one), floquet(two)
    sizes = (np.sort(np.abs(found.multipliers[:4])) for found in (twice, squares))
    assert next(sizes) == pytest.approx(next(sizes) ** 2, rel=1e-4)


def test_a_force_between_the_harmonics(unit, speed):
    """Stirred at 3/2 of the rotation: the motion repeats every two revolutions."""
    machine = with_film(unit, 4, Film(1e14, 1e12, stirring=1e7, order=1.5))
    orbit = HarmonicBalance(16, revolutions=2).solve(machine, speed, 0.05)
    assert orbit.amplitudes[0, 0] > 1e-7
    full = solve_full(machine, speed, 0.05, harmonics=6, revolutions=2)
    six = HarmonicBalance(6, samples=64, revolutions=2).solve(machine, speed, 0.05)
    assert np.abs(full - six.shaft).max() < 1e-10 * np.abs(full).max()
    motion = integrate(machine, RungeKutta(1e-11), speed=speed, static_eccentricity=0.05,
                       revolutions=4, start=orbit)
    assert np.abs(motion.positions[:, -1] - orbit.positions([8 * np.pi])[:, 0]).max() < 1e-9
    again = HarmonicBalance(20, revolutions=2).solve(machine, speed, 0.05, start=orbit)
    assert np.abs(again.local[:, :33] - orbit.local).max() < 1e-9


@pytest.mark.parametrize("revolutions", [0, 5, 1.0, True])
def test_revolutions_are_checked(revolutions):
    with pytest.raises(BadInput, match="revolutions is"):
        HarmonicBalance(4, revolutions=revolutions)
