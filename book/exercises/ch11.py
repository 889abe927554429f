"""Chapter 11: the force of two shapes, the forces of three, a taller rim that leans, a force of
third order, and a 2X without eccentricity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from hydrolab import (
    Arclength,
    Contact,
    HarmonicBalance,
    NoConvergence,
    ellipse,
    follow,
    load_machine,
)
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.machine.gap_shape import Bulge, selection_rule, shaped_law
from hydrolab.machine.parts import Machine
from hydrolab.machine.pull import TiltedPull

SIZE = 2e-4  # m, of the shapes of 11.1
TALL = 1.94  # m, the rim of 11.3


@cache
def unit() -> Machine:
    """The course's machine."""
    return load_machine("kaplan-150rpm")


def shape_force(gap: float) -> float:
    """Force of a stator of order 4 and a rotor of order 5, N, by Eq. (11.3) with a gap, m."""
    pull = unit().air_gap.pull_stiffness
    return selection_rule(pull, gap, ("stator", Bulge(4, SIZE)), ("rotor", Bulge(5, SIZE))).size


@cache
def third_order(share: float) -> float:
    """Force of a stator of order 5 and a rotor of order 2, each of a share of the gap, N: the
    largest of the parts that turn.
    """
    gap, still = unit().air_gap.gap, np.zeros(2)
    law = shaped_law(unit().air_gap.pull_stiffness, gap, (Bulge(5, share * gap),),
                     (Bulge(2, share * gap),))
    forces = [law.force(still, still, 2 * np.pi * i / 64, unit().speed) for i in range(64)]
    return float(abs(np.fft.fft(np.array(forces) @ [1j, 1]) / 64).max())


@cache
def fold_percent(height: float) -> float:
    """First fold, % of the gap, with a rim of this height, m, that leans; upright where it is 0."""
    model = replace(unit(), air_gap=replace(unit().air_gap,
                                            tilt=True)).model() if height else unit().model()
    if height:
        model = replace(model, law=TiltedPull(model.law.upright, height))
    method = Arclength(HarmonicBalance(6), max_folds=1, tail=0)
    return 100 * follow(model, to=0.2, speed=unit().speed, method=method).folds[0].value


def two_shapes(said: Sequence[float]) -> str:
    """The 2X of a machine without eccentricity with a stator and a rotor shape."""
    stator, rotor, percent = said
    if any(order != int(order) or not 2 <= order <= 12
           for order in (stator, rotor)) or not 0 < percent <= 20:
        return ("noted, but orders are whole numbers from 2 to 12 (1 is an eccentricity), and a "
                "size lies between 0 and 20 %.")
    gap, size = unit().air_gap.gap, percent / 100 * unit().air_gap.gap
    law = shaped_law(unit().air_gap.pull_stiffness, gap, (Bulge(int(stator), size),),
                     (Bulge(int(rotor), size),))
    try:
        orbit = HarmonicBalance(6).solve(replace(unit().model(), law=law), unit().speed)
    except (NoConvergence, Contact):
        return "noted. No steady state was found with shapes as large as these."
    second = ellipse(orbit.coefficients, 2)
    sense = "forward" if second.forward else "backward"
    return (f"noted. 2X is {1e6 * second.major:.1f} µm"
            + (f", {sense}" if second.major > 1e-8 else "")
            + f"; at 8 % static eccentricity the round machine has {1e6 * eccentric_2x():.1f} µm.")


@cache
def eccentric_2x() -> float:
    """2X of the round machine at 8 %, m."""
    return ellipse(HarmonicBalance(6).solve(unit().model(), unit().speed, 0.08).coefficients,
                   2).major


EXERCISES = {
    "11.1": Exercise(lambda: shape_force(unit().air_gap.gap), see="Eq. (11.3)", unit="N", mistakes=(
        Mistake(lambda right: 4 * right,
                "These are amplitudes, not peak-to-peak sizes; the force holds their product."),
        Mistake(lambda right: right / 1.5, "The factor three halves is missing."),
        Mistake(lambda right: right / SIZE, "The force holds the product of both sizes."),
        Mistake(lambda right: shape_force(unit().air_gap.gap / 2), "The gap g0 is 11 mm."),
    )),
    "11.2": Exercise(lambda: [-2, 4], see="A selection rule", rtol=0.0, atol=0.1, mistakes=(
        Mistake(lambda right: [2, -4], "Look at the sense again: forward if the stator's order is "
                "one less."),
        Mistake(lambda right: [-4, 2], "Look at the sense again: forward if the stator's order is "
                "one less."),
        Mistake(lambda right: [2, 4], "Not both go with the spin: look which orders "
                "are below the stator's."),
        Mistake(lambda right: [-4, -2], "Not both go against the spin."),
        Mistake(lambda right: [-3, 3], "The turns are counted by the shape that turns."),
        Mistake(lambda right: [-1, 1], "The orders differ by one; how often the force turns is the "
                "order of the shape that turns."),
    )),
    "11.3": Exercise(lambda: fold_percent(TALL), see="Leaning", unit="% of the gap", mistakes=(
        Mistake(lambda right: fold_percent(TALL / 2), "This is the rim of the card, 0.97 m."),
        Mistake(lambda right: fold_percent(0.0), "This rotor stands upright."),
        Mistake(lambda right: fold_percent(2 * TALL), "The height was doubled twice."),
    )),
    "11.4": Exercise(lambda: third_order(0.015), see="A selection rule", unit="N", rtol=0.02,
                     mistakes=(
        Mistake(lambda right: third_order(0.03) / 4, "A quarter is the rule of (11.3), and this "
                "pair breaks that rule: its force is of a higher order."),
        Mistake(lambda right: third_order(0.03) / 2, "Both shapes are half as large."),
        Mistake(lambda right: third_order(0.03) / 16, "The rotor's shape counts twice and the "
                "stator's once: the third order, not the fourth."),
        Mistake(lambda right: 0.0, "The rule forbids a force of second order only."),
        Mistake(lambda right: third_order(0.03), "This is with shapes of 3 %."),
    )),
    "11.5": Exercise(lambda: [3.0, 2.0, 4.0], see="Out of round", reply=two_shapes, rubric=(
        (1, "two orders that differ by one, with the reason"),
        (1, "more than 24 µm with shapes inside a tolerance"),
        (1, "one number of the record that tells this machine from an eccentric one"),
    )),
}
