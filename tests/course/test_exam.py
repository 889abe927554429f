"""The exam bank: answers that their own check accepts and that another method confirms, numbers
that differ, statements without solutions, and a draw that can be marked.
"""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hydrolab.cli import course_files, find_book, main
from hydrolab.course import exam
from hydrolab.errors import BadInput

BOOK = find_book()
BANK = exam.bank(BOOK)


def numbers(problem: exam.Problem) -> list[float]:
    """Every number of the situation and the questions, in order."""
    words = " ".join([problem.situation, *(part.ask for part in problem.parts)])
    return [float(found) for found in re.findall(r"\d+\.?\d*", words)]


def answers(problem: exam.Problem) -> list:
    return [part.answer.right() for part in problem.parts if part.answer]


@pytest.mark.parametrize("name", BANK)
def test_a_problem(name):
    first, other = (exam.drawn(BANK[name], 5, student) for student in ("ada", "emmy"))
    again = exam.drawn(BANK[name], 5, "ada")
    assert exam.solution([first], "x") == exam.solution([again], "x")  # each answer is accepted
    drawn = [exam.drawn(BANK[name], seed, "ada") for seed in range(8)]
    assert len({tuple(numbers(problem)) for problem in drawn}) > 1
    assert len({str(answers(problem)) for problem in drawn}) > 1
    assert 5 <= first.points == other.points <= 10 and 10 <= first.minutes <= 40
    assert all(part.rubric and 1 <= part.points <= 3 for part in first.parts)
    assert set(first.chapters) <= set(range(15))
    statement = exam.statement([first], "x")
    for right in answers(first):  # the digits of an answer stand nowhere in the statement
        if isinstance(right, float) and len(f"{abs(right):.5g}".replace(".", "").strip("0")) == 5:
            assert f"{abs(right):.5g}" not in statement
    for part in first.parts:
        assert not [words for _, words in part.rubric if len(words) > 20 and words in statement]


def by_sampling(problem):
    """Two probes: the ellipse, point by point."""
    a, b, lag = numbers(problem)[:3]
    t = np.linspace(0, 2 * np.pi, 200_001)
    x, z = a * np.sin(t), b * np.cos(t - np.radians(lag))
    turned = np.sum(z[:-1] * np.diff(x) - x[:-1] * np.diff(z))
    return [np.hypot(x, z).max(), np.hypot(x, z).min(), "forward" if turned > 0 else "backward"]


def by_recursion(problem):
    """A clock that is wrong: both methods stepped, the frequency from their eigenvalues."""
    steps, turns = numbers(problem)[0], numbers(problem)[-1]
    wt = 2 * np.pi / steps
    central = np.linalg.eigvals([[2 - wt**2, -1], [1, 0]])
    half = np.array([[1, -wt / 2], [wt / 2, 1]])
    newmark = np.linalg.eigvals(np.linalg.solve(half, half.T))
    fast, slow = (np.abs(np.angle(values)).max() / wt - 1 for values in (central, newmark))
    return [100 * fast, -100 * slow, 360 * turns * fast]


def by_integration(problem):
    """A breaker opens: the speed in time."""
    n, H, closing = numbers(problem)[:3]
    run = solve_ivp(lambda t, w: (1 - t / closing) / (2 * H * w), (0, closing), [1.0], rtol=1e-10)
    return [n / (2 * H), n * run.y[0, -1], run.y[0, -1]**2]


def by_roots(problem):
    """A disc that tilts: the quadratic's roots, at the speed given."""
    ratio, f, n = (numbers(problem)[k] for k in (1, 2, 3))
    w = np.roots([1, -ratio * n * np.pi / 30, -(2 * np.pi * f)**2]) / (2 * np.pi)
    return [w.max(), -w.min()]


def by_eigenvalues(problem):
    """A seal that drives: where an eigenvalue has no damping left."""
    f, percent = numbers(problem)[1:3]
    w, m, q = 2 * np.pi * f, 150e3, 0.0

    def growth(q):
        K = m * w**2 * np.eye(2) + q * np.array([[0, -1], [1, 0]])
        A = np.block([[np.zeros((2, 2)), np.eye(2)],
                      [-K / m, -2 * percent / 100 * w * np.eye(2)]])
        return np.linalg.eigvals(A).real.max()

    low, high = 0.0, 1e8
    for _ in range(60):
        q = (low + high) / 2
        low, high = (q, high) if growth(q) < 0 else (low, q)
    return [q / 1e6, np.exp(growth(2 * q))]


def by_search(problem):
    """Warned by a root: the fold at which the three readings lie on one line of roots."""
    values = numbers(problem)[1:]
    seen, late = np.array(values[0:6:2]), np.array(values[1:6:2])
    folds = late.max() + np.linspace(1e-3, 1.0, 200_001)
    roots = np.sqrt(folds[:, None] - late)
    slopes = np.diff(seen) / np.diff(roots, axis=1)
    best = np.argmin(np.abs(slopes[:, 0] - slopes[:, 1]))
    return [folds[best], seen[2] - slopes[best, 1] * roots[best, 2]]


