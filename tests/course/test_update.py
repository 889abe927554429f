"""A handed-out copy is brought up to date: what a student wrote stays, what they left alone is
replaced, and no solution comes along.
"""

import json

import pytest

from hydrolab.cli import main
from hydrolab.course import hand_out
from hydrolab.course.refresh import read
from hydrolab.errors import BadInput


def cell(name, source, kind="markdown"):
    more = {"outputs": [], "execution_count": None} if kind == "code" else {}
    return {"cell_type": kind, "id": name, "source": source, "metadata": {}} | more


def write(path, *cells, **metadata):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"cells": list(cells), "metadata": metadata, "nbformat": 4,
                                "nbformat_minor": 5}), encoding="utf-8")


FOLDED = "<details>\n<summary>Solution</summary>\n\nforty-two\n\n</details>"
FIRST = (cell("title", "# One"), cell("text", "old words"), cell("stub", "a = ...", "code"),
         cell("fold", f"**1.1**\n\n{FOLDED}"), cell("gone", "soon gone"), cell("last", "the end"))
SECOND = (cell("title", "# One"), cell("text", "new words"), cell("stub", "a = ...  # mm", "code"),
          cell("fold", f"**1.1** again\n\n{FOLDED}"), cell("more", "a new cell"),
          cell("last", "the very end"))


@pytest.fixture
def copies(tmp_path):
    book, folder = tmp_path / "book", tmp_path / "class"
    write(book / "01-one.ipynb", *FIRST)
    (book / "glossary.md").write_text("words")
    files = [path.relative_to(book) for path in sorted(book.iterdir())]
    hand_out.hand_out(book, files, folder)
    notebook = json.loads((folder / "01-one.ipynb").read_text(encoding="utf-8"))
    assert notebook["metadata"]["hydrolab"]["version"] == hand_out.__version__
    write(book / "01-one.ipynb", *SECOND)
    return book, files, folder


def sources(folder):
    return [cell["source"] for cell in read(folder / "01-one.ipynb")["cells"]]


def test_what_was_left_alone_is_replaced(copies):
    book, files, folder = copies
    said = hand_out.update(book, files, folder)
    assert sources(folder) == ["# One", "new words", "a = ...  # mm", "**1.1** again",
                               "a new cell", "the very end"]
    for words in ("changed: new words", "taken out: soon gone", "new: a new cell"):
        assert words in said
    assert "forty-two" not in (folder / "01-one.ipynb").read_text(encoding="utf-8") + said
    assert "up to date" in hand_out.update(book, files, folder)


def test_what_a_student_wrote_stays(copies):
    book, files, folder = copies
    path = folder / "01-one.ipynb"
    mine = read(path)
    by_id = {cell["id"]: cell for cell in mine["cells"]}
    by_id["stub"] |= {"source": "a = 3.2", "execution_count": 4, "outputs": [
        {"output_type": "stream", "name": "stdout", "text": "1.1: right."}]}
    by_id["gone"]["source"] += ", with my remark"
    mine["cells"].remove(by_id["last"])
    mine["cells"].insert(3, cell("mine", "my own notes"))
    mine["cells"].insert(0, cell("name", "Ada"))
    write(path, *mine["cells"], **mine["metadata"])
    (folder / "glossary.md").write_text("my words")
    (folder / "own.txt").write_text("mine")
    said = hand_out.update(book, files, folder)
    assert sources(folder) == ["Ada", "# One", "new words", "a = 3.2", "my own notes",
                               "**1.1** again", "soon gone, with my remark", "a new cell"]
    assert "kept as you have it: a = ...  # mm" in said
    kept = {cell["id"]: cell for cell in read(path)["cells"]}["stub"]
    assert kept["execution_count"] == 4 and kept["outputs"][0]["text"] == "1.1: right."
    assert (folder / "glossary.md").read_text() == "words"
    assert (folder / "glossary.md.before").read_text() == "my words"
    assert (folder / "own.txt").read_text() == "mine"


def test_a_copy_without_a_version_keeps_everything(copies):
    book, files, folder = copies
    mine = read(folder / "01-one.ipynb")
    write(folder / "01-one.ipynb", *mine["cells"])
    hand_out.update(book, files, folder)
    kept = sources(folder)
    assert {"old words", "a = ...", "soon gone", "the end", "a new cell"} <= set(kept)


def test_the_command(tmp_path, capsys):
    folder = tmp_path / "class"
    assert main(["lab", "--update"]) == 2
    assert main(["lab", "--students", str(folder), "--update"]) == 2
    assert "no chapter to update" in capsys.readouterr().err
    assert main(["lab", "--students", str(folder)]) == 0
    assert main(["lab", "--students", str(folder)]) == 2
    assert "--update" in capsys.readouterr().err
    assert main(["lab", "--students", str(folder), "--update"]) == 0
    assert "up to date" in capsys.readouterr().out
    with pytest.raises(BadInput, match="no chapter"):
        hand_out.update(tmp_path, [], tmp_path / "none")
