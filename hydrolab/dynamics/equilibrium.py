"""Where a rotor without unbalance rests in its field, and whether it stays there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.harmonic_balance import respond
from hydrolab.dynamics.solvers import newton
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.model import Model
from hydrolab.machine.quantities import require_model

TURNS_BACK = 1e-6  # relative: how closely the largest offset with an equilibrium is found


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A static equilibrium q: K q = Sᵀ F(S q − centre) + the loads that stand still.

    local: the nonlinear coordinates S q, (c,). displacement: q, (n,). static_eccentricity: fraction
    of the gap.
    """

    model: Model
    static_eccentricity: float
    centre: NDArray
    local: NDArray
    displacement: NDArray

    @property
    def stiffness(self) -> NDArray:
        """K − Sᵀ (∂F/∂u) S, N/m, (n, n): what a small push away from it meets."""
        m, S = self.model, self.model.selection
        slope = m.law.linearise(m.relative(self.local, self.centre))[1]
        return m.K - S.T @ slope @ S

    @property
    def statically_stable(self) -> bool:
        """Whether every small push is answered by a force back."""
        stiffness = self.stiffness
        return bool(np.linalg.eigvalsh((stiffness + stiffness.T) / 2)[0] > 0)

    def eigenvalues(self, speed: float) -> NDArray:
        """Eigenvalues λ, 1/s, of small motions e^{λt} at a speed (rad/s), by falling real part."""
        m = self.model
        n, inverse = m.size, np.linalg.inv(m.M)
        values = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)],
                                             [-inverse @ self.stiffness,
                                              -inverse @ m.velocity_matrix(speed)]]))
        return values[np.argsort(-values.real)]


def equilibrium(model: Model, static_eccentricity: float, *, direction: float = math.pi / 2,
                steps: int = 20) -> Equilibrium:
    """The equilibrium that is reached when the stator is moved from the middle to its offset, in
    steps.

    static_eccentricity: fraction of the gap. direction: gap angle of the offset, rad. steps: to
    get there. Raises NoConvergence where there is none, BadInput for a law that depends on velocity
    or phase and for a machine that can move freely.
    """
    require_model(model)
    if model.law.moving:
        raise BadInput(f"{model.name} has a force of velocity or phase, so it does not rest; solve "
                       "for its steady state.")
    loads = np.column_stack([model.selection.T, model.static]).astype(complex)
    *columns, sag = respond(model, 0.0, 0.0, loads).real.T
    compliance = np.transpose(columns)
    felt, scale, one = model.selection @ compliance, model.length_scale, np.eye(len(columns))
    rest = model.selection @ sag / scale

    def at(centre: NDArray, y: NDArray) -> NDArray:
        def system(y: NDArray) -> tuple[NDArray, NDArray]:
            force, slope, _ = model.law.linearise(model.relative(scale * y, centre))
            return y - rest - felt @ force / scale, one - felt @ slope
        solution = newton(system, y)
        if not solution.converged:
            raise NoConvergence(f"No equilibrium was found at {100 * static_eccentricity:.4g} %: "
                                "the pull is stronger than the shaft. Lower the offset or the "
                                "field.")
        return solution.y

    y, whole = rest, model.centre(static_eccentricity, direction)
    for share in np.linspace(0, 1, steps + 1)[1:]:
        y = at(share * whole, y)
    force = model.law.force(model.relative(scale * y, whole))
    return Equilibrium(model, static_eccentricity, whole, scale * y, sag + compliance @ force)


def largest_offset(model: Model, *, direction: float = math.pi / 2) -> float:
    """Largest static eccentricity (fraction of the gap) with a statically stable equilibrium; 0 if
    there is none at rest.

    direction: gap angle of the offset, rad. Found by bisection between the middle and the whole
    gap. Raises BadInput as `equilibrium` does.
    """
    def holds(offset: float) -> bool:
        try:
            return equilibrium(model, offset, direction=direction, steps=8).statically_stable
        except NoConvergence:
            return False

    low, high = 0.0, 0.999
    if not holds(low):
        return 0.0
    while high - low > TURNS_BACK:
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
