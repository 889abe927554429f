"""Notebooks with fresh, clean outputs: run by nbclient, freed of what changes from run to run,
compared by nbdime and nbval.

`hydrolab book --refresh` writes and says what changed; with --check nbval compares, pixels aside,
and nothing is written. Two executions give the same bytes.
"""

from __future__ import annotations

import copy
import hashlib
import io
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hydrolab.errors import BadInput
from hydrolab.explorers.widget import MIME as FLIPBOOK

Notebook = dict[str, Any]
Cell = dict[str, Any]

ROOT = Path(__file__).resolve().parents[2]
METADATA = {"kernelspec": {"display_name": "Python 3 (ipykernel)", "language": "python",
                           "name": "python3"},
            "language_info": {"name": "python"}}
WIDGETS = ("application/vnd.jupyter.widget-view+json", "application/vnd.jupyter.widget-state+json")
WITH_PICTURES = ("text/html", FLIPBOOK)
PIXELS = re.compile(r"(data:image/(?:png|webp);base64,)[A-Za-z0-9+/=]+")
CELL_ID = re.compile(r"[a-zA-Z0-9_-]{1,64}")
TIMEOUT = 120  # seconds a cell may take, as under nbval


def read(path: Path) -> Notebook:
    """Read a notebook, format 4, with each text as one string.

    Raises BadInput if there is none at this path.
    """
    from nbformat.v4 import to_notebook

    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInput(f"{path} cannot be read: {error.strerror}.") from None
    except ValueError as error:
        raise BadInput(f"{path} is not a notebook: {error}.") from None
    if not (isinstance(found, dict) and found.get("nbformat") == 4
            and isinstance(found.get("cells"), list)):
        raise BadInput(f"{path} is not a notebook of format 4; open and save it in JupyterLab.")
    return to_notebook(found)


def text(notebook: Notebook) -> str:
    """The notebook as it stands in its file: keys in order, one space of indent, texts in lines."""
    from nbformat import from_dict
    from nbformat.v4 import writes

    return writes(from_dict(notebook)) + "\n"


def clean(notebook: Notebook) -> Notebook:
    """A copy without what a run or a person leaves in it, the same however often it is cleaned."""
    cells: list[Cell] = []
    taken: set[str] = set()
    count = 0
    for cell in copy.deepcopy(notebook["cells"]):
        source = "\n".join(line.rstrip() for line in cell["source"].split("\n")).strip("\n")
        tags = cell.get("metadata", {}).get("tags", [])
        new = {"cell_type": cell["cell_type"], "id": _cell_id(cell, source, taken),
               "source": source, "metadata": {"tags": tags} if tags else {}}
        if cell["cell_type"] == "code":
            ran = bool(source and (cell.get("execution_count") or cell.get("outputs")))
            count += ran
            new["execution_count"] = count if ran else None
            new["outputs"] = list(_kept(cell.get("outputs", []), new["execution_count"]))
        elif cell.get("attachments"):
            new["attachments"] = cell["attachments"]
        cells.append(new)
    return {"cells": cells, "metadata": copy.deepcopy(METADATA), "nbformat": 4, "nbformat_minor": 5}


def _cell_id(cell: Cell, source: str, taken: set[str]) -> str:
    """The cell's own id if it is a good one, else one made from its text."""
    wanted = str(cell.get("id", ""))
    if not CELL_ID.fullmatch(wanted) or wanted in taken:
        seed = hashlib.sha256(f"{cell['cell_type']}\n{source}".encode()).hexdigest()
        wanted = next(name for i in range(1000)
                      if (name := seed[:8] + (f"-{i}" if i else "")) not in taken)
    taken.add(wanted)
    return wanted


def _kept(outputs: Sequence[dict[str, Any]], count: int | None) -> Iterator[dict[str, Any]]:
    for output in outputs:
        kind = output["output_type"]
        if kind == "stream":
            yield {"output_type": kind, "name": output["name"], "text": output["text"]}
        elif kind == "error":  # a traceback names files of one computer
            yield {"output_type": kind, "ename": output["ename"], "evalue": output["evalue"],
                   "traceback": []}
        elif data := {mime: value for mime, value in output["data"].items()
                      if mime not in WIDGETS}:
            counted = {"execution_count": count} if kind == "execute_result" else {}
            yield {"output_type": kind, "data": data, "metadata": {}, **counted}


def execute(notebook: Notebook, folder: Path) -> Notebook:
    """Run all cells in a fresh kernel of this Python, in `folder`; return the notebook with their
    outputs, clean.

    Raises BadInput for a cell that does not end or a kernel that dies.
    """
    from nbclient import NotebookClient
    from nbclient.exceptions import CellTimeoutError, DeadKernelError
    from nbformat import from_dict

    bare = clean(notebook)
    for cell in bare["cells"]:
        if cell["cell_type"] == "code":
            cell["outputs"], cell["execution_count"] = [], None
    client = NotebookClient(from_dict(bare), timeout=TIMEOUT, kernel_name="python3",
                            record_timing=False, store_widget_state=False, coalesce_streams=True,
                            allow_errors=True, resources={"metadata": {"path": str(folder)}})
    try:
        done = client.execute(env=_environment())
    except (CellTimeoutError, DeadKernelError) as error:
        raise BadInput(" ".join(str(error).split())[:300]) from None
    return clean(json.loads(json.dumps(done)))


