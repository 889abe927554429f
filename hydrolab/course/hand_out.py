"""A copy of the course to hand out: the chapters without folded solutions and answers, and without
the stored outputs that give them away.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable
from pathlib import Path

from hydrolab.course.refresh import Notebook, clean, read, text
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


def hand_out(book: Path, files: Iterable[Path], folder: Path) -> str:
    """Write `files`, relative to the book, into a folder, notebooks without solutions; return one
    sentence.

    Raises BadInput where the folder holds anything: a copy must not mix with somebody's work.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BadInput(f"--students is {folder}, which is not an empty folder; name a new one.")
    if folder.resolve().is_relative_to(book):
        raise BadInput(f"--students is {folder}, inside the shipped course; choose a folder "
                       "elsewhere.")
    count = 0
    for relative in files:
        target = folder / relative
        target.parent.mkdir(parents=True, exist_ok=True)
        if relative.suffix == ".ipynb":
            bare = without_solutions(read(book / relative))
            target.write_text(text(clean(bare)), encoding="utf-8", newline="\n")
            count += 1
        else:
            shutil.copyfile(book / relative, target)
    return (f"{count} chapters without solutions are in {folder}. The checks stay: they tell right "
            "from wrong and name mistakes, and compute their reference when a student asks.")
