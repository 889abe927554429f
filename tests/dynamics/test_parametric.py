"""Two-pole instability and tangential pull: Floquet against exact limits in a turning frame, on a
point mass and a shaft.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from hydrolab import BadInput, HarmonicBalance, floquet, load_machine, modes
from hydrolab.dynamics.parametric import centred_growth, stability_chart, two_pole_band, two_pole_growth
from hydrolab.machine.pole_pairs import Poles
from hydrolab.machine.parts import AirGap, Machine, RadialBearing, RigidBody
from hydrolab.machine.pull import tangential_limit

MASS, STIFFNESS = 1800.0, 1.3e8
AIR = AirGap("core", 0.5, 0.25, 1.0, 0.005)
PULL = AIR.pull_stiffness
BALANCE = HarmonicBalance(2)


def jeffcott(ratio=0.01, *, poles=None, tangential=0.0):
    damping = 2 * ratio * math.sqrt(STIFFNESS * MASS)
    model = Machine("two poles", 200.0, None,
                    (RigidBody("core", 0, MASS, 0.0, 0.0, unbalance=0.02),),
                    (RadialBearing("spring", 0, STIFFNESS, damping),), poles=poles,
                    air_gap=replace(AIR, tangential=tangential)).model()
    return model, damping


@pytest.fixture(scope="module")
def two_poles():
    return jeffcott(poles=Poles(1))


def test_band_without_damping_is_that_of_the_turning_frame():
    low, high = two_pole_band(MASS, STIFFNESS, PULL)
    assert low == pytest.approx(math.sqrt((STIFFNESS - 1.5 * PULL) / MASS), rel=1e-13)
    assert high == pytest.approx(math.sqrt((STIFFNESS - 0.5 * PULL) / MASS), rel=1e-13)
    assert two_pole_band(MASS, STIFFNESS, PULL, damping=1e6) is None
    with pytest.raises(BadInput, match="two thirds"):
        two_pole_band(MASS, STIFFNESS, 0.7 * STIFFNESS)


@pytest.mark.parametrize("edge", [0, 1])
def test_band_edges_by_floquet_are_exact(two_poles, edge):
    """The edge that Floquet's growth has, found without knowing the exact one."""
    model, damping = two_poles
    exact = two_pole_band(MASS, STIFFNESS, PULL, damping)[edge]
    found = brentq(lambda w: centred_growth(model.with_unbalance(0), w, BALANCE, False),
                   0.98 * exact, 1.02 * exact,
                   xtol=1e-7)
    assert found == pytest.approx(exact, rel=1e-8)
    assert two_pole_growth(MASS, STIFFNESS, PULL, damping, exact) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("frequency", [150.0, 214.0, 216.0, 235.0, 300.0])
def test_growth_is_that_of_the_turning_frame(two_poles, frequency):
    model, damping = two_poles
    exact = two_pole_growth(MASS, STIFFNESS, PULL, damping, frequency)
    assert centred_growth(model.with_unbalance(0), frequency, BALANCE,
                          True) == pytest.approx(exact, abs=1e-5)


def test_chart(two_poles):
    model, damping = two_poles
    speeds, fields = np.linspace(190, 280, 7), np.array([0.2, 1.0])
    chart = stability_chart(model, speeds, fields)
    for i, field in enumerate(fields):
        exact = [two_pole_growth(MASS, STIFFNESS, PULL * field**2, damping, w) for w in speeds]
        assert chart.growth[i] == pytest.approx(exact, abs=1e-4)
    assert chart.band(0) is None
    low, high = two_pole_band(MASS, STIFFNESS, PULL, damping)
    assert chart.band(1) == (speeds[speeds > low][0], speeds[speeds < high][-1])


def test_a_field_that_turns_faster_moves_the_band():
    """The band is one of the electrical frequency: a rotor that slips goes through it at a lower
    speed.
    """
    model, damping = jeffcott(poles=Poles(1, electrical_ratio=1.25))
    for electrical in (205.0, 235.0):
        growth = centred_growth(model.with_unbalance(0), electrical / 1.25,
                                HarmonicBalance(4, revolutions=2), True)
        assert growth == pytest.approx(two_pole_growth(MASS, STIFFNESS, PULL, damping, electrical),
                                       abs=1e-4)


