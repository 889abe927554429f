"""Every force law through everything that reads a machine or a result: what is drawn and said is
the result's own number, or there is a sentence that says why not.
"""

import copy
import json
import math
import pickle
import re
from functools import cached_property

import numpy as np
import pytest

from hydrolab import (
    BadInput,
    HarmonicBalance,
    Newmark,
    NoConvergence,
    basins,
    explorers,
    follow,
    integrate,
    orbits_at,
    steady_map,
    sweep,
    sweep_in_time,
    vary,
)
from hydrolab.dynamics.modes import modes
from hydrolab.dynamics.stability import floquet_all
from hydrolab.explorers import eccentricity, moving_branch, past_fold
from hydrolab.explorers.kept_figure import KeptFigure
from hydrolab.explorers.legs import Legs
from hydrolab.figures import (
    Picture,
    basins_picture,
    branch_picture,
    hysteresis_picture,
    map_picture,
    multipliers_picture,
    orbit_picture,
    study_pictures,
)
from hydrolab.figures.readings import first_along, microns, reading
from hydrolab.figures.rotor import supports
from hydrolab.paper.report import report
from hydrolab.paper.study import PERCENTAGES, Study
from tests.machines import MACHINES

SCALE = 0.43  # of the paper's percentages, so that all of them lie within 4 %


class Case:
    """A machine and its results, each made once."""

    def __init__(self, name):
        self.name, self.machine = name, MACHINES[name]()
        self.model, self.speed = self.machine.model(), self.machine.speed
        self.has_gap = math.isfinite(self.model.gap)

    @cached_property
    def orbit(self):
        return orbits_at(self.branch, 0.02)[0] if self.has_gap else self.branch[0]

    @cached_property
    def fine(self):
        """The orbit with twice as many harmonics."""
        return HarmonicBalance(8).solve(self.model, self.speed, self.orbit.static_eccentricity,
                                        start=self.orbit)

    @cached_property
    def branch(self):
        if self.has_gap:
            return follow(self.model, to=0.04, speed=self.speed)
        return follow(self.model, "speed", to=1.05 * self.speed, speed=self.speed)

    @cached_property
    def stability(self):
        return floquet_all([*self.branch], quick=True)

    @cached_property
    def legs(self):
        return Legs(self.branch, self.stability)

    @cached_property
    def motion(self):
        return self.integrated(self.fine, modes=None)

    def integrated(self, start, modes=12):
        return integrate(self.model, Newmark(192), speed=self.speed, start=start, revolutions=2,
                         static_eccentricity=start.static_eccentricity, modes=modes)

    @cached_property
    def study(self):
        """What `run_study` would give with all percentages on the branch that is at hand."""
        orbits = {p: orbits_at(self.branch, p / 100 * SCALE)[0] for p in PERCENTAGES}
        natural = sweep(self.model, HarmonicBalance(4), [0.0, 0.01, 0.02], speed=self.speed)
        last = orbits[8.9]
        return Study(self.machine, self.model, self.speed, SCALE, self.branch, orbits, natural,
                     tuple(self.stability), self.integrated(orbits[8.8]), self.integrated(last),
                     ((last, floquet_all([last], quick=True)[0]),), 0.0)


CASES = {}


@pytest.fixture(params=MACHINES)
def case(request):
    if request.param not in CASES:
        CASES[request.param] = Case(request.param)
    return CASES[request.param]


def orbit(case):
    picture = orbit_picture(case.orbit)
    path = picture.figure.axes[0].lines[0].get_xydata().T / 1e3
    assert np.allclose(path, case.orbit.positions(2 * np.pi * np.arange(721) / 720), atol=1e-12)
    assert f"1X is {microns(case.orbit.amplitudes[0, 0])} in x" in picture.reading
    assert f"{case.orbit.amplitudes[0, 0] * 1e6:.3g}/" in str(case.orbit)
    if case.has_gap:
        assert f"smallest gap is {1e3 * case.orbit.smallest_gap:.3f} mm" in picture.reading
        wall = picture.figure.axes[1].lines[0].get_xydata().T / 1e3 - case.orbit.centre[:, None]
        touching = case.model.law.smallest_gap(wall[:, :, None], np.linspace(0, 2 * np.pi, 24,
                                                                             endpoint=False))
        assert np.abs(touching.min(axis=1)).max() < 2e-9


