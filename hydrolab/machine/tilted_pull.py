r"""The pull of a rotor that tilts in its stator: each height of the rim has its own eccentricity.

A rim of height h whose centre lies at e and whose axis leans by the slopes t = (∂x/∂y, ∂z/∂y) has, at the height s
below its centre, the eccentricity e + s t. Its pull and the moment that goes with the slopes are

F = (1/h) ∫ f(e + s t) ds, N = (1/h) ∫ s f(e + s t) ds, s from −h/2 to h/2,

with f the pull of the whole rim if it did not lean. For small motion N = k (h²/12) t: the tilt pull, which Gustavsson
and Aidanpää (2006) give a rim with its hub off the middle, and which a model without tilt leaves out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hydrolab.machine.forces import ForceLaw

POINTS = 12  # Gauss points over the height: the pull is smooth in s, so the error falls exponentially with them


@dataclass(frozen=True)
class TiltedPull:
    """The pull on four coordinates: eccentricity (x, z) of the rim's middle, m, and slopes (∂x/∂y, ∂z/∂y), rad.

    upright: the pull without tilt, a positional law on (x, z). height: h, m. The force has the same four rows: N, N m.
    """

    moving: ClassVar[bool] = False
    upright: ForceLaw
    height: float

    def _slices(self, u: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Heights s (m) with weights that sum to 1, and the eccentricity there, (2, …, points)."""
        s, weight = np.polynomial.legendre.leggauss(POINTS)
        s = self.height / 2 * s
        return s, weight / 2, u[:2, ..., None] + u[2:, ..., None] * s

    def force(self, u: NDArray) -> NDArray:
        """Force, N, and the moment that works on the slopes, N m; shape of u. nan where an end is in the stator."""
        s, weight, e = self._slices(u)
        pull = self.upright.force(e)
        return np.concatenate([pull @ weight, pull @ (s * weight)])

    def linearise(self, u: NDArray) -> tuple[NDArray, NDArray]:
        """Force and its derivative, (4, 4, …)."""
        s, weight, e = self._slices(u)
        pull, slope = self.upright.linearise(e)
        direct, mixed, tilt = slope @ weight, slope @ (s * weight), slope @ (s * s * weight)
        return (np.concatenate([pull @ weight, pull @ (s * weight)]),
                np.concatenate([np.concatenate([direct, mixed], axis=1), np.concatenate([mixed, tilt], axis=1)]))

    def potential(self, u: NDArray) -> NDArray:
        """V, J, with force = −∂V/∂u, where the upright pull has one; shape of u without its first axis."""
        _, weight, e = self._slices(u)
        return self.upright.potential(e) @ weight

    def _ends(self, u: NDArray) -> NDArray:
        """Eccentricity of the top and the bottom of the rim, (2, …, 2); no other height comes nearer to the stator.

        Where u is (x, z) alone the rotor is taken as upright.
        """
        lean = u[2:, ..., None] if len(u) > 2 else 0 * u[..., None]
        return u[:2, ..., None] + lean * (self.height / 2 * np.array([-1.0, 1.0]))

    def smallest_gap(self, u: NDArray) -> NDArray:
        """Smallest air gap around the circumference and over the height, m."""
        return self.upright.smallest_gap(self._ends(u)).min(axis=-1)

    def gap_angle(self, u: NDArray) -> NDArray:
        """Angle at which the gap is smallest, rad, from z towards x."""
        ends = self._ends(u)
        nearest = self.upright.smallest_gap(ends).argmin(axis=-1)[..., None]
        return np.take_along_axis(self.upright.gap_angle(ends), nearest, axis=-1)[..., 0]

    def scaled(self, factor: float) -> TiltedPull:
        """The same law, `factor` times as strong."""
        return replace(self, upright=self.upright.scaled(factor))
