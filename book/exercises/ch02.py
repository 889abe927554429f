"""Chapter 2: the pull in kilonewtons, the springs it needs, the field a machine may have, an oval
stator.
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
def needed_kappa(offset: float) -> float:
    """Stiffness of the springs, as a multiple of the pull's, that hold the rotor up to a stator
    offset.
    """
    return stiffness_used_up(brentq(lambda eps: largest_offset(eps) - offset, 1e-3, 0.9))


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
    "2.2": Exercise(lambda: needed_kappa(0.15), see="Static pull-in", mistakes=(
        Mistake(lambda right: stiffness_used_up(0.15),
                "15 % is the stator's offset; the rotor is displaced more, by ε.", see="Eq. (2.8)"),
        Mistake(lambda right: right - 1,
                "This is what the springs have more than the pull; the ratio is asked for."),
        Mistake(lambda right: 1 / right,
                "This is the pull's stiffness over the springs'; κ is the other way round."),
    )),
    "2.3": Exercise(lambda: gap().field * math.sqrt(field_share(rpm(300))),
                    see="Negative stiffness", mistakes=(
        Mistake(lambda right: gap().field * field_share(rpm(300)),
                "The stiffness goes with the square of the field.", see="Eq. (2.4)"),
        Mistake(lambda right: gap().field * math.sqrt(field_share(5.0)),
                "300 rpm are 5 Hz, and 5 Hz are not 5 rad/s."),
        Mistake(lambda right: right * math.sqrt(2),
                "This is the peak of the wave; the formula wants its rms value.", see="Eq. (2.7)"),
    )),
    "2.4": Exercise(lambda: oval(lambda phi: 0.1 * np.cos(2 * phi)),
                    see="The pressure, and its sum", measure=slopes, mistakes=(
        Mistake(lambda right: oval(lambda phi: 0.1 * np.cos(phi)),
                "One wave around is a stator off centre."),
        Mistake(lambda right: oval(lambda phi: 0.1 * np.sin(2 * phi)),
                "The oval is turned by 45°."),
        Mistake(lambda right: oval(lambda phi: -0.1 * np.cos(2 * phi)),
                "x and z are exchanged: φ runs from z towards x.", see="The gap"),
        Mistake(lambda right: oval(lambda phi: 0 * phi), "This stator is round."),
    )),
}
