"""A harmonic balance at one value of a parameter, and the path of all its values.

What a branch can be followed along: each parameter as a family of harmonic balances with its
derivative.

static_eccentricity (fraction of the gap) · direction (gap angle of the offset, rad) · speed (rad/s)
· field and unbalance (factors on the machine's own) · bearings.<name>.stiffness (N/m, both
directions).

Branches of steady states, followed past their folds along any parameter of a model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.continuation import ParametrisedSystem, Step, arclength, correct, land, locate_fold
from hydrolab.dynamics.harmonic_balance import Condensed, HarmonicBalance, condensed_slope
from hydrolab.dynamics.results import Branch, PeriodicOrbit, SpecialPoint
from hydrolab.dynamics.solvers import newton
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.model import Model
from hydrolab.machine.pull import CircularPull
from hydrolab.machine.quantities import number, whole


@dataclass(frozen=True, eq=False)
class Problem:
    """A harmonic balance at one value of a parameter: its equations, and where the stator is."""

    equations: Condensed
    static_eccentricity: float
    direction: float

    @property
    def centre(self) -> NDArray:
        """Stator centre (x_E, z_E), m."""
        return self.equations.model.centre(self.static_eccentricity, self.direction)


@dataclass(frozen=True, eq=False)
class Path:
    """A parameter to follow: its name and unit, first value, scale, and the problem at any value.

    slope: (problem, value, y, Jacobian) → derivative of the scaled residual with respect to the
    value.
    """

    parameter: str
    unit: str
    first: float
    scale: float
    at: Callable[[float], Problem]
    slope: Callable[[Problem, float, NDArray, NDArray], NDArray]

    def system(self) -> ParametrisedSystem:
        """The residual with its derivatives in (y, value/scale), as `arclength` takes it."""
        def system(y: NDArray, scaled: float) -> tuple[NDArray, NDArray, NDArray]:
            value = scaled * self.scale
            try:
                problem = self.at(value)
                residual, jacobian = problem.equations.linearise(y, problem.centre)
            # a speed below zero, a stator outside the gap: there is nothing to follow there
            except BadInput:
                return np.full(len(y), np.nan), np.zeros((len(y), len(y))), np.zeros(len(y))
            return residual, jacobian, self.scale * self.slope(problem, value, y, jacobian)
        return system

    def say(self, value: float, digits: int = 4) -> str:
        """A value in words, with its unit."""
        return f"{100 * value:.{digits}g} %" if self.unit == "%" else f"{value:.{digits}g}{self.unit and ' '}{self.unit}"


# parameters other than angles and eccentricities are scaled by this times their first value
REACH = 10.0
NEARBY = 1e-6  # relative change of the speed for the forces' derivative by it


def path(model: Model, parameter: str, balance: HarmonicBalance, speed: float,
         static_eccentricity: float,
         direction: float) -> Path:
    """The path along a parameter from the given state.

    Raises BadInput for a parameter that this model does not have.
    """
    makers = {"static_eccentricity": _eccentricity, "direction": _direction, "speed": _speed,
              "field": _field,
              "unbalance": _unbalance}
    here = Problem(balance.equations(model, speed), static_eccentricity, direction)
    if parameter in makers:
        return makers[parameter](here, balance)
    name = parameter.removeprefix("bearings.").removesuffix(".stiffness")
    alike = [name for name, bearing in model.supports.items() if not bearing.law
             and np.array_equal(bearing.stiffness, bearing.stiffness[0, 0] * np.eye(2))]
    if name in alike and parameter == f"bearings.{name}.stiffness":
        return _stiffness(here, balance, name)
    known = [*makers, *(f"bearings.{name}.stiffness" for name in alike)]
    raise BadInput(f"parameter is {parameter!r}; what can be followed is {', '.join(known)}.")


def stator_shift(problem: Problem, shift: NDArray, jacobian: NDArray) -> NDArray:
    """Change of the scaled residual when the stator moves by `shift` (m) per unit of a parameter.

    Moving the stator is moving the mean the other way, but only in the pull: Λ − ∂H/∂Y is ∂Z/∂Y.
    """
    eq = problem.equations
    columns = eq.linear.shape[1]
    pull = eq.stiffness - jacobian
    return (pull[:, 0] * shift[0] + pull[:, columns] * shift[1]) / eq.length


def _eccentricity(here: Problem, balance: HarmonicBalance) -> Path:
    model = here.equations.model
    if not math.isfinite(model.gap):
        raise BadInput(f"{model.name} has no air gap, so there is no static eccentricity to follow.")
    unit = model.gap * np.array([math.sin(here.direction), math.cos(here.direction)])
    return Path("static_eccentricity", "%", here.static_eccentricity, 1.0,
                lambda value: Problem(here.equations, value, here.direction),
                lambda problem, value, y, jacobian: stator_shift(problem, unit, jacobian))


def _direction(here: Problem, balance: HarmonicBalance) -> Path:
    offset = here.static_eccentricity * here.equations.model.gap
    if not here.static_eccentricity:
        raise BadInput("direction can only be followed with a static_eccentricity other than 0.")
    return Path("direction", "rad", here.direction, 1.0,
                lambda value: Problem(here.equations, here.static_eccentricity, value),
                lambda problem, value, y, jacobian: stator_shift(
                    problem, offset * np.array([math.cos(value), -math.sin(value)]), jacobian))


def _field(here: Problem, balance: HarmonicBalance) -> Path:
    own = here.equations

    def slope(problem: Problem, value: float, y: NDArray, jacobian: NDArray) -> NDArray:
        position, velocity = own.position(y, problem.centre), own.velocity(y)
        laws = own.model.law, own.model.law.scaled(0.0)
        with_it, without = (law.force(position, velocity, own.phase, own.speed) for law in laws)
        # the pull goes with the square
        return -2 * value * ((with_it - without) @ own.analysis).ravel()

    return Path("field", "times its own", 1.0, REACH,
                lambda value: replace(here, equations=replace(own,
                                                              model=own.model.with_field(value))),
                slope)


def _unbalance(here: Problem, balance: HarmonicBalance) -> Path:
    own = here.equations

    def at(value: float) -> Problem:
        return replace(here, equations=replace(own, model=own.model.with_unbalance(value),
                                               linear=value * own.linear,
                                               shaft_linear=value * own.shaft_linear))

    return Path("unbalance", "times its own", 1.0, REACH, at,
                lambda problem, value, y, jacobian: -own.stiffness @ own.linear.ravel())


def _speed(here: Problem, balance: HarmonicBalance) -> Path:
    model = here.equations.model

    def slope(problem: Problem, value: float, y: NDArray, jacobian: NDArray) -> NDArray:
        eq = problem.equations
        dynamic = [-2 * k**2 * value * model.M + 1j * k
                   * (model.velocity_matrix(value) + value * model.G)
                   for k in np.arange(balance.harmonics + 1) / balance.revolutions]
        load = 2 * value * (model.unbalance_cos - 1j * model.unbalance_sin)
        change = _linear_slope(eq, dynamic, load, y)
        # velocities of the same orbit grow with the speed, and a film knows the speed itself
        if model.law.moving:
            position, velocity = eq.position(y, problem.centre), eq.velocity(y)
            faster, slower = (model.law.force(position, (1 + h) * velocity, eq.phase,
                                              (1 + h) * value)
                              for h in (NEARBY, -NEARBY))
            change -= ((faster - slower) / (2 * NEARBY * value) @ eq.analysis).ravel()
        return change

    return Path("speed", "rad/s", here.equations.speed, REACH * here.equations.speed,
                lambda value: replace(here, equations=balance.equations(model, value)), slope)


def _stiffness(here: Problem, balance: HarmonicBalance, name: str) -> Path:
    model, bearing = here.equations.model, here.equations.model.supports[name]
    touched = bearing.rows.T @ bearing.rows
    first = float(bearing.stiffness[0, 0])

    def at(value: float) -> Problem:
        # Rayleigh damping is a property of the machine as built and does not follow the bearing.
        own = replace(bearing, stiffness=value * np.eye(2))
        changed = replace(model, K=model.K + (value - first) * touched,
                          supports={**model.supports, name: own})
        return replace(here, equations=balance.equations(changed, here.equations.speed))

    def slope(problem: Problem, value: float, y: NDArray, jacobian: NDArray) -> NDArray:
        dynamic = [touched + 0j] * (balance.harmonics + 1)
        return _linear_slope(problem.equations, dynamic, np.zeros(model.size, dtype=complex), y)

    return Path(f"bearings.{name}.stiffness", "N/m", first, REACH * first, at, slope)


def _linear_slope(eq: Condensed, dynamic: list[NDArray], load: NDArray, y: NDArray) -> NDArray:
    """Change of the scaled residual with the linear machine: Λ' (Y − Y_lin) − Λ Y_lin'."""
    stiffness, linear = condensed_slope(eq, dynamic, load)
    return stiffness @ (y - eq.linear.ravel()) - eq.stiffness @ linear.ravel()


__all__ = ["Arclength", "Step", "arclength", "correct", "follow", "locate_fold", "orbits_at",
           "sweep"]
# a branch that comes this near its first point, in the scaled norm along the way, is closed
CLOSED = 1e-3


@dataclass(frozen=True)
class Arclength:
    """How a branch is followed: harmonic balance, step sizes (scaled by the gap), and when to stop.

    max_folds: stop after this many folds and a tail of `tail` points. smallest_gap: stop when less
    than this fraction of the nominal gap is left. past_start: go on past the start value, to find a
    branch that closes.
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
                               f"{'a radian' if key == 'max_turn' else 'the whole gap'}, and far "
                               "less is usual.")
        for key, least in (("max_points", 2), ("max_folds", 1), ("tail", 0)):
            whole(key, getattr(self, key), least)
        if not 0 <= number("smallest_gap", self.smallest_gap) < 1:
            raise BadInput(f"smallest_gap is {self.smallest_gap!r}; it is a fraction of the gap, "
                           "from 0 to below 1.")


