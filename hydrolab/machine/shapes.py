r"""Stator and rotor out of round: the gap by Fourier shapes, those of the stator at rest and those of the rotor turning.

g(φ, t) = g0 + Σ δ cos n(φ − α) [stator] − Σ δ cos n(φ − Ωt − β) [rotor] − e_x sin φ − e_z cos φ, and the pull by
quadrature of Eqs. (7) and (8) of Villa, Carvalho and Salomon, after Lundström and Aidanpää (2007).

To second order in the shapes a centred rotor feels a force only from two orders that differ by one
(`selection_rule`): with g = g0 (1 + η), g⁻² ≈ g0⁻² (1 − 2η + 3η²), and only the product of two such orders holds cos φ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hydrolab.machine.forces import ForceLaw, ShapedPull

POINTS = 256


@dataclass(frozen=True)
class Bulge:
    """One order of a shape: the radius is larger by size · cos(order (φ − angle)). size: m. angle: of a peak, rad."""

    order: int
    size: float
    angle: float = 0.0


def outline(bulges: tuple[Bulge, ...], angle: NDArray) -> NDArray:
    """By how much the radius is larger at gap angles (any shape), m."""
    return sum((b.size * np.cos(b.order * (angle - b.angle)) for b in bulges), np.zeros(np.shape(angle)))


def shaped_law(stiffness: float, gap: float, stator: tuple[Bulge, ...] = (), rotor: tuple[Bulge, ...] = (),
               points: int = POINTS) -> ForceLaw:
    """The pull between two shapes: a `ShapedPull` where only the stator is out of round, else a `TurningPull`.

    stiffness, gap: k (N/m) and g0 (m) of the nominal circular gap.
    """
    if rotor:
        return TurningPull(stiffness, gap, stator, rotor, points)
    return ShapedPull(stiffness, gap, gap + outline(stator, 2 * np.pi * np.arange(points) / points))


@dataclass(frozen=True)
class TurningPull:
    """The pull on a rotor out of round that turns in a stator of any shape, by the trapezoidal rule.

    stiffness, gap: k (N/m) and g0 (m) of the nominal circular gap. stator, rotor: their shapes, the rotor's at phase 0.
    """

    moving: ClassVar[bool] = True
    stiffness: float
    gap: float
    stator: tuple[Bulge, ...]
    rotor: tuple[Bulge, ...]
    points: int = POINTS

    def _around(self, e: NDArray, phase: NDArray | float) -> tuple[NDArray, NDArray, float]:
        """Directions (2, N), the gap (…, N), nan below zero, and the weight k g0³/N."""
        angle = 2 * np.pi * np.arange(self.points) / self.points
        direction = np.stack([np.sin(angle), np.cos(angle)])
        gap = (self.gap + outline(self.stator, angle) - outline(self.rotor, angle - np.asarray(phase)[..., None])
               - np.tensordot(e, direction, axes=(0, 0)))
        return direction, np.where(gap > 0, gap, np.nan), self.stiffness * self.gap**3 / self.points

    def force_at(self, e: NDArray, velocity: NDArray, phase: NDArray | float, speed: float) -> NDArray:
        """Force on the rotor, N, shape of e; velocity and speed do not matter. nan where the rotor is in the stator."""
        direction, gap, weight = self._around(e, phase)
        return weight * np.einsum("in,...n->i...", direction, gap**-2.0)

    def linearise_at(self, e: NDArray, velocity: NDArray, phase: NDArray | float,
                     speed: float) -> tuple[NDArray, NDArray, NDArray]:
        """Force, N, with its derivatives by position, N/m, and by velocity, which are zero."""
        direction, gap, weight = self._around(e, phase)
        slope = 2 * weight * np.einsum("in,jn,...n->ij...", direction, direction, gap**-3.0)
        return weight * np.einsum("in,...n->i...", direction, gap**-2.0), slope, np.zeros_like(slope)

    def potential(self, e: NDArray, phase: NDArray | float) -> NDArray:
        """V, J, with F = −∂V/∂e at a fixed phase."""
        _, gap, weight = self._around(e, phase)
        return -weight * (1 / gap).sum(axis=-1)

    def _narrowest(self, e: NDArray) -> NDArray:
        """The gap around the circumference with the rotor's highest point there, m, (…, N)."""
        angle = 2 * np.pi * np.arange(self.points) / self.points
        direction = np.stack([np.sin(angle), np.cos(angle)])
        highest = outline(self.rotor, angle).max()
        return self.gap + outline(self.stator, angle) - highest - np.tensordot(e[:2], direction, axes=(0, 0))

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap there can be at this place in any phase, m: the rotor's highest point meets every angle."""
        return self._narrowest(e).min(axis=-1)

    def gap_angle(self, e: NDArray) -> NDArray:
        """Angle of that smallest gap, rad, from z towards x."""
        return 2 * np.pi * self._narrowest(e).argmin(axis=-1) / self.points

    def scaled(self, factor: float) -> TurningPull:
        """The same law, `factor` times as strong."""
        return replace(self, stiffness=factor * self.stiffness)


class ShapeForce(NamedTuple):
    """The force of two orders on a centred rotor, F_z + i F_x = size · e^{i (turns Ωt + angle)}.

    kind: "static", "synchronous", "forward" or "backward". turns: in a revolution, below zero backward. size: N.
    """

    kind: Literal["static", "synchronous", "forward", "backward"]
    turns: int
    size: float
    angle: float


Side = Literal["stator", "rotor"]


def selection_rule(stiffness: float, gap: float, one: tuple[Side, Bulge], other: tuple[Side, Bulge]) -> ShapeForce | None:
    """The force of a pair of shapes on a centred rotor to second order, or None where their orders do not differ by one.

    The size is 3 k δ δ′/(2 g0), with k = π B0² u0 l0/(µ0 g0). Of a pair on the stator the force stands still, of a pair on
    the rotor it turns with it. A rotor shape of order n makes a force that turns n times in a revolution: forward with a
    stator shape of order n − 1, backward with one of order n + 1.
    """
    (low_side, low), (high_side, high) = sorted((one, other), key=lambda pair: pair[1].order)
    if high.order - low.order != 1:
        return None
    # the product holds cos(φ − β) with β = (n + 1)(α′ + s′Ωt) − n (α + sΩt); s is 1 on the rotor, 0 on the stator
    turns = high.order * (high_side == "rotor") - low.order * (low_side == "rotor")
    sign = 1 if low_side == high_side else -1
    angle = high.order * high.angle - low.order * low.angle + (0 if sign > 0 else math.pi)
    same = "static" if low_side == "stator" else "synchronous"
    kind = same if low_side == high_side else "forward" if turns > 0 else "backward"
    return ShapeForce(kind, turns, 1.5 * stiffness * abs(low.size * high.size) / gap,
                      angle + (math.pi if low.size * high.size < 0 else 0.0))
