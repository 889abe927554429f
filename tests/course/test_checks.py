"""Checks of exercises: each mistake that has a name gets its own hint, and no answer of any kind
stops a chapter.
"""

import math

import numpy as np
import pytest

from hydrolab import HarmonicBalance
from hydrolab.course import answers as exercises
from hydrolab.course.answers import UNITS, Exercise, Mistake, other_units
from hydrolab.course.checks import check, judge
from hydrolab.errors import BadInput

REGISTERED = {number: asked for of_chapter in exercises.chapters().values()
              for number, asked in of_chapter.items()}
CLOSED = [number for number, asked in REGISTERED.items() if asked.reply is None]
MISTAKES = [(number, i) for number in CLOSED for i in range(len(REGISTERED[number].mistakes))]
ODD = [None, True, 1 + 2j, math.nan, math.inf, -math.inf, "", "−", [], [1, [2]], {}, {"a": ...},
       [..., ...], np.eye(3),
       object(), print, np.float64(3), np.array(3), np.array("a"), 10**400]


@pytest.mark.parametrize("number", REGISTERED)
def test_the_right_answer_is_right(number):
    asked = REGISTERED[number]
    assert judge(asked, asked.right()).found == ("right" if asked.reply is None else "open")


@pytest.mark.parametrize(("number", "i"), MISTAKES)
def test_every_mistake_gets_its_own_hint(number, i):
    asked = REGISTERED[number]
    mistake = asked.mistakes[i]
    verdict = judge(asked, mistake.wrong(asked.right()))
    assert verdict.found == "mistake", verdict.said
    assert mistake.hint in verdict.said and (mistake.see or asked.see) in verdict.said


@pytest.mark.parametrize("number", [n for n in CLOSED
                                    if isinstance(REGISTERED[n].right(), float | int)])
def test_a_number_outside_the_tolerance_is_wrong(number):
    asked = REGISTERED[number]
    right = asked.right()
    assert asked.rtol <= 0.03, "a check must tell mistakes apart"
    if asked.within is not None:
        assert asked.within[0] <= right <= asked.within[1]
        assert judge(asked, 1.01 * asked.within[1]).found != "right"
        return
    for step in (-1.5, 1.5):
        assert judge(asked, right + step * (asked.atol + asked.rtol * abs(right)) + step
                     * 1e-9).found != "right"


@pytest.mark.parametrize("number", REGISTERED)
def test_no_answer_stops_a_chapter(number, capsys):
    check(number, ...)
    assert "not answered yet" in capsys.readouterr().out
    for odd in ODD:
        assert judge(REGISTERED[number], odd).said
    asked = REGISTERED[number]
    assert asked.see and all(mistake.hint.endswith(".") for mistake in asked.mistakes)


@pytest.mark.parametrize("number", ["2", "99.1", "0.99", "", "a.1", "0.1a.2"])
def test_a_number_that_no_exercise_has(number):
    with pytest.raises(BadInput, match="no exercise"):
        check(number, 1)


LENGTH = Exercise(lambda: 2.0, see="The gap", unit="mm", mistakes=(
    Mistake(lambda right: -right, "The sign."),
    Mistake(lambda right: 2 * right, "The diameter.", see="Eq. (2.1)")))


@pytest.mark.parametrize(("answer", "found", "said"), [
    (..., "unanswered", "in place of ..."),
    ("2", "type", "a number of mm"),
    ([2.0], "type", "a list"),
    (math.nan, "type", "finite"),
    (2, "right", "right"),
    (np.array(2.01), "right", "right"),
    (0.002, "unit", "the right value in m; the answer is asked for in mm"),
    (2000.0, "unit", "in µm"),
    (-2.0, "mistake", "The sign. Read again: The gap."),
    (4.0, "mistake", "The diameter. Read again: Eq. (2.1)."),
    (2.3, "wrong", "Read again: The gap."),
    (2.0 * math.sqrt(2), "mistake", "rms value or an amplitude"),
    (2.0 * 30 / math.pi, "mistake", "rpm where rad/s belong"),
])
def test_type_then_unit_then_value_then_mistakes(answer, found, said):
    verdict = judge(LENGTH, answer)
    assert verdict.found == found and said in verdict.said