def _environment() -> dict[str, str]:
    """The kernel runs the hydrolab that runs this."""
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    return os.environ | {"PYTHONPATH": path}


def problems(notebook: Notebook) -> Iterator[str]:
    """What no stored notebook may hold: an unexpected error, words on stderr, a cell not run."""
    for number, cell in enumerate(notebook["cells"], 1):
        if cell["cell_type"] != "code":
            continue
        name = f"cell {number} ({cell['source'].strip().partition(chr(10))[0][:40]})"
        if cell["execution_count"] is None:
            yield f"{name} has not run"
        expected = "raises-exception" in cell["metadata"].get("tags", [])
        for output in cell["outputs"]:
            if output["output_type"] == "error" and not expected:
                yield f"{name} raises {output['ename']}: {output['evalue'][:200]}"
            if output.get("name") == "stderr":
                yield f"{name} writes to stderr: {output['text'].strip()[:200]}"


def without_pixels(notebook: Notebook) -> Notebook:
    """A copy whose pictures are empty, to compare two notebooks as nbval does."""
    bare = copy.deepcopy(notebook)
    for cell in bare["cells"]:
        for data in (output.get("data", {}) for output in cell.get("outputs", [])):
            for mime in data:
                if mime == "image/png":
                    data[mime] = ""
                elif mime in WITH_PICTURES:
                    data[mime] = PIXELS.sub(r"\1", data[mime])
    return bare


def changes(old: Notebook, new: Notebook) -> str:
    """What differs between an old and a new notebook, pixels aside, in nbdime's words; "" where
    nothing does.

    Raises BadInput where nbdime is missing.
    """
    try:
        from nbdime import diff_notebooks
        from nbdime.prettyprint import PrettyPrintConfig, pretty_print_notebook_diff
    except ImportError:
        raise BadInput('A refresh says what changed by nbdime; install hydrolab with its extra: '
                       'pip install -e ".[book]"') from None
    from nbformat import from_dict

    before, after = from_dict(without_pixels(old)), from_dict(without_pixels(new))
    out = io.StringIO()
    config = PrettyPrintConfig(out=out, use_color=False, use_git=False, use_diff=False)
    pretty_print_notebook_diff("stored", "fresh", before, diff_notebooks(before, after), config)
    return out.getvalue().rstrip()


def refresh(path: Path) -> tuple[bool, str]:
    """Execute, clean and write one notebook; return whether all is well, and what changed in words.

    A notebook with an error or a warning is not written.
    """
    stored = read(path)
    fresh = execute(stored, path.resolve().parent)
    if wrong := list(problems(fresh)):
        return False, f"{path.name}: " + "\n    ".join(["not written", *wrong])
    if path.read_text(encoding="utf-8") == text(fresh):
        return True, f"{path.name}: unchanged"
    said = changes(stored, fresh) or "only pixels, or how the file is laid out"
    path.write_text(text(fresh), encoding="utf-8", newline="\n")
    return True, f"{path.name}: changed\n{said}"


def check(paths: Sequence[Path]) -> int:
    """Run notebooks under nbval against what they store, and see that they are clean; return 0 or 1
    and print what is not. Writes nothing.
    """
    untidy = [path.name for path in paths
              if path.read_text(encoding="utf-8") != text(clean(read(path)))]
    if untidy:
        print(f"not clean, refresh: {', '.join(untidy)}", flush=True)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider",
               "-c", str(ROOT / "pyproject.toml"), *map(str, paths)]
    done = subprocess.run(command, cwd=ROOT, env=_environment(), check=False)
    return int(bool(done.returncode or untidy))


def refresh_all(book: Path, chapters: Sequence[str] = (), *, compare: bool = False) -> int:
    """Refresh chapters of the book by number, or all of them, or notebooks by path.

    compare: write nothing (`check`). Returns 1 where one is not well, 2 where one cannot be read or
    run. Raises BadInput for a chapter that the book has not.
    """
    known = {str(int(path.name[:2])): path for path in sorted(book.glob("[0-9][0-9]-*.ipynb"))}
    paths = []
    for chapter in chapters or known:
        own = chapter.endswith(".ipynb")
        path = Path(chapter) if own else known.get(chapter.lstrip("0") or "0")
        if path is None:
            raise BadInput(f"The book has no chapter {chapter}; it has {', '.join(known)}.")
        paths.append(path)
    if compare:
        return check(paths)
    code = 0
    for path in paths:
        start = time.perf_counter()
        try:
            well, said = refresh(path)
            code = max(code, int(not well))
        except BadInput as error:
            said, code = str(error), 2
        first, *rest = said.split("\n")
        print("\n".join([f"{first} ({time.perf_counter() - start:.1f} s)", *rest]), flush=True)
    return code
