"""No exercise's number stands in the book before it is asked, and predictions come before what
answers them.
"""

import math
import re
from pathlib import Path

import pytest

from hydrolab.course import answers as exercises
from hydrolab.course import refresh as notebooks

BOOK = Path(__file__).resolve().parents[2] / "book"
NOTEBOOKS = {int(path.name[:2]): notebooks.without_pixels(notebooks.read(path))
             for path in sorted(BOOK.glob("[0-9]*.ipynb"))}
NUMBER = re.compile(r"(?<![\w.])[-−+]?(\d+(?:[.,]\d+)*)(?:e([-+]?\d+))?")
CLOSED = {number: asked for of_chapter in exercises.chapters().values()
          for number, asked in of_chapter.items() if asked.reply is None}


def shown(cell: notebooks.Cell) -> str:
    """What a reader sees of a cell: its text, or what it put out."""
    if cell["cell_type"] == "markdown":
        return cell["source"]
    return "\n".join(output.get("text", "") + output.get("data", {}).get("text/plain", "")
                     for output in cell["outputs"])


def before(number: str) -> str:
    """All that is shown before the cell that checks an exercise; its question may hold numbers."""
    chapter, text = int(number.split(".")[0]), []
    for at in range(chapter + 1):
        for cell in NOTEBOOKS.get(at, {"cells": []})["cells"]:
            if at == chapter and f'check("{number}"' in cell["source"]:
                return "\n".join(text[:-1])
            text.append(shown(cell))
    raise AssertionError(f"{number} is checked nowhere")


def same(printed: float, wanted: float) -> bool:
    """Whether two numbers have the same four digits, whatever the prefix of their units."""
    ratio = printed / wanted
    return math.isclose(ratio / 1e3 ** round(math.log(ratio, 1e3)), 1, rel_tol=5e-4)


def asked_for() -> list:
    """Exercises with a number that a coincidence would not meet: no small count."""
    return [pytest.param(number, abs(value), id=number) for number, asked in CLOSED.items()
            if isinstance(value := asked.right(), float) and value
            and not (value == round(value) and abs(value) < 1000)
            and float(f"{value:.1e}") != value]


@pytest.mark.parametrize(("number", "value"), asked_for())
def test_no_exercise_is_answered_before_it_is_asked(number, value):
    for found in NUMBER.finditer(before(number)):
        plain = found[1].replace(",", "")
        if len(plain.replace(".", "").lstrip("0")) >= 4 and plain.count(".") < 2:
            printed = float(plain) * 10 ** int(found[2] or 0)
            assert not same(printed, value), f"{found[0]} answers {number}"


@pytest.mark.parametrize("chapter", NOTEBOOKS)
def test_predictions_come_before_what_answers_them(chapter):
    """Of text and outputs above the predictions none holds the answer, to three digits."""
    cells = NOTEBOOKS[chapter]["cells"]
    at = next(i for i, cell in enumerate(cells) if "\npredict(" in f"\n{cell['source']}")
    above = "\n".join(shown(cell) for cell in cells[:at])
    told = "\n".join(shown(cell) for cell in cells[at + 1:])
    for name, value in re.findall(r"^(\d+[a-z]): Computed: −?([\d.]*\d)", told, re.MULTILINE):
        if len(value.replace(".", "").lstrip("0")) >= 3:
            assert value not in above, f"{value} answers {name}"
