"""The tool that keeps the book fresh: what it takes out, what it reports, and that two runs give
the same bytes.
"""

import base64
import copy
import json
import sys

import pytest

from hydrolab.course import refresh as notebooks
from hydrolab.errors import BadInput

VIEW = "application/vnd.jupyter.widget-view+json"


def code(source, *outputs, count=None, **more):
    return {"cell_type": "code", "source": source, "outputs": list(outputs),
            "execution_count": count,
            "metadata": {}, **more}


def stream(text, name="stdout"):
    return {"output_type": "stream", "name": name, "text": text}


def notebook(*cells, **more):
    return {"cells": list(cells), "metadata": {}, "nbformat": 4, "nbformat_minor": 5, **more}


def write(path, *sources, **more):
    path.write_text(json.dumps(notebook(*(code(source) for source in sources), **more)))
    return path


@pytest.fixture
def used():
    """A notebook as JupyterLab saves it after some work."""
    png = base64.b64encode(b"a PNG").decode()
    shown = {"output_type": "display_data", "metadata": {"image/png": {"width": 3}},
             "data": {"image/png": png, "text/plain": "<Figure>", VIEW: {"model_id": "1a"}}}
    result = {"output_type": "execute_result", "execution_count": 17, "metadata": {},
              "data": {"text/html": f'<img src="data:image/png;base64,{png}">', "text/plain": "a"}}
    lonely = {"output_type": "display_data", "metadata": {}, "data": {VIEW: {"model_id": "2b"}}}
    return notebook(
        {"cell_type": "markdown", "source": "# A title  \n\n", "metadata": {"editable": True},
         "id": "title"},
        code("1\n", shown, result, lonely, count=17, id="same",
             metadata={"execution": {"iopub.execute_input": "2020"}, "tags": ["raises-exception"],
                       "scrolled": True}),
        code("2", stream("a\nb\n"), stream("c", "stderr"), count=3, id="same"),
        code(""), metadata={"widgets": {"state": {}}, "kernelspec": {"name": "mine"}})


def test_clean_takes_out_what_changes_from_run_to_run(used):
    before = copy.deepcopy(used)
    clean = notebooks.clean(used)
    assert used == before
    assert clean["metadata"] == notebooks.METADATA
    title, first, second, empty = clean["cells"]
    assert title == {"cell_type": "markdown", "source": "# A title", "metadata": {}, "id": "title"}
    assert first["metadata"] == {"tags": ["raises-exception"]}
    assert [first["execution_count"], second["execution_count"],
            empty["execution_count"]] == [1, 2, None]
    picture, result = first["outputs"]
    assert set(picture["data"]) == {"image/png", "text/plain"} and picture["metadata"] == {}
    assert result["execution_count"] == 1
    assert second["outputs"] == [stream("a\nb\n"), stream("c", "stderr")]


def test_clean_is_idempotent_and_its_ids_are_stable(used):
    clean = notebooks.clean(used)
    assert notebooks.clean(clean) == clean
    ids = [cell["id"] for cell in clean["cells"]]
    assert ids[:2] == ["title", "same"] and len(set(ids)) == 4
    for cell in used["cells"]:
        cell.pop("id", None)
    used["cells"] += [code("2"), code("2")]
    named = [cell["id"] for cell in notebooks.clean(used)["cells"]]
    assert len(set(named)) == 6
    assert named == [cell["id"] for cell in notebooks.clean(used)["cells"]]


def test_problems_are_named_with_their_cell():
    failed = {"output_type": "error", "ename": "ValueError", "evalue": "no", "traceback": ["…"]}
    bad = notebooks.clean(notebook(code("a()", failed, count=1),
                                   code("b()", stream("hm", "stderr"), count=2), code("c"),
                                   code("d()", failed, count=3,
                                        metadata={"tags": ["raises-exception"]})))
    assert list(notebooks.problems(bad)) == ["cell 1 (a()) raises ValueError: no", "cell 2 (b()) "
                                             "writes to stderr: hm",
                                             "cell 3 (c) has not run"]
    assert bad["cells"][0]["outputs"][0]["traceback"] == []


