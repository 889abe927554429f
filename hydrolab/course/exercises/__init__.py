"""The exercises, one module a chapter (`ch02` for chapter 2), each with a dictionary `EXERCISES` by
number.
"""

from __future__ import annotations

import importlib
import pkgutil

from hydrolab.course.answers import Exercise
from hydrolab.errors import BadInput

__all__ = ["chapters", "exercise"]


def chapters() -> dict[int, dict[str, Exercise]]:
    """The exercises of every chapter that has some, by chapter and number."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__)
                   if module.name[:2] == "ch")
    return {int(name[2:]): importlib.import_module(f"{__name__}.{name}").EXERCISES
            for name in names}


def exercise(number: str) -> Exercise:
    """The exercise of a number such as "2.1" or, where it asks for several answers, "2.1a".

    Raises BadInput where there is none.
    """
    of_chapter: dict[str, Exercise] = {}
    chapter = str(number).split(".")[0]
    if chapter.isascii() and chapter.isdigit():
        name = f"ch{int(chapter):02d}"
        if any(module.name == name for module in pkgutil.iter_modules(__path__)):
            of_chapter = importlib.import_module(f"{__name__}.{name}").EXERCISES
    if number not in of_chapter:
        known = (f"chapter {chapter} has {', '.join(of_chapter)}" if of_chapter
                 else f"no chapter {chapter!r} has checks")
        raise BadInput(f"There is no exercise {number!r} to check; {known}.")
    return of_chapter[number]
