"""Every explorer at both ends of every control and where there is nothing, and what its view shows
against another way.
"""

import io
import math
import re
from dataclasses import replace

import ipywidgets as widgets
import numpy as np
import pytest
from PIL import Image

from hydrolab import explorers, load_machine
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.explorers import FigureExplorer, KeptFigure, View, choice, slider, whole
from hydrolab.explorers.mesh import ElementsView
from hydrolab.figures.style import new_figure

KAPLAN, JEFFCOTT = load_machine("kaplan-150rpm"), load_machine("jeffcott")
MAKE = {
    "eccentricity": lambda: explorers.eccentricity_explorer(KAPLAN, 8.8),
    "branch": lambda: explorers.branch_explorer(KAPLAN, 8.5),
    "past fold": explorers.past_fold_explorer,
    "elements": explorers.elements_explorer,
    "Campbell": explorers.campbell_explorer,
    "calibration": explorers.calibration_explorer,
    "diagnosis": explorers.diagnosis_explorer,
    "integrator": explorers.integrator_explorer,
    "harmonics": explorers.harmonics_explorer,
    "arclength": explorers.arclength_explorer,
    "gap shape": explorers.gap_shape_explorer,
}
MADE: dict[str, FigureExplorer] = {}


def explorer_of(name):
    """Each explorer is built once."""
    if name not in MADE:
        MADE[name] = MAKE[name]()
    MADE[name].reset.click()
    return MADE[name]


def seen(explorer):
    """The picture: what stands still, and the pixels that differ."""
    return explorer.image.still, explorer.image.moving


def ends(control):
    """Both ends of a slider, or every choice."""
    if isinstance(control, widgets.SelectionSlider):
        return [control.options[0], control.options[-1]]
    if isinstance(control, widgets.ToggleButtons):
        return [option[1] if isinstance(option, tuple) else option for option in control.options]
    return [control.min, control.max]


@pytest.mark.parametrize("name", MAKE)
def test_both_ends_of_every_control(name):
    explorer = explorer_of(name)
    first, picture = explorer.reading, seen(explorer)
    for key, control in explorer.controls.items():
        shown = set()
        for value in ends(control):
            control.value = value
            shown.add((explorer.reading, seen(explorer)))
            assert explorer.image.still.startswith(b"\x89PNG")
            assert len(explorer.reading) > 40 and "nan" not in explorer.reading.split(), (key,
                                                                                          value)
        assert shown - {(first, picture)}, key
        explorer.reset.click()
        assert explorer.reading == first, key


@pytest.mark.parametrize("name", MAKE)
def test_without_a_kernel_the_first_picture_stands_in(name):
    explorer = explorer_of(name)
    explorer.frames = 3  # the notebooks have all of them, and nbval compares those
    first, picture = explorer.reading, seen(explorer)
    stored = explorer._repr_mimebundle_()
    assert stored["text/plain"] == first
    assert (explorer.reading, seen(explorer)) == (first, picture), "storing it leaves it as it was"
    assert "data:image/" in stored["text/html"]
    assert not [number for number in stored["text/plain"].split() if len(number) > 12
                and number[0].isdigit()]


def test_where_no_orbit_exists_the_last_one_stays_in_grey():
    explorer = explorer_of("eccentricity")
    explorer.controls["eccentricity"].value = 9.5
    assert explorer.reading.startswith("Leg 1 has no steady state at 9.5 %")
    assert explorer.view.none.get_text() == "leg 1: none at 9.5 %"
    harmonics = explorer_of("harmonics")
    harmonics.controls["harmonics"].value = 8
    assert harmonics.reading.startswith("Nothing to show here; the last picture is left in grey. "
                                        "samples is 8")
    harmonics.controls["samples"].value = 64
    assert harmonics.reading.startswith("8 harmonics and 64 samples")


class Asked(View):
    """A view that counts, over a figure of one moving line, and refuses below zero."""

    def __init__(self):
        figure = new_figure(3, 2)
        axes = figure.subplots()
        axes.set(xlim=(0, 1), ylim=(-1, 5))
        self.line, = axes.plot([0, 1], [0, 0])
        self.kept, self.calls = KeptFigure(figure, [self.line]), []

    def __call__(self, height, name):
        self.calls.append((height, name))
        if height < 0:
            raise NoConvergence("there is none below zero.")
        self.line.set_ydata([height, height])
        return f"{name} {height:.1f}"

    def pick(self, x, y):
        return {"height": 4 * y, "name": "b"} if x > 0.5 else None


