"""Motions through a schedule against exact passages, SciPy's integrator, and steady states."""

import math
import signal

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import erf

from hydrolab import (
    BadInput,
    HarmonicBalance,
    Schedule,
    coast_down,
    load_machine,
    load_rejection,
    rpm,
    run,
    runaway,
    start_up,
)
from hydrolab.dynamics.harmonics import long_axis
from hydrolab.machine.parts import Machine, RadialBearing, RigidBody
from tests.machines import MACHINES, guided

OMEGA, ZETA, ARM = 7.0, 0.02, 1e-3  # rad/s, 1, m
SHORT = {"film": 0.02, "pads": 0.1, "pads, crack and oval stator": 0.1, "bush": 0.3}  # revolutions


@pytest.fixture(scope="module")
def jeffcott():
    """100 kg on a damped spring, no gap; its heavy spot is ARM off the axis."""
    disc = RigidBody("disc", 0, 100.0, 0.0, 0.0, unbalance=100 * ARM)
    return Machine("jeffcott", OMEGA, None, (disc,),
                   (RadialBearing("spring", 0, 100 * OMEGA**2, 200 * ZETA * OMEGA),)).model()


def passage(rate, t):
    """z + ix of the centre, m, from rest with a constant angular acceleration, exactly.

    ẅ + 2ζω₀ẇ + ω₀²w = −e d²/dt² e^{iθ}, θ = rate t²/2. Duhamel's integral twice by parts leaves an
    integral of a Gaussian with complex arguments, an error function (Lewis 1932 has Fresnel's).
    """
    root = 1j * OMEGA * math.sqrt(1 - ZETA**2)
    total = 0
    for sign in (1, -1):
        s = -ZETA * OMEGA + sign * root
        p, middle = np.sqrt(-1j * rate / 2), 1j * s / rate
        gauss = (np.exp(1j * s**2 / (2 * rate)) * math.sqrt(math.pi) / (2 * p)
                 * (erf(p * (t + middle)) - erf(p * middle)))
        g = np.exp(1j * rate * t**2 / 2)
        total += sign / (2 * root) * (1j * rate * t * g + s * (g - np.exp(s * t))
                                      + s**2 * np.exp(s * t) * gauss)
    return -ARM * total


@pytest.mark.parametrize("rate", [0.2, 1.0])
def test_the_exact_passage_through_the_critical_speed(jeffcott, rate):
    """Of second order in the step, and as near as it says."""
    plan, errors = Schedule([0, 15 / rate], [0, 15]), []
    for steps in (64, 128, 256):
        found = run(jeffcott, plan, steps_per_revolution=steps)
        x, z = found.positions
        errors.append(np.abs(z + 1j * x - passage(rate, found.times)).max())
        assert errors[-1] < found.step_error
    assert errors[-1] < 2e-4 * np.hypot(x, z).max()
    assert errors[0] > 15 * errors[2]
    assert found.passage.speed > OMEGA and found.passage.amplitude < ARM / (2 * ZETA)


def test_a_law_is_of_second_order_too(shipped):
    plan, errors = Schedule([0, 2, 4], [rpm(150), rpm(150), rpm(200)], [0.5, 1, 1]), []
    for steps in (128, 256):
        found = run(shipped, plan, static_eccentricity=0.06, steps_per_revolution=steps, modes=4)
        errors.append(np.hypot(*(found.positions - by_scipy(found, 1e-10))).max())
        assert errors[-1] < found.step_error
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.2)


def by_scipy(found, rtol=1e-6):
    """The generator's path of a run by DOP853, every law with the forces it has at each time."""
    small, plan, S, r = found.model, found.schedule, found.model.selection, found.model.size

    def rate(t, y):
        q, v, w, turned = y[:r], y[r:], plan.speed(t), np.exp(1j * plan.angle(t))
        m = small.at(w)
        law = m.law.scaled(plan.field(t) ** 2)
        force = law.force(m.relative(S @ q, found.centre), S @ v, plan.angle(t), w)
        heavy = (w**2 - 1j * plan.acceleration(t)) * (m.unbalance_cos - 1j * m.unbalance_sin)
        loads = m.static + ((heavy + m.turning[0] + 1j * w * m.turning[1]) * turned).real
        return np.concatenate([v, np.linalg.solve(m.M, loads + S.T @ force - m.K @ q
                                                  - m.velocity_matrix(w) @ v)])

    done = solve_ivp(rate, found.times[[0, -1]], found.states[:, :, 0].ravel(), method="DOP853",
                     rtol=rtol, atol=1e-3 * rtol, t_eval=found.times)
    return S[:2] @ done.y[:r]


