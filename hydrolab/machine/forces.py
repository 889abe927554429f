r"""Magnetic pull as a force law in local coordinates.

A law acts on the rotor centre's position relative to the stator centre, e = (x − x_E, z − z_E),
given coordinates first: e has shape (2, …) and the force the same shape; the derivative ∂F_i/∂e_j
has shape (2, 2, …). Forces act ON the rotor, positive along +x and +z, so the pull points along e,
towards the small gap. Gap angle φ runs from z towards x.

Source: Villa, Carvalho and Salomon, Eqs. (2) to (8), after Lundström and Aidanpää (2007).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray


class ForceLaw(Protocol):
    """What a solver asks of a force law.

    moving: whether the force also depends on the velocity or on the phase Ωt of the rotation. Such a law has
    `force_at(e, velocity, phase, speed)` and `linearise_at(e, velocity, phase, speed)`, which also returns ∂F_i/∂ė_j,
    N s/m, in place of the first two; phase, rad, is broadcast against the axes of e after its first, speed is Ω, rad/s.
    """

    moving: bool

    def force(self, e: NDArray) -> NDArray:
        """Force on the rotor, N; shape of e."""

    def linearise(self, e: NDArray) -> tuple[NDArray, NDArray]:
        """Force, N, and its derivative, N/m, with one more axis in front."""

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap around the circumference, m; e: all of the law's coordinates, or (x, z) alone."""

    def gap_angle(self, e: NDArray) -> NDArray:
        """Gap angle of the smallest gap, rad, from z towards x."""

    def scaled(self, factor: float) -> Self:
        """The same law, `factor` times as strong."""


