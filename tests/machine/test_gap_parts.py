"""Card keys of poles, shapes and the tangential pull: they build the laws, and refuse with a
sentence.
"""

from dataclasses import replace

import numpy as np
import pytest

from hydrolab import BadInput, load_machine, vary
from hydrolab.machine.cards import machine_from_card, read_card, write_card
from hydrolab.machine.gap_shape import Bulge, gap_shapes
from hydrolab.machine.parts import AirGap
from hydrolab.machine.pole_pairs import PolePairPull
from hydrolab.machine.pull import CircularPull, LinearPull, SeveralLaws, ShapedPull


def stated(value, unit="1"):
    return {"value": value, "unit": unit, "source": "assumed"}


OVAL = {"name": "oval", "of": "stator", "order": 2, "size": stated(0.4, "mm"),
        "angle": stated(30, "deg")}
WORN = {"name": "worn", "of": "rotor", "order": 3, "size": stated(0.2, "mm")}


def card(**changes):
    """The Jeffcott card with changes in its tables."""
    out = read_card("jeffcott")
    out["air_gap"] |= changes.pop("air_gap", {})
    return out | changes


def law_of(**changes):
    return machine_from_card(card(**changes)).model().law


def test_every_law_has_a_card_key():
    air = load_machine("jeffcott").air_gap
    k, gap = air.pull_stiffness, air.gap
    assert law_of() == CircularPull(k, gap)
    assert law_of(air_gap={"linear": True}) == LinearPull(k, gap)
    assert law_of(poles={"pole_pairs": 3}) == PolePairPull(k, gap, 3, 3.0)
    slipping = {"pole_pairs": 1, "electrical_ratio": stated(1.25), "pole_angle": stated(90, "deg"),
                "series": "published",
                "backward": stated(20, "%"), "backward_angle": stated(0.4, "rad")}
    assert law_of(poles=slipping) == PolePairPull(k, gap, 1, 1.25, np.pi / 2, 0.2, 0.4, True)
    loaded = law_of(poles={"pole_pairs": 1, "stator_mmf": stated(0.8),
                           "load_angle": stated(60, "deg")})
    assert isinstance(loaded, ShapedPull) and loaded.waves[1].angle == pytest.approx(-np.pi / 3)
    assert isinstance(law_of(shapes=[OVAL]), ShapedPull)
    turning = law_of(shapes=[OVAL, WORN])
    assert turning.rotor == (Bulge(3, 0.2e-3),)
    assert turning.shape == pytest.approx(gap + 0.4e-3 * np.cos(2 * (turning.angles - np.pi / 6)))
    damped = law_of(air_gap={"tangential": stated(5, "%")})
    assert isinstance(damped, SeveralLaws)
    e = np.array([0.0, 1e-4])
    assert damped.force(e) == pytest.approx([0.05 * k * 1e-4, CircularPull(k, gap).force(e)[1]])
    assert damped.scaled(4.0).force(e) == pytest.approx(4 * damped.force(e))
    assert damped.smallest_gap(e) == pytest.approx(gap - 1e-4)


def test_the_tangential_pull_stands_beside_any_law():
    both = law_of(poles={"pole_pairs": 1}, air_gap={"tangential": stated(-0.1)})
    e, still = np.array([1e-4, 2e-4]), np.zeros(2)
    alone = law_of(poles={"pole_pairs": 1})
    extra = both.force(e, still, 0.7, 1.0) - alone.force(e, still, 0.7, 1.0)
    assert extra == pytest.approx(-0.1 * alone.stiffness * np.array([2e-4, -1e-4]))
    unit = load_machine("kaplan-150rpm")
    leaning = replace(unit, air_gap=replace(unit.air_gap, tilt=True, tangential=0.1)).model()
    assert leaning.selection.shape[0] == 4 and leaning.law.force(np.array([0, 1e-4, 0, 0]))[0] > 0


