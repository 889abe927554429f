"""A smaller model for work in time: the lowest modes, and what acts on the machine beside them.

Plain truncation loses the static stiffness that the cut modes give the generator, and with it moves
the fold. Adding the deflection under a unit force at each nonlinear coordinate restores it exactly
(MacNeal 1971, Rubin 1975: residual flexibility). In a turning machine a push also tilts the shaft,
and the discs answer with a gyroscopic moment that the lowest modes carry poorly: the deflection
under that moment, K⁻¹ G K⁻¹ Sᵀ, is added where asked for. With it multipliers are a hundred times
nearer to those of all DOFs.

Modes at rest know nothing of dashpots, seals and cross-coupling. At a known speed the basis is
therefore compared with all DOFs: where its answer to the unbalance and to a force at the nonlinear
coordinates is off at kΩ, the answer of all DOFs is added (moment matching, Grimme 1997), and so are
free motions that grow or die out slowest and are not in it.

Here speed: rad/s. harmonics: m.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from hydrolab.dynamics.harmonic_balance import SINGULAR, dynamic_stiffness
from hydrolab.dynamics.modes import modes as modes_of
from hydrolab.dynamics.results import BASIS
from hydrolab.errors import BadInput
from hydrolab.machine.model import Model
from hydrolab.machine.quantities import require_model, whole

HARMONICS = 4  # of the speed, at which its answers are compared
EVEN = 1e-9  # a damping ratio below this is rounding
SLOWEST = 3  # free motions that must be in it, beside those that grow


@lru_cache(maxsize=64)
def reduce(model: Model, modes: int = 12, gyroscopic: bool = False, *, speed: float | None = None,
           tolerance: float = BASIS) -> Model:
    """The model on its `modes` lowest modes at rest and the static deflections under the pull.

    gyroscopic: add the deflections under the gyroscopic moments of these. speed: rad/s; add what
    this basis lacks there, so that its answers from 0X to 4X and its slowest free motions are right
    to `tolerance`, relatively, and those that grow are in it. The new DOFs are the modes of that
    subspace, so M is the identity and K is diagonal where it was symmetric. A model with no more
    DOFs than the basis comes back in all its modes. Raises BadInput if `modes` is not a whole
    number of at least 1, or for what is no model.
    """
    require_model(model)
    whole("modes", modes, 1)
    model = model if speed is None else model.at(speed)
    if not np.linalg.cond(model.K, 1) < 1 / SINGULAR:
        raise BadInput(f"{model.name} can move freely, so it has no static deflection; give it "
                       "bearings.")
    try:
        if modes + (2 if gyroscopic else 1) * len(model.selection) >= model.size:
            return _on(model, np.eye(model.size))
        squares, shapes = scipy.linalg.eigh((model.K + model.K.T) / 2, model.M,
                                            subset_by_index=(0, modes - 1))
        # a load that stands still is a force whose deflection must be in the basis as well
        acting = np.column_stack([model.selection.T, model.static])
        static = np.linalg.solve(model.K, acting[:, acting.any(axis=0)])
        tilting = np.linalg.solve(model.K, model.G @ static) if gyroscopic else static[:, :0]
        basis = _independent(np.hstack([shapes, static, tilting]))
        small = _on(model, basis)
        if speed is None:
            return small
        highest = float(np.sqrt(np.abs(squares[-1])))
        missing = _missing(model, small, float(speed), highest, tolerance)
        return _on(model, _independent(np.hstack([basis, missing]))) if missing.size else small
    except np.linalg.LinAlgError as error:
        raise BadInput(f"{model.name} has a DOF without mass, so it has no modes; give the shaft a "
                       "density above 0.") from error


def _independent(columns: NDArray) -> NDArray:
    """An orthonormal basis of the columns, without what the columns before already span."""
    columns = columns[:, np.abs(columns).max(axis=0) > 0]
    basis, left = scipy.linalg.qr(columns / np.linalg.norm(columns, axis=0), mode="economic")
    return basis[:, np.abs(np.diag(left)) > 1e-10]


def _on(model: Model, basis: NDArray) -> Model:
    """The model in the modes at rest of a subspace."""
    K = basis.T @ model.K @ basis
    return model.on_basis(basis @ scipy.linalg.eigh((K + K.T) / 2, basis.T @ model.M @ basis)[1])


def _missing(model: Model, small: Model, speed: float, highest: float, tolerance: float) -> NDArray:
    """Answers and free motions below highest, rad/s, that a basis lacks to tolerance, (n, any)."""
    lacking = [np.empty((model.size, 0))]
    for k in range(HARMONICS + 1):
        exact, own = (np.linalg.solve(dynamic_stiffness(m, k * speed, speed), np.column_stack(
            [m.selection.T, m.loads(speed)[1]])) for m in (model, small))
        seen, rough = model.selection @ exact, small.selection @ own
        # a column for each load, each against its own size
        away = np.abs(seen - rough).max(axis=0) > tolerance * np.abs(seen).max(axis=0)
        if k != 1:
            away[-1] = False
        lacking.append(exact[:, away])
    free, known = modes_of(model, speed), modes_of(small, speed)
    growth = np.where(free.damping_ratios < -EVEN, free.eigenvalues.real, 0)
    decay = np.where(free.damping_ratios > EVEN, free.eigenvalues.real, 0)
    decay[(free.frequencies > highest) & (growth == 0)] = -np.inf
    order = np.argsort(-growth - decay, kind="stable")
    slow = order[:max(SLOWEST, int(np.sum(growth > 0)))]
    apart = np.abs(free.eigenvalues[slow][:, None] - known.eigenvalues).min(axis=1, initial=np.inf)
    new = (growth[slow] > 0) | (apart > tolerance * np.abs(free.eigenvalues[slow]))
    lacking.append(free.shapes[:, slow[new]])
    columns = np.hstack(lacking)
    return np.hstack([columns.real, columns.imag])


def deflection(model: Model, by: tuple[float, float]) -> NDArray:
    """The static deflection of all DOFs under a force that moves the generator `by` (x, z), m."""
    generator = model.selection[:2]
    static = np.linalg.solve(model.K, generator.T)
    return static @ np.linalg.solve(generator @ static, by)


def truncation_error(model: Model, reduced: Model, speed: float, harmonics: int = 4) -> float:
    """Largest relative error of the reduced model's answer to a force at the generator, 0X to mX.

    Compares the compliance S Z_k⁻¹ Sᵀ of both models at the frequencies kΩ; a number, not a
    percentage.
    """
    def compliance(m: Model, w: float) -> NDArray:
        return m.selection @ np.linalg.solve(dynamic_stiffness(m, w, speed),
                                             m.selection.T.astype(complex))

    worst = 0.0
    for k in range(harmonics + 1):
        exact = compliance(model, k * speed)
        worst = max(worst, float(np.abs(compliance(reduced, k * speed) - exact).max()
                                 / np.abs(exact).max()))
    return worst
