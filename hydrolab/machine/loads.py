"""Loads that no motion makes: weight across a lying shaft, a force at a place, a shaft that is bent
at rest.

A force that stands still is constant, one of a bow turns with the shaft. With bearings out of line
and a collar out of square, whose numbers stand with the bearings, they are the `static` and the
`turning` of a `Model`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydrolab.machine.quantities import Fault, Part, number_field, text_field, whole_field


def towards(angle: float) -> NDArray:
    """The unit vector (x, z) at a gap angle, rad, from z towards x."""
    return np.array([math.sin(angle), math.cos(angle)])


def turning_with(phase: float) -> NDArray:
    """Complex (x, z) of the unit vector (sin(Ωt + ψ), cos(Ωt + ψ)) = Re(… e^{iΩt}); phase: ψ, rad.
    """
    return np.exp(1j * phase) * np.array([-1j, 1.0])


@dataclass(frozen=True)
class Gravity(Part):
    """Weight across the shaft, of a unit that lies, or the share of it that a leaning one feels.
    Water that moves with a runner is not weighed.
    """

    table = "gravity"
    acceleration: float = number_field("m/s^2", "acceleration of free fall across the shaft",
                                       above=0, most=30, example=9.81)
    direction: float = number_field("rad", "gap angle of down, from z towards x; z is up in "
                                    "drawings", default=math.pi, example=(180, "deg"),
                                    mirrored=True)

    def field(self) -> NDArray:
        """The acceleration (x, z), m/s²."""
        return self.acceleration * towards(self.direction)


@dataclass(frozen=True)
class Load(Part):
    """A constant force on the shaft, such as the hydraulic radial thrust on a runner."""

    table = "loads"
    noun = "a load"
    name: str = text_field("what the load is called", "radial thrust")
    node: int = whole_field("the node it acts at, from 0 at the shaft top", 5)
    force: float = number_field("N", "size of the force", example=(120, "kN"))
    direction: float = number_field("rad", "gap angle it points to, from z towards x",
                                    default=0.0, example=(90, "deg"), mirrored=True)
    offset: float = number_field("m", "how far below the node it acts; negative: above",
                                 default=0.0, example=(200, "mm"))


@dataclass(frozen=True)
class Bow(Part):
    """A stretch of the shaft that is bent at rest, as an arc; a short one is the kink of a coupling
    whose faces are out of square.
    """

    table = "bows"
    noun = "a bow"
    name: str = text_field("what the bow is called", "bow")
    node: int = whole_field("the node it begins at, from 0 at the shaft top", 1)
    end_node: int = whole_field("the node it ends at", 5)
    size: float = number_field("m", "how far its middle is off the line between its ends",
                               example=(0.1, "mm"))
    phase: float = number_field("rad", "angle its middle points to, from an unbalance of phase 0, "
                                "with the spin", default=0.0, example=(90, "deg"), mirrored=True)

    def disagreements(self) -> Iterator[Fault]:
        """It goes down the shaft."""
        if self.end_node <= self.node:
            yield "end_node", f"is {self.end_node}; it must lie below {self.key}.node, {self.node}."

    def shape(self, nodes: NDArray, element: int) -> NDArray:
        """Complex (x, z, θx, θz) at the two ends of an element, (8,), that the shaft has at rest.

        nodes: depths, m. The arc's ends are on the axis; zero for an element out of the bow.
        """
        if not self.node <= element < self.end_node:
            return np.zeros(8, dtype=complex)
        y = nodes[element:element + 2] - nodes[self.node]
        length = nodes[self.end_node] - nodes[self.node]
        away, slope = (4 * self.size / length**2 * part for part in (y * (length - y),
                                                                     length - 2 * y))
        x, z = turning_with(self.phase)
        return np.stack([away * x, away * z, slope * z, -slope * x], axis=1).ravel()
