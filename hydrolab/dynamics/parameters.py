"""What a branch can be followed along: each parameter as a family of harmonic balances with its derivative.

static_eccentricity (fraction of the gap) · direction (gap angle of the offset, rad) · speed (rad/s) ·
field and unbalance (factors on the machine's own) · bearings.<name>.stiffness (N/m, both directions).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.condensation import Condensed, condensed_slope
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.problems import Path, Problem
from hydrolab.errors import BadInput
from hydrolab.machine.model import Model
from hydrolab.machine.several import force_at

REACH = 10.0  # parameters other than angles and eccentricities are scaled by this times their first value
NEARBY = 1e-6  # relative change of the speed for the forces' derivative by it


def path(model: Model, parameter: str, balance: HarmonicBalance, speed: float, static_eccentricity: float,
         direction: float) -> Path:
    """The path along a parameter from the given state.

    Raises BadInput for a parameter that this model does not have.
    """
    makers = {"static_eccentricity": _eccentricity, "direction": _direction, "speed": _speed, "field": _field,
              "unbalance": _unbalance}
    here = Problem(balance.equations(model, speed), static_eccentricity, direction)
    if parameter in makers:
        return makers[parameter](here, balance)
    name = parameter.removeprefix("bearings.").removesuffix(".stiffness")
    if name in model.supports and parameter == f"bearings.{name}.stiffness":
        return _stiffness(here, balance, name)
    known = [*makers, *(f"bearings.{name}.stiffness" for name in model.supports)]
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
        with_it, without = (force_at(law, position, velocity, own.phase, own.speed) for law in laws)
        return -2 * value * ((with_it - without) @ own.analysis).ravel()  # the pull goes with the square

    return Path("field", "times its own", 1.0, REACH,
                lambda value: replace(here, equations=replace(own, model=own.model.with_field(value))), slope)


def _unbalance(here: Problem, balance: HarmonicBalance) -> Path:
    own = here.equations

    def at(value: float) -> Problem:
        return replace(here, equations=replace(own, model=own.model.with_unbalance(value), linear=value * own.linear,
                                               shaft_linear=value * own.shaft_linear))

    return Path("unbalance", "times its own", 1.0, REACH, at,
                lambda problem, value, y, jacobian: -own.stiffness @ own.linear.ravel())


def _speed(here: Problem, balance: HarmonicBalance) -> Path:
    model = here.equations.model

    def slope(problem: Problem, value: float, y: NDArray, jacobian: NDArray) -> NDArray:
        eq = problem.equations
        dynamic = [-2 * k**2 * value * model.M + 1j * k * (model.velocity_matrix(value) + value * model.G)
                   for k in np.arange(balance.harmonics + 1) / balance.revolutions]
        load = 2 * value * (model.unbalance_cos - 1j * model.unbalance_sin)
        change = _linear_slope(eq, dynamic, load, y)
        if model.law.moving:  # velocities of the same orbit grow with the speed, and a film knows the speed itself
            position, velocity = eq.position(y, problem.centre), eq.velocity(y)
            faster, slower = (model.law.force_at(position, (1 + h) * velocity, eq.phase, (1 + h) * value)
                              for h in (NEARBY, -NEARBY))
            change -= ((faster - slower) / (2 * NEARBY * value) @ eq.analysis).ravel()
        return change

    return Path("speed", "rad/s", here.equations.speed, REACH * here.equations.speed,
                lambda value: replace(here, equations=balance.equations(model, value)), slope)


def _stiffness(here: Problem, balance: HarmonicBalance, name: str) -> Path:
    model, rows = here.equations.model, here.equations.model.supports[name]
    own = model.K
    touched = rows.T @ rows
    first = float(model.support_stiffness[name])

    def at(value: float) -> Problem:
        # Rayleigh damping is a property of the machine as built and does not follow the bearing.
        changed = replace(model, K=own + (value - first) * touched,
                          support_stiffness={**model.support_stiffness, name: value})
        return replace(here, equations=balance.equations(changed, here.equations.speed))

    def slope(problem: Problem, value: float, y: NDArray, jacobian: NDArray) -> NDArray:
        dynamic = [touched + 0j] * (balance.harmonics + 1)
        return _linear_slope(problem.equations, dynamic, np.zeros(model.size, dtype=complex), y)

    return Path(f"bearings.{name}.stiffness", "N/m", first, REACH * first, at, slope)


def _linear_slope(eq: Condensed, dynamic: list[NDArray], load: NDArray, y: NDArray) -> NDArray:
    """Change of the scaled residual with the linear machine: Λ' (Y − Y_lin) − Λ Y_lin'."""
    stiffness, linear = condensed_slope(eq, dynamic, load)
    return stiffness @ (y - eq.linear.ravel()) - eq.stiffness @ linear.ravel()
