"""Chapter 7: a body on an arm, critical speeds, Rayleigh's coefficients, a bearing for runaway."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from hydrolab import campbell, load_machine, modes, rpm, vary
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.dynamics.modes import Campbell
from hydrolab.machine.parts import Machine

BEARING = "bearings.generator guide bearing.stiffness"


@cache
def unit() -> Machine:
    """The course's machine."""
    return load_machine("kaplan-150rpm")


def inertia() -> float:
    """Tilting inertia of the generator about the shaft top, kg m²."""
    body = unit().body("generator")
    return body.Id + body.mass * body.offset**2


@cache
def crossings() -> Campbell:
    """Campbell diagram of the three-disc rotor without damping."""
    model = load_machine("three-disc").model()
    return campbell(replace(model, C=0 * model.C), np.linspace(0, rpm(30000), 61), branches=8)


@cache
def distinct() -> tuple[float, float]:
    """First two distinct frequencies of the unit at rest without field, rad/s."""
    model = unit().model().with_field(0)
    first, second = modes(replace(model, C=0 * model.C)).frequencies[:4:2]
    return float(first), float(second)


def beta(ratio: float) -> float:
    """β for equal ratios in both modes, s."""
    return 2 * ratio / sum(distinct())


def runaway(factor: float) -> str:
    """Where the first forward critical speed is, with the linear pull, for a stiffer or softer
    guide bearing.
    """
    if not 0.3 <= factor <= 100:
        return f"noted, but {factor:g} is no factor from 0.3 to 100."
    model = vary(unit(), {BEARING: factor * unit().bearings[0].stiffness[0, 0]}).model()
    pull = model.law.stiffness * model.selection.T @ model.selection
    bare = replace(model.with_field(0), C=0 * model.C, K=model.K - pull)
    for critical in campbell(bare, np.linspace(1, rpm(1500), 60), branches=6).critical_speeds:
        found = modes(bare, critical)
        if found.direction[np.abs(found.frequencies - critical).argmin()] == "forward":
            verdict = "above" if critical >= rpm(450) else "below"
            return (f"noted. The first forward critical speed is {critical / rpm(1):.0f} rpm, "
                    f"{verdict} the 450 that were asked for.")
    return "noted. There is no forward critical speed below 1500 rpm."


ARM, CRITICAL = "A body at the end of an arm", "Critical speeds, by hand"
DAMPING = "Damping, and what it is worth"

EXERCISES = {
    "7.1": Exercise(lambda: inertia() / 1e3, see="Eq. (7.2)", rtol=0.005, mistakes=(
        Mistake(lambda right: unit().body("generator").Id / 1e3,
                "The arm is missing: Steiner's theorem.", see=ARM),
        Mistake(
                lambda right: 1e-3 * (unit().body("generator").Ip + inertia()
                                      - unit().body("generator").Id),
                "This has Ip in place of Id.", see=ARM),
        Mistake(lambda right: 1e3 * right, "This is in kg m².", see=ARM),
    )),
    "7.2": Exercise(lambda: float(crossings().critical_speeds[2] / rpm(1)), see="Eq. (7.5)",
                    unit="rpm", rtol=0.005, mistakes=(
        Mistake(lambda right: float(crossings().hertz[0, 2] * 60),
                "This is the third natural frequency at rest.", see=CRITICAL),
        Mistake(lambda right: float(crossings().critical_speeds[1] / rpm(1)),
                "This is the second one.", see=CRITICAL),
        Mistake(lambda right: float(crossings().critical_speeds[3] / rpm(1)),
                "This is the fourth one.", see=CRITICAL),
    )),
    "7.3": Exercise(lambda: 1e3 * beta(0.05), see="Eq. (7.6)", unit="ms", mistakes=(
        Mistake(lambda right: right / 5, "This is for 1 %.", see=DAMPING),
        Mistake(lambda right: 2 * np.pi * right, "Frequencies in Hz stand where rad/s belong.",
                see=DAMPING),
        Mistake(lambda right: right / 2, "The ratio is βω/2, so β has a factor of two.",
                see=DAMPING),
    )),
    "7.4": Exercise(lambda: 1.7, see="The unit and its runaway", reply=runaway),
}
