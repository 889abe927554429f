"""`show` where no server can run: the recorded scene that is nearest to what was asked for."""

import json
import sys
from types import SimpleNamespace

import pytest

from hydrolab import Arclength, HarmonicBalance, follow, load_machine, orbits_at
from hydrolab.course.pages import SCENES, scene_name
from hydrolab.errors import BadInput
from hydrolab.figures.readings import reading
from hydrolab.live import recorded


@pytest.fixture(scope="module")
def branch():
    unit = load_machine("kaplan-150rpm")
    return follow(unit.model(), to=0.12, speed=unit.speed, method=Arclength(max_folds=3))


@pytest.fixture(autouse=True)
def scenes(branch, tmp_path, monkeypatch):
    """A list of what is recorded, as a build writes it, of the states that the chapters name."""
    rows = [{"name": scene_name(eccentricity, leg), "machine": "kaplan-150rpm",
             "reading": f"scene {scene_name(eccentricity, leg)} <", "static_eccentricity":
             eccentricity, "mean": (orbits_at(branch, eccentricity)[leg].mean
                                    / branch.equations.model.gap).tolist()}
            for eccentricity, leg in sorted(set().union(*SCENES.values()))]
    kernel = SimpleNamespace(href="https://school.example/course/extensions/@jupyterlite/a.js")
    monkeypatch.setitem(sys.modules, "js", SimpleNamespace(location=kernel))
    monkeypatch.setattr(recorded, "RECORDED", tmp_path / "recorded.json")
    (tmp_path / "recorded.json").write_text(json.dumps(rows), encoding="utf-8")


@pytest.mark.parametrize(("eccentricity", "leg", "nearest"), [
    (0.0, 0, "0-1"), (0.01, 0, "0-1"), (0.04, 0, "5-1"), (0.088, 0, "8.8-1"), (0.088, 2, "8.8-3"),
    (0.1, 0, "8.8-3")])
def test_the_nearest_scene_is_shown_and_named(branch, eccentricity, leg, nearest):
    orbit = orbits_at(branch, eccentricity)[leg]
    view = recorded.show(orbit)
    assert repr(view) == reading(orbit)  # what the chapter's stored output says
    page = view._repr_html_()
    assert f'src="https://school.example/course/scenes/player.html#{nearest}"' in page
    assert "This is a recording" in page and f"scene {nearest} &lt;" in page


def test_a_machine_is_shown_in_its_stators_middle(branch):
    assert "#0-1" in recorded.show(load_machine("kaplan-150rpm"))._repr_html_()
    assert "#5-1" not in recorded.show(branch)._repr_html_()


def test_what_is_not_recorded_has_a_sentence(branch):
    jeffcott = load_machine("jeffcott")
    with pytest.raises(BadInput, match="No scene of jeffcott"):
        recorded.show(HarmonicBalance().solve(jeffcott.model(), jeffcott.speed))
    with pytest.raises(BadInput, match="A str cannot"):
        recorded.show("unit")
