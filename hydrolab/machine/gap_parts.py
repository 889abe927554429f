"""What makes the field or the gap other than round and constant: poles and their waves, and shapes of stator and rotor.

Frozen and validated like the other parts, in SI units; `attach` makes the law of the air gap of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hydrolab.errors import BadInput
from hydrolab.machine.checks import nickname, number, shown, whole
from hydrolab.machine.field_wave import FieldWave, loaded
from hydrolab.machine.pole_pairs import PolePairPull
from hydrolab.machine.shapes import Bulge

SERIES = ("whole", "published")
SIDES = ("stator", "rotor")
MOST = 40  # of the order of a shape: the quadrature's 256 points resolve it


@dataclass(frozen=True)
class Poles:
    """The poles of the field, whose pull beats with twice the electrical frequency (`PolePairPull`, `FieldWave`).

    pole_pairs: p. electrical_ratio: electrical over mechanical angle; 0 stands for p, a synchronous machine.
    pole_angle: electrical angle of the field's peak from z at phase 0, rad.
    backward, backward_angle: the wave that turns backward where the phases are out of balance, over the forward one, and
    its angle, rad. stator_mmf, load_angle: the stator's wave of magnetomotive force over the rotor's, whose field is B0,
    and its electrical angle behind it, rad. series: "whole", or "published" for the permeance cut at its third order.
    """

    pole_pairs: int
    electrical_ratio: float = 0.0
    pole_angle: float = 0.0
    backward: float = 0.0
    backward_angle: float = 0.0
    stator_mmf: float = 0.0
    load_angle: float = 0.0
    series: str = "whole"

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "pole_pairs", whole("poles.pole_pairs", self.pole_pairs, 1, 100, "leave out [poles] for a constant field"))
        for name in ("pole_angle", "backward_angle", "load_angle"):
            put(self, name, number(f"poles.{name}", getattr(self, name), unit="rad"))
        for name in ("electrical_ratio", "backward", "stator_mmf"):
            put(self, name, number(f"poles.{name}", getattr(self, name), least=0))
        if self.series not in SERIES:
            raise BadInput(f"poles.series is {shown(self.series)}; it must be one of {', '.join(SERIES)}.")
        if self.stator_mmf and (self.backward or self.series != "whole"):
            raise BadInput(f"poles.stator_mmf is {self.stator_mmf:g}, which is taken by quadrature in a field without "
                           "a backward wave; leave out backward and series.")

    def law(self, stiffness: float, gap: float) -> PolePairPull | FieldWave:
        """The law of the field in a round gap. stiffness: k, N/m. gap: g0, m."""
        p, ratio = self.pole_pairs, self.electrical_ratio or float(self.pole_pairs)
        if self.stator_mmf:
            return FieldWave(stiffness, gap, loaded(p, self.stator_mmf, self.load_angle, ratio, self.pole_angle))
        return PolePairPull(stiffness, gap, p, ratio, self.pole_angle, self.backward, self.backward_angle,
                            self.series == "published")


@dataclass(frozen=True)
class GapShape:
    """One order of a shape out of round (`Bulge`): the radius is larger by size · cos(order (φ − angle)).

    of: "stator", which stands still, or "rotor", which turns. order: lobes around the circumference. size: m.
    angle: gap angle of a lobe, rad, on the rotor at phase 0.
    """

    name: str
    of: str
    order: int
    size: float
    angle: float = 0.0

    def __post_init__(self) -> None:
        key = f"shapes.{nickname('the name of a shape', self.name)}"
        put = object.__setattr__
        if self.of not in SIDES:
            raise BadInput(f"{key}.of is {shown(self.of)}; it must be one of {', '.join(SIDES)}.")
        put(self, "order", whole(f"{key}.order", self.order, 1, MOST, "1 is a shift, 2 an oval"))
        put(self, "size", number(f"{key}.size", self.size, unit="m"))
        put(self, "angle", number(f"{key}.angle", self.angle, unit="rad"))

    def bulge(self) -> Bulge:
        """The shape as the law takes it."""
        return Bulge(self.order, self.size, self.angle)


def gap_shapes(side: str, bulges: Sequence[Bulge], name: str = "") -> tuple[GapShape, ...]:
    """The parts of a shape of many orders, for `dataclasses.replace(machine, shapes=…)`; each is named by its order."""
    return tuple(GapShape(f"{name or side} {b.order}", side, b.order, b.size, b.angle) for b in bulges)


def check_gap(gap: float, *, tilt: bool, linear: bool, poles: Poles | None, shapes: tuple[GapShape, ...]) -> None:
    """Say in a sentence which parts do not go together in one air gap (gap: g0, m; inf where there is none)."""
    if math.isinf(gap) and (poles or shapes):
        raise BadInput(f"{'poles' if poles else 'shapes'} needs an air gap; add [air_gap].")
    if poles and shapes:
        raise BadInput(f"poles has {poles.pole_pairs} pole pairs and shapes has {len(shapes)} entries; the law of the gap "
                       "takes one of them, so leave out the other.")
    if linear and (poles or shapes):
        raise BadInput("air_gap.linear is true, which is the pull of design tools in a round gap; leave out "
                       f"{'poles' if poles else 'shapes'} or air_gap.linear.")
    if tilt and (poles or any(shape.of == "rotor" for shape in shapes)):
        raise BadInput("air_gap.tilt is true, which takes a pull that stands still; leave out air_gap.tilt, the poles "
                       "and the shapes of the rotor.")
    names = [shape.name for shape in shapes]
    for shape in shapes:
        if names.count(shape.name) > 1:
            raise BadInput(f"shapes: the name {shape.name!r} is used twice; names must differ.")
    total = sum(abs(shape.size) for shape in shapes)
    if total >= gap:
        raise BadInput(f"shapes add up to {total:g} m; together they must be smaller than air_gap.gap, {gap:g} m.")
