"""The report on a unit: one page that asks no other computer for anything and prints cleanly.

a: the assessment. card: its name or path. out: where it is written.
"""

from __future__ import annotations

import base64
import html
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from hydrolab import __version__
from hydrolab.dynamics.probes import read_record
from hydrolab.errors import BadInput
from hydrolab.figures.orbits import branch_picture, orbit_picture
from hydrolab.figures.orders import record_picture, run_picture
from hydrolab.figures.picture import Picture
from hydrolab.figures.rotor import line_picture, unit_picture
from hydrolab.machine.cards import load_machine
from hydrolab.paper.assessment import (
    AT_TOLERANCE,
    Answer,
    Assessment,
    Limit,
    assess,
    balance_answers,
    bearing_answers,
    critical_answers,
    gap_answers,
    rpm_words,
    worst_answers,
)
from hydrolab.paper.report import SCHEMA, machine_record, prepare, write
from hydrolab.progress import progress_bars

CLASSES = {True: "kept", False: "broken", None: ""}
STRAIGHT = 1e-9  # m or rad: a mean line that is nearer to the axis is not drawn
SHOWN = 1.5  # times the highest of the speeds: critical speeds up to there are listed
SILENT = (
    "The pull is that of the air gap alone: currents that it drives in parallel windings and "
    "dampers, and saturation of the iron, are left out. Both weaken it.",
    "The water acts by the loads and the added mass on the card; draft-tube surges, blade passing "
    "and cavitation are not computed.",
    "Bearings act by the numbers on the card. How they change with temperature and load is known "
    "only where the card has a table.",
    "A load rejection goes by a schedule of the speed, not by the turbine's characteristic.")


