"""Tilted pull, pads, short film and crack: defining integrals, derivatives, energies, limits and
published formulas.
"""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from hydrolab.machine.bearings import Pads, ShortFilm
from hydrolab.machine.crack import BreathingCrack, crack_flexibility, stiffness_loss
from hydrolab.machine.elements import shaft_element
from hydrolab.machine.pull import Bulge, CircularPull, ShapedPull, TiltedPull, Wave, shaped_law
from tests.reference.potentials import potential

G0, HEIGHT = 0.011, 0.97
UPRIGHT = CircularPull(1.65e8, G0)
TILTED = TiltedPull(UPRIGHT, HEIGHT)
OVAL = TiltedPull(ShapedPull(1.65e8, G0, G0 * (1 + 0.1
                                               * np.cos(4 * np.pi * np.arange(128) / 128))), HEIGHT)
TURNING = TiltedPull(shaped_law(1.65e8, G0, (Bulge(2, 3e-4, 0.4),), (Bulge(3, 2e-4),),
                                (Wave(2, 1.0, 1.5, 0.3),)), HEIGHT)
PHASE = 0.8
PADS = Pads(stiffness=4e8, clearance=1.5e-4, count=8, angle=0.2, rounding=1e-5, reference=1.6e9)
FILM = ShortFilm(damping=2.3e7, clearance=2e-4, reference=3e8)
SPEED = 15.7
CRACK = BreathingCrack(loss=4e8, phase=0.4, rounding=1e-7)
LEANS = np.random.default_rng(1).uniform(-1, 1,
                                         (4, 7)) * np.array([0.3 * G0, 0.3 * G0, 0.5 * G0,
                                                             0.5 * G0])[:, None]


def differences(force, at, step):
    """Derivative of a force, (c, c, …), by central differences."""
    moves = step * np.eye(len(at)).reshape(len(at), len(at), *(1,) * (at.ndim - 1))
    return np.stack([(force(at + m) - force(at - m)) / (2 * step) for m in moves], axis=1)


leaning = pytest.mark.parametrize("law", [TILTED, OVAL, TURNING],
                                  ids=["circular", "oval", "poles and shapes"])


@leaning
def test_a_leaning_rotor_is_pulled_by_the_integral_over_its_height(law):
    for u in LEANS[:, :3].T:
        def at(s, i, u=u):
            return law.upright.force(u[:2] + s * u[2:], None, PHASE)[i]
        expected = [quad(lambda s, i=i, arm=arm: at(s, i) * s**arm, -HEIGHT / 2, HEIGHT / 2,
                         epsabs=0, epsrel=1e-12)[0]
                    / HEIGHT for arm in (0, 1) for i in (0, 1)]
        found = law.force(u, None, PHASE)
        assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()


@leaning
def test_slope_of_the_tilted_pull(law):
    phases = np.linspace(0, 4, LEANS.shape[1])
    force, slope, _ = law.linearise(LEANS, None, phases)
    assert force == pytest.approx(law.force(LEANS, None, phases), rel=1e-13)
    expected = differences(lambda u: law.force(u, None, phases), LEANS, 1e-7)
    assert np.abs(slope - expected).max() < 1e-7 * np.abs(slope).max()


def test_an_upright_rotor_feels_the_plain_pull():
    u = LEANS * np.array([1, 1, 0, 0])[:, None]
    assert TILTED.force(u)[:2] == pytest.approx(UPRIGHT.force(u[:2]), rel=1e-14)
    assert np.abs(TILTED.force(u)[2:]).max() < 1e-12 * np.abs(TILTED.force(u)[:2]).max()
    assert TILTED.smallest_gap(u) == pytest.approx(UPRIGHT.smallest_gap(u[:2]), rel=1e-14)


def test_a_small_lean_is_pulled_over_by_h_squared_over_twelve():
    _, slope, _ = TILTED.linearise(np.zeros(4))
    assert slope == pytest.approx(1.65e8 * np.diag([1, 1, HEIGHT**2 / 12, HEIGHT**2 / 12]),
                                  rel=1e-13, abs=1e-3)


def test_tilted_pull_comes_from_its_energy():
    gradient = np.stack([(potential(TILTED, LEANS + d) - potential(TILTED, LEANS - d)) / 2e-7
                         for d in 1e-7 * np.eye(4)[:, :, None]])
    assert np.abs(TILTED.force(LEANS) + gradient).max() < 1e-7 * np.abs(gradient).max()