@pytest.mark.parametrize(("right", "answer", "found"), [
    ([1.0, 2.0], (1, 2), "right"),
    ([1.0, 2.0], [1, 2, 3], "shape"),
    ([1.0, 2.0], [1, ...], "shape"),
    ([1.0, 2.0], 1, "type"),
    (np.eye(2), np.eye(2), "right"),
    (np.eye(2), np.eye(2).tolist(), "right"),
    (np.eye(2), -np.eye(2), "mistake"),
    (["forward", "backward"], ["Forward", "backward "], "right"),
    (["forward", "backward"], ["backward", "backward"], "wrong"),
    (["forward", "backward"], "forward", "type"),
    ({"a": 1, "b": 2}, {"b": 2, "a": 1}, "right"),
    ({"a": 1, "b": 2}, {"a": 1}, "shape"),
    ({"a": 1, "b": 2}, {"a": 2, "b": 1}, "mistake"),
    ("stable", "Stable", "right"),
    ("stable", 1, "type"),
])
def test_other_kinds_of_answers(right, answer, found):
    assert judge(Exercise(lambda: right, see="x"), answer).found == found


def test_where_two_mistakes_lead_to_the_same_answer_both_are_said():
    asked = Exercise(lambda: 9.88, see="x", mistakes=(
        Mistake(lambda right: 6.985, "This is 2X in z."),))
    said = judge(asked, 6.986).said
    assert "2X in z" in said and "Or, which gives the same: A factor of √2" in said


def test_a_range_is_right():
    asked = Exercise(lambda: 0.0306, see="x", within=(0.0305, 0.06))
    assert [judge(asked, value).found for value in (0.03, 0.0306, 0.05)] == ["wrong", "right",
                                                                             "right"]


def test_an_open_question_shows_its_rubric():
    asked = Exercise(lambda: 1.0, see="x", reply=lambda answer: "noted.",
                     rubric=((2, "a limit"), (1, "a number")))
    assert judge(asked, 2.0).said == "noted. A full answer has: a limit (2); a number (1)."


OTHERWISE = [  # what else goes wrong with any number: slips that no exercise foresees
    lambda v: -v, lambda v: 2 * v, lambda v: v / 2, lambda v: math.sqrt(2) * v,
    lambda v: v / math.sqrt(2), lambda v: math.sqrt(8) * v, lambda v: v / math.sqrt(8),
    lambda v: v * math.pi / 30, lambda v: v * 30 / math.pi, lambda v: 2 * math.pi * v,
    lambda v: v / (2 * math.pi), lambda v: 60 * v, lambda v: v / 60, lambda v: 1e3 * v,
    lambda v: v / 1e3, lambda v: 100 * v, lambda v: v / 100, lambda v: v * v, lambda v: 1 / v,
    lambda v: 4 * v, lambda v: v / 4, lambda v: 0.11 * v, lambda v: 9.81 * v,
    lambda v: v + 1, lambda v: 1.1 * v, lambda v: 10 * v]


def test_most_plausible_wrong_answers_get_a_hint_of_their_own():
    """At least 85 of 100 slips that any number may suffer; those that an exercise names itself are
    not counted, as each of them is known.
    """
    found = {number: [judge(asked, slip(right)).found for slip in OTHERWISE] for number in CLOSED
             if isinstance(right := (asked := REGISTERED[number]).right(), float | int) and right}
    every = [kind for kinds in found.values() for kind in kinds if kind != "right"]
    assert len(every) > 500
    assert sum(kind in ("mistake", "unit") for kind in every) >= 0.85 * len(every), {
        number: kinds.count("wrong") for number, kinds in found.items()}


def test_a_choice_is_among_the_choices():
    asked = Exercise(lambda: "+x", see="x", choices=("+x", "-x"))
    assert judge(asked, "−x").found == "wrong"
    assert "one of '+x', '-x'" in judge(asked, "left").said


def test_an_object_is_measured():
    asked = Exercise(HarmonicBalance, see="x", measure=lambda method: method.harmonics)
    assert judge(asked, HarmonicBalance()).found == "right"
    assert judge(asked, HarmonicBalance(harmonics=7)).found == "wrong"
    assert judge(asked, 4).said.startswith("a HarmonicBalance is asked for")


def test_units_convert_as_they_should():
    assert other_units("rad/s")["rpm"] == pytest.approx(60 / (2 * math.pi))
    assert other_units("mm") == pytest.approx({"m": 1e-3, "µm": 1e3})
    assert other_units("%") == {"fraction": 0.01} and other_units("kg m") == {}
    assert len({unit for kind in UNITS for unit in kind}) == sum(map(len, UNITS))
