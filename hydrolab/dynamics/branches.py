"""Branches of steady states, followed past their folds along any parameter of a model.

What can be followed: static_eccentricity (fraction of the gap) · direction (gap angle of the
offset, rad) · speed (rad/s) · field and unbalance (factors on the machine's own) · and any number
of the machine's card by its key, such as "bodies.generator.mass" or "air_gap.gap", in SI units.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.continuation import (
    ParametrisedSystem,
    Step,
    arclength,
    correct,
    land,
    locate_fold,
)
from hydrolab.dynamics.harmonic_balance import Condensed, HarmonicBalance, dynamic_stiffness
from hydrolab.dynamics.results import Branch, PeriodicOrbit, SpecialPoint, require
from hydrolab.dynamics.solvers import newton
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.model import Model
from hydrolab.machine.pull import CircularPull
from hydrolab.machine.quantities import number, shown, whole

__all__ = ["Arclength", "Step", "arclength", "correct", "follow", "locate_fold", "orbits_at",
           "sweep"]

# parameters other than angles and eccentricities are scaled by this times their first value
REACH = 10.0
NEARBY = 1e-6  # relative change of a parameter in the central difference by it
CLOSED = 1e-3  # a branch that comes this near its first point, in the scaled norm, is closed


# ------------------------------------------------------------------ the path along a parameter

@dataclass(frozen=True, eq=False)
class Problem:
    """A harmonic balance at one value of a parameter: its equations, and where the stator is."""

    equations: Condensed
    static_eccentricity: float
    direction: float

    @cached_property
    def centre(self) -> NDArray:
        """Stator centre (x_E, z_E), m."""
        return self.equations.model.centre(self.static_eccentricity, self.direction)


@dataclass(frozen=True, eq=False)
class Path:
    """A parameter to follow: its name and unit, first value, scale, and the problem at any value.

    here: the problem at the first value; unknowns keep its scales all along. balance: how its
    equations are made.
    """

    parameter: str
    unit: str
    first: float
    scale: float
    here: Problem
    balance: HarmonicBalance

    def at(self, value: float) -> Problem:
        """The problem at a value of the parameter; BadInput where there is none."""
        here = self.here
        if self.parameter == "static_eccentricity":
            return Problem(here.equations, value, here.direction)
        if self.parameter == "direction":
            return Problem(here.equations, here.static_eccentricity, value)
        return _changed(self, float(value))

    def slope(self, y: NDArray, value: float) -> NDArray:
        """∂H/∂λ of the residual in N, by a central difference; nan at the edge of what is allowed.
        """
        h = NEARBY * max(abs(value), 0.01 * self.scale)
        try:
            ahead, behind = self.at(value + h), self.at(value - h)
            there, back = ahead.centre, behind.centre
        except BadInput:
            return np.full(len(y), np.nan)
        eq, other = ahead.equations, behind.equations
        if eq is other:  # the stator alone moves, and all but the forces cancels
            forces = eq.forces(y, there) - eq.forces(y, back)
            return -eq.force / (2 * h) * (forces @ eq.analysis).ravel()
        return (eq.force * eq.residual(y, there) - other.force * other.residual(y, back)) / (2 * h)

    def system(self) -> ParametrisedSystem:
        """The residual with its derivatives in (y, value/scale), as `arclength` takes it."""
        def system(y: NDArray, scaled: float) -> tuple[NDArray, NDArray, Callable[[], NDArray]]:
            value = scaled * self.scale
            try:
                problem = self.at(value)
                eq = problem.equations
                residual, jacobian = eq.linearise(y, problem.centre)
            # a speed below zero, a stator outside the gap: there is nothing to follow there
            except BadInput:
                nothing = np.full(len(y), np.nan)
                return nothing, np.zeros((len(y), len(y))), lambda: nothing
            return residual, jacobian, lambda: self.scale / eq.force * self.slope(y, value)
        return system

    def say(self, value: float, digits: int = 4) -> str:
        """A value in words, with its unit."""
        if self.unit == "%":
            return f"{100 * value:.{digits}g} %"
        return f"{value:.{digits}g} {self.unit}".rstrip()


def path(model: Model, parameter: str, balance: HarmonicBalance, speed: float,
         static_eccentricity: float, direction: float, to: float | None = None) -> Path:
    """The path along a parameter from the given state; arguments as in `follow`. Where it begins at
    0, `to` gives its scale.

    Raises BadInput for a parameter that this model does not have.
    """
    here = Problem(balance.equations(model, speed), static_eccentricity, direction)
    if parameter == "static_eccentricity" and not math.isfinite(model.gap):
        raise BadInput(f"{model.name} has no air gap, so there is no static eccentricity to "
                       "follow.")
    if parameter == "direction" and not static_eccentricity:
        raise BadInput("direction can only be followed with a static_eccentricity other than 0.")
    known = {"static_eccentricity": (static_eccentricity, "%"), "direction": (direction, "rad"),
             "speed": (here.equations.speed, "rad/s"), "field": (1.0, "times its own"),
             "unbalance": (1.0, "times its own")}
    if parameter not in known:
        known[parameter] = _number(model, parameter, known)
    first, unit = known[parameter]
    scale = 1.0
    if parameter not in ("static_eccentricity", "direction"):
        scale = REACH * abs(first or number("to", 1.0 if to is None else to) or 1.0)
    return Path(parameter, "" if unit == "1" else unit, first, scale, here, balance)


def _number(model: Model, key: str, known: Iterable[str]) -> tuple[float, str]:
    """A number of the machine's card, with its unit; a sentence with what can be followed."""
    try:
        return model.number(key)
    except BadInput as error:
        raise BadInput(f"parameter is {shown(key)}; what can be followed is {', '.join(known)} "
                       f"and any number of the machine's card. {error}") from None


