"""Chapter 2: the pull in kilonewtons, how the offset grows with the springs, the field a machine
may have, where a rotor rests, an oval stator, a gap to choose.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from scipy.optimize import brentq

from hydrolab import CircularPull, LinearPull, ShapedPull, load_machine, rpm
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.machine.parts import AirGap

GRAVITY = 9.81
# stiffness 1, gap 1: displacements are ε, forces in units of k_UMP g0
UNIT_PULL = CircularPull(1.0, 1.0)


def gap() -> AirGap:
    """The paper's air gap."""
    return load_machine("jeffcott").air_gap


def pull(eps: float, law: type = CircularPull) -> float:
    """The pull of a law on a rotor displaced by eps of the gap, kN."""
    return law(gap().pull_stiffness, gap().gap).force(np.array([eps * gap().gap, 0.0]))[0] / 1e3


def stiffness_used_up(eps: float) -> float:
    """The κ whose springs give way at a displacement eps: the pull's own stiffness there."""
    return UNIT_PULL.linearise(np.array([eps, 0.0]))[1][0, 0]


def largest_offset(eps: float) -> float:
    """The stator offset at which those springs give way."""
    return eps - UNIT_PULL.force(np.array([eps, 0.0]))[0] / stiffness_used_up(eps)


@cache
def rest(offset: float, low: float, high: float, linear: bool = False) -> float:
    """Where spring and pull balance at a stator offset, between two displacements, all as shares
    of the gap.
    """
    kappa = load_machine("jeffcott").bearings[0].stiffness[0, 0] / gap().pull_stiffness
    if linear:
        return offset * kappa / (kappa - 1)
    return brentq(lambda eps: eps - UNIT_PULL.force(np.array([eps, 0.0]))[0] / kappa - offset,
                  low, high)


def holds(width: float) -> str:
    """What the springs hold with a gap of this width, mm."""
    if not 5 <= width <= 40:
        return f"noted, but {width:g} is no gap from 5 to 40 mm."
    stiffness = load_machine("jeffcott").bearings[0].stiffness[0, 0]
    kappa = stiffness / (gap().pull_stiffness * 11 / width)
    if kappa <= 1:
        return f"noted. κ is {kappa:.2f}: the pull wins at once."
    top = brentq(lambda eps: stiffness_used_up(eps) - kappa, 0, 0.99)
    most = width * largest_offset(top)
    return (f"noted. κ is {kappa:.2f}, and the springs hold the resting rotor up to an offset of "
            f"{most:.2f} mm, {most:.1f} times what is asked for.")


def field_share(speed: float) -> float:
    """The share of the pull's stiffness that a centred natural frequency of `speed`, rad/s, allows.
    """
    machine = load_machine("jeffcott")
    return (machine.bearings[0].stiffness[0, 0] - machine.bodies[0].mass
            * speed**2) / gap().pull_stiffness


def oval(shape) -> ShapedPull:
    """The pull of a stator whose gap with a centred rotor is g0 (1 + shape(φ))."""
    angles = 2 * np.pi * np.arange(360) / 360
    return ShapedPull(gap().pull_stiffness, gap().gap, gap().gap * (1 + shape(angles)))


def slopes(law: ShapedPull) -> list[float]:
    """Negative stiffness in x and z of the centred rotor, MN/m."""
    return [1e-6 * value for value in np.diag(law.linearise(np.zeros(2))[1])]


