"""`hydrolab exam`: an exam drawn from the bank in the book's folder `instructor/exam`, for each
student with other numbers, statements and solutions apart.

The bank is no part of what is installed: without the project's folder there is none to read. A
problem is a function from a `random.Random` to a `Problem`; the same seed draws the same exam, so
that `hydrolab grade FOLDER --exam exam.json` computes what was asked of whom again.

ask: the question's words. right, choices: the answer, the words to choose from. rubric: points with
what earns them. draw, problems: a problem's function, such functions by name. seed, student,
students, minutes, chapters: of the draw. book, out: folders. count: how many. title: a heading.
"""

from __future__ import annotations

import json
import runpy
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from hydrolab.course.answers import Exercise, Mistake
from hydrolab.course.checks import judge
from hydrolab.course.refresh import clean, text
from hydrolab.errors import BadInput

Rubric = tuple[tuple[int, str], ...]
LETTERS = "abcdefgh"
RULES = ("Write each answer into its line, a number in the unit asked for or one of the words; "
         "arithmetic with numbers may stand there too. Reasons, sketches and derivations go into "
         "a cell below the question, or on paper.")


@dataclass(frozen=True)
class Part:
    """A question of a problem: what is asked, each thing that earns points, and, where a number or
    a word is asked for, its exercise.
    """

    ask: str
    rubric: Rubric
    answer: Exercise | None = None

    @property
    def points(self) -> int:
        """What a full answer earns."""
        return sum(points for points, _ in self.rubric)


@dataclass(frozen=True)
class Problem:
    """A problem with its numbers: the chapters that it examines, the minutes that it takes, the
    situation in words and the questions.
    """

    title: str
    chapters: tuple[int, ...]
    minutes: int
    situation: str
    parts: tuple[Part, ...]

    @property
    def points(self) -> int:
        """What a full answer to all questions earns."""
        return sum(part.points for part in self.parts)


Draw = Callable[[Random], Problem]


def number(ask: str, right: float, unit: str, *rubric: tuple[int, str], rtol: float = 0.01,
           mistakes: Mapping[float, str] | None = None) -> Part:
    """A question for a number of a unit, right within rtol; mistakes: hints by wrong number."""
    known = tuple(Mistake(lambda _, wrong=wrong: wrong, hint)
                  for wrong, hint in (mistakes or {}).items())
    return Part(ask, rubric, Exercise(lambda: float(right), "the problem", unit, rtol,
                                      mistakes=known))


def word(ask: str, right: str, choices: Sequence[str], *rubric: tuple[int, str]) -> Part:
    """A question for one of several words."""
    return Part(ask, rubric, Exercise(lambda: right, "the problem", choices=tuple(choices)))


def reasons(ask: str, *rubric: tuple[int, str]) -> Part:
    """A question for a derivation or a judgement, which a person reads."""
    return Part(ask, rubric)


def bank(book: Path) -> dict[str, Draw]:
    """Every problem of the bank beside a book, by its name; raises BadInput where there is none."""
    found: dict[str, Draw] = {}
    for path in sorted((book / "instructor" / "exam").glob("*.py")):
        found |= {draw.__name__: draw for draw in runpy.run_path(str(path))["PROBLEMS"]}
    if not found:
        raise BadInput("The problems for exams are not installed with hydrolab; run this in the "
                       "project's own folder.")
    return found


def drawn(draw: Draw, seed: int, student: str) -> Problem:
    """The problem as one student gets it."""
    return draw(Random(f"{seed}/{draw.__name__}/{student}"))


def chosen(problems: Mapping[str, Draw], seed: int, minutes: int,
           chapters: Iterable[int] = ()) -> list[str]:
    """Names of problems that fill the minutes, of the chapters taught (none: all), from as many
    chapters as can be; raises BadInput where no problem fits.
    """
    taught, names = set(chapters), sorted(problems)
    Random(seed).shuffle(names)
    sample = {name: drawn(problems[name], seed, "") for name in names}
    fitting = [name for name in names if not taught or set(sample[name].chapters) <= taught]
    taken: list[str] = []
    seen: set[int] = set()
    for again in (False, True):  # first those of chapters that are not examined yet
        for name in fitting:
            problem = sample[name]
            fresh = name not in taken and (again or not seen & set(problem.chapters))
            if fresh and sum(sample[t].minutes for t in taken) + problem.minutes <= minutes:
                taken.append(name)
                seen |= set(problem.chapters)
    if not taken:
        raise BadInput(f"No problem of chapters {sorted(taught) or 'of the book'} takes at most "
                       f"{minutes} minutes; allow more, or name more chapters.")
    return sorted(taken, key=lambda name: sample[name].chapters)