@lru_cache(maxsize=64)
def _changed(along: Path, value: float) -> Problem:
    """The problem of a path that changes the equations at a value of its parameter."""
    here, own, key = along.here, along.here.equations, along.parameter
    if key == "speed":
        return replace(here, equations=along.balance.equations(own.model, value, own.length))
    if key == "field":
        return replace(here, equations=replace(own, model=own.model.with_field(value)))
    if key == "unbalance":
        return replace(here, equations=replace(own, model=own.model.with_unbalance(value),
                                               linear=value * own.linear,
                                               shaft_linear=value * own.shaft_linear))
    model = own.model.with_number(key, value)
    # a number of a law alone leaves the linear machine, and its elimination, as they are
    if all(np.array_equal(getattr(model, name), getattr(own.model, name)) for name in LINEAR):
        return replace(here, equations=replace(own, model=model))
    return replace(here, equations=along.balance.equations(model, own.speed, own.length))


LINEAR = ("M", "C", "G", "K", "unbalance_sin", "unbalance_cos", "selection")


# ------------------------------------------------------------------ resonances on the way

SHARE = 0.3  # of the distance to the nearest resonance: the longest step
SHARPEST = 3e-5  # relative: no step is made shorter than this for a resonance
FAR, NEAR = 0.1, 0.01  # relative changes of a parameter after which resonances are sought again
SILENT = 1e-12  # of the length scale: a harmonic below it is not there


def resonances(along: Path, value: float, y: NDArray) -> NDArray:
    """Values of the parameter, complex, where the machine would vibrate freely with one of the
    frequencies in its motion y; their imaginary parts are the widths of the peaks.

    Z_k(λ) of all DOFs, with the mean slopes of the forces along the motion, is taken as a parabola
    in λ, which it is for a speed, a mass or a stiffness; where that is singular is an eigenvalue
    problem of twice its size.
    """
    eq = along.here.equations
    size = np.abs(y.reshape(len(eq.linear), -1)).max(axis=0)
    live = [k for k in range(1, eq.harmonics + 1)
            if k == eq.revolutions or size[2 * k - 1:2 * k + 1].max() > SILENT]
    h = FAR * max(abs(value), 0.01 * along.scale)
    try:
        before, here, after = (_stiffnesses(along.at(v), y, live)
                               for v in (value - h, value, value + h))
        # (Z + x Z' + x² Z'') q = 0 for λ = value + h x, as an eigenvalue problem in 1/x
        first, second = (-np.linalg.solve(here, change) for change in
                         ((after - before) / 2, (after + before) / 2 - here))
    except (BadInput, np.linalg.LinAlgError):
        return np.empty(0)
    one = np.broadcast_to(np.eye(len(here[0])), here.shape)
    inverse = np.linalg.eigvals(np.block([[first, second], [one, 0 * one]])).ravel()
    return value + h / inverse[np.abs(inverse) > 1e-9]


