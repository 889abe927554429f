"""Answers of the exercises against numbers by hand, from the paper's Table 1 and the cards' own
numbers typed here; the library computes nothing of the expected values.
"""

import math
from dataclasses import replace

import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

import hydrolab
from hydrolab.course.answers import exercise

RPM, TURN = math.pi / 30, 2 * math.pi
GAP, FIELD = 0.011, 0.5  # m, T
PULL = math.pi * FIELD**2 * 2.9945 * 0.97 / (4e-7 * math.pi * GAP)  # N/m, Table 1
MASS, SPRING, UNBALANCE = 1.5e5, 2.7e8, 55.03667  # kg, N/m, kg m: the Jeffcott card
OMEGA, ARM = math.sqrt(SPRING / MASS), UNBALANCE / MASS
LENGTH, STEEL = 9.04, 2e11  # m, Pa
AREA, SECOND = math.pi / 4 * 0.71**2, math.pi / 64 * 0.71**4


def response(speed: float) -> complex:
    """Centre of the Jeffcott rotor over its heavy spot, m; 1 % damping."""
    return ARM * speed**2 / (OMEGA**2 - speed**2 + 0.02j * OMEGA * speed)


def offset(kappa: float) -> float:
    """The stator offset at which springs κ times as stiff as the pull give way, of the gap."""
    eps = brentq(lambda e: (1 + 2 * e**2) / (1 - e**2) ** 2.5 - kappa, 1e-3, 0.9)
    return eps - eps / (kappa * (1 - eps**2) ** 1.5)


def oval_slope(axis: float) -> float:
    """Negative stiffness along an axis of a gap g0 (1 + 0.1 cos 2φ), MN/m: the pressure's slope."""
    return 1e-6 * PULL / math.pi * quad(
        lambda phi: math.cos(phi - axis) ** 2 / (1 + 0.1 * math.cos(2 * phi)) ** 3, 0, TURN)[0]


def split_of_mode(n: int, speed: float) -> float:
    """How far the forward root of Eq. (6.5) lies above the backward one, %."""
    spin = 7850 * SECOND * (n * math.pi / LENGTH) ** 2
    a, b = 7850 * AREA + spin, spin * speed
    root = math.sqrt(b**2 + a * STEEL * SECOND * (n * math.pi / LENGTH) ** 4)
    return 100 * ((root + b) / (root - b) - 1)


def stiffness_at_the_generator(guide: float, turbine: float, thicker: float) -> float:
    """Eq. (8.1), N/m; depths in m, with a shaft so many times as thick as the card's."""
    b, span, shear = 0.472, turbine - guide, 0.9 * STEEL / 2.6 * AREA * thicker**2
    bending = STEEL * SECOND * thicker**4
    a = guide + b
    return 1 / ((1 + a / span) ** 2 / 1.37e9 + (a / span) ** 2 / 1.64e9
                + (a**3 - b**3 + a**2 * span) / (3 * bending)
                + (a - b + a**2 / span) / shear)


BY_HAND = {
    "0.1a": 3 * math.pi,
    "0.1b": 1.5,
    "0.3": 1 / (1 / 78.3 - 0.25 * (1 / 78.3 - 1 / 200)),  # 1/radius goes with the stiffness
    "1.1": OMEGA / math.sqrt(0.9) / RPM,
    "1.2": 1e6 * abs(response(600 * RPM) + ARM),
    # x = 210 sin Ωt and z = 150 sin(Ωt + 60°): the largest sum of their squares
    "1.3": math.sqrt((210**2 + 150**2) / 2
                     + math.hypot((210**2 - 150**2) / 2, 210 * 150 * math.cos(math.pi / 3))),
    "1.4": ["backward" if math.sqrt(2.2e8 / MASS) < speed * RPM < OMEGA else "forward"
            for speed in (330, 385, 450)],
    "1.5": OMEGA / RPM * minimize_scalar(lambda r: r**3 / (r**2 - 1), (1.1, 2, 4)).x,
    "2.1a": 1e-3 * PULL * 0.25 * GAP / (1 - 0.25**2) ** 1.5,
    "2.1b": 1e-3 * PULL * 0.25 * GAP / (1 - 0.25**2) ** 1.5 / 9.81,
    "2.2": math.log(offset(1.0004) / offset(1.0001)) / math.log(4),
    "2.3": FIELD * math.sqrt((SPRING - MASS * (300 * RPM) ** 2) / PULL),
    "3.1": math.ceil(math.pi * 3000 / 2.5),
    "3.2": TURN * OMEGA / (150 * RPM) / math.sqrt(12e-4),
    "4.1": 3 * (2 * 8 + 1),
    "4.2": 3 * 4 + 4 + 1,
    "5.1": 3.0,
    "6.1": 1e-6 * 48 * STEEL * math.pi / 64 * 0.6**4 / 8**3,
    "6.2": split_of_mode(4, 800.0),
    "6.3": 13 / 35,  # the consistent mass matrix of any textbook
    "7.1": 119.4,
    "7.3": 2 * math.sqrt(5.98 * 21.60) / (5.98 + 21.60),  # the modes that the chapter prints, Hz
    "8.1": stiffness_at_the_generator(0.9533, 8.123, 0.8 / 0.71) / PULL,
    "9.2": 512 * math.sqrt(62.10),
    "11.1": 1.5 * PULL * GAP * (0.2 / 11) ** 2,
    "11.2": [-2, 4],
    "12.1": 2 * math.sqrt(2) * 83,
    "12.2": 6.3e-3 / (150 * RPM) * 31310,
    "13.1": 100 / (20 * math.pi),
    "14.1": 4 * math.sqrt(2 / (20 * 64)),
    # the worst of two unit vectors 45° apart: half the angle between them
    "14.2": 1 / (math.sqrt(2) * math.sin(math.radians(22.5))),
    "14.3": brentq(lambda w: abs(OMEGA**2 - w**2 + 0.02j * OMEGA * w)
                   - 2 * abs(OMEGA**2 - PULL / MASS - w**2 + 0.02j * OMEGA * w),
                   280 * RPM, OMEGA) / RPM,
}


@pytest.mark.parametrize("number", BY_HAND)
def test_answer_is_that_by_hand(number):
    right = exercise(number).right()
    if isinstance(right, list) and isinstance(right[0], str):
        assert right == BY_HAND[number]
    else:
        assert right == pytest.approx(BY_HAND[number], rel=1e-3)


def test_an_oval_stator_pulls_unevenly():
    """2.5: x is a quarter turn from z."""
    asked = exercise("2.5")
    assert asked.measure(asked.right()) == pytest.approx(
        [oval_slope(math.pi / 2), oval_slope(0.0)], rel=1e-6)


def test_an_order_below_two():
    """3.3: with γ other than a half Newmark's method is of first order."""
    assert exercise("3.3").right() == pytest.approx(1, abs=0.06)


def test_2X_meets_the_forward_mode():
    """7.2: at that speed a natural frequency is twice the rotation."""
    model, speed = hydrolab.load_machine("kaplan-150rpm").model(), exercise("7.2").right() * RPM
    softer = replace(model, K=model.K - PULL * model.selection.T @ model.selection)
    found = hydrolab.modes(softer, speed)
    at = abs(found.frequencies - 2 * speed).argmin()
    assert found.frequencies[at] == pytest.approx(2 * speed, rel=1e-3)
    assert found.direction[at] == "forward"
