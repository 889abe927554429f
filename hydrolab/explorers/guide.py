"""The radial bearings of a machine, of whatever kind, and the number that says how stiff one is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydrolab.errors import BadInput
from hydrolab.machine.parts import Machine

# the number that says how stiff a bearing is, by the kinds of bearing: its unit and 1 SI in that
STIFFNESS = {"stiffness": ("GN/m", 1e-9), "pad_stiffness": ("GN/m a pad", 1e-9),
             "viscosity": ("mPa s", 1e3)}


@dataclass(frozen=True, eq=False)
class Guide:
    """A radial bearing: its name and node, the key of its stiffness, and that number, SI; unit and
    scale say how a slider shows it.
    """

    name: str
    node: int
    key: str
    value: NDArray | float
    unit: str
    scale: float

    @property
    def shown(self) -> float:
        """Its stiffness as a slider shows it."""
        return self.scale * float(np.abs(self.value).max())


def guides(machine: Machine) -> list[Guide]:
    """All radial bearings of a machine: springs, pads and films."""
    return [Guide(bearing.name, bearing.node, f"bearings.{bearing.name}.{name}",
                  getattr(bearing, name), *STIFFNESS[name])
            for bearing in machine.all_bearings for name in STIFFNESS if hasattr(bearing, name)]


def guide_of(machine: Machine) -> Guide:
    """The radial bearing nearest to the body in the air gap.

    Raises BadInput for a machine without one.
    """
    home, found = machine.body(machine.air_gap.body).node, guides(machine)
    if not found:
        raise BadInput(f"{machine.name} has no radial bearing; this explorer changes the stiffness "
                       "of one.")
    return min(found, key=lambda guide: abs(guide.node - home))
