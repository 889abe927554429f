"""Slow change: what a drift ends on does not hang on its knobs, and a sweep says where it does."""

import math

import numpy as np
import pytest

from hydrolab import (
    HarmonicBalance,
    drift,
    orbits_at,
    stable_orbits_at,
    sweep_in_time,
)
from hydrolab.errors import BadInput
from tests.machines import MACHINES


def left(passage):
    """The value at which it last repeated before it jumped, or left for good."""
    (gone,) = [first for period, first, _ in passage.story if period == 0]
    return gone


def on_whole_machine(orbit, to, per_revolution, steps):
    """A drift of the eccentricity with all DOFs, written here: classical Runge–Kutta in time for
    what the pull adds, exponentials for the linear machine in between (Lawson 1967). Returns the
    generator's (x, z) after each revolution.
    """
    m, w = orbit.model, orbit.speed
    n, h = m.size, 2 * math.pi / w / steps
    inverse = np.linalg.inv(m.M)
    values, vectors = np.linalg.eig(np.block([
        [np.zeros((n, n)), np.eye(n)], [-inverse @ m.K, -inverse @ m.velocity_matrix(w)]]))
    back = np.linalg.inv(vectors)
    whole, half = (((vectors * np.exp(values * t)) @ back).real for t in (h, h / 2))
    load, watch = np.vstack([np.zeros((n, 2)), inverse @ m.selection.T]), m.selection
    shaken = np.stack([np.concatenate([np.zeros(n), w**2 * inverse @ part])
                       for part in (m.unbalance_cos, m.unbalance_sin)])
    unit = orbit.centre / orbit.static_eccentricity
    k = np.arange(1, orbit.harmonics + 1)
    shaft = orbit.shaft
    x = np.concatenate([shaft[:, 0] + shaft[:, 2::2].sum(axis=1), shaft[:, 1::2] @ (w * k)])
    rate = math.copysign(per_revolution, to - orbit.static_eccentricity)

    def extra(t, x):
        centre = (orbit.static_eccentricity + rate * t * w / (2 * math.pi)) * unit
        return (load @ m.law.force(watch @ x[:n] - centre)
                + np.array([math.cos(w * t), math.sin(w * t)]) @ shaken)

    section = []
    for step in range(steps * round(abs(to - orbit.static_eccentricity) / per_revolution)):
        t = step * h
        a = extra(t, x)
        b = extra(t + h / 2, half @ (x + h / 2 * a))
        c = extra(t + h / 2, half @ x + h / 2 * b)
        d = extra(t + h, whole @ x + h * (half @ c))
        x = whole @ x + h / 6 * (whole @ a + 2 * (half @ (b + c)) + d)
        if (step + 1) % steps == 0:
            section.append(watch @ x[:n])
    return np.array(section)


@pytest.mark.parametrize(("steps", "modes"), [(128, 6), (96, 12)])
def test_down_slowly_it_returns(shipped, branch, steps, modes):
    """From 8.3 % on the large orbit at 0.003 % a revolution: through a motion of two revolutions
    to the small orbit, which it reaches between 6.90 and 6.94 %.
    """
    down = drift(orbits_at(branch, 0.083)[2], to=0.067, per_revolution=3e-5, steps=steps,
                 modes=modes)
    assert [period for period, *_ in down.story] == [1, 2, 0, 1]
    assert 0.0690 < left(down) < 0.0694
    (small,) = stable_orbits_at(branch, 0.067)
    assert down.section[-1, -1] == pytest.approx(small.positions(np.zeros(1))[:, 0], abs=3e-5)
    assert "It went all the way, at 6.7 %." in str(down)


def test_the_whole_machine_does_the_same(shipped, branch):
    """All DOFs and another integrator, three times as fast: revolution by revolution the same where
    nothing is at stake, and the same end.
    """
    start = orbits_at(branch, 0.083)[2]
    theirs = on_whole_machine(start, 0.065, 1e-4, 128)
    ours = drift(start, to=0.065, per_revolution=1e-4, steps=256, modes=12)
    assert len(ours.values) == len(theirs) == 180
    assert ours.section[:40, -1] == pytest.approx(theirs[:40], abs=3e-6)
    assert ours.section[-1, -1] == pytest.approx(theirs[-1], abs=3e-5)
    (small,) = stable_orbits_at(branch, 0.065)
    assert theirs[-1] == pytest.approx(small.positions(np.zeros(1))[:, 0], abs=1e-4)


@pytest.mark.parametrize(("name", "parameter", "to"), [
    ("round", "field", 0.9), ("round", "unbalance", 1.3), ("round", "direction", 2.0),
    ("one pole pair", "field", 0.9), ("shaped turning rotor", "direction", 2.0)])