def _stiffnesses(problem: Problem, y: NDArray, harmonics: list[int]) -> NDArray:
    """Z_k − Sᵀ(slope + iω damping) S of all DOFs, with the forces' mean slopes, (…, n, n)."""
    eq = problem.equations
    S = eq.model.selection
    _, slope, damping = eq.model.law.linearise(eq.position(y, problem.centre), eq.velocity(y),
                                               eq.phase, eq.speed)
    mean = slope.mean(axis=-1)
    rate = 0 * mean if damping is None else damping.mean(axis=-1)
    found = []
    for k in harmonics:
        w = k * eq.speed / eq.revolutions
        found.append(dynamic_stiffness(eq.model, w, eq.speed) - S.T @ (mean + 1j * w * rate) @ S)
    return np.array(found)


def foresight(along: Path) -> Callable[[Step], float] | None:
    """A function that gives the longest step from a point, so that no resonance is stepped over;
    None along parameters that leave the linear machine and its forcing frequency as they are.
    """
    if along.parameter in ("static_eccentricity", "direction", "unbalance"):
        return None
    seen, reach, poles = math.nan, 0.0, np.empty(0)

    def longest(step: Step) -> float:
        nonlocal seen, reach, poles
        value = step.parameter * along.scale
        size = max(abs(value), 0.01 * along.scale)
        if not abs(value - seen) < reach:
            seen, poles = value, resonances(along, value, step.y)
            nearest = np.abs(poles - value).min(initial=math.inf)
            reach = max(NEAR * size, min(FAR * size, nearest))
        nearest = np.abs(poles - value).min(initial=math.inf)
        change = max(SHARE * nearest, SHARPEST * size) / along.scale
        return change / max(abs(float(step.tangent[-1])), 1e-9)

    return longest


# ------------------------------------------------------------------ natural continuation

def sweep(model: Model, method: HarmonicBalance, static_eccentricities: Iterable[float], *,
          speed: float, direction: float = math.pi / 2) -> Branch:
    """Natural continuation (Villa et al., section 5): each steady state starts from the last one.

    static_eccentricities: fractions of the gap. speed: rad/s. direction: gap angle of the offset,
    rad. Ends with the first eccentricity at which the solver stops or the rotor touches; `stopped`
    says so in words. Raises NoConvergence or Contact if there is not even the first.
    """
    require("method", method, HarmonicBalance)
    values = [number("static_eccentricities", v) for v in static_eccentricities]
    if not values:
        raise BadInput("static_eccentricities is empty; give at least one fraction of the gap.")
    orbit = method.solve(model, speed, values[0], direction=direction)
    eq = orbit.equations
    rows, left = [orbit.local.ravel() / eq.length], [orbit.residual]
    stopped = f"It ends as asked at {100 * values[-1]:.4g} %."
    for before, value in pairwise(values):
        solution = method.from_guess(eq, model.centre(value, direction), rows[-1])
        if not solution.converged:
            stopped = (f"Natural continuation stopped between {100 * before:.4g} % and "
                       f"{100 * value:.4g} %; `follow` tells whether the branch turns there.")
            break
        rows.append(solution.y)
        left.append(eq.newtons(solution.residual))
    along = path(model, "static_eccentricity", method, speed, values[0], direction)
    branch = _balanced(Branch(along, np.array(values[:len(rows)]), np.array(rows), np.array(left),
                              (), stopped, method))
    touching = np.flatnonzero(branch.smallest_gaps <= 0)
    if not len(touching):
        return branch
    at = along.say(branch.values[touching[0]])
    return _cut(branch, touching[0], f"The rotor touches the stator at {at}.")


def _cut(branch: Branch, rows: int, stopped: str) -> Branch:
    """The first rows of a branch."""
    return replace(branch, values=branch.values[:rows], unknowns=branch.unknowns[:rows],
                   residuals=branch.residuals[:rows], stopped=stopped, closed=False,
                   special_points=tuple(p for p in branch.special_points if p.after < rows - 1))


def _balanced(branch: Branch) -> Branch:
    """The branch up to the first point where the forces do not balance or do not repeat; the first
    is a solution.
    """
    problem = branch.path.at(branch.values[0])
    least = problem.equations.small(branch.unknowns[0], problem.centre)
    doubtful = (branch.residuals > least) | problem.equations.model.law.moving
    for k in map(int, np.flatnonzero(doubtful)):
        problem = branch.path.at(branch.values[k])
        try:
            problem.equations.require_balance(branch.unknowns[k], problem.centre,
                                              branch.residuals[k])
        except (NoConvergence, BadInput) as error:
            return _cut(branch, max(k, 1), str(error))
    return branch


