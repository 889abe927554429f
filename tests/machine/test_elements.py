"""The shaft element against textbook matrices, statics, rigid-body mechanics and exact frequencies.
"""

import subprocess
import sys
from math import pi
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from hydrolab.errors import BadInput
from hydrolab.machine import element_matrices, elements
from hydrolab.machine.elements import shaft_element
from tests.machine.generate_elements import module_text

E, RHO, NU, KAPPA, L = 2.0e11, 7850.0, 0.3, 0.886, 0.8
A, I = pi / 4 * 0.3**2, pi / 64 * 0.3**4
SHEAR = E / (2 * (1 + NU))
PHI = 12 * E * I / (KAPPA * SHEAR * A * L**2)
BOTH = ("lalanne-ferraris", "timoshenko")
NO_SHEAR = 1e14  # as a shear coefficient: Φ = 0 to rounding
Z_PLANE = np.ix_([1, 2, 5, 6], [1, 2, 5, 6])  # (z1, θx1, z2, θx2)


def stock(element, shear_coefficient=KAPPA):
    return shaft_element(element, L, E, RHO, A, I, NU, shear_coefficient)


def assembled(element, nodes, diameter, shear_coefficient=KAPPA):
    area, second_moment = pi / 4 * diameter**2, pi / 64 * diameter**4
    M, G, K = (np.zeros((4 * len(nodes), 4 * len(nodes))) for _ in range(3))
    for i, length in enumerate(np.diff(nodes)):
        at = slice(4 * i, 4 * i + 8)
        for whole, part in zip((M, G, K), shaft_element(element, length, E, RHO, area,
                                                        second_moment, NU,
                                                        shear_coefficient), strict=True):
            whole[at, at] += part
    return M, G, K


def rigid_motions(nodes):
    """Unit x, z, θx and θz of a rigid shaft about its top: θx = ∂z/∂y and θz = −∂x/∂y."""
    R = np.zeros((4 * len(nodes), 4))
    R[0::4, 0] = R[1::4, 1] = R[2::4, 2] = R[3::4, 3] = 1
    R[1::4, 2], R[0::4, 3] = nodes, -np.asarray(nodes)
    return R


def test_bending_and_shear_stiffness_is_the_textbook_one():
    # Przemieniecki 1968, table 5.1 / Friswell et al. 2010, equation 5.23
    expected = E * I / ((1 + PHI) * L**3) * np.array([
        [12, 6 * L, -12, 6 * L],
        [6 * L, (4 + PHI) * L**2, -6 * L, (2 - PHI) * L**2],
        [-12, -6 * L, 12, -6 * L],
        [6 * L, (2 - PHI) * L**2, -6 * L, (4 + PHI) * L**2]])
    for element in BOTH:
        np.testing.assert_allclose(stock(element)[2][Z_PLANE], expected, rtol=1e-13)


def test_lalanne_ferraris_mass_is_hermite_translation_plus_rotary_inertia():
    translation = RHO * A * L / 420 * np.array([
        [156, 22 * L, 54, -13 * L], [22 * L, 4 * L**2, 13 * L, -3 * L**2],
        [54, 13 * L, 156, -22 * L], [-13 * L, -3 * L**2, -22 * L, 4 * L**2]])
    rotary = RHO * I / (30 * L) * np.array([
        [36, 3 * L, -36, 3 * L], [3 * L, 4 * L**2, -3 * L, -L**2],
        [-36, -3 * L, 36, -3 * L], [3 * L, -L**2, -3 * L, 4 * L**2]])
    M, _, _ = stock("lalanne-ferraris")
    np.testing.assert_allclose(M[Z_PLANE], translation + rotary, rtol=1e-13)


