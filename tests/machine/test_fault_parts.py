"""Card keys of the parts that act nonlinearly: they build laws on the right coordinates, and refuse
with a sentence.
"""

from dataclasses import replace

import numpy as np
import pytest

from hydrolab import BadInput, load_machine, vary
from hydrolab.machine.bearings import JournalFilm, PadBearing
from hydrolab.machine.cards import machine_from_card, read_card, write_card
from hydrolab.machine.model import slopes
from hydrolab.machine.pull import SeveralLaws, TiltedPull


def stated(value, unit):
    """A number of a card."""
    return {"value": value, "unit": unit, "source": "assumed"}


PADS = {"name": "guide pads", "node": 1, "pads": 8, "pad_stiffness": stated(3.4e8, "N/m"),
        "clearance": stated(150, "µm")}
FILM = {"name": "film", "node": 11, "viscosity": stated(0.03, "Pa s"),
        "journal_radius": stated(400, "mm"),
        "film_length": stated(250, "mm"), "clearance": stated(200, "µm")}
CRACK = {"name": "crack", "element": 2, "depth": stated(20, "%"), "phase": stated(90, "deg"),
         "breathing": "hinge"}


def faulty_card(**changes):
    """The Kaplan unit with pads and a film in place of its guide bearings, a crack and a pull that
    tilts.
    """
    card = read_card("kaplan-150rpm")
    thrust = [b for b in card["bearings"] if "tilt_stiffness" in b]
    card["bearings"] = [*thrust, {**PADS, **changes.get("pads", {})},
                        {**FILM, **changes.get("film", {})}]
    card["cracks"] = [{**CRACK, **changes.get("crack", {})}]
    card["air_gap"] |= {"tilt": True, **changes.get("air_gap", {})}
    return card


def test_every_law_has_a_card_key_and_its_own_coordinates(tmp_path):
    unit = write_card(faulty_card(), tmp_path / "faulty.toml")
    assert load_machine(tmp_path / "faulty.toml").numbers().keys() == unit.numbers().keys()
    assert "guide pads.clearance" in str(unit) and "0.2 m" not in str(unit)
    model = unit.model()
    assert isinstance(model.law, SeveralLaws) and isinstance(model.law.parts[0].law, TiltedPull)
    assert [(p.rows.start, p.rows.stop, p.law.magnetic) for p in model.law.parts] == [
        (0, 4, True), (4, 6, False), (6, 8, False), (8, 10, False)]
    moved = np.arange(model.size) / 7
    x, z, tilt_x, tilt_z = moved[0::4], moved[1::4], -moved[3::4], moved[2::4]
    offset = unit.body("generator").offset
    expected = [x[0] + offset * tilt_x[0], z[0] + offset * tilt_z[0], tilt_x[0], tilt_z[0], x[1],
                z[1], x[11], z[11],
                tilt_x[3] - tilt_x[2], tilt_z[3] - tilt_z[2]]
    assert model.selection @ moved == pytest.approx(expected, rel=1e-12)


def test_numbers_of_the_parts_can_be_varied():
    unit = vary(machine_from_card(faulty_card()),
                {"cracks.crack.depth": 0.1, "bearings.film.viscosity": 0.05,
                                                   "bearings.guide pads.clearance": 2e-4})
    assert (unit.cracks[0].depth, unit.films[0].viscosity) == (0.1, 0.05)
    assert unit.pad_bearings[0].clearance == 2e-4
    with pytest.raises(BadInput, match="is not a number"):
        vary(unit, {"bearings.guide pads.pads": 9})


def test_a_machine_without_these_parts_keeps_its_plain_pull():
    unit = load_machine("kaplan-150rpm")
    faulty = machine_from_card(faulty_card())
    plain = replace(faulty, pad_bearings=(), films=(), cracks=(), bearings=unit.bearings,
                    air_gap=unit.air_gap)
    assert plain.model().law == unit.model().law and np.array_equal(plain.model().K, unit.model().K)


