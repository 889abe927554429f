"""Pseudo-arclength continuation of any smooth curve of solutions, past its folds.

`arclength` and `locate_fold` know only a system (y, λ) → (residual, ∂/∂y, ∂/∂λ), so they follow a circle as
readily as a rotor. `follow` puts a model into that form. After Keller (1977) and Seydel (2010).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgesv
from scipy.optimize import brentq

from hydrolab.dynamics.condensation import Condensed
from hydrolab.dynamics.harmonic_balance import HarmonicBalance, orbit_from
from hydrolab.dynamics.results import Branch, PeriodicOrbit, SpecialPoint
from hydrolab.dynamics.solvers import newton
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.model import Model

ParametrisedSystem = Callable[[NDArray, float], tuple[NDArray, NDArray, NDArray]]


@dataclass(frozen=True)
class Step:
    """One point of a curve: unknowns, parameter, unit tangent in (y, λ), residual (an upper bound), iterations."""

    y: NDArray
    parameter: float
    tangent: NDArray
    residual: float
    iterations: int


def correct(system: ParametrisedSystem, z: NDArray, tangent: NDArray, tolerance: float = 1e-10,
            max_steps: int = 8) -> Step | None:
    """Return to the curve within the plane through z normal to the tangent; None if Newton does not settle.

    One bordered solve with two right-hand sides gives the Newton step and the tangent at the same time; the new
    tangent points the way of the old one.
    """
    n = len(z) - 1
    bordered = np.empty((n + 1, n + 1), order="F")
    bordered[n] = tangent
    right = np.zeros((n + 1, 2), order="F")
    right[n, 1] = 1
    z0, z = z, z.copy()
    for iterations in range(1, max_steps + 1):
        r, bordered[:n, :n], bordered[:n, n] = system(z[:n], z[n])
        size = math.sqrt(r @ r)
        if not math.isfinite(size):
            return None
        right[:n, 0] = r
        right[n, 0] = tangent @ (z - z0)
        *_, answer, singular = dgesv(bordered, right)
        if singular:
            return None
        z -= answer[:, 0]
        if size < tolerance:  # the last step is taken without looking back: the bordered matrix is regular at folds
            new = answer[:, 1]
            return Step(z[:n], float(z[n]), new / math.sqrt(new @ new), size, iterations)
    return None


def arclength(system: ParametrisedSystem, y: NDArray, parameter: float, *, toward: float = 1.0, step: float = 0.01,
              max_step: float = 0.05, min_step: float = 1e-7, max_turn: float = 0.15) -> Iterator[Step]:
    """Walk along the curve from a point on it, yielding one `Step` after another, for ever.

    toward: sign of the first change of the parameter. step: first step along the curve, in the scaled norm of
    (y, λ). max_turn: the tangent turns less than this (rad) in a step. Ends where no step down to `min_step` succeeds.
    """
    z = np.append(y, parameter)
    along = np.zeros(len(z))
    along[-1] = 1.0
    first = correct(system, z, along)
    if first is None:
        return
    tangent = first.tangent * math.copysign(1.0, toward * first.tangent[-1])
    here = replace(first, tangent=tangent)
    yield here
    while step >= min_step:
        z = np.append(here.y, here.parameter)
        new = correct(system, z + step * here.tangent, here.tangent)
        turn = math.inf if new is None else math.acos(min(1.0, float(new.tangent @ here.tangent)))
        if new is None or turn > 2 * max_turn:
            step /= 2
            continue
        step = min(max_step, step * min(2.0, max(0.5, 0.8 * max_turn / max(turn, 1e-9))))
        here = new
        yield here


def locate_fold(system: ParametrisedSystem, before: Step, after: Step) -> Step:
    """The point between two steps where the parameter turns: λ' = 0 along the curve, by a bracketed secant."""
    start = np.append(before.y, before.parameter)
    span = float(before.tangent @ (np.append(after.y, after.parameter) - start))
    points: dict[float, Step] = {0.0: before, span: after}

    def slope(s: float) -> float:
        if s not in points:
            point = correct(system, start + s * before.tangent, before.tangent, tolerance=1e-12, max_steps=12)
            if point is None:
                raise NoConvergence("The curve was lost between two of its points, at parameters "
                                    f"{before.parameter:.6g} and {after.parameter:.6g}; use a smaller `max_step`.")
            points[s] = point
        return float(points[s].tangent[-1])

    root = brentq(slope, 0.0, span, xtol=1e-13, rtol=1e-13)
    slope(root)
    return points[root]


@dataclass(frozen=True)
class Arclength:
    """How a branch is followed: harmonic balance, step sizes (scaled by the gap), and when to stop.

    max_folds: stop after this many folds and a tail of `tail` points. smallest_gap: stop when less than this
    fraction of the nominal gap is left.
    """

    balance: HarmonicBalance = field(default_factory=HarmonicBalance)
    step: float = 0.002
    max_step: float = 0.02
    max_turn: float = 0.15
    max_points: int = 1000
    max_folds: int = 3
    tail: int = 10
    smallest_gap: float = 0.0

    def __post_init__(self) -> None:
        for key in ("step", "max_step", "max_turn"):
            if not (math.isfinite(getattr(self, key)) and getattr(self, key) > 0):
                raise BadInput(f"{key} is {getattr(self, key)!r}; it must be a positive number.")
        for key, least in (("max_points", 2), ("max_folds", 1), ("tail", 0)):
            if not isinstance(getattr(self, key), int) or getattr(self, key) < least:
                raise BadInput(f"{key} is {getattr(self, key)!r}; it must be a whole number of at least {least}.")
        if not 0 <= self.smallest_gap < 1:
            raise BadInput(f"smallest_gap is {self.smallest_gap!r}; it is a fraction of the gap, from 0 to below 1.")