def test_timoshenko_mass_is_the_textbook_one():
    # Friswell et al. 2010, section 5.4.4 (after Przemieniecki 1968)
    p = PHI
    m1, m2 = 312 + 588 * p + 280 * p**2, (44 + 77 * p + 35 * p**2) * L
    m3, m4 = 108 + 252 * p + 140 * p**2, -(26 + 63 * p + 35 * p**2) * L
    m5, m6 = (8 + 14 * p + 7 * p**2) * L**2, -(6 + 14 * p + 7 * p**2) * L**2
    m7, m8 = 36, (3 - 15 * p) * L
    m9, m10 = (4 + 5 * p + 10 * p**2) * L**2, (-1 - 5 * p + 5 * p**2) * L**2
    translation = RHO * A * L / (840 * (1 + p) ** 2) * np.array([
        [m1, m2, m3, m4], [m2, m5, -m4, m6], [m3, -m4, m1, -m2], [m4, m6, -m2, m5]])
    rotary = RHO * I / (30 * L * (1 + p) ** 2) * np.array([
        [m7, m8, -m7, m8], [m8, m9, -m8, m10], [-m7, -m8, m7, -m8], [m8, m10, -m8, m9]])
    M, _, _ = stock("timoshenko")
    np.testing.assert_allclose(M[Z_PLANE], translation + rotary, rtol=1e-13)


@pytest.mark.parametrize("element", BOTH)
def test_both_planes_bend_alike(element):
    # turning by 90° about y takes (x, z, θx, θz) to (z, −x, θz, −θx): a round shaft does not notice
    turn = np.kron(np.eye(2), np.array([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]]))
    for matrix in stock(element):
        np.testing.assert_allclose(turn.T @ matrix @ turn, matrix, rtol=0,
                                   atol=1e-13 * np.abs(matrix).max())


@pytest.mark.parametrize("element", BOTH)
def test_symmetry_and_definiteness(element):
    M, G, K = stock(element)
    np.testing.assert_allclose(M, M.T, rtol=1e-14)
    np.testing.assert_allclose(K, K.T, rtol=1e-14)
    np.testing.assert_allclose(G, -G.T, rtol=1e-14)
    assert np.abs(G).max() > 0
    scale = np.diag(1 / np.sqrt(np.diag(M)))  # metres and radians on one scale
    assert scipy.linalg.eigvalsh(scale @ M @ scale).min() > 1e-3
    stiffness = scipy.linalg.eigvalsh(scale @ K @ scale)
    # two translations, two tilts, nothing else
    assert np.abs(stiffness[:4]).max() < 1e-12 * stiffness[-1]
    assert stiffness[4] > 1e-3 * stiffness[-1]


@pytest.mark.parametrize("element", BOTH)
def test_mass_and_inertia_of_the_rigid_shaft_are_exact(element):
    nodes, diameter = [0, 0.5, 0.8, 2.0], 0.4
    area, second_moment, length = pi / 4 * diameter**2, pi / 64 * diameter**4, 2.0
    M, G, K = assembled(element, nodes, diameter)
    R = rigid_motions(nodes)
    m, h = RHO * area * length, RHO * area * length**2 / 2
    j = RHO * area * length**3 / 3 + RHO * second_moment * length
    exact = np.array([[m, 0, 0, -h], [0, m, h, 0], [0, h, j, 0], [-h, 0, 0, j]])
    np.testing.assert_allclose(R.T @ M @ R, exact, rtol=1e-12, atol=1e-10)
    polar = 2 * RHO * second_moment * length
    np.testing.assert_allclose(R.T @ G @ R, polar * np.array(
        [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, -1], [0, 0, 1, 0]]), rtol=1e-12, atol=1e-10)
    assert np.abs(K @ R).max() < 1e-13 * np.abs(K).max()


@pytest.mark.parametrize("element", BOTH)
def test_rigid_gyroscopic_moment_is_that_of_angular_momentum(element):
    # dH/dt with H = Ip Ω e along the tilting axis e = (−θz, 1, θx): x gets −Ip Ω θ̇z and z gets +Ip
    # Ω θ̇x
    _, G, _ = stock(element)
    R = rigid_motions([0, L])
    polar, rates, speed = 2 * RHO * I * L, np.array([0.3, -0.7]), 50.0
    axis_rate = np.array([-rates[1], 0, rates[0]])
    expected = polar * speed * axis_rate[[0, 2]]
    np.testing.assert_allclose((R.T @ (speed * G) @ R @ [0, 0, *rates])[2:], expected, rtol=1e-12)


