r"""A transverse crack that breathes: the hinge of Gasch (1976; survey in J. Sound Vib. 160, 1993).

A crack in the middle of a shaft element is felt by the difference of the slopes at its two ends, κ
= (∂x/∂y, ∂z/∂y) at the lower end less that at the upper: the other way in which an element bends
leaves no moment in its middle. Where bending pulls at the cracked side, the crack opens and the
element loses the share Δ of its stiffness EI/l about the crack's edge; where bending presses, it is
closed and the shaft is whole:

f = −Δ p(−n·κ) n,  n = (sin(Ωt + ψ), cos(Ωt + ψ)) from the axis to the crack,  p(d) = d for d > 0
and 0 otherwise.

The flexibility of the open crack is that of fracture mechanics (Dimarogonas and Paipetis 1983):
each strip of the section is a plate with an edge crack in bending, with the stress intensity of
Tada, Paris and Irwin.

Here young: Pa. poisson: the ratio. radius: of the shaft, m. rigidity: EI, N m². length: m.
flexibility: rad/(N m).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad

from hydrolab.machine.pull import ForceLaw, Linear, Phase, Rate, quiet
from hydrolab.machine.quantities import Part, choice_field, number_field, text_field, whole_field

if TYPE_CHECKING:
    from hydrolab.machine.parts import Shaft

# of the diameter; the strips of the flexibility's integral end in the middle of the section
DEEPEST = 0.45


@dataclass(frozen=True)
class BreathingCrack(ForceLaw):
    """Moment of a crack on the slope difference κ, (2, …) rad, at the phase Ωt of the shaft.

    loss: Δ, N m/rad. phase: ψ, rad. rounding: the corner of p is rounded over this angle, rad; p(d)
    = (d + √(d² + b²))/2. breathes: False keeps the crack open, a slot, which is a linear law: the
    asymmetric shaft.
    """

    moving, magnetic, gap = True, False, math.inf
    loss: float
    phase: float = 0.0
    rounding: float = 1e-7
    breathes: bool = True

    @quiet
    def linearise(self, u: NDArray, velocity: Rate = None, phase: Phase = 0.0,
                  speed: float = 0.0) -> Linear:
        """Moment, N m, and its derivative with respect to κ = u, N m/rad."""
        angle = np.asarray(phase) + self.phase + np.zeros(u.shape[1:])
        n = np.stack([np.sin(angle), np.cos(angle)])
        size = -(n * u).sum(axis=0)  # by how much it opens
        share = np.ones_like(size)
        if self.breathes:
            hypotenuse = np.hypot(size, self.rounding)
            size, share = (size + hypotenuse) / 2, (1 + size / hypotenuse) / 2
        return -self.loss * n * size, self.loss * share * n[:, None] * n, None


@lru_cache(maxsize=64)
def crack_flexibility(depth: float, young: float, poisson: float, radius: float) -> float:
    r"""Angle about its edge that an open crack adds under a moment of one, rad/(N m).

    c = (32 (1 − ν²)/(π E R⁸)) ∫∫ (R² − x²) α F(α/h)² dα dx, strips of height h = 2√(R² − x²) with a
    crack of depth α, F(s) = √(tan(πs/2)/(πs/2)) (0.923 + 0.199 (1 − sin(πs/2))⁴)/cos(πs/2). depth:
    of the crack at its deepest over the diameter, 0 to below 0.5, where the strips at the edge of
    the crack end.
    """
    if depth == 0:
        return 0.0
    inner = radius * (1 - 2 * depth)  # distance of the crack's straight edge from the axis
    width = math.sqrt(radius**2 - inner**2)

    def intensity(s: float) -> float:
        t = math.pi * s / 2
        return math.sqrt(math.tan(t) / t) * (0.923 + 0.199 * (1 - math.sin(t)) ** 4) / math.cos(t)

    def strip(x: float) -> float:
        half = math.sqrt(radius**2 - x * x)
        deep = (half - inner) / (2 * half)
        return half**4 * 4 * quad(lambda s: s * intensity(s) ** 2, 0, deep)[0]

    area = 2 * quad(strip, 0, width)[0]
    return 32 * (1 - poisson**2) / (math.pi * young * radius**8) * area


def stiffness_loss(rigidity: float, length: float, flexibility: float) -> float:
    """Δ = k − 1/(1/k + c), N m/rad, of an element with k = EI/l: both angles add up."""
    k = rigidity / length
    return k * k * flexibility / (1 + k * flexibility)


@dataclass(frozen=True)
class Crack(Part):
    """A transverse crack in the middle of a shaft element (`BreathingCrack`)."""

    table = "cracks"
    noun = "a crack"
    name: str = text_field("what the crack is called", "crack")
    element: int = whole_field("the shaft element it is in, from 0 at the shaft top", 1)
    depth: float = number_field("1", "depth at its deepest, over the diameter", least=0,
                                most=DEEPEST, why="of the diameter; the flexibility is known no "
                                "further", example=(20, "%"))
    phase: float = number_field("rad", "angle from an unbalance of phase 0, with the spin",
                                default=0.0, example=(90, "deg"), mirrored=True)
    breathing: str = choice_field("whether it opens and closes with the bending, or stays open, a "
                                  "slot", "hinge", "open", default="hinge")
    rounding_angle: float = number_field("rad", "angle between the element's ends over which it "
                                         "opens", above=0, default=1e-7, example=1e-6)

    def law(self, shaft: Shaft) -> BreathingCrack:
        """The crack's law in its element of a solid shaft."""
        i = self.element
        young, _, poisson = shaft.material(i)
        flexibility = crack_flexibility(self.depth, young, poisson, float(shaft.diameter[i]) / 2)
        loss = stiffness_loss(float(young * shaft.second_moment[i]),
                              float(np.diff(shaft.nodes)[i]), flexibility)
        return BreathingCrack(loss, self.phase, self.rounding_angle, self.breathing == "hinge")