def by_influence(problem):
    """A trial mass: the mass found is tried on the same machine."""
    first, lag, trial, at, size, phase = np.array(numbers(problem)[1:7])
    words = problem.situation
    phase = float(re.search(r"µm at (-?[\d.]+)°; ", words)[1])
    r0 = first * np.exp(-1j * np.radians(lag))
    r1 = size * np.exp(1j * np.radians(phase))
    influence = (r1 - r0) / (trial * np.exp(1j * np.radians(at)))
    mass = -r0 / influence
    return [abs(influence), abs(mass), np.degrees(np.angle(mass))]


@pytest.mark.parametrize(("name", "otherwise"), {
    "two_probes": by_sampling, "clock_that_is_wrong": by_recursion, "load_rejection":
    by_integration, "gyroscope": by_roots, "seal_that_drives": by_eigenvalues,
    "warned_by_a_root": by_search, "trial_mass": by_influence}.items())
def test_another_method_gives_the_same(name, otherwise):
    for seed in range(4):
        problem = exam.drawn(BANK[name], seed, "ada")
        for right, theirs in zip(answers(problem), otherwise(problem), strict=False):
            assert right == (theirs if isinstance(theirs, str)
                             else pytest.approx(theirs, rel=5e-3)), (problem.situation, right)


def test_the_page_lists_the_bank():
    page = (BOOK / "instructor" / "problems.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([^|]+) \| ([\d, ]+) \| (\d+) \| (\d+) \|$", page, re.MULTILINE)
    problems = [exam.drawn(draw, 1, "ada") for draw in BANK.values()]
    assert sorted(rows) == sorted((p.title, ", ".join(map(str, p.chapters)), str(p.minutes),
                                   str(p.points)) for p in problems)
    assert len(rows) >= 40 and f"the {len(rows)} problems" in page
    assert (f"{sum(p.minutes for p in problems)} minutes and {sum(p.points for p in problems)} "
            "points") in page
    assert set().union(*(p.chapters for p in problems)) == set(range(15))


def test_students_have_no_bank(tmp_path):
    assert not [path for path in course_files(BOOK) if "instructor" in path.parts]
    project = tomllib.loads((BOOK.parent / "pyproject.toml").read_text(encoding="utf-8"))
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert {"book/instructor/*.md", "book/instructor/exam"} <= set(wheel["exclude"])
    assert "force-include" not in wheel  # which would not ask what is excluded
    with pytest.raises(BadInput, match="not installed with hydrolab"):
        exam.bank(tmp_path)


def answered(path: Path, problems: list[exam.Problem], change: str) -> None:
    """Put the right answers into a statement's lines, numbers changed."""
    right = {f"answer_{k}{letter}": part.answer.right() for k, problem in enumerate(problems, 1)
             for letter, part in zip("abcdefgh", problem.parts, strict=False) if part.answer}
    notebook = json.loads(path.read_text(encoding="utf-8"))
    for cell in notebook["cells"]:
        if (name := "".join(cell["source"]).split(" = ")[0]) in right:
            value = right[name]
            cell["source"] = [f"{name} = {value!r}{'' if isinstance(value, str) else change}"]
    path.write_text(json.dumps(notebook), encoding="utf-8")


def test_an_exam_is_drawn_and_marked(tmp_path, capsys):
    (tmp_path / "names.txt").write_text("Ada\nEmmy\n\nSofia\n", encoding="utf-8")
    out = tmp_path / "exam"
    draw = ["exam", "--seed", "11", "--out", str(out), "--students", str(tmp_path / "names.txt"),
            "--minutes", "90", "--chapters", "1", "2", "4", "5", "6", "7"]
    assert main(draw) == 0
    assert "points for 3 students" in capsys.readouterr().out
    assert main(draw) == 2  # a second draw must not mix with the first
    names = json.loads((out / "exam.json").read_text(encoding="utf-8"))["problems"]
    drawn = [exam.drawn(BANK[name], 11, "Ada") for name in names]
    assert 60 <= sum(problem.minutes for problem in drawn) <= 90
    assert {chapter for p in drawn for chapter in p.chapters} <= {1, 2, 4, 5, 6, 7}
    ada, emmy, sofia = (out / "statements" / f"{name}.ipynb" for name in ("Ada", "Emmy", "Sofia"))
    answered(ada, drawn, "")
    answered(emmy, [exam.drawn(BANK[name], 11, "Emmy") for name in names], " * 2")
    sofia.write_bytes(ada.read_bytes())  # another's paper
    capsys.readouterr()
    assert main(["grade", str(out / "statements"), "--exam", str(out / "exam.json")]) == 0
    said = capsys.readouterr().out
    sums = {row.split()[0]: int(row.split()[-1]) for row in said.splitlines()[1:4]}
    closed = sum(part.points for p in drawn for part in p.parts if part.answer)
    assert sums["Ada"] == closed and f"Of {closed} points" in said
    assert sums["Emmy"] < closed / 2 and sums["Sofia"] < closed
    assert "A factor of two stands wrong" in said
    assert main(["grade", str(out), "--exam", str(tmp_path / "names.txt")]) == 2


def test_bad_lists_of_students(tmp_path):
    path = tmp_path / "names.txt"
    for words in ("", "a/b", "Ada\nada"):
        path.write_text(words, encoding="utf-8")
        with pytest.raises(BadInput, match="names that differ"):
            exam.read_students(path, 1)
    with pytest.raises(BadInput, match="minutes"):
        exam.chosen(BANK, 1, 5)
    assert exam.read_students(None, 2) == ["01", "02"]
