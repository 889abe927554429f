"""All steady states that can be found at one eccentricity, and branches that leave others.

No method finds all solutions of a nonlinear system. `steady_states` uses three that fail in
different ways, and says what was searched: a branch finds what hangs together with the centred
machine, Newton's method from many starts what does not, once what is known is taken out of the
system (deflation: Farrell, Birkisson and Funke 2015), and continuation in the field and the
unbalance what hangs together elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from hydrolab.dynamics.branches import (
    Branch,
    BranchStability,
    SpecialPoint,
    orbits_at,
)
from hydrolab.dynamics.continuation import correct
from hydrolab.dynamics.following import Arclength, follow, walk
from hydrolab.dynamics.harmonic_balance import Condensed, HarmonicBalance, first_guess
from hydrolab.dynamics.harmonics import from_complex, to_complex
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.solvers import System, newton
from hydrolab.dynamics.stability import Floquet, floquet_all
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.model import Model
from hydrolab.machine.quantities import number, whole

APART = 1e-4  # of the gap: motions that are nearer to each other are one
NUDGE = 0.01  # of the gap: how far from a flip the doubled branch is begun
REACHES = (0.25, 2.0)  # factors on the field and the unbalance between which they are followed


# ------------------------------------------------------------------ what leaves at a flip

def branch_off(branch: Branch, point: SpecialPoint, *,
               method: Arclength | None = None) -> tuple[Branch, BranchStability]:
    """The branch of motions of twice the period that begins in a flip, and its stability.

    branch: on which the flip lies. point: the flip, one of `branch.flips`.
    method: step sizes and limits; its harmonic balance is replaced by one of twice the harmonics of
    the branch in twice the period. The branch begins in the flip, with its `special_points` and
    ends in another flip, where the two halves of the motion become the same, at contact or closed.
    Raises BadInput for a point that is no flip, NoConvergence where nothing branches off.
    """
    if point.kind != "flip":
        raise BadInput(f"point is a {point.kind} at {point.said}; branches of twice the period "
                       "leave at flips.")
    own, here = branch.path.balance, branch.path.here
    balance = replace(own, harmonics=2 * own.harmonics, samples=2 * own.aft_samples,
                      revolutions=2 * own.revolutions)
    along = replace(branch.path, balance=balance, here=replace(here, equations=balance.equations(
        here.equations.model, here.equations.speed)))
    problem, system = along.at(point.value), along.system()
    eq = problem.equations
    y = first_guess(eq, branch.orbit(point.value, point.unknowns, 0.0))
    odd = _odd(eq)
    # the motion with a multiplier of −1 is the null vector in the harmonics of half the frequency
    jacobian = eq.linearise(y, problem.centre)[1]
    away = np.zeros(len(y) + 1)
    away[:-1][odd] = np.linalg.svd(jacobian[np.ix_(odd, odd)])[2][-1]
    at = np.append(y, point.value / along.scale)
    begun = correct(system, at + NUDGE * away, away, max_steps=20)
    if begun is None or np.abs(begun.y[odd]).max() < NUDGE / 10:
        raise NoConvergence(f"No motion of twice the period was found beside the {point}.")
    method = replace(method or Arclength(), balance=balance, past_start=True, max_folds=1000)
    first = begun.parameter * along.scale
    place = along.at(first)
    start = PeriodicOrbit(place.equations, place.static_eccentricity, place.centre,
                          eq.length * begun.y.reshape(eq.linear.shape), begun.residual * eq.force)
    # the other half of the loop is the same motions half a period later
    onward = math.copysign(math.inf, first - point.value)
    half = walk(replace(along, first=first), start, onward, method, until=lambda a, b: bool(
        a.y[odd] @ b.y[odd] < 0))
    found = _from_flip_to_flip(replace(half, path=along), odd, point, y)
    return found, found.stability


def _odd(eq: Condensed) -> NDArray:
    """Places in the unknowns of the harmonics that change sign in half a period."""
    k = (np.arange(eq.linear.shape[1]) + 1) // 2
    return np.flatnonzero(np.tile(k % 2 == 1, len(eq.linear)))


def _from_flip_to_flip(loop: Branch, odd: NDArray, point: SpecialPoint, y: NDArray) -> Branch:
    """A branch of twice the period from the flip, unknowns y, to one in its last step, if any."""
    ends = len(loop) > 1 and bool(loop.unknowns[-2, odd] @ loop.unknowns[-1, odd] < 0)
    rows = len(loop) - ends
    values, unknowns = [point.value, *loop.values[:rows]], [y[None], loop.unknowns[:rows]]
    special = [replace(point, after=0, unknowns=y),
               *(replace(p, after=p.after + 1) for p in loop.folds if p.after < rows)]
    stopped = loop.stopped
    if ends:
        value, there = _flip_after(loop, odd, rows - 1)
        said = loop.path.say(value, 5)
        stopped = f"It ends in a flip at {said}, where both halves of the motion become the same."
        special.append(SpecialPoint("flip", value, rows, there, said))
        values.append(value)
        unknowns.append(there[None])
    residuals = np.full(len(values), loop.residuals.max())
    residuals[1:rows + 1] = loop.residuals[:rows]
    return replace(loop, values=np.array(values), unknowns=np.concatenate(unknowns),
                   residuals=residuals, special_points=tuple(special), stopped=stopped)


def _flip_after(loop: Branch, odd: NDArray, row: int) -> tuple[float, NDArray]:
    """The flip after a row at which the odd harmonics pass through 0: its value and unknowns.

    Two branches cross there, so it is sought on the one without odd harmonics: where their block of
    the Jacobian, bordered by the motion that dies out, is singular.
    """
    a, b = loop.unknowns[row], loop.unknowns[row + 1]
    dying = a[odd] / np.linalg.norm(a[odd])
    share = (dying @ a[odd]) / (dying @ (a - b)[odd])
    known, guess = a + share * (b - a), loop.values[row] + share * np.diff(loop.values)[row]
    even = np.setdiff1d(np.arange(len(a)), odd)
    bordered = np.zeros((len(odd) + 1,) * 2)
    bordered[-1, :-1] = bordered[:-1, -1] = dying
    points: dict[float, NDArray] = {}

    def singular(value: float) -> float:
        problem = loop.path.at(value)

        def shorter(part: NDArray) -> tuple[NDArray, NDArray]:
            y = np.zeros(len(a))
            y[even] = part
            residual, jacobian = problem.equations.linearise(y, problem.centre)
            bordered[:-1, :-1] = jacobian[np.ix_(odd, odd)]
            return residual[even], jacobian[np.ix_(even, even)]

        found = newton(shorter, known[even])
        shorter(found.y)
        points[value] = np.zeros(len(a))
        points[value][even] = found.y
        return float(np.linalg.solve(bordered, np.eye(len(bordered))[-1])[-1])

    width = 1e-6 * loop.path.scale
    while singular(guess - width) * singular(guess + width) > 0:
        width *= 2
        if width > 0.05 * loop.path.scale:
            raise NoConvergence(f"No flip was found near {loop.path.say(guess)}, where the two "
                                "halves of the motion become the same.")
    value = brentq(singular, guess - width, guess + width, xtol=1e-12 * loop.path.scale)
    singular(value)
    return value, points[value]


# ------------------------------------------------------------------ all that can be found

@dataclass(frozen=True, eq=False)
class SteadyStates:
    """Steady states at one speed and eccentricity, sorted by their mean displacement.

    orbits, stability: one for each. searched: what was searched, in words.
    """

    orbits: tuple[PeriodicOrbit, ...]
    stability: tuple[Floquet, ...]
    searched: str

    def __len__(self) -> int:
        return len(self.orbits)

    def __getitem__(self, index: int) -> PeriodicOrbit:
        return self.orbits[index]

    @property
    def stable(self) -> tuple[PeriodicOrbit, ...]:
        """Those on which a machine can stay."""
        return tuple(o for o, f in zip(self.orbits, self.stability, strict=True)
                     if f.verdict == "stable")

    def __str__(self) -> str:
        lines = [f"{len(self)} steady state{'s' * (len(self) != 1)} found. {self.searched}"]
        for orbit, found in zip(self.orbits, self.stability, strict=True):
            x, z = 1e6 * orbit.amplitudes[:, orbit.revolutions - 1]
            gap = (f", smallest gap {1e3 * orbit.smallest_gap:.3f} mm"
                   if math.isfinite(orbit.smallest_gap) else "")
            lines.append(f"mean {1e6 * np.hypot(*orbit.mean):.0f} µm, 1X {x:.3g}/{z:.3g} µm{gap}; "
                         f"{found}")
        return "\n  ".join(lines)


def steady_states(model: Model, *, speed: float, static_eccentricity: float = 0.0,
                  direction: float = math.pi / 2, revolutions: int = 1,
                  method: Arclength | None = None, starts: int = 40, seed: int = 0) -> SteadyStates:
    """All steady states that branches, deflated Newton and continuation find.

    speed: rad/s. static_eccentricity: fraction of the gap. direction: gap angle of the offset, rad.
    revolutions: of the period; only motions that do not repeat sooner are counted, and one that is
    the same a revolution later is one. method: how branches are followed, by default with 8
    harmonics of the rotation, to contact, closure or the start. starts: random starts (`seed`) of
    Newton's method. `searched` says what was done; there may be others. Raises BadInput for
    arguments outside what is allowed.
    """
    whole("revolutions", revolutions, 1, 8)
    whole("starts", starts, 0)
    number("static_eccentricity", static_eccentricity)
    method = method or Arclength(HarmonicBalance(8 * revolutions, revolutions=revolutions),
                                 max_points=3000)
    search = _Search(model, speed, static_eccentricity, direction,
                     replace(method, past_start=True, max_folds=1000))
    said = []
    if math.isfinite(model.gap):
        said.append(search.along_eccentricity() if revolutions == 1 else search.through_flips())
    said.append(search.deflated(starts, np.random.default_rng(seed)))
    if math.isfinite(model.gap):
        said.append(search.continued())
    orbits = sorted(search.found, key=lambda o: float(np.hypot(*o.mean)))
    return SteadyStates(tuple(orbits), tuple(floquet_all(orbits)),
                        f"Searched: {'; '.join(said)}. There may be others.")


class _Search:
    """What has been found at one place, and the ways to find more."""

    def __init__(self, model: Model, speed: float, eccentricity: float, direction: float,
                 method: Arclength) -> None:
        self.model, self.speed, self.eccentricity = model, speed, eccentricity
        self.direction, self.method = direction, method
        self.eq = method.balance.equations(model, speed)
        self.centre = model.centre(eccentricity, direction)
        self.found: list[PeriodicOrbit] = []

    def unknowns(self) -> Iterator[NDArray]:
        """Those of all that was found, begun at each revolution of the period."""
        q = self.eq.revolutions
        for orbit in self.found:
            amplitudes = to_complex(orbit.local)
            k = np.arange(amplitudes.shape[1])
            for turn in range(q):
                later = from_complex(amplitudes * np.exp(2j * math.pi * k * turn / q))
                yield later.ravel() / self.eq.length

    def add(self, orbits: Sequence[PeriodicOrbit]) -> int:
        """Keep those that are new, clear of the stator and of this period; how many."""
        before = len(self.found)
        for orbit in orbits:
            y, q = orbit.local.ravel() / self.eq.length, self.eq.revolutions
            k = (np.arange(orbit.local.shape[1]) + 1) // 2
            own = np.abs(orbit.local[:, k % q != 0]).max(initial=0.0) / self.eq.length
            if ((q == 1 or own > APART) and orbit.smallest_gap > 0
                    and all(np.abs(y - known).max() > APART for known in self.unknowns())):
                self.found.append(orbit)
        return len(self.found) - before

    def both_ways(self, parameter: str, ends: Sequence[float], value: float,
                  **start: Any) -> list[tuple[Branch, list[PeriodicOrbit]]]:
        """Branches along a parameter in both directions, and their orbits at a value of it."""
        branches = []
        for to in ends:
            try:
                branch = follow(self.model, parameter, to=to, speed=self.speed,
                                direction=self.direction, method=self.method, **start)
            except (NoConvergence, Contact):
                continue
            branches.append((branch, orbits_at(branch, value)))
            if branch.closed:
                break
        return branches

    def along_eccentricity(self) -> str:
        """The branch through the centred machine."""
        found = self.both_ways("static_eccentricity", (0.99, -0.99), self.eccentricity)
        new = self.add([o for _, orbits in found for o in orbits])
        folds = sum(len(branch.folds) for branch, _ in found)
        end = found[-1][0].stopped if found else "There is none."
        return (f"the branch through 0 %, both ways, {folds} folds, finds {new} "
                f"({end.rstrip('.')})")

    def through_flips(self) -> str:
        """Branches of twice the period that leave the branch of half of it."""
        q, own = self.eq.revolutions, self.method.balance
        if q % 2:
            return f"no branch leads to motions of {q} revolutions"
        half = replace(self.method, past_start=False,
                       balance=replace(own, harmonics=own.harmonics // 2, samples=None,
                                       revolutions=q // 2))
        branch = follow(self.model, to=math.copysign(0.99, self.eccentricity), speed=self.speed,
                        direction=self.direction, method=half)
        new = 0
        for flip in branch.flips:
            with suppress(NoConvergence):
                new += self.add(orbits_at(branch_off(branch, flip, method=half)[0],
                                          self.eccentricity))
        return (f"the branches that leave {len(branch.flips)} flips of the branch through 0 % find "
                f"{new}")

    def deflated(self, starts: int, random: np.random.Generator) -> str:
        """Newton's method from random starts, with what is known divided out."""
        eq, room = self.eq, min(self.model.gap / self.model.length_scale, 1.0)
        columns, new = eq.linear.shape[1], 0
        for _ in range(starts):
            y = np.zeros_like(eq.linear)
            live = [0, *range(1, min(columns, 2 * eq.revolutions + 1))]
            y[:, live] = 0.5 * room * random.uniform(-1, 1) * random.uniform(
                -1, 1, (len(y), len(live)))
            y[:2, 0] += self.centre / eq.length
            known = list(self.unknowns())
            near = newton(deflate(lambda y: eq.linearise(y, self.centre), known), y.ravel(),
                          max_steps=60).y
            solution = self.method.balance.from_guess(eq, self.centre, near)
            if solution.converged:
                residual = eq.newtons(solution.residual)
                new += self.add([PeriodicOrbit(eq, self.eccentricity, self.centre, eq.length
                                               * solution.y.reshape(eq.linear.shape), residual)])
        return f"{starts} starts of Newton's method with these divided out find {new}"

    def continued(self) -> str:
        """Each orbit followed along field, unbalance and eccentricity, until none is new."""
        new, done = 0, 0
        while done < len(self.found):
            orbit = self.found[done]
            done += 1
            for parameter, ends, value in (("field", REACHES, 1.0), ("unbalance", REACHES, 1.0),
                                           ("static_eccentricity", (0.99, -0.99),
                                            self.eccentricity)):
                for _, orbits in self.both_ways(parameter, ends, value, start=orbit):
                    new += self.add(orbits)
        return f"from all of them along field, unbalance and eccentricity: {new} more"


def deflate(system: System, known: Sequence[NDArray]) -> System:
    """A system without the solutions that are known: its residual times ∏ (1 + 1/|y − known|²)."""
    def deflated(y: NDArray) -> tuple[NDArray, NDArray]:
        residual, jacobian = system(y)
        factor, slope = 1.0, np.zeros(len(y))
        for solution in known:
            away = y - solution
            far = away @ away
            slope -= 2 * away / (far * (far + 1))  # that of the logarithm
            factor *= 1 + 1 / far
        return factor * residual, factor * (jacobian + np.outer(residual, slope))

    return deflated
