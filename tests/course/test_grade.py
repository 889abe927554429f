"""Returned notebooks are read, not run; a value in the limited form is judged, and nothing else."""

import ast
import json
import math

import pytest

from hydrolab.cli import main
from hydrolab.course.answers import chapters
from hydrolab.course.grade import Unreadable, marks, value_of
from hydrolab.errors import BadInput

ASKED = {number: (asked, 1) for of_chapter in chapters().values()
         for number, asked in of_chapter.items()}

def returned(path, *cells):
    path.parent.mkdir(parents=True, exist_ok=True)
    code = [{"cell_type": "code", "id": f"c{i}", "source": source, "metadata": {},
             "execution_count": 1, "outputs": [{"output_type": "stream", "name": "stdout",
                                                "text": text}]}
            for i, (source, text) in enumerate(cells)]
    path.write_text(json.dumps({"cells": code, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}))
    return path


@pytest.mark.parametrize(("text", "value"), [
    ("2 * math.pi * 90 / 60", 3 * math.pi), ("-3.5", -3.5), ("[1, -2]", [1, -2]),
    ("sqrt(16)", 4.0), ("np.sqrt(2) ** 2", pytest.approx(2.0)), ("{'number': 7}", {"number": 7}),
    ("'forward'", "forward"), ("half * 2", 1.0), ("...", ...)])
def test_the_limited_form(text, value):
    assert value_of(ast.parse(text, mode="eval").body, {"half": 0.5}) == value


@pytest.mark.parametrize("text", ["open('x')", "__import__('os')", "x", "a.b", "[i for i in 'ab']",
                                  "9 ** 999999999", "lambda: 1", "'a' * 9", "f'{1}'"])
def test_everything_else_is_not_read(text):
    with pytest.raises(Unreadable):
        value_of(ast.parse(text, mode="eval").body, {})


def test_marks_of_a_notebook(tmp_path):
    path = returned(
        tmp_path / "a.ipynb",
        ("speed = 2 * 3.14159265 * 90 / 60\ncheck('0.1a', speed)\ncheck('0.1b', 90)", ""),
        ("x = law.force(u)\ncheck('2.1a', x)", "2.1a: right.\n"),
        ("raise SystemExit\ncheck('0.3', ...)\ncheck('77.1', 3)", ""), ("not python at (", ""))
    found = {number: str(mark) for number, mark in marks(path, ASKED).items()}
    assert found == {"0.1a": "1", "0.1b": "0", "2.1a": "1*", "0.3": "-"}


def test_the_command(tmp_path, capsys):
    for name, answer in (("ada", 9.42477796), ("bo", 90), ("cy", 90)):
        returned(tmp_path / name / "00-start-here.ipynb", (f"check('0.1a', {answer})", ""))
    assert main(["grade", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "  2 × 0.1a: " in said and "rpm" in said
    assert (tmp_path / "grades.csv").read_text().splitlines() == [
        "student,0.1a,sum", "ada,1,1", "bo,0,0", "cy,0,0"]
    assert main(["grade", str(tmp_path / "none")]) == 2
    broken = tmp_path / "ada" / "broken.ipynb"
    broken.write_text("x")
    with pytest.raises(BadInput, match="is not a notebook"):
        marks(broken, ASKED)