def test_phases_out_of_balance_against_hill():
    """With a backward wave there is no frame in which the stiffness rests: the multipliers of
    Hill's equation by DOP853.
    """
    from scipy.integrate import solve_ivp

    model, damping = jeffcott(poles=Poles(1, backward=0.4))
    speed = 226.0

    def rate(t, s):
        slope = model.law.linearise(np.zeros(2), np.zeros(2), speed * t, speed)[1]
        q, v = s.reshape(4, 4)[:2], s.reshape(4, 4)[2:]
        return np.vstack([v, ((slope - STIFFNESS * np.eye(2)) @ q - damping * v) / MASS]).ravel()

    end = solve_ivp(rate, (0, 2 * math.pi / speed), np.eye(4).ravel(), method="DOP853", rtol=1e-11,
                    atol=1e-11)
    true = np.abs(np.linalg.eigvals(end.y[:, -1].reshape(4, 4))).max()
    found = floquet(BALANCE.solve(model.with_unbalance(0), speed))
    assert abs(found.multipliers[0]) == pytest.approx(true, rel=1e-7)
    alone = floquet(BALANCE.solve(jeffcott(poles=Poles(1))[0].with_unbalance(0), speed))
    assert abs(abs(found.multipliers[0]) - abs(alone.multipliers[0])) > 1e-3


def test_more_pole_pairs_have_no_band():
    model, _ = jeffcott(poles=Poles(2))
    assert not stability_chart(model, [215.0, 226.0, 240.0, 250.0], [1.0]).unstable.any()


def test_the_two_pole_machine_has_its_band_below_its_critical_speed():
    machine = load_machine("two-pole")
    model = replace(machine, poles=Poles(1)).model()
    chart = stability_chart(model, np.array([1500.0, 2250.0, 2982.0]) * np.pi / 30, [1.0])
    assert chart.unstable[0].tolist() == [False, True, False]
    speed = 2250 * np.pi / 30
    mult = abs(floquet(BALANCE.solve(model.with_unbalance(0), speed)).multipliers[0])
    assert math.log(mult) * speed / (2 * np.pi) == pytest.approx(chart.growth[0, 1], rel=1e-3)


# ------------------------------------------------------------------ the tangential pull

@pytest.mark.parametrize("sign", [1, -1])
def test_tangential_limit_of_a_point_mass(sign):
    """c ω = |k_t|, exact; above it the whirl that grows turns with the spin for k_t > 0 and against
    it for k_t < 0.
    """
    _, damping = jeffcott(0.03)
    limit = tangential_limit(MASS, damping, STIFFNESS, PULL) / PULL

    def growth(share):
        return centred_growth(jeffcott(0.03, tangential=sign * share)[0].with_unbalance(0), 200.0,
                              BALANCE, False)

    assert brentq(growth, 0.9 * limit, 1.1 * limit, xtol=1e-9) == pytest.approx(limit, rel=1e-6)
    model, _ = jeffcott(0.03, tangential=1.05 * sign * limit)
    slope = model.law.linearise(np.zeros(2))[1]
    free = modes(replace(model, K=model.K - slope), 200.0)
    growing = free.eigenvalues.real > 0
    assert growing.tolist() == ([True, False] if growing[0] else [False, True])
    assert free.direction[int(np.argmax(growing))] == ("forward" if sign > 0 else "backward")
    assert tangential_limit(MASS, damping, PULL, PULL) != tangential_limit(MASS, damping, PULL,
                                                                           PULL)  # nan


def test_tangential_limit_of_the_whole_unit():
    """Floquet's crossing on the full machine against the eigenvalues of its linearised equations,
    all DOFs.
    """
    unit = load_machine("kaplan-150rpm")

    def model(share):
        return replace(unit, air_gap=replace(unit.air_gap,
                                             tangential=share)).model().with_unbalance(0)

    def by_eigenvalues(share):
        here = model(share)
        slope = here.selection.T @ here.law.linearise(np.zeros(2))[1] @ here.selection
        return float(modes(replace(here, K=here.K - slope), unit.speed).eigenvalues.real.max())

    limit = brentq(by_eigenvalues, 1e-4, 0.2, xtol=1e-7)
    for share, verdict in ((0.97 * limit, "stable"), (1.03 * limit, "unstable")):
        assert floquet(BALANCE.solve(model(share), unit.speed)).verdict == verdict
    found = brentq(lambda share: centred_growth(model(share), unit.speed, BALANCE, False),
                   0.9 * limit, 1.1 * limit,
                   xtol=1e-6)
    assert found == pytest.approx(limit, rel=1e-3)
