"""Notebooks with fresh, clean outputs: execute, take out what changes from run to run, say what
changed.

`hydrolab book --refresh` writes; with --check it only compares, pixels aside, and returns 1 where a
stored notebook is stale or not clean. `python -m hydrolab.course.notebooks FILE …` does so for any
notebook. Two executions give the same bytes.
"""

from __future__ import annotations

import argparse
import base64
import binascii
import copy
import difflib
import hashlib
import json
import os
import re
import struct
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hydrolab.errors import BadInput
from hydrolab.explorers.flipbook import MIME as FLIPBOOK

Notebook = dict[str, Any]
Cell = dict[str, Any]

METADATA = {"kernelspec": {"display_name": "Python 3 (ipykernel)", "language": "python",
                           "name": "python3"},
            "language_info": {"name": "python"}}
WIDGETS = ("application/vnd.jupyter.widget-view+json", "application/vnd.jupyter.widget-state+json")
WITH_PICTURES = ("text/html", FLIPBOOK)
CELL_ID = re.compile(r"[a-zA-Z0-9_-]{1,64}")
PIXELS = re.compile(r"(data:image/(?:png|webp);base64,)([A-Za-z0-9+/=]+)")
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
# text in a PNG that tells which program made it, and when
PNG_MARKS = ("software", "creation time")
TIMEOUT = 120  # seconds a cell may take, as under nbval


def read(path: Path) -> Notebook:
    """Read a notebook, format 4, with each text as one string.

    Raises BadInput if there is none.
    """
    from nbformat import from_dict
    from nbformat.v4.rwbase import rejoin_lines

    try:
        notebook = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInput(f"{path} cannot be read: {error.strerror}.") from None
    except ValueError as error:
        raise BadInput(f"{path} is not a notebook: {error}.") from None
    if not isinstance(notebook,
                      dict) or notebook.get("nbformat") != 4 or not isinstance(notebook.get("cells"), list):
        raise BadInput(f"{path} is not a notebook of format 4; open and save it in JupyterLab.")
    return rejoin_lines(from_dict(notebook))


def text(notebook: Notebook) -> str:
    """The notebook as it stands in its file: keys in order, one space of indent, texts split into
    lines.
    """
    from nbformat import from_dict
    from nbformat.v4.rwbase import split_lines

    split = split_lines(from_dict(copy.deepcopy(notebook)))
    return json.dumps(split, indent=1, sort_keys=True, ensure_ascii=False) + "\n"


def clean(notebook: Notebook) -> Notebook:
    """The notebook without what a run or a person leaves in it: a copy, the same however often it
    is cleaned.
    """
    cells: list[Cell] = []
    taken: set[str] = set()
    count = 0
    for cell in copy.deepcopy(notebook["cells"]):
        kind, source = cell["cell_type"], _trimmed(cell["source"])
        tags = cell.get("metadata", {}).get("tags", [])
        new = {"cell_type": kind, "id": _cell_id(cell, source, taken), "source": source,
               "metadata": {"tags": tags} if tags else {}}
        if kind == "code":
            ran = bool(source) and (cell.get("execution_count") is not None
                                    or bool(cell.get("outputs")))
            count += ran
            new["execution_count"] = count if ran else None
            new["outputs"] = _clean_outputs(cell.get("outputs", []), new["execution_count"])
        elif cell.get("attachments"):
            new["attachments"] = cell["attachments"]
        cells.append(new)
    return {"cells": cells, "metadata": copy.deepcopy(METADATA), "nbformat": 4, "nbformat_minor": 5}


def _trimmed(source: str) -> str:
    return "\n".join(line.rstrip() for line in source.split("\n")).strip("\n")


def _cell_id(cell: Cell, source: str, taken: set[str]) -> str:
    """The cell's own id if it is a good one, else one made from its text."""
    wanted = str(cell.get("id", ""))
    if not CELL_ID.fullmatch(wanted) or wanted in taken:
        seed = hashlib.sha256(f"{cell['cell_type']}\n{source}".encode()).hexdigest()
        wanted = next(name for i in range(1000)
                      if (name := seed[:8] + (f"-{i}" if i else "")) not in taken)
    taken.add(wanted)
    return wanted