@dataclass(frozen=True)
class CircularPull:
    r"""Pull of a circular rotor in a circular stator, in closed form.

    F = k e / (1 − ε²)^{3/2} with ε = |e|/g0: the integral of Eqs. (7) and (8) with the gap of
    Eq. (6), g = g0 (1 − ε cos(φ − γ)).

    stiffness: k = π B0² u0 l0 / (µ0 g0), N/m. gap: g0, m.
    """

    stiffness: float
    gap: float
    moving = False

    def force(self, e: NDArray) -> NDArray:
        """Force on the rotor, N; shape of e. Meaningless (nan) where |e| ≥ g0."""
        ex, ez = e
        with np.errstate(invalid="ignore", divide="ignore"):
            return self.stiffness * (1 - (ex * ex + ez * ez) / self.gap**2) ** -1.5 * e

    def linearise(self, e: NDArray) -> tuple[NDArray, NDArray]:
        r"""Force, N, and its derivative, N/m.

        ∂F/∂e = k [(1 − ε²)^{−3/2} I + 3 (1 − ε²)^{−5/2} e eᵀ/g0²].
        """
        ex, ez = e
        with np.errstate(invalid="ignore", divide="ignore"):
            s = 1 / (1 - (ex * ex + ez * ez) / self.gap**2)
            radial = self.stiffness * s * np.sqrt(s)
        force = radial * e
        jacobian = (3 / self.gap**2 * s * force)[:, None] * e
        jacobian[0, 0] += radial
        jacobian[1, 1] += radial
        return force, jacobian

    def potential(self, e: NDArray) -> NDArray:
        """V = −k g0² (1 − ε²)^{−1/2}, J, with F = −∂V/∂e; shape of e without its first axis, nan outside the gap."""
        ex, ez = e
        with np.errstate(invalid="ignore", divide="ignore"):
            return -self.stiffness * self.gap**2 / np.sqrt(1 - (ex * ex + ez * ez) / self.gap**2)

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap around the circumference, m; zero or less is contact."""
        return self.gap - np.hypot(*e)

    def gap_angle(self, e: NDArray) -> NDArray:
        """Angle at which the gap is smallest, rad, from z towards x."""
        return np.arctan2(e[0], e[1])

    def scaled(self, factor: float) -> CircularPull:
        """The same law, `factor` times as strong (the pull grows with the square of the field)."""
        return replace(self, stiffness=factor * self.stiffness)


@dataclass(frozen=True)
class LinearPull(CircularPull):
    """The pull as design tools take it: F = k e, a negative stiffness, at any eccentricity."""

    def force(self, e: NDArray) -> NDArray:
        """Force on the rotor, N; shape of e."""
        return self.stiffness * e

    def linearise(self, e: NDArray) -> tuple[NDArray, NDArray]:
        """Force, N, and its derivative k I, N/m."""
        identity = np.eye(2).reshape(2, 2, *(1,) * (e.ndim - 1))
        return self.stiffness * e, self.stiffness * np.broadcast_to(identity, (2, *e.shape))

    def potential(self, e: NDArray) -> NDArray:
        """V = −k |e|²/2, J."""
        return -0.5 * self.stiffness * (e * e).sum(axis=0)


@dataclass(frozen=True, eq=False)
class ShapedPull:
    r"""Pull in a gap of any shape, by quadrature of Eqs. (7) and (8).

    F = (k g0³ / 2π) ∮ (sin φ, cos φ) / g² dφ with g(φ) = shape(φ) − e_x sin φ − e_z cos φ.
    The integrand is periodic, so the trapezoidal rule converges exponentially.

    stiffness, gap: k (N/m) and g0 (m) of the nominal circular gap. shape: gap at the N equally spaced
    angles φ_n = 2πn/N when the rotor is centred, m; shape (N,).
    """

    stiffness: float
    gap: float
    shape: NDArray
    moving = False

    def _local_gap(self, e: NDArray) -> tuple[NDArray, NDArray]:
        """Directions (2, N) and the gap along them, m, (…, N); below zero the rotor is in the stator."""
        angle = 2 * np.pi * np.arange(len(self.shape)) / len(self.shape)
        direction = np.stack([np.sin(angle), np.cos(angle)])
        return direction, self.shape - np.tensordot(e, direction, axes=(0, 0))

    def _quadrature(self, e: NDArray) -> tuple[NDArray, NDArray, float]:
        """Directions, gap (nan where the rotor is in the stator) and the weight k g0³/N of each angle."""
        direction, gap = self._local_gap(e)
        return direction, np.where(gap > 0, gap, np.nan), self.stiffness * self.gap**3 / len(self.shape)

    def force(self, e: NDArray) -> NDArray:
        """Force on the rotor, N; shape of e. Meaningless (nan) where the rotor is in the stator."""
        direction, gap, weight = self._quadrature(e)
        return weight * np.einsum("in,...n->i...", direction, gap**-2.0)

    def linearise(self, e: NDArray) -> tuple[NDArray, NDArray]:
        """Force, N, and its derivative, N/m: one more power of the gap under the integral."""
        direction, gap, weight = self._quadrature(e)
        derivative = 2 * weight * np.einsum("in,jn,...n->ij...", direction, direction, gap**-3.0)
        return weight * np.einsum("in,...n->i...", direction, gap**-2.0), derivative

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap over the N angles, m."""
        return self._local_gap(e)[1].min(axis=-1)

    def gap_angle(self, e: NDArray) -> NDArray:
        """Angle at which the gap is smallest, rad, from z towards x."""
        return 2 * np.pi * self._local_gap(e)[1].argmin(axis=-1) / len(self.shape)

    def scaled(self, factor: float) -> ShapedPull:
        """The same law, `factor` times as strong."""
        return replace(self, stiffness=factor * self.stiffness)


def closed_form():
    r"""The integral behind `CircularPull`, done by SymPy: (∫ cos φ/(1 − ε cos φ)² dφ, 2πε/(1 − ε²)^{3/2}).

    SymPy's own `integrate` does not finish on the circle. Both sides are therefore compared as what
    they are, analytic functions of ε on (0, 1): the residue at the pole inside the unit circle.
    Returns the pair (residue result, closed form) as SymPy expressions in ε; their difference simplifies to 0.
    """
    import sympy as sp

    eps = sp.symbols("epsilon", positive=True)
    w = sp.sqrt(1 - eps**2)
    z = sp.symbols("z")
    inside, outside = (1 - w) / eps, (1 + w) / eps
    # cos φ = (z + 1/z)/2 and dφ = dz/(iz) turn the integrand into a rational function of z = e^{iφ}
    # with a double pole at `inside`; its residue is the derivative of what is left after (z − inside)².
    rest = 2 * (z**2 + 1) / (eps**2 * (z - outside) ** 2)
    residue = sp.diff(rest, z).subs(z, inside)
    return sp.simplify(2 * sp.pi * residue), 2 * sp.pi * eps / (1 - eps**2) ** sp.Rational(3, 2)
