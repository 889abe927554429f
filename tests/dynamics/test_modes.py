"""Modes, whirl direction and Campbell diagrams against closed forms and independent eigenproblems.
"""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
import scipy.linalg

from hydrolab import HarmonicBalance, load_machine
from hydrolab.dynamics.modes import (
    campbell,
    critical_speeds,
    modes,
    speed_margins,
    undamped_frequencies,
)
from hydrolab.errors import BadInput
from hydrolab.machine.model import Model, rayleigh_coefficients
from hydrolab.machine.parts import (
    Machine,
    RadialBearing,
    RayleighDamping,
    RigidBody,
    Shaft,
    ThrustBearing,
)
from hydrolab.machine.pull import CircularPull

RPM = pi / 30


def one_node(M, C, G, K):
    """A rigid body at one node: (x, z), or (x, z, θx, θz)."""
    n = len(M)
    return Model("one node", M, C, G, K, np.zeros(n), np.zeros(n), np.eye(2, n),
                 CircularPull(0.0, np.inf), np.inf, np.zeros(1), np.eye(n))


def point_mass(mass, damping, stiffness):
    return one_node(mass * np.eye(2), damping * np.eye(2), np.zeros((2, 2)), stiffness * np.eye(2))


def gyroscope(Id, Ip, tilt_stiffness, mass=2.0, stiffness=3e9):
    G = np.zeros((4, 4))
    G[2, 3], G[3, 2] = -Ip, Ip
    return one_node(np.diag([mass, mass, Id, Id]), np.zeros((4, 4)), G,
                    np.diag([stiffness, stiffness, tilt_stiffness, tilt_stiffness]))


def rotor(stiffness=(1.37e9, 1.64e9), damping=None, bearing_damping=0.0):
    shaft = Shaft(np.linspace(0, 9.04, 7), 0.71, 2e11, 7850, element="timoshenko")
    bodies = RigidBody("generator", 0, 1.5e5, 3e5, 5e5, -0.472), RigidBody("turbine", 6, 5e4, 4e4,
                                                                           6e4)
    bearings = (RadialBearing("upper", 1, stiffness[0], bearing_damping),
                RadialBearing("lower", 5, stiffness[1], bearing_damping))
    return Machine("rotor", 150 * RPM, shaft, bodies, bearings, (ThrustBearing("thrust", 3, 5e7),),
                   damping).model()


def free_motion(model, speed, q, v, times):
    """The equation of motion itself, by the matrix exponential: displacements at equal time steps,
    (n, T).
    """
    n = len(q)
    inverse = np.linalg.inv(model.M)
    A = np.block([[np.zeros((n, n)), np.eye(n)],
                  [-inverse @ model.K, -inverse @ (model.C + speed * model.G)]])
    step = scipy.linalg.expm(A * (times[1] - times[0]))
    state, path = np.concatenate([q, v]), []
    for _ in times:
        path.append(state[:n])
        state = step @ state
    return np.array(path).T


def test_damped_oscillator():
    mass, stiffness, ratio = 3.0, 1200.0, 0.1
    omega = sqrt(stiffness / mass)
    found = modes(point_mass(mass, 2 * ratio * omega * mass, stiffness), 7.0)
    exact = omega * (-ratio + 1j * sqrt(1 - ratio**2))
    np.testing.assert_allclose(found.eigenvalues, [exact, exact], rtol=1e-12)
    np.testing.assert_allclose(found.damping_ratios, ratio, rtol=1e-12)
    np.testing.assert_allclose(found.hertz, exact.imag / (2 * pi), rtol=1e-12)
    assert len(found.real_eigenvalues) == 0


@pytest.mark.parametrize("ratio", [2.0, 5.0])
def test_overdamped_motion_is_real(ratio):
    found = modes(point_mass(1.0, 2 * ratio, 1.0))
    exact = [-ratio - sqrt(ratio**2 - 1), -ratio + sqrt(ratio**2 - 1)]
    assert len(found) == 0
    np.testing.assert_allclose(found.real_eigenvalues, np.repeat(exact, 2), rtol=1e-12)


