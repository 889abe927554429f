"""Parts that act nonlinearly on their own coordinates: a bearing of pads, a journal film, a cracked shaft element.

Frozen and validated like the other parts, in SI units; `attach` makes force laws of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from hydrolab.errors import BadInput
from hydrolab.machine.checks import nickname, number, shown, whole
from hydrolab.machine.crack import BreathingCrack, crack_flexibility, stiffness_loss
from hydrolab.machine.film import ShortFilm
from hydrolab.machine.pads import Pads

DEEPEST = 0.45  # of the diameter; the strips of the flexibility's integral end in the middle of the section
BREATHING = ("hinge", "open")
STIFF = 5  # so that the linear answer, from which a solver starts, lies within the clearance


@dataclass(frozen=True)
class PadBearing:
    """A guide bearing of separate pads with clearance (`Pads`): dry contact, no friction.

    pads: how many, at equal angles. pad_stiffness: of each, N/m. clearance: between each and the resting journal, m;
    negative is a preload. angle: gap angle of the first pad, rad. rounding: distance over which contact begins softly,
    m; 0 stands for a tenth of the clearance, or of a millimetre where there is no clearance.
    """

    name: str
    node: int
    pads: int
    pad_stiffness: float
    clearance: float
    angle: float = 0.0
    rounding: float = 0.0

    def __post_init__(self) -> None:
        key = f"bearings.{nickname('the name of a bearing', self.name)}"
        put = object.__setattr__
        put(self, "pads", whole(f"{key}.pads", self.pads, 3, 64, "with fewer than 3 the journal can slip out between"))
        put(self, "pad_stiffness", number(f"{key}.pad_stiffness", self.pad_stiffness, above=0, unit="N/m"))
        put(self, "clearance", number(f"{key}.clearance", self.clearance, unit="m"))
        put(self, "angle", number(f"{key}.angle", self.angle, unit="rad"))
        put(self, "rounding", number(f"{key}.rounding", self.rounding, least=0, unit="m"))

    def law(self) -> Pads:
        """The bearing's law, which takes back the linear bearing of its closed stiffness in the model's matrix."""
        rounding = self.rounding or 0.1 * (abs(self.clearance) or 1e-3)
        closed = self.pads * self.pad_stiffness / 2
        return Pads(self.pad_stiffness, self.clearance, self.pads, self.angle, rounding, closed)


@dataclass(frozen=True)
class JournalFilm:
    """A short journal bearing with a cavitated oil film (`ShortFilm`).

    viscosity: µ, Pa s. journal_radius: R, m. film_length: L along the axis, m. clearance: radial, m.
    """

    name: str
    node: int
    viscosity: float
    journal_radius: float
    film_length: float
    clearance: float

    def __post_init__(self) -> None:
        key = f"bearings.{nickname('the name of a bearing', self.name)}"
        put = object.__setattr__
        put(self, "viscosity", number(f"{key}.viscosity", self.viscosity, above=0, unit="Pa s"))
        for name in ("journal_radius", "film_length", "clearance"):
            put(self, name, number(f"{key}.{name}", getattr(self, name), above=0, unit="m"))
        if self.clearance > 0.1 * self.journal_radius:
            raise BadInput(f"{key}.clearance is {self.clearance:g} m; a film is thin, so it must be at most a tenth of "
                           f"{key}.journal_radius, {self.journal_radius:g} m.")
        if self.film_length > 2 * self.journal_radius:
            raise BadInput(f"{key}.film_length is {self.film_length:g} m; the short film holds for bearings no longer "
                           f"than their diameter, {2 * self.journal_radius:g} m.")

    def law(self, speed: float) -> ShortFilm:
        """The film's law; the reference it takes back is STIFF times its cross stiffness in the middle at this speed."""
        damping = self.viscosity * self.journal_radius * (self.film_length / self.clearance) ** 3
        return ShortFilm(damping, self.clearance, STIFF * math.pi / 4 * damping * speed)


@dataclass(frozen=True)
class Crack:
    """A transverse crack in the middle of a shaft element (`BreathingCrack`).

    element: counted from the shaft top, from 0. depth: of the crack at its deepest, over the diameter.
    phase: angle of the crack from the direction of an unbalance of phase 0, rad, with the spin.
    breathing: "hinge" opens and closes with the bending, "open" is a slot. rounding_angle: the angle between the
    element's ends over which it opens, rad.
    """

    name: str
    element: int
    depth: float
    phase: float = 0.0
    breathing: str = "hinge"
    rounding_angle: float = 1e-7

    def __post_init__(self) -> None:
        key = f"cracks.{nickname('the name of a crack', self.name)}"
        put = object.__setattr__
        put(self, "element", whole(f"{key}.element", self.element, 0, 10_000, "elements are counted from 0 at the top"))
        put(self, "depth", number(f"{key}.depth", self.depth, least=0))
        if self.depth > DEEPEST:
            raise BadInput(f"{key}.depth is {self.depth:g}; the flexibility is known up to {DEEPEST:g} of the diameter.")
        put(self, "phase", number(f"{key}.phase", self.phase, unit="rad"))
        put(self, "rounding_angle", number(f"{key}.rounding_angle", self.rounding_angle, above=0, unit="rad"))
        if self.breathing not in BREATHING:
            raise BadInput(f"{key}.breathing is {shown(self.breathing)}; it must be one of {', '.join(BREATHING)}.")

    def law(self, young: float, poisson: float, diameter: float, rigidity: float, length: float) -> BreathingCrack:
        """The crack's law in an element of a solid round shaft. rigidity: EI, N m². length: of the element, m."""
        flexibility = crack_flexibility(self.depth, young, poisson, diameter / 2)
        return BreathingCrack(stiffness_loss(rigidity, length, flexibility), self.phase, self.rounding_angle,
                              self.breathing == "hinge")
