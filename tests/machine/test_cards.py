"""Machine cards: what ships is right, and a bad card ends in one sentence for each fault, whatever
is wrong with it.
"""

import copy
import datetime
import math
import tomllib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import hydrolab.machine.cards as module
from hydrolab.errors import BadInput
from hydrolab.machine.bearings import BEARINGS, Guide
from hydrolab.machine.cards import (
    ALONE,
    SEVERAL,
    card_names,
    card_text,
    load_machine,
    machine_from_card,
    read_card,
    write_card,
)
from hydrolab.machine.parts import Machine
from hydrolab.machine.quantities import UNITS, Entry, numbers_of

SHIPPED = ["francis-three-guides", "jeffcott", "kaplan-150rpm", "pelton-horizontal", "pump-turbine",
           "three-disc", "two-pole"]
CARDS = {name: read_card(name) for name in SHIPPED}
UNIT = copy.deepcopy(CARDS["kaplan-150rpm"])  # with round numbers where the calibration has its own
UNIT["bodies"][0] |= {key: {"value": value, "unit": unit, "source": "assumed"}
                      for key, value, unit in (("mass", 90, "t"), ("Id", 2.4e5, "kg m^2"),
                                               ("Ip", 4e5, "kg m^2"))}
CARDS["unit"] = UNIT
RPM = math.pi / 30


def one_sentence(text):
    return (len(text.splitlines()) == 1 and text.endswith(".") and text.isprintable()
            and len(text) < 700)


def only_sentences(error):
    """Whether an error is sentences, one a line and none twice."""
    lines = str(error).split("\n")
    return all(map(one_sentence, lines)) and len(set(lines)) == len(lines)


def edited(path, value, name="unit"):
    """A copy of a shipped card with one place replaced (or deleted, for ...)."""
    card = copy.deepcopy(CARDS[name])
    *above, last = path
    place = card
    for step in above:
        place = place[step]
    if value is ...:
        del place[last]
    else:
        place[last] = value
    return card


def refusal(card):
    with pytest.raises(BadInput) as caught:
        machine_from_card(card)
    assert only_sentences(caught.value), str(caught.value)
    return str(caught.value)


# What ships

def test_the_module_wins_over_its_folder():
    assert module.__file__.endswith("cards.py")
    assert card_names() == SHIPPED


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_cards_load_and_say_where_each_number_comes_from(name):
    machine = load_machine(name)
    assert machine.name == name and machine.title and machine.about
    stated = {key for key, value in machine.numbers().items() if np.any(value)}
    assert stated <= set(machine.provenance)
    brackets = sum(b.has_bracket for b in machine.all_bearings if isinstance(b, Guide))
    assert machine.model().size == 2 * brackets + (2 if machine.shaft is None
                                                   else 4 * machine.nodes)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_copied_card_is_the_same_machine(name, tmp_path):
    (tmp_path / "my-unit.toml").write_text(card_text(name), encoding="utf-8")
    own = tmp_path / "my-unit.toml"
    assert str(load_machine(own)) == str(load_machine(str(own))) == str(load_machine(name))


def test_kaplan_keeps_what_the_paper_states():
    unit = load_machine("kaplan-150rpm")
    assert unit.speed == 150 * RPM
    assert len(unit.shaft.nodes) == 13 and unit.shaft.length == 9.04 and (unit.shaft.diameter
                                                                          == 0.71).all()
    assert (unit.shaft.young, unit.shaft.density, unit.shaft.element) == (2e11, 7850,
                                                                          "lalanne-ferraris")
    assert unit.body("generator").offset == -0.472 and unit.body("generator").node == 0
    assert [b.stiffness[0, 0] for b in unit.bearings] == [1.37e9, 1.64e9]
    assert unit.thrust_bearings[0].tilt_stiffness[0, 0] == 5e7
    assert unit.damping.ratio == (0.01, 0.01)
    gap = unit.air_gap
    assert (gap.field, gap.mean_radius, gap.length, gap.gap) == (0.5, 2.9945, 0.97, 0.011)
    for key in ("speed", "shaft.diameter", "bodies.generator.offset", "damping.ratio"):
        assert unit.provenance[key].source == "paper"
    assert unit.provenance["air_gap.gap"].source == "Table 1"


