"""A number of a part is declared once: what cards, sentences, lists of keys and copies make of it.
"""

import copy
import pickle
import tomllib
from dataclasses import asdict, dataclass, fields, replace

import numpy as np
import pytest

from hydrolab import BadInput, HarmonicBalance, load_machine, vary
from hydrolab.machine.bearings import BEARINGS, JournalFilm, PadBearing
from hydrolab.machine.cards import (
    ALONE,
    SEVERAL,
    card_keys,
    card_names,
    machine_from_card,
    needed,
    read_card,
)
from hydrolab.machine.parts import Machine
from hydrolab.machine.quantities import Part, declared, number_field, numbers_of, text_field
from tests.machines import MACHINES

UNIT = load_machine("kaplan-150rpm")


def stated(value, unit):
    return {"value": value, "unit": unit, "source": "assumed"}


def refusal(card):
    with pytest.raises(BadInput) as caught:
        machine_from_card(card)
    return str(caught.value).split("\n")


# Declared once


@dataclass(frozen=True)
class Spring(Part):
    table, noun = "springs", "a spring"
    name: str = text_field("what it is called", "a spring")
    rate: float = number_field("N/m", "its rate", above=0, below=1e3, example=(5, "N/m"))
    length: float = number_field("m", "its length", least=0, default=1.0, example=(5, "mm"))

    def disagreements(self):
        if self.length > self.rate:
            yield "length", f"is {self.length:g} m, above springs.rate, {self.rate:g} N/m."


def test_one_line_declares_a_number():
    assert replace(Spring("a", 5), length=2).length == 2
    assert needed(Spring) == ["name", "rate"]
    rate = numbers_of(Spring)["rate"]
    assert (rate.unit, rate.limits) == ("N/m", "above 0 N/m, below 1000 N/m")
    assert list(numbers_of(Spring)["length"].units) == ["m", "mm", "µm", "in", "mil"]
    with pytest.raises(BadInput) as caught:
        Spring("a", -5, "long")
    assert str(caught.value).split("\n") == [
        "springs.a.rate is -5 N/m; it must be larger than 0 N/m.",
        "springs.a.length is 'long'; it must be a number in m."]
    with pytest.raises(BadInput, match=r"^springs.a.length is 7 m, above springs.rate, 5 N/m.$"):
        Spring("a", 5, 7)


SEVERAL_TABLES = ("bodies", "bearings", "cracks", "shapes", "loads", "bows")


def test_every_key_of_a_card_has_an_example_that_loads():
    """The paper's unit with each example in its place, one after the other, is a machine."""
    rows = card_keys()
    assert len(rows) == len({(row.part, row.key) for row in rows}) > 60
    base = read_card("kaplan-150rpm")
    base["bearings"] += [
        {"name": "pads", "node": 1, "pads": 8, "pad_stiffness": stated(1e9, "N/m"),
         "clearance": stated(1, "mm")},
        {"name": "film", "node": 2, "viscosity": stated(0.03, "Pa s"),
         "journal_radius": stated(0.5, "m"), "film_length": stated(0.5, "m"),
         "clearance": stated(0.3, "mm")},
        {"name": "seal", "node": 5, "seal_stiffness": stated(-1, "MN/m")},
        {"name": "table", "node": 7, "speeds": stated([0, 150, 500], "rpm"),
         "stiffness_rows": stated([1, 1, 1], "GN/m"), "damping_rows": stated([1, 1, 1], "N s/m")}]
    for bearing in base["bearings"]:
        if "tilt_stiffness" not in bearing:
            bearing |= {"bracket_stiffness": stated(1, "GN/m"), "bracket_mass": stated(1, "t")}
    base["cracks"] = [{"name": "crack", "element": 0, "depth": stated(5, "%")}]
    base["shapes"] = [{"name": "oval", "of": "stator", "order": 3, "size": stated(1, "mm")}]
    base["poles"] = {"pole_pairs": 10}
    base["gravity"] = {"acceleration": stated(0.1, "m/s^2")}
    base["loads"] = [{"name": "thrust", "node": 0, "force": stated(1, "kN")}]
    base["bows"] = [{"name": "bow", "node": 0, "end_node": 2, "size": stated(1, "µm")}]
    place = {"the machine": base, "the card": base, "a body": base["bodies"][0],
             "a crack": base["cracks"][0], "a shape": base["shapes"][0],
             "a load": base["loads"][0], "a bow": base["bows"][0],
             "a radial bearing": base["bearings"][0], "a thrust bearing": base["bearings"][1],
             "pads with clearance": base["bearings"][3], "a journal film": base["bearings"][4],
             "a seal": base["bearings"][5], "a table over the speed": base["bearings"][6]}
    of_a_round_gap = {"air_gap.linear": ("poles", "shapes"), "poles.flux_share": ("shapes",)}
    for row in rows:
        card = copy.deepcopy(base)
        if row.part not in place:
            table = card[row.part.strip("[]")]
        else:
            table = next(t for t in (card, *(t for k in SEVERAL_TABLES for t in card[k]))
                         if t == place[row.part])
        example = tomllib.loads(row.example)
        if row.key == "shaft.nodes":  # four nodes: nothing else of the unit may lie further down
            card["bodies"][1]["node"] = card["bearings"][1]["node"] = 3
            for bearing in card["bearings"][2:]:
                bearing["node"] = min(bearing["node"], 3)
        if row.key in ("shaft.inner_diameter", "shaft.lower_diameter"):  # no place for a crack
            del card["cracks"]
        for gone in of_a_round_gap.get(row.key, ()):
            del card[gone]
        table |= example
        assert isinstance(machine_from_card(card), Machine), row
        if row.needed:
            said = ("missing", "has neither")  # the number that tells the kind of a bearing
            assert any(row.key.rpartition(".")[2] in line and any(words in line for words in said)
                       for line in refusal(_without(card, table, next(iter(example))))), row


