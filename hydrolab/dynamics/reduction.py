"""A smaller model for work in time: the lowest modes, and the static deflection under the pull.

Plain truncation loses the static stiffness that the cut modes give the generator, and with it moves
the fold. Adding the deflection under a unit force at each nonlinear coordinate restores it exactly
(MacNeal 1971, Rubin 1975: residual flexibility). In a turning machine a push also tilts the shaft,
and the discs answer with a gyroscopic moment that the lowest modes carry poorly: the deflection
under that moment, K⁻¹ G K⁻¹ Sᵀ, is added where asked for. With it multipliers are a hundred times
nearer to those of all DOFs.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from hydrolab.dynamics.harmonic_balance import SINGULAR
from hydrolab.errors import BadInput
from hydrolab.machine.model import Model
from hydrolab.machine.quantities import whole


@lru_cache(maxsize=64)
def reduce(model: Model, modes: int = 12, gyroscopic: bool = False) -> Model:
    """The model on its `modes` lowest modes at rest and the static deflections under the pull.

    gyroscopic: add the deflections under the gyroscopic moments of these. The new DOFs are the
    modes of that subspace, so M is the identity and K is diagonal. A model with no more DOFs than
    the basis comes back in all its modes. Raises BadInput if `modes` is not a whole number of at
    least 1.
    """
    whole("modes", modes, 1)
    if not np.linalg.cond(model.K, 1) < 1 / SINGULAR:
        raise BadInput(f"{model.name} can move freely, so it has no static deflection; give it "
                       "bearings.")
    try:
        if modes + (2 if gyroscopic else 1) * len(model.selection) >= model.size:
            basis = np.eye(model.size)
        else:
            shapes = scipy.linalg.eigh(model.K, model.M, subset_by_index=(0, modes - 1))[1]
            static = np.linalg.solve(model.K, model.selection.T)
            tilting = np.linalg.solve(model.K,
                                      model.G
                                      @ static) if gyroscopic and model.G.any() else static[:, :0]
            basis = np.hstack([shapes, static, tilting])
            basis, left = scipy.linalg.qr(basis / np.linalg.norm(basis, axis=0), mode="economic")
            # without what the columns before already span
            basis = basis[:, np.abs(np.diag(left)) > 1e-10]
        _, mix = scipy.linalg.eigh(basis.T @ model.K @ basis, basis.T @ model.M @ basis)
    except np.linalg.LinAlgError as error:
        raise BadInput(f"{model.name} has a DOF without mass, so it has no modes; give the shaft a "
                       "density above 0."
                       ) from error
    return model.on_basis(basis @ mix)


def truncation_error(model: Model, reduced: Model, speed: float, harmonics: int = 4) -> float:
    """Largest relative error of the reduced model's answer to a force at the generator, 0X to mX.

    Compares the compliance S Z_k⁻¹ Sᵀ of both models at the frequencies kΩ; a number, not a
    percentage.
    """
    def compliance(m: Model, w: float) -> NDArray:
        dynamic = m.K - w**2 * m.M + 1j * w * m.velocity_matrix(speed)
        return m.selection @ np.linalg.solve(dynamic, m.selection.T.astype(complex))

    worst = 0.0
    for k in range(harmonics + 1):
        exact = compliance(model, k * speed)
        worst = max(worst, float(np.abs(compliance(reduced, k * speed) - exact).max()
                                 / np.abs(exact).max()))
    return worst