@leaning
def test_the_smallest_gap_of_a_leaning_rotor_is_at_an_end(law):
    for u in LEANS.T:
        s = np.linspace(-HEIGHT / 2, HEIGHT / 2, 201)
        gaps = law.upright.smallest_gap(u[:2, None] + s * u[2:, None], PHASE)
        assert law.smallest_gap(u, PHASE) == pytest.approx(gaps.min(), rel=1e-12)


def test_the_angle_of_a_leaning_rotor_s_smallest_gap_is_that_of_its_nearer_end():
    for u in LEANS.T:
        ends = [u[:2] + s * u[2:] for s in (-HEIGHT / 2, HEIGHT / 2)]
        end = max(ends, key=np.linalg.norm)
        assert TILTED.gap_angle(u) == pytest.approx(math.atan2(*end), rel=1e-12)


def test_field_scales_the_tilted_pull_and_nothing_else():
    assert TILTED.scaled(0.25).force(LEANS) == pytest.approx(TILTED.force(LEANS) / 4, rel=1e-14)
    assert PADS.scaled(0.25) is PADS and FILM.scaled(0.25) is FILM and CRACK.scaled(0.25) is CRACK


MOVES = np.random.default_rng(2).uniform(-2.5e-4, 2.5e-4, (2, 9))


def test_slope_of_the_pads():
    force, slope, _ = PADS.linearise(MOVES)
    assert force == pytest.approx(PADS.force(MOVES), rel=1e-14)
    assert np.abs(slope - differences(PADS.force, MOVES, 1e-9)).max() < 1e-6 * np.abs(slope).max()


def test_pads_come_from_their_energy():
    gradient = np.stack([(potential(PADS, MOVES + d) - potential(PADS, MOVES - d)) / 2e-9
                         for d in 1e-9 * np.eye(2)[:, :, None]])
    assert np.abs(PADS.force(MOVES) + gradient).max() < 1e-6 * np.abs(gradient).max()


def test_a_sharp_pad_pushes_back_by_its_stiffness_times_what_is_pressed_in():
    sharp = Pads(4e8, 1.5e-4, 4, 0.0, 1e-12)
    assert sharp.force(np.array([0.0, 1.9e-4])) == pytest.approx([0, -4e8 * 0.4e-4], rel=1e-6,
                                                                 abs=1e-3)
    assert np.abs(sharp.force(np.array([0.5e-4, 1.0e-4]))).max() < 1e-5


def test_pads_under_preload_are_a_linear_bearing():
    tight = Pads(4e8, -5e-4, 8, 0.2, 1e-9, reference=1.6e9)
    assert tight.count * tight.stiffness / 2 == tight.reference
    assert np.abs(tight.force(MOVES)).max() < 1e-6 * 1.6e9 * np.abs(MOVES).max()


# The film: states with eccentricities up to 0.9 and velocities of either sign.
RANDOM = np.random.default_rng(3)
PLACES = FILM.clearance * np.linspace(0.05, 0.9,
                                      9) * np.array([np.sin(a := RANDOM.uniform(0, 7, 9)),
                                                     np.cos(a)])
RATES = RANDOM.uniform(-2e-3, 2e-3, (2, 9))


def test_film_is_the_integral_of_the_pressure_that_pushes():
    viscosity, radius, length, c = 0.03, 0.4, 0.25, FILM.clearance
    film = ShortFilm(viscosity * radius * (length / c) ** 3, c)
    for (x, z), (vx, vz) in zip(PLACES.T, RATES.T, strict=True):
        def film_force(phi, i, x=x, z=z, vx=vx, vz=vz):
            gap = c - x * math.sin(phi) - z * math.cos(phi)
            rise = -vx * math.sin(phi) - vz * math.cos(phi) + SPEED / 2 * (z * math.sin(phi) - x
                                                                           * math.cos(phi))
            # ∂/∂y (h³/(12 µ) ∂p/∂y) = ∂h/∂t + (Ω/2) ∂h/∂φ, with p = 0 at both ends, integrated over
            # y by Simpson's rule
            middle = -12 * viscosity * rise / gap**3 * length**2 / 8
            line = max(middle, 0.0) * length * 4 / 6
            return -line * radius * (math.sin, math.cos)[i](phi)
        turn = math.atan2(vx - SPEED / 2 * z, vz + SPEED / 2 * x)
        ends = [turn - math.pi / 2, turn + math.pi / 2]
        expected = [quad(film_force, *ends, args=(i,), epsabs=0, epsrel=1e-11, limit=200)[0]
                    for i in (0, 1)]
        whole = [quad(film_force, ends[1], ends[0] + 2 * math.pi, args=(i,))[0] for i in (0, 1)]
        assert np.abs(whole).max() == 0  # the other half bears nothing
        found = film.force(np.array([x, z]), np.array([vx, vz]), 0.0, SPEED)
        assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()


