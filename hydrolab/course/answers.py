"""What an exercise asks for: the right answer as hydrolab computes it, its unit, and the mistakes
that have a name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

# Units of one kind, each with how many of it make the first.
UNITS: Sequence[Mapping[str, float]] = tuple(MappingProxyType(kind) for kind in (
    {"m": 1.0, "mm": 1e3, "µm": 1e6},
    {"rad/s": 1.0, "rpm": 30 / math.pi, "Hz": 1 / (2 * math.pi)},
    {"N": 1.0, "kN": 1e-3, "MN": 1e-6},
    {"N/m": 1.0, "kN/m": 1e-3, "MN/m": 1e-6},
    {"fraction": 1.0, "%": 100.0},
    {"kg": 1.0, "t": 1e-3},
    {"Pa": 1.0, "kPa": 1e-3, "MPa": 1e-6},
    {"W": 1.0, "kW": 1e-3},
    {"rad": 1.0, "°": 180 / math.pi},
    {"s": 1.0, "ms": 1e3, "µs": 1e6},
    {"m/s": 1.0, "mm/s": 1e3},
))


def other_units(unit: str) -> dict[str, float]:
    """The units one may mistake for `unit`, each with the factor from a value in `unit` to the same
    value in it.
    """
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
    either, an
        array, a dictionary, or an object of the library.
    see: the heading or the equation, "Eq. (2.4)", of the chapter that a hint points back to.
    unit: of numbers, one of `UNITS` where a mix-up is to be named.
    rtol, atol: how far a number may be from the right one.
    mistakes: in the order in which they are looked for.
    choices: the words to choose from.
    measure: from an object to the numbers that are compared.
    reply: for an open question, from an answer to what hydrolab computes of it; no answer is wrong
    then, and
        `right` is one example.
    """

    right: Callable[[], Any]
    see: str
    unit: str = ""
    rtol: float = 0.01
    atol: float = 0.0
    mistakes: tuple[Mistake, ...] = ()
    choices: tuple[str, ...] = ()
    measure: Callable[[Any], Any] | None = None
    reply: Callable[[Any], str] | None = None
