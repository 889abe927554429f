"""Sliders for a view that a chapter writes in its own cell: a function from the sliders' values to a `Picture`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hydrolab.show.explorer import FigureExplorer
from hydrolab.show.kept_figure import KeptFigure
from hydrolab.show.picture import Picture
from hydrolab.show.style import new_figure


class Explorer(FigureExplorer):
    """A `FigureExplorer` of a view that returns a `Picture`: of one kept figure, which is quickest, or of a new one.

    The margins stay as they were for the first picture.
    """

    def __init__(self, view: Callable[..., Picture], **sliders: Any) -> None:
        kept = KeptFigure(new_figure(1, 1), ())  # until the view is asked for the first time

        def show(**values: Any) -> str:
            picture = view(**values)
            kept.figure = picture.figure
            kept.redraw()
            return picture.reading

        for slider in sliders.values():
            slider.layout.width = "min(46em, 98%)"
        super().__init__(show, kept, sliders)
