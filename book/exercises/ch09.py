"""Chapter 9: steps of the full mesh, the order of central differences, settling, harmonics near the
fold.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from hydrolab import CentralDifference, HarmonicBalance, floquet, integrate, load_machine, reduce
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
    """The steady state at an eccentricity with so many harmonics."""
    return HarmonicBalance(harmonics).solve(model(), speed(), eccentricity)


@cache
def steps_at_the_limit() -> float:
    """Steps a revolution at the stability limit with all DOFs, Eq. (9.2)."""
    fastest = math.sqrt(np.linalg.eigvals(np.linalg.solve(model().M, model().K)).real.max())
    return math.pi * fastest / speed()


@cache
def error(steps: int, eccentricity: float = 0.05) -> float:
    """Largest distance of the last of 90 revolutions, in so many steps each, from the steady state
    at an eccentricity, m.
    """
    small = reduce(model(), 12)
    exact = HarmonicBalance(16).solve(small, speed(), eccentricity)
    run = integrate(small, CentralDifference(steps), speed=speed(),
                    static_eccentricity=eccentricity, revolutions=90,
                    start=exact)
    times, path = run.last(1)
    return float(np.hypot(*(path - exact.positions(speed() * times))).max())


@cache
def multiplier() -> float:
    """Largest Floquet multiplier at 8.8 %."""
    return floquet(orbit(0.088, 4)).largest


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

EXERCISES = {
    "9.1": Exercise(lambda: 1000 * steps_at_the_limit(), see="Eq. (9.2)", mistakes=(
        Mistake(lambda right: right / 1000, "This is for one revolution.", see=STEP),
        Mistake(lambda right: 2 * right,
                "The limit is 2, not 1: a step of 1/ω is half of what is allowed.", see=STEP),
        Mistake(lambda right: right / math.pi,
                "This is the step's limit, but a revolution is 2π in Ωt.", see=STEP),
        Mistake(lambda right: right / (2 * math.pi),
                "Here a frequency in Hz stands where rad/s belong.", see=STEP),
        Mistake(lambda right: right * speed() / 150,
                "This divides by 150, the speed in rpm; the formula takes rad/s.", see=STEP),
    )),
    "9.2": Exercise(lambda: math.log2(error(512) / error(1024)), see="Eq. (9.4)", rtol=0.02,
                    mistakes=(
        Mistake(lambda right: 2**right,
                "This is the ratio of the errors; the order is the power of the step.",
                see="The step"),
        Mistake(lambda right: right * math.log(2),
                "The logarithm must have the base by which the step changed.", see="The step"),
        Mistake(lambda right: right * math.log10(2),
                "The logarithm must have the base by which the step changed, not 10.",
                see="The step"),
        Mistake(lambda right: -right, "The error falls with the step; turn the ratio over.",
                see="The step"),
    )),
    "9.3": Exercise(lambda: math.log(1e-3) / math.log(multiplier()), see="Eq. (9.3)", mistakes=(
        Mistake(lambda right: -3 / math.log(multiplier()),
                "Two logarithms of different bases were divided.", see=START),
        Mistake(lambda right: right * 2 * math.pi / speed(), "This is in seconds.", see=START),
        Mistake(lambda right: right / 2,
                "The multiplier was squared: it is an amplitude, not an energy.", see=START),
        Mistake(lambda right: -right, "Both logarithms are negative.", see=START),
        Mistake(lambda right: 1e-3 / multiplier(),
                "The multiplier acts once in every revolution: it is a power.", see=START),
    )),
    "9.4": Exercise(lambda: 4, see="How many harmonics", reply=kept),
}