@pytest.fixture
def asked():
    view = Asked()
    controls = {"height": slider("height", 1.0, -1.0, 4.0, 0.5, 1),
                "name": choice("name", "a", ["a", "b"])}
    return FigureExplorer(view, controls)


def test_one_question_and_one_message_a_change(asked, monkeypatch):
    sent = []
    monkeypatch.setattr(type(asked.image), "send_state", lambda self,
                        key=None: sent.append(set(key)))
    asked.controls["height"].value = 2.0
    assert asked.view.calls == [(1.0, "a"), (2.0, "a")]
    assert sent == [{"moving", "reading"}]
    asked.controls["height"].value = 2.0  # no change
    assert len(asked.view.calls) == 2


def pixels(picture):
    """The pixels of a PNG, as 4-byte numbers along the rows."""
    image = Image.open(io.BytesIO(picture)).convert("RGBA")
    return np.array(image).reshape(-1, 4).view("<u4")[:, 0]


def pixels_seen(explorer):
    """What the browser makes of the two layers."""
    there = pixels(explorer.image.still)
    count, *runs = np.frombuffer(explorer.image.moving, "<u4")
    at = np.concatenate([np.arange(s, s + n)
                         for s, n in zip(runs[:count], runs[count:2 * count], strict=True)])
    there[at] = runs[2 * count:]
    return there


@pytest.mark.parametrize("name", ["eccentricity", "asked"])
def test_the_two_layers_are_the_picture(name, asked):
    explorer = asked if name == "asked" else explorer_of(name)
    slider = next(iter(explorer.controls.values()))
    for value in (slider.value, 2.5, slider.max, 3.0):
        slider.value = value
        assert np.array_equal(pixels_seen(explorer), pixels(explorer.view.kept.png()))


def test_reset_puts_everything_back_and_draws_once(asked):
    first = seen(asked)
    asked.controls["height"].value, asked.controls["name"].value = 3.0, "b"
    before = len(asked.view.calls)
    asked.reset.click()
    assert (asked.reading, seen(asked)) == ("a 1.0", first)
    assert len(asked.view.calls) == before + 1
    asked.controls["height"].value = 2.0
    assert asked.reading == "a 2.0"


def test_a_view_that_refuses_leaves_grey_and_a_reason(asked):
    asked.controls["height"].value = 3.0
    shown = seen(asked)
    asked.controls["height"].value = -1.0
    grey = seen(asked)
    assert asked.reading == ("Nothing to show here; the last picture is left in grey. "
                             "there is none below zero.")
    assert grey != shown
    asked.controls["height"].value = -0.5
    assert seen(asked) == grey, "it does not fade further"
    asked.controls["height"].value = 3.0
    assert (seen(asked), asked.reading) == (shown, "a 3.0")


def test_a_mistake_in_a_view_is_not_hidden():
    class Mistaken(Asked):
        def __call__(self, n):
            return f"{1 / n}"

    with pytest.raises(ZeroDivisionError):
        FigureExplorer(Mistaken(), {"n": whole("n", 0, 0, 1)})


@pytest.mark.parametrize("content", [None, 7, "x", {}, {"x": "a", "y": 0.5},
                                     {"x": math.nan, "y": 0.5}, {"x": 2, "y": 0.5},
                                     {"x": [1], "y": {}}, {"x": 0.2, "y": 0.5}])
def test_a_click_that_is_none_changes_nothing(asked, content):
    asked._clicked(asked.image, content, [])
    assert asked.view.calls == [(1.0, "a")]


def test_a_click_sets_what_it_hits(asked):
    asked._clicked(asked.image, {"x": 0.9, "y": 0.5}, [])
    assert asked.reading == "b 2.0"
    assert len(asked.view.calls) == 2, "drawn once"


