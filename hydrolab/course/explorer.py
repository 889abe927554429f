"""A picture with sliders. A plain view function decides what is seen; the explorer only asks it again."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any

import ipywidgets as widgets

from hydrolab.show.picture import Picture
from hydrolab.show.style import CSS_DOTS_PER_INCH


class Explorer(widgets.VBox):
    """Sliders above a picture and its reading.

    view: from the sliders' values, by name, to a `Picture`. It may hand out one kept figure again and again.
    Without a kernel, as in a stored notebook, the first picture stands in its place.
    """

    def __init__(self, view: Callable[..., Picture], **sliders: Any) -> None:
        self.view, self.sliders = view, sliders
        for slider in sliders.values():
            slider.style.description_width = "10em"
            slider.layout.width = "min(44em, 98%)"
            slider.observe(self._show, "value")
        self.image = widgets.Image(format="png")
        self.words = widgets.HTML()
        self._first = self._show()
        self.image.layout.width = f"{round(self._first.figure.get_figwidth() * CSS_DOTS_PER_INCH)}px"
        self.image.layout.max_width = "98%"
        self.image.layout.object_fit = "contain"
        self._stored = self._first._repr_mimebundle_()  # now, while the kept figure shows it
        super().__init__([*sliders.values(), self.image, self.words])

    def _show(self, change: Any = None) -> Picture:
        picture = self.view(**{name: slider.value for name, slider in self.sliders.items()})
        self.image.value = picture.png()
        self.words.value = f'<div role="status" style="line-height: 1.5">{html.escape(picture.reading)}</div>'
        return picture

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        return super()._repr_mimebundle_(**kwargs) | self._stored
