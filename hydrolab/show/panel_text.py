"""The words of the 3D panel, as HTML: the big number with its reading, and the steps of a run sheet."""

from __future__ import annotations

import math
from html import escape

from hydrolab.show.run_sheet import RunSheet, Step


def big_number(smallest_gap: float, reading: str) -> str:
    """The smallest gap (m, inf where there is none), large, and the reading, which a screen reader says when it changes."""
    number = "" if not math.isfinite(smallest_gap) else (
        f'<div style="font-size: 2.7em; font-weight: 600; line-height: 1.1">{1e3 * smallest_gap:.2f}'
        '<span style="font-size: 0.5em"> mm</span></div><div style="opacity: 0.75">smallest gap</div>')
    return (f'<div style="padding: 0.6em 0.9em 0.3em">{number}<div role="status" aria-live="polite" '
            f'style="font-size: 0.85em; line-height: 1.45; margin-top: 0.5em">{escape(reading)}</div></div>')


def room_words(step: Step) -> str:
    """What the room reads of a step: its title and the question."""
    return (f'<div style="padding: 0.2em 0.9em 0.6em; line-height: 1.4"><b>{escape(step.title)}</b>'
            f"<div>{escape(step.ask)}</div></div>")


def presenter_words(sheet: RunSheet, place: int) -> str:
    """What the presenter reads of a step beside its question: where it is in the sheet, what to do, what is to be seen."""
    step = sheet.steps[place]
    before = sum(earlier.minutes for earlier in sheet.steps[:place])
    rows = "".join(f'<div style="margin-top: 0.5em"><b>{name}</b> {escape(text)}</div>'
                   for name, text in (("Do", step.cue), ("See", step.see)))
    where = (f"{escape(sheet.title)}: step {place + 1} of {len(sheet.steps)}, "
             f"minute {before:g} to {before + step.minutes:g} of {sheet.minutes:g}")
    return f'<div style="padding: 0.2em 0.9em 0.5em; font-size: 0.9em; line-height: 1.4">{where}{rows}</div>'
