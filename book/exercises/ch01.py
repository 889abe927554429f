"""Chapter 1: natural frequency, the side on which the rotor lies, the sense of whirl, damping at
the resonance.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from hydrolab import HarmonicBalance, ellipse, load_machine, modes, rpm, vary
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.machine.parts import Machine

LEFT = 5e-3  # m of the gap that exercise 1.4 wants left


@cache
def machine() -> Machine:
    """The point mass on springs; this chapter has no field."""
    return load_machine("jeffcott")


def natural_rpm(mass_factor: float) -> float:
    """Natural frequency with another mass, rpm."""
    lighter = vary(machine(), {"bodies.generator.mass": mass_factor * machine().bodies[0].mass})
    return abs(modes(lighter.model().with_field(0)).eigenvalues[0]) / rpm(1)


@cache
def orbit(speed_rpm: float, z_stiffness: float = 2.7e8) -> PeriodicOrbit:
    """Steady state without field at a speed (speed_rpm), z_stiffness: in z, N/m."""
    springs = vary(machine(), {"bearings.springs.stiffness": [2.7e8, z_stiffness]})
    return HarmonicBalance(harmonics=1).solve(springs.model().with_field(0), speed=rpm(speed_rpm))


def offset() -> float:
    """Distance of the centre of mass from the disc's axis, m."""
    return machine().bodies[0].unbalance / machine().bodies[0].mass


def radii_at_600() -> tuple[float, float]:
    """Distances of the rotor centre and of the centre of mass from the bearing axis, µm, at Ωt = 0.
    """
    at = orbit(600).positions(np.array([0.0]))[:, 0]
    # the heavy spot points along z
    return 1e6 * math.hypot(*at), 1e6 * math.hypot(at[0], at[1] + offset())


def senses() -> list[str]:
    """Sense of whirl on unequal springs at 330, 385 and 450 rpm."""
    return ["forward" if ellipse(orbit(n, 2.2e8).coefficients).forward else "backward"
            for n in (330, 385, 450)]


def needed_damping() -> float:
    """Damping ratio at which the largest orbit leaves 5 mm of the gap."""
    return offset() / (2 * (machine().air_gap.gap - LEFT))


EXERCISES = {
    "1.1": Exercise(lambda: natural_rpm(0.9), see="One machine, two equations", unit="rpm",
                    rtol=0.003, mistakes=(
        Mistake(lambda right: natural_rpm(1.0) / 0.9,
                "The frequency goes with the root of the mass."),
        Mistake(lambda right: natural_rpm(1.0) * math.sqrt(0.9),
                "A lighter mass on the same spring is quicker."),
        Mistake(lambda right: natural_rpm(1.1),
                "This disc has gained a tenth; it should have lost one."),
    )),
    "1.2": Exercise(lambda: radii_at_600()[1], see="Eq. (1.6)", unit="µm", mistakes=(
        Mistake(lambda right: radii_at_600()[0],
                "This is the rotor centre; the centre of mass is asked for."),
        Mistake(lambda right: 1e6 * offset(),
                "This is the distance from the disc's own axis, not from the bearing axis."),
        Mistake(lambda right: radii_at_600()[0] + 1e6 * offset(),
                "The two lengths were added as if they pointed the same way; they have phases.",
                see="Resonance and phase"),
        Mistake(lambda right: 2 * right,
                "This is a diameter (peak to peak); the course counts radii."),
    )),
    "1.3": Exercise(senses, see="Eq. (1.5)", mistakes=(
        Mistake(lambda right: ["forward"] * 3,
                "One of the three speeds lies between the two natural frequencies."),
        Mistake(lambda right: ["backward" if word == "forward" else "forward" for word in right],
                "All three are turned round: positive spin, and forward whirl, run from z towards "
                "x.", see="Eq. (1.4)"),
    )),
    "1.4": Exercise(needed_damping, see="Eq. (1.7)", unit="fraction", mistakes=(
        Mistake(lambda right: offset() / (2 * LEFT),
                "5 mm are to be left; the orbit may fill the rest of the gap."),
        Mistake(lambda right: 2 * right, "The radius at resonance has 2ζ in its denominator."),
        Mistake(lambda right: right / 2, "The orbit's radius fits into the gap, not its diameter."),
        Mistake(lambda right: offset() / (2 * machine().air_gap.gap),
                "This leaves nothing of the gap."),
    )),
}
