"""Harmonic balance against other methods: the linear response, the full twin, exact circles,
DOP853, AUTO.
"""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

from hydrolab import HarmonicBalance, follow, load_machine, newton, powell_dog_leg, sweep
from hydrolab.dynamics.harmonics import from_complex, to_complex
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.model import Model
from hydrolab.machine.parts import RadialBearing, RigidBody
from hydrolab.machine.pull import LinearPull
from tests.reference.full_balance import dynamic_matrix, solve_full


def with_law(model, law):
    from dataclasses import replace
    return replace(model, law=law)


def relative(value, reference):
    return np.abs(value - reference).max() / np.abs(reference).max()


def full_residual(orbit, samples=64):
    """Left over in the full-DOF equations, relative to the forces in them; by the slow twin's
    matrices.
    """
    model, columns = orbit.model, 2 * orbit.harmonics + 1
    turn = 2 * np.pi * np.arange(samples) / samples
    position = orbit.positions(turn) - orbit.centre[:, None]
    forces = model.selection.T @ model.law.force(position) + orbit.speed**2 * (
        np.outer(model.unbalance_sin, np.sin(turn)) + np.outer(model.unbalance_cos, np.cos(turn)))
    spectrum = 2 / samples * np.fft.rfft(forces)[:, :orbit.harmonics + 1]
    spectrum[:, 0] /= 2
    loads = from_complex(spectrum).T.ravel()
    left = dynamic_matrix(model, orbit.speed, orbit.harmonics) @ orbit.shaft.T.ravel() - loads
    assert len(left) == columns * model.size
    return np.abs(left).max() / np.abs(loads).max()


# ------------------------------------------------------------------ the linear machine, exactly

def test_without_field_it_is_the_unbalance_response(unit, speed):
    orbit = HarmonicBalance(harmonics=3).solve(unit.with_field(0.0), speed, 0.05)
    dynamic = unit.K - speed**2 * unit.M + 1j * speed * (unit.C + speed * unit.G)
    response = np.linalg.solve(dynamic, speed**2 * (unit.unbalance_cos - 1j * unit.unbalance_sin))
    assert relative(orbit.shaft[:, 2] - 1j * orbit.shaft[:, 1], response) < 1e-11
    assert np.abs(orbit.shaft[:, [0, 3, 4, 5, 6]]).max() < 1e-15


def test_with_a_linear_pull_it_is_a_softer_machine(unit, speed):
    k, S = unit.law.stiffness, unit.selection
    orbit = HarmonicBalance().solve(with_law(unit, LinearPull(k, unit.gap)), speed, 0.03,
                                    direction=0.4)
    soft = unit.K - k * S.T @ S
    mean = np.linalg.solve(soft, -k * S.T @ unit.centre(0.03, 0.4))
    dynamic = soft - speed**2 * unit.M + 1j * speed * (unit.C + speed * unit.G)
    response = np.linalg.solve(dynamic, speed**2 * (unit.unbalance_cos - 1j * unit.unbalance_sin))
    assert relative(orbit.shaft[:, 0], mean) < 1e-9
    assert relative(orbit.shaft[:, 2] - 1j * orbit.shaft[:, 1], response) < 1e-9


# ------------------------------------------------------------------ the slow twin over all DOFs

@pytest.mark.parametrize("eccentricity", [0.0, 0.05, 0.1])
def test_full_twin_on_the_unit(unit, speed, eccentricity):
    full = solve_full(unit, speed, eccentricity)
    orbit = HarmonicBalance().solve(unit, speed, eccentricity)
    assert relative(orbit.coefficients, unit.selection @ full) < 1e-10
    assert relative(orbit.shaft, full) < 1e-10  # every DOF of the shaft, recovered
    for node in (0, 6, 12):
        assert relative(orbit.node_coefficients(node), full[4 * node:4 * node + 2]) < 1e-10


@pytest.mark.parametrize("seed", range(6))
def test_full_twin_on_random_machines(make_random, seed):
    machine = make_random(np.random.default_rng(seed))
    model = machine.model().with_field(0.4)
    orbit = HarmonicBalance(harmonics=3, samples=48).solve(model, machine.speed, 0.1)
    full = solve_full(model, machine.speed, 0.1, harmonics=3, samples=48)
    assert relative(orbit.shaft, full) < 1e-10


# ------------------------------------------------------------------ exact circles