def test_a_negative_stiffness_drives_the_rotor_away():
    found = modes(point_mass(1.0, 0.0, -4.0))
    np.testing.assert_allclose(found.real_eigenvalues, [-2, -2, 2, 2], rtol=1e-12)
    with pytest.raises(BadInput, match="unstable at rest"):
        undamped_frequencies(point_mass(1.0, 0.0, -4.0))


@pytest.mark.parametrize("speed", [40.0, -40.0])
def test_gyroscope(speed):
    # Id ω² − Ip Ω ω − k = 0 with ω > 0 turning from z to x: the fast mode turns with the spin
    Id, Ip, k = 2.0, 3.0, 5e3
    found = modes(gyroscope(Id, Ip, k), speed)
    fast, slow = (abs(sign * Ip * 40 + sqrt((Ip * 40) ** 2 + 4 * Id * k)) / (2 * Id)
                  for sign in (1, -1))
    np.testing.assert_allclose(found.frequencies[:2], [slow, fast], rtol=1e-12)
    assert found.direction[:2] == ("backward", "forward")
    np.testing.assert_allclose(found.whirl[:2], np.sign(speed) * np.array([-1, 1]), rtol=1e-9)


def test_forward_whirl_turns_with_the_spin_in_numbers():
    model, speed = rotor(), 150 * RPM
    found = modes(model, speed)
    assert found.direction[:4] == ("backward", "forward", "backward", "forward")
    assert found.frequencies[1] > 1.2 * found.frequencies[0]
    times = np.linspace(0, 0.2, 81)
    # a rotating unbalance, (x, z)
    spin = np.unwrap(np.arctan2(np.sin(speed * times), np.cos(speed * times)))
    assert (np.diff(spin) > 0).all()
    for mode, sense in ((0, -1), (1, 1), (2, -1), (3, 1)):
        shape, value = found.shapes[:, mode], found.eigenvalues[mode]
        path = free_motion(model, speed, shape.real, (value * shape).real, times)
        # gap angle, from z towards x, at the shaft top
        angle = np.unwrap(np.arctan2(path[0], path[1]))
        np.testing.assert_allclose(np.diff(angle), sense * value.imag * (times[1] - times[0]),
                                   rtol=1e-6)


def test_an_unbalance_excites_forward_whirl_only():
    # with isotropic bearings the answer to (sin Ωt, cos Ωt) is orthogonal (in M) to every backward
    # mode
    model, speed = replace(rotor(), unbalance_sin=np.eye(28)[0],
                           unbalance_cos=np.eye(28)[1]), 150 * RPM
    dynamic = model.K - speed**2 * model.M + 1j * speed * (model.C + speed * model.G)
    answer = np.linalg.solve(dynamic, speed**2 * (model.unbalance_cos - 1j * model.unbalance_sin))
    found = modes(model, speed)
    share = np.abs(found.shapes.conj().T @ model.M
                   @ answer) / sqrt((answer.conj() @ model.M @ answer).real)
    backward = np.array(found.direction) == "backward"
    assert share[backward].max() < 1e-7
    assert share[~backward][0] > 0.1


def test_shapes_solve_the_quadratic_eigenproblem():
    model, speed = rotor(stiffness=([1.37e9, 1e9], [[1.64e9, 2e8], [-1e8, 1.2e9]]),
                         bearing_damping=1e6), 15.7
    found = modes(model, speed)
    assert (np.diff(found.frequencies) >= 0).all()
    np.testing.assert_allclose(np.einsum("im,ij,jm->m", found.shapes.conj(), model.M,
                                         found.shapes), 1, rtol=1e-10)
    for value, shape in zip(found.eigenvalues, found.shapes.T, strict=True):
        terms = value**2 * (model.M @ shape), value * (model.C + speed
                                                       * model.G) @ shape, model.K @ shape
        assert np.abs(sum(terms)).max() < 1e-9 * max(np.abs(t).max() for t in terms)
    # every eigenvalue is there: the sum of all of them is −trace(M⁻¹(C + ΩG))
    total = 2 * found.eigenvalues.real.sum() + found.real_eigenvalues.sum()
    assert total == pytest.approx(-np.trace(np.linalg.solve(model.M, model.C)), rel=1e-8)
    assert 2 * len(found) + len(found.real_eigenvalues) == 2 * len(model.M)


