"""Chapter 4: counting unknowns and samples, a cubic pull, where solutions merge, how many
harmonics.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from hydrolab import HarmonicBalance, load_machine
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.machine.model import Model
from hydrolab.machine.pull import ForceLaw, Linear

ECCENTRICITY = 0.07


@dataclass(frozen=True)
class CubicPull(ForceLaw):
    """The pull to its cubic term: k e (1 + 3/2 ε²)."""

    stiffness: float
    gap: float

    def linearise(self, u: NDArray, velocity: NDArray | None = None, phase: NDArray | float = 0.0,
                  speed: float = 0.0) -> Linear:
        """Force, N, and its derivative, N/m."""
        square = (u * u).sum(axis=0) / self.gap**2
        one = np.eye(2).reshape(2, 2, *(1,) * (u.ndim - 1))
        slope = self.stiffness * ((1 + 1.5 * square) * one + 3 * u[:, None] * u / self.gap**2)
        return self.stiffness * (1 + 1.5 * square) * u, slope, None


@cache
def model() -> Model:
    """The rotor of the first chapters."""
    return load_machine("jeffcott").model()


@cache
def orbit(harmonics: int, cubic: bool = False) -> PeriodicOrbit:
    """The steady state at 7 % with so many harmonics, with the whole pull or to its cubic term."""
    law = CubicPull(model().law.stiffness, model().gap) if cubic else model().law
    return HarmonicBalance(harmonics).solve(replace(model(), law=law),
                                            load_machine("jeffcott").speed, ECCENTRICITY)


@cache
def merging(zeta: float = 0.05, low: float = 1.5) -> float:
    """The force at which two solutions of Eq. (4.3) merge at ω = 1.4, above an amplitude."""
    found = minimize_scalar(lambda a: ((1 - 1.96) * a + 0.15 * a**3) ** 2 + (2.8 * zeta * a) ** 2,
                            bounds=(low, 3.5), method="bounded", options={"xatol": 1e-10})
    return float(np.sqrt(found.fun))


@cache
def upper_merging() -> float:
    """The force at which the other two merge."""
    a = np.linspace(0.5, 2.0, 15001)
    return float(np.sqrt((((1 - 1.96) * a + 0.15 * a**3) ** 2 + (0.14 * a) ** 2).max()))


def kept(harmonics: float) -> str:
    """What a number of harmonics leaves."""
    if harmonics != int(harmonics) or not 1 <= harmonics <= 16:
        return f"noted, but {harmonics:g} is not a whole number from 1 to 16."
    few = orbit(int(harmonics)).coefficients
    off = np.abs(few - orbit(24).coefficients[:, :few.shape[1]]).max()
    return (f"noted. At 7 % {harmonics:.0f} harmonics leave {1e6 * off:.2g} µm, with {few.size} "
            "unknowns.")


MANY, BACK = "Any number of harmonics", "Time and back"

EXERCISES = {
    "4.1": Exercise(lambda: 3 * (2 * 8 + 1), see=MANY, rtol=1e-3, mistakes=(
        Mistake(lambda right: 3 * 2 * 8, "The mean is an unknown too, one for each coordinate.",
                see=MANY),
        Mistake(lambda right: 3 * (8 + 1), "Each harmonic has a sine and a cosine.", see=MANY),
        Mistake(lambda right: 2 * (2 * 8 + 1), "There are three coordinates here.", see=MANY),
    )),
    "4.2": Exercise(lambda: 3 * 4 + 4 + 1, see=BACK, rtol=1e-3, mistakes=(
        Mistake(lambda right: 3 * 4 + 1,
                "This keeps the mean clean; the first four harmonics want more.", see=BACK),
        Mistake(lambda right: 2 * (3 * 4) + 1,
                "This finds all twelve harmonics of the force; only four are asked for.", see=BACK),
        Mistake(lambda right: right - 1,
                "With this number the twelfth harmonic still falls on the fourth.", see=BACK),
        Mistake(lambda right: 2 * 4 + 1, "This is enough for the motion, not for its cube.",
                see=BACK),
    )),
    "4.3": Exercise(lambda: 1e6 * orbit(4, True).amplitudes[0, 1], see="By hand: the rotor",
                    unit="µm", rtol=0.005, mistakes=(
        Mistake(lambda right: 1e6 * orbit(4, True).amplitudes[1, 1],
                "This is 2X in z; it is asked for in x.", see="By hand: the rotor"),
        Mistake(lambda right: 1e6 * orbit(4, True).amplitudes[0, 0], "This is 1X.",
                see="By hand: the rotor"),
        Mistake(lambda right: 1e6 * orbit(4).amplitudes[0, 1], "This is with the whole pull.",
                see="By hand: the rotor"),
        Mistake(lambda right: 2 * right, "This is peak to peak; amplitudes are 0-to-peak here.",
                see="By hand: the rotor"),
        Mistake(lambda right: right / np.sqrt(2), "This is the rms value of the harmonic.",
                see="By hand: the rotor"),
    )),
    "4.4": Exercise(merging, see="Eq. (4.3)", rtol=0.001, mistakes=(
        Mistake(lambda right: upper_merging(),
                "There the lower two merge, when the force grows; lower it."),
        Mistake(lambda right: right * right, "This is the minimum of the left side, f squared."),
        Mistake(lambda right: 0.5, "There are three at that force; go lower."),
        Mistake(lambda right: 0.14 * 2.53,
                "This is the damper alone; near, but take the whole left side."),
        Mistake(lambda right: 0.36, "Too early: a grid loses two solutions that lie between its "
                "points."),
    )),
    "4.5": Exercise(lambda: 4, see="How many harmonics", reply=kept, rubric=(
        (1, "the error of several numbers of harmonics, not of one"),
        (1, "the cost in unknowns"),
        (1, "what changes nearer to the fold"),
    )),
}
