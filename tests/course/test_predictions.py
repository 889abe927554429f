"""What a student said beside what came out."""

import pytest

from hydrolab.course import predictions
from hydrolab.course.predictions import answer, answered, predict, recall
from hydrolab.errors import BadInput


@pytest.fixture(autouse=True)
def fresh(monkeypatch):
    monkeypatch.setattr(predictions, "_KEPT", {})


@pytest.mark.parametrize(("prediction", "computed", "unit", "said"), [
    (..., -1.5951, "mm", "Computed: −1.6 mm. You have not predicted it"),
    (-1.5, -1.5951, "mm", "You said −1.5 mm: within 10 %."),
    (1.6, -1.5951, "mm", "the other sign"),
    (100, 42.4, "rad/s", "2.4 times as much"),
    (405, 42.4, "rad/s", "within 10 % if you meant rpm; it was asked for in rad/s"),
    (0.0016, 1.6, "mm", "if you meant m;"),
    (0.5, 1.0, "", "50 % of it"),
    (0, 1.0, "", "You said 0."),
    ("much", 1.0, "mm", "which is not a number of mm"),
    ("-X ", "-x", "", "the same"),
    ("+x", "-x", "", "not the same"),
    (..., "-x", "", "Computed: -x. You have not predicted it"),
])
def test_answered(prediction, computed, unit, said):
    assert said in answered(prediction, computed, unit)


@pytest.mark.parametrize(("value", "more", "said"), [
    (..., {"unit": "mm"}, "2a: no prediction yet. Put a number of mm in place of ..."),
    (..., {"choices": ["+x", "-x"]}, "Put one of '+x', '-x' in place of ..."),
    (-1.5, {"unit": "mm"}, "2a: you predict −1.5 mm."),
    ("+X", {"choices": ["+x", "-x"]}, "2a: you predict +X."),
    ("left", {"choices": ["+x", "-x"]}, "'left', which is not one of '+x', '-x'"),
    (None, {"unit": "mm"}, "you predict None, which is not a number of mm"),
    (True, {"unit": "1"}, "which is not a pure number"),
])
def test_a_prediction_is_kept_in_words(value, more, said, capsys):
    predict("2a", value, **more)
    assert said in capsys.readouterr().out


def test_a_prediction_is_answered_and_recalled(capsys):
    predict("2a", 2, "mm")
    predict("2b", ..., choices=["+x", "-x"])
    answer("2a", 1.0, "The pull grows faster than the displacement.")
    said = capsys.readouterr().out
    assert "2a: Computed: 1 mm. You said 2 mm: 2 times as much. The pull grows" in said
    recall()
    assert capsys.readouterr().out.splitlines() == ["2a: Computed: 1 mm. You said 2 mm: 2 times as "
                                                    "much.",
                                                    "2b: not computed yet; run the cells above."]


def test_a_second_try_replaces_the_first(capsys):
    predict("2a", 2, "mm")
    predict("2a", 1, "mm")
    answer("2a", 1.0)
    assert "within 10 %" in capsys.readouterr().out


def test_a_prediction_has_a_unit():
    with pytest.raises(BadInput, match="says no unit"):
        predict("2a", 1)


def test_what_was_not_predicted_has_no_answer():
    with pytest.raises(BadInput, match="'2c'"):
        answer("2c", 1.0)