def test_at_rest_nothing_whirls():
    assert set(modes(rotor()).direction[:8]) == {"planar"}
    assert set(modes(rotor(stiffness=([1.37e9, 1e9], [1.64e9, 1.2e9]))).direction[:8]) == {"planar"}


def test_undamped_frequencies_are_the_modes_at_rest():
    model = rotor()
    np.testing.assert_allclose(undamped_frequencies(model)[:12], modes(model).frequencies[:12],
                               rtol=1e-9)


def test_a_free_shaft_has_four_rigid_motions():
    model = Machine("free", 0.0, Shaft(np.linspace(0, 9.04, 21), 0.71, 2e11, 7850), ()).model()
    omega = undamped_frequencies(model)
    assert (omega[:4] == 0).all() and (omega[4:] > 200).all()
    at_rest = modes(model)
    assert len(at_rest.real_eigenvalues) == 8 and np.abs(at_rest.real_eigenvalues).max() < 1e-2
    assert at_rest.frequencies[0] == pytest.approx(omega[4], rel=1e-8)
    # spun, its axis precesses as that of a rigid rod: Ω Ip / Id, forward
    speed, r, length = 20.0, 0.71 / 2, 9.04
    spun = modes(model, speed)
    ratio = (r**2 / 2) / (r**2 / 4 + length**2 / 12)
    assert spun.frequencies[0] == pytest.approx(speed * ratio, rel=1e-3)
    assert spun.direction[0] == "forward"


def test_critical_speeds_of_a_gyroscope():
    # on the 1X line: (Id − Ip) Ω² = k forward, (Id + Ip) Ω² = k backward
    Id, Ip, k = 3.0, 2.0, 5e3
    found = campbell(gyroscope(Id, Ip, k), np.linspace(0, 120, 25), branches=2)
    np.testing.assert_allclose(found.critical_speeds, [sqrt(k / (Id + Ip)), sqrt(k / (Id - Ip))],
                               rtol=1e-9)
    at = found.whirl[-1, found.critical_branches]
    np.testing.assert_allclose(at, [-1, 1], rtol=1e-9)
    # Ip > Id: the forward branch outruns the line
    disc = campbell(gyroscope(2.0, 3.0, k), np.linspace(0, 500, 51), branches=2)
    np.testing.assert_allclose(disc.critical_speeds, [sqrt(k / 5)], rtol=1e-9)


@pytest.mark.parametrize("speeds", [np.linspace(0, 900 * RPM, 31), np.linspace(0, 900 * RPM, 4)])
def test_campbell_branches_cross_and_stay_themselves(speeds):
    # isotropic, undamped: forward branches never meet forward ones, so sorting within a direction
    # is exact
    model = rotor()
    found = campbell(model, speeds)
    forward = found.whirl[-1] > 0
    assert forward.sum() == 4
    for row, speed in zip(found.frequencies[1:], speeds[1:], strict=True):
        here = modes(model, speed)
        sense = np.array(here.direction)
        np.testing.assert_allclose(np.sort(row[forward]), here.frequencies[sense == "forward"][:4],
                                   rtol=1e-9)
        np.testing.assert_allclose(np.sort(row[~forward]),
                                   here.frequencies[sense == "backward"][:4], rtol=1e-9)
    assert (np.diff(found.frequencies[:, forward], axis=0) > 0).all()
    assert (np.diff(found.frequencies[:, ~forward], axis=0) < 0).all()
    assert (np.diff(np.argsort(found.frequencies[1:], axis=1), axis=0) != 0).any()  # they do cross


