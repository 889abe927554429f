"""An explorer: controls above one kept figure and its reading. What is seen is decided by a view
that knows no widget.

The browser holds back a slider's moves while the last one is being drawn and sends the newest
afterwards, so a fast drag never queues up and always ends where the slider ends.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import anywidget
import ipywidgets as widgets
import traitlets
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from threadpoolctl import threadpool_limits

from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.explorers.kept_figure import (
    FRAMES,
    MIME,
    Frame,
    KeptFigure,
    flipbook,
    main_control,
    quick_png,
    shown,
    slider_values,
)
from hydrolab.figures.picture import Picture
from hydrolab.figures.style import COLOURS, house_style, new_figure

LAYOUT = {"width": "min(46em, 98%)"}  # of a slider


@contextmanager
def at_work() -> Iterator[None]:
    """Draw in the house style, and compute on one BLAS thread, quicker for small matrices."""
    with house_style(), threadpool_limits(1):
        yield


class View:
    """What an explorer asks: called with the controls' values by name, a view changes its kept
    figure and returns the reading.

    Where there is nothing to show it raises what the library raises (NoConvergence, Contact,
    BadInput); the last picture then stays, in grey, with the reason. A new explorer is a view that
    draws on its `panels` and has a `__call__`, and a function that puts controls beside it; one
    that remembers also has a `begin`, and one that can be clicked a `pick`.
    """

    kept: KeptFigure

    def panels(self, width: float, height: float, columns: int = 1, **layout: Any) -> Any:
        """Open the kept figure, width by height inches, and return its axes; columns: how many side
        by side. layout: as `Figure.subplots` takes it.
        """
        self.kept = KeptFigure(new_figure(width, height))
        return self.kept.figure.subplots(1, columns, **layout)

    def line(self, axes: Axes, form: str = "-", **look: Any) -> Line2D:
        """An empty line of some axes that moves; form and look as `Axes.plot` takes them."""
        line, = axes.plot([], [], form, **look)
        self.kept.moves(line)
        return line

    def upright(self, axes: Axes) -> Line2D:
        """A thin upright line that moves."""
        line = axes.axvline(0, color=COLOURS["axis"], linewidth=1)
        self.kept.moves(line)
        return line

    def __call__(self, **values: Any) -> str:
        """Show these values; return the reading."""
        raise NotImplementedError

    def begin(self) -> None:
        """Forget what was seen, before a reset."""

    def pick(self, x: float, y: float) -> Mapping[str, Any] | None:
        """New values of controls from a place in the figure, or None where there is nothing.

        x, y: shares of the figure's width and height from its lower left corner.
        """


class PictureWidget(anywidget.AnyWidget):
    """A picture and its reading in the browser: alt text, a line that a screen reader says when it
    changes, clicks.

    still: PNG. moving: the pixels that differ from it (`kept_figure.differing`), or nothing. width:
    CSS pixels. clickable: send {"x", "y"} on a click, as shares from the lower left corner.
    """

    _esm = Path(__file__).with_name("picture_widget.js")
    still = traitlets.Bytes(b"").tag(sync=True)
    moving = traitlets.Bytes(b"").tag(sync=True)
    reading = traitlets.Unicode("").tag(sync=True)
    width = traitlets.Int(640).tag(sync=True)
    clickable = traitlets.Bool(False).tag(sync=True)


class FigureExplorer(widgets.VBox):
    """Controls, a reset button, a picture and its reading.

    view: a `View`; a click on the picture sets what it picks. controls: by the names that the view
    takes. Where there is no kernel, as in a stored notebook, the first picture and its reading
    stand in its place, and in the static book a flip-book of at most `frames` pictures along the
    first slider.
    """

    def __init__(self, view: View, controls: Mapping[str, Any], frames: int = FRAMES) -> None:
        self.view, self.controls, self.frames = view, dict(controls), frames
        self.initial = {name: control.value for name, control in controls.items()}
        self.image = PictureWidget(clickable=type(view).pick is not View.pick)
        self.image.on_msg(self._clicked)
        self.reset = widgets.Button(description="Reset", tooltip="Back to the first values",
                                    layout={"width": "7em"})
        self.reset.on_click(self._back)
        wide = wide_enough(control.description for control in controls.values())
        for control in self.controls.values():
            control.style.description_width = wide
            control.observe(self._moved, "value")
        self.set()
        self.image.width = view.kept.width
        # now, while the figure shows it
        self._first = Picture(view.kept.figure, self.reading)._repr_mimebundle_()
        super().__init__([*self.controls.values(), self.reset, self.image])

    @property
    def reading(self) -> str:
        """What the picture says, in words."""
        return self.image.reading

    def set(self, **values: Any) -> None:
        """Give several controls a value, and draw once."""
        self._waits = True
        try:
            for name, value in values.items():
                self.controls[name].value = value
        finally:
            self._waits = False
        self._show()

    def _moved(self, change: Any) -> None:
        if not self._waits:
            self._show()

    def _asked(self, values: Mapping[str, Any]) -> tuple[str, bool]:
        """What the view says of the controls' values, and whether it had something to show."""
        try:
            with threadpool_limits(1):
                return self.view(**values), True
        except (NoConvergence, Contact, BadInput) as error:
            return f"Nothing to show here; the last picture is left in grey. {error}", False

    def _show(self) -> None:
        """Ask the view, and send its figure and its words in one message."""
        kept = self.view.kept
        reading, there = self._asked({name: c.value for name, c in self.controls.items()})
        still, moving = kept.layers() if there else (quick_png(kept.greyed()), b"")
        with self.image.hold_sync():
            self.image.reading, self.image.still, self.image.moving = reading, still, moving

    def flipbook(self) -> dict[str, str]:
        """What is seen along the first slider, for a page without a kernel."""
        name = main_control(self.controls)
        if name is None or sys.platform == "emscripten":  # long there, and not needed
            return {}
        main, kept, frames = self.controls[name], self.view.kept, []
        self.view.begin()  # a view that remembers begins the book anew
        for value in slider_values(main, self.frames, self.initial[name]):
            reading, there = self._asked(self.initial | {name: value})
            frames.append(Frame(shown(main, value), reading,
                                kept.pixels() if there else kept.greyed()))
        self.view.begin()
        self._show()
        start = [frame.value for frame in frames].index(shown(main, self.initial[name]))
        return {MIME: flipbook(main.description, frames, start)}

    def _back(self, button: widgets.Button) -> None:
        """Begin again, with the first values."""
        self.view.begin()
        self.set(**self.initial)

    def _clicked(self, widget: Any, content: Any, buffers: Any) -> None:
        """Set what the view picks at a place in the figure; what is no place is passed over."""
        place = [content.get(axis) for axis in ("x", "y")] if isinstance(content, dict) else [None]
        inside = all(isinstance(v, (int, float)) and 0 <= v <= 1 for v in place)
        if inside and (found := self.view.pick(*place)):
            self.set(**found)

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        return super()._repr_mimebundle_(**kwargs) | self._first | self.flipbook()