def _without(card, table, key):
    del table[key]
    return card


def test_keys_say_meaning_units_and_limits():
    rows = {(row.part, row.key): row for row in card_keys()}
    mass = rows["a body", "bodies.….mass"]
    assert (mass.unit, mass.limits, mass.needed) == ("kg, t, lb", "above 0 kg", True)
    assert mass.example == 'mass = { value = 119, unit = "t", source = "assumed" }'
    assert rows["a crack", "cracks.….breathing"].limits == "hinge, open"
    assert rows["pads with clearance", "bearings.….pads"].limits == "a whole number from 3 to 64"
    assert rows["[shaft]", "shaft.poisson"].limits == "above -1, below 0.5"
    assert all(row.meaning and row.example for row in rows.values())


def test_every_kind_of_part_declares_all_its_fields():
    for kind in (*ALONE, *SEVERAL, *BEARINGS):
        assert set(declared(kind)) == {f.name for f in fields(kind)}, kind
        for holds in numbers_of(kind).values():
            assert holds.example[1] in holds.units, holds


@pytest.mark.parametrize("name", MACHINES)
def test_a_machine_knows_each_of_its_numbers(name):
    machine = MACHINES[name]()
    for key, value in machine.numbers().items():
        again = vary(machine, {key: value})
        assert np.array_equal(again.numbers()[key], value)
        if np.size(np.unique(value)) == 1 and np.ndim(value) < 2:
            assert machine.number(key)[0] == np.unique(value)[0]


def test_a_number_comes_with_its_unit():
    assert UNIT.number("bodies.generator.mass") == (119e3, "kg")
    assert UNIT.number("bearings.turbine guide bearing.stiffness") == (1.64e9, "N/m")
    assert UNIT.number("shaft.diameter") == (0.71, "m")
    assert UNIT.number("field") == (0.5, "T")
    with pytest.raises(BadInput, match=r"shaft.nodes is \[0, 0.9.*must be one number"):
        UNIT.number("shaft.nodes")
    with pytest.raises(BadInput, match="'colour' is not a number of kaplan-150rpm; there are"):
        UNIT.number("colour")


def test_numbers_that_must_agree_change_together():
    """Neither change alone is possible: Ip above 2 Id."""
    changes = {"bodies.generator.Ip": 6e5, "bodies.generator.Id": 4e5}
    assert vary(UNIT, changes).bodies[0].Ip == vary(UNIT, dict(reversed(changes.items()))
                                                    ).bodies[0].Ip == 6e5
    with pytest.raises(BadInput, match="Ip above 2 Id"):
        vary(UNIT, {"bodies.generator.Ip": 6e5})


