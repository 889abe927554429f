"""What every chapter keeps: fresh and clean outputs, short cells, equations in order, links that
lead somewhere.

nbval compares the outputs themselves; this reads the files.
"""

import ast
import importlib
import json
import re
from itertools import pairwise
from pathlib import Path

import pytest

from hydrolab.course import refresh as notebooks
from hydrolab.explorers.kept_figure import MIME as FLIPBOOK

BOOK = Path(__file__).resolve().parents[1] / "book"
CHAPTERS = {path.stem: path for path in sorted(BOOK.glob("*.ipynb"))}
NOTEBOOKS = {name: notebooks.read(path) for name, path in CHAPTERS.items()}
PARTS = ["After this chapter you can", "| you need |", "## Predict", "## Exercises", "## What your "
         "predictions said",
         "## Summary", "## What next", "## References"]
LARGEST = 700_000  # bytes of a stored notebook
# The chapter that explains a name of the library. `HarmonicBalance`, `follow`, `Arclength`, `modes`
# and `ellipse` serve before theirs, as tools that the text announces as such.
EXPLAINED = {
    3: ["integrate", "CentralDifference", "Newmark", "RungeKutta"],
    4: ["newton", "powell_dog_leg", "first_guess"],
    5: ["arclength", "locate_fold", "floquet", "branch_stability", "stable_orbits_at",
        "strang_product"],
    6: ["shaft_element", "energies"],
    7: ["campbell", "body_matrices", "rigid_link"],
    8: ["calibrate", "first_fold", "load_family", "sensitivity"],
    9: ["run_study", "judge"],
    10: ["basins", "sweep_in_time", "poincare"],
    13: ["run", "start_up", "load_rejection", "runaway", "speed_margins"],
}
# All that a chapter imports of hydrolab; how a package is divided is no business of a reader's.
PATHS = {"hydrolab", "hydrolab.machine", "hydrolab.dynamics", "hydrolab.paper", "hydrolab.figures",
         "hydrolab.explorers", "hydrolab.course", "hydrolab.live"}
# live-N: the questions that the static page cannot answer; browser-N: seconds in a browser's Python
TAGS = re.compile(r"raises-exception|nbval-ignore-output|live-\d+|browser-\d+")
# Written so that this file does not hold what it looks for.
OF_ONE_COMPUTER = re.compile(
    r"/(?:roo[t]|wor[k]|hom[e]|tm[p]|opt|us[r]|va[r]|User[s])/|[A-Z]:\\|site-package[s]|"
    r"localhos[t]|127\.0\.0\.\d| at 0x[0-9a-f]{6,}|<ipython-inpu[t]|ipykernel_\d")

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
        f"run: python -m hydrolab.course.refresh book/{chapter}.ipynb")


def test_ran_from_top_to_bottom_without_an_error_or_a_warning(chapter):
    assert not list(notebooks.problems(NOTEBOOKS[chapter]))
    counts = [cell["execution_count"] for cell in cells(chapter, "code")]
    assert counts == list(range(1, len(counts) + 1))


def test_cells_are_short(chapter):
    long = {cell["source"].split("\n")[0]: length for cell in NOTEBOOKS[chapter]["cells"]
            if (length := cell["source"].count("\n") + 1) > 30}
    assert not long
    wide = [line for cell in cells(chapter, "code") for line in cell["source"].split("\n")
            if len(line) > 120]
    assert not wide


def test_nothing_is_hidden(chapter):
    for cell in NOTEBOOKS[chapter]["cells"]:
        assert all(map(TAGS.fullmatch, cell["metadata"].get("tags", [])))
        assert not cell["source"].startswith("%%capture")
    folded = re.findall(r"<details>.*?</details>", prose(chapter), re.DOTALL)
    assert r"\tag{" not in "".join(folded), "an equation is folded away"
    taught = re.findall(r"<details>.*?</details>", prose(chapter).split("\n## Exercises")[0],
                        re.DOTALL)
    assert not [text for text in taught if "$$" in text
                or "```python" in text], "physics is folded away"


def test_no_trace_of_one_computer(chapter):
    text = printed(chapter) + "".join(cell["source"] for cell in NOTEBOOKS[chapter]["cells"])
    assert not OF_ONE_COMPUTER.findall(text)


def test_numbers_have_a_fixed_format(chapter):
    assert not re.findall(r"(?<![\d.])\d+\.\d{11,}",
                          printed(chapter)), "print numbers with a format"
    assert not re.findall(r"\d\.?\d*e-(?:1[3-9]|[2-9]\d)",
                          printed(chapter)), "rounding error differs between computers"


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


def test_equations_are_referenced(chapter):
    named = {found for name in NOTEBOOKS
             for found in re.findall(r"\((\d+\.\d+)\)",
                                     "".join(cell["source"] for cell in NOTEBOOKS[name]["cells"]))}
    tags = set(re.findall(r"\\tag\{([^}]*)\}", prose(chapter)))
    assert not tags - named, "an equation has a number and nobody uses it"


def test_links_lead_to_files_of_the_book(chapter):
    for target in re.findall(r"\]\(([^)\s]+)\)", without_code(prose(chapter))):
        path, _, anchor = target.partition("#")
        assert "://" not in target, f"{target}: write it as text; the book works without a network"
        assert not path or (BOOK / path).is_file(), f"{target} leads nowhere"
        if anchor:
            name = Path(path).stem if path else chapter
            assert anchor in [heading.replace(" ", "-")
                              for heading in re.findall(r"^#+ (.*)$", prose(name), re.MULTILINE)]


