"""Two-pole instability: Floquet against exact limits in the frame that turns with the field."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from hydrolab import BadInput, HarmonicBalance, floquet, load_machine
from hydrolab.machine import Poles

RPM = 30 / math.pi


def test_band_without_damping_is_that_of_the_turning_frame(script):
    low, high = script.two_pole_band(0.0)
    for edge, share in ((low, 1.5), (high, 0.5)):
        exact = math.sqrt((script.STIFFNESS - share * script.PULL) / script.MASS)
        assert edge == pytest.approx(exact, rel=1e-13)
    assert script.two_pole_band(1e6) is None
    with pytest.raises(BadInput, match="two thirds"):
        script.two_pole_band(0.0, 0.7 * script.STIFFNESS)


@pytest.mark.parametrize("edge", [0, 1])
def test_band_edges_by_floquet_are_exact(script, edge):
    """The edge that Floquet's growth has, found without knowing the exact one."""
    model = script.point_mass(Poles(1))
    exact = script.two_pole_band(script.DAMPING)[edge]
    found = brentq(lambda w: script.growth(model, w), 0.98 * exact, 1.02 * exact, xtol=1e-7)
    assert found == pytest.approx(exact, rel=1e-8)
    assert script.two_pole_growth(script.DAMPING, exact) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("frequency", [150.0, 214.0, 216.0, 235.0, 300.0])
def test_growth_is_that_of_the_turning_frame(script, frequency):
    exact = script.two_pole_growth(script.DAMPING, frequency)
    model = script.point_mass(Poles(1))
    assert script.growth(model, frequency) == pytest.approx(exact, abs=1e-4)


def test_a_field_that_turns_faster_moves_the_band(script):
    """The band is one of the electrical frequency: a rotor that slips goes through it at a lower
    speed.
    """
    model = script.point_mass(Poles(1, electrical_ratio=1.25))
    for electrical in (205.0, 235.0):
        found = script.growth(model, electrical / 1.25, revolutions=2)
        exact = script.two_pole_growth(script.DAMPING, electrical)
        assert found == pytest.approx(exact, abs=1e-3)


def test_phases_out_of_balance_against_hill(script):
    """With a backward wave there is no frame in which the stiffness rests: the multipliers of
    Hill's equation by DOP853, its stiffness written out here.
    """
    from scipy.integrate import solve_ivp

    backward, speed = 0.4, 226.0
    model = script.point_mass(Poles(1, backward=backward))
    size = script.PULL  # of the forward wave alone, which has the card's field

    def rate(t, s):
        # the wave cos(φ − ωt) + b cos(φ + ωt): mean square 1 + b² + 2b cos 2ωt, second harmonic
        # cos 2(φ − ωt) + b² cos 2(φ + ωt) + 2b cos 2φ, half of it on either axis
        c, d = math.cos(2 * speed * t), math.sin(2 * speed * t)
        mean = 1 + backward**2 + 2 * backward * c
        along = ((1 + backward**2) * c + 2 * backward) / 2
        across = (1 - backward**2) * d / 2
        slope = size * np.array([[mean - along, across], [across, mean + along]])
        q, v = s.reshape(4, 4)[:2], s.reshape(4, 4)[2:]
        pull = (slope - script.STIFFNESS * np.eye(2)) @ q
        return np.vstack([v, (pull - script.DAMPING * v) / script.MASS]).ravel()

    end = solve_ivp(rate, (0, 2 * math.pi / speed), np.eye(4).ravel(), method="DOP853", rtol=1e-11,
                    atol=1e-11)
    true = np.abs(np.linalg.eigvals(end.y[:, -1].reshape(4, 4))).max()
    assert script.growth(model, speed) == pytest.approx(math.log(true) * speed / (2 * math.pi),
                                                        abs=1e-3)
    assert script.growth(script.point_mass(Poles(1)), speed) < script.growth(model, speed) - 1


def test_more_pole_pairs_have_no_band(script):
    model = script.point_mass(Poles(2))
    assert all(script.growth(model, speed) < 0 for speed in (215.0, 226.0, 240.0, 250.0))


def test_the_two_pole_machine_has_its_band_below_its_critical_speed(script):
    model = replace(load_machine("two-pole"), poles=Poles(1)).model()
    rates = [script.growth(model, speed / RPM) for speed in (1500.0, 2250.0, 2982.0)]
    assert [rate > 0 for rate in rates] == [False, True, False]
    orbit = HarmonicBalance(2).solve(model.with_unbalance(0), 2250 / RPM)
    leading = abs(floquet(orbit).multipliers[0])
    # 1/s; the product of 2000 exponentials of the matrix of all 44 degrees of freedom
    assert math.log(leading) * 2250 / 60 == pytest.approx(15.38397, rel=1e-5)
    assert rates[1] == pytest.approx(15.38397, rel=2e-3)  # on a few modes


def test_picture(script):
    speeds, fields = np.array([100.0, 200.0, 300.0, 400.0]) / RPM, np.array([0.8, 1.0])
    growth = np.array([[-1.0, -1.0, -1.0, -1.0], [-1.0, 2.0, 3.5, -1.0]])
    picture = script.picture(speeds, fields, growth)
    assert "unstable from 200 to 300 rpm" in picture.reading and "3.5 a second" in picture.reading
    assert "25 % of the chart" in picture.reading
