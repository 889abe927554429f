"""Pole pairs, waves, shapes and a tangential pull: against their integrals, differences and limits.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from hydrolab.errors import BadInput
from hydrolab.machine.gap_shape import Bulge, gap_law, gap_shapes, selection_rule
from hydrolab.machine.parts import MU_0, AirGap
from hydrolab.machine.pole_pairs import (
    PolePairPull,
    Poles,
    truncated_size,
    whole_size,
)
from hydrolab.machine.pull import CircularPull, ShapedPull, TangentialPull, Wave, shaped_law
from tests.reference.potentials import potential

AIR = AirGap("rotor", 0.5, 0.25, 1.0, 0.005)
K, G0 = AIR.pull_stiffness, AIR.gap
ROUND = CircularPull(K, G0)
PHASES = np.linspace(0.1, 5.0, 12)
STILL = np.zeros((2, 12))
LAWS = {
    **{f"p={p}": PolePairPull(K, G0, p, p, 0.3) for p in (1, 2, 3, 4)},
    **{f"series p={p}": PolePairPull(K, G0, p, p, 0.3, truncated=True) for p in (1, 2, 3, 4)},
    "slip and imbalance": PolePairPull(K, G0, 1, 1.25, 0.3, 0.4, 0.7),
    "loaded": shaped_law(K, G0, waves=Poles(1, stator_mmf=0.8, load_angle=2.0).waves()),
    "several orders": shaped_law(K, G0, waves=(Wave(1, 1.0, 1.0), Wave(3, 0.2, 3.0, 0.5),
                                               Wave(2, 0.1, -1.5, 1.0))),
    "shapes": shaped_law(K, G0, (Bulge(2, 0.3e-3, 0.4), Bulge(3, 0.2e-3)),
                         (Bulge(2, 0.1e-3), Bulge(4, 0.3e-3, 1.0))),
}
ids = list(LAWS)


def positions(largest=0.6, count=12, seed=0):
    random = np.random.default_rng(seed)
    radius, angle = G0 * np.linspace(0.02, largest, count), random.uniform(0, 2 * np.pi, count)
    return radius * np.array([np.sin(angle), np.cos(angle)])


def stress_integral(e, field, gap=lambda phi: G0):
    """Maxwell's stress B²/2µ0 over the rotor, with B the peak-valued field over the true gap: what
    defines the force.
    """
    def part(phi, wave):
        here = gap(phi) - e[0] * math.sin(phi) - e[1] * math.cos(phi)
        return wave(phi) * (field(phi) * G0 / here) ** 2
    scale = AIR.mean_radius * AIR.length / (2 * MU_0)
    return np.array([scale * quad(part, 0, 2 * math.pi, args=(wave,), epsabs=1e-13, epsrel=1e-12,
                                  limit=400)[0]
                     for wave in (math.sin, math.cos)])


@pytest.mark.parametrize("name", ids)
def test_derivatives(name):
    law, e, h = LAWS[name], positions(), 1e-5 * G0
    force, slope, damping = law.linearise(e, STILL, PHASES, 10.0)
    assert force == pytest.approx(law.force(e, STILL, PHASES, 10.0), rel=1e-14)
    for j in (0, 1):
        step = h * np.eye(2)[:, j, None]
        difference = (law.force(e + step, STILL, PHASES, 10.0) - law.force(e - step, STILL,
                                                                                 PHASES,
                                                                                 10.0)) / (2 * h)
        assert np.abs(slope[:, j] - difference).max() < 1e-7 * np.abs(slope).max()
    faster = law.force(e, STILL + 3.0, PHASES, 10.0)
    # no velocity in these laws, and none in their slope
    assert np.array_equal(faster, force) and damping is None


@pytest.mark.parametrize("name", [n for n in ids if "series" not in n])
def test_potential_at_a_fixed_phase(name):
    law, h = LAWS[name], 1e-5 * G0
    e = positions()
    for j in (0, 1):
        step = h * np.eye(2)[:, j, None]
        fall = (potential(law, e - step, PHASES) - potential(law, e + step, PHASES)) / (2 * h)
        assert np.abs(law.force(e, STILL, PHASES, 1.0)[j] - fall).max() < 1e-7 * K * G0


@pytest.mark.parametrize("p", [1, 2, 3, 4, 24])
def test_closed_form_is_the_integral_of_the_stress(p):
    law, peak = PolePairPull(K, G0, p, p, 0.3), math.sqrt(2) * AIR.field
    for e, phase in zip(positions(0.8, 4).T, (0.2, 1.0, 2.0, 4.0), strict=True):
        expected = stress_integral(e, lambda phi, t=phase: peak * math.cos(p * (phi - t) - 0.3))
        assert law.force(e, e, phase, 1.0) == pytest.approx(expected, rel=1e-9,
                                                               abs=1e-9 * K * G0)


def test_imbalance_against_the_integral():
    law, peak, e = LAWS["slip and imbalance"], math.sqrt(2) * AIR.field, np.array([0.3, -0.4]) * G0
    for phase in (0.0, 1.3, 3.0):
        turn = 1.25 * phase + 0.3
        expected = stress_integral(e, lambda phi,
                                   a=turn: peak
                                   * (math.cos(phi - a) + 0.4 * math.cos(phi + a + 0.7)))
        assert law.force(e, e, phase, 1.0) == pytest.approx(expected, rel=1e-10)


def test_waves_against_the_integral():
    law, peak, e, phase = LAWS["several orders"], math.sqrt(2) * AIR.field, np.array([0.5,
                                                                                   0.3]) * G0, 0.8
    expected = stress_integral(e, lambda phi: peak * float(law.field(np.array([phi]), phase)[0]))
    assert law.force(e, e, phase, 1.0) == pytest.approx(expected, rel=1e-10)


def test_shapes_against_the_integral():
    law, e, phase = LAWS["shapes"], np.array([0.2, -0.3]) * G0, 0.8

    def gap(phi):
        return (G0 + 0.3e-3 * math.cos(2 * (phi - 0.4)) + 0.2e-3 * math.cos(3 * phi)
                - 0.1e-3 * math.cos(2 * (phi - phase)) - 0.3e-3 * math.cos(4 * (phi - phase - 1.0)))

    expected = stress_integral(e, lambda phi: AIR.field, gap)
    assert law.force(e, e, phase, 1.0) == pytest.approx(expected, rel=1e-10)


def test_poles_turn_in_an_oval_stator():
    """Every part of the quadrature at once, against the integral of Maxwell's stress."""
    poles = Poles(2, 1.8, 0.4, backward=0.2, backward_angle=0.9, stator_mmf=0.5, load_angle=1.1)
    shapes = gap_shapes("stator", [Bulge(2, 0.4e-3, 0.4)]) + gap_shapes("rotor", [Bulge(3, 0.2e-3)])
    e, phase = np.array([0.2, -0.3]) * G0, 0.8
    theta = 1.8 * phase + 0.4

    def gap(phi):
        return (G0 + 0.4e-3 * math.cos(2 * (phi - 0.4)) - 0.2e-3 * math.cos(3 * (phi - phase)))

    def field(phi):
        return math.sqrt(2) * AIR.field * (math.cos(2 * phi - theta)
                                        + 0.5 * math.cos(2 * phi - theta + 1.1)
                                        + 0.2 * math.cos(2 * phi + theta + 0.9))

    law = gap_law(K, G0, poles, shapes)
    assert law.force(e, e, phase, 1.0) == pytest.approx(stress_integral(e, field, gap), rel=1e-10)
    only_backward = replace(poles, stator_mmf=0.0)
    closed, whole = (gap_law(K, G0, only_backward, shape) for shape in ((), gap_shapes("stator", [
        Bulge(2, 0.0)])))
    assert whole.force(positions(), STILL, PHASES) == pytest.approx(
        closed.force(positions(), STILL, PHASES), rel=1e-11)