def test_cards_of_these_parts_are_written_and_read(tmp_path):
    machine = write_card(card(shapes=[OVAL, WORN], air_gap={"tangential": stated(5, "%")}),
                         tmp_path / "own.toml")
    again = load_machine(tmp_path / "own.toml")
    assert again.numbers().keys() == machine.numbers().keys()
    e, still = np.array([1e-4, 2e-4]), np.zeros(2)
    pulls = [m.model().law.force(e, still, 0.7) for m in (again, machine)]
    assert np.array_equal(*pulls)
    said = str(machine)
    assert "shapes.oval.size" in said and "0.4 mm" in said and "air_gap.tangential" in said
    assert vary(machine, {"shapes.oval.size": 1e-4}).shapes[0].size == 1e-4
    two_pole = load_machine("two-pole")
    assert vary(two_pole, {"poles.backward": 0.3}).model().law.backward == 0.3
    assert "poles.electrical_ratio" in str(two_pole)


def test_a_shape_of_many_orders_goes_on_a_machine():
    bulges = (Bulge(2, 1e-4, 0.1), Bulge(3, 2e-4))
    machine = replace(load_machine("jeffcott"), shapes=gap_shapes("stator", bulges, "measured"))
    assert [s.name for s in machine.shapes] == ["measured 2", "measured 3"]
    assert isinstance(machine.model().law, ShapedPull)


@pytest.mark.parametrize(("changes", "said"), [
    ({"poles": {"pole_pairs": 0}}, ["poles.pole_pairs is 0", "1 to 100", "constant field"]),
    ({"poles": {"pole_pairs": 1, "electrical_ratio": stated(-1)}},
     ["electrical_ratio is -1", "at least 0"]),
    ({"poles": {"pole_pairs": 1, "backward": stated(-5, "%")}},
     ["poles.backward is -0.05", "at least 0", "-5 %"]),
    ({"poles": {"pole_pairs": 1, "series": "some"}},
     ["poles.series is 'some'", "whole, published"]),
    ({"poles": {"pole_pairs": 1, "series": "published", "stator_mmf": stated(0.5)}},
     ["stator_mmf is 0.5", "leave out"]),
    ({"poles": {"pole_pairs": 1, "slip": stated(0.1)}}, ["poles.slip", "not a key"]),
    ({"poles": {"pole_pairs": 1, "series": "published"}, "shapes": [OVAL]},
     ["poles.series is 'published'", "round gap", "leave out"]),
    ({"poles": {"pole_pairs": 1}, "air_gap": {"linear": True}},
     ["air_gap.linear is true", "leave out poles"]),
    ({"shapes": [OVAL | {"of": "shaft"}]}, ["shapes.oval.of is 'shaft'", "stator, rotor"]),
    ({"shapes": [OVAL | {"order": 0}]}, ["shapes.oval.order is 0", "1 to 40", "oval"]),
    ({"shapes": [OVAL, OVAL]}, ["'oval' is used twice"]),
    ({"shapes": [OVAL | {"size": stated(12, "mm")}]}, ["add up to 0.012 m", "smaller than "
                                                       "air_gap.gap, 0.011 m"]),
    ({"air_gap": {"tangential": stated(float("nan"))}}, ["air_gap.tangential is nan", "finite"]),
    ({"air_gap": {"linear": "yes"}}, ["air_gap.linear is 'yes'", "true or false"]),
])
def test_bad_cards_get_a_sentence(changes, said):
    with pytest.raises(BadInput) as error:
        machine_from_card(card(**changes))
    assert all(words in str(error.value) for words in said), str(error.value)
    assert "\n" not in str(error.value)


def test_what_does_not_go_together_on_a_shaft():
    unit = load_machine("kaplan-150rpm")
    with pytest.raises(BadInput, match="poles needs an air gap"):
        replace(unit, air_gap=None, poles=load_machine("two-pole").poles)
    with pytest.raises(BadInput, match="linear is 1"):
        AirGap("a", 0.5, 1.0, 1.0, 0.01, linear=1)
