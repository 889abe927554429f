"""What every chapter keeps: fresh and clean outputs, short cells, equations in order, links that lead somewhere.

nbval compares the outputs themselves; this reads the files.
"""

import ast
import re
from itertools import pairwise
from pathlib import Path

import pytest

from hydrolab.course import notebooks

BOOK = Path(__file__).resolve().parents[1] / "book"
CHAPTERS = {path.stem: path for path in sorted(BOOK.glob("*.ipynb"))}
NOTEBOOKS = {name: notebooks.read(path) for name, path in CHAPTERS.items()}
PARTS = ["After this chapter you can", "## Predict", "## Exercises", "## Summary", "## What next", "## References"]
TAGS = {"raises-exception", "nbval-ignore-output"}
# Written so that this file does not hold what it looks for.
OF_ONE_COMPUTER = re.compile(r"/(?:roo[t]|wor[k]|hom[e]|tm[p]|opt|us[r]|va[r]|User[s])/|[A-Z]:\\|site-package[s]|"
                             r"localhos[t]|127\.0\.0\.\d| at 0x[0-9a-f]{6,}|<ipython-inpu[t]|ipykernel_\d")
SOLUTION = re.compile(r"```python\n(.*?)```\s*```text\n(.*?)```", re.DOTALL)

pytestmark = pytest.mark.parametrize("chapter", NOTEBOOKS)


def cells(chapter: str, kind: str) -> list[notebooks.Cell]:
    return [cell for cell in NOTEBOOKS[chapter]["cells"] if cell["cell_type"] == kind]


def prose(chapter: str) -> str:
    return "\n\n".join(cell["source"] for cell in cells(chapter, "markdown"))


def without_code(markdown: str) -> str:
    return re.sub(r"```.*?```|`[^`\n]*`", "", markdown, flags=re.DOTALL)


def printed(chapter: str) -> str:
    """Everything the outputs say, without pixels."""
    found = []
    for cell in notebooks.without_pixels(NOTEBOOKS[chapter])["cells"]:
        for output in cell.get("outputs", []):
            found += [output.get("text", ""), *map(str, output.get("data", {}).values())]
    return "\n".join(found)


def test_stored_as_the_cleaner_leaves_it(chapter):
    stored = CHAPTERS[chapter].read_bytes()
    assert stored == notebooks.text(notebooks.clean(NOTEBOOKS[chapter])).encode(), (
        f"run: python -m hydrolab.course.notebooks book/{chapter}.ipynb")


def test_ran_from_top_to_bottom_without_an_error_or_a_warning(chapter):
    assert not list(notebooks.problems(NOTEBOOKS[chapter]))
    counts = [cell["execution_count"] for cell in cells(chapter, "code")]
    assert counts == list(range(1, len(counts) + 1))


def test_cells_are_short(chapter):
    long = {cell["source"].split("\n")[0]: length for cell in NOTEBOOKS[chapter]["cells"]
            if (length := cell["source"].count("\n") + 1) > 30}
    assert not long
    wide = [line for cell in cells(chapter, "code") for line in cell["source"].split("\n") if len(line) > 120]
    assert not wide


def test_nothing_is_hidden(chapter):
    for cell in NOTEBOOKS[chapter]["cells"]:
        assert set(cell["metadata"].get("tags", [])) <= TAGS
        assert not cell["source"].startswith("%%capture")
    folded = "".join(re.findall(r"<details>.*?</details>", prose(chapter), re.DOTALL))
    assert r"\tag{" not in folded, "an equation is folded away"


def test_no_trace_of_one_computer(chapter):
    text = printed(chapter) + "".join(cell["source"] for cell in NOTEBOOKS[chapter]["cells"])
    assert not OF_ONE_COMPUTER.findall(text)


def test_numbers_have_a_fixed_format(chapter):
    assert not re.findall(r"(?<![\d.])\d+\.\d{11,}", printed(chapter)), "print numbers with a format"
    assert not re.findall(r"\d\.?\d*e-(?:1[3-9]|[2-9]\d)", printed(chapter)), "rounding error differs between computers"


