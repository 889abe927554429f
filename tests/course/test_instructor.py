"""The instructor's pages: every chapter in the syllabus, links that resolve."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from hydrolab.course import pages

FOLDER = Path(__file__).resolve().parents[2] / "book" / "instructor"
TEXTS = {path.stem: path.read_text(encoding="utf-8") for path in sorted(FOLDER.glob("*.md"))}
CHAPTERS = {int(name[:2]) for name in pages.chapters(FOLDER.parent)}


def test_every_chapter_has_its_time():
    rows = re.findall(r"^\| (\d+) [^|]+\| (\d+) min \| (\d+) min \|", TEXTS["syllabus"],
                      re.MULTILINE)
    assert [int(row[0]) for row in rows] == list(range(len(rows)))
    reading, exercises = (sum(int(row[i]) for row in rows) / 60 for i in (1, 2))
    said = re.search(r"about (\d+) hours of reading and (\d+) of exercises", TEXTS["syllabus"])
    assert (round(reading), round(exercises)) == tuple(map(int, said.groups()))
    for name, notebook in pages.chapters(FOLDER.parent).items():
        minutes = re.search(r"about (\d+) minutes", "\n".join(pages.sources(notebook)))[1]
        assert dict((int(number), time) for number, time, _ in rows)[int(name[:2])] == minutes, name


def times() -> dict[int, tuple[int, int]]:
    """Minutes of reading and of exercises of each chapter."""
    rows = re.findall(r"^\| (\d+) [^|]+\| (\d+) min \| (\d+) min \|", TEXTS["syllabus"],
                      re.MULTILINE)
    return {int(number): (int(reading), int(work)) for number, reading, work in rows}


@pytest.mark.parametrize(("weeks", "sessions"), [("Four", 8), ("Eight", 8), ("Fourteen", 14)])
def test_a_plan_adds_up(weeks, sessions):
    """Minutes in class and of reading, no hand-in before its chapter, chapters in order."""
    plan = TEXTS["syllabus"].split(f"## {weeks} weeks")[1].split("\n## ")[0]
    rows = re.findall(r"^\| [\d.]+ \| ([\d, ]+) \| (\d+) min \| ([^|]+) \| ([^|]+) \|$", plan,
                      re.MULTILINE)
    assert len(rows) == sessions
    taught = []
    for before, reading, in_class, hand_in in rows:
        chapters = [int(chapter) for chapter in before.split(",")]
        assert sum(times()[chapter][0] for chapter in chapters) == int(reading) <= 180
        assert sum(int(part.split()[-1]) for part in in_class.split(";")) == 90
        assert re.search("in pairs|each pair|in groups|each group", in_class)
        taught += chapters
        assert {int(n) for n in re.findall(r"(\d+)\.\d", hand_in)} <= set(chapters)
    assert taught == sorted(set(taught))
    left_out = re.search(r"Left out: ([\d, and]+)\.", plan)
    missing = [int(n) for n in re.findall(r"\d+", left_out[1])] if left_out else []
    assert sorted([*taught, *missing]) == sorted(times())
    exam = re.search(r"--chapters ([\d ]+)`", plan)
    assert exam is None or [int(n) for n in exam[1].split()] == taught


def test_the_test_of_what_must_be_known():
    asked, answers = TEXTS["prerequisites"].split("## Answers")
    numbers = re.findall(r"^(\d+)\. ", asked, re.MULTILINE)
    rows = re.findall(r"^\| (\d+) \| ([^|]+) \| [^|]{8,} \|$", answers, re.MULTILINE)
    assert numbers == [number for number, _ in rows] and len(numbers) == 10
    said = dict(rows)
    assert f"{(800 / 2) ** 0.5:.0f} rad/s, {(800 / 2) ** 0.5 / (2 * np.pi):.2f} Hz" == said["1"]
    assert said["2"] == f"{150 * np.pi / 30:.1f} rad/s"
    assert float(said["3"].split("− ")[1].strip(")")) == pytest.approx(np.arctan2(3, 4), abs=1e-4)
    assert said["5"] == "4/3" and 1 - (1 - 2) / 3 == pytest.approx(4 / 3)
    assert np.allclose(np.sort_complex(np.roots([1, 0, 4])), [-2j, 2j]) and said["6"] == "±2i"
    assert said["10"] == str((np.arange(4) ** 2)[1:].sum())


def test_every_question_of_a_run_sheet_has_an_answer():
    for path in FOLDER.glob("*.toml"):
        sheet = tomllib.loads(path.read_text(encoding="utf-8"))
        for step in sheet["step"]:
            found = re.search(rf"^\| {re.escape(step['ask'])} \| ([^|]+) \|$", TEXTS["answers"],
                              re.MULTILINE)
            assert found, step["ask"]
            if "answer" in step:
                assert found[1].startswith(f"{step['answer']}. "), step["ask"]


def test_every_misconception_has_a_question():
    rows = re.findall(r"^\| ([A-Z\"][^|]+)\| ([\d, ]+) \| (\"[^|]+) \| ([^|]+) \|$",
                      TEXTS["misconceptions"], re.MULTILINE)
    assert len(rows) == TEXTS["misconceptions"].count("\n| ") - 1 == 17
    transfer = re.findall(r"^(\d+)\. [^*]+\? \*[^*]+\*$", TEXTS["misconceptions"], re.MULTILINE)
    assert transfer == [str(k) for k in range(1, len(rows) + 1)]
    for _, chapters, question, answer in rows:
        assert {int(chapter) for chapter in chapters.split(",")} <= CHAPTERS
        assert (question.count('"') == 2 and "?" in question) or "Write the sentence" in question
        assert len(answer) > 60


@pytest.mark.parametrize("name", TEXTS)
def test_links_of_the_instructors_pages(name):
    for target in re.findall(r"\]\(([^)\s#]+)", TEXTS[name]):
        assert (FOLDER / target).is_file(), target
