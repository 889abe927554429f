"""What the book needs: what a chapter imports, and what makes notebooks and pages.

In a chapter: `checks` tells whether an answer is right and names the usual mistakes, for the
exercises that the book's folder holds (written in `answers`); `predictions` keeps what a student
expected beside what came out; `illustrations` are its pictures that are no result; `records` are
the vibration records of chapter 12. Around the chapters, imported by their own names: `refresh`
runs, cleans and compares them, `hand_out` takes the solutions out, `exam` draws and `grade` marks,
`pages` and `static_book` make the static book.
"""

from hydrolab.course import records
from hydrolab.course.checks import check
from hydrolab.course.illustrations import (
    conventions_picture,
    counts,
    gap_picture,
    section_picture,
    sources_picture,
)
from hydrolab.course.predictions import answer, predict, recall
from hydrolab.course.records import (
    Condition,
    diagnose,
    evidence,
    healthy,
    record_text,
    recording,
    unknown_machine,
)

__all__ = [
    "Condition", "answer", "check", "conventions_picture", "counts", "diagnose", "evidence",
    "gap_picture", "healthy", "predict", "recall", "record_text", "recording", "records",
    "section_picture", "sources_picture", "unknown_machine",
]