@pytest.mark.parametrize("name", MACHINES)
def test_every_law_moves_as_by_another_method(name):
    """A rising speed and a falling field; stiff laws for a shorter time."""
    machine = MACHINES[name]()
    model, speed = machine.model(), machine.speed
    turns = SHORT.get(name, 1.0)
    plan = Schedule([0, turns * 2 * math.pi / speed], [speed, (1 + 0.07 * turns) * speed], [1, 0.9])
    found = run(model, plan, static_eccentricity=0.02 if math.isfinite(model.gap) else 0, modes=4)
    away = np.hypot(*(found.positions - by_scipy(found))).max()
    assert away < max(found.step_error, 1e-9)
    assert found.step_error < 0.02 * np.hypot(*found.positions).max() + 1e-9


@pytest.mark.parametrize("name", ["round", "loaded", "plant's bearings", "crack"])
def test_at_a_constant_speed_it_stays_on_the_steady_state(name):
    machine = MACHINES[name]()
    model, speed = machine.model(), machine.speed
    orbit = HarmonicBalance(16).solve(model, speed, 0.02)
    found = run(model, Schedule([0, 12 * 2 * math.pi / speed], [speed] * 2),
                static_eccentricity=0.02, steps_per_revolution=512, modes=None)
    away = np.hypot(*(found.positions - orbit.positions(found.angles))).max()
    assert away < 2e-3 * orbit.vibration
    for name, force in orbit.bearing_forces.items():
        assert found.bearing_forces[name].max() == pytest.approx(force.peak, rel=2e-3)
    assert found.smallest_gap.value == pytest.approx(orbit.smallest_gap, rel=1e-4)
    fall = found.waterfall(lines=3)
    assert fall.of(1) == pytest.approx([long_axis(orbit.coefficients, 1)] * 3, rel=2e-3)
    lowest = found.model.node_at(len(model.depths) - 1)
    here = found.orbit(found.times[-1], place=lowest)
    assert here[:, 0] == pytest.approx(here[:, -1], abs=1e-6)


@pytest.mark.parametrize("plan", [start_up(rpm(150)), load_rejection(rpm(150))],
                         ids=["start", "rejection"])
def test_the_basis_leaves_out_what_it_says(shipped, plan):
    """A minute of the shipped unit on its basis, and with all its degrees of freedom."""
    small, whole = (run(shipped, plan, static_eccentricity=0.05, steps_per_revolution=64,
                        modes=modes, check=False) for modes in (12, None))
    away = np.hypot(*(small.positions - whole.positions)).max()
    assert away < 1e-3 * whole.passage.amplitude and small.basis_error < 1e-4
    assert whole.basis_error == 0


def test_a_rejection_with_the_field_left_on_is_the_worst(shipped):
    on, off = (run(shipped, load_rejection(rpm(150), trip=trip), static_eccentricity=0.05,
                   check=False) for trip in (None, 1.0))
    assert on.passage.amplitude > 1.5 * off.passage.amplitude
    assert on.passage.amplitude > on.passage.steady  # it rings
    assert "left on" in str(on) and "off after 1 s" in str(off) and "not tried" in str(off)
    force = on.largest_bearing_force
    assert on.bearing_forces[force.name][on.times == force.time] == force.value
    assert on.gaps.min() == on.smallest_gap.value


def test_a_slow_passage_is_a_steady_state_throughout(jeffcott):
    slow = run(jeffcott, Schedule([0, 2000], [6, 8]), steps_per_revolution=32, check=False)
    assert slow.passage.amplitude == pytest.approx(ARM / (2 * ZETA), rel=0.002)
    assert slow.passage.amplitude == pytest.approx(slow.passage.steady, rel=0.01)
    assert slow.passage.speed == pytest.approx(OMEGA, rel=0.01)
    times = [500.0, 1000.0]
    speeds = slow.schedule.speed(times)
    exact = ARM * speeds**2 / np.abs(OMEGA**2 - speeds**2 + 2j * ZETA * OMEGA * speeds)
    assert slow.steady(times) == pytest.approx(exact, rel=1e-6)