def test_any_parameter_ends_on_the_orbit_there(name, parameter, to):
    """Moved slowly, then left alone: harmonic balance has the orbit of the changed machine."""
    machine = MACHINES[name]()
    model, balance = machine.model(), HarmonicBalance(8)
    start = balance.solve(model, machine.speed, 0.02)
    first = math.pi / 2 if parameter == "direction" else 1.0
    moved = drift(start, parameter, to=to, per_revolution=abs(to - first) / 100, steps=64)
    changed = {"field": model.with_field(to), "unbalance": model.with_unbalance(to)}
    there = balance.solve(changed.get(parameter, model), machine.speed, 0.02,
                          direction=to if parameter == "direction" else math.pi / 2)
    away = moved.section[-1, -1] - there.positions(np.zeros(1))[:, 0]
    whole_way = start.positions(np.zeros(1))[:, 0] - there.positions(np.zeros(1))[:, 0]
    assert np.hypot(*away) < 0.05 * np.hypot(*whole_way)  # a slow motion lags by a few revolutions


def test_there_and_back(shipped, branch):
    """Several values are gone to one after another, at the same pace."""
    start = orbits_at(branch, 0.05)[0]
    tour = drift(start, to=[0.06, 0.05], per_revolution=2e-4)
    assert tour.values.max() == pytest.approx(0.06)
    assert len(tour.values) == 100
    assert tour.section[-1, -1] == pytest.approx(start.positions(np.zeros(1))[:, 0], abs=5e-5)
    assert tour.told == "repeats every revolution from 5.02 % to 5 %"


def test_a_drift_ends_at_contact_and_keeps_what_was_passed(branch):
    up = drift(stable_orbits_at(branch, 0.105)[-1], to=0.13, per_revolution=2e-4)
    assert up.stopped.startswith("The rotor touches the stator, at 1")
    assert 0.1066 < up.values[-1] < 0.13

    def stop(done, whole):
        if done == 7:
            raise KeyboardInterrupt
    cut = drift(stable_orbits_at(branch, 0.05)[0], to=0.06, per_revolution=1e-4, progress=stop)
    assert cut.stopped == "It was interrupted, at 5.07 %."
    assert len(cut.values) == len(cut.section) == 7


def test_sudden_steps_of_a_thousandth_say_that_they_decide(branch):
    """0.1 % at an instant touches at 7.6 %; half the step does not."""
    down = sweep_in_time(orbits_at(branch, 0.083)[2], np.arange(0.083, 0.0675, -0.001),
                         revolutions=60, modes=6)
    assert down.stopped == "The rotor touches the stator at 7.6 %."
    assert "depends on the steps" in down.doubt
    assert "with half the steps it" in down.doubt
    calm = sweep_in_time(orbits_at(branch, 0.05)[0], [0.05, 0.055, 0.06], revolutions=60, modes=6)
    assert calm.doubt == ""


@pytest.mark.parametrize(("arguments", "why"), [
    ({"to": 0.05, "per_revolution": 1e-4}, "where the motion begins"),
    ({"to": 1.0, "per_revolution": 1e-4}, "fractions of the gap"),
    ({"to": 0.06, "per_revolution": 0.0}, "per_revolution"),
    ({"to": math.nan, "per_revolution": 1e-4}, "finite numbers"),
    ({"parameter": "speed", "to": 20.0, "per_revolution": 0.1}, "what can move in time is"),
    ({"parameter": "field", "to": -1.0, "per_revolution": 0.1}, "0 or more"),
    ({"to": 0.06, "per_revolution": 1e-4, "steps": 4}, "steps")])
def test_drift_refuses(branch, arguments, why):
    with pytest.raises(BadInput, match=why):
        drift(orbits_at(branch, 0.05)[0], **arguments)


def test_without_a_gap_there_is_nothing_to_move():
    machine = MACHINES["no gap"]()
    orbit = HarmonicBalance().solve(machine.model(), machine.speed)
    with pytest.raises(BadInput, match="has no air gap"):
        drift(orbit, to=0.03, per_revolution=1e-3)


@pytest.mark.parametrize("name", ["film", "crack"])
def test_stiff_and_damping_forces_end_on_the_orbit_there(name):
    machine, balance = MACHINES[name](), HarmonicBalance(8)
    model = machine.model()
    start = balance.solve(model, machine.speed, 0.02)
    moved = drift(start, to=[0.03, 0.0299], per_revolution=1e-3, steps=64)
    there = balance.solve(model, machine.speed, 0.0299)
    first, last = (o.positions(np.zeros(1))[:, 0] for o in (start, there))
    assert np.hypot(*(moved.section[-1, -1] - last)) < 0.03 * np.hypot(*(first - last))
