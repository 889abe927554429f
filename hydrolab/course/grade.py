"""`hydrolab grade FOLDER`: what a class has handed in, student by exercise, and which mistakes were
made how often.

Nothing of a student's is executed. Of a cell with `check("2.1", name)` the value of `name` is read
where it is written down: a number, a text, a list or a dictionary of such, with + − * / ** between
numbers, `pi`, `sqrt(…)`, and names given such a value earlier in the cell. Where it is computed by
other code, what `check` printed in the returned notebook is taken, and marked: a student can type
there what they like.
"""

from __future__ import annotations

import ast
import csv
import math
import operator
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydrolab.course.answers import chapters, exercise
from hydrolab.course.checks import judge
from hydrolab.course.refresh import Cell, read
from hydrolab.errors import BadInput

OPERATIONS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
              ast.Div: operator.truediv, ast.USub: operator.neg, ast.UAdd: operator.pos}
MARKS = {"right": "1", "open": "o", "unanswered": "-"}  # every other verdict is "0"
LARGEST = 1e4  # of an exponent: a returned file must not keep the grader busy


class Unreadable(ValueError):
    """A value that is not written down in the limited form."""


@dataclass(frozen=True)
class Mark:
    """A student's answer to an exercise: how it was found, what was said, and whether this was
    taken from the notebook's stored output.
    """

    found: str
    said: str
    stored: bool = False

    def __str__(self) -> str:
        return MARKS.get(self.found, "0") + "*" * self.stored


def value_of(node: ast.expr, known: dict[str, Any]) -> Any:
    """The value of an expression (node) in the limited form with known names; else Unreadable."""
    if isinstance(node, ast.Constant):
        return node.value
    if isinstance(node, ast.List | ast.Tuple):
        return [value_of(entry, known) for entry in node.elts]
    if isinstance(node, ast.Dict):
        return {value_of(key, known): value_of(value, known)
                for key, value in zip(node.keys, node.values, strict=True) if key}
    if isinstance(node, ast.Name) and node.id in known:
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
    """The exercises that a cell checks, each with its value, or Unreadable in its place."""
    known: dict[str, Any] = {}
    try:
        statements = ast.parse(cell["source"]).body
    except (SyntaxError, ValueError, RecursionError):
        return
    for statement in statements:
        if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
            known.pop(statement.targets[0].id, None)
            try:
                known[statement.targets[0].id] = value_of(statement.value, known)
            except (ValueError, ArithmeticError, TypeError, RecursionError):
                continue
        call = statement.value if isinstance(statement, ast.Expr) else None
        if isinstance(call, ast.Call) and ast.unparse(call.func) == "check" and len(call.args) == 2:
            number, answer = call.args
            if isinstance(number, ast.Constant):
                try:
                    yield str(number.value), value_of(answer, known)
                except (ValueError, ArithmeticError, TypeError, RecursionError):
                    yield str(number.value), Unreadable


def printed(cell: Cell, number: str) -> Mark:
    """What the stored output of a cell says of the exercise of a number."""
    text = "".join(str(output.get("text", "")) for output in cell.get("outputs", []))
    said = next((line.split(": ", 1)[1] for line in text.splitlines()
                 if line.startswith(f"{number}: ")), "not answered yet")
    kinds = {"right.": "right", "noted": "open", "not answered": "unanswered"}
    found = next((kind for words, kind in kinds.items() if said.startswith(words)), "wrong")
    return Mark(found, said, stored=True)


def marks(path: Path) -> dict[str, Mark]:
    """Every exercise that the returned notebook at a path checks, by number."""
    found = {}
    for cell in read(path)["cells"]:
        for number, value in checked(cell) if cell["cell_type"] == "code" else ():
            try:
                asked = exercise(number)
            except BadInput:
                continue
            if value is Unreadable:
                found[number] = printed(cell, number)
                continue
            try:
                verdict = judge(asked, value)
            except Exception:  # an open question's reply to an answer of any shape
                found[number] = Mark("wrong", "an answer that could not be judged")
                continue
            found[number] = Mark(verdict.found, verdict.said)
    return found


def handed_in(folder: Path) -> dict[str, dict[str, Mark]]:
    """Students, each a folder below the folder or a notebook in it, with their marks.

    Raises BadInput where there is no notebook.
    """
    students: dict[str, dict[str, Mark]] = {}
    for path in sorted(folder.rglob("*.ipynb")):
        relative = path.relative_to(folder)
        if ".ipynb_checkpoints" not in relative.parts:
            name = relative.parts[0] if len(relative.parts) > 1 else path.stem
            students.setdefault(name, {}).update(marks(path))
    if not students:
        raise BadInput(f"{folder} holds no notebook; give the folder with what was handed in, a "
                       "folder or a notebook for each student.")
    return students


def report(folder: Path) -> str:
    """Write `grades.csv` into a folder with what was handed in, and say it in words: student by
    exercise, sums, mistakes by how often they were made.

    1: right, 0: not, o: open, to be read by a person, -: not answered, *: as the returned notebook
    itself says.
    """
    students = handed_in(folder)
    asked = [number for of_chapter in chapters().values() for number in of_chapter
             if any(number in answered for answered in students.values())]
    rows = [[name, *(str(answered.get(number, "-")) for number in asked),
             str(sum(mark.found == "right" for mark in answered.values()))]
            for name, answered in students.items()]
    with open(folder / "grades.csv", "w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([["student", *asked, "right"], *rows])
    wide = max(len(name) for name in ["student", *students])
    table = [" ".join([row[0].ljust(wide), *(entry.rjust(max(4, len(head)))
                                             for head, entry in zip([*asked, "right"], row[1:],
                                                                    strict=True))])
             for row in [["student", *asked, "right"], *rows]]
    slips = Counter((number, mark.said) for answered in students.values()
                    for number, mark in answered.items() if mark.found in ("mistake", "unit"))
    lines = [f"{count:3d} × {number}: {said}" for (number, said), count in slips.most_common()]
    return "\n".join([*table, "", "1 right, 0 not, o open: read it, - not answered, * as the "
                      "notebook itself says.", *(["", "Mistakes, the most frequent first:"] * bool(
                          lines)), *lines, "", f"{folder / 'grades.csv'} has the same table."])
