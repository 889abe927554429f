"""The parts of a machine and the machine: frozen, checked when they are made, in SI units.

Axes (Villa, Carvalho and Salomon, section 2): the rotor axis y points down from the shaft top,
the transverse plane is (x, z), the spin is positive from z to x. A part that cannot exist is
refused with a sentence that names the key, its value and what is allowed; a machine is also refused
where its numbers cannot belong to one machine.
"""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hydrolab.errors import BadInput
from hydrolab.machine.bearings import (
    BEARINGS,
    Bearing,
    Guide,
    JournalFilm,
    PadBearing,
    RadialBearing,
    Seal,
    TableBearing,
    ThrustBearing,
)
from hydrolab.machine.crack import Crack
from hydrolab.machine.elements import shaft_element, tapered_element
from hydrolab.machine.gap_shape import GapShape
from hydrolab.machine.loads import Bow, Gravity, Load
from hydrolab.machine.model import assemble
from hydrolab.machine.pole_pairs import Poles
from hydrolab.machine.quantities import (
    Entry,
    Fault,
    Held,
    Part,
    choice_field,
    declared,
    dotted,
    flag_field,
    frozen,
    nickname,
    number,
    number_field,
    numbers_of,
    pair,
    per_element,
    quantity,
    shown,
    simplest,
    text_field,
    vector,
    whole_field,
)

if TYPE_CHECKING:
    from hydrolab.machine.model import Model

MU_0 = 4e-7 * math.pi  # permeability of vacuum as the paper's Table 1 states it, H/m
# Limits that no real machine comes near; beyond them a number stands in the wrong unit.
LARGEST_ROTOR = 20.0  # m, radius of gyration; the largest rotors have a radius of 11 m
BEYOND_GAP = 2  # radius of gyration of the generator, over the radius of its air gap
HEAVY = 5  # eccentricity of the generator's mass over the gap; real ones are below a tenth
LONG = 5  # thickness of a shaft, or distance of a body from it, over its length
LOOSE = 0.1  # clearance of pads over the diameter of the shaft
DIAMETERS = ("diameter", "inner_diameter", "lower_diameter")  # of a shaft
PER_ELEMENT = (*DIAMETERS, "young", "density", "poisson")
WIDE = 5  # radius of a journal over the diameter of the shaft


@dataclass(frozen=True)
class AirGap(Part):
    """The generator's air gap (Villa et al., Table 1).

    tilt, linear and tangential choose and add laws: `TiltedPull`, `LinearPull`, `TangentialPull`.
    """

    table = "air_gap"
    body: str = text_field("the name of the body inside it", "generator")
    field: float = number_field("T", "unperturbed flux density B0, rms", least=0, most=100,
                                why="iron saturates near 2 T", example=0.5)
    mean_radius: float = number_field("m", "mean radius u0 of the gap", above=0, example=3)
    length: float = number_field("m", "length l0 of the iron along the axis", above=0, example=0.97)
    gap: float = number_field("m", "nominal gap g0", above=0, example=(11, "mm"))
    tilt: bool = flag_field("whether the pull also feels the rotor lean in the stator, over the "
                            "height l0")
    linear: bool = flag_field("whether to take the pull as a negative stiffness at any "
                              "eccentricity, as design tools do")
    tangential: float = number_field("1", "pull across the eccentricity that damper circuits add, "
                                     "over the pull along it; above 0 it drives forward whirl",
                                     default=0.0, example=(0.5, "%"))

    def disagreements(self) -> Iterator[Fault]:
        """A gap is narrow."""
        if self.gap >= self.mean_radius:
            yield "gap", (f"is {self.gap:g} m; it must be smaller than air_gap.mean_radius, "
                          f"{self.mean_radius:g} m.")

    @property
    def pull_stiffness(self) -> float:
        """π B0² u0 l0 / (µ0 g0), N/m: the pull per metre of a small displacement."""
        return math.pi * self.field**2 * self.mean_radius * self.length / (MU_0 * self.gap)


