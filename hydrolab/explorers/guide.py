"""What explorers ask of a machine: the parts they need, and its radial bearings, of whatever kind,
each with the number that says how stiff it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydrolab.errors import BadInput
from hydrolab.machine import Machine, load_machine
from hydrolab.machine.quantities import dotted, numbers_of

SHOWN = {"N/m": ("GN/m", 1e-9), "Pa s": ("mPa s", 1e3)}  # what sliders show SI units in


def machine_with(machine: Machine | None, card: str, *parts: str) -> Machine:
    """A machine, by default the one of a card; BadInput where it lacks one of these parts."""
    machine = machine or load_machine(card)
    if lacks := [part for part in parts if getattr(machine, part) is None]:
        raise BadInput(f"{machine.name} has no {' and no '.join(lacks)}; this explorer needs "
                       f"{' and '.join(parts)}.")
    return machine


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
    """All bearings of a machine but those against tilt."""
    found = []
    for bearing in machine.all_bearings:
        if bearing not in machine.thrust_bearings:
            name = bearing.told_by
            unit = numbers_of(type(bearing))[name].unit
            found.append(Guide(bearing.name, bearing.node, dotted(bearing.key, name),
                               getattr(bearing, name), *SHOWN.get(unit, (unit, 1.0))))
    return found


def guide_of(machine: Machine) -> Guide:
    """The radial bearing nearest to the body in the air gap; BadInput for a machine without one."""
    home, found = machine.body(machine.air_gap.body).node, guides(machine)
    if not found:
        raise BadInput(f"{machine.name} has no radial bearing; this explorer changes the stiffness "
                       "of one.")
    return min(found, key=lambda guide: abs(guide.node - home))
