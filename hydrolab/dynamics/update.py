"""A branch that follows a slider: all its points corrected together when the model changes a little."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.arclength import Step, locate_fold
from hydrolab.dynamics.batch import Batch, stack
from hydrolab.dynamics.continuation import follow
from hydrolab.dynamics.parameters import path
from hydrolab.dynamics.results import Branch, SpecialPoint
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.forces import CircularPull
from hydrolab.machine.model import Model

MOVED = "It was moved along with the model from a branch followed before."
STRETCH = 3.0  # neighbouring points may come closer or move apart by this factor


def update_branch(branch: Branch, model: Model, speed: float | None = None) -> Branch:
    """The branch of a model near the one it was followed on, by one batched bordered Newton from the old points.

    Every point is corrected within the plane normal to the old branch, the first one at its own eccentricity, and
    the folds are located anew. Where the branch changes its topology, a point is lost or the gap is not circular, it is
    followed from scratch, up to half the gap.
    Raises BadInput for a branch along another parameter, and what `follow` raises where nothing is left to follow.
    """
    speed = branch.equations.speed if speed is None else speed
    if branch.parameter != "static_eccentricity":
        raise BadInput(f"the branch runs along {branch.parameter}; only branches along static_eccentricity can be moved.")
    balance = branch.method.balance
    if type(model.law) is not CircularPull:
        return _afresh(branch, model, speed)
    along = path(model, "static_eccentricity", balance, speed, branch.path.first, float(np.arctan2(*branch.direction)))
    eq = balance.equations(model, speed)
    batch = stack([eq]).take(np.zeros(len(branch), dtype=int))
    old = np.column_stack([branch.unknowns, branch.static_eccentricity])
    corrected = _correct_together(batch, old, _normals(old), branch.direction * model.gap / eq.length,
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
        before, after = (Step(z[j, :-1], z[j, -1], tangents[j], residuals[j], 0) for j in (i, i + 1))
        fold = locate_fold(system, before, after)
        folds.append(SpecialPoint("fold", fold.parameter, int(i), fold.y, along.say(fold.parameter, 8)))
    return Branch(along, z[:, -1], z[:, :-1], residuals * eq.force, tuple(folds), MOVED, branch.method,
                  branch.closed)


def _afresh(branch: Branch, model: Model, speed: float) -> Branch:
    first, direction, method = branch.path.first, float(np.arctan2(*branch.direction)), branch.method
    try:
        start = method.balance.solve(model, speed, first, direction=direction, start=branch[0])
    except (NoConvergence, Contact):
        start = None
    return follow(model, speed=speed, to=float(np.copysign(0.5, branch.values[1] - first)), method=method,
                  static_eccentricity=first, direction=direction, start=start)


def _normals(z: NDArray) -> NDArray:
    """Unit directions along the branch at each point, from its neighbours; at the first point the parameter's own."""
    along = np.gradient(z, axis=0)
    along[0] = 0.0
    along[0, -1] = 1.0
    return along / np.linalg.norm(along, axis=1)[:, None]


def _correct_together(batch: Batch, old: NDArray, normals: NDArray, offset: NDArray, unit: NDArray,
                      tolerance: float = 1e-9, max_steps: int = 6) -> tuple[NDArray, NDArray, NDArray] | None:
    """Points on the new branch (P, n + 1), their unit tangents and residuals; None if one does not settle."""
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


def _same_shape(branch: Branch, old: NDArray, z: NDArray, tangents: NDArray, turns: NDArray) -> bool:
    """Whether the moved points still draw the same curve: in order, evenly spaced, with as many folds."""
    before, after = np.diff(old, axis=0), np.diff(z, axis=0)
    stretch = np.linalg.norm(after, axis=1) / np.linalg.norm(before, axis=1)
    onward = np.einsum("pi,pi->p", after, tangents[:-1]) * np.sign(np.einsum("pi,pi->p", before, after))
    return (len(turns) == len(branch.folds) and bool((stretch < STRETCH).all()) and bool((stretch > 1 / STRETCH).all())
            and bool((onward > 0).all()))
