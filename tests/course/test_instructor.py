"""The instructor's pages: every chapter in the syllabus, links that resolve."""

import re
from pathlib import Path

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


@pytest.mark.parametrize("weeks", ["Four", "Eight", "Fourteen"])
def test_a_syllabus_for(weeks):
    assert f"## {weeks} weeks" in TEXTS["syllabus"]


def test_every_misconception_has_a_question():
    rows = re.findall(r"^\| ([A-Z\"][^|]+)\| ([\d, ]+) \| (\"[^|]+) \| ([^|]+) \|$",
                      TEXTS["misconceptions"], re.MULTILINE)
    assert len(rows) == TEXTS["misconceptions"].count("\n| ") - 1 == 12
    for _, chapters, question, answer in rows:
        assert {int(chapter) for chapter in chapters.split(",")} <= CHAPTERS
        assert (question.count('"') == 2 and "?" in question) or "Write the sentence" in question
        assert len(answer) > 60


@pytest.mark.parametrize("name", TEXTS)
def test_links_of_the_instructors_pages(name):
    for target in re.findall(r"\]\(([^)\s#]+)", TEXTS[name]):
        assert (FOLDER / target).is_file(), target