def test_critical_speeds_solve_their_own_eigenproblem():
    # λ = iΩ in the equation of motion: K φ = Ω² (M − iG) φ
    model = rotor(stiffness=([1.37e9, 1e9], [1.64e9, 1.2e9]))
    squares = scipy.linalg.eigvals(model.K.astype(complex), model.M - 1j * model.G)
    exact = np.sort(np.sqrt(squares.real[squares.real > 0]))
    exact = exact[exact < 900 * RPM]
    found = campbell(model, np.linspace(0, 900 * RPM, 31))
    assert len(exact) >= 3
    np.testing.assert_allclose(found.critical_speeds, exact, rtol=1e-8)


def test_campbell_is_even_in_the_speed():
    speeds = np.linspace(-300, 300, 13) * RPM
    found = campbell(rotor(), speeds)
    np.testing.assert_allclose(np.sort(found.frequencies), np.sort(found.frequencies[::-1]),
                               rtol=1e-8)
    assert (np.diff(found.frequencies, axis=0)[:, 0] * np.diff(found.frequencies,
                                                               axis=0)[0, 0] > 0).all()


def test_a_branch_that_stops_oscillating_is_nan():
    Id, Ip, k = 2.0, 3.0, 5e3
    model = replace(gyroscope(Id, Ip, k), C=np.diag([0.0, 0.0, 300.0, 300.0]))
    # λ² Id + λ (c − iΩIp) + k = 0 in θz + iθx (or its conjugate), overdamped at rest: c² > 4 Id k
    found = campbell(model, [-200.0, 0.0, 200.0], branches=4)
    assert not np.isnan(found.frequencies[0]).any()
    lost = np.isnan(found.frequencies[1])
    assert lost.sum() == 2
    np.testing.assert_allclose(found.frequencies[1, ~lost], sqrt(3e9 / 2), rtol=1e-9)


def test_a_campbell_diagram_prints_its_critical_speeds():
    found = campbell(point_mass(4.0, 0.0, 100.0), [0.0, 10.0])
    # √(100/4) = 5 rad/s
    assert str(found) == ("2 modes from 0 to 95.49 rpm, without the magnetic pull; critical speeds "
                          "of 1X: planar 47.75, 47.75 rpm.")
    assert str(campbell(point_mass(4.0, 0.0, 100.0), [0.0, 1.0])).endswith("of 1X: none.")


def test_bad_speeds_are_refused_in_a_sentence():
    for speeds in ([1.0], [2.0, 1.0], [0.0, np.nan]):
        with pytest.raises(BadInput, match="ascending"):
            campbell(point_mass(1.0, 0.0, 1.0), speeds)
    with pytest.raises(BadInput, match="finite"):
        modes(point_mass(1.0, 0.0, 1.0), np.inf)
    with pytest.raises(BadInput, match="branches is 0"):
        campbell(point_mass(1.0, 0.0, 1.0), [0.0, 1.0], branches=0)
    with pytest.raises(BadInput, match="positive definite"):
        modes(replace(point_mass(1.0, 0.0, 1.0), M=np.zeros((2, 2))))


def test_rayleigh_damping_gives_its_ratios_to_the_two_lowest_distinct_modes():
    model = rotor(damping=RayleighDamping((0.01, 0.03)))
    at_rest = modes(model)
    np.testing.assert_allclose(at_rest.damping_ratios[:4], [0.01, 0.01, 0.03, 0.03], rtol=1e-7)
    orthotropic = rotor(stiffness=([1.37e9, 1e9], [1.64e9, 1.2e9]),
                        damping=RayleighDamping((0.01, 0.03)))
    np.testing.assert_allclose(modes(orthotropic).damping_ratios[:2], [0.01, 0.03], rtol=1e-7)
    omega = np.array([2.0, 5.0])
    alpha, beta = rayleigh_coefficients(np.eye(4), np.diag(np.repeat(omega**2, 2)), (0.1, 0.1))
    assert (alpha, beta) == pytest.approx((2 * 0.1 * 2 * 5 / 7, 2 * 0.1 / 7), rel=1e-12)


