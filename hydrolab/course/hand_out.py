"""A copy of the course to hand out: the chapters without folded solutions and answers, and without
the stored outputs that give them away; and such a copy brought up to date, whatever was written
into it.

book: folder of the course. files: of the book, relative to it. folder: of the copy.
"""

from __future__ import annotations

import hashlib
import re
import shutil
from collections.abc import Iterable
from pathlib import Path

from hydrolab import __version__
from hydrolab.course.refresh import Cell, Notebook, clean, read, text
from hydrolab.errors import BadInput

FOLDED = re.compile(r"\n*<details>\s*<summary>[^<]*(?:Solution|[Aa]nswer)[^<]*</summary>.*?"
                    r"</details>\n*", re.DOTALL)


def without_solutions(notebook: Notebook) -> Notebook:
    """The notebook without what a student opens after having tried, and without any stored output
    below the predictions: whatever answers one is somewhere in them.
    """
    cells, asked = [], False
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            if asked:
                cell = cell | {"outputs": [], "execution_count": None}
            asked |= "\npredict(" in f"\n{cell['source']}"
        elif FOLDED.search(cell["source"]):
            left = FOLDED.sub("\n\n", cell["source"]).strip("\n")
            if not left:
                continue
            cell = cell | {"source": left}
        cells.append(cell)
    return notebook | {"cells": cells}


def handed(path: Path) -> Notebook:
    """The chapter at a path as it is handed out; its metadata say which version it is, and what
    each cell was, so that an update knows what a student has changed.
    """
    notebook = clean(without_solutions(read(path)))
    notebook["metadata"]["hydrolab"] = {"version": __version__, "cells": {
        cell["id"]: _digest(cell) for cell in notebook["cells"]}}
    return notebook


def _digest(cell: Cell) -> str:
    return hashlib.sha256(cell["source"].strip().encode()).hexdigest()[:12]


def hand_out(book: Path, files: Iterable[Path], folder: Path) -> str:
    """Write files of the book into a new folder, notebooks without solutions; return one sentence.

    Raises BadInput where the folder holds anything: a copy must not mix with somebody's work.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BadInput(f"--students is {folder}, which is not an empty folder; name a new one, or "
                       "add --update to bring a copy up to date.")
    if folder.resolve().is_relative_to(book):
        raise BadInput(f"--students is {folder}, inside the shipped course; choose a folder "
                       "elsewhere.")
    count = 0
    for relative in files:
        _write(book / relative, folder / relative)
        count += relative.suffix == ".ipynb"
    return (f"{count} chapters without solutions are in {folder}. The checks stay: they tell right "
            "from wrong and name mistakes, and compute their reference when a student asks.")


def _write(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    if source.suffix == ".ipynb":
        target.write_text(text(handed(source)), encoding="utf-8", newline="\n")
    else:
        shutil.copyfile(source, target)


def update(book: Path, files: Iterable[Path], folder: Path) -> str:
    """Bring a handed-out copy in a folder to this version and say what changed: what a student has
    written stays, what they left alone is replaced, solutions stay out. Another file than a
    notebook that differs is kept beside the new one, as NAME.before.

    Raises BadInput where there is no copy.
    """
    if not any(folder.glob("[0-9]*.ipynb")):
        raise BadInput(f"--students is {folder}, which holds no chapter to update; without "
                       "--update a new copy is written there.")
    said = []
    for relative in files:
        source, target = book / relative, folder / relative
        if not target.exists():
            said.append(f"{relative}: new")
        elif relative.suffix == ".ipynb":
            mine, new = read(target), handed(source)
            merged, words = merged_cells(mine, new)
            metadata = mine["metadata"] | {"hydrolab": new["metadata"]["hydrolab"]}
            target.write_text(text(mine | {"cells": merged, "metadata": metadata}),
                              encoding="utf-8", newline="\n")
            before = mine["metadata"].get("hydrolab", {}).get("version", "one without a number")
            said += [f"{relative}, from version {before} to {__version__}:", *words] * bool(words)
            continue
        elif target.read_bytes() != source.read_bytes():
            target.replace(target.with_name(f"{target.name}.before"))
            said.append(f"{relative}: replaced; {relative.name}.before is the one that was there")
        else:
            continue
        _write(source, target)
    return "\n".join(said or [f"{folder} is up to date, version {__version__}."])


def merged_cells(mine: Notebook, new: Notebook) -> tuple[list[Cell], list[str]]:
    """The cells of a student's notebook, mine, with those of the new one in place of what they left
    as it was given; and a line on each that changed.
    """
    given = mine["metadata"].get("hydrolab", {}).get("cells", {})
    theirs = {cell.get("id", ""): cell for cell in mine["cells"]}
    shipped = {cell["id"]: cell for cell in new["cells"]}
    own: dict[str, list[Cell]] = {}  # by the shipped cell that they stand below
    words, above = [], ""
    for key, cell in theirs.items():
        if key in shipped:
            above = key
        elif given.get(key) != _digest(cell):
            own.setdefault(above, []).append(cell)
        else:
            words.append(_line("taken out", cell))
    merged = own.get("", [])
    for key, cell in shipped.items():
        was = theirs.get(key)
        if was is None and key not in given:
            merged.append(cell)
            words.append(_line("new", cell))
        elif was is not None and given.get(key) == _digest(was) != _digest(cell):
            merged.append(cell)
            words.append(_line("changed", cell))
        elif was is not None:  # else a student has deleted it
            merged.append(was)
            if given.get(key, "") != _digest(cell) != _digest(was):
                words.append(_line("changed, kept as you have it", cell))
        merged += own.get(key, [])
    return merged, words


def _line(what: str, cell: Cell) -> str:
    first = cell["source"].strip().split("\n")[0]
    return f"    {what}: {first[:70]}{' …' if len(first) > 70 else ''}"