def sweep(model: Model, method: HarmonicBalance, static_eccentricities: Iterable[float], *,
          speed: float,
          direction: float = math.pi / 2) -> Branch:
    """Natural continuation (Villa et al., section 5): each steady state starts from the last one.

    Ends with the first eccentricity at which the solver stops or the rotor touches; `stopped` says
    so in words. Raises NoConvergence or Contact if there is not even the first.
    """
    values = [float(v) for v in static_eccentricities]
    if not values:
        raise BadInput("static_eccentricities is empty; give at least one fraction of the gap.")
    orbit = method.solve(model, speed, values[0], direction=direction)
    eq, done, rows, left = orbit.equations, values[:1], [orbit.local.ravel()
                                                         / orbit.equations.length], [
        orbit.residual]
    stopped = f"It ends as asked at {100 * values[-1]:.4g} %."
    for value in values[1:]:
        guess = rows[-1]
        solution = method.from_guess(eq, model.centre(value, direction), guess)
        if not solution.converged:
            stopped = (f"Natural continuation stopped between {100 * done[-1]:.4g} % and "
                       f"{100 * value:.4g} %; "
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
        branch = Branch(along, branch.values[:clear], branch.unknowns[:clear],
                        branch.residuals[:clear],
                        (), f"The rotor touches the stator at {100 * done[clear]:.4g} %.", method)
    return branch


def follow(model: Model, parameter: str = "static_eccentricity", *, to: float | None = None,
           speed: float,
           static_eccentricity: float = 0.0, direction: float = math.pi / 2,
           start: PeriodicOrbit | None = None,
           method: Arclength | None = None) -> Branch:
    """Follow the steady states along a parameter, past folds, in the direction of `to`.

    parameter: "static_eccentricity" (fraction of the gap), "direction" (gap angle of the offset,
    rad), "speed" (rad/s), "field" or "unbalance" (factors on the machine's own),
    "bearings.<name>.stiffness" (N/m). The branch begins at the given speed (rad/s), static
    eccentricity and direction and at the machine's own field, unbalance and bearings, or on
    `start`, an orbit there. Ends on `to` (half the gap if none is given for the eccentricity), at
    contact, back at the start value, after `max_folds` folds and a short tail, or after
    `max_points`; `branch.stopped` says which. Raises BadInput, or NoConvergence where there is no
    first steady state.
    """
    method = method or Arclength()
    if not isinstance(method, Arclength):
        raise BadInput(f"method is a {type(method).__name__}; it must be an Arclength, which takes "
                       "a HarmonicBalance.")
    if start is not None:
        static_eccentricity, direction = start.static_eccentricity, _direction_of(start, direction)
    along = path(model, parameter, method.balance, speed, static_eccentricity, direction)
    if to is None and parameter != "static_eccentricity":
        raise BadInput(f"to is missing; say up to which value {parameter} is to be followed, from "
                       f"{along.say(along.first)}.")
    to = 0.5 if to is None else to
    number("to", to, unit="" if along.unit == "%" else along.unit)
    if along.unit == "%" and abs(to) >= 1:
        raise BadInput(f"to is {to!r}; it is a fraction of the gap, between -1 and 1 (12 % is "
                       "0.12).")
    if to == along.first:
        raise BadInput(f"to is {to:g}, where the branch starts; give another end.")
    origin = start or method.balance.solve(model, speed, static_eccentricity, direction=direction)
    if (origin.harmonics, origin.revolutions) != (method.balance.harmonics,
                                                  method.balance.revolutions):
        raise BadInput(f"start has {origin.harmonics} harmonics, the method "
                       f"{method.balance.harmonics} (in a period of "
                       f"{origin.revolutions} and {method.balance.revolutions} revolutions); they "
                       "must be the same.")
    return _walk(along, origin, to, method)


def _direction_of(start: PeriodicOrbit, direction: float) -> float:
    """Gap angle of the stator's offset of an orbit; the given one where it has none."""
    return math.atan2(*(start.centre
                        / start.static_eccentricity)) if start.static_eccentricity else direction


def _walk(along: Path, origin: PeriodicOrbit, to: float, method: Arclength) -> Branch:
    """Take steps until one of the reasons to stop."""
    system, model = along.system(), origin.model
    forward = math.copysign(1.0, to - along.first)
    steps: list[Step] = []
    special: list[SpecialPoint] = []
    left, stopped, closed = method.tail, "", False
    # A circular gap's pull is not a number outside it, so no point that was found can touch at the
    # AFT samples.
    watched = method.smallest_gap > 0 or type(model.law) is not CircularPull
    for point in arclength(system, origin.local.ravel() / origin.equations.length,
                           along.first / along.scale,
                           toward=forward, step=method.step, max_step=method.max_step,
                           max_turn=method.max_turn):
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
            stopped = (f"The smallest gap is down to {100 * gap:.3g} % of the nominal one at "
                       f"{along.say(value)}."
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
        raise NoConvergence(f"No branch begins at the given start, {along.say(along.first)}: it is "
                            "no steady state of "
                            f"{model.name} at {origin.speed:.4g} rad/s. Solve for one with "
                            "HarmonicBalance.")
    values = np.array([s.parameter for s in steps]) * along.scale
    stopped = stopped or f"No further point was found near {along.say(values[-1])}, down to the smallest step."
    residuals = np.array([s.residual for s in steps]) * origin.equations.force
    return Branch(along, values, np.array([s.y for s in steps]), residuals, tuple(special),
                  stopped, method, closed)


def _smallest_gap(along: Path, y: NDArray, value: float) -> float:
    """Smallest gap of an orbit over the AFT samples, m."""
    problem = along.at(value)
    eq = problem.equations
    return float(np.min(eq.model.law.smallest_gap(eq.position(y, problem.centre), eq.phase)))


def _comes_back(steps: list[Step]) -> bool:
    """Whether the last step passed the first point, in its direction and within a small distance of
    it.
    """
    first, before, last = steps[0], steps[-2], steps[-1]
    along = [first.tangent[:-1] @ (s.y - first.y) + first.tangent[-1]
             * (s.parameter - first.parameter)
             for s in (before, last)]
    if not along[0] < 0 <= along[1]:
        return False
    start = np.append(first.y, first.parameter)
    a = np.append(before.y, before.parameter) - start
    b = np.append(last.y, last.parameter) - start
    share = along[0] / (along[0] - along[1])
    # The chord misses the curve by about its square; half the step is far below the distance to
    # another leg.
    return bool(np.linalg.norm(a + share * (b - a)) < max(CLOSED, 0.1 * np.linalg.norm(b - a)))


def orbits_at(branch: Branch, value: float) -> list[PeriodicOrbit]:
    """Every steady state of a branch at one value of its parameter, in the order met: one for each
    leg that passes it.

    Each starts from the straight line between the two neighbouring points and is solved to the full
    accuracy.
    """
    problem = branch.path.at(value)
    eq, centre = problem.equations, problem.centre
    # With the folds put in, no leg is missed between the last point before a fold and the fold
    # itself.
    after = [fold.after + 1 for fold in branch.folds]
    values = np.insert(branch.values, after, [fold.value for fold in branch.folds])
    unknowns = np.insert(branch.unknowns, after, [fold.unknowns for fold in branch.folds],
                         axis=0) if after else (
        branch.unknowns)
    away = values - value
    found = []
    for i in np.flatnonzero((away[:-1] * away[1:] < 0) | (away[:-1] == 0)):
        share = away[i] / (away[i] - away[i + 1])
        solution = newton(lambda y: eq.linearise(y, centre),
                          (1 - share) * unknowns[i] + share * unknowns[i + 1])
        if solution.converged:
            found.append(branch.orbit(value, solution.y,
                                      float(np.abs(solution.residual).max() * eq.force)))
    if away[-1] == 0:
        found.append(branch[-1])
    return found
