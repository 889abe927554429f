"""Several force laws in one model, each on its own coordinates, and laws of velocity and phase beside plain ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hydrolab.machine.forces import ForceLaw


def force_at(law: ForceLaw, e: NDArray, velocity: NDArray, phase: NDArray | float, speed: float) -> NDArray:
    """Force of any law, N, shape of e: one that does not move is not asked about velocity and phase."""
    return law.force_at(e, velocity, phase, speed) if law.moving else law.force(e)


def linearise_at(law: ForceLaw, e: NDArray, velocity: NDArray, phase: NDArray | float,
                 speed: float) -> tuple[NDArray, NDArray, NDArray]:
    """Force of any law, N, with ∂F_i/∂e_j, N/m, and ∂F_i/∂ė_j, N s/m, (c, c, …)."""
    if law.moving:
        return law.linearise_at(e, velocity, phase, speed)
    force, slope = law.linearise(e)
    return force, slope, np.zeros_like(slope)


@dataclass(frozen=True)
class Placed:
    """A law on some of a model's nonlinear coordinates. magnetic: whether its force grows with the square of the field."""

    law: ForceLaw
    rows: slice
    magnetic: bool = False


@dataclass(frozen=True)
class SeveralLaws:
    """Laws side by side. The first is the pull in the air gap; its coordinates begin with (x, z) of the generator."""

    parts: tuple[Placed, ...]

    @property
    def moving(self) -> bool:
        """Whether one of them depends on velocity or phase."""
        return any(part.law.moving for part in self.parts)

    def force(self, e: NDArray) -> NDArray:
        """Forces on all coordinates, N, shape of e, where no law moves."""
        out = np.zeros_like(e)
        for part in self.parts:
            out[part.rows] += part.law.force(e[part.rows])
        return out

    def linearise(self, e: NDArray) -> tuple[NDArray, NDArray]:
        """Forces, N, and their derivative, N/m, (c, c, …), where no law moves."""
        out, slope = np.zeros_like(e), np.zeros((len(e), *e.shape))
        for part in self.parts:
            force, own = part.law.linearise(e[part.rows])
            out[part.rows] += force
            slope[part.rows, part.rows] += own
        return out, slope

    def force_at(self, e: NDArray, velocity: NDArray, phase: NDArray | float, speed: float) -> NDArray:
        """Forces on all coordinates, N, shape of e."""
        out = np.zeros_like(e)
        for part in self.parts:
            out[part.rows] += force_at(part.law, e[part.rows], velocity[part.rows], phase, speed)
        return out

    def linearise_at(self, e: NDArray, velocity: NDArray, phase: NDArray | float,
                     speed: float) -> tuple[NDArray, NDArray, NDArray]:
        """Forces, N, with their derivatives by position, N/m, and by velocity, N s/m, (c, c, …)."""
        out, slope, damping = np.zeros_like(e), np.zeros((len(e), *e.shape)), np.zeros((len(e), *e.shape))
        for part in self.parts:
            force, *own = linearise_at(part.law, e[part.rows], velocity[part.rows], phase, speed)
            out[part.rows] += force
            slope[part.rows, part.rows] += own[0]
            damping[part.rows, part.rows] += own[1]
        return out, slope, damping

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap, m, by the first law; e: all coordinates, or (x, z) of the rotor centre alone."""
        return self.parts[0].law.smallest_gap(e[self.parts[0].rows])

    def gap_angle(self, e: NDArray) -> NDArray:
        """Gap angle of the smallest gap, rad, by the first law."""
        return self.parts[0].law.gap_angle(e[self.parts[0].rows])

    def scaled(self, factor: float) -> SeveralLaws:
        """The same laws, the magnetic ones `factor` times as strong."""
        return replace(self, parts=tuple(replace(p, law=p.law.scaled(factor)) if p.magnetic else p for p in self.parts))