def test_rayleigh_damping_passes_over_rigid_motions_and_needs_two_frequencies():
    alpha, beta = rayleigh_coefficients(np.eye(3), np.diag([0.0, 4.0, 25.0]), (0.1, 0.1))
    assert (alpha, beta) == pytest.approx((2 / 7, 0.2 / 7), rel=1e-12)
    for K in (np.eye(2), np.zeros((2, 2)), np.diag([0.0, 1.0])):
        with pytest.raises(BadInput, match="two distinct"):
            rayleigh_coefficients(np.eye(2), K, (0.01, 0.01))
    driven = np.array([[2.0, 0.5], [-0.5, 1.0]])  # counts by its symmetric part
    assert rayleigh_coefficients(np.eye(2), driven, (0.01, 0.01)) == pytest.approx(
        rayleigh_coefficients(np.eye(2), np.diag([2.0, 1.0]), (0.01, 0.01)))


# ------------------------------------------------------------------ critical speeds

@pytest.fixture(scope="module")
def kaplan():
    return load_machine("kaplan-150rpm").model()


def in_step(model, speed):
    """Damped frequencies at a speed less the speed, rad/s, by the eigenvalues of M⁻¹ alone."""
    inverse = np.linalg.inv(model.M)
    n = len(inverse)
    A = np.block([[np.zeros((n, n)), np.eye(n)],
                  [-inverse @ model.K, -inverse @ model.velocity_matrix(speed)]])
    return np.linalg.eigvals(A).imag - speed


def test_critical_speeds_of_the_unit(kaplan):
    """K φ = Ω² (M − iG) φ; overdamped motions of the shaft hide none, and none takes long."""
    found = critical_speeds(kaplan)
    squares = 1 / scipy.linalg.eigh(kaplan.M - 1j * kaplan.G, kaplan.K, eigvals_only=True)
    undamped = np.sort(np.sqrt(squares[squares > 0])) / RPM
    assert undamped[:3] == pytest.approx([274.0, 558.4, 839.9], abs=0.05)
    assert found.speeds[:5] / RPM == pytest.approx(undamped[:5], rel=1e-4)
    assert found.direction[:3] == ("backward", "forward", "backward")
    assert found.damping_ratios.max() < 0.71
    for speed in found.speeds[:4]:  # a damped mode turns in step there, to the damping's square
        assert np.abs(in_step(kaplan, speed)).min() < 5e-4 * speed
    diagram = campbell(kaplan, np.linspace(0, 1000 * RPM, 21))
    assert diagram.critical_speeds / RPM == pytest.approx([274.0, 558.4, 839.9], abs=0.1)
    assert diagram.critical_branches.tolist() == [0, 1, 2]
    assert np.isfinite(diagram.eigenvalues).all()
    assert "without the magnetic pull" in str(diagram)


def test_the_pull_lowers_critical_speeds_and_is_said(kaplan):
    k = kaplan.law.stiffness
    soft = replace(kaplan, K=kaplan.K - k * kaplan.selection.T @ kaplan.selection)
    found = critical_speeds(kaplan, pull=True, rated=150 * RPM)
    np.testing.assert_allclose(found.speeds[:6], critical_speeds(soft).speeds[:6], rtol=1e-10)
    assert found.of("forward")[0] / RPM == pytest.approx(373.8, abs=0.1)
    assert found.of("backward")[0] / RPM == pytest.approx(187.3, abs=0.1)
    assert str(found).startswith("Critical speeds of 1X, with the slope of the forces at rest")
    assert "forward: 373.8 rpm (damping ratio 2.2 %)" in str(found)
    assert "rated speed 150.0 rpm: the nearest is 25 % above" in str(found)
    assert "overspeed 210.0 rpm: the nearest is 11 % below" in str(found)
    off = critical_speeds(kaplan.with_field(0), pull=True)
    np.testing.assert_allclose(off.speeds, critical_speeds(kaplan).speeds, rtol=1e-10)
    orbit = HarmonicBalance().solve(kaplan, 150 * RPM, 0.08)
    assert critical_speeds(kaplan, pull=orbit).speeds[0] < found.speeds[0]
    own = campbell(kaplan, np.linspace(0, 500 * RPM, 11), pull=True)
    np.testing.assert_allclose(own.critical_speeds, found.speeds[:2], rtol=1e-10)


