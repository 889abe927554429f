"""The harmonic balance method: one steady state, and natural continuation as the paper does it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.condensation import Condensed, condense
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.solvers import Solution, newton
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.checks import number, require_model, turning, whole
from hydrolab.machine.model import Model


@dataclass(frozen=True)
class HarmonicBalance:
    """Harmonic balance with m harmonics and alternating frequency and time, Eqs. (10) to (19).

    harmonics: m. samples: time samples in a period for the AFT step; by default 16 a harmonic, at least 64.
    solver: `newton` or `powell_dog_leg` of hydrolab.dynamics.solvers. revolutions: q in a period; harmonic k then has
    the frequency kΩ/q, for motions that repeat every q revolutions only.
    """

    harmonics: int = 4
    samples: int | None = None
    solver: Callable[..., Solution] = newton
    revolutions: int = 1

    def __post_init__(self) -> None:
        whole("harmonics", self.harmonics, 1, 64)
        if not isinstance(self.aft_samples, int) or self.aft_samples < 2 * self.harmonics + 2:
            raise BadInput(f"samples is {self.samples!r}; {self.harmonics} harmonics need at least "
                           f"{2 * self.harmonics + 2}, and several times that for a pull without aliasing.")
        whole("revolutions", self.revolutions, 1, self.harmonics, "the harmonics, so that the unbalance is among them")
        if not callable(self.solver):
            raise BadInput(f"solver is {self.solver!r}; it must be a function, newton or powell_dog_leg of hydrolab.")

    @property
    def aft_samples(self) -> int:
        """Time samples in a period: as given, or 16 a harmonic and at least 64."""
        return max(64, 16 * int(self.harmonics)) if self.samples is None else self.samples

    def equations(self, model: Model, speed: float) -> Condensed:
        """The condensed equations of a model at a speed (rad/s)."""
        require_model(model)
        return condense(model, turning(speed), self.harmonics, self.aft_samples, self.revolutions)

    def solve(self, model: Model, speed: float, static_eccentricity: float = 0.0, *,
              direction: float = math.pi / 2, start: PeriodicOrbit | None = None) -> PeriodicOrbit:
        """The steady state at a speed (rad/s) and a static eccentricity (fraction of the gap).

        direction: gap angle of the stator offset, rad. start: a steady state to begin from; without one the
        linear response is tried, then a walk from zero eccentricity.
        Raises NoConvergence with what to try next, Contact where the steady state found would touch the stator,
        BadInput for arguments outside what is allowed.
        """
        eq = self.equations(model, speed)
        number("static_eccentricity", static_eccentricity)
        centre = model.centre(static_eccentricity, direction)
        if start is not None:
            solution = self.from_guess(eq, centre, first_guess(eq, start))
        else:
            solution = self.from_guess(eq, centre, eq.linear.ravel())
            if not solution.converged:
                solution = self._walk(eq, centre)
        if not solution.converged:
            raise NoConvergence(self._advice(eq, solution, static_eccentricity))
        orbit = orbit_from(eq, static_eccentricity, centre, solution)
        orbit.require_clear()
        return orbit

    def from_guess(self, eq: Condensed, centre: NDArray, y: NDArray) -> Solution:
        """Run the solver on condensed equations from unknowns y; the stator is at `centre` (m)."""
        return self.solver(lambda y: eq.linearise(y, centre), y)

    def _walk(self, eq: Condensed, centre: NDArray, steps: int = 20) -> Solution:
        """Reach a steady state by raising the pull to its full strength, then the offset."""
        y = eq.linear.ravel()
        for ratio in np.linspace(0, 1, steps + 1)[1:]:
            weak = replace(eq, model=eq.model.with_field(ratio))  # the linear machine does not change
            solution = self.from_guess(weak, 0 * centre, y)
            if not solution.converged:
                return solution
            y = solution.y
        for ratio in np.linspace(0, 1, steps + 1)[1:]:
            solution = self.from_guess(eq, ratio * centre, solution.y)
            if not solution.converged:
                return solution
        return solution

    def _advice(self, eq: Condensed, solution: Solution, eccentricity: float) -> str:
        smallest = solution.smallest_singular_value
        where = f"at {100 * eccentricity:.4g} %" if math.isfinite(eq.model.gap) else f"at {eq.speed:.4g} rad/s"
        left = np.abs(solution.residual).max() * eq.force
        size = f"residual {left:.1e} N" if math.isfinite(left) else "the rotor outside the gap"
        return (f"{self.solver.__name__} stopped {where} after {solution.steps} steps, {size}: "
                + (f"a fold is near (smallest singular value {smallest:.0e}). " if smallest < 0.05 else "")
                + ("" if math.isfinite(left) else "Lower the eccentricity, the unbalance or the field. ")
                + "Start from a neighbouring steady state, or follow the branch with `follow`; "
                  "a solver that stops does not show that there is no steady state.")


def first_guess(eq: Condensed, start: PeriodicOrbit) -> NDArray:
    """Unknowns of `eq` from an orbit that may have other harmonics or another number of revolutions in its period."""
    y = np.zeros_like(eq.linear)
    for k in range(start.harmonics + 1):
        order = k * eq.revolutions / start.equations.revolutions
        if order == int(order) <= eq.harmonics:
            own, new = max(2 * k - 1, 0), max(2 * int(order) - 1, 0)
            width = 2 if k else 1
            y[:, new:new + width] = start.local[:, own:own + width] / eq.length
    return y.ravel()


def orbit_from(eq: Condensed, eccentricity: float, centre: NDArray, solution: Solution) -> PeriodicOrbit:
    """The orbit of a solution."""
    return PeriodicOrbit(eq, float(eccentricity), centre, eq.length * solution.y.reshape(len(eq.linear), -1),
                         float(np.abs(solution.residual).max() * eq.force))