def test_one_wave_by_quadrature_is_the_closed_form():
    e = positions(0.85)
    for p in (1, 2, 5):
        force, slope, _ = PolePairPull(K, G0, p, 1.5, 0.3).linearise(e, STILL, PHASES, 1.0)
        wave, its_slope, _ = shaped_law(K, G0, waves=(Wave(p, 1.0, 1.5, 0.3),)).linearise(
            e, STILL, PHASES, 1.0)
        assert np.abs(wave - force).max() < 1e-12 * np.abs(force).max()
        assert np.abs(its_slope - slope).max() < 1e-11 * np.abs(slope).max()


def test_two_waves_of_one_order_are_one_wave():
    """Rotor and stator waves add as phasors: 1 + s e^{−iδ}."""
    share, load = 0.8, 2.0
    total = 1 + share * np.exp(-1j * load)
    one = PolePairPull(K * abs(total) ** 2, G0, 1, 1.0, float(np.angle(total)))
    e = positions()
    assert LAWS["loaded"].force(e, STILL, PHASES,
                                   1.0) == pytest.approx(one.force(e, STILL, PHASES, 1.0),
                                                         rel=1e-11)


# ------------------------------------------------------------------ limits

@pytest.mark.parametrize("p", [1, 2, 3, 24])
def test_the_mean_over_the_phase_is_the_plain_pull(p):
    """The plain law takes the rms field, which is what the mean over the phases of a turning wave
    leaves.
    """
    phases = 2 * np.pi * np.arange(8) / 8
    e = positions(0.8)[:, :, None]
    law = PolePairPull(K, G0, p, 1.0)
    mean = law.force(e, 0 * e, phases, 1.0).mean(axis=-1)
    assert mean == pytest.approx(ROUND.force(e[..., 0]), rel=1e-12)


