"""What a machine card may hold: its tables and keys, units and sources, and the sentences about what it may not.

A number of a card is an inline table with value, unit and source (`entry_of`); the tables are `Section`s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from typing import Any

from hydrolab.errors import BadInput
from hydrolab.machine.fault_parts import JournalFilm, PadBearing
from hydrolab.machine.parts import SI_UNITS, Entry, RadialBearing, ThrustBearing, nickname, number, shown

SCHEMA = 1
SOURCES = ("paper", "Table 1", "literature", "derived", "calibrated", "assumed")
UNITS: dict[str, dict[str, tuple[float, float]]] = {
    "m": {"m": (1, 1), "mm": (1, 1000), "µm": (1, 1_000_000)},
    "kg": {"kg": (1, 1), "t": (1000, 1)},
    "kg m": {"kg m": (1, 1), "kg mm": (1, 1000)},
    "kg m^2": {"kg m^2": (1, 1), "t m^2": (1000, 1)},
    "rad/s": {"rad/s": (1, 1), "rpm": (math.pi, 30)},
    "rad": {"rad": (1, 1), "deg": (math.pi, 180)},
    "Pa": {"Pa": (1, 1), "GPa": (1_000_000_000, 1)},
    "1": {"1": (1, 1), "%": (1, 100)},
}  # SI unit → accepted unit → (a, b) with SI value = value · a / b; what is not listed is accepted in SI only


@dataclass(frozen=True)
class Section:
    """What a table of a card holds: plain keys with their type, and numbers that must or may be there.

    choices: plain keys with their type that may be left out.
    """

    plain: Mapping[str, type]
    required: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    choices: Mapping[str, type] = field(default_factory=dict)


CARD = Section({"schema": int, "name": str}, ("speed",))
OTHERS = ("title", "about", "shaft", "bodies", "bearings", "damping", "air_gap", "cracks", "poles", "shapes")  # all optional
SHAFT = Section({"element": str}, ("nodes", "diameter", "young", "density", "poisson", "shear_coefficient"),
                ("inner_diameter",))
BODY = Section({"name": str, "node": int}, ("mass", "Id", "Ip"), ("offset", "unbalance", "phase"))
POINT_MASS = replace(BODY, required=("mass",), optional=("Id", "Ip", *BODY.optional))  # without a shaft nothing tilts
RADIAL = Section({"name": str, "node": int}, ("stiffness",), ("damping",))
ZEROS = {"Id": 0.0, "Ip": 0.0}  # of a point mass
THRUST = Section({"name": str, "node": int}, ("tilt_stiffness",))
DAMPING = Section({}, ("ratio",))
NUMBER = Section({"unit": str, "source": str})
AIR_GAP = Section({"body": str}, ("field", "mean_radius", "length", "gap"), ("tangential",),
                  {"tilt": bool, "linear": bool})
POLES = Section({"pole_pairs": int}, (), ("electrical_ratio", "pole_angle", "backward", "backward_angle", "stator_mmf",
                                          "load_angle"), {"series": str})
SHAPE = Section({"name": str, "of": str, "order": int}, ("size",), ("angle",))
PADS = Section({"name": str, "node": int, "pads": int}, ("pad_stiffness", "clearance"), ("angle", "rounding"))
FILM = Section({"name": str, "node": int}, ("viscosity", "journal_radius", "film_length", "clearance"))
CRACK = Section({"name": str, "element": int}, ("depth",), ("phase", "rounding_angle"), {"breathing": str})
BEARINGS: dict[str, tuple[Section, type, str]] = {
    "stiffness": (RADIAL, RadialBearing, "a radial bearing"),
    "tilt_stiffness": (THRUST, ThrustBearing, "a thrust bearing"),
    "pad_stiffness": (PADS, PadBearing, "pads with clearance"),
    "viscosity": (FILM, JournalFilm, "a journal film"),
}  # the number that tells which kind a bearing is
KINDS = {str: "text", int: "a whole number", bool: "true or false"}


def check_schema(card: Any) -> None:
    """Raise BadInput for what is no card of this schema."""
    if not isinstance(card, Mapping):
        raise BadInput(f"the card is {shown(card)}; it must be a table.")
    if "schema" not in card:
        raise BadInput(f"schema is missing; a card begins with schema = {SCHEMA}.")
    schema = card["schema"]
    if isinstance(schema, int) and not isinstance(schema, bool) and schema > SCHEMA:
        raise BadInput(f"schema is {shown(schema)}; this hydrolab reads schema {SCHEMA}, so it needs a newer hydrolab "
                       "or a card made for this one.")
    if schema != SCHEMA or not isinstance(schema, int) or isinstance(schema, bool):
        raise BadInput(f"schema is {shown(schema)}; it must be the whole number {SCHEMA}.")


def tables_of(key: str, card: Mapping) -> list[tuple[str, Mapping]]:
    """The tables of a list, each with its dotted key, which holds its name."""
    tables = card.get(key, [])
    if not isinstance(tables, list) or not all(isinstance(table, Mapping) for table in tables):
        raise BadInput(f"{key} is {shown(tables)}; it must be a list of tables, each opened by [[{key}]].")
    return [(f"{key}.{nickname(f'{key}[{i}].name', table['name'])}" if "name" in table else f"{key}[{i}]", table)
            for i, table in enumerate(tables)]


def kind_of_bearing(key: str, bearing: Mapping) -> tuple[Section, type]:
    """The section and the part of a bearing, by the one number that tells its kind."""
    told = [k for k in BEARINGS if k in bearing]
    if len(told) > 1:
        kinds = "; ".join(f"{BEARINGS[k][2]} has {k}" for k in told)
        raise BadInput(f"{key} has both {' and '.join(told)}: {kinds}; write two bearings.")
    if not told:
        raise BadInput(f"{key} has neither {' nor '.join(f'{k} ({what})' for k, (_, _, what) in BEARINGS.items())}; add "
                       f"stiffness = {_example('stiffness')}, or one of the others.")
    return BEARINGS[told[0]][:2]


def check_keys(key: str, table: Any, section: Section, also: tuple[str, ...] = ()) -> None:
    """Raise BadInput where a table has a key too many or too few, or plain keys of the wrong type."""
    where = key or "the card"
    if not isinstance(table, Mapping):
        raise BadInput(f"{key} is {shown(table)}; it must be one table, opened by [{key}].")
    dot = f"{key}." if key else ""
    known = [*section.plain, *section.required, *section.optional, *section.choices, *also]
    for unknown in (k for k in table if k not in known):
        near = get_close_matches(str(unknown), known, 1)
        raise BadInput(f"{dot}{shown(unknown).strip(chr(39))} = {shown(table[unknown])} is not a key of {where}; "
                       f"{f'the nearest is {near[0]}, ' if near else ''}allowed are {', '.join(dict.fromkeys(known))}.")
    for k, kind in (*section.plain.items(), *section.choices.items()):
        if k not in table and k in section.choices:
            continue
        if k not in table:
            raise BadInput(f"{dot}{k} is missing; {where} needs {', '.join([*section.plain, *section.required])}.")
        if not isinstance(table[k], kind) or isinstance(table[k], bool) > (kind is bool):
            raise BadInput(f"{dot}{k} is {shown(table[k])}; it must be {KINDS[kind]}.")
    for k in section.required:
        if k not in table:
            raise BadInput(f"{dot}{k} is missing; {where} needs {', '.join([*section.plain, *section.required])}, "
                           f"so add {k} = {_example(k)}.")


def units_of(k: str) -> dict[str, tuple[float, float]]:
    """The units that a number of this name may have, the first its SI unit; see `UNITS`."""
    return UNITS.get(SI_UNITS[k], {SI_UNITS[k]: (1, 1)})


def _example(k: str) -> str:
    return f'{{ value = …, unit = "{next(iter(units_of(k)))}", source = "assumed" }}'


def entry_of(key: str, table: Any) -> Entry:
    """The number a card states under a dotted key, with its value in SI units."""
    k = key.rpartition(".")[2]
    if not isinstance(table, Mapping):
        raise BadInput(f"{key} is {shown(table)}; write a number as {k} = {_example(k)}.")
    check_keys(key, table, NUMBER, ("value", "note"))
    if "value" not in table:
        raise BadInput(f"{key}.value is missing; write a number as {k} = {_example(k)}.")
    for part, allowed in (("unit", units_of(k)), ("source", SOURCES)):
        if table[part] not in allowed:
            raise BadInput(f"{key}.{part} is {shown(table[part])}; it must be one of {', '.join(allowed)}.")
    a, b = units_of(k)[table["unit"]]

    def si(value: Any, depth: int) -> Any:
        if isinstance(value, (list, tuple)) and depth:
            return [si(v, depth - 1) for v in value]
        return number(key, value, unit=table["unit"] if table["unit"] != "1" else "") * a / b

    return Entry(table["value"], table["unit"], table["source"], prose(f"{key}.note", table.get("note", "")),
                 si(table["value"], 2))


def prose(key: str, text: Any) -> str:
    """Free text on one line, without what could steer a terminal."""
    if not isinstance(text, str) or not all(c.isprintable() or c.isspace() for c in text):
        raise BadInput(f"{key} is {shown(text)}; it must be text without control characters.")
    return " ".join(text.split())


def as_stated(sentence: str, entries: Mapping[str, Entry]) -> str:
    """The sentence about a part, with the value as the card states it where that is in another unit."""
    for key, entry in entries.items():
        if sentence.startswith((f"{key} ", f"{key}[")) and entry.unit != SI_UNITS[key.rpartition(".")[2]]:
            return f"{sentence[:-1]}; the card says {shown(entry.value)} {entry.unit}."
    return sentence