def test_jeffcott_whirls_on_200_micrometres():
    unit = load_machine("jeffcott")
    model, body, r = unit.model(), unit.bodies[0], 200e-6
    k, c = model.K[0, 0], model.C[0, 0]
    assert (body.mass, k) == (1.5e5, 2.7e8) and c == pytest.approx(0.02 * math.sqrt(k * body.mass),
                                                                   rel=1e-14)
    pull = unit.air_gap.pull_stiffness * (1 - (r / unit.air_gap.gap) ** 2) ** -1.5
    force = r * math.hypot(k - pull - body.mass * unit.speed**2, c * unit.speed)
    assert body.unbalance * unit.speed**2 == pytest.approx(force, rel=1e-14)


def test_three_disc_rotor_gives_the_published_frequencies():
    machine = load_machine("three-disc")
    for name, radius, height in (("disc-1", 0.12, 0.05), ("disc-2", 0.2, 0.05),
                                 ("disc-3", 0.2, 0.06)):
        body = machine.body(name)
        assert body.mass == pytest.approx(7800 * math.pi * height * (radius**2 - 0.05**2),
                                          rel=1e-14)
        assert body.Id == pytest.approx(body.mass * (3 * (radius**2 + 0.05**2) + height**2) / 12,
                                        rel=1e-14)
        assert body.Ip == pytest.approx(body.mass * (radius**2 + 0.05**2) / 2, rel=1e-14)
    model = machine.model()
    identity, zero = np.eye(model.size), np.zeros((model.size, model.size))
    inverse = np.linalg.inv(model.M)
    values = np.linalg.eigvals(np.block([[zero, identity],
                                         [-inverse @ model.K,
                                          -inverse @ model.velocity_matrix(machine.speed)]]))
    found = np.sort(values.imag[values.imag > 1]) / (2 * math.pi)
    book = [55.408, 67.209, 157.90, 193.71, 249.90, 407.62, 446.62, 622.65, 715.03]
    np.testing.assert_allclose(found[:9], book, rtol=2e-4)


# Units, provenance, print

def test_units_convert_exactly():
    card = edited(["shaft", "nodes"], {"value": [0, 970, 9040], "unit": "mm", "source": "paper"})
    card["bearings"], card["bodies"][1]["node"] = [], 2
    card["bodies"][0]["phase"] = {"value": 90, "unit": "deg", "source": "assumed"}
    card["bodies"][0]["unbalance"] = {"value": 60_000, "unit": "kg mm", "source": "assumed"}
    unit = machine_from_card(card)
    assert unit.shaft.nodes.tolist() == [0, 0.97, 9.04]
    assert (unit.bodies[0].mass, unit.bodies[0].phase, unit.bodies[0].unbalance) == (9e4,
                                                                                     math.pi / 2,
                                                                                     60)


def test_every_number_of_a_part_has_its_units():
    kinds = (Machine, *ALONE, *SEVERAL, *BEARINGS)
    numbers = [holds for kind in kinds for holds in numbers_of(kind).values()]
    assert set(UNITS) == {holds.unit for holds in numbers if len(holds.units) > 1}
    assert all(next(iter(holds.units.items())) == (holds.unit, (1, 1)) for holds in numbers)


def test_provenance_prints_and_columns_align():
    unit = load_machine("kaplan-150rpm")
    assert str(unit.provenance["shaft.diameter"]) == "710 mm  [paper]"
    assert unit.provenance["shaft.diameter"].si.tolist() == [0.71] * 12
    lines = str(unit).splitlines()
    starts = {line.index(word) for line in lines for word in ("  assumed  ", "  calibrated  ")
              if word in line}
    assert len(starts) == 1 and all(line == line.rstrip() for line in lines)
    assert not any("changed" in line for line in lines)


def test_a_scalar_pair_and_matrix_of_stiffness():
    for value, matrix in ((5, [[5, 0], [0, 5]]), ([5, 6], [[5, 0], [0, 6]]),
                          ([[5, 1], [2, 6]], [[5, 1], [2, 6]])):
        unit = machine_from_card(edited(["bearings", 0, "stiffness", "value"], value))
        np.testing.assert_array_equal(unit.bearings[0].stiffness, matrix)


# Refusals

MASS = ["bodies", 0, "mass"]


