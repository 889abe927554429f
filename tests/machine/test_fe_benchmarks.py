"""Whole machines against published rotors and rigid-body mechanics.

Sources: M. I. Friswell et al., Dynamics of Rotating Machines, 2010, section 5.9 (the printed
digits, and the same cases recomputed with the independent code ROSS 3.1.0); M. Lalanne and G.
Ferraris, Rotordynamics Prediction in Engineering, 1990 (the three-disc rotor); a rotor of
hydropower size computed with ROSS 3.1.0.
"""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from hydrolab.dynamics.modes import modes
from hydrolab.machine.elements import shaft_element
from hydrolab.machine.parts import Machine, RadialBearing, RigidBody, Shaft, ThrustBearing

RPM = pi / 30


def cowper(poisson):
    """Shear coefficient of a solid round section (G. R. Cowper, 1966)."""
    return 6 * (1 + poisson) / (7 + 6 * poisson)


def disc(name, node, outer, bore, thickness, density):
    """A disc from its diameters, m, on the shaft."""
    mass = density * pi / 4 * (outer**2 - bore**2) * thickness
    polar = mass * (outer**2 + bore**2) / 8
    return RigidBody(name, node, mass, polar / 2 + mass * thickness**2 / 12, polar)


def friswell(stiffness, damping=0.0):
    poisson = 211e9 / (2 * 81.2e9) - 1
    shaft = Shaft(np.linspace(0, 1.5, 7), 0.05, 211e9, 7810, poisson, cowper(poisson), "timoshenko")
    discs = disc("D1", 2, 0.28, 0.05, 0.07, 7810), disc("D2", 4, 0.35, 0.05, 0.07, 7810)
    bearings = tuple(RadialBearing(f"bearing {node}", node, stiffness, damping) for node in (0, 6))
    return Machine("Friswell 5.9", 0.0, shaft, discs, bearings)


def three_discs(element, shear_coefficient, refine=1):
    nodes = [0.0]
    for end, count in ((0.2, 2), (0.5, 3), (1.0, 5), (1.3, 3)):
        nodes += list(np.linspace(nodes[-1], end, count * refine + 1)[1:])
    shaft = Shaft(nodes, 0.1, 2e11, 7800, 0.3, shear_coefficient, element)
    discs = tuple(disc(f"disc {node}", node * refine, 2 * radius, 0.1, thickness, 7800)
                  for node, radius, thickness in ((2, 0.12, 0.05), (5, 0.2, 0.05), (10, 0.2, 0.06)))
    bearings = tuple(RadialBearing(f"bearing {node}", node * refine, [5e7, 7e7], [500, 700])
                     for node in (0, 13))
    return Machine("three discs", 25000 * RPM, shaft, discs, bearings)


def hydro():
    shaft = Shaft(np.linspace(0, 9.04, 13), 0.71, 2e11, 7850, 0.3, cowper(0.3), "timoshenko")
    bodies = RigidBody("generator", 0, 1.5e5, 3e5, 5e5), RigidBody("turbine", 12, 5e4, 4e4, 6e4)
    bearings = RadialBearing("upper", 1, 1.37e9), RadialBearing("lower", 11, 1.64e9)
    return Machine("hydro size", 150 * RPM, shaft, bodies, bearings,
                   (ThrustBearing("thrust", 6, 5e7),))


def pairs(*values):
    return np.repeat(values, 2)


def test_disc_inertias():
    d1, d2 = friswell(1e6).bodies
    np.testing.assert_allclose([d1.mass, d1.Id, d1.Ip],
                               [32.58972765, 0.17808928257, 0.32956362089], rtol=1e-9)
    np.testing.assert_allclose([d2.mass, d2.Id, d2.Ip],
                               [51.52526111, 0.42358058405, 0.80508220487], rtol=1e-9)


