"""Chapter 7: a body on an arm, critical speeds of 2X and of an eccentric unit, Rayleigh's least, a
bearing for runaway.
"""

from __future__ import annotations

import math
from functools import cache

from hydrolab import HarmonicBalance, critical_speeds, load_machine, modes, rpm, vary
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.dynamics.modes import CriticalSpeeds
from hydrolab.machine.parts import Machine

BEARING = "bearings.generator guide bearing.stiffness"


@cache
def unit() -> Machine:
    """The course's machine."""
    return load_machine("kaplan-150rpm")


@cache
def critical(pull: bool = True, order: float = 1.0) -> CriticalSpeeds:
    """Critical speeds of the centred unit, with or without the pull."""
    return critical_speeds(unit().model(), pull=pull, order=order)


@cache
def off_centre(eccentricity: float) -> CriticalSpeeds:
    """Critical speeds under the pull of the orbit at an eccentricity."""
    orbit = HarmonicBalance(harmonics=4).solve(unit().model(), unit().speed, eccentricity)
    return critical_speeds(unit().model(), pull=orbit)


def in_rpm(found: CriticalSpeeds, direction: str = "forward") -> float:
    """The first of one direction."""
    return float(found.of(direction)[0]) / rpm(1)


def above_rated(speed: float) -> float:
    """How far a speed, rpm, lies above the rated one, % of it."""
    return 100 * (speed * rpm(1) / unit().speed - 1)


@cache
def least(first: int, last: int) -> float:
    """Least damping ratio, %, between two distinct modes of the unit that have 1 %."""
    still = modes(unit().model().with_field(0)).frequencies[::2]
    a, b = still[first - 1], still[last - 1]
    return float(2 * math.sqrt(a * b) / (a + b))


def runaway(factor: float) -> str:
    """Where the first forward critical speed is, with the pull, for a stiffer or softer guide
    bearing.
    """
    if not 0.3 <= factor <= 100:
        return f"noted, but {factor:g} is no factor from 0.3 to 100."
    stiff = vary(unit(), {BEARING: factor * unit().bearings[0].stiffness[0, 0]})
    found = in_rpm(critical_speeds(stiff.model(), pull=True))
    return (f"noted. The first forward critical speed is {found:.0f} rpm, "
            f"{'above' if found >= 450 else 'below'} the 450 that were asked for.")


ARM, CRITICAL = "A body at the end of an arm", "Critical speeds, by hand"
UNIT, DAMPING = "The unit, its pull and its runaway", "Damping, and what it is worth"

EXERCISES = {
    "7.1": Exercise(lambda: 90 + 60 * 0.7**2, see="Eq. (7.2)", rtol=0.002, mistakes=(
        Mistake(lambda right: 90.0, "The arm is missing: Steiner's theorem.", see=ARM),
        Mistake(lambda right: 60 * 0.7**2, "This is what the arm adds; the body has its own.",
                see=ARM),
        Mistake(lambda right: 90 - 60 * 0.7**2, "The arm adds inertia on either side.", see=ARM),
        Mistake(lambda right: 90 + 60 * 0.7, "The arm counts with its square.", see=ARM),
    )),
    "7.2": Exercise(lambda: in_rpm(critical(order=2)), see="Eq. (7.5)", unit="rpm", rtol=0.005,
                    mistakes=(
        Mistake(lambda right: in_rpm(critical()) / 2,
                "This is half of what 1X meets. At that speed the spin has lifted the mode; at "
                "half of it not yet.", see=CRITICAL),
        Mistake(lambda right: in_rpm(critical(order=2), "backward"), "This one is backward.",
                see=CRITICAL),
        Mistake(lambda right: in_rpm(critical(False, 2)), "This is without the pull.", see=UNIT),
        Mistake(lambda right: in_rpm(critical()), "Here 1X meets the mode.", see=CRITICAL),
    )),
    "7.3": Exercise(lambda: least(1, 3), see="Eq. (7.6)", unit="%", rtol=0.002, mistakes=(
        Mistake(lambda right: 1.0, "So much they get at both ends; between them it is less.",
                see=DAMPING),
        Mistake(lambda right: least(1, 2),
                "This is the least between the first and the second mode.", see=DAMPING),
        Mistake(lambda right: right / 2, "Both parts of (7.6) count.", see=DAMPING),
    )),
    "7.4": Exercise(lambda: above_rated(in_rpm(off_centre(0.08), "backward")), see=UNIT, unit="%",
                    mistakes=(
        Mistake(lambda right: above_rated(in_rpm(critical(False), "backward")),
                "This list has no pull in it."),
        Mistake(lambda right: above_rated(in_rpm(critical(), "backward")),
                "This is the pull of the centred rotor."),
        Mistake(lambda right: above_rated(in_rpm(off_centre(0.05), "backward")),
                "This is the pull of the orbit at 5 %."),
        Mistake(lambda right: above_rated(in_rpm(off_centre(0.08))),
                "An eccentric pull lets an unbalance drive backward modes, too."),
        Mistake(lambda right: right / (1 + right / 100),
                "This is a share of the critical speed; of the rated one is asked."),
    )),
    "7.5": Exercise(lambda: 1.7, see=UNIT, reply=runaway, rubric=(
        (1, "a factor that meets the 450 rpm"),
        (1, "a look at the backward critical speeds, which an eccentric pull excites"),
        (1, "what a stiffer bearing costs, such as the force that it carries"),
        (1, "a second factor, which shows that each step gains less"))),
}