@pytest.mark.parametrize("radius", [50e-6, 200e-6, 1e-3])
def test_centred_orbit_is_the_exact_circle(make_jeffcott, speed, radius):
    orbit = HarmonicBalance().solve(make_jeffcott(radius=radius).model(), speed)
    assert orbit.amplitudes[:, 0] == pytest.approx([radius, radius], rel=1e-13)
    assert np.abs(orbit.mean).max() < 1e-15 * 11
    assert orbit.amplitudes[:, 1:].max() < 1e-16 * 11
    assert orbit.smallest_gap == pytest.approx(0.011 - radius, rel=1e-12)


def test_whirl_turns_with_the_spin(unit, speed):
    """Unbalance on an isotropic rotor: z + ix is e^{+iΩt} alone, at every node."""
    orbit = HarmonicBalance().solve(unit, speed)
    for node in range(13):
        x, z = to_complex(orbit.node_coefficients(node))[:, 1]  # û of Re û e^{iΩt}
        forward, backward = (z + 1j * x) / 2, (np.conj(z) + 1j * np.conj(x)) / 2
        assert abs(backward) < 1e-10 * abs(forward)
    quarter = orbit.positions(np.array([0.0, 0.1]))
    turn = math.remainder(math.atan2(*quarter[:, 1]) - math.atan2(*quarter[:, 0]), 2 * math.pi)
    assert turn == pytest.approx(0.1, rel=1e-9)  # gap angle, from z towards x, grows


# ------------------------------------------------------------------ the benchmark that peers were
# measured on

def test_peer_benchmark_at_5_percent(peer, speed):
    orbit = HarmonicBalance(harmonics=4, samples=64).solve(peer, speed, 0.05)
    # µm, by DOP853 and by AUTO-07p
    assert abs(orbit.mean[0]) * 1e6 == pytest.approx(933.5975, abs=6e-5)
    assert orbit.amplitudes[0, :3] * 1e6 == pytest.approx([252.1623, 4.163689, 0.018480], abs=6e-5)
    assert orbit.amplitudes[1, :3] * 1e6 == pytest.approx([214.6530, 3.581861, 0.013059], abs=6e-5)


def test_dop853_from_rest_ends_on_the_orbit(peer, speed):
    """A time integration written here, from rest, 200 periods; it decays by 0.844 in each."""
    m, k, c, (fs, fc) = peer.M[0, 0], peer.K[0, 0], peer.C[0, 0], (peer.unbalance_sin,
                                                                   peer.unbalance_cos)
    pull, g0, offset = peer.law.stiffness, peer.gap, 0.05 * peer.gap

    def rate(t, s):
        x, z, vx, vz = s
        e2 = ((x - offset) ** 2 + z * z) / g0**2
        soft = pull * (1 - e2) ** -1.5
        sin, cos = math.sin(speed * t), math.cos(speed * t)
        return (vx, vz, (soft * (x - offset) - k * x - c * vx + speed**2
                         * (fs[0] * sin + fc[0] * cos)) / m,
                (soft * z - k * z - c * vz + speed**2 * (fs[1] * sin + fc[1] * cos)) / m)

    period = 2 * math.pi / speed
    times = 200 * period + period * np.arange(32) / 32
    found = solve_ivp(rate, (0, times[-1]), np.zeros(4), "DOP853", times, rtol=1e-10, atol=1e-14)
    orbit = HarmonicBalance(harmonics=8).solve(peer, speed, 0.05)
    assert relative(orbit.positions(speed * times), found.y[:2]) < 1e-8
    assert relative(orbit.velocities(speed * times), found.y[2:]) < 1e-8


@pytest.mark.parametrize("harmonics", [4, 6, 8, 12])
def test_peer_fold(peer, speed, harmonics):
    from hydrolab.dynamics.following import Arclength
    method = Arclength(HarmonicBalance(harmonics), max_folds=1, tail=0)
    (fold,) = follow(peer, to=0.2, speed=speed, method=method).folds
    assert fold.value == pytest.approx(0.078325643, abs=1e-8)  # AUTO-07p: 0.078325643218


def test_natural_continuation_stops_where_peers_stop(peer, speed):
    for solver in (newton, powell_dog_leg):
        branch = sweep(peer, HarmonicBalance(solver=solver), np.arange(0, 0.1, 0.001), speed=speed)
        assert branch.static_eccentricity[-1] == pytest.approx(0.078)
        assert "between 7.8 % and 7.9 %" in branch.stopped
        assert "`follow`" in branch.stopped


