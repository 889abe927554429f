"""Drawings and explorers: pictures with readings, and a slider that shows what its view says."""

import ipywidgets as widgets
import pytest

from hydrolab import load_machine
from hydrolab.course.illustrations import conventions_picture, gap_picture
from hydrolab.explorers import Explorer


def test_drawings_say_what_they_show():
    conventions = conventions_picture(load_machine("kaplan-150rpm"))
    assert "y = −0.472 m" in conventions.reading and "9.04 m" in conventions.reading
    assert "along −x" in gap_picture(-0.3).reading
    assert conventions.png().startswith(b"\x89PNG")


def test_the_explorer_asks_its_view_and_nothing_else():
    asked = []

    def view(eccentricity):
        asked.append(eccentricity)
        return gap_picture(eccentricity)

    explorer = Explorer(view, eccentricity=widgets.FloatSlider(value=0.2, min=0, max=0.6))
    first = explorer.image.still
    explorer.controls["eccentricity"].value = 0.4
    assert asked == [0.2, 0.4]
    assert explorer.image.still != first
    assert explorer.reading == gap_picture(0.4).reading


def test_without_a_kernel_the_first_picture_stands_in():
    explorer = Explorer(gap_picture, eccentricity=widgets.FloatSlider(value=0.2, min=0, max=0.6))
    explorer.controls["eccentricity"].value = 0.5
    data = explorer._repr_mimebundle_()
    assert data["text/plain"] == gap_picture(0.2).reading
    assert "data:image/webp;base64," in data["text/html"]
    assert data["application/vnd.jupyter.widget-view+json"]["model_id"] == explorer.model_id


def test_a_view_that_fails_says_so():
    explorer = Explorer(lambda n: gap_picture(1 / n - 1),
                        n=widgets.FloatSlider(value=1, min=0, max=2))
    with pytest.raises(ZeroDivisionError):
        explorer.controls["n"].value = 0