@dataclass(frozen=True, eq=False)
class Shaft(Part):
    """A straight shaft of round section, divided into beam elements: "lalanne-ferraris" has the
    mass of Euler and Bernoulli, and shear in the stiffness only; "timoshenko" is consistent.
    """

    table = "shaft"
    nodes: NDArray | Any = number_field("m", "depths y of the nodes, ascending from the shaft top "
                                        "at 0; (elements + 1,)", form=vector,
                                        example=([0, 1, 5, 9], "m"))
    diameter: NDArray | Any = number_field("m", "diameter, one number or one an element",
                                           form=per_element, above=0, example=(710, "mm"))
    young: float | Any = number_field("Pa", "Young's modulus, one number or one an element",
                                      form=per_element, above=0, example=(200, "GPa"))
    density: float | Any = number_field("kg/m^3", "density, likewise", form=per_element, least=0,
                                        example=7850)
    poisson: float | Any = number_field("1", "Poisson's ratio, likewise", form=per_element,
                                        above=-1, below=0.5, default=0.3, stated=True, example=0.3)
    shear_coefficient: float = number_field("1", "share κ of the section that carries shear, which "
                                            "multiplies G A", above=0, most=1, default=0.9,
                                            stated=True, example=0.9)
    element: str = choice_field("the beam element", "lalanne-ferraris", "timoshenko",
                                default="lalanne-ferraris", stated=True)
    inner_diameter: NDArray | Any = number_field("m", "diameter of the bore, one number or one an "
                                                 "element", form=per_element, least=0, default=0.0,
                                                 example=(200, "mm"))
    lower_diameter: NDArray | Any = number_field(
        "m", "diameter at the lower end of a tapered element, one number or one an element; 0 "
        "stands for `diameter`, which is then that of the upper end", form=per_element, least=0,
        default=0.0, example=(700, "mm"))

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in DIAMETERS:
            each = np.full(len(self.nodes) - 1, getattr(self, name))
            object.__setattr__(self, name, frozen(each))

    def disagreements(self) -> Iterator[Fault]:
        """Nodes descend along the shaft, and a bore leaves some of it."""
        nodes, elements = self.nodes, len(self.nodes) - 1
        if elements < 1:
            yield "nodes", f"has {len(nodes)} entries; a shaft needs at least 2 nodes."
            return
        if nodes[0] != 0:
            yield "nodes", f"starts at {nodes[0]:g} m; the first node is the shaft top, 0 m."
        if (np.diff(nodes) <= 0).any():
            at = int(np.argmin(np.diff(nodes)))
            yield "nodes", (f"goes from {nodes[at]:g} m to {nodes[at + 1]:g} m; the depths must "
                            "ascend.")
        wrong = [(name, np.size(d)) for name in PER_ELEMENT
                 if np.ndim(d := getattr(self, name)) and np.size(d) != elements]
        for name, given in wrong:
            yield name, f"has {given} entries; give one number or one per element, {elements}."
        if wrong:
            return
        inner, outer = (np.full(elements, d) for d in (self.inner_diameter, self.diameter))
        lower = np.where(self.lower_diameter, self.lower_diameter, outer)
        for name, whole in (("diameter", outer), ("lower_diameter", lower)):
            if (inner >= whole).any():
                at = int(np.argmax(inner >= whole))
                yield "inner_diameter", (f"is {inner[at]:g} m; it must be smaller than "
                                         f"shaft.{name}, {whole[at]:g} m.")
                return

    @property
    def length(self) -> float:
        """Length, m."""
        return float(self.nodes[-1])

    def thickness(self, node: int) -> float:
        """Diameter at a node, the larger of its two elements, m."""
        lower = np.where(self.lower_diameter, self.lower_diameter, self.diameter)
        return float(max([*lower[max(node - 1, 0):node], *self.diameter[node:node + 1]]))

    def element_matrices(self, i: int) -> tuple[NDArray, NDArray, NDArray]:
        """M, G and K of an element, each (8, 8); see `elements.shaft_element`."""
        young, density, poisson = self.material(i)
        length = float(self.nodes[i + 1] - self.nodes[i])
        if self.lower_diameter[i]:
            return tapered_element(self.element, length, young, density,
                                   np.array([self.diameter[i], self.lower_diameter[i]]),
                                   np.full(2, self.inner_diameter[i]), poisson,
                                   self.shear_coefficient)
        return shaft_element(self.element, length, young, density, self.area[i],
                             self.second_moment[i], poisson, self.shear_coefficient)

    def material(self, i: int) -> tuple[float, float, float]:
        """Young's modulus, Pa, density, kg/m³, and Poisson's ratio of an element."""
        young, density, poisson = (float(np.broadcast_to(part, len(self.nodes) - 1)[i])
                                   for part in (self.young, self.density, self.poisson))
        return young, density, poisson

    @property
    def area(self) -> NDArray:
        """Section area of each element, at its upper end, m²."""
        return np.pi / 4 * (self.diameter**2 - self.inner_diameter**2)

    @property
    def second_moment(self) -> NDArray:
        """Second moment of area of each element, at its upper end, m⁴."""
        return np.pi / 64 * (self.diameter**4 - self.inner_diameter**4)


