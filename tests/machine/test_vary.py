"""One number of a machine changed, and nothing else."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from hydrolab import BadInput, card_names, load_machine, vary


@pytest.fixture(scope="module")
def machine():
    return load_machine("kaplan-150rpm")


def matrices(machine):
    model = machine.model()
    return {name: getattr(model, name) for name in ("M", "G", "K", "C", "unbalance_sin",
                                                    "unbalance_cos")} | {
        "pull": np.array(model.law.stiffness)}


@pytest.mark.parametrize(("key", "value", "changed"), [
    ("bodies.generator.mass", 1.3e5, {"M", "C"}),
    ("bearings.generator guide bearing.stiffness", 1.5e9, {"K", "C"}),
    ("field", 0.45, {"pull"}), ("air_gap.field", 0.45, {"pull"}),
    ("unbalance", 2.0, {"unbalance_sin", "unbalance_cos"}),
    ("shaft.young", 2.1e11, {"K", "C"}), ("speed", 14.0, set())])
def test_it_changes_what_it_says_and_nothing_else(machine, key, value, changed):
    new = vary(machine, {key: value})
    before, after = matrices(machine), matrices(new)
    assert {name for name in before if not np.array_equal(before[name], after[name])} == changed
    assert (new.speed == value) == (key == "speed")
    again = matrices(machine)
    # the old machine is as it was
    assert all(np.array_equal(before[name], again[name]) for name in before)


def test_values_arrive(machine):
    new = vary(machine, {"bodies.generator.mass": 1e5, "field": 0.3, "unbalance": 0.5,
                         "speed": 12.0})
    assert new.bodies[0].mass == 1e5
    assert new.air_gap.field == 0.3
    assert new.speed == 12.0
    assert [b.unbalance for b in new.bodies] == [0.5 * b.unbalance for b in machine.bodies]
    assert new.bodies[1].mass == machine.bodies[1].mass
    # the field goes with its square into the pull
    ratio = new.model().law.stiffness / machine.model().law.stiffness
    assert ratio == pytest.approx((0.3 / machine.air_gap.field) ** 2, rel=1e-12)


def test_unbalance_is_a_factor_each_time(machine):
    assert vary(vary(machine, {"unbalance": 2.0}), {"unbalance": 0.5}).bodies == machine.bodies


def test_nothing_changed_is_the_same(machine):
    assert vary(machine, {}) is machine


@pytest.mark.parametrize("name", card_names())
def test_every_key_of_every_card(name):
    """Each key takes the value that the machine already has; scalars are then equal to before."""
    machine = load_machine(name)
    numbers = machine.numbers() | {"unbalance": 1.0}
    assert len(numbers) > 5
    before = matrices(machine)
    for key, value in numbers.items():
        after = matrices(vary(machine, {key: value}))
        assert all(np.array_equal(before[k], after[k]) for k in before), key


def test_the_nodes_are_not_numbers(machine):
    assert not any(key.endswith(".node") for key in machine.numbers())
    with pytest.raises(BadInput,
                       match=r"'bodies\.generator\.node' is not a number; this part has mass"):
        vary(machine, {"bodies.generator.node": 3})


@pytest.mark.parametrize("key", ["colour", "bodies", "bodies.generator", "bodies.nobody.mass",
                                 "bearings..stiffness",
                                 "shaft.", "", "air_gap", "shaft.young.more"])
def test_unknown_keys_list_the_known_ones(machine, key):
    with pytest.raises(BadInput, match="is not a number"):
        vary(machine, {key: 1.0})


def test_a_machine_without_the_part(machine):
    bare = replace(machine, air_gap=None)
    with pytest.raises(BadInput, match=r"'air_gap\.field' is not a number of"):
        vary(bare, {"field": 0.5})
    assert not any(key.startswith("air_gap") for key in bare.numbers())


@pytest.mark.parametrize(("key", "value"), [("bodies.generator.mass", -1.0), ("field", math.nan),
                                            ("speed", math.nan),
                                            ("shaft.young", 0.0), ("unbalance", math.inf),
                                            ("bearings.generator guide bearing.stiffness", -1e9)])
def test_values_are_checked_by_their_part(machine, key, value):
    with pytest.raises(BadInput):
        vary(machine, {key: value})


def test_names_with_dots_and_spaces(machine):
    """The attribute is what stands after the last dot; a name may hold anything."""
    dotted = replace(machine, bodies=tuple(replace(b, name=f"no. {i} of 2")
                                           for i, b in enumerate(machine.bodies)),
                     air_gap=replace(machine.air_gap, body="no. 0 of 2"))
    assert vary(dotted, {"bodies.no. 1 of 2.mass": 5e4}).bodies[1].mass == 5e4
    assert "bodies.no. 1 of 2.mass" in dotted.numbers()
    assert fields(dotted)
