"""Many harmonic balances in one call: machines, speeds, fields or eccentricities side by side.

A `Batch` stacks condensed systems; every array has the members first. Newton's method runs on all
of them at once, drops those that have converged, and never lets one that fails disturb the others.

A branch that follows a slider: all its points corrected together when the model changes a little.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.branches import Arclength, follow, path
from hydrolab.dynamics.continuation import Step, locate_fold
from hydrolab.dynamics.harmonic_balance import Condensed
from hydrolab.dynamics.harmonics import fourier_rows
from hydrolab.dynamics.results import Branch, SpecialPoint
from hydrolab.dynamics.solvers import QUADRATIC
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.model import Model
from hydrolab.machine.pull import CircularPull


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
    """Condensed systems side by side: stiffness (B, 2K, 2K), linear (B, 2K), length and force (B,),
    as in `Condensed`.

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
        return replace(self, stiffness=self.stiffness[index], linear=self.linear[index],
                       length=self.length[index],
                       force=self.force[index], law=law)

    def _positions(self, y: NDArray, centre: NDArray) -> NDArray:
        """Position relative to the stator, m, shape (2, B, N)."""
        path = y.reshape(len(y), 2, -1) @ self.rows
        return (path * self.length[:, None, None] - centre[:, :, None]).transpose(1, 0, 2)

    def linearise(self, y: NDArray, centre: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Residuals (B, 2K), Jacobians (B, 2K, 2K) and slopes of the pull's part (B, 2K, 2K), all
        scaled.

        y: (B, 2K). centre: stator centres, m, (B, 2).
        """
        members, columns, samples = len(y), *self.rows.shape
        force, slope, _ = self.law.linearise(self._positions(y, centre))
        analysis = (self.weights[:, None] * self.rows).T
        pull = (force @ analysis).transpose(1, 0, 2).reshape(members, -1) / self.force[:, None]
        residual = np.einsum("bij,bj->bi", self.stiffness, y - self.linear) - pull
        # The slope is symmetric: three blocks instead of four.
        products = np.einsum("nk,ln->nkl", analysis, self.rows).reshape(samples, -1)
        blocks = np.stack([slope[0, 0], slope[0, 1], slope[1, 1]]).reshape(-1, samples) @ products
        blocks = blocks.reshape(3, members, columns,
                                columns) * (self.length / self.force)[:, None, None]
        steep = np.empty((members, 2, columns, 2, columns))
        steep[:, 0, :, 0], steep[:, 1, :, 1] = blocks[0], blocks[2]
        steep[:, 0, :, 1] = steep[:, 1, :, 0] = blocks[1]
        steep = steep.reshape(members, 2 * columns, 2 * columns)
        return residual, self.stiffness - steep, steep


def stack(systems: Sequence[Condensed]) -> Batch:
    """Put condensed systems side by side.

    Raises BadInput where they differ in harmonics or samples, or a pull is not that of a circular
    gap.
    """
    first = systems[0]
    if any((s.harmonics, s.samples) != (first.harmonics, first.samples) for s in systems):
        raise BadInput("a batch needs systems with the same number of harmonics and samples.")
    if other := next((s.model for s in systems if type(s.model.law) is not CircularPull), None):
        raise BadInput(f"{other.name} has the law {type(other.law).__name__}; a batch takes "
                       "circular gaps only.")
    columns = 2 * first.harmonics + 1
    weights = np.full(columns, 2 / first.samples)
    weights[0] = 1 / first.samples
    law = CircularPull(np.array([[s.model.law.stiffness] for s in systems]),
                       np.array([[s.model.law.gap] for s in systems]))
    return Batch(np.stack([s.stiffness for s in systems]),
                 np.stack([s.linear.ravel() for s in systems]),
                 np.array([s.length for s in systems]), np.array([s.force for s in systems]), law,
                 fourier_rows(first.harmonics,
                              2 * np.pi * np.arange(first.samples) / first.samples), weights)


def newton_batch(batch: Batch, y: NDArray, centre: NDArray, tolerance: float = 1e-10,
                 max_steps: int = 25) -> tuple[NDArray, NDArray]:
    """Newton's method on every member; returns the unknowns (B, 2K) and an `Outcome` for each (B,).

    A step that leaves the gap or does not reduce a member's residual is halved for that member
    alone. As in `solvers.newton`, one more step is taken without looking back when the residual is
    below the tolerance.
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


MOVED = "It was moved along with the model from a branch followed before."
STRETCH = 3.0  # neighbouring points may come closer or move apart by this factor


def update_branch(branch: Branch, model: Model, speed: float | None = None) -> Branch:
    """The branch of a model near the one it was followed on, by one batched bordered Newton from
    the old points.

    Every point is corrected within the plane normal to the old branch, the first one at its own
    eccentricity, and the folds are located anew. Where the branch changes its topology, a point is
    lost or the gap is not circular, it is followed from scratch, up to half the gap. Raises
    BadInput for a branch along another parameter, and what `follow` raises where nothing is left to
    follow.
    """
    speed = branch.equations.speed if speed is None else speed
    if branch.parameter != "static_eccentricity":
        raise BadInput(f"the branch runs along {branch.parameter}; only branches along "
                       "static_eccentricity can be moved.")
    if not isinstance(branch.method, Arclength):  # a sweep, which knows no steps along a branch
        branch = replace(branch, method=Arclength(branch.method))
    balance = branch.method.balance
    if type(model.law) is not CircularPull:
        return _afresh(branch, model, speed)
    along = path(model, "static_eccentricity", balance, speed, branch.path.first,
                 float(np.arctan2(*branch.direction)))
    eq = balance.equations(model, speed)
    batch = stack([eq]).take(np.zeros(len(branch), dtype=int))
    old = np.column_stack([branch.unknowns, branch.static_eccentricity])
    corrected = _correct_together(batch, old, _normals(old),
                                  branch.direction * model.gap / eq.length,
                                  branch.direction * model.gap)
    if corrected is None:
        return _afresh(branch, model, speed)
    z, tangents, residuals = corrected
    turns = np.flatnonzero(tangents[:-1, -1] * tangents[1:, -1] < 0)
    if not _same_shape(branch, old, z, tangents, turns):
        return _afresh(branch, model, speed)
    system = along.system()
    folds = []
    for i in turns:
        before, after = (Step(z[j, :-1], z[j, -1], tangents[j], residuals[j], 0)
                         for j in (i, i + 1))
        fold = locate_fold(system, before, after)
        folds.append(SpecialPoint("fold", fold.parameter, int(i), fold.y,
                                  along.say(fold.parameter, 8)))
    return Branch(along, z[:, -1], z[:, :-1], residuals * eq.force, tuple(folds), MOVED,
                  branch.method,
                  branch.closed)


def _afresh(branch: Branch, model: Model, speed: float) -> Branch:
    first, method = branch.path.first, branch.method
    direction = float(np.arctan2(*branch.direction))
    try:
        start = method.balance.solve(model, speed, first, direction=direction, start=branch[0])
    except (NoConvergence, Contact):
        start = None
    ahead = np.copysign(0.5, np.diff(branch.values[:2]).sum())  # also from a lone point
    return follow(model, speed=speed, to=float(ahead), method=method, static_eccentricity=first,
                  direction=direction, start=start)


def _normals(z: NDArray) -> NDArray:
    """Unit directions along the branch at each point, from its neighbours; at the first point the
    parameter's own.
    """
    along = np.gradient(z, axis=0)
    along[0] = 0.0
    along[0, -1] = 1.0
    return along / np.linalg.norm(along, axis=1)[:, None]


def _correct_together(batch: Batch, old: NDArray, normals: NDArray, offset: NDArray, unit: NDArray,
                      tolerance: float = 1e-9,
                      max_steps: int = 6) -> tuple[NDArray, NDArray, NDArray] | None:
    """Points on the new branch (P, n + 1), their unit tangents and residuals; None if one does not
    settle.
    """
    points, n = old.shape[0], old.shape[1] - 1
    columns = n // 2
    z = old.copy()
    bordered = np.empty((points, n + 1, n + 1))
    bordered[:, n] = normals
    right = np.zeros((points, n + 1, 2))
    right[:, n, 1] = 1.0
    for _ in range(max_steps):
        residual, jacobian, steep = batch.linearise(z[:, :n], z[:, n:] * unit)
        bordered[:, :n, :n] = jacobian
        bordered[:, :n, n] = steep[:, :, 0] * offset[0] + steep[:, :, columns] * offset[1]
        right[:, :n, 0] = residual
        right[:, n, 0] = np.einsum("pi,pi->p", normals, z - old)
        if not np.isfinite(residual).all():
            return None
        answer = np.linalg.solve(bordered, right)
        size = np.linalg.norm(residual, axis=1)
        if size.max() < tolerance:
            tangents = answer[:, :, 1]
            return z, tangents / np.linalg.norm(tangents, axis=1)[:, None], size
        z -= answer[:, :, 0]
    return None


def _same_shape(branch: Branch, old: NDArray, z: NDArray, tangents: NDArray,
                turns: NDArray) -> bool:
    """Whether the moved points still draw the same curve: in order, evenly spaced, with as many
    folds.
    """
    before, after = np.diff(old, axis=0), np.diff(z, axis=0)
    stretch = np.linalg.norm(after, axis=1) / np.linalg.norm(before, axis=1)
    onward = np.einsum("pi,pi->p", after, tangents[:-1]) * np.sign(np.einsum("pi,pi->p", before,
                                                                             after))
    return (len(turns) == len(branch.folds) and bool((stretch < STRETCH).all())
            and bool((stretch > 1 / STRETCH).all())
            and bool((onward > 0).all()))