def _line(tag: str, words: str, kind: str = "") -> str:
    """An element of a tag and a class with these words, escaped."""
    named = f' class="{kind}"' if kind else ""
    return f"<{tag}{named}>{html.escape(words)}</{tag}>"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of rows of cells; nothing where there are none."""
    body = "".join(f"<tr>{''.join(row)}</tr>" for row in rows)
    names = "".join(_line("th", name) for name in head)
    return f"<table><thead><tr>{names}</tr></thead><tbody>{body}</tbody></table>" if body else ""


def _cells(row: Iterable[str], first: str = "", last: str = "") -> list[str]:
    """Cells of these texts, with classes of the first and the last."""
    *most, end = row
    return [_line("td", cell, first if not i else "") for i, cell in enumerate(most)] + [
        _line("td", end, last)]


def _answers(answers: Iterable[Answer]) -> str:
    """Questions, what was found, the limit and the verdict."""
    return _table(("asked", "found", "judged by", "verdict"), [
        _cells((one.asked, one.found, one.limit.words, one.verdict), last=CLASSES[one.kept])
        for one in answers])


def _drawn(picture: Picture, kind: str = "") -> str:
    """A picture within the page, with its reading below."""
    data = base64.b64encode(picture.svg()).decode("ascii")
    words = html.escape(picture.reading, quote=True)
    named = f' class="{kind}"' if kind else ""
    return (f'<figure{named}><img alt="{words}" src="data:image/svg+xml;base64,{data}">'
            f"<figcaption>{words}</figcaption></figure>")


def in_short(a: Assessment) -> Iterator[str]:
    """The answers that a reader wants first, as sentences."""
    answers = a.answers()
    judged = [one for one in answers if one.kept is not None]
    broken = [one for one in judged if not one.kept]
    yield (f"{len(judged) - len(broken)} of the {len(judged)} limits that have a number here are "
           f"kept; {len(answers) - len(judged)} answers are left to the plant's and the makers' "
           "own limits.")
    yield from (f"Not kept: {one.asked}: {one.found}. Limit: {one.limit.words}." for one in broken)
    state = "field on" if "field on" in a.criticals else "field off"
    yield from (f"{one.asked}: {one.found}." for one in critical_answers(a)
                if one.asked.endswith(state))
    yield from (f"{one.asked}: {one.found}." for one in gap_answers(a) if "is lost" in one.asked)
    yield from a.troubles


def _the_unit(a: Assessment) -> str:
    """The section through it, and how much of its card is assumed."""
    counts = Counter(entry.source for entry in a.machine.provenance.values())
    said = ", ".join(f"{number} {source}" for source, number in counts.most_common())
    guesses = [f"The {name} is assumed: {rpm_words(a.speeds[name])}." for name in a.assumed]
    words = [f"Numbers on the card by their source: {said}." if said else
             "No number of this machine has a source.", *guesses,
             "Drawn to scale: the generator's rotor by its air gap, any other body as the solid "
             "cylinder of its mass and inertias, a bearing as a sign."]
    return _drawn(unit_picture(a.machine), "tall") + _line("p", " ".join(words))


def _criticals(a: Assessment) -> str:
    """Margins, and the list of critical speeds."""
    top = SHOWN * max(a.speeds.values())
    rows = [(state, rpm_words(s), way, f"{100 * ratio:.1f} %")
            for state, found in a.criticals.items()
            for s, way, ratio in zip(found.speeds, found.direction, found.damping_ratios,
                                     strict=True) if s < top]
    return (_answers(critical_answers(a)) + _line("h3", f"All up to {rpm_words(top)}")
            + _table(("", "speed", "whirl", "damping ratio"), map(_cells, rows))
            + _line("p", "A backward whirl is met by an unbalance only where bearings differ "
                   "between x and z; one that is backward alone is left out of the margins."))


def _steady(a: Assessment) -> str:
    """Where the rotor goes, what is left of the gap, and where its steady states end."""
    side = f"gap angle {math.degrees(a.direction):.0f}°, from z towards x"
    words = f"Out of centre: the stator is moved to {side}." if AT_TOLERANCE in a.orbits else ""
    pictures = [orbit_picture(orbit) for orbit in a.orbits.values()]
    if a.branch is not None:
        whole = len(a.rows) == len(a.branch)
        pictures.append(branch_picture(a.branch, a.stability if whole else None))
    return (_answers(gap_answers(a)) + (_line("p", words) if words else "")
            + "".join(map(_drawn, pictures)))


def _bearings(a: Assessment) -> str:
    """The static line, and what each bearing carries."""
    bent = [orbit for orbit in a.orbits.values() if np.abs(orbit.shaft[:, 0]).max() > STRAIGHT]
    lines = [line_picture(orbit, a.machine) for orbit in bent if a.machine.shaft]
    return "".join(map(_drawn, lines)) + _answers(bearing_answers(a))


def _worst(a: Assessment) -> str:
    """The load rejection over time, and its extremes."""
    if a.run is None:
        return ""
    return _answers(worst_answers(a)) + _drawn(run_picture(a.run), "tall")


def _recorded(a: Assessment) -> str:
    """The record beside the steady state of the card at its speed."""
    if a.record is None or a.recorded is None:
        return ""
    return _drawn(record_picture(a.record, a.recorded)) + _line("p", (
        "The model is the card's, with the stator centred: nothing was fitted to the record. "
        "identify finds the numbers of a card that records tell."))


def _limits(a: Assessment) -> str:
    """Each limit that was used, where it stands and how sure that is."""
    used: dict[Limit, None] = dict.fromkeys(one.limit for one in a.answers())
    return _table(("limit", "source", "how sure"), [_cells((one.words, one.source, one.sure))
                                                    for one in used])


def _sections(a: Assessment) -> Iterator[tuple[str, str]]:
    """Titles and contents, without those that have none."""
    yield "In short", f"<ul>{''.join(_line('li', words) for words in in_short(a))}</ul>"
    yield "The unit", _the_unit(a)
    yield "Critical speeds", _criticals(a)
    yield "Steady states at the rated speed", _steady(a)
    yield "Bearings", _bearings(a)
    yield "The worst minute: a load rejection", _worst(a)
    yield "Beside the record", _recorded(a)
    yield "Balance", _answers(balance_answers(a))
    yield "The limits, and where they stand", _limits(a)
    yield "Every number, and where it comes from", _table(
        ("number", "value", "source", "note"), [_cells(row, "key") for row in a.machine.rows()])
    yield "What this report does not say", f"<ul>{''.join(_line('li', s) for s in SILENT)}</ul>"


def unit_page(a: Assessment) -> str:
    """The report as HTML."""
    machine = a.machine
    body = [_line("h1", machine.title or machine.name),
            _line("p", f"{machine.name} · {rpm_words(a.rated)} · report by hydrolab {__version__}",
                 "under"), _line("p", machine.about) if machine.about else ""]
    body += [_line("h2", title) + content for title, content in _sections(a) if content]
    template = (files("hydrolab.figures") / "unit_page.html").read_text(encoding="utf-8")
    return template.replace("%TITLE%", html.escape(f"Report on {machine.name}")).replace(
        "%BODY%", "\n".join(body))


# ------------------------------------------------------------------ the commands

def _assessed(console: Console, card: str, **more: Any) -> Assessment:
    """The assessment of a card, with progress on a console; more: as of `assess`."""
    machine = load_machine(card)
    with progress_bars(console) as tell:
        return assess(machine, progress=tell, **more)


def report_command(card: str, *, out: Path, record: Path | None = None, **speeds: float) -> int:
    """Write the report on a card into a file and print it in short. record: the CSV of a record;
    speeds: as of `assess`.

    Returns 0. Raises BadInput for a bad card or record, or a file that cannot be written.
    """
    console = Console(markup=False, highlight=False)  # a machine's name may have brackets
    if out.suffix.lower() not in (".html", ".htm"):
        raise BadInput(f"--out is {out}; the report is a page, so its name ends in .html.")
    prepare(out.parent)
    seen = None if record is None else read_record(record)
    a = _assessed(console, card, worst=True, record=seen, **speeds)
    out.write_text(unit_page(a), encoding="utf-8", newline="\n")
    for words in in_short(a):
        console.print(f"• {words}")
    console.print(f"Written to {out}. Open it in a browser; print it there for a PDF.")
    return 0


def unit_record(a: Assessment) -> dict[str, Any]:
    """The content of report.json for a unit that is not the paper's."""
    return {"schema": SCHEMA, "machine": machine_record(a.machine, a.model),
            "answers": [{"asked": one.asked, "found": one.found, "limit": one.limit.words,
                         "source": one.limit.source, "kept": one.kept} for one in a.answers()],
            "not_computed": a.troubles}


def study_unit(card: str, *, out: Path, draw: bool) -> int:
    """Print what an engineer asks of a card's unit, and write it into a folder as report.json and,
    where draw is true, as the page report.html.

    Returns 0. Raises BadInput for a bad card or a folder that cannot be written.
    """
    console = Console(markup=False, highlight=False)
    prepare(out)
    a = _assessed(console, card, worst=draw)
    write(out / "report.json", unit_record(a))
    if draw:
        (out / "report.html").write_text(unit_page(a), encoding="utf-8", newline="\n")
    shown = Table("asked", "found", "judged by", "verdict", show_lines=True, title_justify="left",
                  title=f"What an engineer asks of {a.machine.name}")
    for one in a.answers():
        shown.add_row(one.asked, one.found, one.limit.words, one.verdict)
    console.print(shown)
    for words in a.troubles:
        console.print(words)
    console.print(f"Written to {out}: report.json{' and report.html' * draw}. The paper's claims "
                  "are about the paper's unit: hydrolab study judges them.")
    return 0
