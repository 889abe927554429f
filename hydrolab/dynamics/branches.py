"""Branches of steady states: their folds, their stability, and the orbits at one value.

Here residual: in N. static_eccentricity: a fraction of the gap.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from hydrolab.dynamics.continuation import correct
from hydrolab.dynamics.harmonic_balance import Condensed, HarmonicBalance
from hydrolab.dynamics.harmonics import amplitudes
from hydrolab.dynamics.paths import Path
from hydrolab.dynamics.results import PeriodicOrbit, clearances, require
from hydrolab.dynamics.solvers import newton
from hydrolab.dynamics.stability import MODES, STEPS, Floquet, floquet_all, leading
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.quantities import number, shown

if TYPE_CHECKING:
    from hydrolab.dynamics.following import Arclength

CROSSING = 1e-8  # of the distance between two points: how closely a crossing is located


@dataclass(frozen=True, eq=False)
class SpecialPoint:
    """A located point of a branch: its kind, the parameter's value there, and after which row it
    lies.

    unknowns: Y/length there. said: the value in words, with its unit.
    """

    kind: str
    value: float
    after: int
    unknowns: NDArray
    said: str = ""

    def __str__(self) -> str:
        return f"{self.kind} at {self.said or f'{self.value:.6g}'}"


@dataclass(frozen=True, eq=False)
class Branch:
    """Steady states in the order in which they were followed.

    path: the parameter followed, and the equations at any of its values. values: of the parameter,
    shape (points,). unknowns: Y/length of each point, (points, c(2m + 1)); `local` has them in
    metres. residuals: N. special_points: folds, located. stopped: why it ends, in words. method:
    how it was made. closed: whether the last point is back at the first.
    """

    path: Path
    values: NDArray
    unknowns: NDArray
    residuals: NDArray
    special_points: tuple[SpecialPoint, ...]
    stopped: str
    method: Arclength | HarmonicBalance
    closed: bool = False

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, index: int) -> PeriodicOrbit:
        if not isinstance(index, int | np.integer):
            raise BadInput(f"index is {shown(index)}; a branch gives one steady state at a time, "
                           "branch[3]. Several are [branch[k] for k in range(1, 3)].")
        return self.orbit(float(self.values[index]), self.unknowns[index],
                          float(self.residuals[index]))

    def __iter__(self) -> Iterator[PeriodicOrbit]:
        return (self[i] for i in range(len(self)))

    def orbit(self, value: float, unknowns: NDArray, residual: float) -> PeriodicOrbit:
        """The orbit with these unknowns at a value of the parameter."""
        problem = self.path.at(value)
        eq = problem.equations
        local = eq.length * unknowns.reshape(len(eq.linear), -1)
        return PeriodicOrbit(eq, problem.static_eccentricity, problem.centre, local, residual)

    @property
    def parameter(self) -> str:
        """Name of the parameter followed."""
        return self.path.parameter

    @cached_property
    def equations(self) -> Condensed:
        """The condensed equations at the first point (at every one, if only the stator moves)."""
        return self.path.at(float(self.values[0])).equations

    @cached_property
    def direction(self) -> NDArray:
        """Unit vector (x, z) of the stator's offset at the first point."""
        angle = self.path.at(float(self.values[0])).direction
        return np.array([math.sin(angle), math.cos(angle)])

    @cached_property
    def static_eccentricity(self) -> NDArray:
        """Static eccentricity of each point, fraction of the gap, shape (points,)."""
        if self.parameter == "static_eccentricity":
            return self.values
        return np.full(len(self), self.path.at(float(self.values[0])).static_eccentricity)

    @cached_property
    def centres(self) -> NDArray:
        """Stator centre at each point, m, shape (points, 2)."""
        still = self.parameter in ("speed", "field", "unbalance")
        values = self.values[:1] if still else self.values
        return np.broadcast_to([self.path.at(float(value)).centre for value in values],
                               (len(self), 2))

    @property
    def folds(self) -> tuple[SpecialPoint, ...]:
        """The folds in the order met."""
        return tuple(p for p in self.special_points if p.kind == "fold")

    @cached_property
    def stability(self) -> BranchStability:
        """The counted stability of every point and where it changes, computed when first asked."""
        return branch_stability(self)

    @property
    def flips(self) -> tuple[SpecialPoint, ...]:
        """Where a multiplier crosses −1 and a motion of twice the period leaves, in the order met.
        """
        return self.stability.flips

    @property
    def neimark_sackers(self) -> tuple[SpecialPoint, ...]:
        """Where a complex pair crosses the unit circle and a torus leaves, in the order met."""
        return self.stability.neimark_sackers

    def at_fold(self, number: int = 0) -> PeriodicOrbit:
        """The steady state at a fold (0 is the first).

        Raises BadInput where the branch has no such fold.
        """
        if not -len(self.folds) <= number < len(self.folds):
            raise BadInput(f"number is {number}; this branch has {len(self.folds) or 'no'} fold"
                           f"{'s' * (len(self.folds) != 1)}, counted from 0. {self.stopped}")
        fold = self.folds[number]
        problem = self.path.at(fold.value)
        eq = problem.equations
        residual = eq.newtons(eq.residual(fold.unknowns, problem.centre))
        return self.orbit(fold.value, fold.unknowns, residual)

    @property
    def first_leg(self) -> slice:
        """Rows from the start up to the first fold (all rows if there is none)."""
        return slice(0, self.folds[0].after + 1 if self.folds else len(self))

    @cached_property
    def local(self) -> NDArray:
        """[mean, sin 1, cos 1, …] of all c nonlinear coordinates at every point, m or rad, shape
        (points, c, 2m + 1); the generator's x and z are first.
        """
        eq = self.equations
        return eq.length * self.unknowns.reshape(len(self), len(eq.linear), -1)

    @property
    def coefficients(self) -> NDArray:
        """[mean, sin 1, cos 1, …] of the generator centre, m, (points, 2, 2m + 1)."""
        return self.local[:, :2]

    @cached_property
    def smallest_gaps(self) -> NDArray:
        """Smallest air gap over the period and the circumference at every point, m, (points,)."""
        if self.parameter in ("static_eccentricity", "direction"):
            eq, many = self.equations, range(0, len(self), 16)  # at once: laws may need the memory
            return np.concatenate([clearances(eq, self.local[i:i + 16], self.centres[i:i + 16])
                                   .min(axis=1) for i in many])
        return np.array([orbit.smallest_gap for orbit in self])

    @cached_property
    def amplitudes(self) -> NDArray:
        """√(A_k² + B_k²) of x and z at every point, m 0-to-peak, shape (points, 2, m)."""
        return amplitudes(self.coefficients)

    def __str__(self) -> str:
        say = self.path.say
        folds = ", ".join(say(f.value, 5) for f in self.folds) or "none"
        return (f"Branch of {self.equations.model.name} along {self.parameter}, {len(self)} points "
                f"from {say(self.values[0])} to {say(self.values[-1])}; folds: {folds}. "
                f"{self.stopped}")