def refreshed(path, **more) -> int:
    return notebooks.refresh_all(path.parent, [str(path)], **more)


def test_two_executions_give_the_same_bytes(tmp_path):
    path = write(tmp_path / "a.ipynb", "import ipywidgets\nfrom matplotlib.figure import Figure",
                 "figure = Figure(figsize=(1, 1))\nfigure.subplots().plot([1, 2])\nfigure",
                 "print('a')\nprint('b')\nipywidgets.IntSlider(3)",
                 "from hydrolab import rpm\nf'{rpm(30):.3f}'")
    assert refreshed(path) == 0
    first = path.read_bytes()
    assert refreshed(path) == 0
    assert path.read_bytes() == first
    stored = notebooks.read(path)
    assert not list(notebooks.problems(stored))
    assert stored["cells"][3]["outputs"][0]["data"]["text/plain"] == "'3.142'"
    assert VIEW.encode() not in first and str(tmp_path).encode() not in first


def test_a_refresh_says_what_changed(tmp_path, capsys):
    path = write(tmp_path / "a.ipynb", "print('a first line', 'a second', 1 + 1, sep='\\n')")
    assert refreshed(path) == 0
    path.write_text(path.read_text().replace('"2\\n"', '"3\\n"'))
    capsys.readouterr()
    assert refreshed(path) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("a.ipynb: changed") and {"-  3", "+  2"} <= set(said)
    assert refreshed(path) == 0
    assert capsys.readouterr().out.startswith("a.ipynb: unchanged")


def test_check_is_nbval_and_writes_nothing(tmp_path, capfd):
    """A stale number, and a file that is not as the cleaner leaves it; other pixels are no fault.
    """
    path = write(tmp_path / "a.ipynb", "from IPython.display import HTML\nprint(1 + 1)\n"
                 "HTML('data:image/webp;base64,AAAA')")
    assert refreshed(path) == 0
    fresh = path.read_text()
    for stored, code, said in ((fresh.replace("base64,AAAA", "base64,BBBB", 2), 0, "1 passed"),
                               (fresh.replace('"2\\n"', '"3\\n"'), 1, "1 failed"),
                               (fresh.replace("\n ", "\n  "), 1, "not clean, refresh: a.ipynb")):
        path.write_text(stored)
        assert refreshed(path, compare=True) == code
        assert said in capfd.readouterr().out
        assert path.read_text() == stored


def test_without_nbdime_a_refresh_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "nbdime", None)
    with pytest.raises(BadInput, match=r"\[book\]"):
        notebooks.changes(notebook(), notebook())


@pytest.mark.parametrize(("source", "said"), [("1 / 0", "ZeroDivisionError"),
                                              ("import warnings\nwarnings.warn('careful')",
                                               "careful")])
def test_a_notebook_that_fails_or_warns_is_not_written(tmp_path, capsys, source, said):
    path = write(tmp_path / "a.ipynb", source)
    before = path.read_bytes()
    assert refreshed(path) == 1
    assert path.read_bytes() == before
    assert said in capsys.readouterr().out


def test_a_cell_that_does_not_end_is_stopped(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(notebooks, "TIMEOUT", 2)
    assert refreshed(write(tmp_path / "a.ipynb", "while True: pass")) == 2
    assert "timed out" in capsys.readouterr().out


@pytest.mark.parametrize("content", [None, "", "{", "[]", '{"nbformat": 3}', '{"nbformat": 4}'])
def test_what_is_no_notebook_gets_a_sentence(tmp_path, capsys, content):
    path = tmp_path / "a.ipynb"
    if content is not None:
        path.write_text(content)
    assert refreshed(path) == 2
    assert "a.ipynb" in capsys.readouterr().out
