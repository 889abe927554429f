"""Chapter 3: the step limit, Newmark's frequency error, a damped method's order, an alias, how long
a transient lasts.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from hydrolab import Newmark, RungeKutta, integrate, load_machine
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.dynamics.results import Trajectory
from hydrolab.machine.model import Model


@cache
def model() -> Model:
    """The rotor of the first chapters."""
    return load_machine("jeffcott").model()


@cache
def speed() -> float:
    """Its speed, rad/s."""
    return load_machine("jeffcott").speed


def omega() -> float:
    """Natural frequency without field, rad/s."""
    return math.sqrt(model().K[0, 0] / model().M[0, 0])


def motion(method: Newmark | RungeKutta) -> Trajectory:
    """Ten revolutions after the field was switched on at 5 %."""
    return integrate(model(), method, speed=speed(), static_eccentricity=0.05, revolutions=10,
                     modes=None)


@cache
def damped_order() -> float:
    """Order of Newmark's method with γ = 0.6, measured."""
    exact = motion(RungeKutta(rtol=1e-12)).positions[:, -1]
    off = [np.hypot(*(motion(Newmark(n, gamma=0.6)).positions[:, -1] - exact)) for n in (512, 1024)]
    return math.log2(off[0] / off[1])


def left(revolutions: float) -> str:
    """What is left of a millimetre after so many revolutions."""
    if not 1 <= revolutions <= 1e5:
        return f"noted, but {revolutions:g} is not a number of revolutions from 1 to 100000."
    damping = model().C[0, 0] / (2 * model().M[0, 0])
    rest = 1e3 * math.exp(-damping * 2 * math.pi * revolutions / speed())
    return (f"noted. Of a start that is 1 mm off, about {rest:.2g} µm are left after "
            f"{revolutions:.0f} revolutions.")


LIMIT, ORDER = "How large may the step be", "The order, measured"

EXERCISES = {
    "3.1": Exercise(lambda: math.ceil(math.pi * 2 * math.pi * 3000 / speed()), see="Eq. (3.4)",
                    rtol=1e-4, mistakes=(
        Mistake(lambda right: right / (2 * math.pi), "Here 3 kHz stands where rad/s belong.",
                see=LIMIT),
        Mistake(lambda right: 2 * right, "The limit of ω Δt is 2, not 1.", see=LIMIT),
        Mistake(lambda right: right * speed() / 150, "This divides by 150, the speed in rpm.",
                see=LIMIT),
    )),
    "3.2": Exercise(lambda: 2 * math.pi * omega() / speed() / math.sqrt(12e-4), see="Eq. (3.6)",
                    mistakes=(
        Mistake(lambda right: right / math.sqrt(2),
                "The 24 belongs to central differences; derive Newmark's own.", see=LIMIT),
        Mistake(lambda right: 2 * math.pi * omega() / speed() / 12e-4,
                "The step enters with its square.", see=LIMIT),
        Mistake(lambda right: 2 * math.pi * omega() / speed() / math.sqrt(6e-4),
                "The tangent's series has a third, and the half angle a quarter."),
        Mistake(lambda right: 2 * math.pi * omega() / speed() / math.sqrt(12e-2),
                "One in ten thousand is 1e-4."),
        Mistake(lambda right: 128.0, "These are the steps of the chapter's runs."),
    )),
    "3.3": Exercise(damped_order, see=ORDER, within=(0.9, 1.05), mistakes=(
        Mistake(lambda right: 2.0, "This is the order of the undamped method; measure this one.",
                see=ORDER),
        Mistake(lambda right: right * math.log(2),
                "The logarithm must have the base by which the step changed.", see=ORDER),
    )),
    "3.4": Exercise(lambda: 48, see="Pole pairs, and what 2f means", rtol=1e-3, mistakes=(
        Mistake(lambda right: 8, "This is where it appears. With 20 samples in a revolution other "
                "multiples look the same."),
        Mistake(lambda right: 12, "That is the mirror image; ask which of them is 2f of the grid."),
        Mistake(lambda right: 28, "That looks like 8X too. Ask which of them is 2f of the grid."),
        Mistake(lambda right: 24, "2f is twice the grid's frequency."),
        Mistake(lambda right: 120, "This is in Hz; a multiple of the speed is asked for."),
        Mistake(lambda right: 40, "Forty is twice the sampling; the line lies eight above it."),
    )),
    "3.5": Exercise(lambda: 300, see="A spectrum", reply=left, rubric=(
        (1, "the start's size and the rate at which it falls"),
        (1, "a margin, because other parts than the slowest are in the start"),
        (1, "what the step leaves beside it"),
    )),
}
