"""The page "Extend hydrolab" is done as it says, in a copy of the project: each file written or
changed, each last block run, no more files touched than it promises.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hydrolab.course import refresh as notebooks

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "book" / "extend.md").read_text(encoding="utf-8")
SECTIONS = {text.split("\n", 1)[0]: text for text in PAGE.split("\n## ")[1:]}
STEP = re.compile(r"^\*\*(?:`([^`]+)`|Try it\.?)\*\*", re.MULTILINE)
BLOCK = re.compile(r"^(`{3,})(\w+)\n(.*?)^\1$", re.DOTALL | re.MULTILINE)
FILES = {"A force law, with its table in a card": 3, "A bearing": 2, "An explorer": 2,
         "An exercise": 2}


def steps(section: str) -> list[tuple[str | None, list[tuple[str, str]]]]:
    """The steps of a section: the file that one is about, or None, and its blocks by language."""
    starts = list(STEP.finditer(section))
    ends = [found.start() for found in starts[1:]] + [len(section)]
    return [(found[1], [(kind, text) for _, kind, text in BLOCK.findall(section[found.end():end])])
            for found, end in zip(starts, ends, strict=True)]


def change(text: str, diff: str) -> str:
    """A file with the lines of a block that begin with - replaced by those with +."""
    lines = diff.splitlines(keepends=True)
    old, new = ("".join(line[1:] for line in lines if line[0] in kept) for kept in (" -", " +"))
    if not old:  # only new lines: they stand before what the next block or the end of it names
        raise AssertionError("a block needs a line that is there already")
    assert text.count(old) == 1, f"{text.count(old)} times in the file:\n{old}"
    return text.replace(old, new)


def with_cells(path: Path, blocks: list[tuple[str, str]]) -> None:
    """Put cells at the end of a notebook's exercises."""
    notebook = notebooks.read(path)
    at = next(i for i, cell in enumerate(notebook["cells"])
              if cell["source"].startswith("## What your predictions said"))
    for kind, text in reversed(blocks):
        cell = {"cell_type": "markdown", "metadata": {}, "source": text}
        if kind == "python":
            cell |= {"cell_type": "code", "outputs": [], "execution_count": None}
        notebook["cells"].insert(at, cell)
    path.write_text(notebooks.text(notebooks.clean(notebook)), encoding="utf-8")


def write(path: Path, blocks: list[tuple[str, str]]) -> None:
    """Do one step to a file of the copy."""
    if path.suffix == ".ipynb":
        with_cells(path, blocks)
        return
    for kind, text in blocks:
        done = change(path.read_text(encoding="utf-8"), text) if kind == "diff" else text
        assert (kind == "diff") == path.exists(), f"{path.name}: a new file is given whole"
        path.write_text(done, encoding="utf-8")


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the project in which the sections have been done one after the other."""
    folder = tmp_path_factory.mktemp("project")
    ignored = shutil.ignore_patterns("__pycache__", "_build", ".ipynb_checkpoints")
    for name in ("hydrolab", "tests", "book"):
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    shutil.copyfile(ROOT / "pyproject.toml", folder / "pyproject.toml")
    for section in SECTIONS.values():
        for path, blocks in steps(section):
            if path:
                write(folder / path, blocks)
    return folder


def run(folder: Path, *arguments: str) -> str:
    """What a program of this Python says in the copy; it must succeed."""
    environment = os.environ | {"PYTHONPATH": str(folder), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, *arguments], cwd=folder, env=environment,
                          capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


@pytest.mark.parametrize("title", SECTIONS)
def test_a_section_is_short_and_touches_few_files(title):
    assert len({path for path, _ in steps(SECTIONS[title]) if path}) == FILES[title]
    assert len(SECTIONS[title].splitlines()) <= 125


@pytest.mark.parametrize("title", SECTIONS)
def test_what_is_tried_works(copy, title):
    *_, (path, blocks) = steps(SECTIONS[title])
    assert path is None and [kind for kind, _ in blocks] == ["python"]
    said = run(copy, "-W", "error", "-c", blocks[0][1])
    if title == "An exercise":
        assert said.splitlines()[0] == "1.7: right."
        assert "below the resonance" in said.splitlines()[1]


def test_the_copy_keeps_the_rules(copy):
    """Docstrings, layers, style, the new exercise's stub, hints and solution."""
    run(copy, "-m", "ruff", "check", "hydrolab/machine/computed_pull.py",
        "hydrolab/explorers/pull_curve.py", "hydrolab/machine/bearings.py")
    run(copy, "-m", "pytest", "-q", "-n0", "-p", "no:cacheprovider",
        "tests/course/test_exercises.py", "-k", "01-jeffcott")
    named = run(copy, "-c", "from hydrolab.course.pages import card_page; print(card_page())")
    assert "computed_pull.growth" in named and "hardening_depth" in named
