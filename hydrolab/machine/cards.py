"""Machine cards: a machine in TOML, every number with its unit and its source, read into a `Machine`.

A number of a card is an inline table, `mass = { value = 110, unit = "t", source = "calibrated", note = "…" }`; the
note is optional. Bearings are radial, thrust, of pads with clearance or with a film, by the number that tells
(`card_keys.BEARINGS`); `[[cracks]]` are in shaft elements. Copy a shipped card (`card_text`), edit it, and load it by
its path. A card is data and nothing of it is ever executed. A bad card raises `BadInput` with one sentence that names
the key, its value and what is allowed.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from difflib import get_close_matches
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from hydrolab.errors import BadInput
from hydrolab.machine.card_keys import (
    AIR_GAP,
    BEARINGS,
    BODY,
    CARD,
    CRACK,
    DAMPING,
    OTHERS,
    POINT_MASS,
    POLES,
    SHAFT,
    SHAPE,
    ZEROS,
    Section,
    as_stated,
    check_keys,
    check_schema,
    entry_of,
    kind_of_bearing,
    prose,
    tables_of,
)
from hydrolab.machine.fault_parts import Crack, JournalFilm, PadBearing
from hydrolab.machine.gap_parts import GapShape, Poles
from hydrolab.machine.parts import (
    AirGap,
    Entry,
    Machine,
    RadialBearing,
    RayleighDamping,
    RigidBody,
    Shaft,
    ThrustBearing,
    shown,
)

LARGEST_CARD = 2_000_000  # bytes


def card_names() -> list[str]:
    """Return the names of the cards that ship with hydrolab."""
    return sorted(card.name.removesuffix(".toml") for card in _shipped().iterdir() if card.name.endswith(".toml"))


def card_text(name: str) -> str:
    """Return the text of a shipped card, to copy and edit.

    Raises BadInput if no card has this name.
    """
    if name not in card_names():
        raise BadInput(f"{shown(name)} is not a shipped card; {_choice(name)}, and the path of your own ends in .toml.")
    return (_shipped() / f"{name}.toml").read_text(encoding="utf-8")


def read_card(name_or_path: str | Path) -> dict[str, Any]:
    """Return a card as nested dicts and lists, as it stands in the file: to edit, and to pass to `write_card`.

    Raises BadInput if there is no such card or it is not TOML.
    """
    own = isinstance(name_or_path, Path) or str(name_or_path).endswith(".toml")
    text = _read(Path(name_or_path)) if own else card_text(name_or_path)
    if any(piece.count(".") > 100 for line in text.splitlines() for piece in line.split(",")):
        # tomllib would take minutes over a key of thousands of dots
        raise BadInput(f"{shown(str(name_or_path))} is no card: a line has more than 100 dots without a comma.")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{shown(str(name_or_path))} is not TOML: {_reason(error)}.") from None
    except (ValueError, RecursionError):  # a number of thousands of digits, brackets a thousand deep
        raise BadInput(f"{shown(str(name_or_path))} is not TOML that can be read: a number is too long or "
                       "brackets are too deep.") from None


def load_machine(name_or_path: str | Path) -> Machine:
    """Return the machine of a shipped card (by its name) or of your own (a path that ends in .toml).

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
        found = {k: entry_of(f"{key}.{k}", table[k]) for k in (*section.required, *section.optional) if k in table}
        try:
            plain = {k: table[k] for k in (*section.plain, *section.choices) if k in table}
            made = make(**plain, **{k: entry.si for k, entry in found.items()})
        except BadInput as error:
            raise BadInput(as_stated(str(error), {f"{key}.{k}": entry for k, entry in found.items()})) from None
        entries.update({f"{key}.{k}": replace(entry, si=getattr(made, k)) for k, entry in found.items()})
        return made

    def table(key: str, section: Section, make: Callable[..., Any]) -> Any:
        return part(key, card[key], section, make) if key in card else None

    shaft = table("shaft", SHAFT, Shaft)
    body_section = BODY if shaft else POINT_MASS
    bodies = tuple(part(key, body, body_section, partial(RigidBody, **ZEROS)) for key, body in tables_of("bodies", card))
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
            card["name"], speed.si, shaft, bodies, tuple(bearings[RadialBearing]), tuple(bearings[ThrustBearing]), damping,
            air_gap, prose("title", card.get("title", "")), entries, prose("about", card.get("about", "")),
            tuple(bearings[PadBearing]), tuple(bearings[JournalFilm]), cracks, poles, shapes)
    except BadInput as error:
        raise BadInput(as_stated(str(error), entries)) from None


def write_card(card: Mapping[str, Any], path: str | Path) -> Machine:
    """Write a card from nested dicts and lists, in which a number is an `Entry` or a dict; return its machine.

    The card is checked first, so what is written can be loaded. Raises BadInput where it cannot.
    """
    import tomlkit  # only who writes a card waits for it

    def numeral(value: Any) -> Any:
        if isinstance(value, list):
            return [numeral(v) for v in value]
        if not isinstance(value, float) or value == 0 or 1e-3 <= abs(value) < 1e5:
            return value
        return tomlkit.value(min(repr(value), np.format_float_scientific(value, trim="-", exp_digits=1), key=len))

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
        raise BadInput(f"the card {machine.name} cannot be written as TOML without a change; simplify its texts.")
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
    return f"shipped are {', '.join(card_names())}" + (f" (the nearest is {near[0]})" if near else "")


def _read(path: Path) -> str:
    try:
        if not path.is_file():
            what = "is not a file" if path.exists() else "does not exist"
            raise BadInput(f"{shown(str(path))} {what}; give the path of a card or a name; {_choice(path.stem)}.")
        with path.open("rb") as stream:
            content = stream.read(LARGEST_CARD + 1)
        if len(content) > LARGEST_CARD:
            raise BadInput(f"{shown(str(path))} is larger than {LARGEST_CARD / 1e6:g} MB; a card is a few kB of TOML.")
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