class PictureView(View):
    """A view from a function that returns a `Picture`, quickest of one kept figure."""

    def __init__(self, draw: Callable[..., Picture]) -> None:
        self.draw = draw
        self.kept = KeptFigure(new_figure(1, 1))  # until it is asked for the first time

    def __call__(self, **values: Any) -> str:
        """Show the picture of these values."""
        picture = self.draw(**values)
        self.kept.figure = picture.figure
        self.kept.redraw()
        return picture.reading


class Explorer(FigureExplorer):
    """Sliders for a view that a chapter writes in its own cell: a function from the sliders' values
    to a `Picture`.

    The margins stay as they were for the first picture.
    """

    def __init__(self, view: Callable[..., Picture], **sliders: Any) -> None:
        for control in sliders.values():
            control.layout.width = LAYOUT["width"]
        super().__init__(PictureView(view), sliders)


def wide_enough(words: Iterable[str], more: float = 1.0) -> str:
    """A width that holds the longest of some words in JupyterLab's letters, and `more`, in em."""
    return f"{0.56 * max(map(len, words)) + more:.1f}em"


def slider(description: str, value: float, low: float, high: float, step: float,
           digits: int) -> widgets.FloatSlider:
    """A slider in the explorers' layout, sent while it moves: its description, first value, ends
    low and high, step, and the digits shown.
    """
    return widgets.FloatSlider(value=value, min=low, max=high, step=step, description=description,
                               readout_format=f".{digits}f", layout=LAYOUT)


def whole(description: str, value: int, low: int, high: int) -> widgets.IntSlider:
    """A slider over the whole numbers from low to high; description and value as of `slider`."""
    return widgets.IntSlider(value=value, min=low, max=high, description=description, layout=LAYOUT)


def steps(description: str, value: int, options: list[int]) -> widgets.SelectionSlider:
    """A slider over some numbers, the options; description and value as of `slider`."""
    return widgets.SelectionSlider(value=value, options=options, description=description,
                                   layout=LAYOUT)


def choice(description: str, value: Any, options: list) -> widgets.ToggleButtons:
    """Buttons, one of them down; options: words or (words, value); description, value: its own."""
    words = [option[0] if isinstance(option, tuple) else option for option in options]
    return widgets.ToggleButtons(value=value, options=options, description=description,
                                 style={"button_width": wide_enough(words, 2.0)})
