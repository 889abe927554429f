"""The exercises, one file a chapter in the book's folder `exercises` (`ch02.py` for chapter 2),
each with a dictionary `EXERCISES` by number.
"""

from __future__ import annotations

import sys
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

from hydrolab.course.answers import Exercise
from hydrolab.errors import BadInput

__all__ = ["chapters", "exercise"]
PACKAGE = Path(__file__).resolve().parents[1]


def files() -> dict[int, Path]:
    """The file of each chapter: in the clone, or in the copy that an installed wheel carries."""
    places = [PACKAGE.parent / "book" / "exercises", PACKAGE / "_book" / "exercises"]
    folder = next((place for place in places if place.is_dir()), places[0])
    return {int(path.stem[2:]): path for path in sorted(folder.glob("ch[0-9][0-9].py"))}


@cache
def _of(path: Path) -> dict[str, Exercise]:
    spec = spec_from_file_location(f"hydrolab_exercises_{path.stem}", path)
    module = module_from_spec(spec)  # type: ignore[arg-type]
    sys.modules[spec.name] = module  # type: ignore[union-attr]
    spec.loader.exec_module(module)  # type: ignore[union-attr]
    return module.EXERCISES


def chapters() -> dict[int, dict[str, Exercise]]:
    """The exercises of every chapter that has some, by chapter and number."""
    return {number: _of(path) for number, path in files().items()}


def exercise(number: str) -> Exercise:
    """The exercise of a number such as "2.1" or, where it asks for several answers, "2.1a".

    Raises BadInput where there is none.
    """
    chapter = str(number).split(".")[0]
    path = files().get(int(chapter)) if chapter.isascii() and chapter.isdigit() else None
    of_chapter = _of(path) if path else {}
    if number not in of_chapter:
        known = (f"chapter {chapter} has {', '.join(of_chapter)}" if of_chapter
                 else f"no chapter {chapter!r} has checks")
        raise BadInput(f"There is no exercise {number!r} to check; {known}.")
    return of_chapter[number]