@pytest.mark.parametrize("stiffness, rpm, printed, recomputed", [
    (1e6, 0, pairs(86.66, 274.31, 716.78), pairs(86.65811, 274.31285, 716.78631)),
    (1e6, 4000, [85.39, 87.80, 251.78, 294.71, 600.18],
     [85.38947, 87.79586, 251.7846, 294.71333, 600.17936, 827.07536]),
    ([1e6, 8e5], 0, [82.65, 86.66, 254.52, 274.31, 679.49],
     [82.65304, 86.65811, 254.52048, 274.31285, 679.48903, 716.78631]),
    ([1e6, 8e5], 4000, [82.33, 86.86, 239.64, 287.25, 583.49],
     [82.32547, 86.8637, 239.64228, 287.24958, 583.48783, 806.88728])])
def test_friswell_undamped(stiffness, rpm, printed, recomputed):
    found = modes(friswell(stiffness).model(), rpm * RPM)
    # the book cuts 716.786 to 716.78, so one unit of its last digit
    np.testing.assert_allclose(found.frequencies[:len(printed)], printed, rtol=0, atol=0.01)
    np.testing.assert_allclose(found.frequencies[:len(recomputed)], recomputed, rtol=1e-6)
    assert np.abs(found.frequencies / 650.41 - 1).min() > 0.01  # that one is torsional
    assert np.abs(found.damping_ratios).max() < 1e-9


@pytest.mark.parametrize("rpm, recomputed, natural_hz", [
    (0, pairs(-4.42383 + 87.25794j, -78.24083 + 292.42277j, -566.54038 + 648.5814j),
     pairs(13.91, 48.18, 137.06)),
    (4000, [-4.08308 + 85.96581j, -4.74174 + 88.41471j, -74.10177 + 263.78635j,
            -78.81042 + 318.23504j,
            -402.59086 + 655.01204j, -667.23754 + 663.89967j],
     [13.70, 14.09, 43.61, 52.18, 122.37])])
def test_friswell_damped(rpm, recomputed, natural_hz):
    found = modes(friswell(1e6, 3e3).model(), rpm * RPM)
    np.testing.assert_allclose(found.eigenvalues[:6], recomputed, rtol=2e-7)
    natural = np.abs(found.eigenvalues[:len(natural_hz)]) / (2 * pi)
    np.testing.assert_allclose(natural, natural_hz, rtol=0, atol=0.005)
    if rpm == 0:
        np.testing.assert_allclose(found.hertz[:6], pairs(13.89, 46.54, 103.22), rtol=0, atol=0.005)


BOOK = [55.408, 67.209, 157.90, 193.71, 249.90, 407.62, 446.62, 622.65, 715.03]


def test_three_discs_as_in_the_book():
    found = modes(three_discs("lalanne-ferraris", 0.9).model(), 25000 * RPM).hertz
    np.testing.assert_allclose(found[:9], BOOK, rtol=2e-4)
    np.testing.assert_allclose(found[:9], BOOK, rtol=0, atol=0.005)  # it prints these digits
    np.testing.assert_allclose(found[9:11], [1073.59, 1093.00], rtol=0, atol=0.005)


@pytest.mark.parametrize("refine, expected", [
    (1, [55.411, 67.197, 157.898, 193.639, 249.851, 407.463, 446.713, 622.696, 714.902]),
    (4, [55.411, 67.196, 157.895, 193.634, 249.841, 407.389, 446.648, 622.582, 714.394])])
def test_three_discs_timoshenko(refine, expected):
    found = modes(three_discs("timoshenko", cowper(0.3), refine).model(), 25000 * RPM).hertz[:9]
    np.testing.assert_allclose(found, expected, rtol=0, atol=6e-4)
    np.testing.assert_allclose(found, BOOK, rtol=1e-3)


@pytest.mark.parametrize("rpm, hertz", [
    (0, pairs(6.668744, 14.293049, 17.563898, 29.531152)),
    (150, [5.382650, 8.152366, 13.843746, 14.818037, 16.937244, 18.313902, 29.123493, 30.015279])])
def test_hydro_size(rpm, hertz):
    np.testing.assert_allclose(modes(hydro().model(), rpm * RPM).hertz[:8], hertz, rtol=1e-7)


