"""What a student predicted, beside what was computed: `predict` keeps it, `answer` answers it,
`recall` tells it all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hydrolab.course.answers import other_units
from hydrolab.course.checks import is_number
from hydrolab.errors import BadInput


@dataclass
class Prediction:
    """What was asked, what was said, and, once it is known, one sentence on what came out."""

    value: Any
    unit: str = ""
    choices: tuple[str, ...] = ()
    outcome: str = ""


_KEPT: dict[str, Prediction] = {}  # of this kernel, that is, of one chapter


def predict(name: str, value: Any, unit: str = "", *, choices: Sequence[str] = ()) -> None:
    """Keep a predicted value, a number of `unit` ("1": a pure one) or one of `choices`, until
    `answer` is called with the same name.

    `...` is a prediction not made yet: it is kept as such, with a word on how to make it. Raises
    BadInput where neither a unit nor choices are given: a number without one cannot be judged.
    """
    if not unit and not choices:
        raise BadInput(f"The prediction {name!r} says no unit; give one, as in predict({name!r}, "
                       '..., "mm"), or choices.')
    _KEPT[name] = Prediction(value, unit, tuple(choices))
    wanted = f"one of {', '.join(map(repr, choices))}" if choices else _number_of(unit)
    if value is ...:
        print(f"{name}: no prediction yet. Put {wanted} in place of ... and run this cell again.")
    elif not (str(value).strip().lower() in {choice.lower() for choice in choices} if choices
              else is_number(value)):
        print(f"{name}: you predict {value!r}, which is not {wanted}.")
    else:
        print(f"{name}: you predict {value if choices else _quantity(value, unit)}.")


def answer(name: str, computed: float | str, why: str = "") -> None:
    """Print what was predicted under `name`, what was computed, and why it came out so.

    Raises BadInput for a name that was not predicted.
    """
    if name not in _KEPT:
        raise BadInput(f"Nothing was predicted under {name!r}; run the cell with predict({name!r}, "
                       f"…) first. Predicted so far: {', '.join(_KEPT) or 'nothing'}.")
    kept = _KEPT[name]
    kept.outcome = answered(kept.value, computed, kept.unit)
    print(f"{name}: {kept.outcome}{' ' + why if why else ''}")


def recall() -> None:
    """Print every prediction of this chapter with its outcome, in the order of their making."""
    for name, kept in _KEPT.items():
        print(f"{name}: {kept.outcome or 'not computed yet; run the cells above.'}")


def answered(prediction: Any, computed: float | str, unit: str = "") -> str:
    """One sentence: the prediction, the computed value, how far apart they are; `...` is a
    prediction not made yet.

    computed: a number of `unit`, shown with three significant digits, or a word that was to be
    chosen.
    """
    result = f"Computed: {_quantity(computed, unit)}."
    if prediction is ...:
        return (f"{result} You have not predicted it: put your answer in place of ... and run both "
                "cells again.")
    if isinstance(computed, str):
        same = str(prediction).strip().lower() == computed.lower()
        return f"{result} You said {prediction}: {'the same' if same else 'not the same'}."
    if not is_number(prediction):
        return f"{result} You said {prediction!r}, which is not {_number_of(unit)}."
    value = float(prediction)
    said = f"{result} You said {_quantity(value, unit)}"
    if value == 0 or computed == 0:
        return f"{said}."
    if (value > 0) != (computed > 0):
        return f"{said}: the other sign."
    ratio = value / computed
    if abs(ratio - 1) <= 0.1:
        return f"{said}: within 10 %."
    for other, factor in other_units(unit).items():
        if abs(ratio / factor - 1) <= 0.1:
            return f"{said}: within 10 % if you meant {other}; it was asked for in {unit}."
    return f"{said}: {f'{ratio:.2g} times as much' if ratio > 1 else f'{100 * ratio:.2g} % of it'}."


def _number_of(unit: str) -> str:
    return "a pure number" if unit == "1" else f"a number of {unit}"


def _quantity(value: Any, unit: str) -> str:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    words = f"{value:.3g}".replace("-", "−") if number else str(value)
    return f"{words} {unit}".removesuffix(" 1").rstrip()
