"""What an exercise asks for: the right answer as hydrolab computes it, its unit, and the mistakes
that have a name.

They stand one file a chapter in the book's folder `exercises` (`ch02.py` for chapter 2), each with
a dictionary `EXERCISES` by number.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import MappingProxyType
from typing import Any

from hydrolab.errors import BadInput

PACKAGE = Path(__file__).resolve().parents[1]

# Units of one kind, each with how many of it make the first.
UNITS: Sequence[Mapping[str, float]] = tuple(MappingProxyType(kind) for kind in (
    {"m": 1.0, "mm": 1e3, "µm": 1e6},
    {"rad/s": 1.0, "rpm": 30 / math.pi, "Hz": 1 / (2 * math.pi)},
    {"N": 1.0, "kN": 1e-3, "MN": 1e-6},
    {"N/m": 1.0, "kN/m": 1e-3, "MN/m": 1e-6},
    {"fraction": 1.0, "%": 100.0},
    {"times the gap": 1.0, "% of the gap": 100.0, "mm of the gap": 11.0},  # that of every chapter
    {"times the card's field": 1.0, "T": 0.5},  # B0 of every chapter
    {"kg": 1.0, "t": 1e-3},
    {"Pa": 1.0, "kPa": 1e-3, "MPa": 1e-6},
    {"W": 1.0, "kW": 1e-3},
    {"rad": 1.0, "°": 180 / math.pi},
    {"s": 1.0, "ms": 1e3, "µs": 1e6},
    {"m/s": 1.0, "mm/s": 1e3},
))


def other_units(unit: str) -> dict[str, float]:
    """The units one may mistake for `unit`, each with its factor on a value in `unit`."""
    kind = next((kind for kind in UNITS if unit in kind), {})
    return {other: factor / kind[unit] for other, factor in kind.items() if other != unit}


@dataclass(frozen=True)
class Mistake:
    """A wrong answer that many have given, and the hint for whoever gives it.

    wrong: from the right answer to the wrong one; it may also compute anew.
    hint: one or two sentences that do not give the answer away.
    see: the heading or equation of the chapter to read again; the exercise's own where it is empty.
    """

    wrong: Callable[[Any], Any]
    hint: str
    see: str = ""


@dataclass(frozen=True)
class Exercise:
    """One answer that an exercise asks for.

    right: computes the answer. Its type is the type that is asked for: a number, a word, a list of
        either, an array, a dictionary, or an object of the library.
    see: the heading or the equation, "Eq. (2.4)", of the chapter that a hint points back to.
    unit: of numbers, one of `UNITS` where a mix-up is to be named.
    rtol, atol: how far a number may be from the right one.
    within: the lowest and the highest number that are right, where a range is.
    mistakes: those of this exercise; those of every exercise with numbers are `COMMON`.
    choices: the words to choose from.
    measure: from an object to the numbers that are compared.
    reply: for an open question, from an answer to what hydrolab computes of it; no answer is wrong
        then, and `right` is one example.
    rubric: what a full answer to an open question holds, each with its points.
    """

    right: Callable[[], Any]
    see: str
    unit: str = ""
    rtol: float = 0.01
    atol: float = 0.0
    within: tuple[float, float] | None = None
    mistakes: tuple[Mistake, ...] = ()
    choices: tuple[str, ...] = ()
    measure: Callable[[Any], Any] | None = None
    reply: Callable[[Any], str] | None = None
    rubric: tuple[tuple[int, str], ...] = ()


TWO = ("A factor of two stands wrong: a diameter for a radius, peak-to-peak for 0-to-peak, or a "
       "half that was left out or put in twice.")
ROOT = "A factor of √2 stands wrong: is it an rms value or an amplitude?"
BOTH = "A factor of 2√2 stands wrong: rms is one thing, peak-to-peak another."
TURN = "A factor of 2π stands wrong: a revolution has 2π radians, 1 Hz is 2π rad/s."
RPM = "A factor of 30/π or 60/2π stands wrong: rpm where rad/s belong, or the reverse."
MINUTE = "A factor of 60 stands wrong: a minute has 60 seconds."
# Wrong answers that any number may have, each as what it makes of the right one, and its hint.
COMMON: Sequence[tuple[Callable[[float], float], str]] = (
    (lambda right: -right, "The size is right. Look at the sign: which way does it point, and what "
     "is subtracted from what?"),
    *(((lambda right, factor=factor: factor * right), hint) for size, hint in (
        (2.0, TWO), (math.sqrt(2), ROOT), (2 * math.sqrt(2), BOTH), (2 * math.pi, TURN),
        (30 / math.pi, RPM), (60.0, MINUTE),
        (4.0, "A factor of four stands wrong: is something squared that holds a factor of two?"),
        (math.pi, "A factor of π stands wrong: half a revolution for a radian, or a circle's area "
         "without it."),
        (3.0, "A factor of three stands wrong."), (1.5, "A factor of 3/2 stands wrong."),
        (9.81, "A factor of 9.81 stands wrong: a mass is no weight."),
        (100.0, "A factor of a hundred stands wrong: is it a fraction or per cent?"),
        (1e3, "A factor of a thousand stands wrong: look at the prefixes, milli and kilo."),
        (1e6, "A factor of a million stands wrong: look at the prefixes, micro and mega."),
        (900 / math.pi**2, "A factor of (30/π)² stands wrong: rpm squared where rad/s belong."),
    ) for factor in (size, 1 / size)),
    (lambda right: 1 / right if right else 0.0, "It is upside down: what is divided by what?"),
    (lambda right: right * right, "It is squared once too often."),
    (lambda right: math.sqrt(abs(right)), "A root was taken once too often."),
)


def files() -> dict[int, Path]:
    """The file of each chapter: in the clone, or in the copy that an installed wheel carries."""
    places = [PACKAGE.parent / "book" / "exercises", PACKAGE / "_book" / "exercises"]
    folder = next((place for place in places if place.is_dir()), places[0])
    return {int(path.stem[2:]): path for path in sorted(folder.glob("ch[0-9][0-9].py"))}


@cache
def _of(path: Path) -> dict[str, Exercise]:
    spec = spec_from_file_location(f"hydrolab_exercises_{path.stem}", path)
    module = module_from_spec(spec)  # type: ignore[arg-type]
    sys.modules[spec.name] = module  # type: ignore[union-attr]
    spec.loader.exec_module(module)  # type: ignore[union-attr]
    return module.EXERCISES


def chapters() -> dict[int, dict[str, Exercise]]:
    """The exercises of every chapter that has some, by chapter and number."""
    return {number: _of(path) for number, path in files().items()}


def exercise(number: str) -> Exercise:
    """The exercise of a number such as "2.1" or, where it asks for several answers, "2.1a".

    Raises BadInput where there is none.
    """
    chapter = str(number).split(".")[0]
    path = files().get(int(chapter)) if chapter.isascii() and chapter.isdigit() else None
    of_chapter = _of(path) if path else {}
    if number not in of_chapter:
        known = (f"chapter {chapter} has {', '.join(of_chapter)}" if of_chapter
                 else f"no chapter {chapter!r} has checks")
        raise BadInput(f"There is no exercise {number!r} to check; {known}.")
    return of_chapter[number]
