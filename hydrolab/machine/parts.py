"""The generator's air gap: frozen, validated on construction, in SI units.

The parts of a machine: frozen, validated on construction, in SI units.

Axes (Villa, Carvalho and Salomon, section 2): the rotor axis y points down from the shaft top,
the transverse plane is (x, z), the spin is positive from z to x. A part that cannot exist is
refused with a sentence that names the key, its value and what is allowed.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrolab.errors import BadInput
from hydrolab.machine.bearings import (
    Crack,
    JournalFilm,
    PadBearing,
    RadialBearing,
    RayleighDamping,
    ThrustBearing,
)
from hydrolab.machine.gap_shape import GapShape, Poles, check_gap
from hydrolab.machine.quantities import SI_UNITS, Entry, nickname, number, quantity, shown, vector

MU_0 = 4e-7 * math.pi  # permeability of vacuum as the paper's Table 1 states it, H/m


@dataclass(frozen=True)
class AirGap:
    """The generator's air gap (Villa et al., Table 1).

    body: the name of the rigid body inside it. field: unperturbed flux density B0, T (rms).
    mean_radius: u0, m. length: l0, m. gap: nominal gap g0, m.
    tilt: whether the pull also feels the rotor lean in the stator, over the height l0
    (`TiltedPull`). linear: take the pull as a negative stiffness at any eccentricity, as design
    tools do (`LinearPull`). tangential: pull across the eccentricity that damper circuits add, over
    the pull along it; above 0 it drives forward whirl (`TangentialPull`).
    """

    body: str
    field: float
    mean_radius: float
    length: float
    gap: float
    tilt: bool = False
    linear: bool = False
    tangential: float = 0.0

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "field", number("air_gap.field", self.field, least=0, unit="T"))
        put(self, "mean_radius", number("air_gap.mean_radius", self.mean_radius, above=0, unit="m"))
        put(self, "length", number("air_gap.length", self.length, above=0, unit="m"))
        put(self, "gap", number("air_gap.gap", self.gap, above=0, unit="m"))
        if self.gap >= self.mean_radius:
            raise BadInput(f"air_gap.gap is {self.gap:g} m; it must be smaller than "
                           f"air_gap.mean_radius, {self.mean_radius:g} m.")
        put(self, "tangential", number("air_gap.tangential", self.tangential))
        for name in ("tilt", "linear"):
            if not isinstance(getattr(self, name), bool):
                raise BadInput(f"air_gap.{name} is {shown(getattr(self, name))}; it must be true "
                               "or false.")

    @property
    def pull_stiffness(self) -> float:
        """π B0² u0 l0 / (µ0 g0), N/m: the pull per metre of a small displacement."""
        return math.pi * self.field**2 * self.mean_radius * self.length / (MU_0 * self.gap)


ELEMENTS = ("lalanne-ferraris", "timoshenko")


@dataclass(frozen=True, eq=False)
class Shaft:
    """A straight shaft of round section, divided into beam elements.

    nodes: depths y of the nodes, m, ascending from the shaft top at 0; shape (elements + 1,).
    diameter, inner_diameter: m; one number, or one per element.
    young: Pa. density: kg/m³. poisson: Poisson's ratio.
    shear_coefficient: κ ≤ 1, the share of the section that carries shear (multiplies G A).
    element: "lalanne-ferraris" (Euler–Bernoulli mass, shear in the stiffness only) or
    "timoshenko" (consistent).
    """

    nodes: NDArray
    diameter: NDArray
    young: float
    density: float
    poisson: float = 0.3
    shear_coefficient: float = 0.9
    element: str = "lalanne-ferraris"
    inner_diameter: NDArray | float = 0.0

    def __post_init__(self) -> None:
        nodes = vector("shaft.nodes", self.nodes, unit="m")
        if len(nodes) < 2:
            raise BadInput(f"shaft.nodes has {len(nodes)} entries; a shaft needs at least 2 nodes.")
        if nodes[0] != 0:
            raise BadInput(f"shaft.nodes starts at {nodes[0]:g} m; the first node is the shaft "
                           "top, 0 m.")
        if (np.diff(nodes) <= 0).any():
            at = int(np.argmin(np.diff(nodes)))
            raise BadInput(f"shaft.nodes goes from {nodes[at]:g} m to {nodes[at + 1]:g} m; "
                           "the depths must ascend.")
        outer = self._per_element("shaft.diameter", self.diameter, len(nodes) - 1, above=0.0)
        inner = self._per_element("shaft.inner_diameter", self.inner_diameter, len(nodes) - 1,
                                  least=0.0)
        if (inner >= outer).any():
            at = int(np.argmax(inner >= outer))
            raise BadInput(f"shaft.inner_diameter is {inner[at]:g} m; it must be smaller than "
                           f"shaft.diameter, {outer[at]:g} m.")
        put = object.__setattr__
        put(self, "nodes", nodes)
        put(self, "diameter", outer)
        put(self, "inner_diameter", inner)
        put(self, "young", number("shaft.young", self.young, above=0, unit="Pa"))
        put(self, "density", number("shaft.density", self.density, least=0, unit="kg/m^3"))
        put(self, "poisson", number("shaft.poisson", self.poisson, above=-1, below=0.5))
        put(self, "shear_coefficient",
            number("shaft.shear_coefficient", self.shear_coefficient, above=0))
        if self.shear_coefficient > 1:
            raise BadInput(f"shaft.shear_coefficient is {self.shear_coefficient:g}; it is the "
                           "share of the section "
                           "that carries shear, so it must be at most 1.")
        if self.element not in ELEMENTS:
            raise BadInput(f"shaft.element is {shown(self.element)}; it must be one of "
                           f"{', '.join(ELEMENTS)}.")

    @staticmethod
    def _per_element(key: str, value: ArrayLike, elements: int, **limits: float) -> NDArray:
        if not np.iterable(value) or isinstance(value, (str, Mapping)):
            value = [number(key, value, unit="m", **limits)] * elements
        array = vector(key, value, unit="m", **limits)
        if len(array) != elements:
            raise BadInput(f"{key} has {len(array)} entries; give one number or one per element, "
                           f"{elements}.")
        return array

    @property
    def length(self) -> float:
        """Length, m."""
        return float(self.nodes[-1])

    @property
    def area(self) -> NDArray:
        """Section area of each element, m²."""
        return np.pi / 4 * (self.diameter**2 - self.inner_diameter**2)

    @property
    def second_moment(self) -> NDArray:
        """Second moment of area of each element, m⁴."""
        return np.pi / 64 * (self.diameter**4 - self.inner_diameter**4)


@dataclass(frozen=True)
class RigidBody:
    """A rigid body of revolution, held by a massless rigid link of length |offset| to a shaft node.

    offset: position of its centre below the node, m (negative: above).
    mass: kg. Id, Ip: diametral and polar moments of inertia about its own centre, kg m².
    unbalance: mass times eccentricity, kg m; with phase ψ (rad) the force on the rotor is
    U Ω² (sin(Ωt + ψ), cos(Ωt + ψ)) in (x, z).
    """

    name: str
    node: int
    mass: float
    Id: float
    Ip: float
    offset: float = 0.0
    unbalance: float = 0.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        key = f"bodies.{nickname('the name of a body', self.name)}"
        put = object.__setattr__
        put(self, "mass", number(f"{key}.mass", self.mass, above=0, unit="kg"))
        put(self, "Id", number(f"{key}.Id", self.Id, least=0, unit="kg m^2"))
        put(self, "Ip", number(f"{key}.Ip", self.Ip, least=0, unit="kg m^2"))
        put(self, "offset", number(f"{key}.offset", self.offset, unit="m"))
        put(self, "unbalance", number(f"{key}.unbalance", self.unbalance, least=0, unit="kg m"))
        put(self, "phase", number(f"{key}.phase", self.phase, unit="rad"))
        if self.Ip > 2 * self.Id * (1 + 1e-9):
            raise BadInput(f"{key}.Ip is {self.Ip:g} kg m^2; no rigid body has Ip above 2 Id, "
                           f"here {2 * self.Id:g} kg m^2.")


@dataclass(frozen=True, eq=False)
class Machine:
    """A machine as its card describes it; `model()` turns it into matrices and a force law.

    speed: rated speed, rad/s. shaft: None for a point mass on springs (one node, which translates).
    pad_bearings, films, cracks: parts that act nonlinearly on their own coordinates.
    poles, shapes: what makes the field or the gap other than constant and round.
    provenance: for each number of the card, by its dotted key ("bodies.generator.mass"), what the
    card says; print the machine to see them. about: what the card says of itself.
    """

    name: str
    speed: float
    shaft: Shaft | None
    bodies: tuple[RigidBody, ...]
    bearings: tuple[RadialBearing, ...] = ()
    thrust_bearings: tuple[ThrustBearing, ...] = ()
    damping: RayleighDamping | None = None
    air_gap: AirGap | None = None
    title: str = ""
    provenance: Mapping[str, Entry] = field(default_factory=dict)
    about: str = ""
    pad_bearings: tuple[PadBearing, ...] = ()
    films: tuple[JournalFilm, ...] = ()
    cracks: tuple[Crack, ...] = ()
    poles: Poles | None = None
    shapes: tuple[GapShape, ...] = ()

    def __post_init__(self) -> None:
        nickname("name", self.name)
        object.__setattr__(self, "speed", number("speed", self.speed, least=0, unit="rad/s"))
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))
        parts = [("bodies", b) for b in self.bodies]
        parts += [("bearings", b) for b in self.all_bearings]
        names = [part.name for _, part in parts]
        for kind, part in parts:
            node = part.node
            if isinstance(node, bool) or not isinstance(node, (int, np.integer)):
                raise BadInput(f"{kind}.{part.name}.node is {shown(node)}; it must be a whole "
                               "number.")
            if not 0 <= node < self.nodes:
                allowed = f"the nodes are 0 to {self.nodes - 1}" if self.shaft else "without a shaft the only node is 0"
                raise BadInput(f"{kind}.{part.name}.node is {shown(node)}, off the shaft; "
                               f"{allowed}.")
            if names.count(part.name) > 1:
                raise BadInput(f"{kind}: the name {part.name!r} is used twice; names must differ.")
        for crack in self.cracks:
            self._check_crack(crack)
        if not self.bodies and self.shaft is None:
            raise BadInput("bodies is empty; a machine without a shaft needs a body.")
        if self.shaft is None:
            self._check_point_mass()
        if self.air_gap and self.air_gap.body not in [b.name for b in self.bodies]:
            names = ", ".join(b.name for b in self.bodies) or "there is none"
            raise BadInput(f"air_gap.body is {shown(self.air_gap.body)}; it must be the name of a "
                           f"body: {names}.")
        air = self.air_gap
        check_gap(air.gap if air else math.inf, linear=bool(air and air.linear), poles=self.poles,
                  shapes=self.shapes)

    def _check_point_mass(self) -> None:
        for body in self.bodies:
            if body.offset:
                raise BadInput(f"bodies.{body.name}.offset is {body.offset:g} m; "
                               "without a shaft nothing tilts, so it must be 0.")
        if self.thrust_bearings:
            raise BadInput(f"bearings.{self.thrust_bearings[0].name}.tilt_stiffness has no meaning "
                           "without a shaft.")
        if self.damping:
            raise BadInput("damping.ratio needs two distinct modes; without a shaft there is one, "
                           "so give the bearing a damping instead.")
        if self.air_gap and self.air_gap.tilt:
            raise BadInput("air_gap.tilt is true, but without a shaft nothing tilts; leave it out.")

    def _check_crack(self, crack: Crack) -> None:
        key = f"cracks.{crack.name}"
        if self.shaft is None:
            raise BadInput(f"{key} has no shaft to be in; a machine without a shaft has no cracks.")
        if crack.element >= self.nodes - 1:
            raise BadInput(f"{key}.element is {crack.element}; the shaft's elements are 0 to "
                           f"{self.nodes - 2}.")
        if self.shaft.inner_diameter[crack.element]:
            raise BadInput(f"{key}.element is {crack.element}, which is hollow; the crack's "
                           "flexibility is that of a solid "
                           "shaft.")
        if [c.name for c in self.cracks].count(crack.name) > 1:
            raise BadInput(f"cracks: the name {crack.name!r} is used twice; names must differ.")

    @property
    def all_bearings(self) -> tuple[RadialBearing | ThrustBearing | PadBearing | JournalFilm, ...]:
        """Every bearing: radial, thrust, of pads, with a film."""
        return (*self.bearings, *self.thrust_bearings, *self.pad_bearings, *self.films)

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

    def model(self):
        """The machine's matrices, pull and unbalance: a `hydrolab.machine.model.Model`."""
        from hydrolab.machine.model import assemble
        return assemble(self)

    def numbers(self) -> dict[str, Any]:
        """Every number of the machine by its dotted key, in SI units, as the parts hold it."""
        groups = {"": self, "shaft.": self.shaft, **{f"bodies.{b.name}.": b for b in self.bodies},
                  **{f"bearings.{b.name}.": b for b in self.all_bearings},
                  **{f"cracks.{c.name}.": c for c in self.cracks},
                  "poles.": self.poles, **{f"shapes.{s.name}.": s for s in self.shapes},
                  "damping.": self.damping, "air_gap.": self.air_gap}
        return {f"{prefix}{name}": getattr(part, name) for prefix, part in groups.items()
                if part is not None
                for name in part.__dataclass_fields__ if name in SI_UNITS
                and (prefix or name == "speed")}

    def __str__(self) -> str:
        rows = []
        for key, value in self.numbers().items():
            entry = self.provenance.get(key)
            if entry is not None and np.array_equal(entry.si, value):
                rows.append((key, entry.quantity, entry.source, entry.note))
            elif entry is not None or np.any(value):  # a zero nobody stated says nothing
                now = quantity(_simplest(value), SI_UNITS[key.rpartition(".")[2]])
                rows.append((key, now, "changed", f"the card says {entry.quantity}") if entry
                            else (key, now, "", ""))
        wide = max(len(key) for key, *_ in rows)
        lines = [f"{self.name}: {self.title}" if self.title else self.name]
        lines += textwrap.wrap(" ".join(self.about.split()), 110, initial_indent="  ",
                               subsequent_indent="  ")
        for key, now, source, note in rows:
            start = f"  {key:<{wide}}  {now:<18}  {source:<10}  "
            if len(now) > 18:
                lines += textwrap.wrap(now, 120, initial_indent=f"  {key:<{wide}}  ",
                                       subsequent_indent=" " * (wide + 4))
                start = " " * (wide + 24) + f"{source:<10}  "
            lines += [start + note] if source or note or len(now) <= 18 else []
        return "\n".join(line.rstrip() for line in lines)


def _simplest(value: Any) -> Any:
    """One number for an isotropic bearing or a uniform shaft, the value itself otherwise."""
    array = np.asarray(value)
    if array.shape == (2, 2) and np.array_equal(array, array[0, 0] * np.eye(2)):
        return array[0, 0]
    return array.flat[0] if array.ndim == 1 and (array == array[0]).all() else value