def test_derivatives_of_the_film():
    force, place, velocity = FILM.linearise(PLACES, RATES, 0.0, SPEED)
    assert force == pytest.approx(FILM.force(PLACES, RATES, 0.0, SPEED), rel=1e-14)
    by_place = differences(lambda u: FILM.force(u, RATES, 0.0, SPEED), PLACES, 1e-10)
    by_velocity = differences(lambda v: FILM.force(PLACES, v, 0.0, SPEED), RATES, 1e-8)
    assert (np.abs(place - by_place).max(axis=(0, 1)) < 2e-5 * np.abs(place).max(axis=(0, 1))).all()
    assert (np.abs(velocity - by_velocity).max(axis=(0, 1)) < 2e-6
            * np.abs(velocity).max(axis=(0, 1))).all()


def test_a_centred_film_is_a_linear_bearing():
    film = ShortFilm(FILM.damping, FILM.clearance)
    _, place, velocity = film.linearise(np.zeros(2), np.array([1e-9, 0.0]), 0.0, SPEED)
    assert velocity == pytest.approx(-math.pi / 2 * film.damping * np.eye(2), rel=1e-6)
    cross = math.pi / 4 * film.damping * SPEED
    assert place == pytest.approx(cross * np.array([[0, 1], [-1, 0]]), rel=1e-4, abs=1e-4 * cross)


def test_a_journal_that_whirls_at_half_the_speed_carries_no_load():
    film = ShortFilm(FILM.damping, FILM.clearance)
    x, z = PLACES
    assert np.abs(film.force(PLACES, SPEED / 2 * np.array([z, -x]), 0.0, SPEED)).max() < 1e-9


def test_steady_load_of_dubois_and_ocvirk():
    film, eccentricity = ShortFilm(FILM.damping, FILM.clearance), 0.6
    fx, fz = film.force(np.array([0.0, eccentricity * FILM.clearance]), np.zeros(2), 0.0, SPEED)
    load = FILM.damping * FILM.clearance * SPEED
    assert fz == pytest.approx(-load * eccentricity**2 / (1 - eccentricity**2) ** 2, rel=1e-12)
    assert abs(fx) == pytest.approx(load * math.pi / 4 * eccentricity
                                    / (1 - eccentricity**2) ** 1.5, rel=1e-12)


@pytest.mark.parametrize("eccentricity", [0.1, 0.4, 0.8])
def test_eight_coefficients_of_the_short_bearing(eccentricity):
    """Closed form in Friswell, Penny, Garvey and Lees (2010), section 5.5.1, in axes along the load
    and across it.
    """
    film, e2, pi2 = ShortFilm(FILM.damping, FILM.clearance), eccentricity**2, math.pi**2
    at = np.array([0.0, eccentricity * FILM.clearance])
    force, place, velocity = film.linearise(at, np.zeros(2), 0.0, SPEED)
    load = float(np.hypot(*force))
    along = -force / load  # the load the film carries pushes the other way
    across = np.array([-along[1], along[0]]) * math.copysign(1.0, along[0])
    axes = np.stack([across, along], axis=1)
    root = math.sqrt(1 - e2)
    h0 = 1 / (pi2 * (1 - e2) + 16 * e2) ** 1.5
    stiffness = load / film.clearance * h0 * np.array([
        [4 * (pi2 * (2 - e2) + 16 * e2), math.pi * (pi2 * (1 - e2) ** 2 - 16 * e2**2)
         / (eccentricity * root)],
        [-math.pi * (pi2 * (1 - e2) * (1 + 2 * e2) + 32 * e2 * (1 + e2)) / (eccentricity * root),
         4 * (pi2 * (1 + 2 * e2) + 32 * e2 * (1 + e2) / (1 - e2))]])
    damping = load / film.clearance / SPEED * h0 * np.array([
        [2 * math.pi * root * (pi2 * (1 + 2 * e2) - 16 * e2) / eccentricity,
         -8 * (pi2 * (1 + 2 * e2) - 16 * e2)],
        [-8 * (pi2 * (1 + 2 * e2) - 16 * e2),
         2 * math.pi * (pi2 * (1 - e2) ** 2 + 48 * e2) / (eccentricity * root)]])
    found = -axes.T @ place @ axes, -axes.T @ velocity @ axes
    for ours, theirs in zip(found, (stiffness, damping), strict=True):
        # the book's spin may turn the other way across the load
        mirrored = ours * np.array([[1, -1], [-1, 1]])
        error = min(np.abs(m - theirs).max() for m in (ours, mirrored))
        assert error < 1e-9 * np.abs(theirs).max()


