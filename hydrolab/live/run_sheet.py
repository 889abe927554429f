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

from hydrolab.dynamics.harmonics import ellipse
from hydrolab.errors import BadInput
from hydrolab.explorers.legs import Legs, legs_of
from hydrolab.live.moving_orbit import FIELDS, UNBALANCES
from hydrolab.machine.cards import load_machine, vary
from hydrolab.machine.parts import Machine

VIEWS = ("machine", "air gap", "lower end")
SWITCHES = ("playing", "names", "dark")
NUMBERS = {"eccentricity": (0.0, 100.0), "orbit": (1, 9), "field": FIELDS, "unbalance": UNBALANCES,
           "exaggeration": (1.0, 1000.0), "slow_motion": (1.0, 100.0)}
WORDS = ("title", "camera", "cue", "see", "ask")
START = {"eccentricity": 0.0, "orbit": 1, "field": 1.0, "unbalance": 1.0, "playing": True}
# What `facts` computes and a step may hold.
FACTS = ("orbits", "stable_orbits", "first_um", "across_um", "mean_um", "second_percent",
         "axes_ratio", "smallest_gap_mm", "gap_mm", "offset_um", "fold_percent",
         "second_fold_percent", "third_fold_percent", "speed_rpm")


@dataclass(frozen=True)
class Step:
    """One step of a run sheet. `state` is everything that was set up to here, in the units of the
    sheet.

    see: what the room should see; holds: the numbers in it, which a test computes again (see
    `facts`).
    """

    title: str
    minutes: float
    camera: str
    state: Mapping[str, Any]
    cue: str
    see: str
    ask: str
    holds: Mapping[str, float]

    @property
    def settings(self) -> dict[str, Any]:
        """The state in the units of the scene: eccentricity as a fraction of the gap, legs counted
        from 0.
        """
        own = dict(self.state)
        return {"static_eccentricity": own.pop("eccentricity") / 100,
                "leg": int(own.pop("orbit")) - 1, **own}


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
        state = state | row.get("set", {})
        steps.append(Step(minutes=row["minutes"], state=state, holds=row.get("holds", {}),
                          **{w: row[w] for w in WORDS}))
    total = sum(step.minutes for step in steps)
    if not math.isclose(total, table["minutes"]):
        raise BadInput(f"{path.name}: minutes is {table['minutes']}, but its steps take {total:g}.")
    return RunSheet(str(table["title"]), total, str(table["card"]), tuple(steps))


def _check_step(where: str, row: Any) -> None:
    """Raise BadInput where a step lacks something, or has it in another form or out of range."""
    if not isinstance(row, dict) or (strange := set(row) - {*WORDS, "minutes", "set", "holds"}):
        what = ", ".join(sorted(strange)) if isinstance(row, dict) else row
        raise BadInput(f"{where}: {what!r} is no part of a step.")
    for word in WORDS:
        if not isinstance(row.get(word), str) or not row[word].strip():
            raise BadInput(f"{where}: {word} is {row.get(word)!r}; give a sentence.")
    if row["camera"] not in VIEWS:
        raise BadInput(f"{where}: camera is {row['camera']!r}; there are {', '.join(VIEWS)}.")
    if not _is_number(row.get("minutes")) or not 0 < row["minutes"] <= 180:
        raise BadInput(f"{where}: minutes is {row.get('minutes')!r}; give a number above 0.")
    for part, trouble in (("set", _not_to_be_set), ("holds", _not_to_be_held)):
        table = row.get(part, {})
        if not isinstance(table, dict):
            raise BadInput(f"{where}: {part} is {table!r}; give a table, {{ eccentricity = 5.0 }} "
                           "for instance.")
        for name, value in table.items():
            if wrong := trouble(name, value):
                raise BadInput(f"{where}: {wrong}.")


def _not_to_be_set(name: str, value: Any) -> str:
    """What is wrong with a setting of a step; nothing where it can be set."""
    if name in SWITCHES:
        return "" if isinstance(value, bool) else f"{name} is {value!r}; give true or false"
    if name not in NUMBERS:
        return f"{name} cannot be set; there are {', '.join([*NUMBERS, *SWITCHES])}"
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


def sheet_machine(sheet: RunSheet, step: Step) -> Machine:
    """The machine of a step: the sheet's card with the step's field and unbalance.

    Raises BadInput for a card that there is not.
    """
    machine = load_machine(sheet.card)
    return vary(machine, {"field": step.state["field"] * machine.air_gap.field,
                          "unbalance": step.state["unbalance"]})


def facts(machine: Machine, step: Step, legs: Legs | None = None) -> dict[str, float]:
    """Everything a step may hold, computed: numbers of steady states, the shape of the one shown,
    the folds.

    first, across: 1X in x and z, 0 to peak. axes_ratio: of the 1X ellipse, short to long. legs: of
    this machine, if known. Raises BadInput where the step's orbit does not exist at its
    eccentricity.
    """
    legs = legs or legs_of(machine)
    eccentricity, leg = step.state["eccentricity"] / 100, int(step.state["orbit"]) - 1
    orbit = legs.orbit(eccentricity, leg)
    if orbit is None:
        raise BadInput(f"Step {step.title!r}: there is no orbit {leg + 1} at "
                       f"{step.state['eccentricity']:g} %.")
    there = {i: found for i in range(len(legs.all))
             if (found := legs.orbit(eccentricity, i)) is not None}
    first = ellipse(orbit.coefficients, 1)
    folds = [100 * fold.value for fold in legs.branch.folds] + [math.nan] * 3
    return {
        "orbits": len(there),
        "stable_orbits": sum(legs.verdict(found, i) == "stable" for i, found in there.items()),
        "first_um": 1e6 * float(orbit.amplitudes[0, 0]),
        "across_um": 1e6 * float(orbit.amplitudes[1, 0]),
        "mean_um": 1e6 * math.hypot(*orbit.mean),
        "second_percent": 100 * orbit.second_share,
        "axes_ratio": first.minor / first.major if first.major else math.nan,
        "smallest_gap_mm": 1e3 * orbit.smallest_gap, "gap_mm": 1e3 * machine.air_gap.gap,
        "offset_um": 1e6 * eccentricity * machine.air_gap.gap,
        "fold_percent": folds[0], "second_fold_percent": folds[1], "third_fold_percent": folds[2],
        "speed_rpm": machine.speed * 30 / math.pi,
    }