# ------------------------------------------------------------------ arclength continuation

@dataclass(frozen=True)
class Arclength:
    """How a branch is followed: harmonic balance, step sizes (scaled by the gap), and when to stop.

    step, max_step: first and longest step. max_turn: of the tangent in a step, rad. max_points: in
    all. max_folds: stop after this many folds and a tail of `tail` points; there may be more orbits
    beyond. smallest_gap: stop when less than this fraction of the nominal gap is left. past_start:
    go on past the start value, to find a branch that closes.
    """

    balance: HarmonicBalance = field(default_factory=HarmonicBalance)
    step: float = 0.002
    max_step: float = 0.02
    max_turn: float = 0.15
    max_points: int = 1000
    max_folds: int = 50
    tail: int = 10
    smallest_gap: float = 0.0
    past_start: bool = False

    def __post_init__(self) -> None:
        require("balance", self.balance, HarmonicBalance)
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


def follow(model: Model, parameter: str = "static_eccentricity", *, to: float | None = None,
           speed: float, static_eccentricity: float = 0.0, direction: float = math.pi / 2,
           start: PeriodicOrbit | None = None, method: Arclength | None = None) -> Branch:
    """Follow the steady states along a parameter, past folds, in the direction of `to`.

    parameter: "static_eccentricity" (fraction of the gap), "direction" (gap angle of the offset,
    rad), "speed" (rad/s), "field" or "unbalance" (factors on the machine's own), or the key of any
    number on the machine's card, such as "bearings.<name>.stiffness" (SI units). to: value of the
    parameter to end at; half the gap unless given. The branch begins at this speed (rad/s),
    static_eccentricity, direction and the machine's own numbers, or on `start`, an orbit there.
    method: sizes of steps, and when else to end.

    It ends on `to`, at contact, back at the start value, after `max_folds` folds and a short tail,
    or after `max_points`; `branch.stopped` says which. Steps shorten near the resonances of the
    linear machine, so that none is stepped over, but not along the eccentricity, the direction and
    the unbalance, which leave that machine as it is. Raises BadInput, or NoConvergence where there
    is no first steady state.
    """
    method = Arclength() if method is None else method
    require("method", method, Arclength)
    balance = method.balance
    if start is not None:
        require("start", start, PeriodicOrbit)
        if (start.harmonics, start.revolutions) != (balance.harmonics, balance.revolutions):
            raise BadInput(f"start has {start.harmonics} harmonics, the method "
                           f"{balance.harmonics} (in a period of {start.revolutions} and "
                           f"{balance.revolutions} revolutions); they must be the same.")
        if start.static_eccentricity:
            direction = math.atan2(*(start.centre / start.static_eccentricity))
        static_eccentricity = start.static_eccentricity
    along = path(model, parameter, balance, speed, static_eccentricity, direction, to)
    to = _end(along, to)
    origin = start or balance.solve(model, speed, static_eccentricity, direction=direction)
    return _balanced(walk(along, origin, to, method))


def _end(along: Path, to: float | None) -> float:
    """The value up to which a path is followed, or a sentence why it cannot be."""
    if to is None and along.parameter != "static_eccentricity":
        raise BadInput(f"to is missing; say up to which value {along.parameter} is to be followed, "
                       f"from {along.say(along.first)}.")
    to = 0.5 if to is None else number("to", to, unit="" if along.unit == "%" else along.unit)
    if along.unit == "%" and abs(to) >= 1:
        raise BadInput(f"to is {to!r}; it is a fraction of the gap, between -1 and 1 (12 % is "
                       "0.12).")
    if to == along.first:
        raise BadInput(f"to is {to:g}, where the branch starts; give another end.")
    return to