@dataclass(frozen=True)
class RigidBody(Part):
    """A rigid body of revolution, held by a massless rigid link of length |offset| to a shaft node.

    With the phase ψ of its unbalance U the force on the rotor is U Ω² (sin(Ωt + ψ), cos(Ωt + ψ)) in
    (x, z).
    """

    table = "bodies"
    noun = "a body"
    name: str = text_field("what the body is called", "generator")
    node: int = whole_field("the node it hangs on, from 0 at the shaft top", 0)
    mass: float = number_field("kg", "mass", above=0, example=(119, "t"))
    Id: float = number_field("kg m^2", "moment of inertia about a diameter through its centre",
                             least=0, default=0.0, stated=True, example=(240, "t m^2"))
    Ip: float = number_field("kg m^2", "moment of inertia about the axis", least=0, default=0.0,
                             stated=True, example=(383, "t m^2"))
    offset: float = number_field("m", "position of its centre below the node; negative: above",
                                 default=0.0, example=(-472, "mm"))
    unbalance: float = number_field("kg m", "mass times eccentricity", least=0, default=0.0,
                                    example=84)
    phase: float = number_field("rad", "angle ψ of the unbalance", default=0.0, example=(90, "deg"),
                                mirrored=True)
    added_mass: float = number_field("kg", "mass of the water that moves with it sideways", least=0,
                                     default=0.0, example=(9, "t"))
    added_Id: float = number_field("kg m^2", "inertia of the water that tilts with it", least=0,
                                   default=0.0, example=(5, "t m^2"))

    def disagreements(self) -> Iterator[Fault]:
        """Ip is at most twice Id, and the mass centre of a rotor lies inside it."""
        if self.Ip > 2 * self.Id * (1 + 1e-9):
            yield "Ip", (f"is {self.Ip:g} kg m^2; no rigid body has Ip above 2 Id, here "
                         f"{2 * self.Id:g} kg m^2.")
        if self.gyration > LARGEST_ROTOR:
            yield "mass", self.heavy(f"no rotor has more than {LARGEST_ROTOR:g} m")
        if 0 < self.gyration < self.unbalance / self.mass:
            yield "unbalance", (f"is {self.unbalance:g} kg m, {self.unbalance / self.mass:.3g} m "
                                f"times the mass; that must be less than the radius of gyration, "
                                f"{self.gyration:.3g} m.")

    @property
    def gyration(self) -> float:
        """Radius of gyration about the axis, √(Ip/m), m."""
        return math.sqrt(self.Ip / self.mass)

    def heavy(self, limit: str) -> str:
        """The sentence on a radius of gyration above a limit, which is given in words."""
        return (f"is {self.mass:g} kg and {self.key}.Ip {self.Ip:g} kg m^2, a radius of gyration "
                f"of {self.gyration:.3g} m; {limit}, so one of them is in another unit.")


