"""Run sheets: what a presenter says, shows and asks, step by step, in a TOML file that people and
the program read; and the numbers that such a sheet may hold.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydrolab.errors import BadInput
from hydrolab.live.gate import CHOICES
from hydrolab.live.moving_orbit import ENDINGS, FIELDS, UNBALANCES

VIEWS = ("machine", "air gap", "lower end", "along the axis")
SWITCHES = ("playing", "names", "dark")
NUMBERS = {"eccentricity": (0.0, 100.0), "orbit": (1, 9), "field": FIELDS, "unbalance": UNBALANCES,
           "exaggeration": (1.0, 1000.0), "bow": (1.0, 5000.0), "slow_motion": (1.0, 100.0)}
WORDS = ("title", "camera", "cue", "see", "ask")
PARTS = {*WORDS, "minutes", "set", "holds", "poll", "answer"}
DOUBLED = "of two revolutions"  # an orbit that the machine slides into
START = {"eccentricity": 0.0, "orbit": 1, "field": 1.0, "unbalance": 1.0, "playing": True}
# What a step may hold; a test computes them.
FACTS = ("orbits", "stable_orbits", "first_um", "across_um", "mean_um", "second_percent",
         "axes_ratio", "revolutions", "smallest_gap_mm", "gap_mm", "offset_um", "fold_percent",
         "second_fold_percent", "third_fold_percent", "speed_rpm")


@dataclass(frozen=True)
class Step:
    """One step of a run sheet. `state` is everything that was set up to here, in the units of the
    sheet.

    see: what the room should see; holds: the numbers in it, which a test computes again. poll: what
    A, B, C stand for, where the room is asked; answer: the letter that the machine gives. slides:
    the machine comes here by itself, from the step before.
    """

    title: str
    minutes: float
    camera: str
    state: Mapping[str, Any]
    cue: str
    see: str
    ask: str
    holds: Mapping[str, float]
    poll: tuple[str, ...] = ()
    answer: str = ""

    @property
    def slides(self) -> bool:
        """Whether the machine comes to the step's orbit by itself, over an edge."""
        return "ending" in self.state or self.state["orbit"] == DOUBLED

    @property
    def settings(self) -> dict[str, Any]:
        """The state in the units of the scene: eccentricity as a fraction of the gap, legs counted
        from 0.
        """
        own = {"ending": "any", **self.state}
        orbit = own.pop("orbit")
        leg = {} if orbit == DOUBLED else {"leg": int(orbit) - 1}
        return {"static_eccentricity": own.pop("eccentricity") / 100, **leg, **own}


@dataclass(frozen=True)
class RunSheet:
    """A run sheet: its title, its length in minutes, the machine card it is about, its steps."""

    title: str
    minutes: float
    card: str
    steps: tuple[Step, ...]

    def __str__(self) -> str:
        lines = [f"{self.title} ({self.minutes:g} minutes, {self.card})"]
        for number, step in enumerate(self.steps, 1):
            lines += ["", f"{number}. {step.title} ({step.minutes:g} min; view: {step.camera})",
                      f"   Do:  {step.cue}",
                      f"   See: {step.see}", f"   Ask: {step.ask}"]
            lines += [f"        {letter}: {text}{' (so it is)' * (letter == step.answer)}"
                      for letter, text in zip(CHOICES, step.poll, strict=False)]
        return "\n".join(lines)