# ------------------------------------------------------------------ derivatives

def test_aft_jacobian_is_the_derivative(unit, speed):
    eq = HarmonicBalance().equations(unit, speed)
    orbit = HarmonicBalance().solve(unit, speed, 0.09)
    y = orbit.coefficients.ravel() / eq.length + 1e-3 * np.random.default_rng(0).normal(size=18)
    residual, jacobian = eq.linearise(y, orbit.centre)
    assert residual == pytest.approx(eq.residual(y, orbit.centre), abs=1e-14)
    step = 1e-6
    columns = [(eq.residual(y + step * e, orbit.centre) - eq.residual(y - step * e, orbit.centre))
               / (2 * step)
               for e in np.eye(18)]
    assert np.abs(jacobian - np.array(columns).T).max() < 1e-8 * np.abs(jacobian).max()


@pytest.mark.parametrize("direction", [math.pi / 2, 0.0, 2.1])
def test_derivative_with_the_eccentricity(unit, speed, direction):
    """A shift of the stator is a shift of the mean the other way, but only in the pull."""
    eq = HarmonicBalance().equations(unit, speed)
    orbit = HarmonicBalance().solve(unit, speed, 0.05, direction=direction)
    y, step = orbit.coefficients.ravel() / eq.length, 1e-6
    difference = (eq.residual(y, unit.centre(0.05 + step, direction))
                  - eq.residual(y, unit.centre(0.05 - step, direction))) / (2 * step)
    pull_slope = eq.stiffness - eq.linearise(y, orbit.centre)[1]
    shift = np.zeros((2, 9))
    shift[:, 0] = math.sin(direction), math.cos(direction)
    assert relative(pull_slope @ shift.ravel() * unit.gap / eq.length, difference) < 1e-8


# ------------------------------------------------------------------ solvers

@pytest.mark.parametrize("eccentricity", [0.0, 0.04, 0.09, 0.103])
def test_newton_and_dog_leg_agree(unit, speed, eccentricity):
    one = HarmonicBalance(solver=newton).solve(unit, speed, eccentricity)
    two = HarmonicBalance(solver=powell_dog_leg).solve(unit, speed, eccentricity)
    assert relative(one.coefficients, two.coefficients) < 1e-9


def test_dog_leg_takes_no_minimum_for_a_solution(peer, speed, monkeypatch):
    """Just past the fold the residual has a minimum above zero, and MINPACK likes it."""
    last = HarmonicBalance().solve(peer, speed, 0.0783)
    method = HarmonicBalance(solver=powell_dog_leg)
    eq, centre = last.equations, peer.centre(0.0785)
    start = last.coefficients.ravel() / eq.length
    raw = root(lambda y: eq.linearise(y, centre), start, jac=True, method="hybr",
               options={"xtol": 1e-3})
    assert raw.success  # with a coarse tolerance it even says that it converged …
    assert np.abs(raw.fun).max() * eq.force > 1.0  # … to a point where newtons are left over
    with monkeypatch.context() as patch:
        patch.setattr("hydrolab.dynamics.solvers.root", lambda *args, **options: raw)
        assert not powell_dog_leg(lambda y: eq.linearise(y, centre), start).converged
    with pytest.raises(NoConvergence) as failure:
        method.solve(peer, speed, 0.0785, start=last)
    for words in ("powell_dog_leg stopped at 7.85 %", "N: a fold is near", "`follow`",
                  "does not show"):
        assert words in str(failure.value)


def test_newton_near_a_fold_keeps_its_accuracy(peer, speed):
    """σ is small there, so a residual that is small enough elsewhere leaves a large error."""
    eq = HarmonicBalance().equations(peer, speed)
    fold = follow(peer, to=0.2, speed=speed).folds[0]
    centre = peer.centre(fold.value - 1e-7)
    loose = newton(lambda y: eq.linearise(y, centre), fold.unknowns + 1e-4)
    tight = newton(lambda y: eq.linearise(y, centre), loose.y, tolerance=1e-14)
    assert loose.converged
    assert np.abs(loose.y - tight.y).max() < 1e-10


