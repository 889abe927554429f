"""`check("2.1", answer)`: what is asked for, the unit, the value, and the mistakes that have a
name, in this order.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from hydrolab.course.answers import Exercise, other_units
from hydrolab.course.exercises import exercise

UNANSWERED = "not answered yet. Put your answer in place of ... and run this cell again."


@dataclass(frozen=True)
class Verdict:
    """What a check found: "unanswered", "type", "shape", "unit", "mistake", "wrong", "right" or
    "open", in words too.
    """

    found: str
    said: str


def check(number: str, answer: Any) -> None:
    """Print whether `answer` is right for the exercise of this number, and a hint if it is not.

    `...` stands for an answer not given yet. Raises BadInput for a number that no exercise has.
    """
    print(f"{number}: {judge(exercise(number), answer).said}")


def judge(asked: Exercise, answer: Any) -> Verdict:
    """Compare an answer with what is asked for, an exercise."""
    if answer is ...:
        return Verdict("unanswered", UNANSWERED)
    right = asked.right()
    if (fault := _type_fault(asked, right, answer)) is not None:
        return Verdict("type", fault)
    if (fault := _shape_fault(right, answer)) is not None:
        return Verdict("shape", fault)
    if asked.reply is not None:
        return Verdict("open", asked.reply(answer))
    if _same(asked, answer, right):
        return Verdict("right", "right.")
    back = "Read again: {}."
    if (unit := _mistaken_unit(asked, right, answer)) is not None:
        return Verdict("unit", f"the right value in {unit}; the answer is asked for in "
                       f"{asked.unit}. Convert it. {back.format(asked.see)}")
    for mistake in asked.mistakes:
        if _same(asked, answer, mistake.wrong(right)):
            hint = f"{mistake.hint} {back.format(mistake.see or asked.see)}"
            return Verdict("mistake", f"not yet. {hint}")
    return Verdict("wrong", f"not yet, and not a mistake known here. {back.format(asked.see)}")


def _is_number(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.shape == () and value.dtype.kind in "iuf"
    return isinstance(value, Real) and not isinstance(value, bool | np.bool_)


def _is_finite(value: Any) -> bool:
    return bool(abs(value) < 1e300)  # also False for nan, and for an integer that is no float


def _is_list(value: Any) -> bool:
    listed = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)
    return listed and not _is_number(value)


def _type_fault(asked: Exercise, right: Any, answer: Any) -> str | None:
    """What is wrong with the kind of an answer, or None."""
    if _is_number(right):
        wanted, good = f"a number{f' of {asked.unit}' if asked.unit else ''}", _is_number(answer)
        if good and not _is_finite(answer):
            return f"a finite number is asked for; this is {answer!s:.20}."
    elif isinstance(right, str):
        words = [_word(choice) for choice in asked.choices]
        wanted = f"one of {', '.join(map(repr, asked.choices))}" if words else "a text"
        good = isinstance(answer, str)
        if good and words and _word(answer) not in words:
            return f"{wanted} is asked for; this is {answer!r:.40}."
    elif isinstance(right, Mapping):
        wanted, good = "a dictionary", isinstance(answer, Mapping)
    elif _is_list(right):
        wanted, good = f"a list of {len(right)}", _is_list(answer)
    else:
        wanted, good = _kind(right), isinstance(answer, type(right))
    return None if good else f"{wanted} is asked for; this is {_kind(answer)}."


def _kind(value: Any) -> str:
    if isinstance(value, str):
        return "a text"
    if _is_number(value):
        return "a number"
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    name = type(value).__name__
    return f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"


def _shape_fault(right: Any, answer: Any) -> str | None:
    """What is wrong with the size or the keys of an answer, or None."""
    if isinstance(right, Mapping):
        missing = ", ".join(map(str, sorted(set(right) - set(answer))))
        extra = ", ".join(sorted(map(str, set(answer) - set(right))))
        if missing or extra:
            return (f"{len(right)} entries are asked for, {', '.join(map(str, right))}; missing: "
                    f"{missing or 'none'}; too many: {extra or 'none'}.")
        return _entries_fault(list(right.values()), [answer[key] for key in right])
    if _is_list(right):
        wanted, got = np.shape(np.asarray(right)), _shape(answer)
        if wanted != got:
            return (f"an answer of shape {wanted} is asked for; this has the shape "
                    f"{got or 'of no array'}.")
        return _entries_fault(list(np.ravel(np.asarray(right))), list(np.ravel(np.asarray(answer))))
    return None


def _shape(answer: Any) -> tuple[int, ...]:
    try:
        return np.shape(answer)
    except ValueError:  # rows of different lengths
        return ()


def _entries_fault(right: list[Any], answer: list[Any]) -> str | None:
    for position, (wanted, got) in enumerate(zip(right, answer, strict=True), 1):
        kind = "text" if isinstance(wanted, str) else "number"
        if not (isinstance(got, str) if kind == "text" else _is_number(got) and _is_finite(got)):
            yet = " yet" if got is ... else ""
            return f"each entry is a {kind}; entry {position} is not one{yet}."
    return None


def _word(text: str) -> str:
    return text.strip().lower().replace("−", "-")


def _values(asked: Exercise, answer: Any, keys: Mapping[Any, Any] | None) -> list[Any]:
    """What is compared of an answer, in a row: numbers and words."""
    if asked.measure is not None:
        answer = asked.measure(answer)
    if keys is not None:
        answer = [answer[key] for key in keys]
    return [_word(str(v)) if isinstance(v, str) else float(v)
            for v in np.ravel(np.asarray(answer)).tolist()]


def _same(asked: Exercise, answer: Any, other: Any, factor: float = 1.0) -> bool:
    """Tell whether an answer is another one, numbers within the tolerance and times a factor."""
    keys = other if isinstance(other, Mapping) else None
    mine, theirs = _values(asked, answer, keys), _values(asked, other, keys)

    def near(a: Any, b: Any) -> bool:
        if isinstance(b, str):
            return a == b
        return abs(a - factor * b) <= abs(factor) * (asked.atol + asked.rtol * abs(b))

    return len(mine) == len(theirs) and all(map(near, mine, theirs))


def _mistaken_unit(asked: Exercise, right: Any, answer: Any) -> str | None:
    """The unit in which the answer would be right, if it is another one of the same kind."""
    values = _values(asked, right, right if isinstance(right, Mapping) else None)
    if not any(isinstance(v, float) and v for v in values):
        return None
    return next((unit for unit, factor in other_units(asked.unit).items()
                 if _same(asked, answer, right, factor)), None)