def test_only_a_machine_is_varied():
    with pytest.raises(BadInput, match="machine is a Model; it must be a Machine"):
        vary(UNIT.model(), {"field": 0.5})


def test_a_place_is_a_node_a_depth_or_a_name():
    orbit = HarmonicBalance(1).solve(UNIT.model(), UNIT.speed)
    for place in (1, 0.953, "generator guide bearing"):
        assert orbit.model.node_at(place) == 1
        assert np.array_equal(orbit.node_coefficients(place), orbit.node_coefficients(1))
    assert orbit.model.node_at("turbine") == orbit.model.node_at(9.04) == 12
    for place, said in (("upper guide", "no body or bearing of kaplan-150rpm is called 'upper "
                         "guide'; there are generator, turbine, generator guide bearing"),
                        (3.3, "no node of kaplan-150rpm is at 3.3 m; the nearest is node 4 at "
                         "3.1119 m"), (13, "node is 13; it must be a whole number from 0 to 12"),
                        (None, "node is None")):
        with pytest.raises(BadInput, match=said):
            orbit.node_coefficients(place)


# All faults at once


def test_a_bad_card_names_all_its_faults():
    card = read_card("kaplan-150rpm")
    del card["bodies"][0]["mass"], card["name"]
    card["bodies"][1]["Ip"] |= {"unit": "lb", "source": "guess"}
    card["bodies"][1]["colour"] = "red"
    card["shaft"]["diameter"]["value"] = -710
    card["bearings"][0]["damping"] = stated("soft", "N s/m")
    card["air_gap"]["gap"]["value"] = 11
    lines = refusal(card)
    beginnings = ("name is missing", "shaft.diameter is -0.71 m", "air_gap.gap is 11 m",
                  "bodies.generator.mass is missing", "bodies.turbine.colour = 'red'",
                  "bodies.turbine.Ip.unit is 'lb'", "bodies.turbine.Ip.source is 'guess'",
                  "bearings.generator guide bearing.damping is 'soft'")
    assert [any(line.startswith(begin) for line in lines) for begin in beginnings] == [True] * 8
    assert len(lines) == 8 and all(line.endswith(".") for line in lines)


def test_what_does_not_go_together_is_named_at_once():
    card = read_card("kaplan-150rpm")
    card["bodies"][0]["node"], card["bearings"][2]["node"] = 13, 20
    card["air_gap"]["body"] = "stator"
    lines = refusal(card)
    assert [line.split(";")[0] for line in lines] == [
        "bodies.generator.node is 13, off the shaft",
        "bearings.turbine guide bearing.node is 20, off the shaft", "air_gap.body is 'stator'"]


def test_the_file_is_named_in_each_line(tmp_path):
    (tmp_path / "bad.toml").write_text("schema = 1\ncolour = 2\n")
    with pytest.raises(BadInput) as caught:
        load_machine(tmp_path / "bad.toml")
    assert all(line.startswith("bad.toml: ") for line in str(caught.value).split("\n"))


# Numbers against each other


FILM = JournalFilm("film", 1, 0.03, 0.4, 0.25, 2e-4)


