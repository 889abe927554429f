"""What orbits and motions say of the machine: places, bearing forces, contact, phase."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hydrolab import (
    CentralDifference,
    HarmonicBalance,
    Newmark,
    RungeKutta,
    follow,
    integrate,
    load_machine,
    orbits_at,
    rpm,
    self_crossings,
    sweep,
    update_branch,
)
from hydrolab.dynamics.harmonics import PERIOD, fit, rates, synthesise
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.parts import RadialBearing
from hydrolab.machine.pull import LinearPull, Placed, SeveralLaws
from tests.machines import MACHINES

METHODS = [CentralDifference(256), Newmark(256), RungeKutta()]


@pytest.fixture(scope="module")
def shipped():
    return load_machine("kaplan-150rpm")


@pytest.fixture(scope="module")
def orbit(shipped):
    return HarmonicBalance().solve(shipped.model(), shipped.speed, 0.05)


# ------------------------------------------------------------------ sums of harmonics

def test_a_fit_gives_back_what_was_added_up():
    random = np.random.default_rng(2)
    coefficients, phase = random.normal(size=(3, 2, 9)), np.sort(random.uniform(0, 12, 40))
    assert fit(synthesise(coefficients, phase), phase, 4) == pytest.approx(coefficients, rel=1e-10)
    h = 1e-6
    slope = (synthesise(coefficients, phase + h) - synthesise(coefficients, phase - h)) / (2 * h)
    assert synthesise(rates(coefficients), phase) == pytest.approx(slope, abs=1e-7)


# ------------------------------------------------------------------ bearing forces

def test_forces_of_a_bearing_with_dashpots_unlike_in_x_and_z():
    """A point mass: what the bearing carries is the pull, the unbalance and the inertia."""
    machine = MACHINES["unlike directions"]()
    model, speed = machine.model(), machine.speed
    orbit = HarmonicBalance(8).solve(model, speed, 0.03)
    (force,) = orbit.bearing_forces.values()
    phase = PERIOD
    q = orbit.positions(phase)
    acceleration = speed**2 * synthesise(rates(rates(orbit.coefficients)), phase)
    pull = model.law.force(q - orbit.centre[:, None])
    shaking = speed**2 * (np.outer(model.unbalance_sin, np.sin(phase))
                          + np.outer(model.unbalance_cos, np.cos(phase)))
    carried = pull + shaking - model.M @ acceleration
    assert force.static == pytest.approx(carried.mean(axis=1), rel=1e-7, abs=1e-3)
    assert force.peak == pytest.approx(np.hypot(*carried).max(), rel=1e-7)
    w = fit(carried, phase, 1)
    forward = abs(w[1, 2] + w[0, 1] + 1j * (w[0, 2] - w[1, 1])) / 2
    backward = abs(w[1, 2] - w[0, 1] + 1j * (-w[0, 2] - w[1, 1])) / 2
    assert force.first == pytest.approx(forward + backward, rel=1e-7)
    assert str(force).startswith("springs: static ")


def test_forces_of_all_bearings_hold_the_machine(shipped):
    """Moved sideways as a whole, a machine without Rayleigh damping feels its bearings, the pull
    and the unbalance; one bearing has a dashpot, which the largest force once left out.
    """
    first, *others = shipped.bearings
    damped = RadialBearing(first.name, first.node, first.stiffness, 1e7)
    machine = replace(shipped, bearings=(damped, *others), damping=None)
    model, speed = machine.model(), machine.speed
    orbit = HarmonicBalance(8).solve(model, speed, 0.05)
    q, v, a = (synthesise(c, PERIOD) for c in (orbit.shaft, speed * rates(orbit.shaft),
                                               speed**2 * rates(rates(orbit.shaft))))
    sideways = np.tile([1.0, 0.0, 0.0, 0.0], len(model.depths))
    pull = model.law.force(orbit.positions(PERIOD) - orbit.centre[:, None])[0]
    shaking = speed**2 * (sideways @ model.unbalance_sin * np.sin(PERIOD)
                          + sideways @ model.unbalance_cos * np.cos(PERIOD))
    carried = pull + shaking - sideways @ model.M @ a
    bearings = sum(-b.force(b.rows @ q, b.rows @ v, PERIOD, speed)[0]
                   for b in model.supports.values())
    assert bearings == pytest.approx(carried, rel=1e-6, abs=1e-6 * np.abs(carried).max())
    found = orbit.bearing_forces
    assert sum(f.static[0] for f in found.values()) == pytest.approx(carried.mean(), rel=1e-6)
    rows = model.supports[first.name].rows
    both = np.hypot(*(first.stiffness @ rows @ q + 1e7 * rows @ v)).max()
    assert found[first.name].peak == pytest.approx(both, rel=1e-12)


@pytest.mark.parametrize("name", MACHINES)
def test_every_bearing_of_every_machine_has_its_force(name):
    machine = MACHINES[name]()
    model = machine.model()
    e = 0.02 if math.isfinite(model.gap) else 0.0
    forces = HarmonicBalance().solve(model, machine.speed, e).bearing_forces
    assert set(forces) == set(model.supports)
    for force in forces.values():
        assert force.peak >= np.hypot(*force.static) * (1 - 1e-9) > 0 or not e
        assert force.peak <= 5 * (np.hypot(*force.static) + force.first)


# ------------------------------------------------------------------ what is never returned, and
# what can be kept

def test_forces_that_do_not_balance_are_no_steady_state(shipped):
    """Two springs at one place, a hair apart: the elimination has no digits left. Two films on one
    node once gave 1X of 7.97 µm "with a residual of 100 N".
    """
    model = shipped.model()
    here, there = (model.supports[bearing.name].rows for bearing in shipped.bearings)
    spring = LinearPull(-1e8, math.inf)
    laws = SeveralLaws((Placed(model.law, slice(0, 2)), Placed(spring, slice(2, 4)),
                        Placed(spring, slice(4, 6))))

    def apart(share):
        rows = np.vstack([model.selection, here, here + share * there])
        return replace(model, law=laws, selection=rows)

    both = 1e8 * sum(rows.T @ rows for rows in (here, here + 0.1 * there))
    one = HarmonicBalance().solve(replace(model, K=model.K + both), shipped.speed, 0.03)
    two = HarmonicBalance().solve(apart(0.1), shipped.speed, 0.03)
    assert two.coefficients == pytest.approx(one.coefficients, abs=1e-7 * model.gap)
    with pytest.raises(NoConvergence, match=r"do not balance: .* N are left over"):
        HarmonicBalance().solve(apart(1e-6), shipped.speed, 0.03)
    with pytest.raises(BadInput, match="depend on one another"):
        HarmonicBalance().solve(apart(0.0), shipped.speed, 0.03)


@pytest.mark.parametrize("parameter", ["static_eccentricity", "speed", "bodies.generator.mass"])
def test_a_branch_can_be_pickled(shipped, parameter):
    to = {"static_eccentricity": 0.1, "speed": rpm(155), "bodies.generator.mass": 1.25e5}[parameter]
    branch = follow(shipped.model(), parameter, to=to, speed=shipped.speed)
    again = pickle.loads(pickle.dumps(branch))
    assert str(again) == str(branch)
    assert np.array_equal(again.local, branch.local)
    middle = float(branch.values[:2].mean())
    (one, *_), (two, *_) = orbits_at(again, middle), orbits_at(branch, middle)
    assert one.local == pytest.approx(two.local, abs=1e-15)
    assert again[1].smallest_gap == branch[1].smallest_gap


# ------------------------------------------------------------------ phase and contact in time

@pytest.mark.parametrize("method", METHODS)
def test_another_speed_goes_on_at_the_phase_that_was_reached(peer, method):
    """Two and a third turns at 150 rpm, then 160: against one integration of a phase that runs on.
    The phase was once new speed × old clock, 2.13 turns after two.
    """
    slow, fast = rpm(150), rpm(160)
    first = integrate(peer, method, speed=slow, revolutions=2)
    then = integrate(peer, method, speed=fast, revolutions=2, start=first)
    again = integrate(peer, method, speed=slow, revolutions=1, start=then)
    m, inverse = peer, np.linalg.inv(peer.M)
    change = first.times[-1]

    def rate(t, s):
        speed = slow if t < change else fast
        phase = slow * min(t, change) + fast * max(t - change, 0.0)
        force = (m.law.force(s[:2]) + speed**2 * (m.unbalance_sin * math.sin(phase)
                                                  + m.unbalance_cos * math.cos(phase)))
        return np.concatenate([s[2:], inverse @ (force - m.K @ s[:2]
                                                 - m.velocity_matrix(speed) @ s[2:])])

    begin = integrate(peer, RungeKutta(), speed=slow, revolutions=1)
    linear = HarmonicBalance(1).solve(peer.with_field(0.0), slow).state()
    assert begin.positions[:, 0] == pytest.approx(linear[0], rel=1e-9)
    left = solve_ivp(rate, (0, change), linear.ravel(), method="DOP853", rtol=1e-11, atol=1e-15)
    right = solve_ivp(rate, (change, then.times[-1]), left.y[:, -1], method="DOP853", rtol=1e-11,
                      atol=1e-15)
    allowed = 1e-6 if isinstance(method, RungeKutta) else 2e-3
    size = np.abs(then.positions).max()
    assert then.positions[:, -1] == pytest.approx(right.y[:2, -1], abs=allowed * size)
    assert then.phases[0] == pytest.approx(first.phases[-1], abs=1e-12)
    assert again.phases[-1] == pytest.approx(5 * 2 * math.pi, abs=1e-9)
    assert then.coefficients(4).shape == (2, 9)


def test_a_motion_of_another_machine_is_refused(shipped, orbit):
    model, speed = shipped.model(), shipped.speed
    run = integrate(model, Newmark(64), speed=speed, revolutions=1)
    heavier = model.with_number("bodies.generator.mass", 1.5e5)
    stiffer = model.with_number("bearings.generator guide bearing.stiffness", 3e9)
    for start in (run, orbit):
        with pytest.raises(BadInput, match="start is a motion of another machine"):
            integrate(heavier, Newmark(64), speed=speed, revolutions=1, start=start)
    with pytest.raises(BadInput, match="modes=None"):
        integrate(stiffer, Newmark(64), speed=speed, revolutions=1, start=run)
    # a field that is switched off, or a blade that is lost, is the same machine
    for changed in (model.with_field(0.0), model.with_unbalance(2.0)):
        assert integrate(changed, Newmark(64), speed=speed, revolutions=1, start=run).finished
    with pytest.raises(BadInput, match="it must be a steady state or a Trajectory"):
        integrate(model, Newmark(64), speed=speed, revolutions=1, start=run.state)


@pytest.mark.parametrize("method", METHODS)
def test_a_leaning_rotor_touches_with_its_end(method):
    """The motion ends where an end of the rim meets the stator, before its middle does."""
    machine = MACHINES["tilted"]()
    model, speed = machine.model(), machine.speed
    disturbed = {"speed": speed, "revolutions": 3, "modes": 4, "static_eccentricity": 0.05}
    run = integrate(model, method, disturbance=(-9.9e-3, 0.0), **disturbed)
    assert "touches the stator" in run.stopped
    away = run.positions - run.centre[:, None]
    left = model.gap - np.hypot(*away).max()
    assert 0 < left < 1e-3  # the middle never came there


def test_harmless_underflow_is_quiet(peer, speed):
    with np.errstate(all="raise"):
        for method in METHODS:
            assert integrate(peer, method, speed=speed, revolutions=2).finished


# ------------------------------------------------------------------ wrong arguments

def test_what_is_no_result_is_refused_in_a_sentence(shipped, orbit):
    model, speed = shipped.model(), shipped.speed
    branch = follow(model, to=0.03, speed=speed)
    for call, words in (
            (lambda: update_branch(orbit, model), "branch is a PeriodicOrbit; it must be a Branch"),
            (lambda: update_branch(branch, shipped), "by its method model"),
            (lambda: orbits_at(branch, "5 %"), "value is '5 %'; it must be a number"),
            (lambda: orbits_at(orbit, 0.05), "must be a Branch"),
            (lambda: self_crossings(orbit), r"orbit\.positions\(phases\)"),
            (lambda: rpm("150"), "speed is '150'; it must be a number"),
            (lambda: branch[1:3], r"branch\[k\] for k in range"),
            (lambda: branch["a"], "one steady state at a time"),
            (lambda: follow(shipped, speed=speed), "by its method model"),
            (lambda: follow(model, speed=speed, start=branch), r"branch\[3\] is one steady state"),
            (lambda: sweep(model, None, [0.0], speed=speed), "must be a HarmonicBalance"),
            (lambda: sweep(model, HarmonicBalance(), ["1"], speed=speed), "must be a number"),
            (lambda: HarmonicBalance().solve(model, speed, direction="x"), "direction is 'x'")):
        with pytest.raises(BadInput, match=words):
            call()


def test_a_start_with_other_coordinates_is_refused(shipped):
    tilted = MACHINES["tilted"]()
    start = HarmonicBalance().solve(tilted.model(), tilted.speed, 0.02)
    with pytest.raises(BadInput, match="4 nonlinear coordinates; this model, kaplan-150rpm, has 2"):
        HarmonicBalance().solve(shipped.model(), shipped.speed, 0.02, start=start)
