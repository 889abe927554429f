"""Numbers in the folded answers to "three questions" are what the library computes."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hydrolab import (
    Arclength,
    CircularPull,
    HarmonicBalance,
    floquet,
    follow,
    load_machine,
    orbits_at,
    vary,
)
from hydrolab.course import pages

BOOK = Path(__file__).resolve().parents[2] / "book"
ANSWERS = {int(name[:2]): " ".join(re.findall(r"<summary>Answers</summary>(.*?)</details>",
                                              "\n".join(pages.sources(notebook)), re.DOTALL))
           for name, notebook in pages.chapters(BOOK).items()}
UNIT, POINT = load_machine("kaplan-150rpm"), load_machine("jeffcott")


@cache
def steady(percent: float):
    return HarmonicBalance(harmonics=4).solve(UNIT.model(), UNIT.speed, percent / 100)


@cache
def branch(unbalance=1.0, field=1.0, guide=None):
    """The unit over the eccentricity, past three folds."""
    machine = UNIT if guide is None else vary(
        UNIT, {"bearings.generator guide bearing.stiffness": guide})
    model = machine.model().with_unbalance(unbalance).with_field(field)
    return follow(model, "static_eccentricity", to=0.12, speed=UNIT.speed,
                  method=Arclength(max_folds=3))


def folds(**change) -> list[float]:
    return [100 * fold.value for fold in branch(**change).folds]


@cache
def stable(percent: float):
    """The stable orbits at an eccentricity, the small one first."""
    found = [o for o in orbits_at(branch(), percent / 100) if floquet(o).verdict == "stable"]
    return sorted(found, key=lambda orbit: orbit.amplitudes[0, 0])


def microns(percent: float, axis: int, order: int) -> float:
    return 1e6 * steady(percent).amplitudes[axis, order - 1]


def ends() -> tuple[float, float]:
    """How far the orbit at 8.8 % reaches from its mean, towards +x and −x, mm."""
    x = steady(8.8).positions(np.linspace(0, 2 * np.pi, 721))[0] - steady(8.8).mean[0]
    return 1e3 * x.max(), -1e3 * x.min()


def gap(orbit) -> str:
    return f"{1e3 * orbit.smallest_gap:.2f}"


def offset() -> float:
    """How far the mass centre of the point mass lies off its axis, m."""
    return POINT.bodies[0].unbalance / POINT.bodies[0].mass


def pull(eps: float) -> float:
    return float(CircularPull(1.0, 1.0).force(np.array([eps, 0.0]))[0])


@cache
def tuned(depth=0.953, mass=119.0, unbalance=1.0) -> tuple[float, float]:
    """1X when centred, µm, and the first fold, %, as the explorer of chapter 8 sets the unit."""
    nodes = UNIT.shaft.nodes.copy()
    nodes[UNIT.bearings[0].node] = depth
    machine = vary(UNIT, {"shaft.nodes": nodes, "unbalance": unbalance, "bodies.generator.mass":
                          1e3 * mass})
    found = follow(machine.model(), "static_eccentricity", to=0.12, speed=UNIT.speed,
                   method=Arclength(max_folds=1))
    return 1e6 * found[0].amplitudes[0, 0], 100 * found.folds[0].value


def test_three_numbers_that_agree_with_two_readings():
    """Chapter 8's third answer: other masses, other depths, the same readings."""
    for mass, depth, share in ((60.0, 0.966, 1.10), (150.0, 0.940, 0.97)):
        assert f"{mass:.0f} t " in ANSWERS[8]
        assert f"{depth:.3f} m with {share:.2f} times" in ANSWERS[8]
        size, fold = tuned(depth, mass, share)
        assert abs(size - 200) < 2 and 8.90 <= fold <= 8.95


SAID = {
    "0 how far": (0, lambda: f"{microns(8.8, 1, 1):.0f} µm"),
    "0 two ends": (0, lambda: "{:.1f} mm against {:.1f} mm".format(*ends())),
    "0 the mean": (0, lambda: f"The mean moves by {-1e3 * steady(3.0).mean[0]:.2f} mm"),
    "1 damping": (1, lambda: f"About {100 * offset() / (2 * POINT.air_gap.gap):.1f} %"),
    "2 too small": (2, lambda: f"its force is only {100 * (1 - 0.3 / pull(0.3)):.0f} % too small"),
    "5 the fold": (5, lambda: "up to the fold at {:.3f} %".format(
        100 * follow(POINT.model(), "static_eccentricity", to=0.2, speed=POINT.speed,
                     method=Arclength(max_folds=1)).folds[0].value)),
    "8 unbalance": (8, lambda: f"from {tuned(unbalance=0.3)[0]:.0f} to "
                    f"{tuned(unbalance=2.0)[0]:.0f} µm"),
    "8 folds": (8, lambda: f"from {tuned(unbalance=0.3)[1]:.2f} to "
                f"{tuned(unbalance=2.0)[1]:.2f} %"),
    "8 depth": (8, lambda: f"At 0.952 m the fold lies at {tuned(0.952)[1]:.2f} %, at 0.956 m at "
                f"{tuned(0.956)[1]:.2f} %"),
    "10 second": (10, lambda: f"to {microns(8.9, 0, 2):.0f} µm, 2.1 times"),
    "10 first": (10, lambda: f"to {microns(8.9, 0, 1):.0f} µm, 1.6 times"),
    "10 across": (10, lambda: f"by then, {microns(8.9, 1, 1):.0f} µm"),
    "10 gaps": (10, lambda: "its smallest gap is {} mm, on leg 1 it is {} mm".format(
        *map(gap, stable(8.8)[::-1]))),
    "10 field": (10, lambda: f"from {folds()[0]:.2f} to {folds(field=1.02)[0]:.2f} %"),
    "10 a tenth": (10, lambda: f"static pull-in near {folds(unbalance=0.1)[0]:.1f} %"),
    "10 softer": (10, lambda: "from {:.2f} to {:.2f} % of the gap, the third from "
                  "{:.2f} to {:.2f} %".format(*(folds(guide=guide)[k] for k in (0, 2)
                                                for guide in (None, 1.2e9)))),
    "10 at 8.9": (10, lambda: "its smallest gap is {} mm; on leg 1, at the same eccentricity, it "
                  "was {} mm".format(*map(gap, stable(8.9)[::-1]))),
    "10 sizes": (10, lambda: "{:.0f} µm along the eccentricity on orbit 1, {:.0f} µm on orbit "
                 "3".format(*(1e6 * o.amplitudes[0, 0] for o in stable(8.8)))),
    "10 the end": (10, lambda: f"its third fold at {folds()[2]:.2f} %"),
}


@pytest.mark.parametrize("claim", SAID)
def test_an_answer_says_what_is_computed(claim):
    chapter, computed = SAID[claim]
    assert computed() in ANSWERS[chapter], computed()


@pytest.mark.parametrize("chapter", sorted(set(ANSWERS) - {13}))
def test_every_explorer_of_three_questions_is_answered(chapter):
    name = next(name for name in pages.chapters(BOOK) if int(name[:2]) == chapter)
    text = "\n".join(pages.sources(pages.chapters(BOOK)[name]))
    asked = re.split(r"^#+ [^\n]*[Tt]hree questions[^\n]*$", text, flags=re.MULTILINE)[1:]
    for block in asked:
        block = re.split(r"^## ", block, flags=re.MULTILINE)[0]
        questions, _, answers = block.partition("<summary>Answers</summary>")
        numbers = [re.findall(r"^(\d)\. ", part, re.MULTILINE) for part in (questions, answers)]
        assert numbers == [["1", "2", "3"]] * 2
