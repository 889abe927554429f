"""Chapter 10: the gap that is left, where vibration has doubled, where the fold goes, where a
machine falls back, and what warns of it.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from hydrolab import (
    Arclength,
    HarmonicBalance,
    branch_off,
    branch_stability,
    follow,
    load_machine,
)
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.dynamics.branches import Branch
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.machine.model import Model

READINGS = ("1X", "2X", "ratio of axes", "mean")


@cache
def model() -> Model:
    """The calibrated unit."""
    return load_machine("kaplan-150rpm").model()


@cache
def orbit(eccentricity: float) -> PeriodicOrbit:
    """Its steady state at 150 rpm."""
    return HarmonicBalance(harmonics=4).solve(model(), load_machine("kaplan-150rpm").speed,
                                              eccentricity)


@cache
def branch(unbalance: float = 1.0) -> Branch:
    """Its steady states over the eccentricity, with a share of its unbalance."""
    return follow(model().with_unbalance(unbalance), "static_eccentricity", to=0.12,
                  speed=load_machine("kaplan-150rpm").speed, method=Arclength(max_folds=3))


@cache
def way_back(unbalance: float = 0.8) -> tuple[float, float]:
    """The flip at which the large orbit is lost on the way down, and the fold of the motion of two
    revolutions that begins there, %, with a share of the unbalance.
    """
    flips = branch_stability(branch(unbalance)).flips
    lost = min((flip for flip in flips if flip.value > 0.079), key=lambda flip: flip.value)
    return 100 * lost.value, 100 * branch_off(branch(unbalance), lost)[0].folds[0].value


def on_first_leg() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Eccentricity, %, and the readings one may watch, each growing, along the first leg."""
    leg = branch().first_leg
    size = branch().amplitudes[leg]
    watched = (size[:, 0, 0], size[:, 0, 1], size[:, 0, 0] / size[:, 1, 0],
               -branch().coefficients[leg, 0, 0])
    return 100 * branch().static_eccentricity[leg], dict(zip(READINGS, watched, strict=True))


def grown_at(reading: str, factor: float, since: float = 0.0) -> float:
    """Eccentricity, %, at which a reading is `factor` times what it was at `since` %."""
    late, watched = on_first_leg()
    return float(np.interp(factor * np.interp(since, late, watched[reading]), watched[reading],
                           late))


def warnings() -> dict[str, float]:
    """Eccentricity, %, at which each reading has grown by a quarter since 8 %."""
    return {reading: grown_at(reading, 1.25, since=8.0) for reading in READINGS}


def said_of(reading: str) -> str:
    """How early each reading warns, and the one that was chosen."""
    late = ", ".join(f"{name} {value:.2f} %" for name, value in warnings().items())
    first = min(warnings(), key=warnings().__getitem__)
    chosen = "is the first" if reading.strip().lower() == first.lower() else f"comes after {first}"
    return (f"noted. From 8 % on, each has grown by a quarter at: {late}; the fold is at "
            f"{100 * branch().folds[0].value:.2f} %. {reading} {chosen}. Ask also what else could "
            "have moved it.")


EXERCISES = {
    "10.1": Exercise(lambda: 1e3 * orbit(0.06).smallest_gap, see="Figures 5, 6 and 7", unit="mm",
                     rtol=0.002, mistakes=(
        Mistake(lambda right: 1e3 * 0.94 * model().law.gap,
                "This is the gap of a rotor that stays at the bearing axis: the pull displaces "
                "it, and it whirls."),
        Mistake(lambda right: 1e3 * (0.94 * model().law.gap - abs(orbit(0.06).mean[0])),
                "This is the gap of the mean position; the whirl takes a part of it."),
        Mistake(lambda right: 1e3 * orbit(0.0).smallest_gap,
                "This is the gap of the centred machine."),
    )),
    "10.2": Exercise(lambda: grown_at("1X", 2.0), see="Figures 5, 6 and 7",
                     unit="% of the gap", rtol=0.005, mistakes=(
        Mistake(lambda right: grown_at("1X", 3.0),
                "Grown by twice its value is three times as much; twice is asked for."),
        Mistake(lambda right: grown_at("1X", 1.5), "Here it has grown by a half."),
        Mistake(lambda right: 100 * branch().folds[0].value, "This is the fold."),
    )),
    "10.3": Exercise(lambda: 100 * branch(0.7).folds[0].value, see="Past the fold",
                     unit="% of the gap", rtol=0.003, mistakes=(
        Mistake(lambda right: 100 * branch().folds[0].value,
                "This is the fold with all of the unbalance."),
        Mistake(lambda right: 100 * branch(0.0).folds[0].value,
                "This is the static pull-in, without any unbalance.",
                see="Limit check: back to chapter 2"),
        Mistake(lambda right: 70 * branch().folds[0].value,
                "The fold does not go in proportion to the unbalance."),
        Mistake(lambda right: 100 * branch(0.3).folds[0].value,
                "This is the fold with 70 % less unbalance."),
    )),
    "10.4": Exercise(lambda: way_back()[1], see="The motion of two revolutions",
                     unit="% of the gap", rtol=0.004, mistakes=(
        Mistake(lambda right: way_back()[0],
                "Here the large orbit loses its stability. What takes over, and how far does that "
                "reach? Follow it."),
        Mistake(lambda right: 100 * branch(0.8).folds[0].value,
                "This is the fold of the small orbit, where one goes up."),
        Mistake(lambda right: way_back(1.0)[1], "This is with all of the unbalance."),
        Mistake(lambda right: 0.8 * way_back(1.0)[1],
                "Nothing here goes in proportion to the unbalance."),
    )),
    "10.5": Exercise(lambda: min(warnings(), key=warnings().__getitem__), see="Figures 5, 6 and 7",
                     choices=READINGS, reply=said_of, rubric=(
        (1, "how much each reading has grown, and where"),
        (1, "why the ratio of axes moves first: one axis grows while the other shrinks"),
        (1, "what else moves it on a real unit"),
        (1, "a word on noise: 2X is small"))),
}