def test_markdown_needs_no_extension(chapter):
    text = without_code(prose(chapter))
    assert not re.findall(r"^:::|\{(?:eq|cite|ref|math|numref)\}|\\eqref|\\label\{", text,
                          re.MULTILINE)
    assert text.count("<details>") == text.count("</details>") == text.count("<summary>")
    assert not re.findall(r"</summary>\n(?!\n)", text), "a folded text begins after a blank line"


def test_prose_follows_the_house_style(chapter):
    text = without_code(prose(chapter))
    assert not re.findall(r"\b(?:simply|obviously|clearly|of course|trivial(?:ly)?)\b", text,
                          re.IGNORECASE)
    assert not re.findall(r"!(?!\[)", re.sub(r"\$.*?\$", "", text,
                                             flags=re.DOTALL)), "no exclamation marks"


def test_has_the_parts_of_a_chapter(chapter):
    text = prose(chapter)
    assert text.startswith(f"# {int(chapter[:2])} · ")
    assert re.search(r"\A.*\n\n\*\*[^*]*\?\*\*", text), "a chapter begins with a question"
    places = [text.find(part) for part in PARTS]
    missing = [part for part, at in zip(PARTS, places, strict=True) if at < 0]
    assert not missing
    assert all(a < b for a, b in pairwise(places))
    assert "ncertain" in text, "say what is uncertain"


def test_has_what_a_chapter_promises(chapter):
    text = prose(chapter)
    assert re.search(r"about \d+ minutes", text)
    assert len(re.findall(r"^- \*\*\w+", text,
                          re.MULTILINE)) >= 3, "objectives begin with a verb in bold"
    assert re.search("^#+ .*limit check", text, re.MULTILINE | re.IGNORECASE)
    assert "by hand" in text.lower()
    code = "\n".join(cell["source"] for cell in cells(chapter, "code"))
    made = re.findall(r"^(?:predict|answer|check)\(\s*\"(\d+)", code, re.MULTILINE)
    assert set(made) == {str(int(chapter[:2]))}
    assert re.findall(r"^predict\(\"(\w+)\"", code, re.MULTILINE), "a chapter asks for a prediction"
    assert (set(re.findall(r"^\s*predict\(\s*\"(\w+)\"", code, re.MULTILINE))
            == set(re.findall(r"^\s*answer\(\s*\"(\w+)\"", code,
                              re.MULTILINE))), "each prediction is answered"
    assert "recall()" in code


def test_an_explorer_has_three_questions_and_answers(chapter):
    cells = NOTEBOOKS[chapter]["cells"]
    places = [i for i, cell in enumerate(cells) for output in cell.get("outputs", [])
              if FLIPBOOK in output.get("data", {})]
    assert places, "no explorer"
    for place in places:
        after = cells[place + 1]["source"]
        asked, _, folded = after.partition("<details>")
        for part in (asked, folded):
            assert re.findall(r"^(\d)\. ", part, re.MULTILINE)[:3] == ["1", "2", "3"], after[:60]


def test_pictures_carry_their_words(chapter):
    for cell in cells(chapter, "code"):
        for output in cell["outputs"]:
            data = output.get("data", {})
            assert not {"image/png", "image/svg+xml"} & set(data), "show a Picture"
            for tag in re.findall(r"<img[^>]*>", data.get("text/html", "")):
                assert re.search(r'alt="[^"]{20,}"', tag)
            if FLIPBOOK in data:
                frames = json.loads(data[FLIPBOOK])["frames"]
                assert len({frame["reading"]
                            for frame
                            in frames}) == len(frames), "a frame's reading names its value"


def test_uses_nothing_that_a_later_chapter_explains(chapter):
    later = {name for number, names in EXPLAINED.items() if number > int(chapter[:2])
             for name in names}
    for cell in cells(chapter, "code"):
        for node in ast.walk(ast.parse(cell["source"])):
            if isinstance(node, ast.ImportFrom):
                used = {node.module, *(alias.name for alias in node.names)}
            else:
                used = {alias.name for alias in node.names} if isinstance(node,
                                                                          ast.Import) else set()
            assert not used & later, f"{used & later} comes later"


def test_imports_from_few_paths(chapter):
    """In its cells, and in its solutions."""
    folded = re.findall(r"```python\n(.*?)```", prose(chapter), re.DOTALL)
    for source in [*(cell["source"] for cell in cells(chapter, "code")), *folded]:
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.ImportFrom) and node.module.split(".")[0] == "hydrolab":
                assert node.module in PATHS, f"{node.module}: import from its package"
                package = importlib.import_module(node.module)
                assert {alias.name for alias in node.names} <= set(package.__all__)
            elif isinstance(node, ast.Import):
                assert not [a.name for a in node.names if a.name.startswith("hydrolab.")]


def test_is_not_large(chapter):
    assert CHAPTERS[chapter].stat().st_size < LARGEST


def test_code_parses_and_imports_stand_where_they_are_needed(chapter):
    for cell in cells(chapter, "code"):
        tree = ast.parse(cell["source"])
        starred = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)
                   and node.names[0].name == "*"]
        assert not starred
