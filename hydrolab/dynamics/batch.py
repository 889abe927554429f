"""Many harmonic balances in one call: machines, speeds, fields or eccentricities side by side.

A `Batch` stacks condensed systems; every array has the members first. Newton's method runs on all of them at
once, drops those that have converged, and never lets one that fails disturb the others.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.condensation import Condensed, fourier_rows
from hydrolab.dynamics.solvers import QUADRATIC
from hydrolab.errors import BadInput
from hydrolab.machine.forces import CircularPull


class Outcome(IntEnum):
    """How a member of a batch ended."""

    CONVERGED = 0
    STALLED = 1  # the residual could not be reduced further: no steady state near the start, or a fold
    OUTSIDE = 2  # the start is outside the gap
    BEYOND_FOLD = 3  # the first leg of the branch ends before this point
    NO_START = 4  # there is no steady state to begin with
    NOT_DONE = 5  # interrupted before its turn


@dataclass(frozen=True, eq=False)
class Batch:
    """Condensed systems side by side: stiffness (B, 2K, 2K), linear (B, 2K), length and force (B,), as in `Condensed`.

    law: the pull with one strength and gap per member, each of shape (B, 1).
    """

    stiffness: NDArray
    linear: NDArray
    length: NDArray
    force: NDArray
    law: CircularPull
    rows: NDArray
    weights: NDArray

    def __len__(self) -> int:
        return len(self.length)

    def take(self, index: NDArray) -> Batch:
        """The members at these indices (repeats allowed)."""
        law = replace(self.law, stiffness=self.law.stiffness[index], gap=self.law.gap[index])
        return replace(self, stiffness=self.stiffness[index], linear=self.linear[index], length=self.length[index],
                       force=self.force[index], law=law)

    def _positions(self, y: NDArray, centre: NDArray) -> NDArray:
        """Position relative to the stator, m, shape (2, B, N)."""
        path = y.reshape(len(y), 2, -1) @ self.rows
        return (path * self.length[:, None, None] - centre[:, :, None]).transpose(1, 0, 2)

    def linearise(self, y: NDArray, centre: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Residuals (B, 2K), Jacobians (B, 2K, 2K) and slopes of the pull's part (B, 2K, 2K), all scaled.

        y: (B, 2K). centre: stator centres, m, (B, 2).
        """
        members, columns, samples = len(y), *self.rows.shape
        force, slope = self.law.linearise(self._positions(y, centre))
        analysis = (self.weights[:, None] * self.rows).T
        pull = (force @ analysis).transpose(1, 0, 2).reshape(members, -1) / self.force[:, None]
        residual = np.einsum("bij,bj->bi", self.stiffness, y - self.linear) - pull
        # The slope is symmetric: three blocks instead of four.
        products = np.einsum("nk,ln->nkl", analysis, self.rows).reshape(samples, -1)
        blocks = np.stack([slope[0, 0], slope[0, 1], slope[1, 1]]).reshape(-1, samples) @ products
        blocks = blocks.reshape(3, members, columns, columns) * (self.length / self.force)[:, None, None]
        steep = np.empty((members, 2, columns, 2, columns))
        steep[:, 0, :, 0], steep[:, 1, :, 1] = blocks[0], blocks[2]
        steep[:, 0, :, 1] = steep[:, 1, :, 0] = blocks[1]
        steep = steep.reshape(members, 2 * columns, 2 * columns)
        return residual, self.stiffness - steep, steep


def stack(systems: Sequence[Condensed]) -> Batch:
    """Put condensed systems side by side.

    Raises BadInput where they differ in harmonics or samples, or a pull is not that of a circular gap.
    """
    first = systems[0]
    if any((s.harmonics, s.samples) != (first.harmonics, first.samples) for s in systems):
        raise BadInput("a batch needs systems with the same number of harmonics and samples.")
    if other := next((s.model for s in systems if type(s.model.law) is not CircularPull), None):
        raise BadInput(f"{other.name} has the law {type(other.law).__name__}; a batch takes circular gaps only.")
    columns = 2 * first.harmonics + 1
    weights = np.full(columns, 2 / first.samples)
    weights[0] = 1 / first.samples
    law = CircularPull(np.array([[s.model.law.stiffness] for s in systems]), np.array([[s.model.law.gap] for s in systems]))
    return Batch(np.stack([s.stiffness for s in systems]), np.stack([s.linear.ravel() for s in systems]),
                 np.array([s.length for s in systems]), np.array([s.force for s in systems]), law,
                 fourier_rows(first.harmonics, 2 * np.pi * np.arange(first.samples) / first.samples), weights)


def newton_batch(batch: Batch, y: NDArray, centre: NDArray, tolerance: float = 1e-10,
                 max_steps: int = 25) -> tuple[NDArray, NDArray]:
    """Newton's method on every member; returns the unknowns (B, 2K) and an `Outcome` for each (B,).

    A step that leaves the gap or does not reduce a member's residual is halved for that member alone. As in
    `solvers.newton`, one more step is taken without looking back when the residual is below the tolerance.
    """
    y = y.copy()
    outcome = np.full(len(y), Outcome.STALLED, dtype=np.int8)
    active, part, at = np.arange(len(y)), batch, centre
    r, jacobian, _ = part.linearise(y, at)
    size = np.linalg.norm(r, axis=1)
    outcome[~np.isfinite(size)] = Outcome.OUTSIDE
    keep = np.isfinite(size)
    for count in range(max_steps + 1):
        if not keep.all():
            active, part, at = active[keep], part.take(keep), at[keep]
            r, jacobian, size = r[keep], jacobian[keep], size[keep]
        if not len(active):
            break
        step = solve_each(jacobian, r)
        length = np.linalg.norm(step, axis=1)
        done = size < tolerance
        outcome[active[done]] = Outcome.CONVERGED
        last = done & (length < QUADRATIC)  # at a fold the last step would lead away; false for nan
        y[active[last]] -= step[last]
        going = ~done & np.isfinite(length)
        if count == max_steps or not going.any():
            break
        active, part, at = active[going], part.take(going), at[going]
        step, size = step[going], size[going]
        share = np.ones(len(active))
        trial = y[active] - step
        r, jacobian, _ = part.linearise(trial, at)
        new_size = np.linalg.norm(r, axis=1)
        for _ in range(11):
            worse = ~((new_size < size) | (new_size < tolerance))  # true for nan
            if not worse.any():
                break
            share[worse] /= 2
            trial[worse] = y[active[worse]] - share[worse, None] * step[worse]
            r[worse], jacobian[worse], _ = part.take(worse).linearise(trial[worse], at[worse])
            new_size[worse] = np.linalg.norm(r[worse], axis=1)
        keep = (new_size < size) | (new_size < tolerance)
        y[active[keep]] = trial[keep]
        size = new_size
    return y, outcome


def solve_each(matrices: NDArray, right: NDArray) -> NDArray:
    """Solutions of many small systems, (B, n); nan where a matrix is singular."""
    try:
        return np.linalg.solve(matrices, right[..., None])[..., 0]
    except np.linalg.LinAlgError:  # one singular member must not stop the others
        out = np.full_like(right, np.nan)
        for i, (matrix, r) in enumerate(zip(matrices, right, strict=True)):
            with contextlib.suppress(np.linalg.LinAlgError):
                out[i] = np.linalg.solve(matrix, r)
        return out
