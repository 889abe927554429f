r"""Stator and rotor out of round: the gap by Fourier shapes, those of the stator at rest and those
of the rotor turning.

g(φ, t) = g0 + Σ δ cos n(φ − α) [stator] − Σ δ cos n(φ − Ωt − β) [rotor] − e_x sin φ − e_z cos φ,
and the pull by quadrature of Eqs. (7) and (8) of Villa, Carvalho and Salomon, after Lundström and
Aidanpää (2007).

To second order in the shapes a centred rotor feels a force only from two orders that differ by one
(`selection_rule`): with g = g0 (1 + η), g⁻² ≈ g0⁻² (1 − 2η + 3η²), and only the product of two such
orders holds cos φ.

A measured air gap, from a CSV of angle and gap to the Fourier shape of a stator or a rotor.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hydrolab.errors import BadInput
from hydrolab.machine.pole_pairs import Poles
from hydrolab.machine.pull import Bulge, ForceLaw, outline, shaped_law
from hydrolab.machine.quantities import (
    Part,
    choice_field,
    micro,
    number_field,
    shown,
    text_field,
    whole,
    whole_field,
)

Kind = Literal["static", "synchronous", "forward", "backward"]
Side = Literal["stator", "rotor"]


class ShapeForce(NamedTuple):
    """The force of two orders on a centred rotor, F_z + i F_x = size · e^{i (turns Ωt + angle)}.

    kind: "static", "synchronous", "forward" or "backward". turns: in a revolution, below zero
    backward. size: N.
    """

    kind: Kind
    turns: int
    size: float
    angle: float


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
    kind: Kind = "forward" if turns > 0 else "backward"
    if low_side == high_side:
        kind = "static" if low_side == "stator" else "synchronous"
    return ShapeForce(kind, turns, 1.5 * stiffness * abs(low.size * high.size) / gap,
                      angle + (math.pi if low.size * high.size < 0 else 0.0))


SIDES = ("stator", "rotor")
MOST = 40  # of the order of a shape: the quadrature's 256 points resolve it


@dataclass(frozen=True)
class GapShape(Part):
    """One order of a shape out of round (`Bulge`): the radius is larger by size · cos(order (φ −
    angle)). A stator's stands still, a rotor's turns.
    """

    table = "shapes"
    noun = "a shape"
    name: str = text_field("what the shape is called", "oval")
    of: str = choice_field("what is out of round", *SIDES)
    order: int = whole_field("lobes around the circumference", 2, least=1, most=MOST,
                             why="1 is a shift, 2 an oval")
    size: float = number_field("m", "by how much the radius is larger at a lobe",
                               example=(400, "µm"))
    angle: float = number_field("rad", "gap angle of a lobe, on the rotor at phase 0", default=0.0,
                                example=(30, "deg"), mirrored=True)

    def bulge(self) -> Bulge:
        """The shape as the law takes it."""
        return Bulge(self.order, self.size, self.angle)


def gap_shapes(side: str, bulges: Sequence[Bulge], name: str = "") -> tuple[GapShape, ...]:
    """The parts of a shape of many orders on a side (stator or rotor) under a name, for
    `dataclasses.replace(machine, shapes=…)`; each is named by its order.
    """
    return tuple(GapShape(f"{name or side} {b.order}", side, b.order, b.size, b.angle)
                 for b in bulges)


def gap_law(stiffness: float, gap: float, poles: Poles | None,
            shapes: tuple[GapShape, ...]) -> ForceLaw:
    """The pull of poles and shapes, at least one of them: in closed form where there is one.

    stiffness: k, N/m. gap: g0, m.
    """
    if poles and not shapes and not poles.stator_mmf:
        return poles.closed(stiffness, gap)
    stator, rotor = (tuple(s.bulge() for s in shapes if s.of == side) for side in SIDES)
    return shaped_law(stiffness, gap, stator, rotor, poles.waves() if poles else ())


COLUMNS = {"angle": {"deg": math.pi / 180, "rad": 1.0},
           "gap": {"m": 1.0, "mm": 1e-3, "µm": 1e-6, "um": 1e-6}}
TURNS = 2  # beyond which angles in radians are degrees under the wrong name
LARGEST_FILE = 50_000_000  # bytes
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
                f"{1e3 * self.gap.max():.4g} mm at {len(self.gap)} angles; the largest order is "
                f"{largest.order} with {1e6 * largest.size:.3g} µm at "
                f"{math.degrees(largest.angle):.4g}°; orders 1 to {len(self.bulges)} leave "
                f"{1e6 * self.misfit:.2g} µm rms.")


def read_gap(path: str | Path, orders: int = 8) -> MeasuredGap:
    """Read a measured gap: a CSV with a line of names such as `angle_deg,gap_mm` and a row for each
    angle.

    The angles, from z towards x, may be in any order and unequally spaced; the shape is a
    least-squares fit. Names are `angle_deg` or `angle_rad`, and `gap_m`, `gap_mm` or `gap_um`;
    other columns are ignored. Columns are apart by commas, or by semicolons, and then a comma may
    mark the decimals. orders: highest order. Raises BadInput with one sentence that names the line.
    """
    whole("orders", orders, 1, MOST)
    name, rows = Path(path).name, csv_rows(Path(path))
    header = [micro(cell.strip()) for cell in rows[0][1]] if rows else []
    places = [_column(name, header, kind) for kind in COLUMNS]
    values = np.array([[csv_value(name, line, header[at], row, at) * scale for at, scale in places]
                       for line, row in rows[1:]]).reshape(-1, 2)
    angle, gap = values.T
    if places[0][1] == 1 and len(angle) and (turns := np.ptp(angle) / (2 * np.pi)) > TURNS:
        raise BadInput(f"{name}: angle_rad goes from {angle.min():.4g} to {angle.max():.4g} rad, "
                       f"{turns:.0f} turns; a gap is measured once around. If these are degrees, "
                       "call the column angle_deg.")
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


def csv_rows(source: Path | str) -> list[tuple[int, list[str]]]:
    """Rows of a CSV that are not empty, each with its line number; source: its path, or its text.
    """
    name = source.name if isinstance(source, Path) else "the text"
    try:
        size = source.stat().st_size if isinstance(source, Path) else len(source)
        if size > LARGEST_FILE:
            raise BadInput(f"{name} is larger than {LARGEST_FILE / 1e6:g} MB; cut out a part.")
        text = source.read_text(encoding="utf-8-sig") if isinstance(source, Path) else source
        apart = ";" if ";" in text.lstrip().split("\n", 1)[0] else ","
        rows = enumerate(csv.reader(text.splitlines(), delimiter=apart), 1)
        # where semicolons are apart, commas mark the decimals
        return [(i, [cell.replace(",", ".") for cell in row] if apart == ";" else row)
                for i, row in rows if any(cell.strip() for cell in row)]
    except OSError as error:
        raise BadInput(f"{name} cannot be read: {error.strerror or error}; give the path of a "
                       "CSV file.") from None
    except (UnicodeDecodeError, csv.Error):
        raise BadInput(f"{name} is not a CSV file in UTF-8; export it as text with "
                       "commas.") from None


def _column(name: str, header: list[str], kind: str) -> tuple[int, float]:
    """Place of a column of this kind and its unit in SI."""
    for unit, scale in COLUMNS[kind].items():
        if header.count(f"{kind}_{unit}") == 1:
            return header.index(f"{kind}_{unit}"), scale
    raise BadInput(f"{name} begins with {shown(','.join(header))}; its first line must name one "
                   f"column {' or '.join(f'{kind}_{unit}' for unit in COLUMNS[kind])}.")


def csv_value(name: str, line: int, column: str, row: list[str], at: int) -> float:
    """The number at a place of a row, which is a line of the file of a name, under a column."""
    if at >= len(row):
        raise BadInput(f"{name} line {line} has {len(row)} values; there is none for {column}.")
    try:
        value = float(row[at])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadInput(f"{name} line {line}: {column} is {shown(row[at])}; it must be a finite "
                       "number, with a point for the decimals.")
    return value
