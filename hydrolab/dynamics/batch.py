"""Many harmonic balances in one call: machines, speeds, fields or eccentricities side by side.

A `Batch` stacks condensed systems; every array has the members first. Newton's method runs on all
of them at once, drops those that have converged, and never lets one that fails disturb the others.
`update_branch` makes a branch follow a slider: all its points corrected together when the model
changes a little.

Here y: unknowns, scaled, (B, 2K). centre: of the stator, m, (B, 2). max_steps: of Newton. matrices,
right: (B, n, n) and (B, n).
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import cast

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.harmonic_balance import BALANCED, Condensed
from hydrolab.dynamics.harmonics import fourier_rows
from hydrolab.dynamics.solvers import QUADRATIC
from hydrolab.errors import BadInput
from hydrolab.machine.pull import CircularPull

TOLERANCE = 1e-10  # of the scaled residual


class Outcome(IntEnum):
    """How a member of a batch ended."""

    CONVERGED = 0
    # the residual could not be reduced further: no steady state near the start, or a fold
    STALLED = 1
    OUTSIDE = 2  # the start is outside the gap
    BEYOND_FOLD = 3  # the first leg of the branch ends before this point
    NO_START = 4  # there is no steady state to begin with
    NOT_DONE = 5  # interrupted before its turn


@dataclass(frozen=True, eq=False)
class Batch:
    """Condensed systems of round gaps side by side: stiffness (B, 2K, 2K), linear (B, 2K), length
    and force (B,), as in `Condensed`.

    pull: strength k and gap g0 of each member's pull, (2, B, 1). rows, analysis: from coefficients
    to samples and back, (K, N) and (N, K). products: both in one, (N, K²).
    """

    stiffness: NDArray
    linear: NDArray
    length: NDArray
    force: NDArray
    pull: NDArray
    rows: NDArray
    analysis: NDArray
    products: NDArray

    def __len__(self) -> int:
        return len(self.length)

    @property
    def law(self) -> CircularPull:
        """The pull with one strength and gap per member."""
        return CircularPull(*self.pull)

    def take(self, index: NDArray) -> Batch:
        """The members at these indices (repeats allowed)."""
        return replace(self, stiffness=self.stiffness[index], linear=self.linear[index],
                       length=self.length[index], force=self.force[index], pull=self.pull[:, index])

    def _positions(self, y: NDArray, centre: NDArray) -> NDArray:
        """Position relative to the stator, m, shape (2, B, N)."""
        path = y.reshape(len(y), 2, -1) @ self.rows
        return (path * self.length[:, None, None] - centre[:, :, None]).transpose(1, 0, 2)

    def _harmonics(self, force: NDArray) -> NDArray:
        """Harmonics of the pull from its samples, N, (2, B, N): scaled, (B, 2K)."""
        found = (force @ self.analysis).transpose(1, 0, 2).reshape(force.shape[1], -1)
        return found / self.force[:, None]

    def linearise(self, y: NDArray, centre: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Residuals (B, 2K), Jacobians (B, 2K, 2K) and slopes of the pull's part (B, 2K, 2K), all
        scaled.

        y: (B, 2K). centre: stator centres, m, (B, 2).
        """
        members, (columns, samples) = len(y), self.rows.shape
        force, slope, _ = self.law.linearise(self._positions(y, centre))
        residual = np.einsum("bij,bj->bi", self.stiffness, y - self.linear) - self._harmonics(force)
        # The slope is symmetric: three blocks instead of four.
        blocks = np.stack([slope[0, 0], slope[0, 1], slope[1, 1]]).reshape(-1, samples)
        blocks = (blocks @ self.products).reshape(3, members, columns, columns)
        blocks = blocks * (self.length / self.force)[:, None, None]
        steep = np.empty((members, 2, columns, 2, columns))
        steep[:, 0, :, 0], steep[:, 1, :, 1] = blocks[0], blocks[2]
        steep[:, 0, :, 1] = steep[:, 1, :, 0] = blocks[1]
        pull = steep.reshape(members, 2 * columns, 2 * columns)
        return residual, self.stiffness - pull, pull

    def balanced(self, y: NDArray, centre: NDArray) -> NDArray:
        """Whether what is left over is small against the forces, the pull and the unbalance, (B,).
        """
        pull = self._harmonics(self.law.force(self._positions(y, centre)))
        driven, held = (np.einsum("bij,bj->bi", self.stiffness, x) for x in (self.linear, y))
        forces = np.maximum(np.abs(pull).max(axis=1), np.abs(driven).max(axis=1))
        return np.abs(held - driven - pull).max(axis=1) <= BALANCED * forces