def test_hydro_size_without_shear_and_rotary_inertia_of_the_shaft():
    model = hydro().model()
    M, K = model.M.copy(), model.K.copy()
    area, second_moment = pi / 4 * 0.71**2, pi / 64 * 0.71**4
    for i in range(12):
        at = slice(4 * i, 4 * i + 8)
        m, _, k = shaft_element("timoshenko", 9.04 / 12, 2e11, 7850, area, second_moment, 0.3,
                                cowper(0.3))
        light, _, _ = shaft_element("lalanne-ferraris", 9.04 / 12, 2e11, 7850, area, 0.0, 0.3, 1e14)
        _, _, stiff = shaft_element("lalanne-ferraris", 9.04 / 12, 2e11, 7850, area, second_moment,
                                    0.3, 1e14)
        M[at, at] += light - m
        K[at, at] += stiff - k
    found = modes(replace(model, M=M, K=K))
    np.testing.assert_allclose(found.hertz[:8], pairs(6.686452, 14.432676, 17.791273, 29.956247),
                               rtol=1e-7)


@pytest.mark.parametrize("offset", [-0.472, 0.0, 0.9])
def test_a_body_on_an_offset_has_the_exact_rigid_body_mass_matrix(offset):
    shaft = Shaft([0.0, 1.0], 0.2, 2e11, 7850)
    body = RigidBody("disc", 1, 1000.0, 300.0, 500.0, offset)
    with_body, without = Machine("a", 0.0, shaft, (body,)).model(), Machine("b", 0.0, shaft,
                                                                            ()).model()
    # velocity of the centre v + ω × r and the spin-free ω = (θ̇x, 0, θ̇z), from unit rates, by
    # cross products
    unit = np.eye(4)
    velocity = np.column_stack([unit[:, 0], np.zeros(4), unit[:, 1]])
    omega = np.column_stack([unit[:, 2], np.zeros(4), unit[:, 3]])
    centre = velocity + np.cross(omega, [0.0, offset, 0.0])
    exact = 1000.0 * centre @ centre.T + omega @ np.diag([300.0, 500.0, 300.0]) @ omega.T
    np.testing.assert_allclose((with_body.M - without.M)[4:, 4:], exact, rtol=1e-12, atol=1e-9)
    assert not (with_body.M - without.M)[:4].any()
    gyroscopic = np.zeros((4, 4))
    # the angular momentum does not know the offset
    gyroscopic[2, 3], gyroscopic[3, 2] = -500.0, 500.0
    np.testing.assert_allclose((with_body.G - without.G)[4:, 4:], gyroscopic, rtol=1e-12, atol=1e-9)


def test_an_overhung_body_swings_as_the_same_body_at_the_end_of_a_rigid_shaft():
    # the same machine twice: the link as an offset, and as a nearly rigid, nearly massless piece of
    # shaft
    bearings = RadialBearing("upper", 1, 1e8), RadialBearing("lower", 2, 2e8)
    body = RigidBody("runner", 2, 5e4, 4e4, 6e4, 0.7)
    linked = Machine("link", 0.0, Shaft([0.0, 1.0, 5.0], [0.5, 0.5], 2e11, 7850.0), (body,),
                     bearings).model()
    long = Machine("long", 0.0, Shaft([0.0, 1.0, 5.0, 5.7], [0.5, 0.5, 20.0], 2e11, 7850.0),
                   (replace(body, node=3, offset=0.0),), bearings).model()
    piece = shaft_element("lalanne-ferraris", 0.7, 2e11, 7850.0, pi / 4 * 20**2, pi / 64 * 20**4,
                          0.3, 0.9)
    M, G = long.M.copy(), long.G.copy()
    M[8:, 8:] -= (1 - 1e-9) * piece[0]
    G[8:, 8:] -= (1 - 1e-9) * piece[1]
    speed = 30.0
    np.testing.assert_allclose(modes(replace(long, M=M, G=G), speed).frequencies[:6],
                               modes(linked, speed).frequencies[:6], rtol=1e-5)