@pytest.mark.parametrize("element", BOTH)
@pytest.mark.parametrize("across, tilt, sign", [(1, 2, 1), (0, 3, -1)])
def test_cantilever_under_a_tip_force_is_exact_with_one_element(element, across, tilt, sign):
    _, _, K = stock(element)
    force = 1e4
    load = np.zeros(4)
    load[across] = force
    tip = np.linalg.solve(K[4:, 4:], load)
    assert tip[across] == pytest.approx(force * L**3 / (3 * E * I) + force * L
                                        / (KAPPA * SHEAR * A), rel=1e-13)
    assert tip[tilt] == pytest.approx(sign * force * L**2 / (2 * E * I), rel=1e-13)


@pytest.mark.parametrize("element", BOTH)
@pytest.mark.parametrize("support, roots", [
    ("cantilever", (1.875104069, 4.694091133, 7.854757438)),
    ("free-free", (4.730040745, 7.853204624, 10.99560784))])
def test_slender_beam_frequencies(element, support, roots):
    # cosh βL cos βL = ∓1; thin enough that shear and rotary inertia do not show at this tolerance
    length, diameter = 1.0, 1e-4
    M, _, K = assembled(element, np.linspace(0, length, 61), diameter)
    held = 4 if support == "cantilever" else 0
    omega = np.sqrt(np.abs(scipy.linalg.eigvalsh(K[held:, held:], M[held:, held:])))
    bending = omega[0 if held else 4:][:6]
    exact = np.repeat(np.array(roots) ** 2, 2) * np.sqrt(E * diameter**2 / 16 / RHO) / length**2
    np.testing.assert_allclose(bending, exact, rtol=3e-6)
    if not held:
        assert omega[:4].max() < 1e-3 * bending[0]


def rotating_simply_supported(element, count, speed, shear_coefficient):
    """Signed frequencies (+ forward) of the paper's shaft on two pins, by a route that has no
    `modes` in it.
    """
    M, G, K = assembled(element, np.linspace(0, 9.04, count + 1), 0.71, shear_coefficient)
    free = np.setdiff1d(np.arange(len(M)), [0, 1, len(M) - 4, len(M) - 3])
    M, G, K = (m[np.ix_(free, free)] for m in (M, G, K))
    # K φ = ω² M φ − iωΩ G φ linearised as a Hermitian pencil in (ωφ, φ), so that ω is real without
    # a filter
    zero = np.zeros_like(M)
    left = np.block([[-1j * speed * G, K], [K, zero]])
    right = np.block([[M, zero], [zero, K]])
    return np.unique(np.round(scipy.linalg.eigh(left, right, eigvals_only=True), 9))


def exact_simply_supported(n, speed, kappa):
    """Lowest forward (+) and backward (−) frequency: Timoshenko with gyroscopic terms, κ = ∞ gives
    Rayleigh.
    """
    area, second_moment, k = pi / 4 * 0.71**2, pi / 64 * 0.71**4, n * pi / 9.04
    ei, ra, ri = E * second_moment, RHO * area, RHO * second_moment
    if np.isinf(kappa):
        roots = np.roots([ra + ri * k**2, -2 * ri * k**2 * speed, -ei * k**4])
    else:
        s = kappa * SHEAR * area
        roots = np.polysub(np.polymul([-ra, 0, s * k**2], [-ri, 2 * ri * speed, ei * k**2 + s]),
                           [(s * k) ** 2])
        roots = np.roots(roots)
    roots = np.sort(roots.real)
    return roots[roots > 0].min(), roots[roots < 0].max()


