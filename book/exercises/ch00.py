"""Chapter 0: speeds, a first orbit, the card, and what moves the fold."""

from __future__ import annotations

import math
from collections import Counter
from functools import cache

from hydrolab import HarmonicBalance, follow, load_machine, rpm, vary
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.machine.parts import Machine

# of the generator: numbers that can change by 1 % on their own
CALIBRATED = ("mass", "Id", "Ip", "unbalance")


@cache
def unit() -> Machine:
    """The course's machine."""
    return load_machine("kaplan-150rpm")


@cache
def orbit(eccentricity: float) -> PeriodicOrbit:
    """Its steady state at 150 rpm."""
    return HarmonicBalance(harmonics=4).solve(unit().model(), speed=rpm(150),
                                              static_eccentricity=eccentricity)


def mean_and_1x(at: PeriodicOrbit) -> list[float]:
    """Mean in x, mm, and 1X in x, µm."""
    return [1e3 * at.mean[0], 1e6 * at.amplitudes[0, 0]]


def sources() -> dict[str, int]:
    """How many of the card's numbers come from each source."""
    return dict(Counter(entry.source for entry in unit().provenance.values()))


@cache
def first_fold(key: str = "") -> float:
    """The first fold, % of the gap, with the card's number at `key` raised by 1 %."""
    machine = unit()
    if key:
        machine = vary(machine, {f"bodies.generator.{key}": 1.01
                                 * getattr(machine.body("generator"), key)})
    return 100 * follow(machine.model(), to=0.12, speed=rpm(150)).folds[0].value


def sensitivity(key: str) -> str:
    """What 1 % more of a number of the generator does to the first fold."""
    key = key.strip().removeprefix("bodies.generator.")
    moves = {name: first_fold(name) - first_fold() for name in CALIBRATED}
    most = max(moves, key=lambda name: abs(moves[name]))
    others = ", ".join(f"{name} {move:+.3f}" for name, move in moves.items())
    yours = "is the strongest of these" if key == most else (
        f"is weaker than {most}" if key in moves else "is not one of these; try it with `vary`")
    return ("noted. 1 % more of a number of the generator moves the first fold, in % of the gap, "
            f"by: {others}. "
            f"{key or 'Yours'} {yours}.")


EXERCISES = {
    "0.1a": Exercise(lambda: rpm(90), see="The axes", unit="rad/s", mistakes=(
        Mistake(lambda right: 2 * math.pi * 90, "One minute has 60 seconds."),
        Mistake(lambda right: right / 2, "One revolution is 2π, not π."),
    )),
    "0.1b": Exercise(lambda: rpm(90) / (2 * math.pi), see="The axes", mistakes=(
        Mistake(lambda right: 90.0, "This is per minute; per second is asked for."),
        Mistake(lambda right: rpm(90),
                "This is in radians per second; a revolution has 2π of them."),
    )),
    "0.2": Exercise(lambda: orbit(0.03), see="One steady state", measure=mean_and_1x, mistakes=(
        Mistake(lambda right: orbit(0.0),
                "This orbit is centred: give the eccentricity to `solve`."),
        Mistake(lambda right: orbit(-0.03), "The stator moved the other way, towards −x."),
        Mistake(lambda right: orbit(0.003),
                "The eccentricity is a fraction of the gap: 3 % is 0.03."),
        Mistake(lambda right: orbit(0.088), "This is the orbit at 8.8 %."),
    )),
    "0.3": Exercise(sources, see="Where each number comes from", rtol=0.0),
    "0.4": Exercise(lambda: "mass", see="Follow the steady states", reply=sensitivity),
}
