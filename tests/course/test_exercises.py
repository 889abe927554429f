"""What the exercises of every chapter keep: a stub, a check and a folded solution that runs and
passes it.
"""

import ast
import re
from pathlib import Path

import pytest

from hydrolab.course import answers as exercises
from hydrolab.course import refresh as notebooks
from hydrolab.course.answers import Exercise

BOOK = Path(__file__).resolve().parents[2] / "book"
NOTEBOOKS = {path.stem: notebooks.read(path) for path in sorted(BOOK.glob("*.ipynb"))}
SOLUTION = re.compile(r"```python\n(.*?)```(?:\s*```text\n(.*?)```)?", re.DOTALL)
SEE = re.compile(r"Eqs?\. \((\d+\.\d+)\)")

pytestmark = pytest.mark.parametrize("chapter", NOTEBOOKS)


def prose(chapter: str) -> str:
    return "\n\n".join(cell["source"] for cell in NOTEBOOKS[chapter]["cells"]
                       if cell["cell_type"] == "markdown")


def checks_in(source: str) -> dict[str, str]:
    """The checks of a cell: number of the exercise → the line that checks it."""
    calls = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)
             and isinstance(node.func, ast.Name) and node.func.id == "check"]
    return {ast.literal_eval(call.args[0]): ast.unparse(call) for call in calls}


def assigned(source: str, *, stubs: bool = False) -> set[str]:
    """Names that a cell assigns at its top level, or only those that it assigns `...`."""
    found = set()
    for node in ast.parse(source).body:
        if isinstance(node, ast.Assign) and (not stubs or ast.unparse(node.value) == "..."):
            found |= {name.id for target in node.targets for name in ast.walk(target)
                      if isinstance(name, ast.Name)}
        elif not stubs:
            found |= {name.id for name in ast.walk(node) if isinstance(name, ast.Name)
                      and isinstance(name.ctx, ast.Store)}
    return found


def exercise_cells(chapter: str) -> list[tuple[list[str], notebooks.Cell]]:
    """Each folded solution with the stubs before it, in order."""
    found, stubs = [], []
    cells = NOTEBOOKS[chapter]["cells"]
    start = next(i for i, cell in enumerate(cells)
                 if re.search("^## Exercises", cell["source"], re.MULTILINE))
    for cell in cells[start:]:
        if cell["cell_type"] == "code" and assigned(cell["source"], stubs=True):
            stubs.append(cell["source"])
        elif cell["cell_type"] == "markdown" and "```python" in cell["source"]:
            found.append((stubs, cell))
            stubs = []
    return found


def registered(chapter: str) -> dict[str, Exercise]:
    return exercises.chapters().get(int(chapter[:2]), {})


def test_exercises_have_a_stub_a_check_and_a_folded_solution(chapter):
    number = int(chapter[:2])
    found = re.findall(rf"^\*\*{number}\.(\d+)", prose(chapter), re.MULTILINE)
    assert found == [str(k) for k in range(1, len(found) + 1)] and len(found) >= 4
    assert prose(chapter).count("(warm-up)") == 1 and "(open-ended)" in prose(chapter)
    solved = exercise_cells(chapter)
    assert len(solved) == len(found)
    checked = {}
    for k, (stubs, cell) in zip(found, solved, strict=True):
        assert stubs, f"{number}.{k} has a solution and no stub"
        assert re.search(r"<details>.*```python.*</details>", cell["source"], re.DOTALL)
        of_this = {name: line for source in stubs for name, line in checks_in(source).items()}
        assert of_this and all(re.fullmatch(rf"{number}\.{k}[a-z]?", name) for name in of_this)
        answers = set().union(*(assigned(source, stubs=True) for source in stubs))
        solution = "\n".join(code for code, _ in SOLUTION.findall(cell["source"]))
        assert not (left := answers - assigned(solution)), f"{number}.{k} does not assign {left}"
        assert all(any(re.search(rf"\b{name}\b", line) for line in of_this.values())
                   for name in answers)
        checked |= of_this
    assert list(checked) == list(registered(chapter))


def test_hints_point_to_something_that_stands_there(chapter):
    before = [name for name in NOTEBOOKS if name[:2] <= chapter[:2]]
    text = "\n\n".join(prose(name) for name in before)
    headings, tags = re.findall(r"^#+ (.*)$", text, re.MULTILINE), re.findall(r"\\tag\{([^}]*)\}",
                                                                              text)
    for asked in registered(chapter).values():
        for see in (asked.see, *(mistake.see for mistake in asked.mistakes if mistake.see)):
            named = SEE.findall(see)
            assert set(named) <= set(tags), f"{see!r} is no equation up to here"
            assert named or see in headings, f"{see!r} is no heading up to here"


def needed_for(cells: list[notebooks.Cell], wanted: set[str]) -> list[notebooks.Cell]:
    """Of the code cells, those with the ids `wanted`, those that name something these use, and so
    on; and predictions.
    """
    kept, used = [], set()
    for cell in reversed([cell for cell in cells if cell["cell_type"] == "code"]):
        tree = ast.parse(cell["source"])
        if cell["id"] in wanted or "predict(" in cell["source"] or used & named(tree):
            used |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
            kept.insert(0, cell)
    return kept


def named(tree: ast.Module) -> set[str]:
    """Names that code imports, defines or assigns to, or to a part of which it assigns."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.alias):
            found.add((node.asname or node.name).split(".")[0])
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Name | ast.Attribute | ast.Subscript) and isinstance(node.ctx,
                                                                                       ast.Store):
            found |= {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
    return found


def test_folded_solutions_run_print_what_they_say_and_pass_their_check(chapter):
    """In the chapter's order, after the cells that they need; nbval runs them all."""
    cells = notebooks.clean(NOTEBOOKS[chapter])["cells"]
    solved = {cell["source"]: stubs for stubs, cell in exercise_cells(chapter)}
    wanted, checks, kept = {}, [], []

    def add(name: str, source: str) -> None:
        kept.append({"cell_type": "code", "id": name, "source": source, "metadata": {},
                     "outputs": [],
                     "execution_count": None})

    for cell in cells:
        kept.append(cell)
        for i, (code, output) in enumerate(SOLUTION.findall(cell["source"])
                                           if cell["cell_type"] == "markdown" else []):
            add(f"{cell['id']}-solution-{i}", code)
            wanted[f"{cell['id']}-solution-{i}"] = output
        if stubs := solved.get(cell["source"]):
            checks.append(f"{cell['id']}-check")
            add(checks[-1], "\n".join(line for source in stubs
                                      for line in checks_in(source).values()))
    assert wanted
    done = notebooks.execute(NOTEBOOKS[chapter] | {"cells": needed_for(kept, {*wanted, *checks})},
                             BOOK)
    assert not list(notebooks.problems(done))
    said = {cell["id"]: "".join(output.get("text", "") for output in cell.get("outputs", []))
            for cell in done["cells"]}
    assert {name: said[name] for name in wanted} == wanted
    verdicts = [line for name, text in said.items() if name.endswith("-check")
                for line in text.splitlines()]
    assert len(verdicts) >= 4
    for line in verdicts:
        number, verdict = line.split(": ", 1)
        assert verdict.startswith("noted." if registered(chapter)[number].reply else "right."), line