def stack(systems: Sequence[Condensed]) -> Batch:
    """Put condensed systems side by side.

    Raises BadInput where they differ in harmonics or samples, or a pull is not that of a circular
    gap.
    """
    first = systems[0]
    if any((s.harmonics, s.samples) != (first.harmonics, first.samples) for s in systems):
        raise BadInput("a batch needs systems with the same number of harmonics and samples.")
    if other := next((s.model for s in systems if not s.model.law.closed_form), None):
        raise BadInput(f"{other.name} has the law {type(other.law).__name__}; a batch takes "
                       "circular gaps only.")
    weights = np.full((2 * first.harmonics + 1, 1), 2 / first.samples)
    weights[0] = 1 / first.samples
    rows = fourier_rows(first.harmonics, 2 * np.pi * np.arange(first.samples) / first.samples)
    analysis = (weights * rows).T
    laws = [cast(CircularPull, s.model.law) for s in systems]
    return Batch(np.stack([s.stiffness for s in systems]),
                 np.stack([s.linear.ravel() for s in systems]),
                 np.array([s.length for s in systems]), np.array([s.force for s in systems]),
                 np.array([[[law.stiffness] for law in laws], [[law.gap] for law in laws]]),
                 rows, analysis, np.einsum("nk,ln->nkl", analysis, rows).reshape(first.samples, -1))


def newton_batch(batch: Batch, y: NDArray, centre: NDArray,
                 max_steps: int = 25) -> tuple[NDArray, NDArray]:
    """Newton's method on every member; returns the unknowns (B, 2K) and an `Outcome` for each (B,).

    y: where to start, (B, 2K). centre: stator centres, m, (B, 2). A step that leaves the gap or
    does not reduce a member's residual is halved for that member alone. As in `solvers.newton`, one
    more step is taken without looking back when the residual is below TOLERANCE.
    """
    y = y.copy()
    outcome = np.full(len(y), Outcome.STALLED, dtype=np.int8)
    active, part, at = np.arange(len(y)), batch, centre
    r, jacobian, _ = part.linearise(y, at)
    size = np.linalg.norm(r, axis=1)
    keep = np.isfinite(size)
    outcome[~keep] = Outcome.OUTSIDE
    for count in range(max_steps + 1):
        # go on with those that neither left the gap nor stalled
        if not keep.all():
            active, part, at = active[keep], part.take(keep), at[keep]
            r, jacobian, size = r[keep], jacobian[keep], size[keep]
        if not len(active):
            break
        step = solve_each(jacobian, r)
        length = np.linalg.norm(step, axis=1)
        # those that are done take this last step, but not at a fold, where it would lead away
        done = size < TOLERANCE
        outcome[active[done]] = Outcome.CONVERGED
        last = done & (length < QUADRATIC)  # false for nan
        y[active[last]] -= step[last]
        going = ~done & np.isfinite(length)
        if count == max_steps or not going.any():
            break
        # the others take theirs, halved as often as they must
        active, part, at = active[going], part.take(going), at[going]
        y[active], r, jacobian, new = _halved(part, y[active], step[going], at, size[going])
        keep, size = (new < size[going]) | (new < TOLERANCE), new
    found = np.flatnonzero(outcome == Outcome.CONVERGED)
    if len(found):
        held = batch.take(found).balanced(y[found], centre[found])
        outcome[found[~held]] = Outcome.STALLED
    return y, outcome


def _halved(part: Batch, y: NDArray, step: NDArray, centre: NDArray,
            size: NDArray) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Unknowns after the longest steps that reduce residuals; these, Jacobians and sizes."""
    share = np.ones(len(y))
    trial = y - step
    r, jacobian, _ = part.linearise(trial, centre)
    new = np.linalg.norm(r, axis=1)
    for _ in range(11):
        worse = ~((new < size) | (new < TOLERANCE))  # true for nan
        if not worse.any():
            return trial, r, jacobian, new
        share[worse] /= 2
        trial[worse] = y[worse] - share[worse, None] * step[worse]
        r[worse], jacobian[worse], _ = part.take(worse).linearise(trial[worse], centre[worse])
        new[worse] = np.linalg.norm(r[worse], axis=1)
    better = (new < size) | (new < TOLERANCE)
    return np.where(better[:, None], trial, y), r, jacobian, new


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
