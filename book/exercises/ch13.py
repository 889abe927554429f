"""Chapter 13: a term of a start, the torque of a whirl, the latest trip, a wrong phase, a
protection.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from hydrolab import BadInput, Schedule, load_machine, rpm, run, runaway
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.machine.model import Model

ALPHA = rpm(600) / 20  # rad/s², of the passage by hand
LEFT = 8.5e-3  # m, the gap that shall stay


@cache
def plain() -> Model:
    """The point mass without field, with 30 % of its unbalance."""
    return load_machine("jeffcott").model().with_field(0).with_unbalance(0.3)


@cache
def torque(phase: float = 1.0) -> float:
    """The largest torque that the whirl takes in the passage by hand, N m; phase: exponent of the
    turning by which the acceleration is seen.
    """
    found = run(plain(), Schedule([0, 20], [0, rpm(600)]))
    m, (x, z), (vx, vz) = plain(), found.positions, found.path().derivative()(found.times)
    turned, heavy = np.exp(1j * found.angles), m.unbalance_cos[1]
    force = heavy * (found.speeds**2 - 1j * ALPHA) * turned
    w = (force - m.C[0, 0] * (vz + 1j * vx) - m.K[0, 0] * (z + 1j * x)) / m.M[0, 0]
    return float(np.abs(heavy * (w / turned**phase).imag).max())


@cache
def gap_left(trip: float, eccentricity: float = 0.05) -> float:
    """The smallest gap of a runaway whose field is switched off so many seconds after the loss, m.
    """
    found = run(load_machine("kaplan-150rpm").model(), runaway(rpm(150), trip=trip, seconds=25),
                static_eccentricity=eccentricity, steps_per_revolution=64, check=False)
    return found.smallest_gap.value


@cache
def latest() -> float:
    """The latest trip that leaves the gap, s, to 5 ms."""
    low, high = 5.0, 8.0
    while high - low > 0.005:
        middle = (low + high) / 2
        low, high = (middle, high) if gap_left(middle) > LEFT else (low, middle)
    return low


@cache
def peak(share: float) -> float:
    """Speed at which the passage by hand shows most, rpm, where the phase is that share of α t²."""
    m = plain()

    def rate(t: float, y: np.ndarray) -> list:
        size = m.unbalance_cos[1] * ((ALPHA * t)**2 - 1j * ALPHA)
        force = size * np.exp(1j * share * ALPHA * t**2)
        return [y[1], (force - m.C[0, 0] * y[1] - m.K[0, 0] * y[0]) / m.M[0, 0]]

    found = solve_ivp(rate, (0, 20), [0j, 0j], method="DOP853", rtol=1e-9, atol=1e-12,
                      t_eval=np.linspace(0, 20, 20001))
    return float(ALPHA * found.t[np.abs(found.y[0]).argmax()] / rpm(1))


def protected(said: dict[str, Any]) -> str:
    """What becomes of the unit with a protection of a student's own."""
    trip, eccentricity = said["trip"], said["eccentricity"]
    if not 0 <= eccentricity <= 0.08 or not 0 < trip < 15:
        return (f"noted, but the eccentricity is a fraction of the gap from 0 to 0.08 and the trip "
                f"lies between 0 and 15 s; these are {eccentricity:g} and {trip:g}.")
    try:
        gap = gap_left(float(trip), float(eccentricity))
        late = gap_left(float(trip) + 1, float(eccentricity))
    except BadInput as error:
        return f"noted, but {error}"
    few = len(said["why"].split()) < 5
    return (f"noted. The smallest gap is {1e3 * gap:.2f} mm, and {1e3 * late:.2f} mm if the relay "
            "is a second late." + " Reasons need numbers: write them down as well." * few)


EXERCISES = {
    "13.1": Exercise(lambda: 100 / (20 * math.pi), see="Eq. (13.4)", unit="%", mistakes=(
        Mistake(lambda right: 10.0, "The angle must be in radians, not in revolutions."),
        Mistake(lambda right: 2 * right, "The factor 2 of the squared speed was lost."),
        Mistake(lambda right: 100 / (4 * math.pi), "This is after one revolution."),
    )),
    "13.2": Exercise(torque, see="Eq. (13.3)", unit="N m", mistakes=(
        Mistake(lambda right: torque(0.0), "The acceleration must be seen from the rotor: divide "
                "by the turned direction."),
        Mistake(lambda right: right * plain().M[0, 0] / plain().unbalance_cos[1],
                "This is a force; the torque has the arm e."),
    )),
    "13.3": Exercise(latest, see="A runaway", unit="s", mistakes=(
        Mistake(lambda right: right + 5, "Seconds after the loss are asked for; the load is lost "
                "at 5 s."),
        Mistake(lambda right: right + 2, "This is when the field has died away; it is switched off "
                "before."),
    )),
    "13.4": Exercise(lambda: peak(1.0), see="The angle is an unknown", unit="rpm", mistakes=(
        Mistake(lambda right: peak(0.5), "This is the right program's. His phase is another "
                "function of time."),
        Mistake(lambda right: math.sqrt(plain().K[0, 0] / plain().M[0, 0]) / rpm(1),
                "This is the critical speed. His unbalance does not turn at the frequency of his "
                "speed."),
        Mistake(lambda right: 2 * right, "This is the frequency at which his unbalance turns then; "
                "the speed is asked for."),
    )),
    "13.5": Exercise(lambda: {"trip": 1.0, "eccentricity": 0.05, "why": "which run says so"},
                     see="A runaway", reply=protected, rubric=(
        (1, "a run with its smallest gap at the trip chosen"),
        (1, "the same with the relay late"),
        (1, "what the eccentricity changes"),
        (1, "what the schedule assumes"),
    )),
}
