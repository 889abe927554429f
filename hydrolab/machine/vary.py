"""The same machine with one number changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from hydrolab.errors import BadInput
from hydrolab.machine.parts import Machine

GROUPS = {"bodies": ("bodies",), "bearings": ("bearings", "thrust_bearings", "pad_bearings", "films"),
          "cracks": ("cracks",), "shapes": ("shapes",)}  # fields of a machine that hold the parts of a card's section


def vary(machine: Machine, changes: Mapping[str, Any]) -> Machine:
    """Return the machine with these numbers in place of its own, SI units.

    Keys are those of its card: "speed", "air_gap.field", "bodies.generator.mass",
    "bearings.generator guide bearing.stiffness", "shaft.young"; short forms: "field" for "air_gap.field" and
    "unbalance" for a factor on all unbalances.
    Raises BadInput for a key the machine does not have, or a value its part refuses.
    """
    for key, value in changes.items():
        if key == "speed":
            machine = replace(machine, speed=value)
        elif key == "unbalance":
            machine = replace(machine, bodies=tuple(replace(b, unbalance=value * b.unbalance) for b in machine.bodies))
        else:
            machine = _vary_part(machine, "air_gap.field" if key == "field" else key, value)
    return machine


def _vary_part(machine: Machine, key: str, value: Any) -> Machine:
    section, _, rest = key.partition(".")
    name, _, attribute = rest.rpartition(".")
    if section in ("shaft", "air_gap", "poles") and not name and getattr(machine, section) is not None:
        return replace(machine, **{section: _replaced(key, getattr(machine, section), attribute, value)})
    for group in GROUPS.get(section, ()):
        parts = getattr(machine, group)
        for i, part in enumerate(parts):
            if part.name == name:
                changed = _replaced(key, part, attribute, value)
                return replace(machine, **{group: (*parts[:i], changed, *parts[i + 1:])})
    raise BadInput(f"{key!r} is not a number of {machine.name}; there are {', '.join(parameter_keys(machine))}.")


def _replaced(key: str, part: Any, attribute: str, value: Any) -> Any:
    if attribute not in _numbers(part):
        raise BadInput(f"{key!r} is not a number; this part has {', '.join(_numbers(part))}.")
    return replace(part, **{attribute: value})


def _numbers(part: Any) -> list[str]:
    """Names of the fields of a part that hold numbers."""
    return [f.name for f in fields(part) if f.name not in ("node", "element", "pads", "pole_pairs", "order")
            and isinstance(value := getattr(part, f.name), (int, float, np.ndarray, np.number))
            and not isinstance(value, bool)]


def parameter_keys(machine: Machine) -> list[str]:
    """Every key that `vary` takes for this machine."""
    keys = ["speed", "unbalance"]
    for section in ("shaft", "air_gap", "poles"):
        if getattr(machine, section) is not None:
            keys += [f"{section}.{n}" for n in _numbers(getattr(machine, section))]
    for section, parts in (("bodies", machine.bodies), ("bearings", machine.all_bearings), ("cracks", machine.cracks),
                           ("shapes", machine.shapes)):
        keys += [f"{section}.{part.name}.{n}" for part in parts for n in _numbers(part)]
    return keys
