"""Floquet multipliers of a steady state: does a small disturbance die out?

The disturbance obeys M q̈ + (C + ΩG) q̇ + K q = Sᵀ J(t) S q, where J is the slope of the pull along the
orbit. Everything but the rank-two pull is constant. So over a step of length h the constant part is
advanced exactly, in its eigenvectors, and the pull acts as a kick h Sᵀ J S q on the velocities in the
middle (Strang splitting). The error of this second-order product has only even powers of h, so one
Richardson extrapolation from h and h/2 leaves O(h⁴).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from hydrolab.dynamics.reduction import reduce
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput

TRUST = 1e-3  # multipliers at h and h/2 may differ by this much; beyond, the verdict is "unknown"


@dataclass(frozen=True, eq=False)
class Floquet:
    """Floquet multipliers of one orbit, largest first, and what they say.

    multipliers: complex, shape (2r,) for r reduced DOFs. error: largest change of the leading ones when the
    step is halved. verdict: "stable", "unstable" or "unknown". kind: how the leading one leaves the unit
    circle: "fold" (at +1), "flip" (at −1) or "Neimark–Sacker" (a complex pair).
    """

    multipliers: NDArray
    error: float
    verdict: str
    kind: str

    @property
    def largest(self) -> float:
        """Largest modulus."""
        return float(abs(self.multipliers[0]))

    def __str__(self) -> str:
        mu = self.multipliers[0]
        value = f"{mu.real:.5f}" if abs(mu.imag) < 1e-9 else f"{mu.real:.5f} ± {abs(mu.imag):.5f} i"
        return f"{self.verdict}: leading multiplier {value}, modulus {abs(mu):.5f}"


def monodromy(orbit: PeriodicOrbit, modes: int = 12, steps: int = 256) -> NDArray:
    """Monodromy matrix of the orbit on the reduced basis, shape (2r, 2r), by Strang splitting with `steps` steps.

    In the eigenvectors of the constant part, so its eigenvalues are the multipliers but its entries are modal.
    """
    model = reduce(orbit.model, modes)
    r = model.size
    inverse_mass = np.linalg.inv(model.M)
    constant = np.block([[np.zeros((r, r)), np.eye(r)],
                         [-inverse_mass @ model.K, -inverse_mass @ model.velocity_matrix(orbit.speed)]])
    exponents, vectors = scipy.linalg.eig(constant)
    watch = np.hstack([model.selection, np.zeros_like(model.selection)]) @ vectors
    push = np.linalg.solve(vectors, np.vstack([np.zeros((r, 2)), inverse_mass @ model.selection.T]))

    h = 2 * np.pi / orbit.speed / steps
    middle = 2 * np.pi * (np.arange(steps) + 0.5) / steps
    _, slope = model.law.linearise(orbit.positions(middle) - orbit.centre[:, None])
    flow = np.exp(exponents * h)[:, None]
    product = np.diag(np.exp(exponents * h / 2))
    for n in range(steps):
        product += push @ (h * slope[:, :, n] @ (watch @ product))
        product *= flow
    return np.exp(-exponents * h / 2)[:, None] * product


def floquet(orbit: PeriodicOrbit, modes: int = 12, steps: int = 256) -> Floquet:
    """Floquet multipliers of an orbit, with the step halved once as a check and for the fourth order.

    modes: modes of the reduced basis (the static deflection under the pull is added). steps: in a revolution.
    Raises BadInput for fewer than 16 steps.
    """
    if steps < 16:
        raise BadInput(f"steps is {steps}; at least 16 in a revolution are needed.")
    coarse, fine = monodromy(orbit, modes, steps), monodromy(orbit, modes, 2 * steps)
    finer = (4 * fine - coarse) / 3
    coarse_extrapolated = (4 * coarse - monodromy(orbit, modes, steps // 2)) / 3
    multipliers = np.linalg.eigvals(finer)
    multipliers = multipliers[np.argsort(-np.abs(multipliers))]
    before = np.linalg.eigvals(coarse_extrapolated)
    error = float(max(np.abs(before - mu).min() for mu in multipliers[:4]))
    lead = multipliers[0]
    if not np.isfinite(error) or error > TRUST * max(1.0, abs(lead)) or abs(abs(lead) - 1) <= error:
        verdict = "unknown"
    else:
        verdict = "stable" if abs(lead) < 1 else "unstable"
    kind = "Neimark–Sacker" if abs(lead.imag) > 1e-6 * abs(lead) else ("fold" if lead.real > 0 else "flip")
    return Floquet(multipliers, error, verdict, kind)
