"""A CSV file of a bearing's eight coefficients over the speed."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hydrolab.errors import BadInput
from hydrolab.machine.bearings import ENTRIES
from hydrolab.machine.gap_shape import csv_rows, csv_value
from hydrolab.machine.quantities import shown

COLUMN = re.compile(r"(speed|[kc](?:xx|xz|zx|zz))[ _]*[\[(]?([^\])]*)[\])]?$")


def read_table(path: Path) -> dict[str, dict[str, Any]]:
    """Return the numbers of a `TableBearing` as a card states them, from a CSV file whose columns
    are named with their units: speed [rpm], kxx [MN/m], kxz, …, czz [kN s/m].

    Columns are apart by commas, or by semicolons, and then a comma may mark the decimals. What has
    no column is 0. Raises BadInput with one sentence.
    """
    rows = csv_rows(path)
    header = [cell.strip() for cell in rows[0][1]] if rows else []
    found: dict[str, tuple[int, str]] = {}
    for at, cell in enumerate(header):
        if match := COLUMN.match(cell):
            found[match[1]] = at, match[2].strip()
    units = {kind: {unit for name, (_, unit) in found.items() if name.startswith(kind)}
             for kind in ("speed", "k", "c")}
    if any(len(unit) != 1 for unit in units.values()):
        raise BadInput(f"{path.name} begins with {shown(','.join(header))}; its first line must "
                       "name columns speed, kxx to kzz and cxx to czz, each kind in one unit, such "
                       "as speed [rpm],kxx [MN/m],kzz [MN/m],cxx [kN s/m],czz [kN s/m].")

    def column(name: str) -> list[float]:
        if name not in found:
            return [0.0] * (len(rows) - 1)
        at = found[name][0]
        return [csv_value(path.name, line, header[at], row, at) for line, row in rows[1:]]

    values: dict[str, tuple[str, Any]] = {"speeds": ("speed", column("speed"))}
    for kind, name in (("k", "stiffness_rows"), ("c", "damping_rows")):
        values[name] = kind, [list(row) for row in zip(*(column(kind + e) for e in ENTRIES),
                                                       strict=True)]
    return {name: {"value": value, "unit": units[kind].copy().pop(), "source": "literature",
                   "note": path.name} for name, (kind, value) in values.items()}