@pytest.mark.parametrize("leg, eccentricity", [(1, 5.0), (2, 8.0), (3, 8.4), (3, 10.0)])
def test_a_click_on_the_branch_shows_that_orbit(leg, eccentricity):
    explorer = explorer_of("eccentricity")
    view = explorer.view
    orbit = view.legs.orbit(eccentricity / 100, leg - 1)
    place = view.diagram.axes.transData.transform((eccentricity, 1e6 * orbit.amplitudes[0, 0]))
    x, y = view.kept.figure.transFigure.inverted().transform(place)
    explorer._clicked(explorer.image, {"x": float(x), "y": float(y)}, [])
    assert explorer.controls["leg"].value == leg
    assert explorer.controls["eccentricity"].value == pytest.approx(eccentricity, abs=0.051)
    assert explorer.reading.startswith(f"Leg {leg}, ")
    assert view.pick(0.02, 0.98) is None


@pytest.mark.parametrize("name", ["branch", "past fold"])
@pytest.mark.parametrize("leg, eccentricity", [(0, 5.0), (2, 8.4)])
def test_a_click_on_a_branch_shows_the_orbits_there(name, leg, eccentricity):
    explorer = explorer_of(name)
    view = explorer.view
    orbit = view.legs.orbit(eccentricity / 100, leg)
    axes, value = ((view.axes[1], 1e3 * orbit.smallest_gap) if name == "branch" else
                   (view.diagram.axes, 1e6 * orbit.amplitudes[0, 0]))
    place = axes.transData.transform((eccentricity, value))
    x, y = view.kept.figure.transFigure.inverted().transform(place)
    explorer._clicked(explorer.image, {"x": float(x), "y": float(y)}, [])
    assert explorer.controls["eccentricity"].value == pytest.approx(eccentricity, abs=0.11)
    assert f"{1e3 * orbit.smallest_gap:.2f} mm" in explorer.reading
    assert view.pick(0.02, 0.02) is None


def test_a_click_at_a_fold_stays_on_the_leg():
    view = explorer_of("eccentricity").view
    fold = view.legs.branch.at_fold(0)
    place = view.diagram.axes.transData.transform((100 * fold.static_eccentricity,
                                                   1e6 * fold.amplitudes[0, 0]))
    found = view.pick(*view.kept.figure.transFigure.inverted().transform(place))
    assert view.legs.orbit(found["eccentricity"] / 100, found["leg"] - 1) is not None


def test_past_the_fold_the_machine_jumps_and_does_not_come_back_the_same_way():
    explorer = explorer_of("past fold")
    where = explorer.controls["eccentricity"]
    where.value = 8.9
    assert "3 steady states" in explorer.reading and "The machine is on leg 1." in explorer.reading
    where.value = 9.0  # the fold is at 8.925 %
    assert "At 8.95 % leg 1 has ended: the motion settles on leg 3." in explorer.reading
    where.value = 8.5
    assert "The machine is on leg 3." in explorer.reading
    where.value = 7.5  # on the orbit of two revolutions, which ends in its own fold at 6.9295 %
    assert "At 8 % leg 3 is no longer stable" in explorer.reading
    assert "The machine moves without repeating every revolution." in explorer.reading
    where.value = 6.8
    assert "The machine is on leg 1." in explorer.reading
    back = float(re.search(r"At ([\d.]+) %: the motion settles on leg 1", explorer.reading)[1])
    assert 6.8 <= back < 6.93  # some steps below that fold: it takes revolutions to arrive
    explorer.reset.click()
    assert "The machine is on leg 1." in explorer.reading


def test_a_stator_of_no_depth_is_round():
    explorer = explorer_of("gap shape")
    explorer.set(depth=0, displacement=40, direction=120)
    words = explorer.reading
    size = JEFFCOTT.air_gap.pull_stiffness * 0.4 * JEFFCOTT.air_gap.gap / (1 - 0.16) ** 1.5 / 1e3
    assert f"the pull is {size:.1f} kN, turned by 0.0°" in words.replace("-0.0°", "0.0°")


