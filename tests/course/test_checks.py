"""Checks of exercises: each mistake that has a name gets its own hint, and no answer of any kind
stops a chapter.
"""

import math

import numpy as np
import pytest

from hydrolab import HarmonicBalance
from hydrolab.course import exercises
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
    (3.0, "wrong", "Read again: The gap."),
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
    (np.eye(2), -np.eye(2), "wrong"),
    (["forward", "backward"], ["Forward", "backward "], "right"),
    (["forward", "backward"], ["backward", "backward"], "wrong"),
    (["forward", "backward"], "forward", "type"),
    ({"a": 1, "b": 2}, {"b": 2, "a": 1}, "right"),
    ({"a": 1, "b": 2}, {"a": 1}, "shape"),
    ({"a": 1, "b": 2}, {"a": 2, "b": 1}, "wrong"),
    ("stable", "Stable", "right"),
    ("stable", 1, "type"),
])
def test_other_kinds_of_answers(right, answer, found):
    assert judge(Exercise(lambda: right, see="x"), answer).found == found


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