def test_orders_of_a_waterfall_are_those_of_a_cosine_in_the_turned_angle(shipped):
    """The static pull's 2X grows with the speed; at rest there are no lines."""
    found = run(shipped, start_up(rpm(150), seconds=80), static_eccentricity=0.08, check=False)
    fall = found.waterfall(lines=20)
    orbit = HarmonicBalance(4).solve(shipped, rpm(150), 0.08)
    for k in (1, 2):
        assert fall.of(k)[-1] == pytest.approx(long_axis(orbit.coefficients, k), rel=0.05)
    assert fall.speeds[0] < 0.4 * rpm(150) and (np.diff(fall.times) > 0).all()


def test_what_was_computed_is_kept(shipped):
    def interrupting(done, of):
        if done == 20:
            signal.raise_signal(signal.SIGINT)

    plan = load_rejection(rpm(150))
    kept = run(shipped, plan, progress=interrupting)
    assert kept.interrupted and "this much is kept" in str(kept) and math.isnan(kept.step_error)
    whole = run(shipped, plan, check=False)
    assert 0 < len(kept.times) - 1 == 20 * 32
    assert np.array_equal(kept.positions, whole.positions[:, :len(kept.times)])


def test_contact_ends_it_and_says_where(shipped):
    found = run(shipped, Schedule([0, 20], [rpm(150)] * 2, [0, 2]), static_eccentricity=0.08)
    assert "touches the stator" in found.stopped and found.times[-1] < 20
    assert (found.gaps > 0).all()


def test_the_schedules_are_what_their_words_say():
    speed = rpm(150)
    for plan, end, most in ((start_up(speed), 1, 1), (load_rejection(speed, trip=0.5), 1, 1.4),
                            (coast_down(speed), 0, 1)):
        assert plan.speeds[-1] == pytest.approx(end * speed)
        assert plan.speeds.max() == pytest.approx(most * speed)
    assert 2.4 * speed < runaway(speed).speeds.max() < 2.5 * speed
    coast = coast_down(speed, half=20)
    assert coast.speed(20) == pytest.approx(speed / 2, rel=0.02) and coast.field(1) == 0.5
    # the angle is the integral of the speed, and the speed that of the acceleration
    times = np.linspace(0, 60, 60001)
    plan = load_rejection(speed)
    assert plan.angle(60.0) == pytest.approx(np.trapezoid(plan.speed(times), times), rel=1e-6)
    assert plan.acceleration(times).sum() * 1e-3 == pytest.approx(0, abs=1e-2)


@pytest.mark.parametrize(("wrong", "said"), [
    (lambda m: Schedule([0, 0], [1, 1]), "each must lie after the one before"),
    (lambda m: Schedule([0, 1], [1, -1]), r"speeds\[1\] is -1; it must be at least 0"),
    (lambda m: Schedule([0, 1, 2], [1, 1]), "as many of one as of the others"),
    (lambda m: Schedule([0, 1], [0, 0]), "a machine at rest needs no run"),
    (lambda m: start_up(rpm(150), flash=20), "flash is 20 s; it must be later than run up"),
    (lambda m: load_rejection(rpm(150), to=0.9), "to is 0.9; it must be larger than 1"),
    (lambda m: load_rejection(rpm(150), trip=-1), "trip is -1 s; it must be at least 0"),
    (lambda m: coast_down("150"), "speed is '150'"),
    (lambda m: run(m, 150), "make one by start_up"),
    (lambda m: run(m, start_up(rpm(150)), steps_per_revolution=8), "from 16|at least 16"),
    (lambda m: run(m, Schedule([0, 1], [1, 2])).orbit(0.5), "before which it turned"),
    (lambda m: run(m, Schedule([0, 1], [1, 2])).waterfall(), "take fewer"),
])
def test_what_does_not_fit_is_said(shipped, wrong, said):
    with pytest.raises((BadInput, RuntimeError), match=said):
        wrong(shipped)


def test_bearings_of_tables_are_not_known_below_their_ends():
    from hydrolab.machine.bearings import TableBearing
    table = TableBearing("oil", 1, [10.0, 30.0], [1.5e9, 1.2e9], [1e6, 1e6])
    with pytest.raises(BadInput, match="oil"):
        run(guided(tables=(table,)).model(), start_up(rpm(150)))


def test_a_rotor_that_does_not_rest_is_refused():
    with pytest.raises(BadInput, match="does not rest"):
        run(load_machine("jeffcott").model(), Schedule([0, 1], [0, 1]),
            static_eccentricity=0.5)