@pytest.mark.parametrize("ratio", [0.01, 0.1, 0.4])
def test_damped_critical_speed_of_an_oscillator(ratio):
    """k + iΩc − Ω²m = 0: |Ω| is √(k/m) whatever the damping, and its sine the damping ratio."""
    omega, mass = 40.0, 3.0
    found = critical_speeds(point_mass(mass, 2 * ratio * omega * mass, mass * omega**2))
    np.testing.assert_allclose(found.speeds, omega, rtol=1e-10)
    np.testing.assert_allclose(found.damping_ratios, ratio, rtol=1e-10)
    assert len(critical_speeds(point_mass(mass, 2 * 0.8 * omega * mass, mass * omega**2))) == 0


def test_unlike_directions_and_a_seal_are_exact():
    """Each complex root makes K + iΩC + Ω²(iG − M) singular, for unsymmetric K as well."""
    model = rotor(stiffness=([1.37e9, 1e9], [[1.64e9, 2e8], [-2e8, 1.2e9]]), bearing_damping=1e6)
    found = critical_speeds(model)
    for speed, ratio in list(zip(found.speeds, found.damping_ratios, strict=True))[:6]:
        w = speed * (sqrt(1 - ratio**2) + 1j * ratio)
        dynamic = model.K + 1j * w * model.C + w**2 * (1j * model.G - model.M)
        values = np.linalg.svd(dynamic, compute_uv=False)
        assert values[-1] < 1e-9 * values[0]


def test_order_of_critical_speeds():
    """2X of an oscillator is in step at half its frequency."""
    model = point_mass(3.0, 0.0, 4800.0)
    np.testing.assert_allclose(critical_speeds(model, order=2).speeds, 20.0, rtol=1e-12)


def test_what_is_no_model_is_refused(kaplan):
    machine = load_machine("kaplan-150rpm")
    for verb in (modes, critical_speeds, lambda m: campbell(m, [0.0, 1.0])):
        with pytest.raises(BadInput, match="must be a Model; a Machine makes one"):
            verb(machine)
    with pytest.raises(BadInput, match="pull=orbit"):
        critical_speeds(load_machine("two-pole").model(), pull=True)
    with pytest.raises(BadInput, match="move freely"):
        critical_speeds(replace(kaplan, K=0 * kaplan.K))


def test_speed_margins_are_those_with_the_field_off_and_on():
    machine = load_machine("kaplan-150rpm")
    table = speed_margins(machine.model())
    for share, found in ((0.0, table.off), (1.0, table.on)):
        law = machine.model().with_field(share).law
        model = machine.model()
        slope = model.selection.T @ (law.stiffness * np.eye(2)) @ model.selection
        same = critical_speeds(replace(model, K=model.K - slope))
        assert found.speeds == pytest.approx(same.speeds, rel=1e-9)
    margin = table.on.of("forward")[0] / (375 * RPM) - 1
    assert table.on.margin(375 * RPM, "forward") == pytest.approx(margin)
    assert "nearest to runaway speed, 375.0" in str(table)
    # the two of a point mass are one pair that whirls either way
    point = speed_margins(load_machine("jeffcott").model())
    assert point.off.margin(150 * RPM, "forward") == pytest.approx(
        sqrt(2.7e8 / 1.5e5) / (150 * RPM) - 1)
    with pytest.raises(BadInput, match="give one in rad/s"):
        speed_margins(replace(machine.model(), origin=None))