def walk(along: Path, origin: PeriodicOrbit, to: float, method: Arclength,
         until: Callable[[Step, Step], bool] | None = None) -> Branch:
    """Take steps until one of the reasons to stop, or the first two of which `until` is true."""
    system, eq = along.system(), origin.equations
    forward = math.copysign(1.0, to - along.first)
    steps: list[Step] = []
    folds: list[SpecialPoint] = []
    past, stopped, closed = 0, "", False  # past: points after the last fold asked for
    y = origin.local.ravel() / eq.length
    # a motion that is small in its gap is to be known as well as any other
    small = min(1.0, max(100 * float(np.abs(y).max()), 1e-5))
    for point in arclength(system, y, along.first / along.scale, toward=forward, step=method.step,
                           max_step=method.max_step, max_turn=method.max_turn,
                           tolerance=1e-10 * small, longest=foresight(along)):
        if until and steps and until(steps[-1], point):
            steps.append(point)
            break
        # a fold between this point and the last?
        fold = None
        if steps and point.tangent[-1] * steps[-1].tangent[-1] < 0:
            fold = locate_fold(system, steps[-1], point)
        furthest = fold if fold and forward * fold.parameter > forward * point.parameter else point
        reached = forward * (furthest.parameter * along.scale - to) >= 0
        if reached and (landed := land(system, steps[-1], furthest, to / along.scale)):
            point, fold = landed, None  # a fold in this step lies beyond `to`
        if fold:
            value = fold.parameter * along.scale
            folds.append(SpecialPoint("fold", value, len(steps) - 1, fold.y, along.say(value, 8)))
        steps.append(point)
        past += len(folds) >= method.max_folds
        # the end?
        closed = len(steps) > 3 and _comes_back(steps)
        stopped = _reason(along, steps, to, method, closed, reached)
        if not stopped and past > method.tail:
            stopped = f"It passed {len(folds)} folds, as many as were asked for; it goes on."
        if stopped:
            break
    if not steps:
        raise NoConvergence(f"No branch begins at the given start, {along.say(along.first)}: it is "
                            f"no steady state of {origin.model.name} at {origin.speed:.4g} rad/s. "
                            "Solve for one with HarmonicBalance.")
    values = np.array([s.parameter for s in steps]) * along.scale
    stopped = stopped or (f"No further point was found near {along.say(values[-1])}, down to the "
                          "smallest step.")
    return Branch(along, values, np.array([s.y for s in steps]),
                  np.array([s.residual for s in steps]) * eq.force, tuple(folds), stopped, method,
                  closed)


def _reason(along: Path, steps: list[Step], to: float, method: Arclength, closed: bool,
            reached: bool) -> str:
    """Why a branch ends with the last of these points, or "" where it goes on."""
    value, first = steps[-1].parameter * along.scale, along.first
    gap = _room(along, steps[-1].y, value, method)
    if gap <= 0:
        return f"The rotor touches the stator at {along.say(value)}."
    if gap <= method.smallest_gap:
        return (f"The smallest gap is down to {100 * gap:.3g} % of the nominal one at "
                f"{along.say(value)}.")
    if closed:
        return (f"It is closed: it came back to the steady state at {along.say(first)} where it "
                "began.")
    if reached:
        return f"It reached {along.say(to)} as asked."
    turned = math.copysign(1.0, to - first) * (value - first) <= 0
    if turned and len(steps) > 2 and not method.past_start:
        return f"It came back to {along.say(first)}, where it began."
    if len(steps) >= method.max_points:
        return f"It has the {method.max_points} points that were allowed."
    return ""


def _room(along: Path, y: NDArray, value: float, method: Arclength) -> float:
    """Smallest gap at the AFT samples over the nominal one; inf where it cannot be the end."""
    # the pull of a round gap is no number outside it, so no point that was found can touch
    if not method.smallest_gap and type(along.here.equations.model.law) is CircularPull:
        return math.inf
    problem = along.at(value)
    eq = problem.equations
    gaps = eq.model.law.smallest_gap(eq.position(y, problem.centre), eq.phase)
    return float(np.min(gaps)) / eq.model.length_scale


def _comes_back(steps: list[Step]) -> bool:
    """Whether the last step passed the first point, in its direction and within a small distance of
    it.
    """
    first, before, last = steps[0], steps[-2], steps[-1]

    def ahead(step: Step) -> float:
        return float(first.tangent[:-1] @ (step.y - first.y)
                     + first.tangent[-1] * (step.parameter - first.parameter))

    if not ahead(before) < 0 <= ahead(last):
        return False
    start, a, b = (np.append(s.y, s.parameter) for s in (first, before, last))
    share = ahead(before) / (ahead(before) - ahead(last))
    # The chord misses the curve by about its square; half the step is far below the distance to
    # another leg.
    away = float(np.linalg.norm(a + share * (b - a) - start))
    return away < max(CLOSED, 0.1 * float(np.linalg.norm(b - a)))


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
