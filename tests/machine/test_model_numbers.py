"""A model knows the numbers of its machine and takes another value of one; forces of bearings.
"""

import copy
import pickle
from dataclasses import asdict, replace

import numpy as np
import pytest

from hydrolab import BadInput, HarmonicBalance, load_machine, reduce, vary
from hydrolab.dynamics.harmonics import rates, synthesise
from hydrolab.machine import Model
from hydrolab.machine.pull import CircularPull, LinearPull
from tests.machines import MACHINES

ARRAYS = ("M", "C", "G", "K", "unbalance_sin", "unbalance_cos", "selection")
KEYS = {
    "round": ["bodies.generator.mass", "bodies.generator.unbalance", "bodies.generator.offset",
              "air_gap.gap", "air_gap.field", "shaft.young",
              "bearings.turbine guide bearing.stiffness"],
    "one pole pair": ["poles.electrical_ratio", "bearings.free end.damping"],
    "shaped turning rotor": ["shapes.lobes.size", "air_gap.gap"],
    "pads": ["bearings.pads.pad_stiffness", "bearings.pads.clearance"],
    "film": ["bearings.film.viscosity", "speed"],
    "crack": ["cracks.crack.depth"],
}
CASES = [(name, key) for name, keys in KEYS.items() for key in keys]


@pytest.mark.parametrize(("name", "key"), CASES)
def test_a_number_is_changed_as_on_the_machine(name, key):
    machine = MACHINES[name]()
    value, unit = machine.model().number(key)
    assert unit == machine.number(key)[1]
    model = machine.model().with_number(key, 1.1 * value)
    assert model.number(key)[0] == pytest.approx(1.1 * value, rel=1e-14)
    expected = vary(machine, {key: 1.1 * value}).model()
    for array in ARRAYS:
        there = getattr(expected, array)
        if array == "C" and machine.damping:  # Rayleigh damping stays as built
            there = there + machine.model().C - expected.C
        assert getattr(model, array) == pytest.approx(there, rel=1e-12,
                                                      abs=1e-12 * np.abs(there).max())
    u = np.linspace(1e-5, 3e-5, len(model.selection))
    assert np.array_equal(model.law.force(u, u, 0.7, 10.0), expected.law.force(u, u, 0.7, 10.0))
    assert model.gap == expected.gap


def test_what_was_changed_before_stays():
    machine = load_machine("kaplan-150rpm")
    model = machine.model().with_field(0.5).with_unbalance(2.0)
    heavier = model.with_number("bodies.generator.mass", 1.2e5).with_number(
        "bodies.generator.unbalance", 30.0)
    expected = vary(machine, {"bodies.generator.mass": 1.2e5, "bodies.generator.unbalance": 30.0,
                              "air_gap.field": 0.5 * machine.air_gap.field}).model()
    assert heavier.M == pytest.approx(expected.M)
    assert heavier.unbalance_cos == pytest.approx(2 * expected.unbalance_cos, abs=1e-9)
    assert heavier.law.stiffness == pytest.approx(expected.law.stiffness)
    own = LinearPull(1e8, model.gap)
    mine = replace(model, law=own, K=2 * model.K)
    stiff = mine.with_number("bearings.turbine guide bearing.stiffness", 2e9)
    assert stiff.law is own
    rows = model.supports["turbine guide bearing"].rows
    known = machine.number("bearings.turbine guide bearing.stiffness")[0]
    assert stiff.K == pytest.approx(2 * model.K + (2e9 - known) * rows.T @ rows, rel=1e-12)
    with pytest.raises(BadInput, match="its law was replaced"):
        mine.with_number("air_gap.gap", 0.012)


def test_a_reduced_model_is_changed_in_its_basis():
    model = load_machine("kaplan-150rpm").model()
    small = reduce(model, 4)
    key = "bearings.turbine guide bearing.stiffness"
    found, whole = small.with_number(key, 2e9), model.with_number(key, 2e9)
    expected = small.shaft_map.T @ whole.K @ small.shaft_map
    assert found.K == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())
    assert found.supports["turbine guide bearing"].rows.shape == (2, small.size)


def test_a_model_made_by_hand_has_no_numbers():
    one = np.eye(2)
    model = Model("by hand", one, 0 * one, 0 * one, one, np.ones(2), np.ones(2), one,
                  CircularPull(0.1, 1.0), 1.0, np.zeros(1), one)
    for ask in (lambda: model.number("speed"), lambda: model.with_number("speed", 1.0)):
        with pytest.raises(BadInput, match="by hand was not made from a card"):
            ask()
    unit = load_machine("kaplan-150rpm").model()
    with pytest.raises(BadInput, match=r"bodies.generator.mas"):
        unit.number("bodies.generator.mas")
    with pytest.raises(BadInput, match=r"bodies.generator.mass is -1"):
        unit.with_number("bodies.generator.mass", -1.0)


@pytest.mark.parametrize("name", MACHINES)
def test_machines_and_models_are_copied_and_sent(name):
    machine = MACHINES[name]()
    for thing in (machine, machine.model()):
        for twin in (pickle.loads(pickle.dumps(thing)), copy.deepcopy(thing)):
            assert str(twin.name) == thing.name
        assert asdict(thing)["name"] == thing.name
    twin = pickle.loads(pickle.dumps(machine.model()))
    u = np.full(len(twin.selection), 1e-5)
    assert np.array_equal(twin.law.force(u, u, 0.3, 5.0), machine.model().law.force(u, u, 0.3, 5.0))


@pytest.mark.parametrize("name", [n for n in MACHINES if n != "no gap"])
def test_bearings_carry_what_the_machine_needs(name):
    """Inertia, unbalance and pull against the forces of the bearings, summed over x and over z: in
    each harmonic that is balanced nothing is left, a shift of the whole shaft bends it nowhere.
    """
    machine = MACHINES[name]()
    model = machine.model()
    own = sum(s.rows.T @ s.damping @ s.rows for s in model.supports.values())
    model = replace(model, C=own)  # Rayleigh damping is not the bearings'
    orbit = HarmonicBalance(6).solve(model, machine.speed, 0.02)
    eq = orbit.equations
    phase, shaft = eq.phase, orbit.shaft
    q, v, a = (orbit.speed**k * synthesise(c, phase)
               for k, c in enumerate((shaft, rates(shaft), rates(rates(shaft)))))
    push = sum(np.einsum("in,ij->jn", s.force(s.rows @ q, s.rows @ v, phase, orbit.speed), s.rows)
               for s in model.supports.values())
    u = model.relative(orbit.coordinates(phase), orbit.centre[:, None])
    pull = model.selection[:2].T @ model.pull(u, phase, orbit.speed)
    still, turning = model.loads(orbit.speed)
    still = still - sum(s.stiffness @ s.offset @ s.rows for s in model.supports.values())
    shaken = still[:, None] + np.outer(turning, np.exp(1j * phase)).real
    inertia = model.M @ a
    per_node = 2 if machine.shaft is None else 4
    nodal = per_node * machine.nodes
    for axis in (0, 1):  # a rigid shift along x or z does no work on the shaft itself
        left = (push + pull + shaken - inertia)[axis:nodal:per_node].sum(axis=0) @ eq.analysis
        size = np.abs(push[axis:nodal:per_node]).sum(axis=0) @ np.abs(eq.analysis)
        assert np.abs(left).max() < 1e-9 * size.max()