def test_many_poles_leave_the_plain_pull():
    e = positions(0.5)
    law = PolePairPull(K, G0, 24, 24.0)
    assert law.force(e, STILL, PHASES, 1.0) == pytest.approx(ROUND.force(e), rel=1e-12)


@pytest.mark.parametrize("p", [1, 2, 3, 4])
def test_the_beat_grows_with_the_power_2p_minus_1(p):
    """A fit over eccentricities of 2 to 8 %; the force that does not turn is taken away by its
    closed form.
    """
    eps = np.geomspace(0.02, 0.08, 12)
    phases = 2 * np.pi * np.arange(16) / 16
    e = eps[:, None] * G0 * np.array([0.6, 0.8])[:, None, None] * np.ones(16)
    wave = shaped_law(K, G0, waves=(Wave(p, 1.0, 1.0),)).force(e, 0 * e, phases, 1.0)
    beat = np.hypot(*(wave - ROUND.force(e))).max(axis=-1)
    slope = np.polyfit(np.log(eps), np.log(beat), 1)[0]
    assert slope == pytest.approx(2 * p - 1, abs=0.02)


def test_small_displacement_of_two_poles():
    """K(t) = −k (I + ½ [rotation by 2θ]): the stiffness that turns at twice the electrical
    frequency.
    """
    law = PolePairPull(K, G0, 1, 1.0)
    for phase in (0.0, 0.4, 2.0):
        slope = law.linearise(np.zeros(2), np.zeros(2), phase, 1.0)[1]
        c, s = math.cos(2 * phase), math.sin(2 * phase)
        assert slope == pytest.approx(K * (np.eye(2) + 0.5 * np.array([[-c, s], [s, c]])),
                                      rel=1e-12)  # (x, z)