def test_equations_are_numbered_in_order_and_referenced_rightly(chapter):
    number = int(chapter[:2])
    tags = re.findall(r"\\tag\{([^}]*)\}", prose(chapter))
    assert tags == [f"{number}.{k}" for k in range(1, len(tags) + 1)]
    everything = {tag for name in NOTEBOOKS for tag in re.findall(r"\\tag\{([^}]*)\}", prose(name))}
    text = prose(chapter) + "".join(cell["source"] for cell in cells(chapter, "code"))
    named = set(re.findall(r"Eqs?\. \((\d+\.\d+)\)", text))
    named |= {found for found in re.findall(r"\((\d+\.\d+)\)", without_code(prose(chapter)))
              if found.startswith(f"{number}.")}
    assert named <= everything


def test_links_lead_to_files_of_the_book(chapter):
    for target in re.findall(r"\]\(([^)\s]+)\)", without_code(prose(chapter))):
        path, _, anchor = target.partition("#")
        assert "://" not in target, f"{target}: write references as text; the book works without a network"
        assert not path or (BOOK / path).is_file(), f"{target} leads nowhere"
        if anchor:
            name = Path(path).stem if path else chapter
            assert anchor in [heading.replace(" ", "-") for heading in re.findall(r"^#+ (.*)$", prose(name), re.MULTILINE)]


def test_markdown_needs_no_extension(chapter):
    text = without_code(prose(chapter))
    assert not re.findall(r"^:::|\{(?:eq|cite|ref|math|numref)\}|\\eqref|\\label\{", text, re.MULTILINE)
    assert text.count("<details>") == text.count("</details>") == text.count("<summary>")
    assert not re.findall(r"</summary>\n(?!\n)", text), "a folded text begins after a blank line"


def test_prose_follows_the_house_style(chapter):
    text = without_code(prose(chapter))
    assert not re.findall(r"\b(?:simply|obviously|clearly|of course|trivial(?:ly)?)\b", text, re.IGNORECASE)
    assert not re.findall(r"!(?!\[)", re.sub(r"\$.*?\$", "", text, flags=re.DOTALL)), "no exclamation marks"


def test_has_the_parts_of_a_chapter(chapter):
    text = prose(chapter)
    assert text.startswith(f"# {int(chapter[:2])} · ")
    assert re.search(r"\A.*\n\n\*\*[^*]*\?\*\*", text), "a chapter begins with a question"
    places = [text.find(part) for part in PARTS]
    assert -1 not in places, f"missing: {[part for part, at in zip(PARTS, places, strict=True) if at < 0]}"
    assert all(a < b for a, b in pairwise(places))
    assert "ncertain" in text, "say what is uncertain"


def test_exercises_have_a_stub_and_a_folded_solution(chapter):
    number = int(chapter[:2])
    found = re.findall(rf"^\*\*{number}\.(\d+)", prose(chapter), re.MULTILINE)
    assert len(found) >= 2
    assert found == [str(k) for k in range(1, len(found) + 1)]
    stubs = [cell for cell in cells(chapter, "code") if re.search(r"= \.\.\.(?:\s|$)", cell["source"])]
    solved = [cell for cell in cells(chapter, "markdown") if "<details>" in cell["source"] and "```python" in cell["source"]]
    assert len(stubs) >= len(found)
    assert len(solved) == len(found)


def test_code_parses_and_imports_stand_where_they_are_needed(chapter):
    for cell in cells(chapter, "code"):
        tree = ast.parse(cell["source"])
        starred = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.names[0].name == "*"]
        assert not starred


def test_folded_solutions_run_and_print_what_they_say(chapter):
    wanted, kept = {}, []
    for cell in notebooks.clean(NOTEBOOKS[chapter])["cells"]:
        kept.append(cell)
        for i, (code, output) in enumerate(SOLUTION.findall(cell["source"]) if cell["cell_type"] == "markdown" else []):
            name = f"{cell['id']}-solution-{i}"
            wanted[name] = output
            kept.append({"cell_type": "code", "id": name, "source": code, "metadata": {}, "outputs": [],
                         "execution_count": None})
    assert wanted
    done = notebooks.execute(NOTEBOOKS[chapter] | {"cells": kept}, BOOK)
    assert not list(notebooks.problems(done))
    said = {cell["id"]: "".join(output.get("text", "") for output in cell["outputs"])
            for cell in done["cells"] if cell["id"] in wanted}
    assert said == wanted