def test_closed_pads_and_the_linear_bearing_they_stand_for_have_one_matrix():
    unit = load_machine("kaplan-150rpm")
    old = unit.bearings[0]
    pads = PadBearing("pads", old.node, 8, old.stiffness[0, 0] / 4, -1e-3)
    model = replace(unit, bearings=unit.bearings[1:], pad_bearings=(pads,)).model()
    assert np.abs(model.K - unit.model().K).max() < 1e-15 * np.abs(model.K).max()
    assert np.abs(model.C - unit.model().C).max() < 1e-9 * np.abs(model.C).max()
    moved = np.full((4, 1), 1e-4)
    # the rounding of the corner
    assert np.abs(model.law.force(moved)[2:]).max() < 3e-3 * old.stiffness[0, 0] * 1e-4


def test_slopes_are_those_of_the_shaft():
    assert slopes(1, 8).tolist() == [[0, 0, 0, 0, 0, 0, 0, -1], [0, 0, 0, 0, 0, 0, 1, 0]]


@pytest.mark.parametrize(("changes", "said"), [
    ({"pads": {"pads": 2}}, ["guide pads.pads is 2", "from 3 to 64", "slip out"]),
    ({"pads": {"pads": 8.5}}, ["guide pads.pads is 8.5", "whole number"]),
    ({"pads": {"pad_stiffness": stated(0, "N/m")}}, ["pad_stiffness is 0 N/m", "larger than 0"]),
    ({"pads": {"node": 13}}, ["guide pads.node is 13", "0 to 12"]),
    ({"pads": {"rounding": stated(-1, "mm")}}, ["rounding is -0.001 m", "at least 0"]),
    ({"pads": {"stiffness": stated(1e9, "N/m")}},
     ["has both stiffness and pad_stiffness", "write two bearings"]),
    ({"film": {"viscosity": stated(-0.1, "Pa s")}},
     ["film.viscosity is -0.1 Pa s", "larger than 0"]),
    ({"film": {"viscosity": stated(30, "cP")}}, ["film.viscosity.unit is 'cP'", "Pa s"]),
    ({"film": {"clearance": stated(50, "mm")}}, ["film.clearance is 0.05 m", "tenth", "0.4 m"]),
    ({"film": {"film_length": stated(1.2, "m")}},
     ["film.film_length is 1.2 m", "short film", "0.8 m"]),
    ({"crack": {"depth": stated(60, "%")}},
     ["crack.depth is 0.6", "at most 0.45 (of the diameter"]),
    ({"crack": {"element": 12}}, ["crack.element is 12", "0 to 11"]),
    ({"crack": {"breathing": "always"}}, ["crack.breathing is 'always'", "hinge, open"]),
    ({"crack": {"breathing": 1}}, ["crack.breathing is 1", "one of hinge, open"]),
    ({"crack": {"rounding_angle": stated(0, "rad")}}, ["rounding_angle is 0 rad", "larger than 0"]),
    ({"air_gap": {"tilt": 1}}, ["air_gap.tilt is 1", "true or false"]),
])
def test_bad_cards_get_a_sentence(changes, said):
    with pytest.raises(BadInput) as caught:
        machine_from_card(faulty_card(**changes))
    sentence = str(caught.value)
    assert all(part in sentence for part in said), sentence
    assert sentence.endswith(".") and "\n" not in sentence


def test_what_needs_a_shaft_says_so():
    card = read_card("jeffcott")
    with pytest.raises(BadInput, match="without a shaft nothing tilts"):
        machine_from_card({**card, "air_gap": {**card["air_gap"], "tilt": True}})
    with pytest.raises(BadInput, match="has no shaft to be in"):
        machine_from_card({**card, "cracks": [CRACK]})
    hollow = read_card("kaplan-150rpm")
    hollow["shaft"]["inner_diameter"] = stated(0.2, "m")
    with pytest.raises(BadInput, match="which is hollow"):
        machine_from_card({**hollow, "cracks": [CRACK]})
    twice = faulty_card()
    twice["cracks"] *= 2
    with pytest.raises(BadInput, match="used twice"):
        machine_from_card(twice)


def test_the_reference_of_a_film_is_five_times_its_cross_stiffness():
    film = JournalFilm("film", 1, 0.03, 0.4, 0.25, 2e-4).law(15.7)
    assert film.damping == pytest.approx(0.03 * 0.4 * 0.25**3 / 2e-4**3)
    _, place, _ = replace(film, reference=0.0).linearise(np.zeros(2), np.array([1e-9, 0.0]),
                                                            0.0, 15.7)
    assert place[0, 1] == pytest.approx(film.reference / 5, rel=1e-4)