@pytest.mark.parametrize(("wrong", "said"), [
    (lambda: vary(UNIT, {"bodies.generator.mass": 119}),
     ["bodies.generator.mass is 119 kg", "gyration of 56.8 m"]),
    (lambda: vary(UNIT, {"bodies.generator.mass": 3000, "bodies.generator.unbalance": 0}),
     ["bodies.generator.mass is 3000 kg", "gyration of 11.3 m", "air_gap.mean_radius, 2.9945 m"]),
    (lambda: vary(UNIT, {"bodies.turbine.mass": 31.3}), ["31.3 kg", "gyration of 29.5 m", "20 m"]),
    (lambda: vary(UNIT, {"shaft.diameter": 710}),
     ["shaft.diameter is 710 m", "5 times the shaft's 9.04 m"]),
    (lambda: vary(UNIT, {"bodies.generator.offset": -472}),
     ["bodies.generator.offset is -472 m", "5 times the shaft's 9.04 m"]),
    (lambda: vary(UNIT, {"air_gap.field": 5000}), ["air_gap.field is 5000 T", "100 T", "iron"]),
    (lambda: vary(UNIT, {"bodies.generator.unbalance": 0.7 * 119e3}),
     ["unbalance is 83300 kg m", "0.7 m times the mass", "5 times air_gap.gap, 0.011 m"]),
    (lambda: vary(UNIT, {"bodies.turbine.unbalance": 1e5}),
     ["unbalance is 100000 kg m", "3.19 m times the mass", "gyration, 0.932 m"]),
    (lambda: replace(UNIT, pad_bearings=(PadBearing("pads", 1, 8, 1e8, 1.0),)),
     ["bearings.pads.clearance is 1 m", "0.1 times shaft.diameter there, 0.071 m"]),
    (lambda: replace(load_machine("jeffcott"),
                     pad_bearings=(PadBearing("pads", 0, 8, 1e8, 1.0),)),
     ["bearings.pads.clearance is 1 m", "air_gap.gap, 0.011 m"]),
    (lambda: replace(UNIT, films=(replace(FILM, journal_radius=400, film_length=250,
                                          clearance=0.2),)),
     ["bearings.film.journal_radius is 400 m", "5 times shaft.diameter there, 3.55 m"]),
    (lambda: vary(UNIT, {"bearings.turbine guide bearing.stiffness": [[100, 1e9], [150, 1.2e9]]}),
     ["stiffness is [[100", "table over the speed"]),
])
def test_numbers_that_cannot_belong_to_one_machine(wrong, said):
    with pytest.raises(BadInput) as caught:
        wrong()
    assert all(words in str(caught.value) for words in said), str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_card_and_its_unit_are_named_where_two_numbers_disagree():
    card = read_card("kaplan-150rpm")
    card["bodies"][0]["mass"]["unit"] = "kg"
    assert refusal(card)[0].startswith("bodies.generator.mass is 119 kg and bodies.generator.Ip")
    card = read_card("kaplan-150rpm")
    card["bodies"][0]["offset"]["unit"] = "m"
    assert len(refusal(card)) == 1 and "-472 m" in refusal(card)[0]
    card["bodies"][0]["offset"] = stated(-47200, "mm")
    assert refusal(card)[0].endswith("; the card says -47200 mm.")


@pytest.mark.parametrize("matrix", [
    [[1e9, 2e8], [-2e8, 1e9]], [[1e9, 0], [0, 2e9]], [[0, 5e7], [-5e7, 0]],  # a seal
    [[1e6, 3e9], [-2e9, 4e9]], [[3e8, 1e9], [5e8, 2e9]], [[5e7, 0], [0, 0]]])
def test_a_matrix_of_a_bearing_is_not_taken_for_a_table(matrix):
    changed = vary(UNIT, {"bearings.turbine guide bearing.stiffness": matrix})
    assert changed.bearings[1].stiffness.tolist() == matrix


def test_the_greek_letter_is_the_micro_sign():
    card = read_card("jeffcott")
    card["air_gap"]["gap"] = stated(11_000, "\u03bcm")
    assert machine_from_card(card).air_gap.gap == 0.011
    assert "air_gap.gap" in str(machine_from_card(card)) and "11000 \u00b5m" in str(
        machine_from_card(card))


# Copies


@pytest.mark.parametrize("name", [*card_names(), *MACHINES])
def test_a_machine_can_be_pickled_copied_and_taken_apart(name):
    machine = load_machine(name) if name in card_names() else MACHINES[name]()
    model = machine.model()
    u = np.full(len(model.selection), 1e-5)
    force = model.law.force(u, u, 0.3, machine.speed)
    for other in (pickle.loads(pickle.dumps(machine)), copy.deepcopy(machine)):
        assert str(other) == str(machine) and other.provenance.keys() == machine.provenance.keys()
        assert np.array_equal(other.model().K, model.K)
        assert np.array_equal(other.model().law.force(u, u, 0.3, machine.speed), force)
    apart = asdict(machine)
    assert apart["bodies"][0]["mass"] == machine.bodies[0].mass
    assert apart["provenance"].keys() == machine.provenance.keys()


def test_a_refusal_survives_a_process():
    with pytest.raises(BadInput) as caught:
        vary(UNIT, {"bodies.generator.mass": -1})
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
