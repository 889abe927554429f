r"""Stator and rotor out of round: the gap by Fourier shapes, those of the stator at rest and those
of the rotor turning.

g(φ, t) = g0 + Σ δ cos n(φ − α) [stator] − Σ δ cos n(φ − Ωt − β) [rotor] − e_x sin φ − e_z cos φ,
and the pull by quadrature of Eqs. (7) and (8) of Villa, Carvalho and Salomon, after Lundström and
Aidanpää (2007).

To second order in the shapes a centred rotor feels a force only from two orders that differ by one
(`selection_rule`): with g = g0 (1 + η), g⁻² ≈ g0⁻² (1 − 2η + 3η²), and only the product of two such
orders holds cos φ.

What makes the field or the gap other than round and constant: poles and their waves, and shapes of
stator and rotor.

Frozen and validated like the other parts, in SI units; `attach` makes the law of the air gap of
them.

A measured air gap, from a CSV of angle and gap to the Fourier shape of a stator or a rotor.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hydrolab.errors import BadInput
from hydrolab.machine.pole_pairs import PolePairPull
from hydrolab.machine.pull import FieldWave, ForceLaw, ShapedPull, loaded
from hydrolab.machine.quantities import nickname, number, shown, whole

POINTS = 256


@dataclass(frozen=True)
class Bulge:
    """One order of a shape: the radius is larger by size · cos(order (φ − angle)). size: m. angle:
    of a peak, rad.
    """

    order: int
    size: float
    angle: float = 0.0


def outline(bulges: tuple[Bulge, ...], angle: NDArray) -> NDArray:
    """By how much the radius is larger at gap angles (any shape), m."""
    return sum((b.size * np.cos(b.order * (angle - b.angle)) for b in bulges),
               np.zeros(np.shape(angle)))


def shaped_law(stiffness: float, gap: float, stator: tuple[Bulge, ...] = (),
               rotor: tuple[Bulge, ...] = (),
               points: int = POINTS) -> ForceLaw:
    """The pull between two shapes: a `ShapedPull` where only the stator is out of round, else a
    `TurningPull`.

    stiffness, gap: k (N/m) and g0 (m) of the nominal circular gap.
    """
    if rotor:
        return TurningPull(stiffness, gap, stator, rotor, points)
    return ShapedPull(stiffness, gap, gap + outline(stator, 2 * np.pi * np.arange(points) / points))


@dataclass(frozen=True)
class TurningPull:
    """The pull on a rotor out of round that turns in a stator of any shape, by the trapezoidal
    rule.

    stiffness, gap: k (N/m) and g0 (m) of the nominal circular gap. stator, rotor: their shapes, the
    rotor's at phase 0.
    """

    moving: ClassVar[bool] = True
    stiffness: float
    gap: float
    stator: tuple[Bulge, ...]
    rotor: tuple[Bulge, ...]
    points: int = POINTS

    def _around(self, e: NDArray, phase: NDArray | float) -> tuple[NDArray, NDArray, float]:
        """Directions (2, N), the gap (…, N), nan below zero, and the weight k g0³/N."""
        angle = 2 * np.pi * np.arange(self.points) / self.points
        direction = np.stack([np.sin(angle), np.cos(angle)])
        gap = (self.gap + outline(self.stator, angle) - outline(self.rotor,
                                                                angle
                                                                - np.asarray(phase)[..., None])
               - np.tensordot(e, direction, axes=(0, 0)))
        return direction, np.where(gap > 0, gap, np.nan), self.stiffness * self.gap**3 / self.points

    def force_at(self, e: NDArray, velocity: NDArray, phase: NDArray | float,
                 speed: float) -> NDArray:
        """Force on the rotor, N, shape of e; velocity and speed do not matter. nan where the rotor
        is in the stator.
        """
        direction, gap, weight = self._around(e, phase)
        return weight * np.einsum("in,...n->i...", direction, gap**-2.0)

    def linearise_at(self, e: NDArray, velocity: NDArray, phase: NDArray | float,
                     speed: float) -> tuple[NDArray, NDArray, NDArray]:
        """Force, N, with its derivatives by position, N/m, and by velocity, which are zero."""
        direction, gap, weight = self._around(e, phase)
        slope = 2 * weight * np.einsum("in,jn,...n->ij...", direction, direction, gap**-3.0)
        return weight * np.einsum("in,...n->i...", direction,
                                  gap**-2.0), slope, np.zeros_like(slope)

    def potential(self, e: NDArray, phase: NDArray | float) -> NDArray:
        """V, J, with F = −∂V/∂e at a fixed phase."""
        _, gap, weight = self._around(e, phase)
        return -weight * (1 / gap).sum(axis=-1)

    def _narrowest(self, e: NDArray) -> NDArray:
        """The gap around the circumference with the rotor's highest point there, m, (…, N)."""
        angle = 2 * np.pi * np.arange(self.points) / self.points
        direction = np.stack([np.sin(angle), np.cos(angle)])
        highest = outline(self.rotor, angle).max()
        return self.gap + outline(self.stator, angle) - highest - np.tensordot(e[:2], direction,
                                                                               axes=(0, 0))

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap there can be at this place in any phase, m: the rotor's highest point
        meets every angle.
        """
        return self._narrowest(e).min(axis=-1)

    def gap_angle(self, e: NDArray) -> NDArray:
        """Angle of that smallest gap, rad, from z towards x."""
        return 2 * np.pi * self._narrowest(e).argmin(axis=-1) / self.points

    def scaled(self, factor: float) -> TurningPull:
        """The same law, `factor` times as strong."""
        return replace(self, stiffness=factor * self.stiffness)


class ShapeForce(NamedTuple):
    """The force of two orders on a centred rotor, F_z + i F_x = size · e^{i (turns Ωt + angle)}.

    kind: "static", "synchronous", "forward" or "backward". turns: in a revolution, below zero
    backward. size: N.
    """

    kind: Literal["static", "synchronous", "forward", "backward"]
    turns: int
    size: float
    angle: float


Side = Literal["stator", "rotor"]


def selection_rule(stiffness: float, gap: float, one: tuple[Side, Bulge],
                   other: tuple[Side, Bulge]) -> ShapeForce | None:
    """The force of a pair of shapes on a centred rotor to second order, or None where their orders
    do not differ by one.

    The size is 3 k δ δ′/(2 g0), with k = π B0² u0 l0/(µ0 g0). Of a pair on the stator the force
    stands still, of a pair on the rotor it turns with it. A rotor shape of order n makes a force
    that turns n times in a revolution: forward with a stator shape of order n − 1, backward with
    one of order n + 1.
    """
    (low_side, low), (high_side, high) = sorted((one, other), key=lambda pair: pair[1].order)
    if high.order - low.order != 1:
        return None
    # the product holds cos(φ − β) with β = (n + 1)(α′ + s′Ωt) − n (α + sΩt); s is 1 on the rotor, 0
    # on the stator
    turns = high.order * (high_side == "rotor") - low.order * (low_side == "rotor")
    sign = 1 if low_side == high_side else -1
    angle = high.order * high.angle - low.order * low.angle + (0 if sign > 0 else math.pi)
    same = "static" if low_side == "stator" else "synchronous"
    kind = same if low_side == high_side else "forward" if turns > 0 else "backward"
    return ShapeForce(kind, turns, 1.5 * stiffness * abs(low.size * high.size) / gap,
                      angle + (math.pi if low.size * high.size < 0 else 0.0))


SERIES = ("whole", "published")
SIDES = ("stator", "rotor")
MOST = 40  # of the order of a shape: the quadrature's 256 points resolve it


@dataclass(frozen=True)
class Poles:
    """The poles of the field, whose pull beats with twice the electrical frequency (`PolePairPull`,
    `FieldWave`).

    pole_pairs: p. electrical_ratio: electrical over mechanical angle; 0 stands for p, a synchronous
    machine. pole_angle: electrical angle of the field's peak from z at phase 0, rad. backward,
    backward_angle: the wave that turns backward where the phases are out of balance, over the
    forward one, and its angle, rad. stator_mmf, load_angle: the stator's wave of magnetomotive
    force over the rotor's, whose field is B0, and its electrical angle behind it, rad. series:
    "whole", or "published" for the permeance cut at its third order.
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
        put(self, "pole_pairs", whole("poles.pole_pairs", self.pole_pairs, 1, 100,
                                      "leave out [poles] for a constant field"))
        for name in ("pole_angle", "backward_angle", "load_angle"):
            put(self, name, number(f"poles.{name}", getattr(self, name), unit="rad"))
        for name in ("electrical_ratio", "backward", "stator_mmf"):
            put(self, name, number(f"poles.{name}", getattr(self, name), least=0))
        if self.series not in SERIES:
            raise BadInput(f"poles.series is {shown(self.series)}; it must be one of "
                           f"{', '.join(SERIES)}.")
        if self.stator_mmf and (self.backward or self.series != "whole"):
            raise BadInput(f"poles.stator_mmf is {self.stator_mmf:g}, which is taken by quadrature "
                           "in a field without "
                           "a backward wave; leave out backward and series.")

    def law(self, stiffness: float, gap: float) -> PolePairPull | FieldWave:
        """The law of the field in a round gap. stiffness: k, N/m. gap: g0, m."""
        p, ratio = self.pole_pairs, self.electrical_ratio or float(self.pole_pairs)
        if self.stator_mmf:
            return FieldWave(stiffness, gap,
                             loaded(p, self.stator_mmf, self.load_angle, ratio, self.pole_angle))
        return PolePairPull(stiffness, gap, p, ratio, self.pole_angle, self.backward,
                            self.backward_angle,
                            self.series == "published")


