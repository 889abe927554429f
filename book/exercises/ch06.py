"""Chapter 6: the stiffness of a beam, the split of its whirl by the spin, its mass matrix, how many
elements.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from hydrolab import load_machine
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.machine.elements import element_matrices_symbolic, shaft_element, symbols
from hydrolab.machine.parts import Shaft

SPEED = 500.0  # rad/s


@cache
def shaft() -> Shaft:
    """The unit's shaft."""
    return load_machine("kaplan-150rpm").shaft


def middle() -> float:
    """Stiffness in the middle between supports, N/m."""
    return 48 * shaft().young * float(shaft().second_moment[0]) / shaft().length**3


def whirl(n: int, speed: float) -> tuple[float, float]:
    """Backward (negative) and forward frequency of mode n of the pinned shaft at a speed, rad/s,
    Eq. (6.5).
    """
    k, s = n * math.pi / shaft().length, shaft()
    inertia = s.density * s.second_moment[0] * k**2
    low, high = np.sort(np.roots([s.density * s.area[0] + inertia, -2 * inertia * speed,
                                  -s.young * s.second_moment[0] * k**4]).real)
    return float(low), float(high)


def split() -> float:
    """How far the third forward frequency is above the backward one, %."""
    low, high = whirl(3, SPEED)
    return 100 * (high / -low - 1)


def mass_share() -> float:
    """m₁₁/(ρAℓ) of the element without rotary inertia, from the library's symbolic mass matrix."""
    c = symbols()
    entry = element_matrices_symbolic("lalanne-ferraris")[0][0, 0].subs(c.I, 0)
    return float(entry / (c.rho * c.A * c.L))


@cache
def frequency(count: int) -> float:
    """Third frequency of the pinned shaft in equal Timoshenko elements, rad/s."""
    import scipy.linalg

    size = 4 * count + 4
    M, K = np.zeros((size, size)), np.zeros((size, size))
    m, _, k = shaft_element("timoshenko", shaft().length / count, shaft().young, shaft().density,
                            float(shaft().area[0]),
                            float(shaft().second_moment[0]), shaft().poisson,
                            shaft().shear_coefficient)
    for i in range(count):
        M[4 * i:4 * i + 8, 4 * i:4 * i + 8] += m
        K[4 * i:4 * i + 8, 4 * i:4 * i + 8] += k
    free = np.delete(np.arange(size), [0, 1, size - 4, size - 3])
    return float(np.sqrt(scipy.linalg.eigvalsh(K[np.ix_(free, free)], M[np.ix_(free, free)])[4]))


def kept(count: float) -> str:
    """What a number of elements leaves."""
    if count != int(count) or not 2 <= count <= 64:
        return f"noted, but {count:g} is not a whole number from 2 to 64."
    off = 100 * (frequency(int(count)) / frequency(64) - 1)
    return (f"noted. With {count:.0f} elements the third frequency is {off:.2g} % too high, with "
            f"{4 * count + 4:.0f} numbers.")


STIFF, EXACT = "Stiffness from energy, by hand", "Against the exact shaft"
MASS = "Mass, rotary inertia and spin"

EXERCISES = {
    "6.1": Exercise(lambda: middle() / 1e6, see="Eq. (6.7)", unit="MN/m", mistakes=(
        Mistake(lambda right: 16 * right,
                "The diameter was taken for the radius: I goes with the fourth power.", see=STIFF),
        Mistake(lambda right: right / 16, "This is a cantilever's stiffness at its end.",
                see=STIFF),
        Mistake(lambda right: 4 * right, "This is for ends that cannot turn.", see=STIFF),
    )),
    "6.2": Exercise(split, see="Eq. (6.5)", rtol=0.01, mistakes=(
        Mistake(lambda right: right / 2, "This is the distance from the frequency at rest.",
                see=EXACT),
        Mistake(lambda right: -right / (1 + right / 100),
                "This is backward over forward; turn the ratio over.", see=EXACT),
        Mistake(lambda right: 100 * (whirl(1, SPEED)[1] / -whirl(1, SPEED)[0] - 1),
                "This is the first mode.", see=EXACT),
        Mistake(lambda right: right * math.pi / 30, "500 was taken for rpm; it is in rad/s.",
                see=EXACT),
    )),
    "6.3": Exercise(mass_share, see=MASS, rtol=0.002, mistakes=(
        Mistake(lambda right: 0.5, "Half the mass at each end is the lumped matrix, not this one.",
                see=MASS),
        Mistake(lambda right: 1 / 3,
                "This is a rod with a straight shape; here the shape is a cubic.", see=MASS),
        Mistake(lambda right: 9 / 70, "This is the coupling of the two ends.", see=MASS),
    )),
    "6.4": Exercise(lambda: 20, see="How it converges", reply=kept),
}
