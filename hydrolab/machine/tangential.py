r"""A pull across the eccentricity, which damper circuits and cages add to the pull along it.

F = k_t J e, with J the quarter turn from z to x: k_t > 0 pushes a rotor that whirls with the spin on its way. It stands
beside the law of the pull on the same coordinates (`SeveralLaws`), so that F = k_r e + k_t J e for a linear pull k_r.
A Jeffcott rotor with damping c is stable as long as c ω > |k_t|, with ω = √((k − k_r)/m): k_t > 0 drives its forward
whirl, k_t < 0 its backward whirl. Karlsson et al. (2007) find such a pull where a generator has a damper winding. Here
k_t is constant, while a circuit's depends on the whirl frequency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class TangentialPull:
    """F = k_t J e on the eccentricity (x, z). stiffness: k_t, N/m. gap: g0, m."""

    moving: ClassVar[bool] = False
    stiffness: float
    gap: float

    def force(self, e: NDArray) -> NDArray:
        """Force on the rotor, N; shape of e."""
        return self.stiffness * np.stack([e[1], -e[0]])

    def linearise(self, e: NDArray) -> tuple[NDArray, NDArray]:
        """Force, N, and its derivative k_t J, N/m."""
        turn = np.array([[0.0, 1.0], [-1.0, 0.0]]).reshape(2, 2, *(1,) * (e.ndim - 1))
        return self.force(e), self.stiffness * np.broadcast_to(turn, (2, *e.shape))

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap around the circumference, m."""
        return self.gap - np.hypot(e[0], e[1])

    def gap_angle(self, e: NDArray) -> NDArray:
        """Angle at which the gap is smallest, rad, from z towards x."""
        return np.arctan2(e[0], e[1])

    def scaled(self, factor: float) -> TangentialPull:
        """The same law, `factor` times as strong."""
        return replace(self, stiffness=factor * self.stiffness)


def tangential_limit(mass: float, damping: float, stiffness: float, pull: float) -> float:
    """Largest |k_t|, N/m, of a stable Jeffcott rotor: c √((k − k_r)/m).

    mass: kg. damping: c, N s/m. stiffness: k of the spring, N/m. pull: k_r, N/m, less than k, or nan comes back.
    """
    return damping * math.sqrt((stiffness - pull) / mass) if pull < stiffness else math.nan