@dataclass(frozen=True)
class RayleighDamping(Part):
    """C = αM + βK with the given damping ratios in the first and the second distinct mode at rest;
    of a K with cross-coupling, its symmetric part.
    """

    table = "damping"
    ratio: tuple[float, float] = number_field("1", "damping ratios of the two modes, one or two "
                                              "numbers", form=pair, least=0, below=1,
                                              example=(1, "%"))


# What a card has tables of, in their order: one of a kind, or several that have names.
KINDS: tuple[type[Part], ...] = (Shaft, RigidBody, Bearing, RayleighDamping, AirGap, Crack, Poles,
                                 GapShape, Gravity, Load, Bow)


@dataclass(frozen=True, eq=False)
class Machine(Part):
    """A machine as its card describes it; `model()` turns it into matrices and a force law.

    speed: rated speed, rad/s. shaft: None for a point mass on springs (one node, which translates).
    pad_bearings, films, cracks: parts that act nonlinearly on their own coordinates. seals,
    tables: linear ones of other coefficients.
    poles, shapes: what makes the field or the gap other than constant and round.
    gravity: of a unit whose shaft lies. loads, bows: what no motion makes.
    provenance: for each number of the card, by its dotted key ("bodies.generator.mass"), what the
    card says; print the machine to see them. about: what the card says of itself.

    Raises BadInput with every fault, a sentence a line, where its numbers cannot belong together.
    """

    noun = "the machine"
    name: str = text_field("what the machine is called", "my unit")
    speed: float = number_field("rad/s", "rated speed", least=0, example=(150, "rpm"))
    shaft: Shaft | None = None
    bodies: tuple[RigidBody, ...] = ()
    bearings: tuple[RadialBearing, ...] = ()
    thrust_bearings: tuple[ThrustBearing, ...] = ()
    damping: RayleighDamping | None = None
    air_gap: AirGap | None = None
    title: str = text_field("a line about it", "A Kaplan unit", "")
    provenance: Mapping[str, Entry] = field(default_factory=dict)
    about: str = text_field("a paragraph about it", "Where its numbers come from.", "")
    pad_bearings: tuple[PadBearing, ...] = ()
    films: tuple[JournalFilm, ...] = ()
    cracks: tuple[Crack, ...] = ()
    poles: Poles | None = None
    shapes: tuple[GapShape, ...] = ()
    gravity: Gravity | None = None
    loads: tuple[Load, ...] = ()
    bows: tuple[Bow, ...] = ()
    seals: tuple[Seal, ...] = ()
    tables: tuple[TableBearing, ...] = ()

    def __post_init__(self) -> None:
        nickname("name", self.name)
        object.__setattr__(self, "provenance", dict(self.provenance))
        super().__post_init__()

    @property
    def key(self) -> str:
        """Nothing: the keys of its own numbers stand alone."""
        return ""

    def disagreements(self) -> Iterator[Fault]:
        """What does not go together in this machine, by the keys of its numbers."""
        bent = self._bent() if self.shaft is None else self._cracked(self.shaft)
        yield from [*self._misplaced(), *bent, *self._clashes()] or self._sizes()

    def _misplaced(self) -> Iterator[Fault]:
        """Names used twice, parts off the shaft."""
        placed: tuple[Any, ...] = (*self.bodies, *self.all_bearings)
        groups: tuple[tuple[Any, ...], ...] = (placed, self.cracks, self.shapes, self.loads,
                                               self.bows)
        for group in groups:
            names = Counter(part.name for part in group)
            for part in group:
                if names[part.name] > 1:
                    yield f"{part.key}.name", (f"is not its own: the name {part.name!r} is used "
                                               "twice; names must differ.")
        allowed = (f"the nodes are 0 to {self.nodes - 1}" if self.shaft
                   else "without a shaft the only node is 0")
        for part in (*placed, *self.loads, *self.bows):
            for name in {"node", "end_node"} & declared(type(part)).keys():
                if (node := getattr(part, name)) >= self.nodes:
                    yield f"{part.key}.{name}", f"is {shown(node)}, off the shaft; {allowed}."

    def _cracked(self, shaft: Shaft) -> Iterator[Fault]:
        """Cracks that cannot be in this shaft."""
        for crack in self.cracks:
            if crack.element >= self.nodes - 1:
                yield f"{crack.key}.element", (f"is {crack.element}; the shaft's elements are 0 to "
                                               f"{self.nodes - 2}.")
            elif shaft.lower_diameter[crack.element]:
                yield f"{crack.key}.element", (f"is {crack.element}, which is tapered; the crack's "
                                               "flexibility is that of a uniform shaft.")
            elif shaft.inner_diameter[crack.element]:
                yield f"{crack.key}.element", (f"is {crack.element}, which is hollow; the crack's "
                                               "flexibility is that of a solid shaft.")

    def _bent(self) -> Iterator[Fault]:
        """What a machine without a shaft cannot have."""
        if not self.bodies:
            yield "bodies", "is empty; a machine without a shaft needs a body."
        hangs: tuple[RigidBody | Load, ...] = (*self.bodies, *self.loads)
        for hung in hangs:
            if hung.offset:
                yield f"{hung.key}.offset", (f"is {hung.offset:g} m; without a shaft nothing "
                                             "tilts, so it must be 0.")
        for bearing in self.thrust_bearings:
            yield f"{bearing.key}.tilt_stiffness", "has no meaning without a shaft."
        for guide in self.all_bearings:
            if isinstance(guide, Guide) and guide.has_bracket:
                yield f"{guide.key}.bracket_stiffness", "needs a shaft; state one, or no bracket."
        for part in (*self.cracks, *self.bows):
            yield part.key, ("has no shaft to be in; a machine without a shaft has no "
                             f"{part.table}.")
        if self.damping:
            yield "damping.ratio", ("needs two distinct modes; without a shaft there is one, so "
                                    "give the bearing a damping instead.")
        if self.air_gap and self.air_gap.tilt:
            yield "air_gap.tilt", "is true, but without a shaft nothing tilts; leave it out."

    def _clashes(self) -> Iterator[Fault]:
        """What does not go together in the air gap."""
        air, poles, shapes = self.air_gap, self.poles, self.shapes
        what = "poles" if poles else "shapes"
        if air is None:
            if poles or shapes:
                yield what, "needs an air gap; add [air_gap]."
            return
        names = [body.name for body in self.bodies]
        if air.body not in names:
            yield "air_gap.body", (f"is {shown(air.body)}; it must be the name of a body: "
                                   f"{', '.join(names) or 'there is none'}.")
        if poles and shapes and poles.series != "whole":
            yield "poles.series", (f"is {shown(poles.series)}, a series for a round gap, and "
                                   f"shapes has {len(shapes)} entries; leave out poles.series or "
                                   "the shapes.")
        if poles and shapes and poles.flux_share != 1.0:
            yield "poles.flux_share", (f"is {poles.flux_share:g}, which is known for a round gap; "
                                       "leave out poles.flux_share or the shapes.")
        if air.linear and (poles or shapes):
            yield "air_gap.linear", ("is true, which is the pull of design tools in a round gap; "
                                     f"leave out {what} or air_gap.linear.")
        if (total := sum(abs(shape.size) for shape in shapes)) >= air.gap:
            yield "shapes", (f"add up to {total:g} m; together they must be smaller than "
                             f"air_gap.gap, {air.gap:g} m.")

    def _sizes(self) -> Iterator[Fault]:
        """Sizes that cannot belong to one machine: one of two numbers is in another unit."""
        if air := self.air_gap:
            rotor = self.body(air.body)
            if rotor.gyration > BEYOND_GAP * air.mean_radius:
                yield f"{rotor.key}.mass", rotor.heavy(
                    f"the rotor turns within air_gap.mean_radius, {air.mean_radius:g} m")
            if (eccentricity := rotor.unbalance / rotor.mass) > HEAVY * air.gap:
                yield f"{rotor.key}.unbalance", (
                    f"is {rotor.unbalance:g} kg m, {eccentricity:.3g} m times the mass; that must "
                    f"be at most {HEAVY} times air_gap.gap, {air.gap:g} m.")
        for table in self.tables:
            low, high = table.speeds[[0, -1]]
            if not low <= self.speed <= high:
                yield "speed", (f"is {self.speed:g} rad/s; {table.key}.speeds goes from {low:g} to "
                                f"{high:g} rad/s, so add a row.")
        for key, length, most, what in self._lengths():
            if abs(length) > most:
                yield key, f"is {length:g} m; it must be at most {what}, {most:g} m."

    def _lengths(self) -> Iterator[tuple[str, float, float, str]]:
        """Keys of lengths, the lengths, m, and what they may be at most, m and in words."""
        if shaft := self.shaft:
            most, what = LONG * shaft.length, f"{LONG} times the shaft's {shaft.length:g} m"
            yield "shaft.diameter", float(shaft.diameter.max()), most, what
            hangs: tuple[RigidBody | Load, ...] = (*self.bodies, *self.loads)
            for hung in hangs:
                yield f"{hung.key}.offset", hung.offset, most, what
            for film in self.films:
                yield (f"{film.key}.journal_radius", film.journal_radius,
                       WIDE * shaft.thickness(film.node), f"{WIDE} times shaft.diameter there")
            for pads in self.pad_bearings:
                yield (f"{pads.key}.clearance", pads.clearance,
                       LOOSE * shaft.thickness(pads.node), f"{LOOSE:g} times shaft.diameter there")
        elif air := self.air_gap:
            for pads in self.pad_bearings:
                yield f"{pads.key}.clearance", pads.clearance, air.gap, "air_gap.gap"

    @property
    def all_bearings(self) -> tuple[Bearing, ...]:
        """Every bearing, kind by kind."""
        return tuple(bearing for kind in BEARINGS for bearing in getattr(self, kind.group))

    @property
    def places(self) -> dict[str, int]:
        """The nodes of bodies and bearings, by their names."""
        bodies = {body.name: body.node for body in self.bodies}
        return bodies | {bearing.name: bearing.node for bearing in self.all_bearings}

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return 1 if self.shaft is None else len(self.shaft.nodes)

    def body(self, name: str) -> RigidBody:
        """The rigid body of that name.

        Raises BadInput if there is none.
        """
        for body in self.bodies:
            if body.name == name:
                return body
        raise BadInput(f"no body is called {name!r}; there are "
                       f"{', '.join(b.name for b in self.bodies)}.")

    def reversed(self) -> Machine:
        """The machine turning the other way, as a mirror shows it: x is turned round, so that its
        spin runs from z to x again. What turns with it and what the spin drives stay as they are.
        """
        cross = {(2, 2): [[1, -1], [-1, 1]]}
        changes = {key: value * np.array(cross.get(np.shape(value), [1, -1, -1, 1]
                                                   if np.ndim(value) else -1))
                   for key, (part, name) in self._owners().items()
                   if numbers_of(type(part))[name].mirrored
                   for value in [getattr(part, name)]}
        return self.with_numbers(changes)

    def model(self) -> Model:
        """The machine's matrices, pull and unbalance."""
        return assemble(self)

    # Its numbers

    def parts(self) -> list[Part]:
        """The machine itself and its parts, in the order in which they are printed."""
        parts = (self, self.shaft, *self.bodies, *self.all_bearings, *self.cracks, self.poles,
                 *self.shapes, self.damping, self.air_gap, self.gravity, *self.loads, *self.bows)
        return [part for part in parts if part is not None]

    def _owners(self) -> dict[str, tuple[Part, str]]:
        """The part and the field of each number, by its key."""
        return {dotted(part.key, name): (part, name)
                for part in self.parts() for name in numbers_of(type(part))}

    def numbers(self) -> dict[str, Any]:
        """Every number of the machine by its dotted key, in SI units, as the parts hold it."""
        return {key: getattr(part, name) for key, (part, name) in self._owners().items()}

    def _owner(self, key: str) -> tuple[Part, str]:
        """The part and the field of a number, by its key or its short form "field"."""
        owners, key = self._owners(), "air_gap.field" if key == "field" else key
        if isinstance(key, str) and key in owners:
            return owners[key]
        for part in self.parts()[1:]:
            if isinstance(key, str) and key.rpartition(".")[0] == part.key:
                raise BadInput(f"{key!r} is not a number; this part has "
                               f"{', '.join(numbers_of(type(part)))}.")
        raise BadInput(f"{shown(key)} is not a number of {self.name}; there are "
                       f"{', '.join((*owners, 'unbalance'))}.")

    def number(self, key: str) -> tuple[float, str]:
        """The value of a number of the machine and its SI unit, by its dotted key.

        An isotropic bearing and a uniform shaft count as one number. Raises BadInput for a key that
        the machine does not have, and for a number that is a list or a matrix.
        """
        part, name = self._owner(key)
        value, unit = simplest(getattr(part, name)), numbers_of(type(part))[name].unit
        if np.ndim(value):
            raise BadInput(f"{key} is {quantity(value, unit)}; it must be one number here.")
        return float(value), unit

    def with_numbers(self, changes: Mapping[str, Any]) -> Machine:
        """The machine with these numbers in place of its own; see `hydrolab.machine.vary`."""
        new: dict[str, dict[str, Any]] = {}
        for key, value in changes.items():
            if key == "unbalance":
                ratio = number("unbalance", value, least=0)
                for body in self.bodies:
                    own = new.setdefault(body.key, {})
                    own[key] = ratio * own.get(key, body.unbalance)
            else:
                part, name = self._owner(key)
                new.setdefault(part.key, {})[name] = value

        def renewed(part: Any) -> Any:
            return replace(part, **new[part.key]) if part.key in new else part

        # all at once, so that numbers which must agree can change together
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        parts: dict[str, Any] = {
            name: renewed(value) if isinstance(value, Part) else tuple(map(renewed, value))
            for name, value in values.items() if isinstance(value, (Part, tuple))}
        return replace(self, **parts, **new.get("", {})) if changes else self

    def rows(self) -> list[Sequence[str]]:
        """Key, quantity, source and note of every number, but of zeros that nobody stated."""
        return [row for key, (part, name) in self._owners().items()
                if (row := _row(key, getattr(part, name), numbers_of(type(part))[name],
                                self.provenance.get(key)))]

    def __str__(self) -> str:
        rows = self.rows()
        wide = max(len(key) for key, *_ in rows)
        lines = [f"{self.name}: {self.title}" if self.title else self.name]
        lines += textwrap.wrap(self.about, 110, initial_indent="  ", subsequent_indent="  ")
        for key, now, source, note in rows:
            start = f"  {key:<{wide}}  {now:<18}  {source:<10}  "
            if len(now) > 18:
                lines += textwrap.wrap(now, 120, initial_indent=f"  {key:<{wide}}  ",
                                       subsequent_indent=" " * (wide + 4))
                start = " " * (wide + 24) + f"{source:<10}  "
            lines += [start + note] if source or note or len(now) <= 18 else []
        return "\n".join(line.rstrip() for line in lines)


def _row(key: str, value: Any, held: Held, entry: Entry | None) -> Sequence[str]:
    """Key, quantity, source and note of a number as printed; nothing for a zero nobody stated."""
    if entry is not None and np.array_equal(entry.si, value):
        return key, entry.quantity, entry.source, entry.note
    if entry is None and not np.any(value):
        return ()
    now = quantity(simplest(value), held.unit)
    return (key, now, "changed", f"the card says {entry.quantity}") if entry else (key, now, "", "")
