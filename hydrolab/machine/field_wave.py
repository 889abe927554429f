r"""The pull of any magnetomotive force in the true gap, by quadrature: waves of the rotor and the stator added up.

f(φ, t) = Σ share cos(order · φ − ratio · Ωt − angle), and F = (k g0³/2π) ∮ 2 f² (sin φ, cos φ)/g² dφ with the gap
g = g0 − e_x sin φ − e_z cos φ, no series. A lone wave of share 1 is the field whose rms is B0, so its mean pull is that of
`CircularPull`. Pennacchi and Frosini (2005) take the rotor's and the stator's wave with the load angle between them; their
parameters could not be read.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

LEAST = 128  # points around the gap: at 90 % of the gap ρ¹²⁸ is 1e-26


@dataclass(frozen=True)
class Wave:
    """One wave of magnetomotive force: share · cos(order · φ − ratio · Ωt − angle).

    order: number of its pole pairs around the gap. share: of the reference wave, whose field is B0 (rms).
    ratio: electrical over mechanical angle; a wave fixed to the rotor has ratio = order, one that stands still 0, and one
    that turns backward a negative ratio. angle: rad.
    """

    order: int
    share: float = 1.0
    ratio: float = 1.0
    angle: float = 0.0


def loaded(pole_pairs: int, stator_share: float, load_angle: float, ratio: float, start: float = 0.0) -> tuple[Wave, Wave]:
    """The rotor's wave and the stator's, which is `load_angle` (electrical, rad) behind it."""
    return (Wave(pole_pairs, 1.0, ratio, start), Wave(pole_pairs, stator_share, ratio, start - load_angle))


@dataclass(frozen=True)
class FieldWave:
    """The pull of a sum of waves in a circular gap, by the trapezoidal rule, which converges exponentially.

    stiffness: k = π B0² u0 l0/(µ0 g0), N/m, of the reference wave. gap: g0, m. waves: `Wave`, at least one.
    """

    moving: ClassVar[bool] = True
    stiffness: float
    gap: float
    waves: tuple[Wave, ...]

    @property
    def points(self) -> int:
        """Points of the quadrature: more for waves of a high order."""
        return LEAST + 4 * max(wave.order for wave in self.waves)

    def field(self, angle: NDArray, phase: NDArray | float) -> NDArray:
        """f at gap angles (N,) and phases (…): (…, N)."""
        phase = np.asarray(phase)[..., None]
        return sum(w.share * np.cos(w.order * angle - w.ratio * phase - w.angle) for w in self.waves)

    def force_at(self, e: NDArray, velocity: NDArray, phase: NDArray | float, speed: float) -> NDArray:
        """Force on the rotor, N, shape of e; velocity and speed do not matter. nan where the rotor is in the stator."""
        direction, weight, gap = self._around(e, phase)
        return np.einsum("in,...n->i...", direction, weight / gap**2)

    def linearise_at(self, e: NDArray, velocity: NDArray, phase: NDArray | float,
                     speed: float) -> tuple[NDArray, NDArray, NDArray]:
        """Force, N, with its derivatives by position, N/m, and by velocity, which are zero."""
        direction, weight, gap = self._around(e, phase)
        stress = weight / gap**2
        slope = np.einsum("in,jn,...n->ij...", direction, direction, 2 * stress / gap)
        return np.einsum("in,...n->i...", direction, stress), slope, np.zeros_like(slope)

    def potential(self, e: NDArray, phase: NDArray | float) -> NDArray:
        """V, J, with F = −∂V/∂e at a fixed phase."""
        _, weight, gap = self._around(e, phase)
        return -(weight / gap).sum(axis=-1)

    def _around(self, e: NDArray, phase: NDArray | float) -> tuple[NDArray, NDArray, NDArray]:
        """Directions (2, N), weights 2 f² k g0³/N (…, N), and the gap (…, N), nan below zero."""
        angle = 2 * np.pi * np.arange(self.points) / self.points
        direction = np.stack([np.sin(angle), np.cos(angle)])
        gap = self.gap - np.tensordot(e, direction, axes=(0, 0))
        weight = 2 * self.stiffness * self.gap**3 / self.points * self.field(angle, phase) ** 2
        return direction, weight, np.where(gap > 0, gap, np.nan)

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap around the circumference, m."""
        return self.gap - np.hypot(e[0], e[1])

    def gap_angle(self, e: NDArray) -> NDArray:
        """Angle at which the gap is smallest, rad, from z towards x."""
        return np.arctan2(e[0], e[1])

    def scaled(self, factor: float) -> FieldWave:
        """The same law, `factor` times as strong."""
        return replace(self, stiffness=factor * self.stiffness)