def test_newton_finds_the_root_of_a_known_system():
    def system(y):
        return np.array([y[0] ** 2 + y[1] ** 2 - 4, y[0] - y[1]]), np.array([[2 * y[0], 2 * y[1]],
                                                                             [1.0, -1.0]])
    for solver in (newton, powell_dog_leg):
        solution = solver(system, np.array([3.0, 1.0]))
        assert solution.converged
        assert solution.y == pytest.approx([math.sqrt(2)] * 2, rel=1e-14)
    assert solution.smallest_singular_value == pytest.approx(math.sqrt(2), rel=1e-6)
    none = newton(lambda y: (np.array([y[0] ** 2 + 1]), np.array([[2 * y[0]]])), np.array([0.7]))
    assert not none.converged


# ------------------------------------------------------------------ failures are sentences

def test_beyond_every_steady_state(peer, speed):
    with pytest.raises(NoConvergence,
                       match=r"newton stopped at 30 % after \d+ steps, .*`follow`.*does not show"):
        HarmonicBalance().solve(peer, speed, 0.3)


def test_unbalance_larger_than_the_gap(peer, speed):
    with pytest.raises(NoConvergence, match="the rotor outside the gap"):
        HarmonicBalance().solve(peer.with_unbalance(200.0), speed)


def test_an_orbit_that_touches_is_contact(peer, speed):
    """A linear pull lets the rotor through the stator; the orbit found is not one of the machine.
    """
    weak = with_law(peer, LinearPull(0.3 * peer.law.stiffness, peer.gap))
    with pytest.raises(Contact,
                       match=r"stator.*after 0\.\d\d revolutions.*gap angle \d+°") as contact:
        HarmonicBalance().solve(weak.with_unbalance(150.0), speed)
    assert "Lower" in str(contact.value)


def test_contact_says_when_and_where(peer, speed):
    """Whirl of 8 mm about a mean that the stator's offset moves to −x: first contact on the −x
    side.
    """
    law = LinearPull(0.5 * peer.law.stiffness, peer.gap)
    linear = with_law(peer, law)
    circle = HarmonicBalance().solve(linear, speed).amplitudes[0, 0]
    big = linear.with_unbalance(8e-3 / circle)
    safe = HarmonicBalance().solve(big, speed, 0.1)
    safe.require_clear()
    with pytest.raises(Contact) as contact:
        HarmonicBalance().solve(big, speed, 0.3)
    phase = np.linspace(0, 2 * math.pi, 20001)
    from hydrolab.dynamics.harmonic_balance import orbit_from
    eq = HarmonicBalance().equations(big, speed)
    orbit = orbit_from(eq, 0.3, big.centre(0.3),
                       newton(lambda y: eq.linearise(y, big.centre(0.3)), eq.linear.ravel()))
    e = orbit.positions(phase) - orbit.centre[:, None]
    first = int(np.argmax(np.hypot(*e) >= big.gap))
    angle = math.degrees(math.atan2(*e[:, first])) % 360
    words = str(contact.value)
    time = float(words.split("(")[1].split(" s")[0])
    assert time == pytest.approx(phase[first] / speed, abs=2 * math.pi / 360 / speed)
    assert float(words.split("gap angle ")[1].split("°")[0]) == pytest.approx(angle, abs=2)


def test_sweep_stops_before_contact(peer, speed):
    linear = with_law(peer, LinearPull(0.9 * peer.law.stiffness, peer.gap))
    branch = sweep(linear, HarmonicBalance(), np.arange(0, 0.9, 0.05), speed=speed)
    assert "touches the stator" in branch.stopped
    assert branch.smallest_gaps.min() > 0
    assert branch.smallest_gaps[-1] == pytest.approx(branch[-1].smallest_gap, rel=1e-12)


@pytest.mark.parametrize(("options", "words"), [
    ({"harmonics": 0}, "from 1 to 64"), ({"harmonics": 65}, "from 1 to 64"),
    ({"harmonics": 2.0}, "whole number"),
    ({"harmonics": True}, "whole number"), ({"samples": 9}, "at least 10"),
    ({"samples": 64.0}, "samples is 64.0")])
def test_options_are_checked(options, words):
    with pytest.raises(BadInput, match=words):
        HarmonicBalance(**options)


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan, math.inf])
def test_speed_is_checked(peer, speed):
    with pytest.raises(BadInput, match="speed is"):
        HarmonicBalance().solve(peer, speed)


def test_a_free_rotor_is_refused(make_kaplan, speed):
    machine = make_kaplan()
    from dataclasses import replace
    for bearings in ((), (RadialBearing("one", 3, 1e9),)):
        free = replace(machine, bearings=bearings, thrust_bearings=(), damping=None).model()
        with pytest.raises(BadInput, match="give it bearings"):
            HarmonicBalance().solve(free, speed)


