"""Design practice against the nonlinear answer: the pull as a negative stiffness, which tools of
rotordynamics can take.

Both are steady states of the same machine; only the law in the gap differs. What a designer reads
off is compared: critical speed, 1X amplitude, bearing force and static bend.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.branches import Arclength, follow
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.harmonics import ellipse, fourier_rows
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.model import Model
from hydrolab.machine.pull import CircularPull, LinearPull

PHASES = np.linspace(0, 2 * np.pi, 360, endpoint=False)
NOTHING = 1e-9  # of the gap: a bend below this is none


def practice(model: Model) -> Model:
    """The model with its pull as design tools take it, F = k e.

    Raises BadInput for a law that is not the plain pull of a circular gap.
    """
    if type(model.law) is not CircularPull:
        raise BadInput(f"{model.name} has the law {type(model.law).__name__}; the practice "
                       "replaces the plain pull of a "
                       "circular gap, so leave out the poles, shapes and other laws.")
    return replace(model, law=LinearPull(model.law.stiffness, model.law.gap))


class DesignNumbers(NamedTuple):
    """What a designer reads off a steady state.

    critical_speed: lowest undamped synchronous speed with the pull's mean slope along the orbit,
    rad/s, nan where that slope is more than the shaft can hold. amplitude: long half axis of 1X at
    the generator, m. bearing_force: largest radial force in a bearing over a revolution, N. bend:
    mean displacement of the generator, m.
    """

    critical_speed: float
    amplitude: float
    bearing_force: float
    bend: float


def design_numbers(orbit: PeriodicOrbit) -> DesignNumbers:
    """The numbers of one steady state."""
    model = orbit.model
    slope = model.law.linearise(orbit.positions(PHASES) - orbit.centre[:, None])[1].mean(axis=-1)
    stiffness = model.K - model.selection.T @ slope @ model.selection
    shape = ellipse(orbit.coefficients)
    motion = orbit.shaft @ fourier_rows(orbit.harmonics, PHASES)
    forces = [model.support_stiffness[name] * float(np.hypot(*(rows @ motion)).max())
              for name, rows in model.supports.items()]
    return DesignNumbers(critical_speed(model, stiffness), shape.major,
                         max(forces, default=math.nan),
                         float(np.hypot(*orbit.mean)))




def critical_speed(model: Model, stiffness: NDArray) -> float:
    """Lowest ω of K q = ω² (M − i G) q, rad/s: free undamped motion in step with the rotation, in
    either sense.

    nan where the stiffness is not positive definite: the rotor is pulled away.
    """
    if scipy.linalg.eigvalsh(stiffness, subset_by_index=[0, 0])[0] <= 0:
        return math.nan
    # 1/ω² is the largest eigenvalue of the Hermitian pencil (M − iG, K), whose second matrix is
    # positive definite
    last = len(stiffness) - 1
    inverse = scipy.linalg.eigh(model.M - 1j * model.G, stiffness, eigvals_only=True,
                                subset_by_index=[last, last])[0]
    return 1 / math.sqrt(inverse)


@dataclass(frozen=True, eq=False)
class PracticeErrors:
    """Errors of the practice, practice/nonlinear − 1, over field and static eccentricity; nan past
    the fold, (f, e).

    eccentricities: fractions of the gap, (e,). fields: factors on the card's flux density, (f,).
    folds: the first fold of each field, fraction of the gap, nan where there is none, (f,). The
    four errors are those of `DesignNumbers`; the critical speed's is nan as well where one of the
    two has none.
    """

    speed: float
    eccentricities: NDArray
    fields: NDArray
    folds: NDArray
    critical_speed: NDArray
    amplitude: NDArray
    bearing_force: NDArray
    bend: NDArray

    @property
    def worst(self) -> NDArray:
        """Largest of the four errors by size, (f, e); nan past the fold, where the practice has no
        equal.
        """
        errors = np.abs(np.stack([getattr(self, name) for name in DesignNumbers._fields]))
        reached = np.isfinite(self.amplitude)
        return np.where(reached, np.nanmax(np.where(np.isfinite(errors), errors, 0), axis=0),
                        np.nan)

    def safe_to(self, tolerance: float = 0.05) -> NDArray:
        """Eccentricity up to which all errors stay within a tolerance, for each field, on the grid;
        nan if nowhere, (f,).
        """
        inside = np.logical_and.accumulate(self.worst <= tolerance, axis=1)
        return np.where(inside[:, 0], self.eccentricities[np.maximum(inside.sum(axis=1) - 1, 0)],
                        np.nan)


def compare(model: Model, speed: float, static_eccentricity: float = 0.0, *,
            harmonics: int = 6) -> tuple[DesignNumbers, DesignNumbers]:
    """The numbers by the practice and by the nonlinear pull at one speed (rad/s) and eccentricity.
    """
    linear = HarmonicBalance(1).solve(practice(model), speed, static_eccentricity)
    return design_numbers(linear), design_numbers(HarmonicBalance(harmonics).solve(model, speed,
                                                                                   static_eccentricity))


def practice_errors(model: Model, speed: float, eccentricities: ArrayLike,
                    field_factors: ArrayLike, *,
                    harmonics: int = 6, progress: Callable[[int, int], None]
                    | None = None) -> PracticeErrors:
    """Map the errors of the practice over static eccentricity (fractions of the gap, from 0) and
    field (factors).

    The nonlinear branch is followed to its first fold; past it the map is empty.
    """
    eccentricities, factors = np.asarray(eccentricities, dtype=float), np.asarray(field_factors,
                                                                                  dtype=float)
    if (eccentricities < 0).any() or (np.diff(eccentricities) <= 0).any():
        raise BadInput("eccentricities must ascend from 0 or more; they are fractions of the gap.")
    errors = np.full((len(DesignNumbers._fields), len(factors), len(eccentricities)), np.nan)
    folds = np.full(len(factors), np.nan)
    for i, factor in enumerate(factors):
        there = model.with_field(float(factor))
        errors[:, i], folds[i] = _row(there, speed, eccentricities, HarmonicBalance(harmonics))
        if progress:
            progress(i + 1, len(factors))
    return PracticeErrors(speed, eccentricities, factors, folds, *errors)


def _row(model: Model, speed: float, eccentricities: NDArray,
         balance: HarmonicBalance) -> tuple[NDArray, float]:
    """Errors of the four numbers at one field, (4, e), and where the first fold is."""
    errors = np.full((len(DesignNumbers._fields), len(eccentricities)), np.nan)
    try:
        branch = follow(model, speed=speed, to=max(1.05 * float(eccentricities[-1]), 1e-3),
                        method=Arclength(balance, max_folds=1, tail=0))
    except (NoConvergence, Contact):
        return errors, math.nan
    fold = branch.folds[0].value if branch.folds else math.nan
    known = branch.static_eccentricity[branch.first_leg]
    linear = practice(model)
    for j, value in enumerate(eccentricities):
        if value >= fold:
            break
        start = branch[int(np.argmin(np.abs(known - value)))]
        exact = design_numbers(balance.solve(model, speed, float(value), start=start))
        simple = design_numbers(HarmonicBalance(1).solve(linear, speed, float(value)))
        errors[:, j] = [_error(a, b, NOTHING * model.gap if name == "bend" else 0.0)
                        for name, a, b in zip(DesignNumbers._fields, simple, exact, strict=True)]
    return errors, fold


def _error(simple: float, exact: float, nothing: float) -> float:
    """practice/nonlinear − 1, and 0 where both are nothing."""
    return 0.0 if max(abs(simple), abs(exact)) <= nothing else simple / exact - 1