def eccentricity_system(eq: Condensed, direction: NDArray) -> ParametrisedSystem:
    """The harmonic balance as a system in the static eccentricity (fraction of the gap) along a unit vector."""
    offset = np.zeros((2, eq.linear.shape[1]))
    offset[:, 0] = direction * eq.model.gap / eq.length
    offset, unit = offset.ravel(), eq.model.gap * direction

    def system(y: NDArray, eccentricity: float) -> tuple[NDArray, NDArray, NDArray]:
        r, jacobian = eq.linearise(y, eccentricity * unit)
        # Moving the stator is moving the mean the other way, but only in the pull: Λ − ∂H/∂Y is ∂Z/∂Y.
        return r, jacobian, (eq.stiffness - jacobian) @ offset

    return system


def follow(model: Model, parameter: str = "static_eccentricity", *, to: float = 0.2, speed: float,
           method: Arclength | None = None, start: PeriodicOrbit | None = None,
           direction: float = math.pi / 2) -> Branch:
    """Follow the steady states from `start` (by default at zero eccentricity) along a parameter, past folds.

    Ends at `to`, at contact, back at the start value, after the third fold and a short tail, or after max_points;
    `branch.stopped` says which. parameter: "static_eccentricity", a fraction of the gap.
    Raises BadInput, or NoConvergence where there is no first steady state.
    """
    method = method or Arclength()
    if parameter != "static_eccentricity":
        raise BadInput(f"parameter is {parameter!r}; the one that can be followed is 'static_eccentricity'.")
    if not math.isfinite(model.gap):
        raise BadInput(f"{model.name} has no air gap, so there is no static eccentricity to follow.")
    if not (math.isfinite(to) and abs(to) < 1):
        raise BadInput(f"to is {to!r}; it is a fraction of the gap between -1 and 1 (12 % is 0.12).")
    origin = start or method.balance.solve(model, speed, 0.0, direction=direction)
    eq, first = method.balance.equations(model, speed), origin.static_eccentricity
    if to == first:
        raise BadInput(f"to is {to:g}, where the branch starts; give another end.")
    unit = np.array([math.sin(direction), math.cos(direction)])
    system = eccentricity_system(eq, unit)
    steps: list[Step] = []
    special: list[SpecialPoint] = []
    forward = math.copysign(1.0, to - first)
    left = method.tail
    y0 = origin.coefficients.ravel() / eq.length
    if origin.harmonics != eq.harmonics:
        raise BadInput(f"start has {origin.harmonics} harmonics, the method {eq.harmonics}; they must be the same.")
    for point in arclength(system, y0, first, toward=forward, step=method.step, max_step=method.max_step,
                           max_turn=method.max_turn):
        if steps and point.tangent[-1] * steps[-1].tangent[-1] < 0:
            fold = locate_fold(system, steps[-1], point)
            special.append(SpecialPoint("fold", fold.parameter, len(steps) - 1, fold.y))
        steps.append(point)
        position = point.y.reshape(2, -1) @ eq.synthesis - (point.parameter * model.gap * unit)[:, None]
        gap = float(np.min(model.law.smallest_gap(position))) / model.length_scale
        if gap <= method.smallest_gap:
            stopped = (f"The smallest gap is down to {100 * gap:.3g} % of the nominal one at "
                       f"{100 * point.parameter:.4g} %." if gap > 0 else
                       f"The rotor touches the stator at {100 * point.parameter:.4g} %.")
        elif forward * (point.parameter - to) >= 0:
            stopped = f"It reached {100 * to:.4g} % as asked."
        elif len(steps) > 2 and forward * (point.parameter - first) <= 0:
            stopped = f"It came back to {100 * first:.4g} %, where it began."
        elif len(steps) >= method.max_points:
            stopped = f"It has the {method.max_points} points that were allowed."
        elif len(special) >= method.max_folds and (left := left - 1) < 0:
            stopped = f"It passed {len(special)} folds, as many as were asked for."
        else:
            continue
        break
    else:
        if not steps:
            raise NoConvergence(f"No branch begins at the given start, {100 * first:.4g} %: it is no steady state of "
                                f"{model.name} at {speed:.4g} rad/s. Solve for one with HarmonicBalance.")
        stopped = f"No further point was found near {100 * steps[-1].parameter:.4g} %, down to the smallest step."
    return Branch(eq, unit, np.array([s.parameter for s in steps]), np.array([s.y for s in steps]),
                  np.array([s.residual for s in steps]) * eq.force, tuple(special), stopped, method)


def orbits_at(branch: Branch, static_eccentricity: float) -> list[PeriodicOrbit]:
    """Every steady state of a branch at one eccentricity, in the order met: one for each leg that passes it.

    Each starts from the straight line between the two neighbouring points and is solved to the full accuracy.
    """
    eq = branch.equations
    centre = static_eccentricity * eq.model.gap * branch.direction
    # With the folds put in, no leg is missed between the last point before a fold and the fold itself.
    after = [fold.after + 1 for fold in branch.folds]
    values = np.insert(branch.static_eccentricity, after, [fold.value for fold in branch.folds])
    unknowns = np.insert(branch.unknowns, after, [fold.unknowns for fold in branch.folds], axis=0) if after else (
        branch.unknowns)
    away = values - static_eccentricity
    found = []
    for i in np.flatnonzero((away[:-1] * away[1:] < 0) | (away[:-1] == 0)):
        share = away[i] / (away[i] - away[i + 1])
        solution = newton(lambda y: eq.linearise(y, centre), (1 - share) * unknowns[i] + share * unknowns[i + 1])
        if solution.converged:
            found.append(orbit_from(eq, static_eccentricity, centre, solution))
    if away[-1] == 0:
        found.append(branch[-1])
    return found