def statement(problems: Sequence[Problem], title: str) -> str:
    """The text of a notebook with the questions and a line for each answer."""
    cells = [_cell("markdown", f"# {title}\n\n{RULES}")]
    for k, problem in enumerate(problems, 1):
        cells.append(_cell("markdown", f"## {k}. {problem.title} ({problem.points} points, about "
                           f"{problem.minutes} minutes)\n\n{problem.situation}"))
        for letter, part in zip(LETTERS, problem.parts, strict=False):
            cells.append(_cell("markdown", f"**{k}{letter}** ({part.points}) {part.ask}"))
            if part.answer:
                wanted = part.answer.unit or ", ".join(map(repr, part.answer.choices))
                cells.append(_cell("code", f"answer_{k}{letter} = ...  # {wanted}"))
    return text(clean({"cells": cells}))


def _cell(kind: str, source: str) -> dict[str, Any]:
    return {"cell_type": kind, "source": source, "metadata": {}}


def solution(problems: Sequence[Problem], title: str) -> str:
    """The answers with what earns points, as Markdown; raises BadInput for an answer that its own
    check refuses.
    """
    lines = [f"# {title}: solutions"]
    for k, problem in enumerate(problems, 1):
        lines += [f"## {k}. {problem.title} ({problem.points} points)", problem.situation]
        for letter, part in zip(LETTERS, problem.parts, strict=False):
            lines.append(f"**{k}{letter}** ({part.points}) {part.ask}")
            if part.answer is not None:
                right = part.answer.right()
                if (verdict := judge(part.answer, right)).found != "right":
                    raise BadInput(f"{problem.title}, {letter}: its own answer {right} is refused: "
                                   f"{verdict.said}")
                value = f"{right:.5g}" if isinstance(right, float) else str(right)
                lines.append(f"**{f'{value} {part.answer.unit}'.strip()}**")
            lines.append("\n".join(f"- ({points}) {words}" for points, words in part.rubric))
    return "\n\n".join(lines) + "\n"


def write_exam(book: Path, out: Path, seed: int, students: Sequence[str], minutes: int,
               chapters: Iterable[int] = ()) -> str:
    """Draw an exam and write statements, solutions and what grading needs into an empty folder;
    return one sentence. Raises BadInput where the folder holds anything.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BadInput(f"--out is {out}, which is not an empty folder; name a new one.")
    problems = bank(book)
    names = chosen(problems, seed, minutes, chapters)
    for kind in ("statements", "solutions"):
        (out / kind).mkdir(parents=True)
    for student in students:
        theirs = [drawn(problems[name], seed, student) for name in names]
        for path, words in ((out / "statements" / f"{student}.ipynb", statement(theirs, student)),
                            (out / "solutions" / f"{student}.md", solution(theirs, student))):
            path.write_text(words, encoding="utf-8", newline="\n")
    (out / "exam.json").write_text(json.dumps({"seed": seed, "problems": names}),
                                   encoding="utf-8")
    points = sum(problem.points for problem in theirs)
    return (f"{len(names)} problems of {points} points for {len(students)} students are in {out}: "
            f"{', '.join(problem.title for problem in theirs)}. Hand out statements, keep the "
            "rest; `hydrolab grade FOLDER --exam exam.json` reads what comes back.")


def asked_of(book: Path, exam: Path, student: str) -> dict[str, tuple[Exercise, int]]:
    """What the exam of a file exam.json asked of a student for a number or a word: exercise and
    points by label, "1a".
    """
    try:
        kept = json.loads(exam.read_text(encoding="utf-8"))
        seed, names = kept["seed"], kept["problems"]
    except (OSError, ValueError, KeyError, TypeError):
        raise BadInput(f"{exam} is no exam.json that `hydrolab exam` wrote.") from None
    problems = bank(book)
    if missing := [name for name in names if name not in problems]:
        raise BadInput(f"The bank has no {', '.join(missing)} any more; grade with the version "
                       "that drew the exam.")
    theirs = [drawn(problems[name], seed, student) for name in names]
    return {f"{k}{letter}": (part.answer, part.points) for k, problem in enumerate(theirs, 1)
            for letter, part in zip(LETTERS, problem.parts, strict=False) if part.answer}


def read_students(path: Path | None, count: int) -> list[str]:
    """Names of students, one a line of a file; or, without one, as many numbers."""
    if path is None:
        return [f"{k:02d}" for k in range(1, count + 1)]
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        raise BadInput(f"--students is {path}, which cannot be read; give a text file with a name "
                       "a line.") from None
    names = [line.strip() for line in lines if line.strip()]
    bad = [name for name in names if any(c in '/\\:*?"<>|' for c in name) or name.startswith(".")]
    if bad or not names or len(set(map(str.casefold, names))) < len(names):
        raise BadInput(f"--students is {path}; it must hold names that differ, one a line, each "
                       f"good as a file's name{': not ' + repr(bad[0]) if bad else ''}.")
    return names