EXERCISES = {
    "2.1a": Exercise(lambda: pull(0.25), see="Eq. (2.4)", unit="kN", mistakes=(
        Mistake(lambda right: pull(0.25, LinearPull),
                "This is the linear law, the first term of the series.", see="Negative stiffness"),
        Mistake(lambda right: 2 * right, "u0 in the formula is a radius, not a diameter."),
        Mistake(lambda right: right / 2,
                "The flux density in the formula is an rms value: no further half.",
                see="Which flux density: rms or peak"),
        Mistake(lambda right: -right,
                "The size is asked for. The pull acts along the displacement, towards the small "
                "gap.", see="Eq. (2.1)"),
    )),
    "2.1b": Exercise(lambda: pull(0.25) / GRAVITY, see="Eq. (2.4)", unit="t", mistakes=(
        Mistake(lambda right: pull(0.25, LinearPull) / GRAVITY,
                "This is the weight of the linear pull.", see="Negative stiffness"),
        Mistake(lambda right: right * GRAVITY,
                "Divide the force by g to get the mass that weighs as much."),
        Mistake(lambda right: right * GRAVITY**2, "Divide by g; do not multiply."),
    )),
    "2.2": Exercise(lambda: 1.5, see="Static pull-in", rtol=0.02, mistakes=(
        Mistake(lambda right: 1.0, "In proportion to κ − 1 would be a straight line; look at the "
                "table."),
        Mistake(lambda right: 0.5, "This is how the displacement ε goes; the offset is asked for.",
                see="Eq. (2.8)"),
        Mistake(lambda right: 2.0, "ε goes like a root of κ − 1, not like κ − 1."),
        Mistake(lambda right: 2.5, "One factor κ − 1 is left in (2.8), not two."),
    )),
    "2.3": Exercise(lambda: gap().field * math.sqrt(field_share(rpm(300))),
                    see="Negative stiffness", unit="T", mistakes=(
        Mistake(lambda right: gap().field * field_share(rpm(300)),
                "The stiffness goes with the square of the field.", see="Eq. (2.4)"),
        Mistake(lambda right: field_share(rpm(300)), "This is the share of the pull's stiffness."),
        Mistake(lambda right: gap().field * math.sqrt(field_share(5.0)),
                "300 rpm are 5 Hz, and 5 Hz are not 5 rad/s."),
        Mistake(lambda right: gap().field * math.sqrt(field_share(rpm(150))),
                "This is for the machine's own speed, 150 rpm."),
        Mistake(lambda right: right * math.sqrt(2),
                "This is the peak of the wave; the formula wants its rms value.", see="Eq. (2.7)"),
    )),
    "2.4": Exercise(lambda: rest(0.07, 0, 0.33), see="Eq. (2.8)", unit="times the gap", mistakes=(
        Mistake(lambda right: rest(0.07, 0.34, 0.99), "There spring and pull balance too, but the "
                "pull is the steeper of the two: a push outwards is not answered.",
                see="Explore: spring against pull"),
        Mistake(lambda right: rest(0.07, 0, 0.33, True), "This is the linear pull."),
        Mistake(lambda right: 0.07, "This is the stator's offset; the rotor follows the pull."),
        Mistake(lambda right: right - 0.07,
                "This is how far the rotor has left its bearing axis; ε is counted in the stator."),
        Mistake(lambda right: 0.3317, "There the springs give way; at 7 % they do not yet.",
                see="Eq. (2.9)"),
    )),
    "2.5": Exercise(lambda: oval(lambda phi: 0.1 * np.cos(2 * phi)),
                    see="The pressure, and its sum", measure=slopes, mistakes=(
        Mistake(lambda right: oval(lambda phi: 0.1 * np.cos(phi)),
                "One wave around is a stator off centre."),
        Mistake(lambda right: oval(lambda phi: 0.1 * np.sin(2 * phi)),
                "The oval is turned by 45°."),
        Mistake(lambda right: oval(lambda phi: -0.1 * np.cos(2 * phi)),
                "x and z are exchanged: φ runs from z towards x.", see="The gap"),
        Mistake(lambda right: oval(lambda phi: 0 * phi), "This stator is round."),
    )),
    "2.6": Exercise(lambda: 13.0, see="Static pull-in", reply=holds, rubric=(
        (1, "the offset as a share of the new gap, and κ of the new gap"),
        (1, "a margin, and for what: whirl, tolerances, stiffness not known"),
        (1, "the cost: magnetising current in proportion to the gap"),
    )),
}
