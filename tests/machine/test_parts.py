"""Parts refuse what cannot exist, with one sentence, and print what they are."""

import math
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hydrolab.errors import BadInput
from hydrolab.machine.parts import (
    MU_0,
    AirGap,
    Machine,
    RadialBearing,
    RayleighDamping,
    RigidBody,
    Shaft,
    ThrustBearing,
)
from hydrolab.machine.quantities import Entry, number, shown

SHAFT = {"nodes": [0, 1, 2.5], "diameter": 0.4, "young": 2e11, "density": 7850}
BODY = {"name": "rotor", "node": 0, "mass": 1e4, "Id": 2e3, "Ip": 3e3}
GAP = {"body": "rotor", "field": 0.5, "mean_radius": 2.9945, "length": 0.97, "gap": 0.011}


def machine(**changes):
    given = {"name": "unit", "speed": 15.0, "shaft": Shaft(**SHAFT), "bodies": (RigidBody(**BODY),),
             "bearings": (RadialBearing("top", 0, 1e9), RadialBearing("end", 2, [1e9, 2e9]))}
    return Machine(**{**given, **changes})


@pytest.mark.parametrize(("cls", "good", "bad", "sentence"), [
    (Shaft, SHAFT, {"nodes": [0]}, "shaft.nodes has 1 entries"),
    (Shaft, SHAFT, {"nodes": 3}, "shaft.nodes is 3; it must be a list"),
    (Shaft, SHAFT, {"nodes": {"a": 1}}, "shaft.nodes is {'a': 1}; it must be a list"),
    (Shaft, SHAFT, {"nodes": [0.5, 1]}, "the first node is the shaft top, 0 m"),
    (Shaft, SHAFT, {"nodes": [0, 2, 1]}, "from 2 m to 1 m; the depths must ascend"),
    (Shaft, SHAFT, {"nodes": [0, math.nan]}, r"shaft.nodes\[1\] is nan"),
    (Shaft, SHAFT, {"diameter": 0}, "shaft.diameter is 0 m; it must be larger than 0 m"),
    (Shaft, SHAFT, {"diameter": [0.4, 0.4, 0.4]}, "has 3 entries; give one number or one per "
                                                  "element, 2"),
    (Shaft, SHAFT, {"inner_diameter": [0.1, 0.5]}, "shaft.inner_diameter is 0.5 m; it must be "
                                                   "smaller than .* 0.4 m"),
    (Shaft, SHAFT, {"young": -1.0}, "shaft.young is -1 Pa; it must be larger than 0 Pa"),
    (Shaft, SHAFT, {"poisson": 0.5}, "shaft.poisson is 0.5; it must be smaller than 0.5"),
    (Shaft, SHAFT, {"shear_coefficient": 1.1}, "shaft.shear_coefficient is 1.1; .* at most 1"),
    (Shaft, SHAFT, {"element": "beam"}, "shaft.element is 'beam'; it must be one of "
                                        "lalanne-ferraris, timoshenko"),
    (RigidBody, BODY, {"mass": -5}, "bodies.rotor.mass is -5 kg; it must be larger than 0 kg"),
    (RigidBody, BODY, {"mass": True}, "bodies.rotor.mass is True; it must be a number in kg"),
    (RigidBody, BODY, {"Ip": 5e3},
     r"bodies.rotor.Ip is 5000 kg m\^2; no rigid body has Ip above 2 Id"),
    (RigidBody, BODY, {"unbalance": -1},
     "bodies.rotor.unbalance is -1 kg m; it must be at least 0"),
    (RigidBody, BODY, {"offset": math.inf},
     "bodies.rotor.offset is inf; it must be a finite number"),
    (RigidBody, BODY, {"name": "two\nlines"},
     "the name of a body is 'two.*lines'; it must be text"),
    (ThrustBearing, {"name": "t", "node": 0, "tilt_stiffness": 1}, {"tilt_stiffness": "1"},
     "it must be a number"),
    (AirGap, GAP, {"gap": 3.0}, "air_gap.gap is 3 m; it must be smaller than air_gap.mean_radius, "
                                "2.9945 m"),
    (RayleighDamping, {"ratio": 0.01}, {"ratio": [0.01, 0.02, 0.03]},
     "damping.ratio has 3 entries"),
    (RadialBearing, {"name": "half", "node": 0, "stiffness": 1e9}, {"node": 0.5},
     "bearings.half.node is 0.5; it must be a whole number"),
    (AirGap, GAP, {"body": []}, r"air_gap.body is \[\]; it must be text"),
    (RayleighDamping, {"ratio": 0.01}, {"ratio": 1},
     "damping.ratio is 1; it must be smaller than 1"),
])
def test_what_cannot_exist_is_refused(cls, good, bad, sentence):
    cls(**good)
    with pytest.raises(BadInput, match=sentence) as caught:
        cls(**{**good, **bad})
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("value", ["1e9", None, [1], [1, 2, 3], [[1, 2]], [[1, 2], [3]],
                                   [1, [2, 3]], math.nan,
                                   -1.0, [1, -1], [[1, 0], [0, "1"]], True, {}, 10**400,
                                   np.zeros((2, 2, 2))])
def test_bearing_matrix_refuses(value):
    with pytest.raises(BadInput, match=r"bearings.b.stiffness .* must"):
        RadialBearing("b", 0, value)