@dataclass(frozen=True)
class GapShape:
    """One order of a shape out of round (`Bulge`): the radius is larger by size · cos(order (φ −
    angle)).

    of: "stator", which stands still, or "rotor", which turns. order: lobes around the
    circumference. size: m. angle: gap angle of a lobe, rad, on the rotor at phase 0.
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
    """The parts of a shape of many orders, for `dataclasses.replace(machine, shapes=…)`; each is
    named by its order.
    """
    return tuple(GapShape(f"{name or side} {b.order}", side, b.order, b.size, b.angle)
                 for b in bulges)


def check_gap(gap: float, *, tilt: bool, linear: bool, poles: Poles | None,
              shapes: tuple[GapShape, ...]) -> None:
    """Say in a sentence which parts do not go together in one air gap (gap: g0, m; inf where there
    is none).
    """
    if math.isinf(gap) and (poles or shapes):
        raise BadInput(f"{'poles' if poles else 'shapes'} needs an air gap; add [air_gap].")
    if poles and shapes:
        raise BadInput(f"poles has {poles.pole_pairs} pole pairs and shapes has {len(shapes)} "
                       "entries; the law of the gap "
                       "takes one of them, so leave out the other.")
    if linear and (poles or shapes):
        raise BadInput("air_gap.linear is true, which is the pull of design tools in a round gap; "
                       "leave out "
                       f"{'poles' if poles else 'shapes'} or air_gap.linear.")
    if tilt and (poles or any(shape.of == "rotor" for shape in shapes)):
        raise BadInput("air_gap.tilt is true, which takes a pull that stands still; leave out "
                       "air_gap.tilt, the poles "
                       "and the shapes of the rotor.")
    names = [shape.name for shape in shapes]
    for shape in shapes:
        if names.count(shape.name) > 1:
            raise BadInput(f"shapes: the name {shape.name!r} is used twice; names must differ.")
    total = sum(abs(shape.size) for shape in shapes)
    if total >= gap:
        raise BadInput(f"shapes add up to {total:g} m; together they must be smaller than "
                       f"air_gap.gap, {gap:g} m.")


COLUMNS = {"angle": {"deg": math.pi / 180, "rad": 1.0},
           "gap": {"m": 1.0, "mm": 1e-3, "µm": 1e-6, "um": 1e-6}}
LARGEST_FILE = 5_000_000  # bytes
ROUGHEST = 1e3  # condition number beyond which the angles do not tell the orders apart


@dataclass(frozen=True, eq=False)
class MeasuredGap:
    """A gap around the circumference and the Fourier shape that fits it.

    angle: rad, (n,). gap: m, (n,). mean: of the fit, m. bulges: orders 1 to m of what widens the
    gap: the stator's shape if the rotor was turned along with the probe. misfit: rms of what the
    orders leave over, m.
    """

    angle: NDArray
    gap: NDArray
    mean: float
    bulges: tuple[Bulge, ...]
    misfit: float

    def rotor(self) -> tuple[Bulge, ...]:
        """The same as the shape of a rotor, whose bulges narrow the gap."""
        return tuple(Bulge(b.order, -b.size, b.angle) for b in self.bulges)

    def __str__(self) -> str:
        largest = max(self.bulges, key=lambda b: b.size)
        return (f"Mean gap {1e3 * self.mean:.4g} mm, from {1e3 * self.gap.min():.4g} to "
                f"{1e3 * self.gap.max():.4g} mm at "
                f"{len(self.gap)} angles; the largest order is {largest.order} with "
                f"{1e6 * largest.size:.3g} µm at "
                f"{math.degrees(largest.angle):.4g}°; orders 1 to {len(self.bulges)} leave "
                f"{1e6 * self.misfit:.2g} µm rms.")


def read_gap(path: str | Path, orders: int = 8) -> MeasuredGap:
    """Read a measured gap: a CSV with a line of names such as `angle_deg,gap_mm` and a row for each
    angle.

    The angles, from z towards x, may be in any order and unequally spaced; the shape is a
    least-squares fit. Names are `angle_deg` or `angle_rad`, and `gap_m`, `gap_mm` or `gap_um`;
    other columns are ignored. orders: highest order. Raises BadInput with one sentence that names
    the line.
    """
    if isinstance(orders, bool) or not isinstance(orders, int) or not 1 <= orders <= MOST:
        raise BadInput(f"orders is {orders!r}; it must be a whole number from 1 to {MOST}.")
    name, rows = Path(path).name, _rows(Path(path))
    header = [cell.strip() for cell in rows[0][1]] if rows else []
    places = [_column(name, header, kind) for kind in COLUMNS]
    values = np.array([[_value(name, line, header[at], row, at) * scale for at, scale in places]
                       for line, row in rows[1:]]).reshape(-1, 2)
    angle, gap = values.T
    if (gap <= 0).any():
        line = rows[1 + int(np.argmax(gap <= 0))][0]
        raise BadInput(f"{name} line {line}: the gap is {1e3 * gap.min():.4g} mm; a gap is larger "
                       "than 0.")
    needed = 2 * orders + 1
    if len(gap) < needed:
        raise BadInput(f"{name} has {len(gap)} angles; {orders} orders need at least {needed}, so "
                       "give orders at most "
                       f"{max(1, (len(gap) - 1) // 2)} or measure at more angles.")
    k = np.arange(1, orders + 1)
    fit = np.hstack([np.ones((len(angle), 1)), np.cos(angle[:, None] * k),
                     np.sin(angle[:, None] * k)])
    if np.linalg.cond(fit) > ROUGHEST:
        raise BadInput(f"{name}: the angles leave too wide a part of the circumference open for "
                       f"{orders} orders; are they "
                       "in the unit the column names? Measure all around, or give fewer orders.")
    found = np.linalg.lstsq(fit, gap, rcond=None)[0]
    parts = zip(k.tolist(), found[1:orders + 1].tolist(), found[orders + 1:].tolist(), strict=True)
    bulges = tuple(Bulge(n, math.hypot(c, s), math.atan2(s, c) / n) for n, c, s in parts)
    misfit = float(np.sqrt(np.mean((gap - found[0] - outline(bulges, angle)) ** 2)))
    return MeasuredGap(angle, gap, float(found[0]), bulges, misfit)


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Rows of a CSV that are not empty, each with its line number."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise BadInput(f"{path.name} is larger than {LARGEST_FILE / 1e6:g} MB; a measured gap "
                           "has some hundred lines.")
        text = path.read_text(encoding="utf-8-sig")
        return [(i, row) for i, row in enumerate(csv.reader(text.splitlines()), 1)
                if any(cell.strip() for cell in row)]
    except OSError as error:
        raise BadInput(f"{path.name} cannot be read: {error.strerror or error}; give the path of a "
                       "CSV file.") from None
    except (UnicodeDecodeError, csv.Error):
        raise BadInput(f"{path.name} is not a CSV file in UTF-8; export it as text with commas.") from None


def _column(name: str, header: list[str], kind: str) -> tuple[int, float]:
    """Place of a column of this kind and its unit in SI."""
    for unit, scale in COLUMNS[kind].items():
        if header.count(f"{kind}_{unit}") == 1:
            return header.index(f"{kind}_{unit}"), scale
    raise BadInput(f"{name} begins with {shown(','.join(header))}; its first line must name one "
                   "column "
                   f"{' or '.join(f'{kind}_{unit}' for unit in COLUMNS[kind])}.")


def _value(name: str, line: int, column: str, row: list[str], at: int) -> float:
    """One number of a row."""
    if at >= len(row):
        raise BadInput(f"{name} line {line} has {len(row)} values; there is none for {column}.")
    try:
        value = float(row[at])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadInput(f"{name} line {line}: {column} is {shown(row[at])}; it must be a finite "
                       "number, with a point for "
                       "the decimals.")
    return value