@pytest.mark.parametrize(("path", "value", "parts"), [
    (MASS, ..., ["bodies.generator.mass is missing", 'mass = { value = …, unit = "kg", source']),
    (MASS, 9e4, ["bodies.generator.mass is 90000.0", "write a number as mass = {"]),
    ([*MASS, "value"], -90, ["bodies.generator.mass is -90000 kg", "larger than 0 kg",
                             "the card says -90 t"]),
    ([*MASS, "value"], "heavy", ["bodies.generator.mass is 'heavy'", "a number in t"]),
    ([*MASS, "value"], True, ["bodies.generator.mass is True", "a number in t"]),
    ([*MASS, "value"], math.nan, ["bodies.generator.mass is nan", "finite"]),
    ([*MASS, "value"], [1, 2], ["bodies.generator.mass is [1000.0, 2000.0]", "a number in kg",
                                "says [1, 2] t"]),
    ([*MASS, "value"], ..., ["bodies.generator.mass.value is missing"]),
    ([*MASS, "source"], ..., ["bodies.generator.mass.source is missing"]),
    ([*MASS, "source"], "guess", ["bodies.generator.mass.source is 'guess'", "paper, Table 1, "
                                  "literature, derived"]),
    ([*MASS, "unit"], "stone", ["bodies.generator.mass.unit is 'stone'", "kg, t, lb"]),
    ([*MASS, "unit"], 1, ["bodies.generator.mass.unit is 1", "one of kg, t"]),
    ([*MASS, "note"], "a\x1b[2Jb", ["bodies.generator.mass.note", "control characters"]),
    ([*MASS, "sorce"], "paper", ["bodies.generator.mass.sorce = 'paper' is not a key",
                                 "the nearest is source"]),
    (["bodies", 0, "mas"], 1, ["bodies.generator.mas = 1 is not a key", "the nearest is mass"]),
    (["bodies", 0, "Ip", "value"], 5e5, ["bodies.generator.Ip is 500000 kg m^2", "2 Id", "480000"]),
    (["bodies", 0, "name"], ..., ["bodies[0].name is missing"]),
    (["bodies", 0, "name"], "a\nb", ["bodies[0].name is 'a\\nb'", "one line"]),
    (["bodies", 0, "name"], 7, ["bodies[0].name is 7", "text"]),
    (["bodies", 0, "name"], "thrust bearing", ["'thrust bearing' is used twice"]),
    (["bodies", 0, "node"], 0.0, ["bodies.generator.node is 0.0", "a whole number"]),
    (["bodies", 0, "node"], ..., ["bodies.generator.node is missing"]),
    (["bodies"], {"name": "generator"}, ["bodies is {'name': 'generator'}", "[[bodies]]"]),
    (["bodies"], [3], ["bodies is [3]", "[[bodies]]"]),
    (["bodies"], ..., ["air_gap.body is 'generator'", "there is none"]),
    (["bearings", 0, "node"], 13, ["bearings.generator guide bearing.node is 13, off the shaft",
                                   "0 to 12"]),
    (["bearings", 0, "tilt_stiffness"], {}, ["has both stiffness and tilt_stiffness",
                                             "write two bearings"]),
    (["bearings", 0, "stiffness"], ...,
     ["neither stiffness (a radial bearing) nor tilt_stiffness"]),
    (["bearings", 0, "stiffness", "value"], [[[1]]],
     ["guide bearing.stiffness is [1]", "a number in N/m"]),
    (["bearings", 1, "damping"], {}, ["bearings.thrust bearing.damping = {} is not a key"]),
    (["shaft"], [1], ["shaft is [1]", "opened by [shaft]"]),
    (["shaft"], ..., ["bodies.turbine.node", "without a shaft"]),
    (["shaft", "element"], "beam", ["shaft.element is 'beam'", "lalanne-ferraris, timoshenko"]),
    (["shaft", "diameter", "value"], 0, ["shaft.diameter is 0 m", "larger than 0 m",
                                         "the card says 0 mm"]),
    (["shaft", "nodes", "value"], [], ["shaft.nodes has 0 entries"]),
    (["air_gap", "gap", "value"], 3, ["air_gap.gap is 3 m", "smaller than air_gap.mean_radius"]),
    (["air_gap", "gab"], 3, ["air_gap.gab = 3 is not a key", "the nearest is gap"]),
    (["damping", "ratio", "value"], 150, ["damping.ratio is 1.5", "smaller than 1", "the card says "
                                          "150 %"]),
    (["speed"], ..., ["speed is missing", 'speed = { value = …, unit = "rad/s"']),
    (["speed", "value"], -150, ["speed is -15.708 rad/s", "at least 0", "the card says -150 rpm"]),
    (["title"], 3, ["title is 3", "text"]),
    (["name"], ..., ["name is missing"]),
    (["schema"], ..., ["schema is missing", "schema = 1"]),
    (["schema"], 2, ["schema is 2", "this hydrolab reads schema 1"]),
    (["schema"], True, ["schema is True"]),
    (["schema"], "1", ["schema is '1'"]),
    (["colour"], "red", ["colour = 'red' is not a key of the card",
                         "allowed are name, speed, title"]),
])
def test_a_bad_card_gets_one_sentence(path, value, parts):
    sentence = refusal(edited(path, value))
    for part in parts:
        assert part in sentence