TILTS = np.random.default_rng(4).uniform(-2e-5, 2e-5, (2, 8))
PHASES = np.linspace(0, 6, 8)


def test_slope_of_the_crack_at_any_phase():
    force, slope, damping = CRACK.linearise(TILTS, np.zeros_like(TILTS), PHASES, SPEED)
    assert force == pytest.approx(CRACK.force(TILTS, np.zeros_like(TILTS), PHASES, SPEED),
                                  rel=1e-14)
    by_place = differences(lambda u: CRACK.force(u, u, PHASES, SPEED), TILTS, 1e-10)
    assert np.abs(slope - by_place).max() < 1e-6 * np.abs(slope).max()
    assert damping is None


def test_a_crack_is_closed_on_the_pressed_side_and_a_slot_never_is():
    sharp = BreathingCrack(4e8, rounding=1e-14)
    slot = BreathingCrack(4e8, breathes=False)
    towards = 1e-5 * np.array([np.sin(PHASES), np.cos(PHASES)])
    nothing = np.zeros_like(towards)
    # A shaft whose slope grows towards the crack is pressed there (concave side); the other way it
    # is pulled.
    assert np.abs(sharp.force(towards, nothing, PHASES, SPEED)).max() < 1e-5
    assert sharp.force(-towards, nothing, PHASES, SPEED) == pytest.approx(-4e8 * towards,
                                                                             rel=1e-8)
    assert slot.force(towards, nothing, PHASES, SPEED) == pytest.approx(4e8 * towards, rel=1e-12)
    half = (sharp.force(TILTS, nothing, PHASES, SPEED) - sharp.force(-TILTS, nothing, PHASES,
                                                                           SPEED))
    assert half == pytest.approx(slot.force(TILTS, nothing, PHASES, SPEED), rel=1e-6, abs=1e-4)


def test_a_shallow_crack_is_as_flexible_as_an_edge_crack_in_a_plate():
    E, nu, R = 2e11, 0.3, 0.355
    depth = 1e-4
    a = 2 * R * depth
    # c → 32 (1 − ν²)/(π E R⁸) · 1.122² R² ∫ α²/2 dx with α = a − x²/(2R)
    expected = 32 * (1 - nu**2) / (math.pi * E * R**8) * 1.122**2 * R**2 * (16 / 15 * a**2
                                                                            * math.sqrt(2 * R
                                                                                        * a)) / 2
    assert crack_flexibility(depth, E, nu, R) == pytest.approx(expected, rel=2e-3)
    assert crack_flexibility(0.0, E, nu, R) == 0


@pytest.mark.parametrize("element", ["lalanne-ferraris", "timoshenko"])
def test_an_open_crack_adds_its_angle_to_a_cantilever(element):
    """Castigliano: a crack of flexibility c in the middle adds c M to the slope of the end and c P
    a² to its place.
    """
    E, nu, R, L = 2e11, 0.3, 0.355, 0.7
    rigidity, flexibility = E * math.pi / 4 * R**4, crack_flexibility(0.3, 2e11, 0.3, 0.355)
    _, _, K = shaft_element(element, L, E, 7850.0, math.pi * R**2, math.pi / 4 * R**4, nu, 0.9)
    bend = np.zeros(8)
    bend[3], bend[7] = 1.0, -1.0  # ∂x/∂y = −θz, lower end less upper end
    cracked = K - stiffness_loss(rigidity, L, flexibility) * np.outer(bend, bend)
    def added(load):
        return np.linalg.solve(cracked[4:, 4:], load) - np.linalg.solve(K[4:, 4:], load)

    moment, push = np.array([0, 0, 0, 1e6]), np.array([1e6, 0, 0, 0])
    assert added(moment)[3] == pytest.approx(flexibility * 1e6, rel=1e-9)
    assert added(push)[0] == pytest.approx(flexibility * 1e6 * (L / 2) ** 2, rel=1e-9)