@dataclass(frozen=True, eq=False)
class BranchStability:
    """The stability of every point of a branch, and where it changes.

    points: one `Floquet` for each row of the branch. crossings: flips and Neimark–Sacker points
    located on the branch (folds are the branch's own), the latter with the multiplier's angle from
    the positive real axis in `kind`. lost: between which values there is another, in words.
    """

    points: tuple[Floquet, ...]
    crossings: tuple[SpecialPoint, ...]
    lost: tuple[str, ...] = ()

    @property
    def verdicts(self) -> tuple[str, ...]:
        """"stable", "unstable" or "unknown" for each point."""
        return tuple(p.verdict for p in self.points)

    @property
    def flips(self) -> tuple[SpecialPoint, ...]:
        """Where a multiplier crosses −1, in the order met."""
        return tuple(c for c in self.crossings if c.kind == "flip")

    @property
    def neimark_sackers(self) -> tuple[SpecialPoint, ...]:
        """Where a complex pair crosses the unit circle, in the order met."""
        return tuple(c for c in self.crossings if c.kind != "flip")

    def __str__(self) -> str:
        counts = ", ".join(f"{self.verdicts.count(v)} {v}"
                           for v in ("stable", "unstable", "unknown"))
        where = "; ".join([*map(str, self.crossings), *self.lost]) or "none"
        quick = " at a quick look" if any(p.how == "quick" for p in self.points) else ""
        return (f"{counts} of {len(self.points)} points{quick}; stability changes away from folds: "
                f"{where}")


