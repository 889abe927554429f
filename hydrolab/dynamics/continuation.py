"""Pseudo-arclength continuation of any smooth curve of solutions, past its folds.

It knows only a system (y, λ) → (residual, ∂/∂y, ∂/∂λ), so it follows a circle as readily as a
rotor. ∂/∂λ may be a function without arguments that gives it: one that is dear is then asked for
once a step, near its end. After Keller (1977) and Seydel (2010).

system: that function. tolerance: of the residual. max_steps: of Newton. slope: ∂/∂λ. max_step: the
longest step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgesv
from scipy.optimize import brentq

from hydrolab.errors import NoConvergence

ParametrisedSystem = Callable[[NDArray, float],
                              tuple[NDArray, NDArray, NDArray | Callable[[], NDArray]]]


@dataclass(frozen=True)
class Step:
    """One point of a curve: unknowns, parameter, unit tangent in (y, λ), residual (an upper bound),
    iterations, ∂/∂λ as last asked for.
    """

    y: NDArray
    parameter: float
    tangent: NDArray
    residual: float
    iterations: int
    slope: NDArray | None = None


def correct(system: ParametrisedSystem, z: NDArray, tangent: NDArray, tolerance: float = 1e-10,
            max_steps: int = 8, guess: NDArray | None = None,
            slope: NDArray | None = None) -> Step | None:
    """Return to the curve within the plane through z normal to the tangent; None if Newton does not
    settle. It begins at z, or at a better guess, with ∂/∂λ as it was at a point before.

    One bordered solve with two right-hand sides gives the Newton step and the tangent at the same
    time; the new tangent points the way of the old one.
    """
    n = len(z) - 1
    bordered = np.empty((n + 1, n + 1), order="F")
    bordered[n] = tangent
    right = np.zeros((n + 1, 2), order="F")
    right[n, 1] = 1
    z0, z, fresh = z, (z if guess is None else guess).copy(), False
    for iterations in range(1, max_steps + 1):
        r, bordered[:n, :n], change = system(z[:n], z[n])
        size = math.sqrt(r @ r)
        if not math.isfinite(size):
            return None
        # after the first step the point is nearly there: good for the tangent and the last steps
        if not callable(change):
            slope = change
        elif slope is None or iterations == 2 or (size < tolerance and not fresh):
            slope, fresh = change(), True
        bordered[:n, n] = slope
        right[:n, 0] = r
        right[n, 0] = tangent @ (z - z0)
        *_, answer, singular = dgesv(bordered, right)
        if singular:
            return None
        z -= answer[:, 0]
        # the last step is taken without looking back: the bordered matrix is regular at folds
        if size < tolerance:
            new = answer[:, 1]
            long = math.sqrt(new @ new)
            if not math.isfinite(long):
                return None
            return Step(z[:n], float(z[n]), new / long, size, iterations, slope)
    return None


def arclength(system: ParametrisedSystem, y: NDArray, parameter: float, *, toward: float = 1.0,
              step: float = 0.01, max_step: float = 0.05, min_step: float = 1e-7,
              max_turn: float = 0.15, tolerance: float = 1e-10,
              longest: Callable[[Step], float] | None = None,
              held: float = math.inf) -> Iterator[Step]:
    """Walk along the curve from a point on it, yielding one `Step` after another, for ever.

    toward: sign of the first change of the parameter. step: first step along the curve, in the
    scaled norm of (y, λ). max_turn: the tangent turns less than this (rad) in a step. tolerance: of
    the residual. longest: the longest step from a point, for a curve that has more to see than its
    turns. held: share of the parameter in the tangent above which it is held in a step, so that a
    system that is dear to set up is set up once. Ends where no step down to `min_step` succeeds.
    """
    z = np.append(y, parameter)
    along = np.zeros(len(z))
    along[-1] = 1.0
    first = correct(system, z, along, tolerance)
    if first is None:
        return
    tangent = first.tangent * math.copysign(1.0, toward * first.tangent[-1])
    here, bend = replace(first, tangent=tangent), 0 * tangent
    yield here
    step = min(step, longest(here)) if longest else step
    while step >= min_step:
        z = np.append(here.y, here.parameter) + step * here.tangent
        guess, normal = z + step**2 / 2 * bend, here.tangent
        if abs(normal[-1]) > held:
            z = guess
            normal = math.copysign(1.0, normal[-1]) * along
        new = correct(system, z, normal, tolerance, guess=guess, slope=here.slope)
        turn = math.inf if new is None else math.acos(min(1.0, float(new.tangent @ here.tangent)))
        if new is None or turn > 2 * max_turn:
            step /= 2
            continue
        # how the curve bends, seen from the new point, for the guess of the next
        bend = (new.tangent - here.tangent) / step
        bend -= (bend @ new.tangent) * new.tangent
        step = min(max_step, step * min(2.0, max(0.5, 0.8 * max_turn / max(turn, 1e-9))))
        here = new
        yield here
        step = min(step, longest(here)) if longest else step


def land(system: ParametrisedSystem, before: Step, after: Step, parameter: float) -> Step | None:
    """The point between two steps with this value of the parameter; None if Newton fails there."""
    share = (parameter - before.parameter) / (after.parameter - before.parameter)
    z = np.append(before.y + share * (after.y - before.y), parameter)
    fixed = np.zeros(len(z))
    fixed[-1] = 1.0
    found = correct(system, z, fixed, max_steps=12)
    if found is None:
        return None
    return replace(found, parameter=parameter,
                   tangent=math.copysign(1.0, before.tangent[-1]) * found.tangent)


def locate_fold(system: ParametrisedSystem, before: Step, after: Step) -> Step:
    """The point between two steps where the parameter turns, λ' = 0, by a bracketed secant."""
    start = np.append(before.y, before.parameter)
    span = float(before.tangent @ (np.append(after.y, after.parameter) - start))
    points: dict[float, Step] = {0.0: before, span: after}

    def slope(s: float) -> float:
        if s not in points:
            point = correct(system, start + s * before.tangent, before.tangent, tolerance=1e-12,
                            max_steps=12)
            if point is None:
                raise NoConvergence("The curve was lost between two of its points, at parameters "
                                    f"{before.parameter:.6g} and {after.parameter:.6g}; use a "
                                    "smaller `max_step`.")
            points[s] = point
        return float(points[s].tangent[-1])

    root = brentq(slope, 0.0, span, xtol=1e-13, rtol=1e-13)
    slope(root)
    return points[root]