def test_rms_and_peak_field_are_kept_apart():
    peak = math.sqrt(2) * AIR.field
    by_peak = math.pi * peak**2 * AIR.mean_radius * AIR.length / (2 * MU_0 * AIR.gap)
    assert by_peak == pytest.approx(K, rel=1e-12)
    by_mistake = AirGap("rotor", peak, AIR.mean_radius, AIR.length, AIR.gap).pull_stiffness
    assert by_mistake == pytest.approx(2 * K, rel=1e-12)


def whole_moment(n):
    """(1/2π) ∮ cos nφ/(1 − ε cos φ)² dφ by the residue at its pole, and ρⁿ (1 + n w)/w³: SymPy,
    (residue, closed form, ε).

    Half of it over εⁿ is a_n.
    """
    import sympy as sp

    eps = sp.symbols("epsilon", positive=True)
    w, z = sp.sqrt(1 - eps**2), sp.symbols("z")
    inside, outside = (1 - w) / eps, (1 + w) / eps
    residue = sp.diff(4 * z ** (n + 1) / (eps**2 * (z - outside) ** 2), z).subs(z, inside)
    return residue, inside**n * (1 + n * w) / w**3, eps


@pytest.mark.parametrize("n", [1, 3, 5])
def test_sympy_derives_the_whole_moments(n):
    residue, closed, eps = whole_moment(n)
    for value in (0.1, 0.5, 0.8):
        integral = quad(lambda phi, v=value: math.cos(n * phi) / (1 - v * math.cos(phi)) ** 2, 0,
                        2 * math.pi,
                        epsabs=1e-13)[0] / (2 * math.pi)
        assert float(residue.subs(eps, value)) == pytest.approx(integral, rel=1e-8)
        assert float(closed.subs(eps, value)) == pytest.approx(integral, rel=1e-8)
        assert whole_size(np.sqrt(1 - value**2), n)[0] * value**n == pytest.approx(integral / 2,
                                                                                   rel=1e-8)


def test_what_the_series_to_third_order_misses():
    """Sizes from the permeance that Guo, Chu and Chen (2002) cut after its third order, and the
    fifth, of which the cut series keeps a third.
    """
    for eps, f1, f3, f4 in ((0.1, 1 - 1.6e-8, 0.00251, 3.2e-6), (0.5, 0.99963, 0.0667, 2.4e-3),
                            (0.7, 0.9954, 0.1396, 1.2e-2)):
        w = np.sqrt(1 - eps**2)
        first, third, fifth = (truncated_size(w, n)[0] * eps**n for n in (1, 3, 5))
        assert 2 * first / (eps / w**3) == pytest.approx(f1, abs=1e-4)
        assert third / (2 * first) == pytest.approx(f3, rel=0.01)
        assert fifth / (2 * first) == pytest.approx(f4, rel=0.05)
    near = np.sqrt(1 - 1e-6)
    assert truncated_size(near, 5)[0] / whole_size(near, 5)[0] == pytest.approx(1 / 3, rel=1e-5)
    assert truncated_size(near, 3)[0] / whole_size(near, 3)[0] == pytest.approx(1, rel=1e-5)


# ------------------------------------------------------------------ shapes

@pytest.mark.parametrize("stator", [Bulge(2, 2e-5, 0.3), Bulge(4, 2e-5, -0.9),
                                    Bulge(3, -2e-5, 1.1)])
@pytest.mark.parametrize("rotor", [Bulge(3, 3e-5, 0.7), Bulge(2, 3e-5), Bulge(5, 3e-5, 2.0)])
def test_selection_rule_of_a_rotor_in_a_stator(stator, rotor):
    phases = 2 * np.pi * np.arange(32) / 32
    here = np.zeros((2, 32))
    force = shaped_law(K, G0, (stator,), (rotor,)).force(here, here, phases, 1.0)
    spectrum = np.fft.fft(force[1] + 1j * force[0]) / 32
    rule = selection_rule(K, G0, ("stator", stator), ("rotor", rotor))
    second = K * stator.size * rotor.size / G0
    if rule is None:
        assert np.abs(spectrum).max() < 0.05 * abs(second)
        return
    assert abs(rule.turns) == rotor.order
    assert rule.kind == ("forward" if rotor.order > stator.order else "backward")
    assert spectrum[rule.turns] == pytest.approx(rule.size * np.exp(1j * rule.angle), rel=1e-3)
    assert np.abs(np.delete(spectrum, rule.turns)).max() < 0.05 * rule.size


