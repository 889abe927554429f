"""Flip-books: the frames that a page without a kernel shows are the pictures that the explorer
showed.
"""

import base64
import io
import json

import ipywidgets as widgets
import numpy as np
import pytest
from PIL import Image

from hydrolab.course.illustrations import gap_picture
from hydrolab.errors import BadInput
from hydrolab.explorers import Explorer
from hydrolab.explorers.kept_figure import (
    FRAMES,
    MIME,
    Frame,
    flipbook,
    main_control,
    shown,
    slider_values,
)


def image(uri):
    return Image.open(io.BytesIO(base64.b64decode(uri.split(",", 1)[1])))


def seen(book, number):
    """What a page shows: the frame over the whole first one."""
    whole = image(book["whole"]).convert("RGBA")
    whole.alpha_composite(image(book["frames"][number]["picture"]).convert("RGBA"))
    return np.asarray(whole.convert("RGB")).astype(int)


def test_a_frame_over_the_first_one_is_the_picture():
    random = np.random.default_rng(1)
    still = np.full((40, 60, 4), 255, np.uint8)
    still[5:8] = (200, 0, 0, 255)
    frames, drawn = [], []
    for k in range(3):
        pixels = still.copy()
        pixels[10 + 5 * k:20 + 5 * k, 10:30] = (0, 90 + 40 * k, 160, 255)
        frames.append(Frame(str(k), f"frame {k}.", pixels))
        drawn.append(pixels[..., :3].astype(int))
    frames.append(Frame("3", "another size.", random.integers(0, 9, (20, 30, 4), np.uint8)))
    book = json.loads(flipbook("place", frames, 1))
    for k in range(3):
        assert abs(seen(book, k) - drawn[k]).max() <= 1
    assert [frame["reading"] for frame in book["frames"][:2]] == ["frame 0.", "frame 1."]
    assert (book["width"], book["height"], book["start"], book["label"]) == (60, 40, 1, "place")
    assert image(book["frames"][3]["picture"]).size == (30, 20)
    assert flipbook("place", frames, 1) == flipbook("place", frames, 1)


@pytest.mark.parametrize("slider", [
    widgets.FloatSlider(value=0.3, min=0, max=1, step=0.01),
    widgets.FloatSlider(value=8.77, min=0, max=11.2, step=0.05),
    widgets.IntSlider(value=3, min=1, max=5), widgets.IntSlider(value=7, min=0, max=100),
    widgets.FloatSlider(value=0.0, min=0, max=1, step=0.3),
    widgets.FloatSlider(value=0.234, min=0, max=1, step=0.1)])
def test_values_span_the_slider_and_hold_its_own(slider):
    values = slider_values(slider)
    assert values == sorted(set(values)) and len(values) <= FRAMES
    assert values[0] == slider.min and slider.max - values[-1] < slider.step
    assert slider.value in values
    assert all(isinstance(value, type(slider.value)) for value in values)


def test_some_numbers_to_choose_from_are_a_slider_too():
    slider = widgets.SelectionSlider(value=64, options=[4, 16, 64, 256])
    assert slider_values(slider) == [4, 16, 64, 256]
    assert shown(slider, 64) == "64"


def test_the_main_slider_is_the_first_one():
    controls = {"leg": widgets.ToggleButtons(options=[1, 2]),
                "e": widgets.FloatSlider(0.5, readout_format=".2f"),
                "n": widgets.IntSlider(1)}
    assert main_control(controls) == "e"
    assert main_control({"leg": controls["leg"]}) is None
    assert shown(controls["e"], 0.125) == "0.12" and shown(controls["n"], 3) == "3"


def test_an_explorer_carries_its_frames():
    explorer = Explorer(gap_picture, eccentricity=widgets.FloatSlider(value=0.2, min=0, max=0.6,
                                                                      readout_format=".1f"))
    explorer.controls["eccentricity"].value = 0.1  # the page begins where the chapter did
    book = json.loads(explorer._repr_mimebundle_()[MIME])
    assert explorer.reading == gap_picture(0.1).reading
    assert book["frames"][book["start"]]["reading"] == gap_picture(0.2).reading
    assert [frame["value"] for frame in book["frames"]] == [f"{0.1 * k:.1f}" for k in range(7)]
    assert book["frames"][6]["reading"] == gap_picture(0.6).reading
    assert abs(seen(book, 6) - seen(book, 0)).max() > 100


def test_where_there_is_nothing_to_show_the_frame_says_so():
    def view(eccentricity):
        if eccentricity > 0.45:
            raise BadInput("too far.")
        return gap_picture(eccentricity)

    explorer = Explorer(view, eccentricity=widgets.FloatSlider(value=0.2, min=0, max=0.6,
                                                               readout_format=".1f"))
    book = json.loads(explorer._repr_mimebundle_()[MIME])
    assert book["frames"][6]["reading"].endswith("too far.")
    assert explorer.reading == gap_picture(0.2).reading


def test_a_moved_explorer_still_begins_where_it_did():
    explorer = Explorer(gap_picture, eccentricity=widgets.FloatSlider(value=0.23, min=0, max=0.6,
                                                                      step=0.01,
                                                                      readout_format=".2f"))
    explorer.frames = 4
    explorer.controls["eccentricity"].value = 0.07
    book = json.loads(explorer._repr_mimebundle_()[MIME])
    assert [frame["value"] for frame in book["frames"]] == ["0.00", "0.23", "0.40", "0.60"]
    assert book["start"] == 1 and book["frames"][1]["reading"] == gap_picture(0.23).reading
