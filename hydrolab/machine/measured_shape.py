"""A measured air gap, from a CSV of angle and gap to the Fourier shape of a stator or a rotor."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hydrolab.errors import BadInput
from hydrolab.machine.checks import shown
from hydrolab.machine.gap_parts import MOST
from hydrolab.machine.shapes import Bulge, outline

COLUMNS = {"angle": {"deg": math.pi / 180, "rad": 1.0}, "gap": {"m": 1.0, "mm": 1e-3, "µm": 1e-6, "um": 1e-6}}
LARGEST_FILE = 5_000_000  # bytes
ROUGHEST = 1e3  # condition number beyond which the angles do not tell the orders apart


@dataclass(frozen=True, eq=False)
class MeasuredGap:
    """A gap around the circumference and the Fourier shape that fits it.

    angle: rad, (n,). gap: m, (n,). mean: of the fit, m. bulges: orders 1 to m of what widens the gap: the stator's shape
    if the rotor was turned along with the probe. misfit: rms of what the orders leave over, m.
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
        return (f"Mean gap {1e3 * self.mean:.4g} mm, from {1e3 * self.gap.min():.4g} to {1e3 * self.gap.max():.4g} mm at "
                f"{len(self.gap)} angles; the largest order is {largest.order} with {1e6 * largest.size:.3g} µm at "
                f"{math.degrees(largest.angle):.4g}°; orders 1 to {len(self.bulges)} leave {1e6 * self.misfit:.2g} µm rms.")


def read_gap(path: str | Path, orders: int = 8) -> MeasuredGap:
    """Read a measured gap: a CSV with a line of names such as `angle_deg,gap_mm` and a row for each angle.

    The angles, from z towards x, may be in any order and unequally spaced; the shape is a least-squares fit. Names are
    `angle_deg` or `angle_rad`, and `gap_m`, `gap_mm` or `gap_um`; other columns are ignored. orders: highest order.
    Raises BadInput with one sentence that names the line.
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
        raise BadInput(f"{name} line {line}: the gap is {1e3 * gap.min():.4g} mm; a gap is larger than 0.")
    needed = 2 * orders + 1
    if len(gap) < needed:
        raise BadInput(f"{name} has {len(gap)} angles; {orders} orders need at least {needed}, so give orders at most "
                       f"{max(1, (len(gap) - 1) // 2)} or measure at more angles.")
    k = np.arange(1, orders + 1)
    fit = np.hstack([np.ones((len(angle), 1)), np.cos(angle[:, None] * k), np.sin(angle[:, None] * k)])
    if np.linalg.cond(fit) > ROUGHEST:
        raise BadInput(f"{name}: the angles leave too wide a part of the circumference open for {orders} orders; are they "
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
            raise BadInput(f"{path.name} is larger than {LARGEST_FILE / 1e6:g} MB; a measured gap has some hundred lines.")
        text = path.read_text(encoding="utf-8-sig")
        return [(i, row) for i, row in enumerate(csv.reader(text.splitlines()), 1) if any(cell.strip() for cell in row)]
    except OSError as error:
        raise BadInput(f"{path.name} cannot be read: {error.strerror or error}; give the path of a CSV file.") from None
    except (UnicodeDecodeError, csv.Error):
        raise BadInput(f"{path.name} is not a CSV file in UTF-8; export it as text with commas.") from None


def _column(name: str, header: list[str], kind: str) -> tuple[int, float]:
    """Place of a column of this kind and its unit in SI."""
    for unit, scale in COLUMNS[kind].items():
        if header.count(f"{kind}_{unit}") == 1:
            return header.index(f"{kind}_{unit}"), scale
    raise BadInput(f"{name} begins with {shown(','.join(header))}; its first line must name one column "
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
        raise BadInput(f"{name} line {line}: {column} is {shown(row[at])}; it must be a finite number, with a point for "
                       "the decimals.")
    return value