def branch(case):
    picture = branch_picture(case.branch, case.stability)
    first = first_along(case.branch)
    line = np.vstack([line.get_xydata() for line in picture.figure.axes[1].lines])
    unit = 100 if case.has_gap else 30 / math.pi  # per cent, rpm
    for value, size in zip(unit * case.branch.values, 1e6 * first, strict=True):
        away = np.abs((line - [value, size]) / [max(value, 1.0), max(size, 1e-6)])
        assert away.max(axis=1).min() < 0.02, "the drawn line passes every point of the branch"
    assert f"is at most {microns(first.max())}" in picture.reading
    assert "is stable from" in picture.reading or "no point of it is stable" in picture.reading


def past_the_fold(case):
    rows = [0, len(case.branch) - 1]
    picture = multipliers_picture(case.branch, case.stability, rows)
    drawn = picture.figure.axes[0].lines[1].get_xydata()[0]
    assert complex(*drawn) == pytest.approx(complex(case.stability[0].multipliers[0]))
    start = case.branch[0]
    with sentence("velocit|phase|air gap|stiff|kick"):
        passage = sweep_in_time(start, [0.0, 0.001], revolutions=2, keep=2)
        shown = hysteresis_picture(case.branch, case.stability, {"up": passage})
        dots = shown.figure.axes[0].lines[-1].get_ydata()
        assert dots == pytest.approx(1e6 * passage.section[:, :, 0].ravel())
        drawn = shown.figure.axes[0].lines[0].get_ydata()[0]
        assert drawn == pytest.approx(1e6 * start.positions([0.0])[0, 0], rel=1e-3, abs=1e-3)
    with sentence("velocit|phase|air gap|stiff|kick"):
        found = basins([start], [0.0, 1e-5], [0.0], revolutions=2)
        said = basins_picture(found, ["it"]).reading
        assert re.search(r"Of 2 starts off it .*100 % end in", said)


def maps(case):
    with sentence("round gap alone|air_gap|no air gap"):
        found = steady_map(case.machine, "static_eccentricity", [0.0, 0.02], "unbalance", [1.0])
        gap = 1e3 * float(found["smallest_gap"][0, 1])
        assert gap == pytest.approx(1e3 * case.orbit.smallest_gap, rel=1e-6)
        assert f"{gap:.3g}" in map_picture(found).reading


def stability_and_time(case):
    assert floquet_all([case.orbit], quick=True)[0].verdict == "stable"
    times, path = case.motion.last(1)
    away = np.hypot(*(path - case.fine.positions(case.speed * times))).max()
    assert away <= 0.02 * case.fine.vibration
    assert "Over 2 revolutions" in reading(case.motion)
    found = modes(case.model, case.speed)
    assert f"{found.hertz[0]:.2f} Hz" in reading(found)


def study_and_report(case):
    if not case.has_gap:
        return
    made = study_pictures(case.study)
    assert f"{1e3 * case.study.orbits[8.8].smallest_gap:.3f} mm of" in made["figure-3"].reading
    assert microns(math.hypot(*case.study.orbits[8.9].mean)) in made["figure-7"].reading
    gap = next(axes for axes in made["figure-8"].figure.axes if "gap" in axes.get_ylabel())
    assert 0 < gap.lines[0].get_ydata().min() < 1e3 * case.model.gap
    written = json.loads(json.dumps(report(case.study, []), allow_nan=False))
    assert written["orbits"][2]["x"]["cos"][0] == case.study.orbits[2.0].coefficients[0, 2]
    if case.machine.shaft is not None:
        panel = made["figure-7"].figure.axes[3]
        told = " ".join(t.get_text() for t in panel.child_axes[0].get_yticklabels())
        assert all(name in told for _, name, _ in supports(case.machine))


def print_vary_and_copies(case):
    printed = str(case.machine)
    parts = (*case.machine.all_bearings, *case.machine.cracks, *case.machine.shapes)
    assert all(part.name in printed for part in parts)
    twice = vary(case.machine, {"unbalance": 2.0}).model()
    assert np.array_equal(twice.unbalance_sin, 2 * case.model.unbalance_sin)
    for copied in (pickle.loads(pickle.dumps(case.machine)), copy.deepcopy(case.machine)):
        assert np.array_equal(copied.model().K, case.model.K) and str(copied) == printed
    for copied in (pickle.loads(pickle.dumps(case.branch)), copy.deepcopy(case.branch)):
        assert np.array_equal(copied.local, case.branch.local)
        assert copied[-1].smallest_gap == case.branch[-1].smallest_gap
    again = pickle.loads(pickle.dumps(case.orbit))
    assert again.smallest_gap == case.orbit.smallest_gap