def test_inertias_are_optional_only_without_a_shaft():
    assert load_machine("jeffcott").bodies[0].Id == 0
    assert "bodies.generator.Id is missing" in refusal(edited(["bodies", 0, "Id"], ...))


@pytest.mark.parametrize("name", ["kaplan", "Kaplan-150RPM", "", None, 5, "../cards/jeffcott",
                                  "kaplan-family", "a\nb"])
def test_an_unknown_name_lists_what_ships(name):
    with pytest.raises(BadInput, match=", ".join(SHIPPED)) as caught:
        load_machine(name)
    assert one_sentence(str(caught.value))
    with pytest.raises(BadInput):
        card_text(name)


def test_an_unknown_name_gets_the_nearest():
    with pytest.raises(BadInput, match=r"the nearest is kaplan-150rpm"):
        load_machine("kaplan-150")
    with pytest.raises(BadInput, match=r"does not exist.*the nearest is three-disc"):
        load_machine("three_disc.toml")


@pytest.mark.parametrize(("content", "parts"), [
    (b"schema = 1\nname = \n", ["bad.toml", "is not TOML", "line 2"]),
    (b"\xff\xfe", ["is not UTF-8 text"]),
    (b"", ["bad.toml: schema is missing"]),
    (b"schema = 1\nschema = 1", ["cannot overwrite a value"]),
    (b"a = " + b"[" * 100_000, ["is not TOML"]),
    (b"a = " + b"9" * 10_000, ["is not TOML"]),
    (b"schema = 0x" + b"f" * 10_000, ["schema is", "40000 bits"]),
    (b"schema = 1\nname = 'x'\n[speed]\nvalue = 0x" + b"f" * 10_000 + b"\nunit = 'rpm'\nsource = "
     b"'paper'",
     ["bad.toml: speed is", "40000 bits"]),
    (b"a." * 90 + b"a = 1", ["schema is missing"]),
    (b"a." * 900_000 + b"a = 1", ["more than 100 dots"]),
    (b"x" * 3_000_000, ["is larger than 2 MB"]),
])
def test_a_file_that_is_no_card(content, parts, tmp_path):
    (tmp_path / "bad.toml").write_bytes(content)
    with pytest.raises(BadInput) as caught:
        load_machine(tmp_path / "bad.toml")
    assert one_sentence(str(caught.value)), str(caught.value)
    for part in parts:
        assert part in str(caught.value)


def test_what_is_no_file(tmp_path):
    with pytest.raises(BadInput, match="is not a file"):
        (tmp_path / "folder.toml").mkdir()
        load_machine(tmp_path / "folder.toml")
    for name in ("nul\0.toml", "x" * 5000 + ".toml"):
        with pytest.raises(BadInput) as caught:
            load_machine(name)
        assert one_sentence(str(caught.value))


def test_windows_line_ends_and_byte_order_mark(tmp_path):
    text = card_text("jeffcott").replace("\r\n", "\n").replace("\n", "\r\n")
    (tmp_path / "w.toml").write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert str(load_machine(tmp_path / "w.toml")) == str(load_machine("jeffcott"))


# Writing

@pytest.mark.parametrize("name", SHIPPED)
def test_what_is_written_reads_back(name, tmp_path):
    machine = write_card(CARDS[name], tmp_path / "new.toml")
    assert read_card(tmp_path / "new.toml") == CARDS[name]
    assert str(machine) == str(load_machine(tmp_path / "new.toml")) == str(load_machine(name))


