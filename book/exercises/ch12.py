"""Chapter 12: amplitudes, balance, a zone border, a false 2X, the faults of unknown machines."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import brentq

from hydrolab import HarmonicBalance, load_machine, rpm
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.course.records import FAULTS, TELLS, condition_of, grade
from hydrolab.dynamics.harmonics import fourier_rows
from hydrolab.machine.parts import Machine

PHASE = 2 * np.pi * np.arange(720) / 720
ZONES = (2.3381, 2.5599, 2.8609)  # c of Eq. (12.4)
GUIDE = 1  # node of the guide bearing


@cache
def unit() -> Machine:
    """The course's machine."""
    return load_machine("kaplan-150rpm")


def border(zone: int, speed: float = 150) -> float:
    """Border of a zone, m peak-to-peak, at a speed in rpm, Eq. (12.4)."""
    return 1e-6 * 10 ** (ZONES[zone] - 0.0704 * math.log10(speed))


def peak_to_peak(eccentricity: float) -> float:
    """Larger peak-to-peak of x and z at the guide bearing, m."""
    orbit = HarmonicBalance(4).solve(unit().model(), rpm(150), eccentricity)
    return float(np.ptp(orbit.node_coefficients(GUIDE) @ fourier_rows(4, PHASE), axis=1).max())


@cache
def reaches(size: float) -> float:
    """Static eccentricity, % of the gap, at which a peak-to-peak is reached."""
    return 100 * brentq(lambda e: peak_to_peak(e) - size, 0.001, 0.0892, xtol=1e-7)


def leaked(cosine: float, revolutions: float = 4.5) -> float:
    """What a 1X of 200 µm puts into 2X over some revolutions, for the integral of sin θ cos 2θ,
    µm.
    """
    return 2 / (2 * math.pi * revolutions) * 200 * cosine


def permitted(name: str, speed: float) -> float:
    """Unbalance that G 6.3 permits the body of this name at a speed, rad/s; kg m, Eq. (12.5)."""
    return 6.3e-3 / speed * unit().body(name).mass


def own_machine(said: dict[str, Any]) -> str:
    """What to say to whoever names the fault of a machine of their own choice."""
    number, fault = said["number"], str(said["fault"]).strip().lower()
    if number != int(number):
        return f"noted, but {number!r} is not a whole number."
    if fault not in FAULTS:
        return f"noted, but the faults are {', '.join(FAULTS)}."
    few = len(said["evidence"].split()) < 5
    verdict = grade(int(number), fault)
    return (f"noted. {verdict[0].upper()}{verdict[1:]}"
            + " Evidence needs numbers: write them down as well." * few)


def other(fault: str) -> Mistake:
    """A wrong name for the fault of machine 7, with what tells it from the true one."""
    return Mistake(lambda right: fault, TELLS[frozenset((fault, condition_of(7)[0]))],
                   see="Four faults")


EXERCISES = {
    "12.1": Exercise(lambda: 2 * math.sqrt(2) * 83, see="Eq. (12.2)", unit="µm", mistakes=(
        Mistake(lambda right: right / 2, "This is 0-to-peak."),
        Mistake(lambda right: right / math.sqrt(2), "This takes the rms value for the amplitude."),
        Mistake(lambda right: right / 4, "This divides by the root of two where it must multiply."),
        Mistake(lambda right: 83.0, "This is still the rms value."),
    )),
    "12.2": Exercise(lambda: permitted("turbine", rpm(150)), see="Eq. (12.5)", mistakes=(
        Mistake(lambda right: permitted("turbine", 150), "The speed must be in rad/s, not in rpm."),
        Mistake(lambda right: permitted("turbine", 2.5),
                "The speed must be in rad/s, not in revolutions per second."),
        Mistake(lambda right: 1000 * right, "The grade is in mm/s; the card is in metres."),
        Mistake(lambda right: permitted("generator", rpm(150)), "This is the generator's."),
        Mistake(lambda right: 6.3e-3 / rpm(150) ** 2 * unit().body("turbine").mass,
                "The grade is e Ω, not e Ω²."),
    )),
    "12.3": Exercise(lambda: reaches(border(1)), see="Limits, and how sure they are",
                     unit="% of the gap", rtol=0.002, mistakes=(
        Mistake(lambda right: reaches(border(1) / 2), "S is peak-to-peak, not 0-to-peak.",
                see="Eq. (12.4)"),
        Mistake(lambda right: reaches(border(1) / math.sqrt(2)), "S is peak-to-peak, not an rms "
                "value.", see="Eq. (12.4)"),
        Mistake(lambda right: reaches(border(0)), "This is where zone A ends."),
        Mistake(lambda right: reaches(border(1, rpm(150))),
                "The curve takes the speed in rpm, not in rad/s.", see="Eq. (12.4)"),
        Mistake(lambda right: reaches(border(1, 2.5)),
                "The curve takes the speed in rpm, not in revolutions per second.",
                see="Eq. (12.4)"),
    )),
    "12.4": Exercise(lambda: leaked(2 / 3), see="Eq. (12.1)", unit="µm", mistakes=(
        Mistake(lambda right: 0.0, "So it would be over whole revolutions; this record has half of "
                "one too many."),
        Mistake(lambda right: leaked(1 / 3), "One of the two sines in the product was lost."),
        Mistake(lambda right: leaked(2 / 3, 1), "The integral is divided by the whole record."),
        Mistake(lambda right: leaked(2.0), "This is what the half revolution leaves as a mean; "
                "2X has a cosine of 2θ beside it."),
        Mistake(lambda right: 200 / 4.5, "The share of one revolution is not what leaks."),
    )),
    "12.5": Exercise(lambda: condition_of(7)[0], see="Four faults", choices=FAULTS,
                     mistakes=tuple(other(fault) for fault in FAULTS
                                    if fault != condition_of(7)[0])),
    "12.6": Exercise(lambda: {"number": 2026, "fault": condition_of(2026)[0],
                              "evidence": "which numbers speak for it"},
                     see="Four faults", reply=own_machine, rubric=(
        (1, "the fault, with the number that speaks for it"),
        (2, "for each of the other three one number that rules it out"),
        (1, "what the record cannot tell"),
    )),
}
