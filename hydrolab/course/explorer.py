"""A picture with sliders. A plain view function decides what is seen; the explorer only asks it again."""

from __future__ import annotations

import html
import io
from collections.abc import Callable
from typing import Any

import ipywidgets as widgets
import numpy as np
from matplotlib.image import imsave
from numpy.typing import NDArray

from hydrolab.show.flipbook import MIME, Frame, flipbook, main_control, shown, slider_values
from hydrolab.show.picture import Picture
from hydrolab.show.style import CSS_DOTS_PER_INCH, house_style


class Explorer(widgets.VBox):
    """Sliders above a picture and its reading.

    view: from the sliders' values, by name, to a `Picture`. One kept figure whose lines it moves is quickest: the
    margins stay as they were for the first picture. Without a kernel, as in a stored notebook, that one is shown; the
    static book shows a flip-book along the first slider.
    """

    def __init__(self, view: Callable[..., Picture], **sliders: Any) -> None:
        self.view, self.sliders = view, sliders
        for slider in sliders.values():
            slider.style.description_width = "10em"
            slider.layout.width = "min(44em, 98%)"
            slider.observe(self._show, "value")
        first = self.picture()
        self._stored = first._repr_mimebundle_()
        first.figure.set_layout_engine("none")  # half the time of a new picture goes into margins
        width = f"{round(first.figure.get_figwidth() * CSS_DOTS_PER_INCH)}px"
        self.image = widgets.Image(format="png", layout={"width": width, "max_width": "98%", "object_fit": "contain"})
        self.words = widgets.HTML()
        self._stored |= self._flipbook()
        self._show()
        super().__init__([*sliders.values(), self.image, self.words])

    def picture(self) -> Picture:
        """What the view shows for the sliders as they stand."""
        return self.view(**{name: slider.value for name, slider in self.sliders.items()})

    def _flipbook(self) -> dict[str, str]:
        """What the view shows along the first slider, the others as they stand."""
        main = main_control(self.sliders.values())
        if main is None:
            return {}
        name = next(name for name, slider in self.sliders.items() if slider is main)
        values, frames = slider_values(main), []
        for value in values:
            picture = self.view(**{other: slider.value for other, slider in self.sliders.items()} | {name: value})
            frames.append(Frame(shown(main, value), picture.reading, _pixels(picture)))
        return {MIME: flipbook(main.description, frames, values.index(main.value))}

    def _show(self, change: Any = None) -> None:
        picture = self.picture()
        self.image.value = _quick_png(picture)
        self.words.value = f'<div role="status" style="line-height: 1.5">{html.escape(picture.reading)}</div>'

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        return super()._repr_mimebundle_(**kwargs) | self._stored


@house_style()
def _pixels(picture: Picture) -> NDArray:
    """The picture drawn once (saving draws twice): a copy of its pixels, (height, width, 4)."""
    picture.figure.canvas.draw()
    return np.asarray(picture.figure.canvas.buffer_rgba()).copy()


def _quick_png(picture: Picture) -> bytes:
    """A PNG for now, hardly compressed."""
    stream = io.BytesIO()
    imsave(stream, _pixels(picture), format="png", pil_kwargs={"compress_level": 1})
    return stream.getvalue()
