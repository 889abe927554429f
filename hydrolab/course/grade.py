"""`hydrolab grade FOLDER`: what a class has handed in, student by exercise, and which mistakes were
made how often; with `--exam exam.json` an exam, in points.

Nothing of a student's is executed. Of a cell with `check("2.1", name)` the value of `name` is read
where it is written down: a number, a text, a list or a dictionary of such, with + − * / ** between
numbers, `pi`, `sqrt(…)`, and names given such a value earlier in the cell. Where it is computed by
other code, what `check` printed in the returned notebook is taken, and marked: a student can type
there what they like. Of an exam the lines `answer_1a = …` are read in the same way.
"""

from __future__ import annotations

import ast
import csv
import math
import operator
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydrolab.course.answers import Exercise, chapters
from hydrolab.course.checks import judge
from hydrolab.course.exam import asked_of
from hydrolab.course.refresh import Cell, read
from hydrolab.errors import BadInput

OPERATIONS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
              ast.Div: operator.truediv, ast.USub: operator.neg, ast.UAdd: operator.pos}
MARKS = {"open": "o", "unanswered": "-", "unread": "?"}  # every other verdict is "0"
KEY = ("0 not right, o open: read it, - not answered, ? not in the limited form: read it, * as the "
       "notebook itself says.")
LARGEST = 1e4  # of an exponent: a returned file must not keep the grader busy


class Unreadable(ValueError):
    """A value that is not written down in the limited form."""


@dataclass(frozen=True)
class Mark:
    """A student's answer to an exercise: how it was found, what was said, whether this was taken
    from the notebook's stored output, and what it is worth if it is right.
    """

    found: str
    said: str
    stored: bool = False
    worth: int = 1

    @property
    def points(self) -> int:
        """What it has earned."""
        return self.worth if self.found == "right" else 0

    def __str__(self) -> str:
        return (str(self.points) if self.points else MARKS.get(self.found, "0")) + "*" * self.stored


def value_of(node: ast.expr, known: dict[str, Any]) -> Any:
    """The value of an expression (node) in the limited form with known names; else Unreadable."""
    if isinstance(node, ast.Constant):
        return node.value
    if isinstance(node, ast.List | ast.Tuple):
        return [value_of(entry, known) for entry in node.elts]
    if isinstance(node, ast.Dict):
        return {value_of(key, known): value_of(value, known)
                for key, value in zip(node.keys, node.values, strict=True) if key}
    if isinstance(node, ast.Name) and known.get(node.id, Unreadable) is not Unreadable:
        return known[node.id]
    return _computed(node, known)


def _computed(node: ast.expr, known: dict[str, Any]) -> float:
    """What arithmetic gives."""
    if ast.unparse(node) in ("math.pi", "np.pi", "pi"):
        return math.pi
    if isinstance(node, ast.Call) and len(node.args) == 1 and ast.unparse(node.func) in (
            "sqrt", "math.sqrt", "np.sqrt"):
        return math.sqrt(number_of(node.args[0], known))
    if isinstance(node, ast.UnaryOp) and type(node.op) in OPERATIONS:
        return OPERATIONS[type(node.op)](number_of(node.operand, known))
    if isinstance(node, ast.BinOp):
        a, b = number_of(node.left, known), number_of(node.right, known)
        if isinstance(node.op, ast.Pow) and abs(b) <= LARGEST:
            return float(a) ** b
        if type(node.op) in OPERATIONS:
            return OPERATIONS[type(node.op)](a, b)
    raise Unreadable(ast.unparse(node)[:40])


def number_of(node: ast.expr, known: dict[str, Any]) -> float:
    """The value of an expression (node), with names that are known, that must be a number."""
    value = value_of(node, known)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Unreadable(ast.unparse(node)[:40])
    return value


def checked(cell: Cell) -> Iterator[tuple[str, Any]]:
    """The exercises that a cell checks and the parts of an exam that it answers, each with its
    value, or Unreadable in its place.
    """
    known: dict[str, Any] = {}
    try:
        statements = ast.parse(cell["source"]).body
    except (SyntaxError, ValueError, RecursionError):
        return
    for statement in statements:
        if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
            name = statement.targets[0].id
            known[name] = _value_or_not(statement.value, known)
            if name.startswith("answer_"):
                yield name.removeprefix("answer_"), known[name]
        call = statement.value if isinstance(statement, ast.Expr) else None
        if isinstance(call, ast.Call) and ast.unparse(call.func) == "check" and len(call.args) == 2:
            number, answer = call.args
            if isinstance(number, ast.Constant):
                yield str(number.value), _value_or_not(answer, known)


