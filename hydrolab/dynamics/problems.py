"""A harmonic balance at one value of a parameter, and the path of all its values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.arclength import ParametrisedSystem
from hydrolab.dynamics.condensation import Condensed
from hydrolab.errors import BadInput


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

    slope: (problem, value, y, Jacobian) → derivative of the scaled residual with respect to the value.
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
            except BadInput:  # a speed below zero, a stator outside the gap: there is nothing to follow there
                return np.full(len(y), np.nan), np.zeros((len(y), len(y))), np.zeros(len(y))
            return residual, jacobian, self.scale * self.slope(problem, value, y, jacobian)
        return system

    def say(self, value: float, digits: int = 4) -> str:
        """A value in words, with its unit."""
        return f"{100 * value:.{digits}g} %" if self.unit == "%" else f"{value:.{digits}g}{self.unit and ' '}{self.unit}"
