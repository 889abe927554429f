"""Chapter 4: counting unknowns and samples, a cubic pull, how many harmonics."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

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
        Mistake(lambda right: 1e6 * orbit(4).amplitudes[0, 1], "This is with the whole pull.",
                see="By hand: the rotor"),
        Mistake(lambda right: 2 * right, "This is peak to peak; amplitudes are 0-to-peak here.",
                see="By hand: the rotor"),
        Mistake(lambda right: right / np.sqrt(2), "This is the rms value of the harmonic.",
                see="By hand: the rotor"),
    )),
    "4.4": Exercise(lambda: 4, see="How many harmonics", reply=kept),
}
