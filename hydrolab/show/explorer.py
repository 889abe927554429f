"""An explorer: controls above one kept figure and its reading. What is seen is decided by a view that knows no widget.

A view takes the controls' values by name, changes its kept figure and returns the reading. Where there is nothing to
show it raises what the library raises (NoConvergence, Contact, BadInput); the last picture then stays, in grey, with
the reason. The browser holds back a slider's moves while the last one is being drawn and sends the newest
afterwards, so a fast drag never queues up and always ends where the slider ends.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import anywidget
import ipywidgets as widgets
import traitlets

from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.show.flipbook import FRAMES, MIME, Frame, flipbook, main_control, shown, slider_values
from hydrolab.show.kept_figure import KeptFigure
from hydrolab.show.picture import Picture

View = Callable[..., str]
Pick = Callable[[float, float], Mapping[str, Any] | None]


class PictureWidget(anywidget.AnyWidget):
    """A picture and its reading in the browser: alt text, a line that a screen reader says when it changes, clicks.

    still: PNG. moving: the pixels that differ from it (`kept_figure.differing`), or nothing. width: CSS pixels.
    clickable: send {"x", "y"} on a click, as shares from the lower left corner.
    """

    _esm = Path(__file__).with_name("picture_widget.js")
    still = traitlets.Bytes(b"").tag(sync=True)
    moving = traitlets.Bytes(b"").tag(sync=True)
    reading = traitlets.Unicode("").tag(sync=True)
    width = traitlets.Int(640).tag(sync=True)
    clickable = traitlets.Bool(False).tag(sync=True)


class FigureExplorer(widgets.VBox):
    """Controls, a reset button, a picture and its reading.

    view: from the controls' values, by name, to the reading. kept: the figure that it changes. pick: from a point of
    the figure, as shares of its width and height from the lower left, to new values of controls, or None; with it a
    click on the picture sets them. start: called before the reset, for a view that remembers. Where there is no kernel,
    as in a stored notebook, the first picture and its reading stand in its place, and in the static book a flip-book
    of at most `frames` pictures along the first slider.
    """

    def __init__(self, view: View, kept: KeptFigure, controls: Mapping[str, Any], pick: Pick | None = None,
                 start: Callable[[], None] | None = None, frames: int = FRAMES) -> None:
        self.frames = frames
        self.view, self.kept, self.controls = view, kept, dict(controls)
        self.pick, self.start = pick, start
        self.initial = {name: control.value for name, control in controls.items()}
        self.image = PictureWidget(clickable=pick is not None)
        self.image.on_msg(self._clicked)
        self.reset = widgets.Button(description="Reset", tooltip="Back to the first values", layout={"width": "7em"})
        self.reset.on_click(self._back)
        for control in self.controls.values():
            control.style.description_width = wide_enough(control.description for control in controls.values())
            control.observe(self._show, "value")
        self._show()
        self.image.width = kept.width
        self._first = Picture(kept.figure, self.reading)._repr_mimebundle_()  # now, while the figure shows it
        super().__init__([*self.controls.values(), self.reset, self.image])

    @property
    def reading(self) -> str:
        """What the picture says, in words."""
        return self.image.reading

    def set(self, **values: Any) -> None:
        """Give several controls a value, and draw once."""
        for control in self.controls.values():
            control.unobserve(self._show, "value")
        try:
            for name, value in values.items():
                self.controls[name].value = value
        finally:
            for control in self.controls.values():
                control.observe(self._show, "value")
        self._show()

    def _asked(self, values: Mapping[str, Any]) -> tuple[str, bool]:
        """What the view says of the controls' values, and whether it had something to show."""
        try:
            return self.view(**values), True
        except (NoConvergence, Contact, BadInput) as error:
            return f"Nothing to show here; the last picture is left in grey. {error}", False

    def _show(self, change: Any = None) -> None:
        """Ask the view, and send its figure and its words in one message."""
        reading, there = self._asked({name: control.value for name, control in self.controls.items()})
        still, moving = self.kept.layers() if there else (self.kept.greyed(), b"")
        with self.image.hold_sync():
            self.image.reading, self.image.still, self.image.moving = reading, still, moving

    def flipbook(self) -> dict[str, str]:
        """What is seen along the first slider, the other controls as at the start, for a page without a kernel."""
        name = main_control(self.controls)
        if name is None:
            return {}
        main, frames = self.controls[name], []
        if self.start:
            self.start()  # a view that remembers begins the book anew
        for value in slider_values(main, self.frames, self.initial[name]):
            reading, there = self._asked(self.initial | {name: value})
            frames.append(Frame(shown(main, value), reading, self.kept.png() if there else self.kept.greyed()))
        if self.start:
            self.start()
        self._show()
        start = [frame.value for frame in frames].index(shown(main, self.initial[name]))
        return {MIME: flipbook(main.description, frames, start)}

    def _back(self, button: widgets.Button) -> None:
        """Begin again, with the first values."""
        if self.start:
            self.start()
        self.set(**self.initial)

    def _clicked(self, widget: Any, content: Any, buffers: Any) -> None:
        """Set what `pick` finds at a place in the figure; what does not look like one is passed over."""
        place = [content.get(axis) for axis in ("x", "y")] if isinstance(content, dict) else [None]
        if self.pick and all(isinstance(v, (int, float)) and 0 <= v <= 1 for v in place) and (found := self.pick(*place)):
            self.set(**found)

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        return super()._repr_mimebundle_(**kwargs) | self._first | self.flipbook()


def wide_enough(words: Iterable[str], more: float = 1.0) -> str:
    """A width that holds the longest of some words in JupyterLab's letters, and `more`, in em."""
    return f"{0.56 * max(map(len, words)) + more:.1f}em"


def slider(description: str, value: float, low: float, high: float, step: float, digits: int) -> widgets.FloatSlider:
    """A slider in the explorers' layout, sent while it moves."""
    return widgets.FloatSlider(value=value, min=low, max=high, step=step, description=description,
                               readout_format=f".{digits}f", layout={"width": "min(46em, 98%)"})


def whole(description: str, value: int, low: int, high: int) -> widgets.IntSlider:
    """A slider over whole numbers, in the same layout."""
    return widgets.IntSlider(value=value, min=low, max=high, description=description, layout={"width": "min(46em, 98%)"})


def steps(description: str, value: int, options: list[int]) -> widgets.SelectionSlider:
    """A slider over some numbers, in the same layout."""
    return widgets.SelectionSlider(value=value, options=options, description=description,
                                   layout={"width": "min(46em, 98%)"})


def choice(description: str, value: str, options: list[str]) -> widgets.ToggleButtons:
    """Buttons of which one is down."""
    return widgets.ToggleButtons(value=value, options=options, description=description,
                                 style={"button_width": wide_enough(options, 2.0)})
