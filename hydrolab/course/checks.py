"""`check("2.1", answer)`: what is asked for, the unit, the value, and the mistakes that have a
name, in this order.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from hydrolab.course.answers import COMMON, Exercise, exercise, other_units

UNANSWERED = "not answered yet. Put your answer in place of ... and run this cell again."


@dataclass(frozen=True)
class Verdict:
    """Found: unanswered, type, shape, unit, mistake, wrong, right or open; said: in words."""

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
        return Verdict("open", " ".join([asked.reply(answer), *_rubric(asked)]))
    if _accepted(asked, answer, right):
        return Verdict("right", "right.")
    return _diagnosis(asked, right, answer)


def _rubric(asked: Exercise) -> list[str]:
    """What to look for in one's own words, the points in brackets."""
    parts = "; ".join(f"{words} ({points})" for points, words in asked.rubric)
    return [f"A full answer has: {parts}."] if parts else []


def _accepted(asked: Exercise, answer: Any, right: Any) -> bool:
    if asked.within is not None:
        low, high = asked.within
        return bool(low <= answer <= high)
    return _same(asked, answer, right)


def _diagnosis(asked: Exercise, right: Any, answer: Any) -> Verdict:
    """What to say to a wrong answer: the hints of at most two mistakes that lead there."""
    found, hints = "", []
    seen: list[list[Any]] = []  # what the mistakes so far have led to: the first name stays
    for kind, hint, see, wrong in _mistakes(asked, right):
        named = any(_near(asked, wrong, other, 1e-6) for other in seen)
        if not named and _near(asked, _values(asked, answer, right), wrong, asked.rtol or 1e-9):
            found, hints = found or kind, [*hints, (hint, see)]
            seen.append(wrong)
    if not hints:
        return Verdict("wrong", f"not yet, and not a mistake known here. Read again: {asked.see}.")
    (hint, see), *more = hints[:2]
    if found == "unit" and not more:
        return Verdict("unit", f"{hint} Read again: {see}.")
    other = f" Or, which gives the same: {more[0][0]}" if more else ""
    return Verdict("mistake", f"not yet. {hint}{other} Read again: {see}.")


def _mistakes(asked: Exercise, right: Any) -> Iterator[tuple[str, str, str, list[Any]]]:
    """Every mistake with a name, the exercise's own first: kind, hint, place to read, result."""
    theirs = _values(asked, right, right)
    for mistake in asked.mistakes:
        yield ("mistake", mistake.hint, mistake.see or asked.see,
               _values(asked, mistake.wrong(right), right))
    if not theirs or any(isinstance(value, str) for value in theirs):
        return
    changes = [("unit", f"the right value in {unit}; the answer is asked for in {asked.unit}. "
                "Convert it.", factor.__mul__) for unit, factor in other_units(asked.unit).items()]
    for kind, hint, change in [*changes, *(("mistake", *reversed(pair)) for pair in COMMON)]:
        wrong = [change(value) for value in theirs]
        if not _near(asked, wrong, theirs, asked.rtol or 1e-9):
            yield kind, hint, asked.see, wrong
    if len(theirs) > 1 and not _near(asked, theirs[::-1], theirs, asked.rtol or 1e-9):
        yield ("mistake", "The entries stand in the wrong order: is x taken for z, the first for "
               "the last?", asked.see, theirs[::-1])


def is_number(value: Any) -> bool:
    """Tell whether a value is a real number, also one of NumPy's; True is none."""
    if isinstance(value, np.ndarray):
        return value.shape == () and value.dtype.kind in "iuf"
    return isinstance(value, Real) and not isinstance(value, bool | np.bool_)


def _is_finite(value: Any) -> bool:
    return bool(abs(value) < 1e300)  # also False for nan, and for an integer that is no float


def _is_list(value: Any) -> bool:
    listed = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)
    return listed and not is_number(value)


def _type_fault(asked: Exercise, right: Any, answer: Any) -> str | None:
    """What is wrong with the kind of an answer, or None."""
    if is_number(right):
        wanted, good = f"a number{f' of {asked.unit}' if asked.unit else ''}", is_number(answer)
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
    if is_number(value):
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
        if not (isinstance(got, str) if kind == "text" else is_number(got) and _is_finite(got)):
            yet = " yet" if got is ... else ""
            return f"each entry is a {kind}; entry {position} is not one{yet}."
    return None


def _word(text: str) -> str:
    return text.strip().lower().replace("−", "-")


def _values(asked: Exercise, answer: Any, like: Any = None) -> list[Any]:
    """What is compared of an answer: numbers and words, a dictionary's in the order of `like`."""
    if asked.measure is not None:
        answer = asked.measure(answer)
    if isinstance(like, Mapping):
        answer = [answer[key] for key in like]
    return [_word(str(v)) if isinstance(v, str) else float(v)
            for v in np.ravel(np.asarray(answer)).tolist()]


def _near(asked: Exercise, mine: list[Any], theirs: list[Any], rtol: float) -> bool:
    """Tell whether two rows of values agree, numbers within the tolerance."""
    return len(mine) == len(theirs) and all(
        a == b if isinstance(b, str) or isinstance(a, str)
        else abs(a - b) <= asked.atol + rtol * abs(b) for a, b in zip(mine, theirs, strict=True))


def _same(asked: Exercise, answer: Any, other: Any) -> bool:
    """Tell whether an answer is another one, numbers within the exercise's tolerance."""
    return _near(asked, _values(asked, answer, other), _values(asked, other, other), asked.rtol)
