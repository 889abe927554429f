"""Chapter 9: a step beside its limit, the step's own error, settling, also near the fold, harmonics
there.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from hydrolab import HarmonicBalance, floquet, load_machine
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.machine.model import Model

PHASE = 2 * np.pi * np.arange(360) / 360


@cache
def model() -> Model:
    """The course's machine."""
    return load_machine("kaplan-150rpm").model()


@cache
def speed() -> float:
    """Its speed, rad/s."""
    return load_machine("kaplan-150rpm").speed


@cache
def orbit(eccentricity: float, harmonics: int) -> PeriodicOrbit:
    """The steady state at an eccentricity with so many harmonics, from one at 8.9 % where it is
    beyond.
    """
    start = orbit(0.089, harmonics) if eccentricity > 0.0891 else None
    return HarmonicBalance(harmonics).solve(model(), speed(), eccentricity, start=start)


@cache
def multiplier(eccentricity: float = 0.088) -> float:
    """Largest Floquet multiplier at an eccentricity."""
    return floquet(orbit(eccentricity, 4)).largest


def settled(share: float, eccentricity: float = 0.088) -> float:
    """Revolutions until a share of a disturbance is left, Eq. (9.3)."""
    return math.log(share) / math.log(multiplier(eccentricity))


def kept(harmonics: float) -> str:
    """What a number of harmonics leaves at 8.9 %."""
    if harmonics != int(harmonics) or not 2 <= harmonics <= 32:
        return f"noted, but {harmonics:g} is not a whole number from 2 to 32."
    few, many = (orbit(0.089, m).positions(PHASE) for m in (int(harmonics), 40))
    off = np.hypot(*(few - many)).max()
    return (f"noted. At 8.9 % {harmonics:.0f} harmonics are off by {1e6 * off:.2g} µm, with "
            f"{2 * (2 * int(harmonics) + 1)} "
            f"unknowns; one micrometre is what a good displacement probe resolves.")


STEP = "How large may the step be"
START = "What is left of the start"

ONE = 2 * math.pi / 512  # Ω times the step, of 512 in a revolution

EXERCISES = {
    "9.1": Exercise(lambda: 1422.1 * ONE / speed(), see="Eq. (9.2)", rtol=0.003, mistakes=(
        Mistake(lambda right: 1422.1 * ONE, "This leaves out the speed: the step is 2π/(512 Ω).",
                see=STEP),
        Mistake(lambda right: 1422.1 / speed() / 512, "A revolution is 2π in Ωt.", see=STEP),
        Mistake(lambda right: 1422.1 * ONE / 150, "The speed must be in rad/s, not in rpm.",
                see=STEP),
        Mistake(lambda right: 285 / 512, "This is its share of the limit; the product itself is "
                "asked for.", see=STEP),
        Mistake(lambda right: 25891.4 * ONE / speed(), "This is the full mesh.", see=STEP),
    )),
    "9.2": Exercise(lambda: 512 * math.sqrt(62.10), see="The step", rtol=0.02, mistakes=(
        Mistake(lambda right: 2048 * math.sqrt(5.84), "A part of the 5.84 nm belongs to harmonic "
                "balance with four harmonics and does not fall with the step."),
        Mistake(lambda right: 512 * 62.10, "The error goes with the square of the step.",
                see="Eq. (9.4)"),
        Mistake(lambda right: 2048 * 4.17, "The error goes with the square of the step.",
                see="Eq. (9.4)"),
        Mistake(lambda right: 512 * 62.10**0.25, "The method is of second order, not of fourth.",
                see="Eq. (9.4)"),
    )),
    "9.3": Exercise(lambda: settled(1e-9 / 94e-6), see="Eq. (9.3)", mistakes=(
        Mistake(lambda right: math.log10(1e-9 / 94e-6) / math.log(multiplier()),
                "Two logarithms of different bases were divided.", see=START),
        Mistake(lambda right: right * 2 * math.pi / speed(), "This is in seconds.", see=START),
        Mistake(lambda right: right / 2,
                "The multiplier was squared: it is an amplitude, not an energy.", see=START),
        Mistake(lambda right: settled(1e-3), "This is for a thousandth.", see=START),
        Mistake(lambda right: settled(1e-9 / 1e-4 * 1e-3), "94 µm over 1 nm is a factor of "
                "94,000.", see=START),
        Mistake(lambda right: right + 401, "Count from the knock, not from the start of the run.",
                see=START),
        Mistake(lambda right: 43.0, "This is what the chapter needed for a thousandth.", see=START),
        Mistake(lambda right: 50.0, "After 50 revolutions a third of a micrometre is left.",
                see=START),
    )),
    "9.4": Exercise(lambda: settled(1e-3, 0.089249), see="Eq. (9.3)", rtol=0.03, mistakes=(
        Mistake(lambda right: settled(1e-3), "This is at 8.8 %, and also at 8.92 %; ask nearer to "
                "the fold.", see=START),
        Mistake(lambda right: -3 / math.log(multiplier(0.089249)),
                "Two logarithms of different bases were divided.", see=START),
        Mistake(lambda right: settled(1e-3, 0.08924), "This is at 8.924 %.", see=START),
        Mistake(lambda right: settled(1e-3, 0.089245), "This is at 8.9245 %.", see=START),
        Mistake(lambda right: right * 2 * math.pi / speed(), "This is in seconds.", see=START),
    )),
    "9.5": Exercise(lambda: 4, see="How many harmonics", reply=kept, rubric=(
        (1, "the change from one number of harmonics to the next, at 8.9 % and not at 8.8 %"),
        (1, "what it costs in unknowns"),
        (1, "that the fold's place does not depend on it from some number on"),
    )),
}
