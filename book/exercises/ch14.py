"""Chapter 14: an error of an order, two probes, a trial mass, a balance that fails, a unit that
nobody knows.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from functools import cache

from scipy.optimize import brentq

from hydrolab import HarmonicBalance, balance, identify, load_machine, made_up_record, vary
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.course.records import record_text
from hydrolab.dynamics.identify import Identified
from hydrolab.dynamics.probes import ProbeRecord, read_record
from hydrolab.machine.parts import Machine

GUIDES = ("generator guide bearing", "turbine guide bearing")
SIZE, PHASE = "bodies.generator.unbalance", "bodies.generator.phase"
FREE = (SIZE, PHASE, "static_eccentricity", "direction",
        "bearings.generator guide bearing.stiffness")
NEAR = 3.0  # standard errors


@cache
def unit() -> Machine:
    """The course's machine."""
    return load_machine("kaplan-150rpm")


def run_of(extra: complex, field: float, place: tuple[str, ...]) -> ProbeRecord:
    """A record without noise of the unit with an extra unbalance on its generator, kg m."""
    whole = unit().body("generator").unbalance + extra
    model = vary(unit(), {SIZE: abs(whole), PHASE: cmath.phase(whole)}).model().with_field(field)
    orbit = HarmonicBalance(4).solve(model, unit().speed)
    return made_up_record(orbit, place, noise=1e-9, seed=1, field=field)


def left_at_the_generator(influence: float, read: float = 1.0) -> float:
    """1X of the generator with field, µm, with the mass that readings at one field ask for by the
    influence at a field.
    """
    record = replace(run_of(0, read, GUIDES), field=influence)
    size, angle = balance(unit(), record).masses["generator"]
    return 1e6 * run_of(cmath.rect(size, angle), 1.0, ("generator",)).order("generator", 1)[0]


def twice(damped: bool = True, least: float = 1.05) -> float:
    """Speed, rpm, beyond `least` times the resonance with field, at which the field doubles the
    influence of the Jeffcott rotor, Eq. (14.8).
    """
    rotor = load_machine("jeffcott")
    spring, mass = rotor.bearings[0], rotor.bodies[0].mass
    k, pull = spring.stiffness[0, 0], rotor.air_gap.pull_stiffness  # type: ignore[union-attr]
    c = spring.damping[0, 0] * damped

    def excess(w: float) -> float:
        return abs((k - mass * w**2 + 1j * c * w) / (k - pull - mass * w**2 + 1j * c * w)) - 2

    return brentq(excess, least * math.sqrt((k - pull) / mass), math.sqrt(k / mass)) * 30 / math.pi


@cache
def known() -> Identified:
    """What the records of the unknown unit tell, without run-out."""
    slow = read_record(record_text("slow-roll"), field=0.0)
    clean = [read_record(record_text(f"{name}-field"), field=field).without(slow)
             for name, field in (("with", 1.0), ("without", 0.0))]
    return identify(unit(), clean, list(FREE))


def own_unit(said: Identified) -> str:
    """What to say to whoever hands in a model of the unknown unit."""
    best = known()
    if said.rejected:
        return (f"noted, but the records reject this model: χ² is {said.chi_square:.4g} at "
                f"{said.freedom} degrees of freedom. Furthest off: {said.worst}.")
    off = []
    for key in best.values.keys() & said.values.keys():
        away = said.values[key] - best.values[key]
        if best.units[key] == "rad":
            away = (away + math.pi) % (2 * math.pi) - math.pi
        if abs(away) > NEAR * best.errors[key]:
            off.append(f"{key} by {abs(away) / best.errors[key]:.0f}")
    if off:
        return ("noted. The records do not reject this model, and hydrolab's own differs from it, "
                f"in standard errors: {'; '.join(sorted(off))}.")
    return "noted. The records do not reject this model, and hydrolab finds the same numbers."


EXERCISES = {
    "14.1": Exercise(lambda: 4 * math.sqrt(2 / 1280), see="Eq. (14.3)", unit="µm", mistakes=(
        Mistake(lambda right: 4 / math.sqrt(1280), "This is the error of the mean; a wave has a "
                "mean square of a half."),
        Mistake(lambda right: 4 * math.sqrt(2 / 64), "This counts one revolution only."),
        Mistake(lambda right: 4 * math.sqrt(2 / 20), "Each revolution has 64 samples, and each "
                "counts."),
        Mistake(lambda right: 4 * 2 / 1280, "Variances add up, not errors: take the root."),
    )),
    "14.2": Exercise(lambda: (1 - math.cos(math.pi / 4)) ** -0.5, see="Eq. (14.1)", mistakes=(
        Mistake(lambda right: right**2, "This is the ratio of the variances."),
        Mistake(lambda right: math.sqrt(2), "This is the error across one of the probes; a "
                "direction between them is worse."),
        Mistake(lambda right: (1 + math.cos(math.pi / 4)) ** -0.5, "This is the best direction."),
        Mistake(lambda right: (1 + math.cos(math.pi / 4)) ** 0.5
                / (1 - math.cos(math.pi / 4)) ** 0.5,
                "This compares the worst direction with the best one, not with a right angle."),
    )),
    "14.3": Exercise(twice, see="Eq. (14.8)", unit="rpm", rtol=0.002, mistakes=(
        Mistake(lambda right: 30 / math.pi * math.sqrt(2.7e8 / 1.5e5),
                "This is the resonance without field."),
        Mistake(lambda right: 30 / math.pi * math.sqrt((2.7e8 - 1.6504e8) / 1.5e5),
                "This is the resonance with field."),
    )),
    "14.4": Exercise(lambda: left_at_the_generator(0.0),
                     see="Balancing: what a mass does", unit="µm", rtol=0.02, mistakes=(
        Mistake(lambda right: left_at_the_generator(0.0, 0.0),
                "The 1X is read with the field on; only the influence is that without."),
        Mistake(lambda right: left_at_the_generator(1.0),
                "This takes the influence with field for that without."),
        Mistake(lambda right: 1e6 * run_of(0, 1.0, ("generator",)).order("generator", 1)[0],
                "This is the unit before it was balanced."),
    )),
    "14.5": Exercise(known,
                     see="A wrong model is seen in what it leaves over", reply=own_unit, rubric=(
        (1, "run-out taken away, and what happens without that"),
        (2, "a model that is not rejected, and the one before it that was, both with their χ²"),
        (1, "each number with its 95 %"),
        (1, "which numbers are tied, and a record that would part them"),
    )),
}
