"""Chapter 0: speeds, a pull that equals a weight, half the field, a mean of 1 mm, the fold."""

from __future__ import annotations

import math
from functools import cache

from scipy.optimize import brentq

from hydrolab import HarmonicBalance, follow, load_machine, rpm, vary
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.machine.parts import Machine

# of the generator: numbers that can change by 1 % on their own
CALIBRATED = ("mass", "Id", "Ip", "unbalance")


@cache
def unit() -> Machine:
    """The course's machine."""
    return load_machine("kaplan-150rpm")


@cache
def orbit(eccentricity: float) -> PeriodicOrbit:
    """Its steady state at 150 rpm."""
    return HarmonicBalance(harmonics=4).solve(unit().model(), speed=rpm(150),
                                              static_eccentricity=eccentricity)


def equal_to_weight(radius: float = 4.2, gap: float = 0.016) -> float:
    """Displacement at which the pull of the second unit equals its weight, mm, by Eq. (0.2)."""
    stiffness = math.pi * 0.6**2 * radius * 1.4 / (4e-7 * math.pi * gap)
    return 1e3 * 300e3 * 9.81 / stiffness


def radius_with(field: float) -> float:
    """Circle of the centred machine with the field times a factor, µm."""
    found = HarmonicBalance(harmonics=4).solve(unit().model().with_field(field), speed=rpm(150))
    return 1e6 * found.amplitudes[0, 0]


@cache
def mean_moved(size: float) -> float:
    """Eccentricity at which the mean has moved by a size, m; % of the gap."""
    return 100 * brentq(lambda e: abs(orbit(e).mean[0]) - size, 0.001, 0.088, xtol=1e-8)


@cache
def first_fold(key: str = "") -> float:
    """The first fold, % of the gap, with the card's number at `key` raised by 1 %."""
    machine = unit()
    if key:
        machine = vary(machine, {f"bodies.generator.{key}": 1.01
                                 * getattr(machine.body("generator"), key)})
    return 100 * follow(machine.model(), to=0.12, speed=rpm(150)).folds[0].value


def sensitivity(key: str) -> str:
    """What 1 % more of a number of the generator does to the first fold."""
    key = key.strip().removeprefix("bodies.generator.")
    moves = {name: first_fold(name) - first_fold() for name in CALIBRATED}
    most = max(moves, key=lambda name: abs(moves[name]))
    others = ", ".join(f"{name} {move:+.3f}" for name, move in moves.items())
    yours = "is the strongest of these" if key == most else (
        f"is weaker than {most}" if key in moves else "is not one of these; try it with `vary`")
    return ("noted. 1 % more of a number of the generator moves the first fold, in % of the gap, "
            f"by: {others}. "
            f"{key or 'Yours'} {yours}.")


EXERCISES = {
    "0.1a": Exercise(lambda: rpm(90), see="The axes", unit="rad/s", mistakes=(
        Mistake(lambda right: 2 * math.pi * 90, "One minute has 60 seconds."),
        Mistake(lambda right: right / 2, "One revolution is 2π, not π."),
    )),
    "0.1b": Exercise(lambda: rpm(90) / (2 * math.pi), see="The axes", mistakes=(
        Mistake(lambda right: 90.0, "This is per minute; per second is asked for."),
        Mistake(lambda right: rpm(90),
                "This is in radians per second; a revolution has 2π of them."),
    )),
    "0.2": Exercise(equal_to_weight, see="Eq. (0.2)", unit="mm", mistakes=(
        Mistake(lambda right: right / 9.81, "The weight is the mass times g."),
        Mistake(lambda right: equal_to_weight(radius=8.4), "u0 is a radius, not a diameter."),
        Mistake(lambda right: equal_to_weight(gap=0.011), "This unit's gap is 16 mm."),
        Mistake(lambda right: right * 0.6, "The flux density enters with its square."),
        Mistake(lambda right: right * 119 / 300, "This rotor weighs 300 t."),
    )),
    "0.3": Exercise(lambda: radius_with(0.5), see="Limit check: without the field", unit="µm",
                    mistakes=(
        Mistake(lambda right: (78.3 + 200) / 2, "The pull goes with the square of the field, and "
                "it does not add to the orbit: it takes stiffness away."),
        Mistake(lambda right: 78.3 + (200 - 78.3) / 4, "A quarter of the pull is right. But it "
                "does not add to the orbit: it takes stiffness away."),
        Mistake(lambda right: radius_with(math.sqrt(0.5)),
                "This is half the pull; half the field leaves a quarter of it."),
        Mistake(lambda right: 100.0, "Half the field is not half the orbit."),
        Mistake(lambda right: 78.3, "This is without field."),
    )),
    "0.4": Exercise(lambda: mean_moved(1e-3), see="One steady state", unit="% of the gap",
                    rtol=0.003, mistakes=(
        Mistake(lambda right: 8.8 / abs(1e3 * orbit(0.088).mean[0]),
                "This is the straight line; the mean does not follow one."),
        Mistake(lambda right: 100 / 11, "This is the stator's offset of 1 mm; the rotor's mean is "
                "asked for."),
        Mistake(lambda right: 5 / abs(1e3 * orbit(0.05).mean[0]),
                "This is the straight line through 5 %; the mean does not follow one."),
        Mistake(lambda right: mean_moved(1.1e-3), "1 mm is not a tenth of the gap."),
    )),
    "0.5": Exercise(lambda: "mass", see="Follow the steady states", reply=sensitivity, rubric=(
        (1, "the sizes of the moves, with their sign"),
        (1, "what 1 % of each number is worth: who knows a mass to 1 %?"),
        (1, "that the fold's place was put in and its existence was not"),
    )),
}
