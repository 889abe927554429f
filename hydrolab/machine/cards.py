"""What a machine card may hold: its tables and keys, units and sources, and the sentences about
what it may not.

A number of a card is an inline table with value, unit and source (`entry_of`); the tables are
`Section`s.

Machine cards: a machine in TOML, every number with its unit and its source, read into a `Machine`.

A number of a card is an inline table, `mass = { value = 110, unit = "t", source = "calibrated",
note = "…" }`; the note is optional. Bearings are radial, thrust, of pads with clearance or with a
film, by the number that tells (`card_keys.BEARINGS`); `[[cracks]]` are in shaft elements. Copy a
shipped card (`card_text`), edit it, and load it by its path. A card is data and nothing of it is
ever executed. A bad card raises `BadInput` with one sentence that names the key, its value and what
is allowed.

The same machine with one number changed.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from hydrolab.errors import BadInput
from hydrolab.machine.bearings import Crack, JournalFilm, PadBearing
from hydrolab.machine.gap_shape import GapShape, Poles
from hydrolab.machine.parts import (
    SI_UNITS,
    AirGap,
    Entry,
    Machine,
    RadialBearing,
    RayleighDamping,
    RigidBody,
    Shaft,
    ThrustBearing,
    nickname,
    number,
    shown,
)

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
# SI unit → accepted unit → (a, b) with SI value = value · a / b; what is not listed is accepted in
# SI only
}


@dataclass(frozen=True)
class Section:
    """What a table of a card holds: plain keys with their type, and numbers that must or may be
    there.

    choices: plain keys with their type that may be left out.
    """

    plain: Mapping[str, type]
    required: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    choices: Mapping[str, type] = field(default_factory=dict)


CARD = Section({"schema": int, "name": str}, ("speed",))
OTHERS = ("title", "about", "shaft", "bodies", "bearings", "damping", "air_gap", "cracks", "poles",
          "shapes")  # all optional
SHAFT = Section({"element": str}, ("nodes", "diameter", "young", "density", "poisson",
                                   "shear_coefficient"),
                ("inner_diameter",))
BODY = Section({"name": str, "node": int}, ("mass", "Id", "Ip"), ("offset", "unbalance", "phase"))
# without a shaft nothing tilts
POINT_MASS = replace(BODY, required=("mass",), optional=("Id", "Ip", *BODY.optional))
RADIAL = Section({"name": str, "node": int}, ("stiffness",), ("damping",))
ZEROS = {"Id": 0.0, "Ip": 0.0}  # of a point mass
THRUST = Section({"name": str, "node": int}, ("tilt_stiffness",))
DAMPING = Section({}, ("ratio",))
NUMBER = Section({"unit": str, "source": str})
AIR_GAP = Section({"body": str}, ("field", "mean_radius", "length", "gap"), ("tangential",),
                  {"tilt": bool, "linear": bool})
POLES = Section({"pole_pairs": int}, (), ("electrical_ratio", "pole_angle", "backward",
                                          "backward_angle", "stator_mmf",
                                          "load_angle"), {"series": str})
SHAPE = Section({"name": str, "of": str, "order": int}, ("size",), ("angle",))
PADS = Section({"name": str, "node": int, "pads": int}, ("pad_stiffness", "clearance"),
               ("angle", "rounding"))
FILM = Section({"name": str, "node": int}, ("viscosity", "journal_radius", "film_length",
                                            "clearance"))
CRACK = Section({"name": str, "element": int}, ("depth",), ("phase", "rounding_angle"),
                {"breathing": str})
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
        raise BadInput(f"schema is {shown(schema)}; this hydrolab reads schema {SCHEMA}, so it "
                       "needs a newer hydrolab "
                       "or a card made for this one.")
    if schema != SCHEMA or not isinstance(schema, int) or isinstance(schema, bool):
        raise BadInput(f"schema is {shown(schema)}; it must be the whole number {SCHEMA}.")


def tables_of(key: str, card: Mapping) -> list[tuple[str, Mapping]]:
    """The tables of a list, each with its dotted key, which holds its name."""
    tables = card.get(key, [])
    if not isinstance(tables, list) or not all(isinstance(table, Mapping) for table in tables):
        raise BadInput(f"{key} is {shown(tables)}; it must be a list of tables, each opened by "
                       f"[[{key}]].")
    return [(f"{key}.{nickname(f'{key}[{i}].name', table['name'])}" if "name" in table
             else f"{key}[{i}]", table)
            for i, table in enumerate(tables)]


def kind_of_bearing(key: str, bearing: Mapping) -> tuple[Section, type]:
    """The section and the part of a bearing, by the one number that tells its kind."""
    told = [k for k in BEARINGS if k in bearing]
    if len(told) > 1:
        kinds = "; ".join(f"{BEARINGS[k][2]} has {k}" for k in told)
        raise BadInput(f"{key} has both {' and '.join(told)}: {kinds}; write two bearings.")
    if not told:
        raise BadInput(f"{key} has neither "
                       f"{' nor '.join(f'{k} ({what})' for k, (_, _, what) in BEARINGS.items())}; "
                       "add "
                       f"stiffness = {_example('stiffness')}, or one of the others.")
    return BEARINGS[told[0]][:2]


def check_keys(key: str, table: Any, section: Section, also: tuple[str, ...] = ()) -> None:
    """Raise BadInput where a table has a key too many or too few, or plain keys of the wrong type.
    """
    where = key or "the card"
    if not isinstance(table, Mapping):
        raise BadInput(f"{key} is {shown(table)}; it must be one table, opened by [{key}].")
    dot = f"{key}." if key else ""
    known = [*section.plain, *section.required, *section.optional, *section.choices, *also]
    for unknown in (k for k in table if k not in known):
        near = get_close_matches(str(unknown), known, 1)
        raise BadInput(f"{dot}{shown(unknown).strip(chr(39))} = {shown(table[unknown])} is not a "
                       f"key of {where}; "
                       f"{f'the nearest is {near[0]}, ' if near else ''}allowed are "
                       f"{', '.join(dict.fromkeys(known))}.")
    for k, kind in (*section.plain.items(), *section.choices.items()):
        if k not in table and k in section.choices:
            continue
        if k not in table:
            raise BadInput(f"{dot}{k} is missing; {where} needs "
                           f"{', '.join([*section.plain, *section.required])}.")
        if not isinstance(table[k], kind) or isinstance(table[k], bool) > (kind is bool):
            raise BadInput(f"{dot}{k} is {shown(table[k])}; it must be {KINDS[kind]}.")
    for k in section.required:
        if k not in table:
            raise BadInput(f"{dot}{k} is missing; {where} needs "
                           f"{', '.join([*section.plain, *section.required])}, "
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
            raise BadInput(f"{key}.{part} is {shown(table[part])}; it must be one of "
                           f"{', '.join(allowed)}.")
    a, b = units_of(k)[table["unit"]]

    def si(value: Any, depth: int) -> Any:
        if isinstance(value, (list, tuple)) and depth:
            return [si(v, depth - 1) for v in value]
        return number(key, value, unit=table["unit"] if table["unit"] != "1" else "") * a / b

    return Entry(table["value"], table["unit"], table["source"],
                 prose(f"{key}.note", table.get("note", "")),
                 si(table["value"], 2))


def prose(key: str, text: Any) -> str:
    """Free text on one line, without what could steer a terminal."""
    if not isinstance(text, str) or not all(c.isprintable() or c.isspace() for c in text):
        raise BadInput(f"{key} is {shown(text)}; it must be text without control characters.")
    return " ".join(text.split())


def as_stated(sentence: str, entries: Mapping[str, Entry]) -> str:
    """The sentence about a part, with the value as the card states it where that is in another
    unit.
    """
    for key, entry in entries.items():
        if sentence.startswith((f"{key} ",
                                f"{key}[")) and entry.unit != SI_UNITS[key.rpartition(".")[2]]:
            return f"{sentence[:-1]}; the card says {shown(entry.value)} {entry.unit}."
    return sentence


LARGEST_CARD = 2_000_000  # bytes


def card_names() -> list[str]:
    """Return the names of the cards that ship with hydrolab."""
    return sorted(card.name.removesuffix(".toml") for card in _shipped().iterdir()
                  if card.name.endswith(".toml"))


def card_text(name: str) -> str:
    """Return the text of a shipped card, to copy and edit.

    Raises BadInput if no card has this name.
    """
    if name not in card_names():
        raise BadInput(f"{shown(name)} is not a shipped card; {_choice(name)}, and the path of "
                       "your own ends in .toml.")
    return (_shipped() / f"{name}.toml").read_text(encoding="utf-8")


def read_card(name_or_path: str | Path) -> dict[str, Any]:
    """Return a card as nested dicts and lists, as it stands in the file: to edit, and to pass to
    `write_card`.

    Raises BadInput if there is no such card or it is not TOML.
    """
    own = isinstance(name_or_path, Path) or str(name_or_path).endswith(".toml")
    text = _read(Path(name_or_path)) if own else card_text(name_or_path)
    if any(piece.count(".") > 100 for line in text.splitlines() for piece in line.split(",")):
        # tomllib would take minutes over a key of thousands of dots
        raise BadInput(f"{shown(str(name_or_path))} is no card: a line has more than 100 dots "
                       "without a comma.")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{shown(str(name_or_path))} is not TOML: {_reason(error)}.") from None
    # a number of thousands of digits, brackets a thousand deep
    except (ValueError, RecursionError):
        raise BadInput(f"{shown(str(name_or_path))} is not TOML that can be read: a number is too "
                       "long or "
                       "brackets are too deep.") from None


def load_machine(name_or_path: str | Path) -> Machine:
    """Return the machine of a shipped card (by its name) or of your own (a path that ends in
    .toml).

    Raises BadInput with one sentence if the card cannot be found, read or is no possible machine.
    """
    card = read_card(name_or_path)
    try:
        return machine_from_card(card)
    except BadInput as error:
        raise BadInput(f"{shown(Path(name_or_path).name).strip(chr(39))}: {error}") from None


def machine_from_card(card: Mapping[str, Any]) -> Machine:
    """Return the machine of a card given as nested dicts and lists, as `read_card` returns it.

    Raises BadInput with one sentence that names the key, its value and what is allowed.
    """
    check_schema(card)
    check_keys("", card, CARD, OTHERS)
    speed = entry_of("speed", card["speed"])
    entries = {"speed": speed}

    def part(key: str, table: Any, section: Section, make: Callable[..., Any]) -> Any:
        check_keys(key, table, section)
        found = {k: entry_of(f"{key}.{k}", table[k])
                 for k in (*section.required, *section.optional) if k in table}
        try:
            plain = {k: table[k] for k in (*section.plain, *section.choices) if k in table}
            made = make(**plain, **{k: entry.si for k, entry in found.items()})
        except BadInput as error:
            raise BadInput(as_stated(str(error),
                                     {f"{key}.{k}": entry for k, entry in found.items()})) from None
        entries.update({f"{key}.{k}": replace(entry, si=getattr(made, k))
                        for k, entry in found.items()})
        return made

    def table(key: str, section: Section, make: Callable[..., Any]) -> Any:
        return part(key, card[key], section, make) if key in card else None

    shaft = table("shaft", SHAFT, Shaft)
    body_section = BODY if shaft else POINT_MASS
    bodies = tuple(part(key, body, body_section, partial(RigidBody, **ZEROS))
                   for key, body in tables_of("bodies", card))
    bearings: dict[type, list] = {kind: [] for _, kind, _ in BEARINGS.values()}
    for key, bearing in tables_of("bearings", card):
        section, kind = kind_of_bearing(key, bearing)
        bearings[kind].append(part(key, bearing, section, kind))
    cracks = tuple(part(key, crack, CRACK, Crack) for key, crack in tables_of("cracks", card))
    shapes = tuple(part(key, shape, SHAPE, GapShape) for key, shape in tables_of("shapes", card))
    poles = table("poles", POLES, Poles)
    damping, air_gap = table("damping", DAMPING, RayleighDamping), table("air_gap", AIR_GAP, AirGap)
    try:
        return Machine(
            card["name"], speed.si, shaft, bodies, tuple(bearings[RadialBearing]),
            tuple(bearings[ThrustBearing]), damping,
            air_gap, prose("title", card.get("title", "")), entries,
            prose("about", card.get("about", "")),
            tuple(bearings[PadBearing]), tuple(bearings[JournalFilm]), cracks, poles, shapes)
    except BadInput as error:
        raise BadInput(as_stated(str(error), entries)) from None


def write_card(card: Mapping[str, Any], path: str | Path) -> Machine:
    """Write a card from nested dicts and lists, in which a number is an `Entry` or a dict; return
    its machine.

    The card is checked first, so what is written can be loaded. Raises BadInput where it cannot.
    """
    import tomlkit  # only who writes a card waits for it

    def numeral(value: Any) -> Any:
        if isinstance(value, list):
            return [numeral(v) for v in value]
        if not isinstance(value, float) or value == 0 or 1e-3 <= abs(value) < 1e5:
            return value
        return tomlkit.value(min(repr(value),
                                 np.format_float_scientific(value, trim="-", exp_digits=1),
                                 key=len))

    def item(value: Any) -> Any:
        if isinstance(value, dict) and "value" in value:
            inline = tomlkit.inline_table()
            inline.update({**value, "value": numeral(value["value"])})
            return inline
        if isinstance(value, str) and "\n" in value:
            return tomlkit.string(value, multiline=True)
        if isinstance(value, dict):
            return {k: item(v) for k, v in value.items()}
        return [item(v) for v in value] if isinstance(value, list) else value

    card = _plain(card)
    machine = machine_from_card(card)
    text = tomlkit.dumps(item(card))
    if tomllib.loads(text) != card:
        raise BadInput(f"the card {machine.name} cannot be written as TOML without a change; "
                       "simplify its texts.")
    try:
        Path(path).write_text(text, encoding="utf-8")
    except (OSError, ValueError) as error:
        raise BadInput(f"{shown(str(path))} cannot be written: {_reason(error)}.") from None
    return machine


def _reason(error: Exception) -> str:
    """What an exception says, as the end of a sentence."""
    text = " ".join((getattr(error, "strerror", None) or str(error)).split()).rstrip(".")
    return text[:1].lower() + (text[1:] if len(text) < 160 else f"{text[1:100]} … {text[-50:]}")


def _shipped():
    return files("hydrolab.machine") / "cards"


def _choice(name: Any) -> str:
    near = get_close_matches(name, card_names(), 1, 0.3) if isinstance(name, str) else []
    return f"shipped are {', '.join(card_names())}" + (f" (the nearest is {near[0]})" if near
                                                       else "")


def _read(path: Path) -> str:
    try:
        if not path.is_file():
            what = "is not a file" if path.exists() else "does not exist"
            raise BadInput(f"{shown(str(path))} {what}; give the path of a card or a name; "
                           f"{_choice(path.stem)}.")
        with path.open("rb") as stream:
            content = stream.read(LARGEST_CARD + 1)
        if len(content) > LARGEST_CARD:
            raise BadInput(f"{shown(str(path))} is larger than {LARGEST_CARD / 1e6:g} MB; a card "
                           "is a few kB of TOML.")
        return content.decode("utf-8-sig")  # Windows puts a mark before UTF-8
    except UnicodeDecodeError as error:
        raise BadInput(f"{shown(str(path))} is not TOML: byte {error.start} is not UTF-8 text.") from None
    except OSError as error:
        raise BadInput(f"{shown(str(path))} cannot be read: {_reason(error)}.") from None


def _plain(value: Any) -> Any:
    """A card in dicts, lists, numbers and texts only."""
    if isinstance(value, Entry):
        note = {"note": value.note} if value.note else {}
        value = {"value": value.value, "unit": value.unit, "source": value.source, **note}
    if isinstance(value, Mapping):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


GROUPS = {"bodies": ("bodies",), "bearings": ("bearings", "thrust_bearings", "pad_bearings",
                                              "films"),
          # fields of a machine that hold the parts of a card's section
          "cracks": ("cracks",), "shapes": ("shapes",)}


def vary(machine: Machine, changes: Mapping[str, Any]) -> Machine:
    """Return the machine with these numbers in place of its own, SI units.

    Keys are those of its card: "speed", "air_gap.field", "bodies.generator.mass",
    "bearings.generator guide bearing.stiffness", "shaft.young"; short forms: "field" for
    "air_gap.field" and "unbalance" for a factor on all unbalances. Raises BadInput for a key the
    machine does not have, or a value its part refuses.
    """
    for key, value in changes.items():
        if key == "speed":
            machine = replace(machine, speed=value)
        elif key == "unbalance":
            machine = replace(machine, bodies=tuple(replace(b, unbalance=value * b.unbalance)
                                                    for b in machine.bodies))
        else:
            machine = _vary_part(machine, "air_gap.field" if key == "field" else key, value)
    return machine


def _vary_part(machine: Machine, key: str, value: Any) -> Machine:
    section, _, rest = key.partition(".")
    name, _, attribute = rest.rpartition(".")
    if section in ("shaft", "air_gap", "poles") and not name and getattr(machine,
                                                                         section) is not None:
        return replace(machine, **{section: _replaced(key, getattr(machine, section), attribute,
                                                      value)})
    for group in GROUPS.get(section, ()):
        parts = getattr(machine, group)
        for i, part in enumerate(parts):
            if part.name == name:
                changed = _replaced(key, part, attribute, value)
                return replace(machine, **{group: (*parts[:i], changed, *parts[i + 1:])})
    raise BadInput(f"{key!r} is not a number of {machine.name}; there are "
                   f"{', '.join(parameter_keys(machine))}.")


def _replaced(key: str, part: Any, attribute: str, value: Any) -> Any:
    if attribute not in _numbers(part):
        raise BadInput(f"{key!r} is not a number; this part has {', '.join(_numbers(part))}.")
    return replace(part, **{attribute: value})


def _numbers(part: Any) -> list[str]:
    """Names of the fields of a part that hold numbers."""
    return [f.name for f in fields(part) if f.name not in ("node", "element", "pads", "pole_pairs",
                                                           "order")
            and isinstance(value := getattr(part, f.name), (int, float, np.ndarray, np.number))
            and not isinstance(value, bool)]


def parameter_keys(machine: Machine) -> list[str]:
    """Every key that `vary` takes for this machine."""
    keys = ["speed", "unbalance"]
    for section in ("shaft", "air_gap", "poles"):
        if getattr(machine, section) is not None:
            keys += [f"{section}.{n}" for n in _numbers(getattr(machine, section))]
    for section, parts in (("bodies", machine.bodies), ("bearings", machine.all_bearings),
                           ("cracks", machine.cracks),
                           ("shapes", machine.shapes)):
        keys += [f"{section}.{part.name}.{n}" for part in parts for n in _numbers(part)]
    return keys
