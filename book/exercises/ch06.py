"""Chapter 6: the stiffness of a beam, the split of its whirl by the spin, its mass matrix, a
frequency in the limit, how many elements.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from hydrolab import load_machine
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.machine.elements import element_matrices_symbolic, shaft_element, symbols
from hydrolab.machine.parts import Shaft

SPEED = 800.0  # rad/s


@cache
def shaft() -> Shaft:
    """The unit's shaft."""
    return load_machine("kaplan-150rpm").shaft


def middle(diameter: float = 0.6, factor: float = 48) -> float:
    """Stiffness of a shaft of 8 m in its middle, MN/m."""
    return factor * 200e9 * math.pi / 64 * diameter**4 / 8**3 / 1e6


def whirl(n: int, speed: float) -> tuple[float, float]:
    """Backward (negative) and forward frequency of mode n of the pinned shaft at a speed, rad/s,
    Eq. (6.5).
    """
    k, s = n * math.pi / shaft().length, shaft()
    inertia = s.density * s.second_moment[0] * k**2
    low, high = np.sort(np.roots([s.density * s.area[0] + inertia, -2 * inertia * speed,
                                  -s.young * s.second_moment[0] * k**4]).real)
    return float(low), float(high)


def split(n: int = 4, speed: float = SPEED) -> float:
    """How far the forward frequency of mode n is above the backward one at a speed, %."""
    low, high = whirl(n, speed)
    return 100 * (high / -low - 1)


def mass_share() -> float:
    """m₁₁/(ρAℓ) of the element without rotary inertia, from the library's symbolic mass matrix."""
    c = symbols()
    entry = element_matrices_symbolic("lalanne-ferraris")[0][0, 0].subs(c.I, 0)
    return float(entry / (c.rho * c.A * c.L))


@cache
def frequency(count: int, mode: int = 3) -> float:
    """Frequency of a mode of the pinned shaft in equal Timoshenko elements, rad/s."""
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
    return float(np.sqrt(scipy.linalg.eigvalsh(K[np.ix_(free, free)], M[np.ix_(free, free)])
                         [2 * mode - 2]))


def extrapolated(order: int, fine: int = 32) -> float:
    """Fourth frequency from two meshes for an error of an order, Hz."""
    coarse, best = (frequency(n, 4) / (2 * math.pi) for n in (fine // 2, fine))
    return best - (coarse - best) / (2**order - 1)


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
    "6.1": Exercise(middle, see="Eq. (6.7)", unit="MN/m", mistakes=(
        Mistake(lambda right: 16 * right,
                "The diameter was taken for the radius: I goes with the fourth power.", see=STIFF),
        Mistake(lambda right: right / 16, "This is a cantilever's stiffness at its end.",
                see=STIFF),
        Mistake(lambda right: 4 * right, "This is for ends that cannot turn.", see=STIFF),
        Mistake(lambda right: middle(0.71), "This shaft has 600 mm."),
        Mistake(lambda right: right / 1e3, "This is in GN/m.", see=STIFF),
        Mistake(lambda right: middle() * (8 / 9.04) ** 3, "This shaft is 8 m long."),
    )),
    "6.2": Exercise(split, see="Eq. (6.5)", mistakes=(
        Mistake(lambda right: right / 2, "This is the distance from the frequency at rest.",
                see=EXACT),
        Mistake(lambda right: right / (1 + right / 100),
                "This is the share of the forward frequency; that of the backward one is asked "
                "for.", see=EXACT),
        Mistake(lambda right: -right / (1 + right / 100),
                "This is backward over forward; turn the ratio over.", see=EXACT),
        Mistake(lambda right: split(1), "This is the first mode.", see=EXACT),
        Mistake(lambda right: split(3), "This is the third mode.", see=EXACT),
        Mistake(lambda right: split(4, 500), "This is at 500 rad/s.", see=EXACT),
        Mistake(lambda right: split(4, SPEED * math.pi / 30),
                "800 was taken for rpm; it is in rad/s.", see=EXACT),
    )),
    "6.3": Exercise(mass_share, see=MASS, rtol=0.002, mistakes=(
        Mistake(lambda right: 0.5, "Half the mass at each end is the lumped matrix, not this one.",
                see=MASS),
        Mistake(lambda right: 1 / 3,
                "This is a rod with a straight shape; here the shape is a cubic.", see=MASS),
        Mistake(lambda right: 9 / 70, "This is the coupling of the two ends.", see=MASS),
    )),
    "6.4": Exercise(lambda: frequency(256, 4) / (2 * math.pi), see="Shear", unit="Hz", rtol=1e-4,
                    mistakes=(
        Mistake(lambda right: extrapolated(4), "This takes away a fifteenth of the last step, as "
                "for the fourth order. Ask whether this beam's error is of that order."),
        Mistake(lambda right: frequency(32, 4) / (2 * math.pi),
                "This is the mesh of 32; extrapolate what is left of its error."),
        Mistake(lambda right: extrapolated(1), "This takes the error for one of first order."),
        Mistake(lambda right: extrapolated(4, 16), "From 8 and 16, and for the wrong order."),
        Mistake(lambda right: extrapolated(2, 16), "From 16 and 32 elements it is nearer."),
        Mistake(lambda right: whirl(4, 0.0)[1] / (2 * math.pi), "This is the beam without shear."),
        Mistake(lambda right: frequency(128, 3) / (2 * math.pi), "This is the third frequency."),
    )),
    "6.5": Exercise(lambda: 20, see="How it converges", reply=kept, rubric=(
        (1, "a measured order, with shear, not the one without"),
        (1, "nodes where discs and bearings are"),
        (1, "what else is uncertain by more than 0.1 %"),
    )),
}
