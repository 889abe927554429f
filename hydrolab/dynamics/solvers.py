"""Two solvers for a small nonlinear system: Newton, and the dog-leg the paper used.

A system is a function y → (residual, Jacobian), scaled so that unknowns and residuals are of order
one. Both return a `Solution`; neither raises when it fails, because only the caller knows what to
advise.

y: where to begin. tolerance: of the residual. max_steps: how many.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgesv
from scipy.optimize import root

System = Callable[[NDArray], tuple[NDArray, NDArray]]
QUADRATIC = 1e-6  # a Newton step below this leaves an error of about its square


@dataclass(frozen=True)
class Solution:
    """Where a solver ended: y, its residual and Jacobian, steps taken, whether y is a solution."""

    y: NDArray
    residual: NDArray
    jacobian: NDArray
    steps: int
    converged: bool

    @property
    def smallest_singular_value(self) -> float:
        """Smallest singular value of the scaled Jacobian; near zero at a fold."""
        if not np.isfinite(self.jacobian).all():
            return float("nan")
        return float(np.linalg.svd(self.jacobian, compute_uv=False)[-1])


def newton(system: System, y: NDArray, tolerance: float = 1e-10, max_steps: int = 30) -> Solution:
    """Newton's method; a step that leaves the domain or does not reduce the residual is halved.

    Converged when the residual is below `tolerance`. The Jacobian is at hand then, so one more step
    is taken without looking back; the residual returned is that before it, hence an upper bound.
    """
    r, jacobian = system(y)
    size = r @ r
    for steps in range(1, max_steps + 1):
        if not np.isfinite(size):
            break
        *_, step, singular = dgesv(jacobian, r)
        if size < tolerance**2:
            # at a fold the last step would lead away
            safe = not singular and step @ step < QUADRATIC**2
            return Solution(y - step if safe else y, r, jacobian, steps, True)
        if singular:
            break
        for halvings in range(12):
            trial = y - step / 2**halvings
            r_trial, jacobian_trial = system(trial)
            size_trial = r_trial @ r_trial
            if size_trial < size or size_trial < tolerance**2:  # false for nan: outside the gap
                break
        else:
            break
        y, r, jacobian, size = trial, r_trial, jacobian_trial, size_trial
    return Solution(y, r, jacobian, steps, False)


def powell_dog_leg(system: System, y: NDArray, tolerance: float = 1e-10) -> Solution:
    """Powell's hybrid dog-leg (MINPACK through SciPy) with the analytic Jacobian.

    MINPACK may stop at a point where the residual is only stationary. Near a fold that is a
    least-squares minimum and no solution, so convergence is judged by the residual alone.
    """
    # MINPACK cannot take nan: a large residual turns it back into the gap
    outside = np.full(len(y), 1e6)

    def guarded(y: NDArray) -> tuple[NDArray, NDArray]:
        r, jacobian = system(y)
        return (r, jacobian) if np.isfinite(r).all() else (outside, np.eye(len(y)))

    found = root(guarded, y, jac=True, method="hybr", options={"xtol": 1e-13})
    r, jacobian = system(found.x)
    return Solution(found.x, r, jacobian, found.nfev, bool(np.abs(r).max() < tolerance))