def _clean_outputs(outputs: Sequence[dict[str, Any]], count: int | None) -> list[dict[str, Any]]:
    kept: list[dict[str, Any]] = []
    for output in outputs:
        kind = output["output_type"]
        if kind == "stream":
            if kept and kept[-1]["output_type"] == "stream" and kept[-1]["name"] == output["name"]:
                kept[-1]["text"] += output["text"]
            else:
                kept.append({"output_type": kind, "name": output["name"], "text": output["text"]})
        elif kind == "error":  # a traceback names files of one computer
            kept.append({"output_type": kind, "ename": output["ename"], "evalue": output["evalue"],
                         "traceback": []})
        else:
            data = {mime: _clean_data(mime, value) for mime, value in output["data"].items()
                    if mime not in WIDGETS}
            if data:
                extra = {"execution_count": count} if kind == "execute_result" else {}
                kept.append({"output_type": kind, "data": data, "metadata": {}, **extra})
    return kept


def _clean_data(mime: str, value: Any) -> Any:
    if mime == "image/png":
        return _unmarked(value)
    return PIXELS.sub(lambda found: found[1] + _unmarked(found[2]),
                      value) if mime in WITH_PICTURES else value


def _unmarked(encoded: str) -> str:
    """A PNG in base64, on one line, without the marks of time and program; what is no PNG stays as
    it is.
    """
    try:
        return base64.b64encode(without_marks(base64.b64decode(encoded))).decode("ascii")
    except (binascii.Error, BadInput):
        return encoded


def without_marks(png: bytes) -> bytes:
    """A PNG without the chunks that say when and with which program it was made.

    Raises BadInput for what is no PNG.
    """
    if not png.startswith(PNG_SIGNATURE):
        raise BadInput("these bytes are not a PNG.")
    kept, at = [PNG_SIGNATURE], len(PNG_SIGNATURE)
    while at + 12 <= len(png):
        end = at + 12 + struct.unpack(">I", png[at:at + 4])[0]
        kind, keyword = png[at + 4:at + 8], png[at + 8:end
                                                - 4].split(b"\0")[0].decode("latin-1").lower()
        if end > len(png):
            raise BadInput("this PNG is cut short.")
        if kind != b"tIME" and not (kind in (b"tEXt", b"iTXt", b"zTXt") and keyword in PNG_MARKS):
            kept.append(png[at:end])
        at = end
    return b"".join(kept)


def execute(notebook: Notebook, folder: Path) -> Notebook:
    """Run all cells in a fresh kernel of this Python, in `folder`; return the notebook with their
    outputs, clean.
    """
    from nbclient import NotebookClient
    from nbclient.exceptions import CellTimeoutError, DeadKernelError
    from nbformat import from_dict

    bare = clean(notebook)
    for cell in bare["cells"]:
        if cell["cell_type"] == "code":
            cell["outputs"], cell["execution_count"] = [], None
    client = NotebookClient(from_dict(bare), timeout=TIMEOUT, kernel_name="python3",
                            record_timing=False,
                            store_widget_state=False, coalesce_streams=True, allow_errors=True,
                            resources={"metadata": {"path": str(folder)}})
    here = str(Path(__file__).resolve().parents[2])  # the kernel runs the hydrolab that runs this
    path = os.pathsep.join(filter(None, [here, os.environ.get("PYTHONPATH")]))
    try:
        done = client.execute(env=os.environ | {"PYTHONPATH": path})
    except (CellTimeoutError, DeadKernelError) as error:
        raise BadInput(" ".join(str(error).split())[:300]) from None
    return clean(json.loads(json.dumps(done)))


def problems(notebook: Notebook) -> Iterator[str]:
    """What no stored notebook may hold: an error that its cell does not expect, words on stderr, a
    cell not run.
    """
    for number, cell in enumerate(notebook["cells"], 1):
        if cell["cell_type"] != "code":
            continue
        if cell["execution_count"] is None:
            yield f"{_named(number, cell)} has not run"
        for output in cell["outputs"]:
            if output["output_type"] == "error" and "raises-exception" not in cell["metadata"].get("tags", []):
                yield f"{_named(number, cell)} raises {output['ename']}: {output['evalue'][:200]}"
            if output.get("name") == "stderr":
                yield f"{_named(number, cell)} writes to stderr: {output['text'].strip()[:200]}"


def _named(number: int, cell: Cell) -> str:
    first = next((line.strip() for line in cell["source"].split("\n") if line.strip()), "nothing")
    return f"cell {number} ({first[:40]}{'…' if len(first) > 40 else ''})"


def without_pixels(notebook: Notebook) -> Notebook:
    """A copy whose pictures are empty, to compare two notebooks as nbval does."""
    bare = copy.deepcopy(notebook)
    for cell in bare["cells"]:
        for output in cell.get("outputs", []):
            for mime, value in output.get("data", {}).items():
                output["data"][mime] = "" if mime == "image/png" else (
                    PIXELS.sub(r"\1", value) if mime in WITH_PICTURES else value)
    return bare