def explorers_of_a_branch(case):
    if not case.has_gap:
        with pytest.raises(BadInput, match="air_gap"):
            explorers.eccentricity_explorer(case.machine)
        return
    leg = next(i for i, leg in enumerate(case.legs.all, 1) if leg.holds(0.02))
    gap = f"{1e3 * case.orbit.smallest_gap:.2f} mm"
    one = explorers.eccentricity_explorer(case.machine, 2.0)
    one.set(leg=leg)
    assert f"smallest gap is {1e3 * case.orbit.smallest_gap:.3f} mm" in one.reading
    assert one.view.here.get_ydata() == pytest.approx(1e6 * case.orbit.amplitudes[0, :1], rel=1e-6)
    moving = explorers.branch_explorer(case.machine, 2.0)
    assert f"stable with a smallest gap of {gap}" in moving.reading
    drawn = moving.view.dots[1].get_ydata()
    assert drawn[0] == pytest.approx(1e3 * case.orbit.smallest_gap, rel=1e-12)
    softer = 0.9 * moving.controls["stiffness"].value
    moving.set(stiffness=softer)
    again = vary(case.machine, {moving.view.guide.key: 0.9 * moving.view.guide.value}).model()
    there = HarmonicBalance(4).solve(again, case.speed, 0.02, start=case.orbit)
    assert f"with a smallest gap of {1e3 * there.smallest_gap:.2f} mm" in moving.reading
    near = orbits_at(case.branch, 0.004)[0]
    all_there = explorers.past_fold_explorer(case.machine, 0.4).reading
    assert f"leg 1 stable, smallest gap {1e3 * near.smallest_gap:.2f} mm" in all_there


def explorers_of_the_machine(case):
    with sentence("air_gap|fold is near"):
        assert "smallest gap" in explorers.diagnosis_explorer(case.machine).reading
        assert "stator" in explorers.gap_shape_explorer(case.machine).reading
    with sentence("air_gap|shaft"):
        tried = explorers.calibration_explorer(case.machine)
        first = tried.reading
        tried.set(unbalance=1.0)
        assert tried.reading != first and "1X is" in tried.reading
    with sentence("shaft"):
        assert "above the exact" in explorers.elements_explorer(case.machine).reading
    diagram = explorers.campbell_explorer(case.machine)
    assert "the lowest modes are at" in diagram.reading
    assert len(diagram.view.now.get_ydata()) == min(8, len(modes(case.model, case.speed).hertz))


def explorers_of_methods(case):
    percentage = 2.0 if case.has_gap else 0.0
    with sentence("central differences|does not vibrate"):
        steps = explorers.integrator_explorer(case.machine, percentage)
        steps.set(method="Newmark, γ = 1/2", steps=64)
        assert "with 64 steps" in steps.reading or "grey" in steps.reading
    with sentence("no air gap"):
        balance = explorers.harmonics_explorer(case.machine, percentage, 1)
        balance.set(harmonics=4, samples=32)
        assert "4 harmonics and 32 samples" in balance.reading


class sentence:
    """What is refused is refused in a sentence that has one of these words."""

    def __init__(self, words):
        self.words = words

    def __enter__(self):
        return self

    def __exit__(self, kind, error, traceback):
        return kind in (BadInput, NoConvergence) and re.search(self.words, str(error)) is not None


@pytest.mark.parametrize("through", [
    orbit, branch, past_the_fold, maps, stability_and_time, study_and_report,
    print_vary_and_copies, explorers_of_a_branch, explorers_of_the_machine, explorers_of_methods],
    ids=lambda check: check.__name__)
def test_every_law_through(through, case, monkeypatch):
    for module in (eccentricity, moving_branch, past_fold) if case.has_gap else ():
        monkeypatch.setattr(module, "legs_of", lambda machine: case.legs)
    # what explorers show is compared with the result; that it can be drawn is tested elsewhere
    monkeypatch.setattr(KeptFigure, "layers", lambda kept: (b"", b""))
    monkeypatch.setattr(Picture, "_repr_mimebundle_", lambda picture: {})
    through(case)