def test_entries_and_numpy_numbers_can_be_written(tmp_path):
    card = edited(MASS, Entry(np.float64(1.1e5), "kg", "calibrated", 'first fold at "8.925 %"'))
    card["shaft"]["nodes"]["value"] = np.array(card["shaft"]["nodes"]["value"])
    write_card(card, tmp_path / "new.toml")
    text = (tmp_path / "new.toml").read_text(encoding="utf-8")
    assert (r'mass = {value = 1.1e+5, unit = "kg", source = "calibrated", '
            r'note = "first fold at \"8.925 %\""}') in text
    unit = load_machine(tmp_path / "new.toml")
    assert str(unit.provenance["bodies.generator.mass"]) == (
        '110000 kg  [calibrated] first fold at "8.925 %"')


def test_a_bad_card_is_not_written(tmp_path):
    with pytest.raises(BadInput, match="mass"):
        write_card(edited([*MASS, "value"], -1), tmp_path / "new.toml")
    assert not (tmp_path / "new.toml").exists()
    with pytest.raises(BadInput, match="cannot be written"):
        write_card(CARDS["jeffcott"], tmp_path / "nowhere" / "new.toml")


@given(st.text(), st.floats(0.1, 1e12))
def test_texts_and_numbers_survive_the_file(tmp_path_factory, text, mass):
    card = edited(["about"], text, "jeffcott")
    card["bodies"][0]["mass"] = Entry(mass, "kg", "assumed")
    path = tmp_path_factory.mktemp("cards") / "new.toml"
    try:
        write_card(card, path)
    except BadInput as error:
        assert only_sentences(error)
    else:
        found = tomllib.loads(path.read_bytes().decode())
        assert found["about"] == text and found["bodies"][0]["mass"]["value"] == mass


# Whatever is done to a card

def places(card, path=()):
    """Every place of a card, as paths."""
    items = card.items() if isinstance(card, dict) else enumerate(card) if isinstance(card,
                                                                                      list) else ()
    for step, value in items:
        yield (*path, step)
        yield from places(value, (*path, step))


PLACES = {name: list(places(card)) for name, card in CARDS.items()}
JUNK = st.one_of(
    st.just(...), st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=20),
    st.binary(max_size=5),
    st.sampled_from([10**30, 10**400, -10**5000, 1e300, -1e-300, 1e-40, math.nan, -math.inf, "nan",
                     "", "a\nb",
                     "\x1b[2J", [], {}, [[]], [[1, 2], [3]], [{}], {"value": 1},
                     datetime.date(2024, 1, 1)]),
    st.recursive(st.floats() | st.text(max_size=3),
                 lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
        st.sampled_from(["value", "unit", "source", "name"]) | st.text(max_size=3), inner,
        max_size=3), max_leaves=6))


@settings(max_examples=500, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
def test_a_mutated_card_is_a_machine_or_sentences(data):
    name = data.draw(st.sampled_from(SHIPPED))
    card = copy.deepcopy(CARDS[name])
    for path in data.draw(st.lists(st.sampled_from(PLACES[name]), min_size=1, max_size=3)):
        value = data.draw(JUNK)
        try:
            place = card
            for step in path[:-1]:
                place = place[step]
            if data.draw(st.booleans()) and isinstance(place, dict):
                # a key that was not there
                place[data.draw(st.text(max_size=8))] = copy.deepcopy(value)
            elif value is ...:
                del place[path[-1]]
            else:
                place[path[-1]] = copy.deepcopy(value)
        except (KeyError, IndexError, TypeError):
            continue  # an earlier change took the place away
    try:
        machine = machine_from_card(card)
    except BadInput as error:
        assert only_sentences(error), str(error)
    else:
        assert isinstance(machine, Machine) and str(machine)


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_a_damaged_file_is_a_machine_or_one_sentence(tmp_path_factory, data):
    text = bytearray(card_text(data.draw(st.sampled_from(SHIPPED))).encode())
    at = data.draw(st.integers(0, len(text)))
    text[at:at + data.draw(st.integers(0, 20))] = data.draw(st.binary(max_size=6) | st.sampled_from(
        [b"-", b"=", b"[", b"]]", b"{", b'"', b"\n", b"#", b"nan", b"1e999", b"0x", b"\\", b"'''"]))
    path = tmp_path_factory.mktemp("cards") / "damaged.toml"
    path.write_bytes(bytes(text))
    try:
        assert isinstance(load_machine(path), Machine)
    except BadInput as error:
        assert only_sentences(error), str(error)