def test_bearing_matrix_takes_three_forms():
    np.testing.assert_array_equal(RadialBearing("b", 0, 5).stiffness, [[5, 0], [0, 5]])
    np.testing.assert_array_equal(RadialBearing("b", 0, (5, 6)).stiffness, [[5, 0], [0, 6]])
    np.testing.assert_array_equal(RadialBearing("b", 0, np.array([[5, -2], [2, 6]])).stiffness,
                                  [[5, -2], [2, 6]])


@pytest.mark.parametrize(("changes", "sentence"), [
    ({"bearings": (RadialBearing("far", 3, 1e9),)}, "bearings.far.node is 3, off the shaft; the "
                                                    "nodes are 0 to 2"),
    ({"bearings": (RadialBearing("far", 10**5000, 1e9),)}, "off the shaft"),
    ({"bearings": (RadialBearing("rotor", 0, 1e9),)}, "the name 'rotor' is used twice"),
    ({"air_gap": AirGap(**{**GAP, "body": "stator"})}, "air_gap.body is 'stator'; .* the name of a "
                                                       "body: rotor"),
    ({"air_gap": AirGap(**GAP), "bodies": ()}, "it must be the name of a body: there is none"),
    ({"shaft": None}, "without a shaft the only node is 0"),
    ({"shaft": None, "bodies": (), "bearings": ()}, "a machine without a shaft needs a body"),
    ({"shaft": None, "bearings": (), "bodies": (RigidBody(**BODY, offset=1),)}, "it must be 0"),
    ({"shaft": None, "bearings": (), "thrust_bearings": (ThrustBearing("t", 0, 1),)},
     "no meaning without a shaft"),
    ({"shaft": None, "bearings": (), "damping": RayleighDamping(0.01)},
     "give the bearing a damping instead"),
    ({"speed": -1}, "speed is -1 rad/s; it must be at least 0 rad/s"),
    ({"name": ""}, "name is ''; it must be text"),
])
def test_impossible_machines(changes, sentence):
    with pytest.raises(BadInput, match=sentence):
        machine(**changes)


def test_parts_cannot_be_changed():
    unit = machine()
    with pytest.raises(FrozenInstanceError):
        unit.speed = 1.0
    with pytest.raises(ValueError, match="read-only"):
        unit.shaft.nodes[1] = 0.1
    said = {"speed": Entry(15.0, "rad/s", "paper", si=15.0)}
    named = machine(provenance=said)
    said.clear()
    assert list(named.provenance) == ["speed"]


def test_sections_and_pull():
    shaft = Shaft(**{**SHAFT, "diameter": [0.4, 0.5]}, inner_diameter=0.2)
    np.testing.assert_allclose(shaft.area, math.pi / 4 * np.array([0.12, 0.21]))
    np.testing.assert_allclose(shaft.second_moment,
                               math.pi / 64 * np.array([0.4**4 - 0.2**4, 0.5**4 - 0.2**4]))
    assert shaft.length == 2.5
    assert AirGap(**GAP).pull_stiffness == pytest.approx(1.6504e8, rel=1e-4)
    assert MU_0 == pytest.approx(4e-7 * math.pi)


def test_bodies_are_found_by_name():
    assert machine().body("rotor").mass == 1e4
    with pytest.raises(BadInput, match="no body is called 'stator'; there are rotor"):
        machine().body("stator")


@given(st.one_of(st.integers(), st.floats(), st.text(), st.booleans(), st.none(), st.binary(),
                 st.lists(st.integers()),
                 st.sampled_from([10**400, -10**5000, 1e300, 1e-300, np.float64("nan"),
                                  np.int64(3), 1j])))
def test_number_returns_a_float_or_one_sentence(value):
    try:
        assert 0 < number("key", value, above=0) <= 1e30
    except BadInput as error:
        assert str(error).startswith("key is ") and len(str(error).splitlines()) == 1


@pytest.mark.parametrize("value", ["long " * 1000, [[[[[[[[1]]]]]]]] * 99, 10**4000, [10**9999],
                                   {"a": [10**9999]},
                                   "a\nb\u2028c\x1b[2J"])
def test_whatever_is_shown_is_short_and_on_one_line(value):
    text = shown(value)
    assert len(text) <= 120 and len(text.splitlines()) == 1 and "\x1b" not in text


def test_a_machine_made_in_python_prints_its_numbers():
    text = str(machine(title="A test"))
    assert text.startswith("unit: A test\n")
    assert "shaft.diameter" in text and "0.4 m" in text and "[0.4, 0.4]" not in text
    assert "bearings.end.stiffness" in text and "[[1e+09, 0], [0, 2e+09]] N/m" in text
    assert "offset" not in text  # a zero nobody stated


def test_print_shows_what_is_true_after_a_change():
    card = Entry(15.0, "rad/s", "paper", "section 5", si=15.0)
    unit = machine(provenance={"speed": card})
    line = next(line for line in str(unit).splitlines() if "speed" in line)
    assert line.split() == ["speed", "15", "rad/s", "paper", "section", "5"]
    line = next(line for line in str(replace(unit, speed=20.0)).splitlines() if "speed" in line)
    assert line.split() == ["speed", "20", "rad/s", "changed", "the", "card", "says", "15", "rad/s"]
    assert str(card) == "15 rad/s  [paper] section 5"
