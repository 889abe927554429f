"""Checks of what a user gives, each with a sentence, and the record of where a card's number comes
from.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrolab.errors import BadInput

SMALLEST, LARGEST = 1e-30, 1e30  # beyond these, powers of a number leave the range of floats
SI_UNITS = {
    "speed": "rad/s", "nodes": "m", "diameter": "m", "inner_diameter": "m", "young": "Pa",
    "density": "kg/m^3",
    "poisson": "1", "shear_coefficient": "1", "mass": "kg", "Id": "kg m^2", "Ip": "kg m^2",
    "offset": "m",
    "unbalance": "kg m", "phase": "rad", "stiffness": "N/m", "damping": "N s/m",
    "tilt_stiffness": "N m/rad",
    "ratio": "1", "field": "T", "mean_radius": "m", "length": "m", "gap": "m",
    "pad_stiffness": "N/m", "clearance": "m", "angle": "rad", "rounding": "m",
    "viscosity": "Pa s", "journal_radius": "m", "film_length": "m", "depth": "1",
    "rounding_angle": "rad",
    "electrical_ratio": "1", "pole_angle": "rad", "backward": "1", "backward_angle": "rad",
    "stator_mmf": "1",
    "load_angle": "rad", "size": "m", "tangential": "1",
}  # every number of a part, by the name of its field


class _Short(reprlib.Repr):
    def repr_int(self, x: int, level: int) -> str:
        return str(x) if x.bit_length() < 100 else f"a whole number of {x.bit_length()} bits"


_short = _Short()
_short.maxstring = _short.maxother = 60


def shown(value: Any) -> str:
    """Return a value as a sentence can show it: on one line and short, whatever it is."""
    text = " ".join(_short.repr(value).split())
    return text if len(text) <= 120 else f"{text[:80]} … {text[-20:]}"


def nickname(key: str, value: Any) -> str:
    """Return a name if a sentence can carry it: one line of 1 to 80 printable characters."""
    if not isinstance(value,
                      str) or not value.strip() or not value.isprintable() or len(value) > 80:
        raise BadInput(f"{key} is {shown(value)}; it must be text of 1 to 80 characters on one "
                       "line.")
    return value


def number(key: str, value: Any, *, above: float = -math.inf, least: float = -math.inf,
           below: float = math.inf, unit: str = "") -> float:
    """Return value as a float, or say in a sentence why it is not allowed for this key."""
    unit = f" {unit}" if unit else ""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise BadInput(f"{key} is {shown(value)}; it must be a "
                       f"number{f' in{unit}' if unit else ''}.")
    if value != value or abs(value) == math.inf:
        raise BadInput(f"{key} is {value}; it must be a finite number.")
    if abs(value) > LARGEST or (above == 0 and 0 < value < SMALLEST):
        raise BadInput(f"{key} is {shown(value)}{unit}; its size must lie between {SMALLEST:g} and "
                       f"{LARGEST:g}{unit}.")
    value = float(value)
    if value <= above:
        raise BadInput(f"{key} is {value:g}{unit}; it must be larger than {above:g}{unit}.")
    if value < least:
        raise BadInput(f"{key} is {value:g}{unit}; it must be at least {least:g}{unit}.")
    if value >= below:
        raise BadInput(f"{key} is {value:g}{unit}; it must be smaller than {below:g}{unit}.")
    return value


def whole(key: str, value: Any, least: int, most: float = math.inf, why: str = "") -> int:
    """Return value if it is a whole number from least to most, or say in a sentence, with the
    reason why, that not.
    """
    if isinstance(value, bool) or not isinstance(value,
                                                 (int, np.integer)) or not least <= value <= most:
        span = f"of at least {least}" if most == math.inf else f"from {least} to {most}"
        raise BadInput(f"{key} is {shown(value)}; it must be a whole number "
                       f"{span}{f' ({why})' if why else ''}.")
    return int(value)


def turning(speed: Any) -> float:
    """Return a speed of rotation, rad/s, or say in a sentence that it is none."""
    try:
        return number("speed", speed, above=0, unit="rad/s")
    except BadInput as error:
        raise BadInput(f"{str(error)[:-1]} (rpm(150) gives 150 rpm in rad/s).") from None


def require_model(model: Any) -> None:
    """Raise BadInput for what has no matrices, such as a machine."""
    if not hasattr(model, "velocity_matrix"):
        own = "; a Machine makes one by its method model()" if hasattr(model, "model") else ""
        raise BadInput(f"model is a {type(model).__name__}; it must be a Model{own}.")


def vector(key: str, values: ArrayLike, *, above: float = -math.inf, least: float = -math.inf,
           unit: str = "") -> NDArray:
    """Return values as a read-only vector, each entry checked as by `number`."""
    if isinstance(values, (str, Mapping)) or not np.iterable(values):
        raise BadInput(f"{key} is {shown(values)}; it must be a list of numbers.")
    array = np.array([number(f"{key}[{i}]", v, above=above, least=least, unit=unit)
                      for i, v in enumerate(values)])
    array.setflags(write=False)
    return array


def bearing_matrix(key: str, value: ArrayLike, unit: str) -> NDArray:
    """Return the 2 × 2 matrix in (x, z) of a scalar (isotropic), two diagonal entries, or 2 × 2."""
    value = value.tolist() if isinstance(value, np.ndarray) else value
    rows = value if isinstance(value, (list, tuple)) else [[value, 0.0], [0.0, value]]
    if len(rows) == 2 and not any(isinstance(row, (list, tuple)) for row in rows):
        rows = [[rows[0], 0.0], [0.0, rows[1]]]
    if len(rows) != 2 or any(not isinstance(row, (list, tuple)) or len(row) != 2 for row in rows):
        raise BadInput(f"{key} is {shown(value)}; it must be one number, two numbers [x, z] or a "
                       f"2 by 2 matrix [[xx, xz], [zx, zz]], in {unit}.")
    array = np.array([[number(key, entry, unit=unit) for entry in row] for row in rows])
    if min(array[0, 0], array[1, 1]) < 0:
        raise BadInput(f"{key} has a negative direct entry, {min(array[0, 0], array[1, 1]):g} "
                       f"{unit}; "
                       f"direct entries must be at least 0 {unit}.")
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class Entry:
    """A number as a machine card states it, and where it comes from.

    value: a number or nested lists, in `unit`. si: the same as the part holds it, in SI units.
    """

    value: Any
    unit: str
    source: str
    note: str = ""
    si: Any = None

    @property
    def quantity(self) -> str:
        """The value with its unit, rounded to six figures."""
        return quantity(self.value, self.unit)

    def __str__(self) -> str:
        return f"{self.quantity}  [{self.source}] {self.note}".rstrip()


def quantity(value: Any, unit: str) -> str:
    """Return a number or nested lists of numbers with their unit, rounded to six figures."""
    def text(v: Any) -> str:
        return f"[{', '.join(map(text, v))}]" if np.iterable(v) else f"{v:.6g}"

    return f"{text(value)} {unit}" if unit != "1" else text(value)
