"""Machine cards: a machine in TOML, every number with its unit and its source.

A number of a card is an inline table, `mass = { value = 110, unit = "t", source = "calibrated",
note = "…" }`; the note is optional. What a table may hold is read from the fields of its part
(`card_keys` lists all of them); a bearing is told by one of its numbers. Copy a shipped card
(`card_text`), edit it, and load it by its path. A card is data and nothing of it is ever executed.
A bad card raises `BadInput` with everything that is wrong with it, a sentence a line, each with the
key, its value and what is allowed.

Here key: dotted, as in `card_keys`. table: what stands under it. value: in a unit.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields, replace
from difflib import get_close_matches
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hydrolab.errors import BadInput
from hydrolab.machine.bearing_table import read_table
from hydrolab.machine.bearings import BEARINGS, Bearing
from hydrolab.machine.parts import KINDS, Machine
from hydrolab.machine.quantities import (
    UNITS,
    BadParts,
    Entry,
    Fault,
    Held,
    Part,
    checked,
    declared,
    dotted,
    micro,
    nickname,
    number,
    prose,
    require_machine,
    shown,
)

SCHEMA = 1
SOURCES = ("paper", "Table 1", "literature", "derived", "calibrated", "assumed")
CONVERTED = {unit for units in UNITS.values() for unit in units} - set(UNITS)
# parts of which a machine has one, and those of which it has several, told apart by their names
ALONE = tuple(kind for kind in KINDS if "name" not in declared(kind))
SEVERAL = tuple(kind for kind in KINDS if "name" in declared(kind))


class CardKey(NamedTuple):
    """A key that a card may hold.

    key: dotted, with "…" for the name of a part. part: what has it, in words. meaning: in words.
    unit: those accepted, the first SI; empty for what is not a number. limits: in words. example:
    a line of TOML. needed: whether its table must have it.
    """

    key: str
    part: str
    meaning: str
    unit: str
    limits: str
    example: str
    needed: bool


def card_keys() -> list[CardKey]:
    """Return every key that a card may hold, in the order of its tables."""
    rows = [CardKey("schema", "the card", "the form of the card", "", f"{SCHEMA}",
                    f"schema = {SCHEMA}", True)]
    kinds: list[type[Part]] = [Machine]
    for kind in KINDS:
        kinds += BEARINGS if kind is Bearing else (kind,)
    for kind in kinds:
        prefix = f"{kind.table}.…" if "name" in declared(kind) and kind.table else kind.table
        what = f"[{kind.table}]" if kind in ALONE else kind.noun
        rows += [CardKey(dotted(prefix, name), what, held.meaning,
                         ", ".join(held.units) if held.unit else "", held.limits,
                         f"{name} = {example(held)}", name in needed(kind))
                 for name, held in declared(kind).items()]
    return rows


def example(held: Held, filled: bool = True) -> str:
    """What a declared field may look like in a card; not filled: its form, for any number."""
    if not held.unit:
        return json.dumps(held.example)  # true, a number or a text in quotes, as in TOML
    value, unit = held.example if filled else ("…", next(iter(held.units)))
    value = f"{value:g}" if isinstance(value, float) else value
    return f'{{ value = {value}, unit = "{unit}", source = "assumed" }}'


def needed(kind: type[Part], free: tuple[str, ...] = ()) -> list[str]:
    """The fields of a kind of part that its table must state; free: those that it need not."""
    default = {f.name: f.default for f in fields(kind)}
    return [name for name, held in declared(kind).items()
            if (held.stated or default[name] is MISSING) and name not in free]


class Reader:
    """Reads the tables of a card into parts, and gathers what is wrong on the way.

    entries: the numbers as stated, by their keys. faults: keys and sentences.
    """

    def __init__(self) -> None:
        self.entries: dict[str, Entry] = {}
        self.faults: list[Fault] = []

    def fail(self, key: str, sentence: str) -> None:
        """Add a fault, a sentence, with the value as the card states it where its unit differs."""
        entry = self.entries.get(key)
        if entry is not None and entry.unit in CONVERTED:
            sentence = f"{sentence[:-1]}; the card says {shown(entry.value)} {entry.unit}."
        self.faults.append((key, sentence))

    def keys(self, key: str, table: Mapping, must: Mapping[str, str], may: list[str]) -> None:
        """Find keys too many and too few. must: what the table needs, each with an example; may:
        what it may have.
        """
        where, known = key or "the card", list(dict.fromkeys([*must, *may]))
        for unknown in (k for k in table if k not in known):
            near = get_close_matches(str(unknown), known, 1)
            self.fail(key, f"{dotted(key, shown(unknown).strip(chr(39)))} = "
                      f"{shown(table[unknown])} is not a key of {where}; "
                      f"{f'the nearest is {near[0]}, ' if near else ''}allowed are "
                      f"{', '.join(known)}.")
        for k in (k for k in must if k not in table):
            own = dotted(key, k)
            self.fail(own, f"{own} is missing; {where} needs {', '.join(must)}, so add "
                      f"{k} = {must[k]}.")

    def entry(self, key: str, table: Any, held: Held) -> Entry | None:
        """The number that a card states under a key, or None."""
        name, before = key.rpartition(".")[2], len(self.faults)
        if not isinstance(table, Mapping):
            self.fail(key, f"{key} is {shown(table)}; write a number as "
                      f"{name} = {example(held, filled=False)}.")
            return None
        self.keys(key, table, {"value": "…", "unit": f'"{next(iter(held.units))}"',
                               "source": '"assumed"'}, ["note"])
        stated = {**table, "unit": micro(table.get("unit"))}
        for part, allowed in (("unit", list(held.units)), ("source", SOURCES)):
            if part in table and stated[part] not in allowed:
                self.fail(f"{key}.{part}", f"{key}.{part} is {shown(table[part])}; it must be one "
                          f"of {', '.join(allowed)}.")
        try:
            note = prose(f"{key}.note", table.get("note", ""))
            if len(self.faults) == before:
                si = in_si(key, table["value"], stated["unit"], held.units[stated["unit"]])
                return Entry(table["value"], stated["unit"], table["source"], note, si)
        except BadInput as error:
            self.fail("", str(error))
        return None

    def values(self, kind: type[Part], key: str, table: Any, free: tuple[str, ...] = (),
               also: tuple[str, ...] = ()) -> dict[str, Any] | None:
        """The declared fields of a part as its table states them, or None where something is wrong.

        free: fields that the table need not state. also: keys of other things in it.
        """
        if not isinstance(table, Mapping):
            self.fail(key, f"{key} is {shown(table)}; it must be one table, opened by [{key}].")
            return None
        before, fields_of = len(self.faults), declared(kind)
        self.keys(key, table, {k: example(fields_of[k], filled=False) for k in needed(kind, free)},
                  [*fields_of, *also])
        found: dict[str, Any] = {}
        for name in (name for name in fields_of if name in table):
            own, held = dotted(key, name), fields_of[name]
            found[name] = table[name]
            if held.unit:
                entry = self.entry(own, table[name], held)
                if entry is None:
                    del found[name]
                else:
                    self.entries[own], found[name] = entry, entry.si
        good, faults = checked(kind, key, found)
        for fault in faults:
            self.fail(*fault)
        return good if len(self.faults) == before else None

    def part(self, kind: type[Part], key: str, values: dict[str, Any] | None) -> Any:
        """The part that these values make, or None where something is wrong."""
        if values is None:
            return None
        try:
            made = kind(**values)
        except BadParts as error:
            for fault in error.faults:
                self.fail(*fault)
            return None
        for name in (name for name in declared(kind) if (own := dotted(key, name)) in self.entries):
            own = dotted(key, name)
            self.entries[own] = replace(self.entries[own], si=getattr(made, name))
        return made

    def tables(self, kind: type[Part], card: Mapping) -> Iterator[tuple[str, Mapping]]:
        """The tables of a list, each with its dotted key, which holds its name if it has one."""
        tables = card.get(kind.table, [])
        if not isinstance(tables, list) or not all(isinstance(t, Mapping) for t in tables):
            self.fail(kind.table, f"{kind.table} is {shown(tables)}; it must be a list of tables, "
                      f"each opened by [[{kind.table}]].")
            return
        for i, table in enumerate(tables):
            try:
                yield f"{kind.table}.{nickname('', table.get('name'))}", table
            except BadInput:  # the check of its fields says so
                yield f"{kind.table}[{i}]", table

    def kind_of_bearing(self, key: str, table: Mapping) -> type[Bearing] | None:
        """The kind of a bearing, by the one number that tells."""
        told = [kind for kind in BEARINGS if kind.told_by in table]
        if len(told) > 1:
            self.fail(key, f"{key} has both {' and '.join(kind.told_by for kind in told)}: "
                      f"{'; '.join(f'{kind.noun} has {kind.told_by}' for kind in told)}; write two "
                      "bearings.")
        elif not told:
            kinds = " nor ".join(f"{kind.told_by} ({kind.noun})" for kind in BEARINGS)
            first = BEARINGS[0]
            form = example(declared(first)[first.told_by], filled=False)
            self.fail(key, f"{key} has neither {kinds}; add {first.told_by} = {form}, or one of "
                      "the others.")
        return told[0] if len(told) == 1 else None


def in_si(key: str, value: Any, unit: str, factors: tuple[float, float], depth: int = 2) -> Any:
    """Numbers or nested lists in a unit, in SI units; factors: as in `UNITS`; depth: of lists."""
    if isinstance(value, (list, tuple)) and depth:
        return [in_si(key, v, unit, factors, depth - 1) for v in value]
    return number(key, value, unit=unit if unit != "1" else "") * factors[0] / factors[1]


def check_schema(card: Any) -> None:
    """Raise BadInput for what is no card of this schema."""
    if not isinstance(card, Mapping):
        raise BadInput(f"the card is {shown(card)}; it must be a table.")
    if "schema" not in card:
        raise BadInput(f"schema is missing; a card begins with schema = {SCHEMA}.")
    schema = card["schema"]
    if isinstance(schema, int) and not isinstance(schema, bool) and schema > SCHEMA:
        raise BadInput(f"schema is {shown(schema)}; this hydrolab reads schema {SCHEMA}, so it "
                       "needs a newer hydrolab or a card made for this one.")
    if schema != SCHEMA or not isinstance(schema, int) or isinstance(schema, bool):
        raise BadInput(f"schema is {shown(schema)}; it must be the whole number {SCHEMA}.")


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
    text = _read(Path(name_or_path)) if own else card_text(str(name_or_path))
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
                       "long or brackets are too deep.") from None


def load_machine(name_or_path: str | Path) -> Machine:
    """Return the machine of a shipped card (by its name) or of your own (a path that ends in
    .toml).

    Raises BadInput if the card cannot be found or read, or with everything that is wrong with it, a
    sentence a line.
    """
    card = read_card(name_or_path)
    try:
        _read_tables(card, Path(name_or_path).parent)
        return machine_from_card(card)
    except BadInput as error:
        name = shown(Path(name_or_path).name).strip("'")
        raise BadInput("\n".join(f"{name}: {line}" for line in str(error).split("\n"))) from None


def _read_tables(card: dict[str, Any], folder: Path) -> None:
    """Put the numbers of CSV files beside a card in the place of their names.

    Raises BadInput for a file elsewhere, or one that cannot be read.
    """
    bearings = card.get("bearings", [])
    for bearing in bearings if isinstance(bearings, list) else []:
        if isinstance(bearing, dict) and "table" in bearing:
            name = bearing.pop("table")
            if not isinstance(name, str) or Path(name).name != name:
                raise BadInput(f"table is {shown(name)}; it must be the name of a CSV file in the "
                               "folder of the card.")
            bearing |= read_table(folder / name)


def machine_from_card(card: Mapping[str, Any]) -> Machine:
    """Return the machine of a card given as nested dicts and lists, as `read_card` returns it.

    Raises BadInput with everything that is wrong, a sentence a line, each with the key, its value
    and what is allowed.
    """
    check_schema(card)
    read = Reader()
    own = read.values(Machine, "", card,
                      also=("schema", *(kind.table for kind in (*ALONE, *SEVERAL))))
    alone = {kind: read.part(kind, kind.table, read.values(kind, kind.table, card[kind.table]))
             for kind in ALONE if kind.table in card}
    several: dict[str, list[Part]] = {}
    for kind in SEVERAL:
        for key, table in read.tables(kind, card):
            free = ("Id", "Ip") if "shaft" not in card else ()  # without a shaft nothing tilts
            one = read.kind_of_bearing(key, table) if kind is Bearing else kind
            if one is not None:
                made = read.part(one, key, read.values(one, key, table, free))
                group = one.group if issubclass(one, Bearing) else kind.table
                several.setdefault(group, []).append(made)
    machine = None
    if own is not None and not read.faults:
        parts = {kind.table: made for kind, made in alone.items()}
        lists = {group: tuple(made) for group, made in several.items()}
        machine = read.part(Machine, "", own | parts | lists | {"provenance": read.entries})
    if machine is None:
        raise BadParts(read.faults)
    return machine


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


def _shipped() -> Traversable:
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
        raise BadInput(f"{shown(str(path))} is not TOML: byte {error.start} is not UTF-8 "
                       "text.") from None
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


def vary(machine: Machine, changes: Mapping[str, Any]) -> Machine:
    """Return the machine with these numbers in place of its own, SI units.

    machine: as loaded from a card or made in Python. changes: values by key. Keys are those of its
    card, which `machine.numbers()` lists: "speed", "air_gap.field", "bodies.generator.mass",
    "bearings.generator guide bearing.stiffness", "shaft.young", "damping.ratio"; short forms:
    "field" for "air_gap.field" and "unbalance" for a factor on all unbalances. Raises BadInput for
    a key the machine does not have, or a value its part refuses.
    """
    require_machine(machine)
    return machine.with_numbers(changes)
