r"""A guide bearing of separate pads with clearance: a pad pushes where the journal has crossed its clearance.

F = −k Σ_j p(n_j · u − c) n_j over pads in the directions n_j, with p(d) = d for d > 0 and 0 otherwise. The corner is
rounded over a distance b, p(d) = (d + √(d² + b²))/2, as surfaces that meet are rounded, so that Newton's method has a
derivative. It has a potential, so it neither damps nor drives. The set-up of guide bearings with radial pads is
described by Gustavsson and Aidanpää (2006) and in ISO 20816-5; this law of dry, frictionless pads is the simplest of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Pads:
    """Force of `count` equal pads at equal angles on a journal at u = (x, z).

    stiffness: of one pad, N/m. clearance: of each, m; negative is a preload. angle: gap angle of the first pad, rad.
    rounding: b, m. reference: stiffness of the linear bearing in the model's matrix, N/m, which this law takes back.
    """

    moving: ClassVar[bool] = False
    stiffness: float
    clearance: float
    count: int
    angle: float
    rounding: float
    reference: float = 0.0

    @property
    def directions(self) -> NDArray:
        """Unit vectors (x, z) towards the pads, (2, count)."""
        angle = self.angle + 2 * np.pi * np.arange(self.count) / self.count
        return np.stack([np.sin(angle), np.cos(angle)])

    @property
    def closed_stiffness(self) -> float:
        """Stiffness of the bearing in any direction while every pad pushes, N/m."""
        return self.count * self.stiffness / 2

    def _pressed(self, u: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Directions (2, count); how far the journal is beyond each clearance, and the rounded hypotenuse, (…, count)."""
        n = self.directions
        beyond = np.tensordot(u, n, axes=(0, 0)) - self.clearance
        return n, beyond, np.hypot(beyond, self.rounding)

    def force(self, u: NDArray) -> NDArray:
        """Force on the journal, N; shape of u."""
        n, d, h = self._pressed(u)
        return self.reference * u - self.stiffness / 2 * np.einsum("ij,...j->i...", n, d + h)

    def linearise(self, u: NDArray) -> tuple[NDArray, NDArray]:
        """Force, N, and its derivative, N/m."""
        n, d, h = self._pressed(u)
        slope = -self.stiffness / 2 * np.einsum("ik,jk,...k->ij...", n, n, 1 + d / h)
        slope[[0, 1], [0, 1]] += self.reference
        return self.reference * u - self.stiffness / 2 * np.einsum("ij,...j->i...", n, d + h), slope

    def potential(self, u: NDArray) -> NDArray:
        """V, J, with F = −∂V/∂u; shape of u without its first axis."""
        _, d, h = self._pressed(u)
        pressed = (d * d + d * h + self.rounding**2 * np.arcsinh(d / self.rounding)) / 4
        return self.stiffness * pressed.sum(axis=-1) - self.reference / 2 * (u * u).sum(axis=0)

    def scaled(self, factor: float) -> Pads:
        """The same law: a bearing does not change with the field."""
        return self