def load_run_sheet(path: Path) -> RunSheet:
    """Read a run sheet.

    Raises BadInput with the step and the key for a file that is none.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInput(f"{path} cannot be read: {error.strerror}.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadInput(f"{path.name} is not TOML: {error}.") from None
    rows = table.get("step")
    if set(table) != {"title", "minutes", "card", "step"} or not isinstance(rows, list) or not rows:
        raise BadInput(f"{path.name} has {', '.join(table) or 'nothing'}; "
                       "a run sheet has title, minutes, card and one or more [[step]].")
    state, steps = dict(START), []
    for number, row in enumerate(rows, 1):
        where = f"{path.name}, step {number}"
        _check_step(where, row)
        state = {name: value for name, value in state.items() if name != "ending"}
        state |= row.get("set", {})
        steps.append(Step(minutes=row["minutes"], state=state, holds=row.get("holds", {}),
                          poll=tuple(row.get("poll", ())), answer=row.get("answer", ""),
                          **{w: row[w] for w in WORDS}))
    total = sum(step.minutes for step in steps)
    if not math.isclose(total, table["minutes"]):
        raise BadInput(f"{path.name}: minutes is {table['minutes']}, but its steps take {total:g}.")
    return RunSheet(str(table["title"]), total, str(table["card"]), tuple(steps))


def _check_step(where: str, row: Any) -> None:
    """Raise BadInput where a step lacks something, or has it in another form or out of range."""
    if not isinstance(row, dict) or (strange := set(row) - PARTS):
        what = ", ".join(sorted(strange)) if isinstance(row, dict) else row
        raise BadInput(f"{where}: {what!r} is no part of a step.")
    for word in WORDS:
        if not isinstance(row.get(word), str) or not row[word].strip():
            raise BadInput(f"{where}: {word} is {row.get(word)!r}; give a sentence.")
    if row["camera"] not in VIEWS:
        raise BadInput(f"{where}: camera is {row['camera']!r}; there are {', '.join(VIEWS)}.")
    if not _is_number(row.get("minutes")) or not 0 < row["minutes"] <= 180:
        raise BadInput(f"{where}: minutes is {row.get('minutes')!r}; give a number above 0.")
    _check_poll(where, row)
    for part, trouble in (("set", _not_to_be_set), ("holds", _not_to_be_held)):
        table = row.get(part, {})
        if not isinstance(table, dict):
            raise BadInput(f"{where}: {part} is {table!r}; give a table, {{ eccentricity = 5.0 }} "
                           "for instance.")
        for name, value in table.items():
            if wrong := trouble(name, value):
                raise BadInput(f"{where}: {wrong}.")


def _check_poll(where: str, row: dict[str, Any]) -> None:
    """Raise BadInput where a poll has not three texts and one answer."""
    poll = row.get("poll", [])
    if not isinstance(poll, list) or len(poll) not in (0, 3) or not all(
            isinstance(text, str) and text.strip() for text in poll):
        raise BadInput(f"{where}: poll is {poll!r}; give three texts, for A, B and C.")
    if ("answer" in row) != bool(poll) or (poll and row["answer"] not in tuple(CHOICES)):
        raise BadInput(f"{where}: answer is {row.get('answer')!r}; a poll has one, A, B or C.")


def _not_to_be_set(name: str, value: Any) -> str:
    """What is wrong with a setting of a step; nothing where it can be set."""
    if name in SWITCHES:
        return "" if isinstance(value, bool) else f"{name} is {value!r}; give true or false"
    if name == "ending":
        return "" if value in ENDINGS else f"ending is {value!r}; there are {', '.join(ENDINGS)}"
    if name not in NUMBERS:
        return f"{name} cannot be set; there are {', '.join([*NUMBERS, *SWITCHES, 'ending'])}"
    if name == "orbit" and value == DOUBLED:
        return ""
    low, high = NUMBERS[name]
    if not _is_number(value) or not low <= value <= high:
        return f"{name} is {value!r}; give a number from {low:g} to {high:g}"
    whole = name != "orbit" or value == int(value)
    return "" if whole else f"{name} is {value!r}; give a whole number"


def _not_to_be_held(name: str, value: Any) -> str:
    """What is wrong with a number that is to hold; nothing where it can be computed again."""
    if name in FACTS and _is_number(value):
        return ""
    return f"holds {name} = {value!r}; numbers that can be checked are {', '.join(FACTS)}"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