@pytest.mark.parametrize(("side", "kind", "turns"),
                         [("stator", "static", 0), ("rotor", "synchronous", 1)])
def test_selection_rule_of_one_side(side, kind, turns):
    a, b = Bulge(4, 2e-5, 0.3), Bulge(3, 3e-5, -0.5)
    law = shaped_law(K, G0, *(((a, b), ()) if side == "stator" else ((), (a, b))))
    phases = 2 * np.pi * np.arange(32) / 32
    force = law.force(np.zeros((2, 32)), np.zeros((2, 32)), phases, 1.0)
    spectrum = np.fft.fft(force[1] + 1j * force[0]) / 32
    rule = selection_rule(K, G0, (side, a), (side, b))
    assert (rule.kind, rule.turns) == (kind, turns)
    assert spectrum[turns] == pytest.approx(rule.size * np.exp(1j * rule.angle), rel=1e-3)
    assert np.abs(np.delete(spectrum, turns)).max() < 0.05 * rule.size
    assert selection_rule(K, G0, (side, a), (side, Bulge(2, 1e-5))) is None


def test_shapes_have_their_limits():
    e = positions(0.5)
    assert shaped_law(K, G0).force(e) == pytest.approx(ROUND.force(e), rel=1e-11)
    stator = (Bulge(2, 3e-4, 0.4),)
    still = shaped_law(K, G0, stator)
    assert isinstance(still, ShapedPull) and not still.moving
    turning = shaped_law(K, G0, stator, (Bulge(3, 0.0),))
    assert turning.force(e, STILL, PHASES, 1.0) == pytest.approx(still.force(e), rel=1e-12)
    # order 1 of the rotor is a shift that turns with it
    one = shaped_law(K, G0, (), (Bulge(1, 0.2 * G0, 0.3),))
    turn = PHASES + 0.3
    assert one.force(e, STILL, PHASES, 1.0) == pytest.approx(
        ROUND.force(e + 0.2 * G0 * np.array([np.sin(turn), np.cos(turn)])), rel=1e-10)


def test_smallest_gap_of_turning_shapes():
    law = LAWS["shapes"]
    e = positions(0.3, 5)
    angle, phase = np.meshgrid(np.linspace(0, 2 * np.pi, 721), np.linspace(0, 2 * np.pi, 721))
    for place in e.T:
        gap = (G0 + 0.3e-3 * np.cos(2 * (angle - 0.4)) + 0.2e-3 * np.cos(3 * angle) - 0.1e-3
               * np.cos(2 * (angle - phase))
               - 0.3e-3 * np.cos(4 * (angle - phase - 1.0)) - place[0] * np.sin(angle) - place[1]
               * np.cos(angle))
        for at in (0, 100, 333):  # rows of equal phase
            there = law.smallest_gap(place, phase[at, 0])
            assert there == pytest.approx(gap[at].min(), abs=1e-4 * G0)
            lowest = angle[at, gap[at].argmin()]
            assert np.cos(law.gap_angle(place, phase[at, 0]) - lowest) > np.cos(0.02)


# ------------------------------------------------------------------ the tangential pull

