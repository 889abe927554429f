"""A parameter of a model: the equations at any of its values, and the resonances on the way.

What can be followed: static_eccentricity (fraction of the gap) · direction (gap angle of the
offset, rad) · speed (rad/s) · field and unbalance (factors on the machine's own) · and any number
of the machine's card by its key, such as "bodies.generator.mass" or "air_gap.gap", in SI units.

Here y: unknowns, scaled. digits: that are significant. value: of the parameter. speed: rad/s.
static_eccentricity: a fraction of the gap. direction: a gap angle, rad.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.continuation import ParametrisedSystem, Step
from hydrolab.dynamics.harmonic_balance import Condensed, HarmonicBalance, dynamic_stiffness
from hydrolab.errors import BadInput
from hydrolab.machine.model import ARRAYS, Model
from hydrolab.machine.quantities import number, shown

# parameters other than angles and eccentricities are scaled by this times their first value
REACH = 10.0
NEARBY = 1e-6  # relative change of a parameter in the central difference by it
APART, REMEMBERED = 1e-4, 12  # relative, of values that give a difference; how many are kept


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

    def _onward(self, problem: Problem) -> NDArray:
        """∂(x_E, z_E)/∂λ where the parameter moves the stator, m."""
        if self.parameter == "direction":
            return problem.equations.model.centre(problem.static_eccentricity,
                                                  problem.direction + math.pi / 2)
        return 2 * problem.equations.model.centre(0.5, problem.direction)

    @property
    def moves_stator(self) -> bool:
        """Whether the parameter moves the stator and leaves the equations as they are."""
        return self.parameter in ("static_eccentricity", "direction")

    def size(self, value: float) -> float:
        """What a change of the parameter is compared with."""
        return max(abs(value), 0.01 * self.scale)

    def slope(self, y: NDArray, value: float) -> NDArray:
        """∂H/∂λ of the residual in N, by a central difference; nan at the edge of what is allowed.
        """
        h = NEARBY * self.size(value)
        try:
            ahead, behind = self.at(value + h), self.at(value - h)
            return (_force_left(ahead, y) - _force_left(behind, y)) / (2 * h)
        except BadInput:
            return np.full(len(y), np.nan)

    def system(self) -> ParametrisedSystem:
        """The residual with its derivatives in (y, value/scale), as `arclength` takes it.

        Where equations change, ∂H/∂λ comes from those of the last values, which cost nothing to set
        up again; where there are no such yet, from a central difference.
        """
        known: dict[float, Problem] = {}

        def slope(y: NDArray, value: float) -> NDArray:
            """By the parabola through this value and the two nearest that are well apart from it.
            """
            size, near = self.size(value), [value]
            for other in sorted(known, key=lambda v: abs(v - value)):
                if min(abs(other - v) for v in near) > APART * size:
                    near.append(other)
            if len(near) < 3 or abs(near[2] - value) > FAR * size:
                return self.slope(y, value)
            here, one, two = (_force_left(known[v], y) for v in near[:3])
            h, k = near[1] - value, near[2] - value
            return (k / h * (one - here) - h / k * (two - here)) / (k - h)

        def system(y: NDArray, scaled: float) -> tuple[NDArray, NDArray,
                                                       NDArray | Callable[[], NDArray]]:
            value = scaled * self.scale
            try:
                problem = self.at(value)
                eq = problem.equations
                residual, jacobian = eq.linearise(y, problem.centre)
            # a speed below zero, a stator outside the gap: there is nothing to follow there
            except BadInput:
                nothing = np.full(len(y), np.nan)
                return nothing, np.zeros((len(y), len(y))), nothing
            if self.moves_stator:
                # to move it is to move the mean the other way, for the forces alone
                mean = [0, eq.linear.shape[1]]
                forces = eq.stiffness[:, mean] - jacobian[:, mean]
                return residual, jacobian, forces @ self._onward(problem) / eq.length
            if self.parameter == "field" and eq.model.law.closed_form:
                # the pull, all that is left of the linear forces, goes with its square
                pull = eq.stiffness @ (y - eq.linear.ravel()) - residual
                return residual, jacobian, -2 * self.scale / (value or 1.0) * pull
            known[value] = problem
            if len(known) > REMEMBERED:
                del known[next(iter(known))]
            return residual, jacobian, lambda: self.scale / eq.force * slope(y, value)
        return system

    def say(self, value: float, digits: int = 4) -> str:
        """A value in words, with its unit."""
        if self.unit == "%":
            return f"{100 * value:.{digits}g} %"
        return f"{value:.{digits}g} {self.unit}".rstrip()


def _force_left(problem: Problem, y: NDArray) -> NDArray:
    """H of a problem, N."""
    return problem.equations.force * problem.equations.residual(y, problem.centre)


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
    if key == "unbalance" and not own.model.static.any() and not own.model.turning.any():
        return replace(here, equations=replace(own, model=own.model.with_unbalance(value),
                                               linear=value * own.linear,
                                               shaft_linear=value * own.shaft_linear))
    model = (own.model.with_unbalance(value) if key == "unbalance"
             else own.model.with_number(key, value))
    # a number of a law alone leaves the linear machine, and its elimination, as they are
    if all(np.array_equal(getattr(model, name), getattr(own.model, name)) for name in ARRAYS):
        return replace(here, equations=replace(own, model=model))
    return replace(here, equations=along.balance.equations(model, own.speed, own.length))


# ------------------------------------------------------------------ resonances on the way

SHARE = 0.3  # of the distance to the nearest resonance: the longest step
SHARPEST = 3e-5  # relative: no step is made shorter than this for a resonance
FAR = 0.1  # relative change of a parameter over which its equations are known by a parabola
NEAR, STEADY = 0.01, 0.02  # changes of it and of the forces' slopes that are looked at again
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
    h = FAR * along.size(value)
    try:
        problems = [along.at(v) for v in (value - h, value, value + h)]
        # where the linear machine stays, what it is to the nonlinear coordinates says it all
        stays = all(p.equations.stiffness is eq.stiffness for p in problems)
        before, here, after = (_stiffnesses(p, y, live, stays) for p in problems)
        # (Z + x Z' + x² Z'') q = 0 for λ = value + h x, as an eigenvalue problem in 1/x
        first, second = (-np.linalg.solve(here, change) for change in
                         ((after - before) / 2, (after + before) / 2 - here))
    except (BadInput, np.linalg.LinAlgError):
        return np.empty(0)
    one = np.broadcast_to(np.eye(len(here[0])), here.shape)
    inverse = np.linalg.eigvals(np.block([[first, second], [one, 0 * one]])).ravel()
    return value + h / inverse[np.abs(inverse) > 1e-9]


def _stiffnesses(problem: Problem, y: NDArray, harmonics: list[int], condensed: bool) -> NDArray:
    """Z_k − Sᵀ(slope + iω damping) S of all DOFs, with the forces' mean slopes, (…, n, n); or of
    the nonlinear coordinates alone, (…, c, c).
    """
    eq = problem.equations
    S = eq.model.selection
    mean, rate = _mean_slopes(problem, y)
    found = []
    for k in harmonics:
        w = k * eq.speed / eq.revolutions
        slope = mean + 1j * w * rate
        found.append(eq.felt(k) - slope if condensed else
                     dynamic_stiffness(eq.model, w, eq.speed) - S.T @ slope @ S)
    return np.array(found)


def _mean_slopes(problem: Problem, y: NDArray) -> NDArray:
    """∂F/∂u and ∂F/∂u̇, mean along a motion, (2, c, c)."""
    eq = problem.equations
    _, slope, damping = eq.model.law.linearise(eq.position(y, problem.centre), eq.velocity(y),
                                               eq.phase, eq.speed)
    mean = slope.mean(axis=-1)
    return np.array([mean, 0 * mean if damping is None else damping.mean(axis=-1)])


def foresight(along: Path) -> Callable[[Step], float] | None:
    """A function that gives the longest step from a point, so that no resonance is stepped over.

    None where the linear machine and its forcing frequency stay as they are: along the
    eccentricity, the direction and the unbalance a resonance moves with the pull's slope alone,
    that is with the motion, which changes by no more than a step is long.
    """
    if along.moves_stator or along.parameter == "unbalance":
        return None
    seen, slopes, poles = math.nan, np.empty(0), np.empty(0)

    def longest(step: Step) -> float:
        nonlocal seen, slopes, poles
        value = step.parameter * along.scale
        size, now = along.size(value), _mean_slopes(along.at(value), step.y)
        away, nearest = abs(value - seen), np.abs(poles - value).min(initial=math.inf)
        # the parabola reaches as far as its values; the motion may shift the poles before
        if not away < FAR * size or (away > max(NEAR * size, nearest) and
                                     np.abs(now - slopes).max() > STEADY * np.abs(now).max()):
            seen, slopes, poles = value, now, resonances(along, value, step.y)
        nearest = np.abs(poles - value).min(initial=math.inf)
        change = max(SHARE * nearest, SHARPEST * size) / along.scale
        return change / max(abs(float(step.tangent[-1])), 1e-9)

    return longest
