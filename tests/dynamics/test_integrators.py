"""Time integration against exact motions, energy, harmonic balance, and its own promises."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from hydrolab import (
    CentralDifference,
    HarmonicBalance,
    Newmark,
    RungeKutta,
    integrate,
    load_machine,
    reduce,
    rpm,
    truncation_error,
)
from hydrolab.dynamics.integrate import Task, central_difference_matrices, newmark_matrices
from hydrolab.errors import BadInput
from hydrolab.machine.model import Model
from hydrolab.machine.parts import Machine, RadialBearing, RigidBody
from hydrolab.machine.pull import CircularPull, LinearPull, ShapedPull


@pytest.fixture(scope="module")
def oscillator():
    """A point mass on a damped spring: 7 rad/s, driven at 5 rad/s, no gap."""
    disc = RigidBody("disc", 0, 100.0, 0.0, 0.0, unbalance=2.0, phase=0.4)
    return Machine("oscillator", 5.0, None, (disc,),
                   (RadialBearing("b", 0, 100 * 49.0, 100 * 0.6),)).model()


def exact(model, speed, times, disturbance):
    """Driven motion and a decaying free one that starts at `disturbance` at rest; x and z are
    uncoupled.
    """
    m, c, k = model.M[0, 0], model.C[0, 0], model.K[0, 0]
    drive = speed**2 * (model.unbalance_cos - 1j * model.unbalance_sin) / (k - m * speed**2 + 1j
                                                                           * c * speed)
    decay = c / (2 * m)
    w = math.sqrt(k / m - decay**2)
    free = np.exp(-decay * times) * (np.cos(w * times) + decay / w * np.sin(w * times))
    return np.real(np.outer(drive, np.exp(1j * speed * times))) + np.outer(disturbance, free)


def order(errors, steps):
    return -np.polyfit(np.log(steps), np.log(errors), 1)[0]


# ------------------------------------------------------------------ exact motion of a driven
# oscillator

@pytest.mark.parametrize("method", [CentralDifference, Newmark], ids=lambda m: m.__name__)
@pytest.mark.parametrize("steps", [[64, 128, 256, 512]])
def test_order_on_a_driven_oscillator(oscillator, method, steps):
    errors = []
    for n in steps:
        run = integrate(oscillator, method(n), speed=5.0, revolutions=5, disturbance=(0.05, -0.02))
        error = run.positions - exact(oscillator, 5.0, run.times, [0.05, -0.02])
        errors.append(np.abs(error).max())
    assert order(errors, steps) == pytest.approx(method().order, abs=0.03)
    assert errors[-1] < 1e-3 * 0.05


def test_newmark_with_numerical_damping_is_of_first_order(oscillator):
    steps = [128, 256, 512, 1024]
    errors = []
    for n in steps:
        run = integrate(oscillator, Newmark(n, beta=0.3025, gamma=0.6), speed=5.0, revolutions=3,
                        disturbance=(0.05, 0))
        errors.append(np.abs(run.positions - exact(oscillator, 5.0, run.times, [0.05, 0])).max())
    assert order(errors, steps) == pytest.approx(Newmark(gamma=0.6).order, abs=0.1)


def test_runge_kutta_keeps_its_tolerance(oscillator):
    errors = []
    for rtol in (1e-5, 1e-8, 1e-11):
        run = integrate(oscillator, RungeKutta(rtol, 1e-15), speed=5.0, revolutions=5,
                        disturbance=(0.05, -0.02))
        errors.append(np.abs(run.positions - exact(oscillator, 5.0, run.times,
                                                   [0.05, -0.02])).max() / 0.05)
        assert errors[-1] < 50 * rtol
    assert errors[0] > 100 * errors[1] > 1e4 * errors[2]


@pytest.mark.parametrize("method", [CentralDifference, Newmark], ids=lambda m: m.__name__)
def test_order_with_the_pull(peer, speed, method):
    """Against DOP853 on a motion that is not periodic; 8 % of the gap, so the pull is far from
    linear.
    """
    start = HarmonicBalance().solve(peer, speed, 0.05)
    options = {"speed": speed, "static_eccentricity": 0.07, "revolutions": 3, "start": start,
               "disturbance": (5e-4, 3e-4)}
    fine = integrate(peer, RungeKutta(1e-12, 1e-16, 64), **options)
    errors, steps = [], [128, 256, 512, 1024]
    for n in steps:
        run = integrate(peer, method(n), **options)
        errors.append(np.abs(run.positions[:, ::n // 64] - fine.positions).max())
    assert order(errors, steps) == pytest.approx(2, abs=0.06)


def test_a_shaped_gap_takes_the_general_way(peer, speed):
    """The circular law runs on floats, others on arrays: same motion."""
    shaped = replace(peer, law=ShapedPull(peer.law.stiffness, peer.gap, np.full(64, peer.gap)))
    for method in (CentralDifference(64), Newmark(64), RungeKutta()):
        options = {"speed": speed, "static_eccentricity": 0.06, "revolutions": 2, "ramp": 1}
        one, two = integrate(peer, method, **options), integrate(shaped, method, **options)
        assert np.abs(one.positions - two.positions).max() < 1e-9 * np.abs(one.positions).max()


# ------------------------------------------------------------------ stability limit and energy

@pytest.fixture(scope="module")
def free(oscillator):
    """Undamped and undriven: 7 rad/s."""
    return replace(oscillator, C=0 * oscillator.C).with_unbalance(0.0)


@pytest.mark.parametrize(("w_dt", "grows"), [(1.99, False), (2.01, True)])
def test_central_differences_blow_up_beyond_two_over_omega(free, w_dt, grows):
    before, now, _, _ = central_difference_matrices(free, 5.0, w_dt / 7.0)
    old, q = np.array([1e-3, 0.0]), np.array([0.9e-3, 0.0])
    for _ in range(2000):
        old, q = q, now @ q + before @ old
    assert (np.abs(q).max() > 1e3) == grows


def test_step_limit_is_said_and_true(make_jeffcott, speed):
    """k/m = 424²: 2/ω is 84.85 steps in a revolution. 84 are refused with the number that is
    accepted.
    """
    model = make_jeffcott(stiffness=2.7e10, damping_ratio=0.0, radius=5e-5).model()
    with pytest.raises(BadInput, match="central differences need at most 2") as refusal:
        integrate(model, CentralDifference(84), speed=speed, revolutions=1)
    needed = int(re.search(r"at least (\d+) steps", str(refusal.value))[1])
    assert needed == math.ceil(math.pi * math.sqrt(2.7e10 / 1.5e5) / speed) == 85
    run = integrate(model, CentralDifference(needed), speed=speed, revolutions=200,
                    disturbance=(1e-4, 0))
    assert run.finished
    assert np.abs(run.positions).max() < 2e-3


def test_step_limit_of_the_whole_shaft(unit, speed):
    with pytest.raises(BadInput, match="or fewer modes") as refusal:
        integrate(unit, CentralDifference(512), speed=speed, modes=None, revolutions=1)
    fastest = math.sqrt(np.linalg.eigvals(np.linalg.solve(unit.M, unit.K)).real.max())
    assert f"{fastest:.4g} rad/s" in str(refusal.value)


def test_newmark_conserves_energy(unit, speed):
    model = reduce(replace(unit, C=0 * unit.C, G=0 * unit.G).with_unbalance(0.0).with_field(0.0),
                   12)
    run = integrate(model, Newmark(64), speed=speed, modes=None, revolutions=1,
                    disturbance=(3e-3, 2e-3))
    later = integrate(model, Newmark(64), speed=speed, modes=None, revolutions=50, start=run)

    def energy(state):
        q, v = state
        return 0.5 * v @ model.M @ v + 0.5 * q @ model.K @ q

    start = np.linalg.solve(model.K, model.selection.T)
    q = start @ np.linalg.solve(model.selection @ start, [3e-3, 2e-3])
    assert energy(run.state) == pytest.approx(energy([q, 0 * q]), rel=1e-11)
    assert energy(later.state) == pytest.approx(energy([q, 0 * q]), rel=1e-10)


def test_newmark_has_no_step_limit(unit, speed):
    run = integrate(unit, Newmark(16), speed=speed, modes=None, revolutions=50)
    assert run.finished
    assert np.abs(run.positions).max() < 1e-3


def test_newmark_matrices_obey_newmarks_rules(unit, speed):
    model, dt, beta, gamma = reduce(unit, 6), 1e-3, 0.3, 0.55
    advance, push, load = newmark_matrices(model, speed, dt, beta, gamma)
    random = np.random.default_rng(0)
    q, v, a = random.normal(size=(3, model.size))
    f, F = random.normal(size=2), random.normal(size=model.size)
    new_q, new_v, new_a = np.split(advance @ np.concatenate([q, v, a]) + push @ f + load @ F, 3)
    assert new_q == pytest.approx(q + dt * v + dt**2 * ((0.5 - beta) * a + beta * new_a))
    assert new_v == pytest.approx(v + dt * ((1 - gamma) * a + gamma * new_a))
    left = (model.M @ new_a + model.velocity_matrix(speed) @ new_v + model.K @ new_q
            - model.selection.T @ f - F)
    assert np.abs(left).max() < 1e-9 * np.abs(model.K @ new_q).max()


# ------------------------------------------------------------------ orbits

METHODS = [CentralDifference(2048), Newmark(2048), RungeKutta()]
NAMES = ["central", "newmark", "dop853"]


@pytest.mark.parametrize(("method", "tolerance"),
                         list(zip(METHODS, [2e-6, 2e-6, 3e-8], strict=True)),
                         ids=NAMES)
def test_started_on_an_orbit_it_stays_there(peer, speed, method, tolerance):
    orbit = HarmonicBalance(harmonics=8).solve(peer, speed, 0.05)
    run = integrate(peer, method, speed=speed, static_eccentricity=0.05, revolutions=4, start=orbit)
    distance = run.positions - orbit.positions(speed * run.times)
    assert np.abs(distance).max() < tolerance * np.abs(run.positions).max()
    assert np.abs(run.coefficients(8)
                  - orbit.coefficients).max() < tolerance * np.abs(run.positions).max()


def test_orbit_of_the_unit_on_its_modal_basis(unit, speed):
    """Integration on 12 modes, harmonic balance on all 52 DOFs."""
    orbit = HarmonicBalance(harmonics=8).solve(unit, speed, 0.1)
    run = integrate(unit, RungeKutta(), speed=speed, static_eccentricity=0.1, revolutions=3,
                    start=orbit)
    distance = run.positions - orbit.positions(speed * run.times)
    assert np.abs(distance).max() < 2e-6 * np.abs(run.positions).max()


def test_basis_of_modes_and_deflection(unit, speed):
    few, many = reduce(unit, 4), reduce(unit, 12)
    assert few.size == 6
    assert many.size == 14
    assert truncation_error(unit, many, speed) < 1e-5 < truncation_error(unit, few, speed) < 1e-2
    # a static force at the generator is answered exactly, however few the modes
    exact_answer = unit.selection @ np.linalg.solve(unit.K, unit.selection.T)
    assert few.selection @ np.linalg.solve(few.K, few.selection.T) == pytest.approx(exact_answer,
                                                                                    rel=1e-9)
    assert np.abs(few.M - np.eye(6)).max() < 1e-9
    # plain modes do not, and that moves the orbit
    plain = np.linalg.eigh(np.linalg.solve(np.linalg.cholesky(unit.M), np.linalg.solve(
        np.linalg.cholesky(unit.M), unit.K).T))[1][:, :6]
    shapes = np.linalg.solve(np.linalg.cholesky(unit.M).T, plain)
    compliance = unit.selection @ shapes @ np.linalg.solve(shapes.T @ unit.K @ shapes,
                                                           (unit.selection @ shapes).T)
    assert abs(compliance[0, 0] / exact_answer[0, 0] - 1) > 1e-4


def test_orbits_on_the_basis_and_on_all_dofs(unit, speed):
    balance = HarmonicBalance()
    full = balance.solve(unit, speed, 0.1)
    small = balance.solve(reduce(unit, 12), speed, 0.1)
    assert np.abs(small.coefficients
                  - full.coefficients).max() < 2e-5 * np.abs(full.coefficients).max()
    # and the shaft's nodes, through shaft_map
    assert np.abs(small.node_coefficients(6)
                  - full.node_coefficients(6)).max() < 2e-5 * np.abs(full.shaft).max()


def test_newmark_on_all_dofs_and_on_the_basis(unit, speed):
    options = {"speed": speed, "static_eccentricity": 0.05, "revolutions": 3}
    full, small = integrate(unit, Newmark(256), modes=None, **options), integrate(unit,
                                                                                  Newmark(256),
                                                                                  **options)
    assert full.model.size == 52
    assert np.abs(full.positions - small.positions).max() < 1e-4 * np.abs(full.positions).max()


def test_it_starts_from_the_steady_state_of_the_linear_problem(unit, speed):
    linear = HarmonicBalance(1).solve(unit.with_field(0.0), speed)
    for modes, tolerance in ((None, 1e-10), (12, 1e-6)):
        run = integrate(unit, Newmark(64), speed=speed, revolutions=1, modes=modes)
        assert run.positions[:, 0] == pytest.approx(linear.positions(np.zeros(1))[:, 0],
                                                    rel=tolerance)
        velocity = run.model.selection @ integrate(unit.with_field(0.0), Newmark(4096),
                                                   speed=speed, revolutions=1,
                                                   modes=modes).state[1]
        assert velocity == pytest.approx(linear.velocities(np.zeros(1))[:, 0], rel=1e-3, abs=1e-7)


# ------------------------------------------------------------------ ramp

def test_field_of_the_ramp(peer, speed):
    task = Task(peer, speed, np.zeros(2), 4.0)
    assert [task.field(t) for t in (0.0, 1.0, 4.0, 9.0)] == [0.0, 0.25, 1.0, 1.0]
    u = np.array([1e-3, 0])
    assert task.force(1.0, u, 0 * u) == pytest.approx(peer.law.force(u) / 16)
    assert Task(peer, speed, np.zeros(2), 0.0).field(0.0) == 1.0


@pytest.mark.parametrize("method", [CentralDifference(128), Newmark(128), RungeKutta()], ids=NAMES)
def test_a_ramp_ends_on_the_orbit(peer, speed, method):
    """At 7.5 % the sudden field throws the rotor into the stator, the ramped one does not."""
    options = {"speed": speed, "static_eccentricity": 0.075}
    ramped = integrate(peer, method, revolutions=120, ramp=40, **options)
    assert ramped.finished
    orbit = HarmonicBalance(harmonics=8).solve(peer, speed, 0.075)
    assert np.abs(ramped.coefficients(4)
                  - orbit.coefficients[:, :9]).max() < 2e-3 * np.abs(orbit.coefficients).max()
    # begins with no field at all
    assert np.abs(ramped.positions[:, 1] - ramped.positions[:, 0]).max() < 2e-5


# ------------------------------------------------------------------ contact and other ends

@pytest.mark.parametrize("method", [CentralDifference(512), Newmark(512), RungeKutta()], ids=NAMES)
def test_contact_is_said_with_time_and_angle(peer, speed, method):
    run = integrate(peer, method, speed=speed, static_eccentricity=0.3, revolutions=50)
    assert not run.finished
    found = re.search(r"touches the stator after ([\d.]+) revolutions \(([\d.]+) s\), "
                      r"at gap angle (\d+)°", run.stopped)
    turns, time, angle = map(float, found.groups())
    assert turns == pytest.approx(time * speed / (2 * math.pi), abs=0.01)
    assert run.times[-1] < time * 1.001
    assert run.times[-1] == pytest.approx(time, abs=3 * 2 * math.pi / speed / 128)
    assert np.isfinite(run.positions).all()
    assert not run.interrupted
    gaps = peer.law.smallest_gap(run.positions - run.centre[:, None])
    assert 0 < gaps[-1] == gaps.min()
    assert angle == pytest.approx(270, abs=15)  # the stator moved to +x, so the rotor falls to −x
    assert len(run.times) == run.positions.shape[1]
    with pytest.raises(BadInput, match="cannot be gone on from"):
        integrate(peer, method, speed=speed, start=run)


def test_all_methods_touch_at_the_same_time(peer, speed):
    times = [integrate(peer, method, speed=speed, static_eccentricity=0.2, revolutions=50).times[-1]
             for method in (CentralDifference(1024), Newmark(1024),
                            RungeKutta(steps_per_revolution=1024))]
    assert np.ptp(times) < 5 * 2 * math.pi / speed / 1024


@pytest.mark.parametrize("shift", [0.0, 0.5, 1.5])
def test_contact_right_after_the_start_of_a_revolution(peer, speed, shift):
    """No sample at all lies before contact in that block."""
    start = HarmonicBalance().solve(peer, speed, 0.05)
    run = integrate(peer, RungeKutta(steps_per_revolution=8), speed=speed,
                    static_eccentricity=0.05, revolutions=2,
                    start=start, disturbance=(-9.6e-3 + 1e-4 * shift, 0.0))
    assert not run.finished
    assert "touches the stator" in run.stopped


def test_a_start_outside_the_gap_is_contact(peer, speed):
    for method in (CentralDifference(64), Newmark(64), RungeKutta()):
        run = integrate(peer, method, speed=speed, revolutions=2, disturbance=(0.02, 0.0))
        assert "touches the stator" in run.stopped
        assert not run.finished


def test_without_a_gap_a_motion_may_grow_beyond_all_numbers(oscillator):
    grows = replace(oscillator, law=LinearPull(5e6, math.inf))
    run = integrate(grows, Newmark(64), speed=5.0, revolutions=200)
    assert not run.finished
    assert "grew beyond all numbers" in run.stopped


def test_newmark_says_when_a_step_is_too_long(peer, speed):
    """A law whose force jumps has no position that solves the step."""
    class Jump(CircularPull):
        def linearise(self, e, *rest):
            force = 1e9 * np.where(e[0] > 0, -1.0, 1.0) * np.array([1.0, 0.0])
            return force, np.zeros((2, 2)), None
    run = integrate(replace(peer, law=Jump(1.0, peer.gap)), Newmark(16), speed=speed, revolutions=1)
    assert not run.finished
    assert "Use more steps" in run.stopped


# ------------------------------------------------------------------ interrupting and going on

@pytest.mark.parametrize("method", [CentralDifference(128), Newmark(64), RungeKutta(1e-11)],
                         ids=NAMES)
def test_interrupt_keeps_what_was_done_and_going_on_is_exact(unit, speed, method):
    options = {"speed": speed, "static_eccentricity": 0.05, "ramp": 6}
    calls = []

    def progress(done, total):
        calls.append((done, total))
        if done == 4:
            raise KeyboardInterrupt

    part = integrate(unit, method, revolutions=10, progress=progress, modes=4, **options)
    assert calls == [(1, 10), (2, 10), (3, 10), (4, 10)]
    assert not part.finished
    assert part.revolutions == pytest.approx(4)
    assert "Interrupted after 4 of 10" in part.stopped
    assert part.interrupted
    with pytest.raises(BadInput, match="revolutions is 5, and the motion has 4"):
        part.coefficients(4, revolutions=5)
    whole = integrate(unit, method, revolutions=10, modes=4, **options)
    rest = integrate(unit, method, revolutions=6, start=part, modes=4, **options)
    assert rest.times[-1] == pytest.approx(whole.times[-1])
    scale = np.abs(whole.positions).max()
    samples = method.steps_per_revolution
    assert np.abs(part.positions - whole.positions[:, :4 * samples + 1]).max() < 1e-12 * scale
    assert np.abs(rest.positions - whole.positions[:, 4 * samples:]).max() < 1e-11 * scale
    assert rest.state == pytest.approx(whole.state, rel=1e-8, abs=1e-8 * np.abs(whole.state).max())


def test_going_on_with_another_basis_is_refused(unit, speed):
    part = integrate(unit, Newmark(64), speed=speed, revolutions=1, modes=4)
    with pytest.raises(BadInput, match="10 DOFs, this basis 14"):
        integrate(unit, Newmark(64), speed=speed, revolutions=1, start=part)


def test_another_speed_takes_the_basis_of_that_speed():
    """Dashpots give each speed a basis of its own; the motion goes on in it where it was."""
    machine = load_machine("kaplan-150rpm")
    stiff = replace(machine, damping=None, bearings=tuple(
        replace(b, damping=2e7 * np.eye(2)) for b in machine.bearings)).model()
    first = integrate(stiff, Newmark(256), speed=rpm(150), revolutions=3, modes=4)
    then = integrate(stiff, Newmark(256), speed=rpm(220), revolutions=3, modes=4, start=first)
    assert then.model.size != first.model.size or not np.allclose(then.model.K, first.model.K)
    assert np.abs(then.positions[:, 0] - first.positions[:, -1]).max() < 1e-3 * np.abs(
        first.positions).max()
    heavier = stiff.with_number("bodies.generator.mass", 1.5e5)
    with pytest.raises(BadInput, match="another machine"):
        integrate(heavier, Newmark(256), speed=rpm(220), revolutions=1, modes=4, start=first)


def test_reading_a_trajectory(unit, speed):
    run = integrate(unit, CentralDifference(128), speed=speed, revolutions=3, modes=4)
    times, positions = run.last(1)
    assert len(times) == 129
    assert positions.shape == (2, 129)
    assert "3 revolutions at 150 rpm" in str(run)


# ------------------------------------------------------------------ refusals

@pytest.mark.parametrize(("options", "words"), [
    ({"speed": 0.0}, "speed is"), ({"revolutions": 0}, "at least 1"),
    ({"revolutions": 1.5}, "whole number"),
    ({"ramp": 7}, "between 0 and the 5"), ({"ramp": -1}, "ramp"), ({"modes": 0}, "modes is 0"),
    ({"static_eccentricity": 1.5}, "fraction of the gap")])
def test_arguments_are_checked(peer, speed, options, words):
    with pytest.raises(BadInput, match=words):
        integrate(peer, Newmark(16), **{"speed": speed, "revolutions": 5, **options})


@pytest.mark.parametrize(("make", "words"), [
    (lambda: CentralDifference(4), "at least 8"), (lambda: Newmark(12.0), "whole number"),
    (lambda: Newmark(beta=0.0), "beta"), (lambda: Newmark(gamma=0.2), "gamma"),
    (lambda: RungeKutta(rtol=2.0), "rtol")])
def test_options_are_checked(make, words):
    with pytest.raises(BadInput, match=words):
        make()


def test_a_massless_or_free_machine_is_refused(make_kaplan, speed):
    machine = make_kaplan()
    weightless = replace(machine, shaft=replace(machine.shaft, density=0.0), damping=None).model()
    free = replace(machine, bearings=(), thrust_bearings=(), damping=None).model()
    for model in (weightless, free):
        for modes in (4, None):
            with pytest.raises(BadInput):
                integrate(model, Newmark(16), speed=speed, revolutions=1, modes=modes)


def test_any_model_can_be_integrated(speed):
    """Three coordinates, cross-coupled springs: solvers see a Model by its attributes."""
    K = 1e6 * np.array([[4.0, 0.3, -1], [-0.3, 4, 0], [-1, 0, 3]])
    model = Model("three", 1e3 * np.eye(3), 3e3 * np.eye(3), 0 * K, K, np.array([5.0, 0, 0]),
                  np.array([0, 5.0, 0]),
                  np.eye(2, 3), CircularPull(1e6, 0.01), 0.01, np.zeros(1), np.eye(3))
    orbit = HarmonicBalance(12).solve(model, speed, 0.1)
    run = integrate(model, RungeKutta(), speed=speed, static_eccentricity=0.1, revolutions=2,
                    start=orbit)
    assert run.positions == pytest.approx(orbit.positions(speed * run.times), abs=1e-9)
