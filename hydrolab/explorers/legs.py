"""Numbers for figures that move: one branch, leg by leg, ready to be asked for its orbit at any
eccentricity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.branches import follow, orbits_at
from hydrolab.dynamics.results import Branch, PeriodicOrbit
from hydrolab.dynamics.stability import Floquet, branch_stability
from hydrolab.errors import BadInput
from hydrolab.figures.orbits import curve, stretches
from hydrolab.figures.readings import verdicts
from hydrolab.machine.parts import Machine


@dataclass(frozen=True, eq=False)
class Leg:
    """A stretch of a branch between two folds (or an end): its least and greatest eccentricity, and
    its first row.
    """

    low: float
    high: float
    rows: slice

    def holds(self, eccentricity: float) -> bool:
        """Whether the leg passes this eccentricity."""
        return self.low <= eccentricity <= self.high


@dataclass(frozen=True, eq=False)
class Legs:
    """A branch that begins at zero eccentricity, cut at its folds, with the verdict on each of its
    points.
    """

    branch: Branch
    stability: Sequence[Floquet]

    @cached_property
    def all(self) -> tuple[Leg, ...]:
        """The legs in the order met, without the tail after the last fold that was asked for."""
        folds, values = self.branch.folds, self.branch.static_eccentricity
        ends = [values[0], *(fold.value for fold in folds), values[-1]]
        rows = [0, *(fold.after + 1 for fold in folds), len(values)]
        legs = [Leg(float(min(ends[i:i + 2])), float(max(ends[i:i + 2])), slice(*rows[i:i + 2]))
                for i in range(len(rows) - 1)]
        return tuple(legs[:-1] if len(folds) >= self.branch.method.max_folds else legs)

    @cached_property
    def words(self) -> list[str]:
        """"stable", "unstable" or "unknown" for each point of the branch."""
        return verdicts(self.branch, self.stability)

    def orbit(self, eccentricity: float, leg: int) -> PeriodicOrbit | None:
        """The steady state on a leg (0 is the first), or None where the leg does not pass that
        eccentricity.
        """
        if not (0 <= leg < len(self.all) and self.all[leg].holds(eccentricity)):
            return None
        passing = [i for i, other in enumerate(self.all) if other.holds(eccentricity)]
        found = orbits_at(self.branch, eccentricity)
        place = passing.index(leg)
        return found[place] if place < len(found) else None

    def verdict(self, orbit: PeriodicOrbit, leg: int) -> str:
        """The verdict on the nearest point of a leg to an orbit of it."""
        return self._verdict_at(orbit.static_eccentricity, leg)

    def _verdict_at(self, eccentricity: float, leg: int) -> str:
        rows = range(*self.all[leg].rows.indices(len(self.branch)))
        away = np.abs(self.branch.static_eccentricity[rows.start:rows.stop] - eccentricity)
        return self.words[rows.start + int(np.argmin(away))] if len(away) else "unknown"

    def stable_at(self, eccentricity: float) -> tuple[int, ...]:
        """The legs (0 is the first) that a machine can be on at an eccentricity, by their nearest
        points.
        """
        return tuple(i for i, leg in enumerate(self.all)
                     if leg.holds(eccentricity) and self._verdict_at(eccentricity, i) == "stable")

    def lines(self, number, per_branch: int = 240) -> dict[str, tuple[NDArray, NDArray]]:
        """For each verdict, eccentricity (%) and `number` of the coefficients, with nan between
        stretches.
        """
        smooth = curve(self.branch)
        pieces: dict[str, list] = {}
        for word, start, end in stretches(smooth, self.words):
            share = (end - start) / (smooth.at_points[-1] - smooth.at_points[0])
            eccentricity, coefficients = smooth(np.linspace(start, end,
                                                            8 + round(per_branch * share)))
            pieces.setdefault(word, []).append((100 * np.append(eccentricity, np.nan),
                                                np.append(number(eccentricity, coefficients),
                                                          np.nan)))
        return {word: tuple(np.concatenate(column) for column in zip(*found, strict=True))
                for word, found in pieces.items()}

    def dense(self, number, per_leg: int = 300) -> tuple[NDArray, NDArray, NDArray]:
        """Eccentricity (%), `number` of the coefficients and the leg (1 is the first), at many
        points of all legs.
        """
        smooth = curve(self.branch)
        ends = np.concatenate([[0.0], smooth.at_folds, smooth.at_points[-1:]])
        place = np.concatenate([np.linspace(*ends[i:i + 2], per_leg) for i in range(len(self.all))])
        eccentricity, coefficients = smooth(place)
        return 100 * eccentricity, number(eccentricity,
                                          coefficients), np.repeat(np.arange(len(self.all)) + 1,
                                                                   per_leg)


def legs_of(machine: Machine) -> Legs:
    """The branch of a machine at its rated speed, guarded stability and all.

    Raises BadInput for a machine without an air gap or at rest, NoConvergence where there is no
    first steady state.
    """
    if machine.air_gap is None:
        raise BadInput(f"{machine.name} has no air_gap; an explorer of its eccentricity needs one.")
    if not machine.speed > 0:
        raise BadInput("speed is 0 rad/s; an explorer of steady states needs a turning rotor.")
    with threadpool_limits(1):
        branch = follow(machine.model(), speed=machine.speed, to=0.5)
        return Legs(branch, branch_stability(branch, locate=False).points)


def round_up(value: float) -> float:
    """The next of 1, 1.5, 2, 3, 5, 7 times a power of ten."""
    if not value > 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return next(f * power for f in (1, 1.5, 2, 3, 5, 7, 10, 15) if f * power >= value * (1 - 1e-12))