def changes(old: Notebook, new: Notebook) -> Iterator[str]:
    """What differs between two notebooks of the same cells, cell by cell, in words."""
    if {k: v for k, v in old.items() if k != "cells"} != {k: v for k, v in new.items()
                                                          if k != "cells"}:
        yield "the notebook's metadata"
    if renamed := sum(was.get("id") != now["id"]
                      for was, now in zip(old["cells"], new["cells"], strict=True)):
        yield f"the ids of {renamed} cells"
    bare = zip(without_pixels(old)["cells"], without_pixels(new)["cells"], strict=True)
    for number, ((before, after), was, now) in enumerate(zip(bare, old["cells"], new["cells"],
                                                             strict=True), 1):
        keys = [key for key in sorted({*was, *now} - {"id"}) if was.get(key) != now.get(key)]
        if not keys:
            continue
        if keys == ["outputs"] and before == after:
            yield f"{_named(number, now)}: pixels"
            continue
        lines = [line for line in difflib.unified_diff(_shown(before), _shown(after), n=0,
                                                       lineterm="")
                 if line[:1] in "+-" and line[:3] not in ("+++", "---")]
        yield f"{_named(number, now)}: {', '.join(keys)}" + "".join(f"\n      {line[:120]}"
                                                                    for line in lines[:4])


def _shown(cell: Cell) -> list[str]:
    """The texts that a cell puts out, in lines."""
    found = [output.get("text") or output.get("data", {}).get("text/plain", "")
             for output in cell.get("outputs", [])]
    return "\n".join(map(str, found)).splitlines()


def refresh(path: Path, *, check: bool = False) -> tuple[bool, str]:
    """Execute and clean one notebook; return whether all is well, and what changed in words.

    A notebook with an error or a warning is not written. check: write nothing; stale or not clean
    is not well.
    """
    stored = read(path)
    fresh = execute(stored, path.resolve().parent)
    if wrong := list(problems(fresh)):
        return False, f"{path.name}: " + "\n    ".join(["not written" if not check else "fails",
                                                        *wrong])
    before = path.read_text(encoding="utf-8")
    if before == text(fresh):
        return True, f"{path.name}: unchanged"
    differences = list(changes(stored, fresh)) or ["how the file is laid out"]
    if check:
        tidy = before == text(clean(stored))
        same = without_pixels(clean(stored)) == without_pixels(fresh)
        said = "only pixels differ" if tidy and same else " and ".join(
            word for word, is_so in (("stale", not same), ("not clean", not tidy)) if is_so)
        return tidy and same, f"{path.name}: " + "\n    ".join([said, *differences])
    path.write_text(text(fresh), encoding="utf-8", newline="\n")
    return True, f"{path.name}: " + "\n    ".join(["changed", *differences])


def main(arguments: Sequence[str] | None = None) -> int:
    """Refresh the notebooks named on the command line; return 1 if one is not well, 2 if one cannot
    be read.
    """
    parser = argparse.ArgumentParser(prog="python -m hydrolab.course.notebooks",
                                     description=__doc__.split("\n\n")[0])
    parser.add_argument("notebooks", nargs="+", type=Path, metavar="NOTEBOOK")
    parser.add_argument("--check", action="store_true", help="compare with what is stored, write "
                        "nothing")
    options = parser.parse_args(arguments)
    return _refresh_each(options.notebooks, check=options.check)


def refresh_all(book: Path, chapters: Sequence[str] = (), *, check: bool = False) -> int:
    """Refresh the chapters of these numbers, or all of them; return as `main` does.

    Raises BadInput for a chapter that the book has not.
    """
    paths = {str(int(path.name[:2])): path for path in sorted(book.glob("[0-9][0-9]-*.ipynb"))}
    wanted = [chapter.lstrip("0") or "0" for chapter in chapters]
    if missing := [chapter for chapter in wanted if chapter not in paths]:
        raise BadInput(f"The book has no chapter {', '.join(missing)}; it has {', '.join(paths)}.")
    return _refresh_each([paths[chapter] for chapter in wanted or paths], check=check)


def _refresh_each(paths: Sequence[Path], *, check: bool) -> int:
    code = 0
    for path in paths:
        start = time.perf_counter()
        try:
            well, said = refresh(path, check=check)
            code = max(code, 0 if well else 1)
        except BadInput as error:
            said, code = str(error), 2
        first, *rest = said.split("\n")
        print("\n".join([f"{first} ({time.perf_counter() - start:.1f} s)", *rest]), flush=True)
    return code


if __name__ == "__main__":
    sys.exit(main())