def nearest(values, target):
    return values[np.argmin(np.abs(values - target))]


@pytest.mark.parametrize("speed, n, forward_hz, backward_hz", [
    (150 * pi / 30, 1, 17.1033, 17.0848), (150 * pi / 30, 2, 66.9655, 66.8966),
    (150 * pi / 30, 3, 145.765, 145.626),
    (500.0, 1, 17.3915, 16.8014), (500.0, 2, 68.0343, 65.8426), (500.0, 3, 147.906, 143.506)])
def test_rotating_simply_supported_shaft(speed, n, forward_hz, backward_hz):
    kappa = 0.88636
    exact = exact_simply_supported(n, speed, kappa)
    np.testing.assert_allclose(np.array(exact) / (2 * pi), [forward_hz, -backward_hz], rtol=5e-6)
    assert exact[0] > -exact[1]  # forward is the faster
    computed = rotating_simply_supported("timoshenko", 40, speed, kappa)
    np.testing.assert_allclose([nearest(computed, e) for e in exact], exact, rtol=3e-4)


@pytest.mark.parametrize("element, shear_coefficient, order", [
    ("lalanne-ferraris", NO_SHEAR, 4), ("timoshenko", NO_SHEAR, 4), ("timoshenko", 0.88636, 2)])
def test_order_of_convergence(element, shear_coefficient, order):
    # Hermite cubics: h⁴. With shear, w is exact for end loads only and the inertia loads cost (r
    # h)² k⁴, so h².
    speed, n = 500.0, 2
    kappa = np.inf if shear_coefficient == NO_SHEAR else shear_coefficient
    for exact in exact_simply_supported(n, speed, kappa):
        counts = np.array([4, 6, 8, 12, 16]) if order == 4 else np.array([16, 24, 32, 48])
        errors = [abs(nearest(rotating_simply_supported(element, c, speed, shear_coefficient),
                              exact) / exact - 1)
                  for c in counts]
        slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
        assert slope == pytest.approx(-order, abs=0.1)


def test_without_shear_the_two_elements_are_one():
    for a, b in zip(stock("lalanne-ferraris", NO_SHEAR), stock("timoshenko", NO_SHEAR),
                    strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-11)
    assert not np.allclose(stock("lalanne-ferraris")[0], stock("timoshenko")[0], rtol=1e-3)


def test_shape_functions_take_their_end_values_and_hold_equilibrium():
    c = elements.symbols()
    w, theta = elements.shape_functions()
    for at, rows in ((0, (0, 1)), (1, (2, 3))):
        for row, function in zip(rows, (w, theta), strict=True):
            assert [int(v) for v in function.subs(c.s, at).applyfunc(lambda v: v.simplify())] == [
                int(i == row) for i in range(4)]
    moment_balance = theta.diff(c.s, 2) * c.Phi / 12 + w.diff(c.s) / c.L - theta
    assert moment_balance.applyfunc(lambda v: v.simplify()).is_zero_matrix


@pytest.mark.parametrize("element", elements.ELEMENTS)
def test_what_is_displayed_is_what_runs(element):
    c = elements.symbols()
    M, G, K = elements.element_matrices_symbolic(element)
    numbers = {c.L: L, c.Phi: PHI, c.E: E, c.rho: RHO, c.A: A, c.I: I}
    for symbolic, numeric in zip((M, G, K), stock(element), strict=True):
        np.testing.assert_allclose(np.array(symbolic.subs(numbers).tolist(), dtype=float), numeric,
                                   rtol=1e-12)


def test_the_functions_that_run_are_the_ones_derived():
    assert Path(element_matrices.__file__).read_text(encoding="utf-8") == module_text()


def test_an_unknown_element_is_refused_in_a_sentence():
    with pytest.raises(BadInput, match=r"euler.*lalanne-ferraris, timoshenko"):
        stock("euler")


def test_sympy_is_not_loaded_by_importing():
    code = "import sys, hydrolab.machine.elements; sys.exit('sympy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