def test_the_error_of_a_method_falls_with_its_order():
    view = explorer_of("integrator").view
    for method, order in (("central difference", 2), ("Newmark, γ = 1/2", 2),
                          ("Newmark, γ = 0.6", 1)):
        for steps in (128, 256):
            view(method, steps)
        found = math.log2(view.errors[method, 128] / view.errors[method, 256])
        assert found == pytest.approx(order, abs=0.1)
    explorer = explorer_of("integrator")
    explorer.set(method="central difference", steps=8)
    assert "central differences need at most 2" in explorer.reading


def test_a_slender_shaft_has_the_frequencies_of_euler_and_bernoulli():
    shaft = replace(KAPLAN.shaft, nodes=np.array([0.0, 50.0]), diameter=0.1,
                    inner_diameter=0.0, lower_diameter=0.0, young=2e11, density=7850.0, poisson=0.3)
    view = ElementsView(shaft)
    k, radius = np.arange(1, 5) * math.pi / 50, 0.1 / 4
    exact = k**2 * math.sqrt(shaft.young / shaft.density) * radius
    # rotation and shear
    softer = 1 - (1 + 2 * (1 + shaft.poisson) / shaft.shear_coefficient) * (k * radius) ** 2 / 2
    assert view.exact == pytest.approx(exact * softer, rel=1e-7)
    assert view.modes(16)[0][:2] == pytest.approx(exact[:2], rel=1e-4)


def test_calibration_hits_with_the_numbers_of_the_card():
    explorer = explorer_of("calibration")
    assert "Neither agrees" in explorer.reading
    explorer.set(depth=float(KAPLAN.shaft.nodes[1]), mass=119.0, unbalance=1.0)
    assert "8.925 %" in explorer.reading and "1X is 200.0 µm" in explorer.reading
    assert explorer.reading.endswith("Both agree with the paper.")


def test_a_field_at_its_end_keeps_folds_and_eccentricity_in_sight():
    """With 12 % more field the axis once ended at 6 % while the slider said 8.5, under a legend."""
    explorer = explorer_of("branch")
    explorer.controls["field"].value = explorer.controls["field"].max
    view = explorer.view
    upper = view.axes[0]
    where = explorer.controls["eccentricity"].value
    assert upper.get_xlim()[1] > where
    assert upper.get_legend() is None
    legend = view.kept.figure.legends[0].get_window_extent()
    for axes, folds in zip(view.axes, view.folds, strict=True):
        assert not any(legend.contains(*place)
                       for place in axes.transData.transform(folds.get_xydata()))


def test_a_machine_of_two_modes_has_a_campbell_diagram():
    explorer = explorers.campbell_explorer(JEFFCOTT)
    own = math.sqrt(JEFFCOTT.bearings[0].stiffness[0, 0] / JEFFCOTT.bodies[0].mass) / 2 / math.pi
    assert f"{own:.2f} Hz" in explorer.reading
    explorer.set(stiffness=4.0)
    assert f"{2 * own:.2f} Hz" in explorer.reading


def test_a_cause_of_no_size_is_the_healthy_machine():
    explorer = explorer_of("diagnosis")
    for cause in explorer.controls["cause"].options:
        explorer.set(cause=cause, size=0.0)
        assert "1.00 times the healthy one" in explorer.reading
        assert "1.00 and 1.00 times" in explorer.reading


def test_natural_steps_stop_at_the_fold_and_arclength_passes_it():
    explorer = explorer_of("arclength")
    assert "Newton fails at λ = 1.200" in explorer.reading and "folds passed: 0" in explorer.reading
    explorer.set(way="arclength", count=30)
    assert "folds passed: 2" in explorer.reading
    x, y = explorer.view.points.get_data()
    assert np.hypot(x, y) == pytest.approx(np.ones(31), abs=1e-10)


def test_machines_that_do_not_fit_are_refused_with_a_sentence():
    for make in (explorers.elements_explorer, explorers.calibration_explorer):
        with pytest.raises(BadInput, match="jeffcott"):
            make(JEFFCOTT)
    bare = load_machine("three-disc")
    for make in (explorers.eccentricity_explorer, explorers.past_fold_explorer,
                 explorers.gap_shape_explorer, explorers.diagnosis_explorer):
        with pytest.raises(BadInput, match="air_gap"):
            make(bare)
    with pytest.raises(BadInput, match="leg is 9"):
        explorers.harmonics_explorer(leg=9)
