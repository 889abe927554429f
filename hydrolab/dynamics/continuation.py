"""Branches of steady states, followed past their folds along any parameter of a model."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.arclength import Step, arclength, correct, land, locate_fold
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.parameters import path
from hydrolab.dynamics.problems import Path
from hydrolab.dynamics.results import Branch, PeriodicOrbit, SpecialPoint
from hydrolab.dynamics.solvers import newton
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.checks import number, whole
from hydrolab.machine.forces import CircularPull
from hydrolab.machine.model import Model

__all__ = ["Arclength", "Step", "arclength", "correct", "follow", "locate_fold", "orbits_at", "sweep"]
CLOSED = 1e-3  # a branch that comes this near its first point, in the scaled norm along the way, is closed


@dataclass(frozen=True)
class Arclength:
    """How a branch is followed: harmonic balance, step sizes (scaled by the gap), and when to stop.

    max_folds: stop after this many folds and a tail of `tail` points. smallest_gap: stop when less than this
    fraction of the nominal gap is left. past_start: go on past the start value, to find a branch that closes.
    """

    balance: HarmonicBalance = field(default_factory=HarmonicBalance)
    step: float = 0.002
    max_step: float = 0.02
    max_turn: float = 0.15
    max_points: int = 1000
    max_folds: int = 3
    tail: int = 10
    smallest_gap: float = 0.0
    past_start: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.balance, HarmonicBalance):
            raise BadInput(f"balance is {self.balance!r}; it must be a HarmonicBalance.")
        for key in ("step", "max_step", "max_turn"):
            if number(key, getattr(self, key), above=0) > 1:
                raise BadInput(f"{key} is {getattr(self, key):g}; at most 1 is allowed, "
                               f"{'a radian' if key == 'max_turn' else 'the whole gap'}, and far less is usual.")
        for key, least in (("max_points", 2), ("max_folds", 1), ("tail", 0)):
            whole(key, getattr(self, key), least)
        if not 0 <= number("smallest_gap", self.smallest_gap) < 1:
            raise BadInput(f"smallest_gap is {self.smallest_gap!r}; it is a fraction of the gap, from 0 to below 1.")


def sweep(model: Model, method: HarmonicBalance, static_eccentricities: Iterable[float], *, speed: float,
          direction: float = math.pi / 2) -> Branch:
    """Natural continuation (Villa et al., section 5): each steady state starts from the last one.

    Ends with the first eccentricity at which the solver stops or the rotor touches; `stopped` says so in words.
    Raises NoConvergence or Contact if there is not even the first.
    """
    values = [float(v) for v in static_eccentricities]
    if not values:
        raise BadInput("static_eccentricities is empty; give at least one fraction of the gap.")
    orbit = method.solve(model, speed, values[0], direction=direction)
    eq, done, rows, left = orbit.equations, values[:1], [orbit.local.ravel() / orbit.equations.length], [
        orbit.residual]
    stopped = f"It ends as asked at {100 * values[-1]:.4g} %."
    for value in values[1:]:
        guess = rows[-1]
        solution = method.from_guess(eq, model.centre(value, direction), guess)
        if not solution.converged:
            stopped = (f"Natural continuation stopped between {100 * done[-1]:.4g} % and {100 * value:.4g} %; "
                       "`follow` tells whether the branch turns there.")
            break
        done.append(value)
        rows.append(solution.y)
        left.append(float(np.abs(solution.residual).max() * eq.force))
    along = path(model, "static_eccentricity", method, speed, done[0], direction)
    branch = Branch(along, np.array(done), np.array(rows), np.array(left), (), stopped, method)
    touching = np.flatnonzero(branch.smallest_gaps <= 0)
    if len(touching):
        clear = touching[0]
        branch = Branch(along, branch.values[:clear], branch.unknowns[:clear], branch.residuals[:clear],
                        (), f"The rotor touches the stator at {100 * done[clear]:.4g} %.", method)
    return branch


def follow(model: Model, parameter: str = "static_eccentricity", *, to: float | None = None, speed: float,
           static_eccentricity: float = 0.0, direction: float = math.pi / 2, start: PeriodicOrbit | None = None,
           method: Arclength | None = None) -> Branch:
    """Follow the steady states along a parameter, past folds, in the direction of `to`.

    parameter: "static_eccentricity" (fraction of the gap), "direction" (gap angle of the offset, rad), "speed" (rad/s),
    "field" or "unbalance" (factors on the machine's own), "bearings.<name>.stiffness" (N/m). The branch begins at the
    given speed (rad/s), static eccentricity and direction and at the machine's own field, unbalance and bearings, or
    on `start`, an orbit there.
    Ends on `to` (half the gap if none is given for the eccentricity), at contact, back at the start value, after
    `max_folds` folds and a short tail, or after `max_points`; `branch.stopped` says which. Raises BadInput, or
    NoConvergence where there is no first steady state.
    """
    method = method or Arclength()
    if not isinstance(method, Arclength):
        raise BadInput(f"method is a {type(method).__name__}; it must be an Arclength, which takes a HarmonicBalance.")
    if start is not None:
        static_eccentricity, direction = start.static_eccentricity, _direction_of(start, direction)
    along = path(model, parameter, method.balance, speed, static_eccentricity, direction)
    if to is None and parameter != "static_eccentricity":
        raise BadInput(f"to is missing; say up to which value {parameter} is to be followed, from {along.say(along.first)}.")
    to = 0.5 if to is None else to
    number("to", to, unit="" if along.unit == "%" else along.unit)
    if along.unit == "%" and abs(to) >= 1:
        raise BadInput(f"to is {to!r}; it is a fraction of the gap, between -1 and 1 (12 % is 0.12).")
    if to == along.first:
        raise BadInput(f"to is {to:g}, where the branch starts; give another end.")
    origin = start or method.balance.solve(model, speed, static_eccentricity, direction=direction)
    if (origin.harmonics, origin.revolutions) != (method.balance.harmonics, method.balance.revolutions):
        raise BadInput(f"start has {origin.harmonics} harmonics, the method {method.balance.harmonics} (in a period of "
                       f"{origin.revolutions} and {method.balance.revolutions} revolutions); they must be the same.")
    return _walk(along, origin, to, method)


def _direction_of(start: PeriodicOrbit, direction: float) -> float:
    """Gap angle of the stator's offset of an orbit; the given one where it has none."""
    return math.atan2(*(start.centre / start.static_eccentricity)) if start.static_eccentricity else direction


def _walk(along: Path, origin: PeriodicOrbit, to: float, method: Arclength) -> Branch:
    """Take steps until one of the reasons to stop."""
    system, model = along.system(), origin.model
    forward = math.copysign(1.0, to - along.first)
    steps: list[Step] = []
    special: list[SpecialPoint] = []
    left, stopped, closed = method.tail, "", False
    # A circular gap's pull is not a number outside it, so no point that was found can touch at the AFT samples.
    watched = method.smallest_gap > 0 or type(model.law) is not CircularPull
    for point in arclength(system, origin.local.ravel() / origin.equations.length, along.first / along.scale,
                           toward=forward, step=method.step, max_step=method.max_step, max_turn=method.max_turn):
        fold = None
        if steps and point.tangent[-1] * steps[-1].tangent[-1] < 0:
            fold = locate_fold(system, steps[-1], point)
        furthest = fold if fold and forward * fold.parameter > forward * point.parameter else point
        reached = forward * (furthest.parameter * along.scale - to) >= 0
        if reached and (landed := land(system, steps[-1], furthest, to / along.scale)):
            point, fold = landed, None  # a fold in this step lies beyond `to`
        if fold:
            value = fold.parameter * along.scale
            special.append(SpecialPoint("fold", value, len(steps) - 1, fold.y, along.say(value, 8)))
        steps.append(point)
        value = point.parameter * along.scale
        gap = _smallest_gap(along, point.y, value) / model.length_scale if watched else math.inf
        closed = len(steps) > 3 and _comes_back(steps)
        if gap <= method.smallest_gap:
            stopped = (f"The smallest gap is down to {100 * gap:.3g} % of the nominal one at {along.say(value)}."
                       if gap > 0 else f"The rotor touches the stator at {along.say(value)}.")
        elif closed:
            stopped = f"It is closed: it came back to the steady state at {along.say(along.first)} where it began."
        elif reached:
            stopped = f"It reached {along.say(to)} as asked."
        elif not method.past_start and len(steps) > 2 and forward * (value - along.first) <= 0:
            stopped = f"It came back to {along.say(along.first)}, where it began."
        elif len(steps) >= method.max_points:
            stopped = f"It has the {method.max_points} points that were allowed."
        elif len(special) >= method.max_folds and (left := left - 1) < 0:
            stopped = f"It passed {len(special)} folds, as many as were asked for."
        else:
            continue
        break
    if not steps:
        raise NoConvergence(f"No branch begins at the given start, {along.say(along.first)}: it is no steady state of "
                            f"{model.name} at {origin.speed:.4g} rad/s. Solve for one with HarmonicBalance.")
    values = np.array([s.parameter for s in steps]) * along.scale
    stopped = stopped or f"No further point was found near {along.say(values[-1])}, down to the smallest step."
    residuals = np.array([s.residual for s in steps]) * origin.equations.force
    return Branch(along, values, np.array([s.y for s in steps]), residuals, tuple(special), stopped, method, closed)


def _smallest_gap(along: Path, y: NDArray, value: float) -> float:
    """Smallest gap of an orbit over the AFT samples, m."""
    problem = along.at(value)
    eq = problem.equations
    return float(np.min(eq.model.law.smallest_gap(eq.position(y, problem.centre))))


def _comes_back(steps: list[Step]) -> bool:
    """Whether the last step passed the first point, in its direction and within a small distance of it."""
    first, before, last = steps[0], steps[-2], steps[-1]
    along = [first.tangent[:-1] @ (s.y - first.y) + first.tangent[-1] * (s.parameter - first.parameter)
             for s in (before, last)]
    if not along[0] < 0 <= along[1]:
        return False
    start = np.append(first.y, first.parameter)
    a = np.append(before.y, before.parameter) - start
    b = np.append(last.y, last.parameter) - start
    share = along[0] / (along[0] - along[1])
    # The chord misses the curve by about its square; half the step is far below the distance to another leg.
    return bool(np.linalg.norm(a + share * (b - a)) < max(CLOSED, 0.1 * np.linalg.norm(b - a)))


def orbits_at(branch: Branch, value: float) -> list[PeriodicOrbit]:
    """Every steady state of a branch at one value of its parameter, in the order met: one for each leg that passes it.

    Each starts from the straight line between the two neighbouring points and is solved to the full accuracy.
    """
    problem = branch.path.at(value)
    eq, centre = problem.equations, problem.centre
    # With the folds put in, no leg is missed between the last point before a fold and the fold itself.
    after = [fold.after + 1 for fold in branch.folds]
    values = np.insert(branch.values, after, [fold.value for fold in branch.folds])
    unknowns = np.insert(branch.unknowns, after, [fold.unknowns for fold in branch.folds], axis=0) if after else (
        branch.unknowns)
    away = values - value
    found = []
    for i in np.flatnonzero((away[:-1] * away[1:] < 0) | (away[:-1] == 0)):
        share = away[i] / (away[i] - away[i + 1])
        solution = newton(lambda y: eq.linearise(y, centre), (1 - share) * unknowns[i] + share * unknowns[i + 1])
        if solution.converged:
            found.append(branch.orbit(value, solution.y, float(np.abs(solution.residual).max() * eq.force)))
    if away[-1] == 0:
        found.append(branch[-1])
    return found