def branch_stability(branch: Branch, modes: int = MODES, steps: int = STEPS, *,
                     quick: bool = False, locate: bool = True) -> BranchStability:
    """Floquet multipliers of every point of a branch in one batch, and where stability changes
    between them.

    modes, steps, quick: as in `floquet_all`. locate: find flips and Neimark–Sacker points where the
    number of multipliers outside the unit circle changes. Raises BadInput for what is no branch.
    """
    require("branch", branch, Branch)
    points = floquet_all(list(branch), modes, steps, quick=quick)
    if not locate:
        return BranchStability(tuple(points), ())
    # at a fold one multiplier crosses 1, and at a flip in which a branch begins or ends one is 1
    known = {min(p.after, len(branch) - 2) for p in branch.special_points}
    crossings, lost = [], []
    for i, (a, b) in enumerate(pairwise(points)):
        few, many = sorted((a.outside, b.outside))
        if "unknown" not in (a.verdict, b.verdict) and many - few > (i in known):
            try:
                crossings += _locate(branch, i, range(few, many), modes)
            except NoConvergence:
                first, last = (branch.path.say(branch.values[j]) for j in (i, i + 1))
                lost.append(f"not located, between {first} and {last}")
    return BranchStability(tuple(points), tuple(crossings), tuple(lost))


def _locate(branch: Branch, i: int, places: range, modes: int) -> list[SpecialPoint]:
    """Where between rows i and i + 1 the multipliers at places, by size, cross the unit circle."""
    scale, system = branch.path.scale, branch.path.system()
    first, last = (np.append(branch.unknowns[j], branch.values[j] / scale) for j in (i, i + 1))
    length = float(np.linalg.norm(last - first))
    along = (last - first) / length

    @cache
    def at(s: float) -> tuple[NDArray, NDArray]:
        """A point of the branch between the two, and its multipliers."""
        step = correct(system, first + s * along, along)
        if step is None:
            raise NoConvergence(f"The branch was lost after its point {i}; use a smaller "
                                "`max_step`.")
        orbit = branch.orbit(step.parameter * scale, step.y, step.residual)
        return np.append(step.y, step.parameter), leading(orbit, modes)

    def margin(s: float, place: int) -> float:
        return float(abs(at(s)[1][place])) - 1

    found: list[SpecialPoint] = []
    for place in places:
        if not margin(0.0, place) * margin(length, place) < 0:
            continue  # not so when looked at more finely
        point, values = at(brentq(margin, 0.0, length, args=(place,), xtol=CROSSING * length))
        mu = values[place]
        real = abs(mu.imag) < 1e-6
        if (real and mu.real > 0) or any(abs(p.value - point[-1] * scale) < 10 * CROSSING * scale
                                         for p in found):
            continue  # a fold, which the branch has; or the other of a pair
        angle = math.degrees(abs(np.angle(mu)))
        kind = "flip" if real else f"Neimark–Sacker, {angle:.1f}° a revolution,"
        value = float(point[-1]) * scale
        found.append(SpecialPoint(kind, value, i, point[:-1], branch.path.say(value, 5)))
    return found


def orbits_at(branch: Branch, value: float) -> list[PeriodicOrbit]:
    """Every steady state of a branch at one value of its parameter, in the order met: one for each
    leg that passes it.

    Each starts from the straight line between the two neighbouring points and is solved to the full
    accuracy. Raises BadInput for what is no branch or no value of its parameter.
    """
    require("branch", branch, Branch)
    problem = branch.path.at(number("value", value, unit=branch.path.unit.removeprefix("%")))
    eq, centre = problem.equations, problem.centre
    # With the folds put in, no leg is missed between the last point before a fold and the fold
    # itself.
    values, unknowns = branch.values, branch.unknowns
    if branch.folds:
        after = [fold.after + 1 for fold in branch.folds]
        values = np.insert(values, after, [fold.value for fold in branch.folds])
        unknowns = np.insert(unknowns, after, [fold.unknowns for fold in branch.folds], axis=0)
    away = values - value
    found = []
    for i in np.flatnonzero((away[:-1] * away[1:] < 0) | (away[:-1] == 0)):
        share = away[i] / (away[i] - away[i + 1])
        solution = newton(lambda y: eq.linearise(y, centre),
                          (1 - share) * unknowns[i] + share * unknowns[i + 1])
        if solution.converged:
            residual = eq.newtons(solution.residual)
            eq.require_balance(solution.y, centre, residual)
            found.append(branch.orbit(value, solution.y, residual))
    if away[-1] == 0:
        found.append(branch[-1])
    return found


def stable_orbits_at(branch: Branch, static_eccentricity: float) -> list[PeriodicOrbit]:
    """The stable steady states of a branch at one eccentricity."""
    orbits = orbits_at(branch, static_eccentricity)
    return [o for o, f in zip(orbits, floquet_all(orbits), strict=True) if f.verdict == "stable"]
