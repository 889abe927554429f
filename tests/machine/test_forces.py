"""The magnetic pull: closed form, quadrature, derivative, potential, static fold."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

from hydrolab.machine.parts import MU_0, AirGap
from hydrolab.machine.pull import CircularPull, LinearPull, ShapedPull, closed_form
from tests.reference.potentials import potential

GAP = AirGap("generator", 0.5, 2.9945, 0.97, 0.011)  # the paper's Table 1
G0 = GAP.gap
PULL = CircularPull(GAP.pull_stiffness, G0)
ROUND = ShapedPull(GAP.pull_stiffness, G0, np.full(256, G0))
# A stator that is oval and has a third harmonic: no symmetry for an error to hide behind.
ANGLE = 2 * np.pi * np.arange(256) / 256
ODD = ShapedPull(GAP.pull_stiffness, G0, G0 * (1 + 0.1 * np.cos(2 * ANGLE - 0.3) + 0.05
                                               * np.sin(3 * ANGLE)))


def positions(largest, count=12, seed=0):
    """Positions with |e| up to `largest` of the gap, (2, count)."""
    random = np.random.default_rng(seed)
    radius, angle = G0 * np.linspace(0.02, largest, count), random.uniform(0, 2 * np.pi, count)
    return radius * np.array([np.sin(angle), np.cos(angle)])


def paper_integrals(x, z, x_e, z_e):
    """Eqs. (7) and (8) with the gap of Eq. (6), as printed (the erratum in its last term
    corrected).
    """
    def gap(phi):
        return 1 + ((x_e - x) * math.sin(phi) + (z_e - z) * math.cos(phi)) / G0
    factor = GAP.field**2 * GAP.mean_radius * GAP.length / (2 * MU_0)
    return [factor * quad(lambda phi, wave=wave: wave(phi) / gap(phi) ** 2, 0, 2 * math.pi,
                          epsabs=1e-13, epsrel=1e-13)[0] for wave in (math.sin, math.cos)]


def test_stiffness_of_table_1():
    assert GAP.pull_stiffness == pytest.approx(1.6504e8, rel=1e-4)  # Table 1 in π B0² u0 l0/(µ0 g0)


def test_closed_form_is_the_papers_integral():
    for x, z in positions(0.8, 6).T:
        expected = np.array(paper_integrals(x + 1e-3, z - 2e-3, 1e-3, -2e-3))
        error = PULL.force(np.array([x, z])) - expected
        assert np.abs(error).max() < 1e-12 * np.abs(expected).max()


def test_closed_form_is_the_quadrature_of_a_circular_gap():
    e = positions(0.9)
    force, slope, _ = ROUND.linearise(e)
    exact, exact_slope, _ = PULL.linearise(e)
    assert np.abs(force - exact).max(axis=1) == pytest.approx(0, abs=1e-12 * np.abs(exact).max())
    assert np.abs(force / exact - 1).max() < 1e-11
    assert np.abs(slope - exact_slope).max() < 1e-12 * np.abs(exact_slope).max()
    assert np.array_equal(ROUND.force(e), force)
    assert PULL.force(e) == pytest.approx(exact, rel=1e-14)


def test_sympy_derives_the_closed_form():
    import sympy as sp

    residue, formula = closed_form()
    assert sp.simplify(residue - formula) == 0
    (eps,) = formula.free_symbols
    integral = quad(lambda phi: math.cos(phi) / (1 - 0.3 * math.cos(phi)) ** 2, 0, 2 * math.pi)[0]
    assert float(residue.subs(eps, 0.3)) == pytest.approx(integral, rel=1e-12)


@pytest.mark.parametrize("law", [PULL, ODD, LinearPull(GAP.pull_stiffness, G0)],
                         ids=["circular", "shaped", "linear"])
def test_slope_is_the_derivative_of_the_force(law):
    e, h = positions(0.6), 1e-5 * G0
    force, slope, _ = law.linearise(e)
    assert force == pytest.approx(law.force(e), rel=1e-14)
    for j in (0, 1):
        step = h * np.eye(2)[:, j, None]
        difference = (law.force(e + step) - law.force(e - step)) / (2 * h)
        assert np.abs(slope[:, j] - difference).max() < 1e-7 * np.abs(slope).max()


@pytest.mark.parametrize("law", [PULL, LinearPull(GAP.pull_stiffness, G0)],
                         ids=["circular", "linear"])
def test_potential_is_the_work_along_a_path(law):
    def path(s):
        return G0 * np.array([0.1 + 0.6 * s * s, -0.3 + 0.5 * math.sin(2 * s)])

    def power(s):
        return float(law.force(path(s)) @ (G0 * np.array([1.2 * s, math.cos(2 * s)])))

    work = quad(power, 0, 1, epsabs=0, epsrel=1e-11)[0]
    assert work == pytest.approx(potential(law, path(0)) - potential(law, path(1)), rel=1e-11)


@pytest.mark.parametrize(("kappa", "eps_fold", "e_max"), [
    (1.2, 0.2018, 0.0228), (1.4, 0.2746, 0.0540), (1.6, 0.3247, 0.0848), (1.8, 0.3632, 0.1137),
    (3.0, 0.4944, 0.2435)])
def test_static_fold(kappa, eps_fold, e_max):
    """Largest stator offset a spring κ times the pull stiffness can hold: chapter 2, Eq. (2.8)."""
    def offset(eps):
        return eps - PULL.force(np.array([eps * G0, 0.0]))[0] / (kappa * PULL.stiffness * G0)

    found = minimize_scalar(lambda eps: -offset(eps), bounds=(0.01, 0.9), options={"xatol": 1e-12})
    formula = brentq(lambda eps: (1 + 2 * eps**2) / (1 - eps**2) ** 2.5 - kappa, 0.01, 0.9)
    assert offset(found.x) == pytest.approx(offset(formula), rel=1e-12)
    assert formula == pytest.approx(eps_fold, abs=6e-5)
    assert offset(formula) == pytest.approx(e_max, abs=6e-5)
    # at the fold the spring and the slope of the pull cancel
    slope = PULL.linearise(np.array([formula * G0, 0.0]))[1][0, 0]
    assert slope == pytest.approx(kappa * PULL.stiffness, rel=1e-9)


def test_small_displacements_feel_a_negative_stiffness():
    for eps in (1e-2, 1e-3, 1e-4):
        force = PULL.force(np.array([0.6 * eps * G0, 0.8 * eps * G0]))
        ratio = np.hypot(*force) / (GAP.pull_stiffness * eps * G0)
        # ε + 3/2 ε³ + 15/8 ε⁵
        assert ratio - 1 == pytest.approx(1.5 * eps**2, rel=3 * eps**2 + 1e-7)


@pytest.mark.parametrize("law", [PULL, ROUND], ids=["circular", "shaped"])
def test_pull_points_to_the_small_gap(law):
    for angle in (0.0, math.pi / 2, 3.0, -2.0):
        e = 0.3 * G0 * np.array([math.sin(angle), math.cos(angle)])
        force = law.force(e)
        assert math.atan2(*force) == pytest.approx(angle, abs=1e-12)  # gap angle: from z towards x
        assert law.smallest_gap(e) == pytest.approx(0.7 * G0, rel=1e-3)
        assert math.remainder(float(law.gap_angle(e)) - angle,
                              2 * math.pi) == pytest.approx(0, abs=0.013)
    # raising x_E leaves the rotor on the −x side, and it is pulled to −x
    assert law.force(np.zeros(2) - [1e-3, 0])[0] < 0


@pytest.mark.parametrize(("eps", "share"), [(0.1, 0.9850), (0.2, 0.9406), (0.3, 0.8681),
                                            (0.5, 0.6495), (0.9, 0.0828)])
def test_linear_pull_underestimates(eps, share):
    e = np.array([0.0, eps * G0])
    linear = LinearPull(PULL.stiffness, G0)
    # (1 − ε²)^(3/2), by hand
    assert linear.force(e)[1] / PULL.force(e)[1] == pytest.approx(share, abs=6e-5)
    assert linear.linearise(e)[1] == pytest.approx(PULL.linearise(np.zeros(2))[1])


def test_a_shifted_circle_is_a_moved_rotor():
    shift, e = 0.2 * G0, positions(0.5)
    shifted = ShapedPull(PULL.stiffness, G0, G0 - shift * np.sin(ANGLE))
    assert shifted.force(e) == pytest.approx(PULL.force(e + [[shift], [0.0]]), rel=1e-11)


def test_an_oval_stator_does_not_pull_a_centred_rotor():
    oval = ShapedPull(PULL.stiffness, G0, G0 * (1 + 0.2 * np.cos(2 * ANGLE)))
    assert np.abs(oval.force(np.zeros(2))).max() < 1e-12 * PULL.stiffness * G0
    pear = ShapedPull(PULL.stiffness, G0, G0
                      * (1 + 0.2 * np.cos(2 * ANGLE) + 0.2 * np.cos(3 * ANGLE)))
    # orders that differ by one do pull
    assert np.abs(pear.force(np.zeros(2))).max() > 1e-2 * PULL.stiffness * G0


@pytest.mark.parametrize("law", [PULL, ODD], ids=["circular", "shaped"])
def test_scaled_is_linear_in_the_factor(law):
    e = positions(0.5)
    assert law.scaled(4.0).force(e) == pytest.approx(4 * law.force(e), rel=1e-14)


@pytest.mark.parametrize("law", [PULL, ROUND, ODD], ids=["circular", "round", "odd"])
def test_there_is_no_force_in_the_stator(law):
    for e in (np.array([1.3 * G0, 0.0]), np.array([0.9 * G0, 0.9 * G0])):
        assert law.smallest_gap(e) < 0
        assert np.isnan(law.force(e)).all()
        force, slope, _ = law.linearise(e)
        assert np.isnan(force).all()
        assert np.isnan(slope).all()
    assert np.isnan(potential(PULL, np.array([1.3 * G0, 0.0])))
