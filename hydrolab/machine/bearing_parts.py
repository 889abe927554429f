"""Linear supports of a shaft, and the damping of the whole machine: frozen, validated on construction, in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydrolab.errors import BadInput
from hydrolab.machine.checks import bearing_matrix, nickname, number


@dataclass(frozen=True, eq=False)
class RadialBearing:
    """A linear radial bearing: force on the rotor −stiffness·u − damping·u̇ with u = (x, z).

    stiffness (N/m) and damping (N s/m): one number (isotropic), two ([x, z]) or 2 × 2.
    """

    name: str
    node: int
    stiffness: NDArray
    damping: NDArray | float = 0.0

    def __post_init__(self) -> None:
        key = f"bearings.{nickname('the name of a bearing', self.name)}"
        object.__setattr__(self, "stiffness", bearing_matrix(f"{key}.stiffness", self.stiffness, "N/m"))
        object.__setattr__(self, "damping", bearing_matrix(f"{key}.damping", self.damping, "N s/m"))


@dataclass(frozen=True)
class ThrustBearing:
    """A thrust bearing seen by the lateral motion: an angular spring, N m/rad, at one node."""

    name: str
    node: int
    tilt_stiffness: float

    def __post_init__(self) -> None:
        key = f"bearings.{nickname('the name of a bearing', self.name)}.tilt_stiffness"
        object.__setattr__(self, "tilt_stiffness", number(key, self.tilt_stiffness, least=0, unit="N m/rad"))


@dataclass(frozen=True)
class RayleighDamping:
    """C = αM + βK with the given damping ratios in the first and the second distinct mode at rest."""

    ratio: tuple[float, float]

    def __post_init__(self) -> None:
        one = not np.iterable(self.ratio) or isinstance(self.ratio, (str, Mapping))
        ratios = (self.ratio,) * 2 if one else self.ratio
        checked = tuple(number("damping.ratio", r, least=0, below=1) for r in ratios)
        if len(checked) != 2:
            raise BadInput(f"damping.ratio has {len(checked)} entries; give one ratio or two.")
        object.__setattr__(self, "ratio", checked)