def test_an_undamped_resonance_is_refused():
    from hydrolab.machine.parts import Machine
    disc = RigidBody("disc", 0, 100.0, 0.0, 0.0, unbalance=0.1)
    model = Machine("m", 10.0, None, (disc,), (RadialBearing("b", 0, 100.0 * 30.0**2),)).model()
    with pytest.raises(BadInput, match="resonance"):
        HarmonicBalance().solve(model, 30.0)
    with pytest.raises(BadInput, match="harmonic 3"):
        HarmonicBalance().solve(model, 10.0)


# ------------------------------------------------------------------ small things

def test_coefficients_and_complex_amplitudes():
    random = np.random.default_rng(3)
    coefficients, phase = random.normal(size=(2, 9)), np.array([0.3, 2.0])
    amplitudes = to_complex(coefficients)
    wave = np.real(amplitudes @ np.exp(1j * np.outer(np.arange(5), phase)))
    written = coefficients[:, :1] + sum(coefficients[:, [2 * k - 1]] * np.sin(k * phase)
                                        + coefficients[:, [2 * k]] * np.cos(k * phase)
                                        for k in range(1, 5))
    assert wave == pytest.approx(written)
    assert from_complex(amplitudes) == pytest.approx(coefficients, abs=1e-16)


def test_start_may_have_other_harmonics(unit, speed):
    few = HarmonicBalance(harmonics=2).solve(unit, speed, 0.09)
    many = HarmonicBalance(harmonics=8).solve(unit, speed, 0.09, start=few)
    assert relative(HarmonicBalance(harmonics=8).solve(unit, speed, 0.09).coefficients,
                    many.coefficients) < 1e-10


def test_the_walk_finds_what_the_linear_guess_does_not(peer, speed):
    """From a linear response that fills half the gap Newton goes astray; raising the pull in steps
    does not.
    """
    heavy = peer.with_unbalance(30.0)
    eq, centre = HarmonicBalance().equations(heavy, speed), heavy.centre(0.05)
    assert not newton(lambda y: eq.linearise(y, centre), eq.linear.ravel()).converged
    orbit = HarmonicBalance().solve(heavy, speed, 0.05)
    assert full_residual(orbit) < 1e-9


def test_turning_the_offset_turns_the_orbit(unit, speed):
    """The machine is isotropic, so an offset along z gives the same orbit, turned and a quarter
    period earlier.
    """
    along_x = HarmonicBalance().solve(unit, speed, 0.09)
    along_z = HarmonicBalance().solve(unit, speed, 0.09, direction=0.0)
    phase = np.linspace(0, 6, 20)
    x, z = along_x.positions(phase)
    assert relative(along_z.positions(phase - math.pi / 2), np.array([-z, x])) < 1e-9


def test_model_is_not_needed_to_be_a_machine(speed):
    """Solvers see a Model by its attributes: a third coordinate, a cross-coupled spring, no shaft.
    """
    one = np.eye(3)
    K = 1e6 * np.array([[4.0, 0.3, -1], [-0.3, 4, 0], [-1, 0, 3]])
    model = Model("three", 1e3 * one, 3e3 * one, 0 * one, K, np.array([5.0, 0, 0]),
                  np.array([0, 5.0, 0]),
                  np.eye(2, 3), LinearPull(1e6, 0.01), 0.01, np.zeros(1), np.eye(3))
    orbit = HarmonicBalance(1).solve(model, speed, 0.1)
    assert relative(orbit.shaft, solve_full(model, speed, 0.1, harmonics=1)) < 1e-10


def test_arguments_of_another_kind_are_a_sentence(unit, speed):
    balance, machine = HarmonicBalance(), load_machine("kaplan-150rpm")
    with pytest.raises(BadInput, match=r"model is a Machine; .* makes one by its method model\(\)"):
        balance.solve(machine, speed)
    with pytest.raises(BadInput, match=r"static_eccentricity is '0\.05'; it must be a number"):
        balance.solve(unit, speed, "0.05")
    with pytest.raises(BadInput, match="solver is 'newton'; it must be a function"):
        HarmonicBalance(solver="newton")
    with pytest.raises(NoConvergence, match="Lower the eccentricity, the unbalance or the field"):
        balance.solve(unit.with_unbalance(1e6), speed)
    # as a loop over np.arange gives it
    assert HarmonicBalance(np.int64(6)).solve(unit, speed, 0.02).harmonics == 6