def test_tangential_pull_turns_from_z_to_x():
    law = TangentialPull(2e6, G0)
    # at +z it pushes to +x: forward
    assert law.force(np.array([0.0, 1e-3])) == pytest.approx([2e3, 0.0])
    e = positions()
    force, slope, _ = law.linearise(e)
    assert np.abs((force * e).sum(axis=0)).max() < 1e-12 * np.abs(force).max()
    assert np.einsum("ij...,j...->i...", slope, e) == pytest.approx(force, rel=1e-14)
    circle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    path, rate = G0 / 2 * np.array([np.sin(circle),
                                    np.cos(circle)]), G0 / 2 * np.array([np.cos(circle),
                                                                         -np.sin(circle)])
    work = (law.force(path) * rate).sum() * 2 * np.pi / 400
    # there is no potential: a lap gains energy
    assert work == pytest.approx(2 * np.pi * 2e6 * (G0 / 2) ** 2, rel=1e-12)


@pytest.mark.parametrize("law", [*LAWS.values(), TangentialPull(2e6, G0)], ids=[*ids, "tangential"])
def test_scaled_and_gaps(law):
    e, double = positions(), law.scaled(2.0)
    if law.moving:
        assert double.force(e, STILL, PHASES,
                               1.0) == pytest.approx(2 * law.force(e, STILL, PHASES, 1.0),
                                                     rel=1e-13)
        touching = np.array([1.2 * G0, 0.0])
        assert np.isnan(law.force(touching, touching, 0.0,
                                     1.0)).all() and law.smallest_gap(touching) < 0
    else:
        assert double.force(e) == pytest.approx(2 * law.force(e), rel=1e-14)
    aside = np.array([0.3 * G0, 0.0])
    assert 0 < law.smallest_gap(aside) <= 0.7 * G0 * 1.001


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("pairs", [1, 2, 3])
def test_a_net_flux_that_is_held_back(pairs, share):
    """Against the integral over the gap, with the potential at which that share of the flux passes;
    the slope against differences.
    """
    law = PolePairPull(1.0, 1.0, pairs, 1.5 * pairs, 0.3, 0.2, 0.7, flux_share=share)
    phi = 2 * np.pi * np.arange(2048) / 2048
    for eps, angle, phase in ((0.4, 0.8, 1.1), (0.2, 4.0, 2.5)):
        permeance = 1 / (1 - eps * np.cos(phi - angle))
        wave = np.real(law.wave(phase) * np.exp(-1j * pairs * phi))
        free = np.mean(wave * permeance)
        field = (wave - (1 - share) * free / permeance.mean()) * permeance
        assert field.mean() == pytest.approx(share * free, abs=1e-14)
        along = 2 * np.mean(field**2 * np.exp(1j * phi))
        place = eps * np.array([np.sin(angle), np.cos(angle)])
        force, slope, _ = law.linearise(place, None, phase)
        assert force == pytest.approx([along.imag, along.real], abs=1e-13)
        steps = 1e-6 * np.eye(2)
        differences = [(law.force(place + d, None, phase) - law.force(place - d, None, phase))
                       / 2e-6 for d in steps]
        assert slope == pytest.approx(np.transpose(differences), abs=1e-8)


def test_a_blocked_flux_halves_the_pull_of_one_pole_pair_and_stops_its_beat():
    phases = np.linspace(0.0, 6.0, 7)
    free, blocked = (PolePairPull(K, G0, 1, 1.0, flux_share=share) for share in (1.0, 0.0))
    slopes = blocked.linearise(np.zeros((2, 7)), None, phases)[1]
    assert slopes == pytest.approx(np.stack([K / 2 * np.eye(2)] * 7, axis=-1), abs=1e-9 * K)
    assert np.ptp(free.linearise(np.zeros((2, 7)), None, phases)[1][0, 0]) > 0.8 * K


def test_a_share_that_no_closed_form_knows_is_refused():
    for more in ({"stator_mmf": 0.5}, {"series": "published"}):
        with pytest.raises(BadInput, match=r"poles\.flux_share is 0\.3.*whole series"):
            Poles(1, flux_share=0.3, **more)