def _value_or_not(node: ast.expr, known: dict[str, Any]) -> Any:
    """The value of an expression in the limited form, or Unreadable."""
    try:
        return value_of(node, known)
    except (ValueError, ArithmeticError, TypeError, RecursionError):
        return Unreadable


def printed(cell: Cell, number: str) -> Mark:
    """What the stored output of a cell says of the exercise of a number."""
    text = "".join(str(output.get("text", "")) for output in cell.get("outputs", []))
    said = next((line.split(": ", 1)[1] for line in text.splitlines()
                 if line.startswith(f"{number}: ")), "not answered yet")
    kinds = {"right.": "right", "noted": "open", "not answered": "unanswered"}
    found = next((kind for words, kind in kinds.items() if said.startswith(words)), "wrong")
    return Mark(found, said, stored=True)


Asked = Mapping[str, tuple[Exercise, int]]  # exercise and points by number


def marks(path: Path, asked: Asked) -> dict[str, Mark]:
    """Every exercise of those asked that the returned notebook at a path answers, by number."""
    return {number: _mark(cell, number, value, *asked[number]) for cell in read(path)["cells"]
            for number, value in (checked(cell) if cell["cell_type"] == "code" else ())
            if number in asked}


def _mark(cell: Cell, number: str, value: Any, asked: Exercise, worth: int) -> Mark:
    if value is Unreadable:
        return (Mark("unread", "computed by other code") if f"check({number!r}" not in
                cell["source"].replace('"', "'") else printed(cell, number))
    try:
        verdict = judge(asked, value)
    except Exception:  # an open question's reply to an answer of any shape
        return Mark("wrong", "an answer that could not be judged")
    return Mark(verdict.found, verdict.said, worth=worth)


def handed_in(folder: Path, asked: Callable[[str], Asked]) -> dict[str, dict[str, Mark]]:
    """Students, each a folder below the folder or a notebook in it, with their marks; `asked` says
    what a student was asked.

    Raises BadInput where there is no notebook.
    """
    students: dict[str, dict[str, Mark]] = {}
    for path in sorted(folder.rglob("*.ipynb")):
        relative = path.relative_to(folder)
        if ".ipynb_checkpoints" not in relative.parts:
            name = relative.parts[0] if len(relative.parts) > 1 else path.stem
            students.setdefault(name, {}).update(marks(path, asked(name)))
    if not students:
        raise BadInput(f"{folder} holds no notebook; give the folder with what was handed in, a "
                       "folder or a notebook for each student.")
    return students


def report(folder: Path, exam: Path | None = None, book: Path = Path()) -> str:
    """Write `grades.csv` into a folder with what was handed in, and say it in words: student by
    exercise, sums, mistakes by how often they were made. exam: the file exam.json of the exam that
    it is, drawn from the bank beside a book.
    """
    course = {number: (asked, 1) for of_chapter in chapters().values()
              for number, asked in of_chapter.items()}
    students = handed_in(folder, lambda name: asked_of(book, exam, name) if exam else course)
    everything = asked_of(book, exam, next(iter(students))) if exam else course
    asked = [number for number in everything if any(number in had for had in students.values())]
    head = ["student", *asked, "sum"]
    rows = [head, *([name, *(str(had.get(number, "-")) for number in asked),
                     str(sum(mark.points for mark in had.values()))]
                    for name, had in students.items())]
    with open(folder / "grades.csv", "w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(rows)
    wide = max(len(row[0]) for row in rows)
    table = [" ".join([row[0].ljust(wide), *(entry.rjust(max(4, len(top))) for top, entry
                                             in zip(head[1:], row[1:], strict=True))])
             for row in rows]
    slips = Counter((number, mark.said) for had in students.values()
                    for number, mark in had.items() if mark.found in ("mistake", "unit"))
    lines = [f"{count:3d} × {number}: {said}" for (number, said), count in slips.most_common()]
    points = (f"Of {sum(worth for _, worth in everything.values())} points that a check can give; "
              if exam else "1 right, ")
    return "\n".join([*table, "", points + KEY,
                      *(["", "Mistakes, the most frequent first:"] * bool(lines)), *lines, "",
                      f"{folder / 'grades.csv'} has the same table."])
