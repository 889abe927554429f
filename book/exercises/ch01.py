"""Chapter 1: natural frequency, the side on which the rotor lies, an ellipse, the sense of whirl,
the damper's power, damping at the resonance.
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


def half_axes(lag: float = -30.0) -> tuple[float, float]:
    """Long and short half axis of x = 210 sin Ωt, z = 150 cos(Ωt + lag), lag in degrees."""
    turn = math.radians(lag)
    shape = ellipse(np.array([[0, 210, 0], [0, -150 * math.sin(turn), 150 * math.cos(turn)]]))
    return shape.major, shape.minor


def left(ratio: float) -> str:
    """What a damping ratio leaves of the gap at the resonance."""
    if not 0.001 <= ratio <= 1:
        return f"noted, but {ratio:g} is no damping ratio from 0.001 to 1; 1 % is 0.01."
    rest = 1e3 * (machine().air_gap.gap - offset() / (2 * ratio))
    said = f"leaves {rest:.1f} mm of it" if rest > 0 else "does not fit into it"
    return (f"noted. The largest orbit is {1e3 * offset() / (2 * ratio):.1f} mm in a gap of "
            f"11 mm: it {said}, {'enough' if rest >= 1e3 * LEFT else 'too little'} for 5 mm.")


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
    "1.3": Exercise(lambda: half_axes()[0], see="Eq. (1.5)", unit="µm", rtol=0.005, mistakes=(
        Mistake(lambda right: 210.0, "The long axis of the ellipse points along neither probe."),
        Mistake(lambda right: math.hypot(210, 150),
                "The two are not at their largest together: they have a phase."),
        Mistake(lambda right: half_axes()[1], "This is the short half axis."),
        Mistake(lambda right: half_axes(60)[0], "Check the phase of z: it is a cosine."),
        Mistake(lambda right: half_axes(-120)[0], "Check the phase of z: it is a cosine."),
        Mistake(lambda right: 360.0, "The largest values of both do not add up: they point along "
                "different axes."),
        Mistake(lambda right: (210 + 150) / 2, "This is the mean of the two amplitudes."),
    )),
    "1.4": Exercise(senses, see="When the whirl goes against the spin", mistakes=(
        Mistake(lambda right: ["forward"] * 3,
                "One of the three speeds lies between the two natural frequencies."),
        Mistake(lambda right: ["backward" if word == "forward" else "forward" for word in right],
                "All three are turned round: positive spin, and forward whirl, run from z towards "
                "x.", see="Eq. (1.4)"),
        Mistake(lambda right: ["forward", "backward", "backward"],
                "Above both natural frequencies both coordinates have turned round."),
        Mistake(lambda right: ["backward"] * 3, "Unequal springs do not turn every whirl round."),
    )),
    "1.5": Exercise(lambda: math.sqrt(3) * natural_rpm(1.0), see="Eq. (1.9)", unit="rpm",
                    mistakes=(
        Mistake(lambda right: natural_rpm(1.0) * 3, "Ω² is three times ω², not Ω three times ω."),
        Mistake(lambda right: natural_rpm(1.0), "At the resonance the power is largest."),
        Mistake(lambda right: natural_rpm(1.0) * math.sqrt(2),
                "The radius enters with its square, and the speed as well."),
        Mistake(lambda right: natural_rpm(1.0) * math.sqrt(1.5),
                "There the radius is three times U/m; ask for the power."),
        Mistake(lambda right: 1200.0, "The power grows again before that: c Ω² with a radius that "
                "hardly changes."),
    )),
    "1.6": Exercise(lambda: 0.035, see="Eq. (1.7)", reply=left, rubric=(
        (1, "the least damping from (1.7), with a margin"),
        (1, "one other change, with what it costs: balancing, a fast run-up, stiffer springs"),
        (1, "why the resonance of this model cannot be trusted at such an amplitude"),
    )),
}
