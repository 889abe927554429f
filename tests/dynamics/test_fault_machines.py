"""Tilted pull, pads, film and crack on a whole machine: harmonic balance and multipliers against
other methods.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hydrolab import (
    HarmonicBalance,
    Newmark,
    RungeKutta,
    floquet,
    follow,
    integrate,
    load_machine,
    reduce,
    rpm,
)
from hydrolab.dynamics.ensemble import split
from hydrolab.dynamics.stability import multipliers
from hydrolab.machine.bearings import JournalFilm, PadBearing
from hydrolab.machine.crack import Crack
from hydrolab.machine.gap_shape import GapShape
from tests.reference.full_balance import solve_full

SPEED, OFFSET = rpm(150), 0.04
UNIT = load_machine("kaplan-150rpm")
GUIDE, OTHERS = UNIT.bearings[0], UNIT.bearings[1:]
TILTED = replace(UNIT, air_gap=replace(UNIT.air_gap, tilt=True))
PADS = replace(UNIT, bearings=OTHERS, pad_bearings=(PadBearing("pads", GUIDE.node, 8, 1.37e9, 5e-5,
                                                               rounding=3e-5),))
FILM = replace(UNIT, bearings=OTHERS, films=(JournalFilm("film", GUIDE.node, 0.03, 0.4, 0.25,
                                                         1.5e-4),))
# beside the linear bearing
THIN = replace(UNIT, films=(JournalFilm("film", GUIDE.node, 0.01, 0.4, 0.25, 4e-4),))
CRACKED = replace(UNIT, cracks=(Crack("crack", 1, 0.2, phase=0.7, rounding_angle=3e-6),))
SEVERAL = replace(PADS, cracks=CRACKED.cracks, shapes=(GapShape("oval", "stator", 2, 4e-4),))
SLOT = replace(UNIT, cracks=(Crack("slot", 1, 0.2, phase=0.7, breathing="open"),))


@pytest.mark.parametrize(("machine", "harmonics", "tolerance"), [
    (TILTED, 10, 1e-6), (PADS, 32, 2e-6), (CRACKED, 24, 2e-5), (THIN, 16, 1e-6),
    (SEVERAL, 24, 3e-5)],
    ids=["tilted", "pads", "cracked", "film", "pads, crack and oval stator"])
def test_an_orbit_is_kept_in_time(machine, harmonics, tolerance):
    model = machine.model()
    orbit = HarmonicBalance(harmonics).solve(model, SPEED, OFFSET)
    motion = integrate(model, RungeKutta(1e-9, 1e-12), speed=SPEED, static_eccentricity=OFFSET,
                       revolutions=1, start=orbit)
    away = np.abs(motion.coefficients(4) - orbit.coefficients[:, :9]).max()
    assert away < tolerance * np.abs(orbit.coefficients[:, 1:]).max()


def test_newmark_comes_to_the_film_s_orbit_with_the_square_of_its_step():
    model = reduce(FILM.model(), 4)
    orbit = HarmonicBalance(16).solve(model, SPEED, OFFSET)
    away = [np.abs(integrate(model, Newmark(n), speed=SPEED, static_eccentricity=OFFSET,
                             revolutions=1, start=orbit,
                             modes=None).coefficients(4) - orbit.coefficients[:, :9]).max()
            for n in (256, 512, 1024)]
    assert [away[0] / away[1], away[1] / away[2]] == pytest.approx([4, 4], rel=0.1)
    assert away[2] < 1e-5 * np.abs(orbit.coefficients[:, 1:]).max()


@pytest.mark.parametrize("machine", [TILTED, FILM, CRACKED], ids=["tilted", "film", "cracked"])
def test_all_dofs_at_once_give_the_same_orbit(machine):
    model = machine.model()
    orbit = HarmonicBalance(4, samples=64).solve(model, SPEED, 0.02)
    full = solve_full(model, SPEED, 0.02)
    assert np.abs(full - orbit.shaft).max() < 1e-8 * np.abs(full).max()


def test_multipliers_of_a_film_are_those_of_its_linear_equations_in_time():
    model = THIN.model()
    orbit = HarmonicBalance(10).solve(model, SPEED, OFFSET)
    system = split(model, SPEED, 2)
    found, known = multipliers(system, orbit.local[None], orbit.centre[None], 32)
    small, r = system.model, system.model.size
    turn = SPEED * np.arange(1, orbit.harmonics + 1)
    inverse = np.linalg.inv(small.M)

    def rate(t, s):
        s = s.reshape(2 * r, -1)
        sine, cosine = np.sin(turn * t), np.cos(turn * t)
        u = orbit.local[:, 0] + orbit.local[:, 1::2] @ sine + orbit.local[:, 2::2] @ cosine
        v = orbit.local[:, 1::2] @ (turn * cosine) - orbit.local[:, 2::2] @ (turn * sine)
        _, slope, damping = small.law.linearise(small.relative(u, orbit.centre), v, SPEED * t,
                                                SPEED)
        S = small.selection
        force = S.T @ (slope @ S @ s[:r] + damping @ S
                       @ s[r:]) - small.K @ s[:r] - small.velocity_matrix(SPEED) @ s[r:]
        return np.vstack([s[r:], inverse @ force]).ravel()

    end = solve_ivp(rate, (0, 2 * np.pi / SPEED), np.eye(2 * r).ravel(), method="DOP853",
                    rtol=1e-8, atol=1e-10)
    true = np.linalg.eigvals(end.y[:, -1].reshape(2 * r, 2 * r))
    assert known[0] < 1e-5
    assert max(np.abs(true - mu).min() for mu in found[0] if abs(mu) > 0.3) < 1e-5


def turning_frame(model, crack_loss, phase):
    """Matrices (velocity, stiffness) of a slotted, otherwise isotropic machine seen from axes that
    turn with it.
    """
    J = np.kron(np.eye(model.size // 2), [[0, 1], [-1, 0]])  # from z to x
    towards = np.array([np.sin(phase), np.cos(phase)]) @ model.selection[2:]
    velocity = model.velocity_matrix(SPEED)
    return (velocity + 2 * SPEED * model.M @ J,
            model.K - SPEED**2 * model.M + SPEED * velocity @ J - crack_loss * np.outer(towards,
                                                                                        towards))


def test_a_slot_is_an_asymmetric_shaft_which_has_constant_coefficients_where_it_turns():
    model = SLOT.model().with_field(0.0)
    velocity, stiffness = turning_frame(model, model.law.parts[1].law.loss, 0.7)
    orbit = HarmonicBalance(3).solve(model, SPEED)
    # unbalance at phase 0 of the turning axes
    still = np.linalg.solve(stiffness, SPEED**2 * model.unbalance_cos)
    assert orbit.shaft[:, 2] == pytest.approx(still, rel=1e-8, abs=1e-10 * np.abs(still).max())
    assert np.abs(orbit.shaft[:, [0, 3, 4, 5, 6]]).max() < 1e-12 * np.abs(still).max()
    n, inverse = model.size, np.linalg.inv(model.M)
    rates = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)],
                                        [-inverse @ stiffness, -inverse @ velocity]]))
    exact = np.exp(rates * 2 * np.pi / SPEED)
    found = floquet(orbit, modes=16)
    assert found.verdict == "stable"
    assert max(np.abs(exact - mu).min() for mu in found.multipliers if abs(mu) > 0.5) < 1e-5


def test_without_a_side_load_a_crack_of_a_vertical_machine_does_not_breathe():
    orbit = HarmonicBalance(8).solve(CRACKED.model().with_field(0.0), SPEED, OFFSET)
    assert orbit.amplitudes[:, 1:].max() < 1e-6 * orbit.amplitudes[:, 0].min()
    with_field = HarmonicBalance(8).solve(CRACKED.model(), SPEED, OFFSET)
    assert with_field.amplitudes[:, 1].min() > 0.1 * with_field.amplitudes[:, 0].min()


@pytest.mark.parametrize("machine", [replace(CRACKED, cracks=(Crack("crack", 1, 0.0),)),
                                     replace(UNIT, bearings=OTHERS, pad_bearings=(PadBearing(
                                         "pads", GUIDE.node, 8, GUIDE.stiffness[0, 0] / 4, -0.01,
                                         rounding=1e-7),)),
                                     replace(THIN,
                                             films=(replace(THIN.films[0], viscosity=1e-9),))],
                         ids=["no depth", "preload", "no viscosity"])
def test_without_the_fault_the_orbit_is_the_plain_one(machine):
    plain = HarmonicBalance(6).solve(UNIT.model(), SPEED, OFFSET)
    orbit = HarmonicBalance(6).solve(machine.model(), SPEED, OFFSET)
    assert np.abs(orbit.coefficients
                  - plain.coefficients).max() < 1e-8 * np.abs(plain.coefficients).max()


def test_a_flat_rotor_does_not_feel_its_tilt():
    flat = replace(UNIT, air_gap=replace(UNIT.air_gap, tilt=True, length=1e-4,
                                         field=0.5 * np.sqrt(0.97 / 1e-4)))
    plain = HarmonicBalance(6).solve(UNIT.model(), SPEED, OFFSET)
    orbit = HarmonicBalance(6).solve(flat.model(), SPEED, OFFSET)
    assert np.abs(orbit.coefficients
                  - plain.coefficients).max() < 1e-6 * np.abs(plain.coefficients).max()


def test_smallest_gap_of_a_leaning_rotor():
    orbit = HarmonicBalance(6).solve(TILTED.model(), SPEED, OFFSET)
    u = TILTED.model().relative(orbit.coordinates(np.linspace(0, 2 * np.pi, 721)),
                                orbit.centre[:, None])
    ends = [TILTED.air_gap.gap - np.hypot(*(u[:2] + s * u[2:])) for s in (-0.485, 0.485)]
    assert orbit.smallest_gap == pytest.approx(np.min(ends), rel=1e-6)
    assert orbit.smallest_gap < TILTED.air_gap.gap - np.hypot(*u[:2]).max() - 1e-5


@pytest.mark.parametrize("machine", [FILM, CRACKED], ids=["film", "cracked"])
def test_branches_along_the_speed(machine):
    """The film's force knows the speed, so its slope along the branch does too."""
    model = machine.model()
    branch = follow(model, "speed", speed=SPEED, to=0.9 * SPEED, static_eccentricity=0.02)
    there = HarmonicBalance().solve(model, float(branch.values[-1]), 0.02)
    assert np.abs(there.local - branch[-1].local).max() < 1e-7 * np.abs(there.local).max()
    system, scaled = branch.path.system(), branch.values[-1] / branch.path.scale
    y, h = branch.unknowns[-1], 1e-5 * scaled
    difference = (system(y, scaled + h)[0] - system(y, scaled - h)[0]) / (2 * h)
    slope = system(y, scaled)[2]()
    assert np.abs(difference - slope).max() < 1e-5 * np.abs(slope).max()
