"""A figure that is drawn again and again: what stands still is drawn and sent once, what moves is
drawn over it.

Drawing a whole figure takes ten times as long as drawing the few lines of it that change, and to
write and read a PNG of it as long again; so a picture that follows a slider is a PNG of what stands
still and the pixels that differ from it.

Flip-books: what an explorer shows along its main slider, computed in advance for pages that have no
kernel.

A stored notebook carries the frames beside the first picture; JupyterLab ignores them, the static
book shows them with a slider. The first frame is kept whole, the others as what differs from it, so
that ten of them are small.

An explorer: controls above one kept figure and its reading. What is seen is decided by a view that
knows no widget.

A view takes the controls' values by name, changes its kept figure and returns the reading. Where
there is nothing to show it raises what the library raises (NoConvergence, Contact, BadInput); the
last picture then stays, in grey, with the reason. The browser holds back a slider's moves while the
last one is being drawn and sends the newest afterwards, so a fast drag never queues up and always
ends where the slider ends.

Sliders for a view that a chapter writes in its own cell: a function from the sliders' values to a
`Picture`.
"""

from __future__ import annotations

import base64
import io
import json
import struct
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import anywidget
import ipywidgets as widgets
import numpy as np
import traitlets
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.figures.picture import Picture
from hydrolab.figures.style import COLOURS, CSS_DOTS_PER_INCH, house_style, new_figure

COMPRESSION = 1  # of the PNG: the quickest; larger files do not leave this computer


class KeptFigure:
    """A figure with its own Agg canvas, and the artists of it that move.

    Change the artists, then ask for `png()`, or for `layers()`. After changing anything else
    (limits, ticks, titles) call `redraw()`.
    """

    def __init__(self, figure: Figure, moving: Iterable[Artist]) -> None:
        self.figure, self.moving = figure, sorted(moving, key=lambda artist: artist.get_zorder())
        for artist in self.moving:
            # left out when the still part is drawn, and in when the figure is saved
            artist.set_animated(True)
        self._still: Any = None
        self._ground: tuple[NDArray, bytes] | None = None  # the still part, as pixels and as PNG
        self._last: NDArray | None = None

    @property
    def width(self) -> int:
        """Width in CSS pixels."""
        return round(self.figure.get_figwidth() * CSS_DOTS_PER_INCH)

    def redraw(self) -> None:
        """Forget the still part; it is drawn anew when the next picture is asked for."""
        self._still = None

    def png(self) -> bytes:
        """The figure as it is now, as PNG."""
        return quick_png(self._pixels())

    def layers(self) -> tuple[bytes, bytes]:
        """The figure as it is now: what stands still, as PNG, and the pixels that `differ` from it.
        """
        pixels = self._pixels()
        if self._ground is None:
            canvas = self.figure.canvas
            canvas.restore_region(self._still)
            still = np.array(canvas.buffer_rgba())
            self._ground = still, quick_png(still)
        return self._ground[1], differing(self._ground[0], pixels)

    def _pixels(self) -> NDArray:
        """The figure as it is now, (height, width, 4) of bytes, opaque."""
        canvas = self.figure.canvas
        if self._still is None:
            with house_style():
                canvas.draw()  # also lays the panels out
            self.figure.set_layout_engine("none")
            self._still, self._ground = canvas.copy_from_bbox(self.figure.bbox), None
        renderer = canvas.get_renderer()
        canvas.restore_region(self._still)
        for artist in self.moving:
            artist.draw(renderer)
        self._last = np.array(canvas.buffer_rgba())
        return self._last

    def greyed(self, words: str = "nothing to show here") -> bytes:
        """The last picture in pale grey with words across it, as PNG; asked again, it does not fade
        further.
        """
        if self._last is None:
            self._pixels()
        # anew, where the figure was saved at another resolution
        renderer = self.figure.canvas.get_renderer()
        pixels = np.asarray(renderer.buffer_rgba())
        pixels[...] = 255 - 0.35 * (255 - self._last[..., :3].mean(axis=2, keepdims=True))
        pixels[..., 3] = 255
        with house_style():
            note = self.figure.text(0.5, 0.5, words, ha="center", va="center", fontsize=22,
                                    color=COLOURS["unstable"],
                                    bbox={"facecolor": "white", "edgecolor": COLOURS["unstable"],
                                          "pad": 12})
            note.draw(renderer)
        note.remove()
        return quick_png(pixels)


def differing(still: NDArray, now: NDArray) -> bytes:
    """The pixels of one picture that differ from another of the same size, in runs: 4-byte numbers,
    little end first.

    How many runs there are, where each begins (counted along the rows), how long each is, and then
    all their pixels.
    """
    pixels = now.reshape(-1, 4).view("<u4")[:, 0]
    at = np.flatnonzero(still.reshape(-1, 4).view("<u4")[:, 0] != pixels)
    first = np.flatnonzero(np.diff(at, prepend=-2) != 1)
    lengths = np.diff(first, append=len(at))
    return np.concatenate([[len(first)], at[first], lengths, pixels[at]]).astype("<u4").tobytes()


def quick_png(pixels: NDArray) -> bytes:
    """A PNG of pixels (height, width, 4) of bytes, without filters: in half the time that a general
    writer takes.
    """
    height, width = pixels.shape[:2]
    rows = np.zeros((height, 1 + 4 * width), dtype=np.uint8)  # each row begins with its filter, 0
    rows[:, 1:] = pixels.reshape(height, -1)

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I",
                                                                              zlib.crc32(kind
                                                                                         + content))

    # 8 bits, RGBA, the only compression and filter
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT",
                                                                  zlib.compress(rows, COMPRESSION))
            + chunk(b"IEND", b""))


MIME = "text/vnd.hydrolab.flipbook"  # JSON as text, so that nbval compares the readings
FRAMES = 11
PALETTE = 31  # colours of a frame


@dataclass(frozen=True)
class Frame:
    """A value of the slider in words, what is said there, and what is seen, as PNG."""

    value: str
    reading: str
    png: bytes


def main_control(controls: Mapping[str, Any]) -> str | None:
    """The name of the first of an explorer's controls that is a slider, or None."""
    return next((name for name, control in controls.items()
                 if hasattr(control, "readout")
                 and (hasattr(control, "options") or hasattr(control, "step"))), None)


def slider_values(control: Any, count: int = FRAMES, keep: Any = None) -> list[Any]:
    """At most `count` values of a slider, in its order; both ends and `keep` (by default its value)
    are among them.
    """
    keep = control.value if keep is None else keep
    if hasattr(control, "options"):
        options = [option[1] if isinstance(option, tuple) else option for option in control.options]
        return [options[place] for place in _places(len(options) - 1, options.index(keep), count)]
    now = round((keep - control.min) / control.step)
    kind = int if isinstance(keep, int) else float
    return [keep if place == now else kind(round(control.min + place * control.step, 12))
            for place in _places(round((control.max - control.min) / control.step), now, count)]


def _places(steps: int, now: int, count: int) -> list[int]:
    """At most `count` of the places 0 … steps, evenly spaced but for `now`."""
    taken = {round(place) for place in np.linspace(0, steps, min(count, steps + 1))}
    if now not in taken:
        nearest = min((place for place in taken if 0 < place < steps),
                      key=lambda place: abs(place - now))
        taken = (taken - {nearest}) | {now}
    return sorted(taken)


def shown(control: Any, value: Any) -> str:
    """A value as the slider writes it."""
    return str(value) if hasattr(control, "options") else format(value,
                                                                 getattr(control, "readout_format",
                                                                         "") or "g")


def flipbook(label: str, frames: Sequence[Frame], start: int) -> str:
    """The frames as JSON: label of the slider, number of the frame to begin with, the whole frame,
    and all frames.
    """
    first = _pixels(frames[start].png)
    rows = [{"value": frame.value, "reading": frame.reading,
             "picture": _uri(_difference(_pixels(frame.png), first))}
            for frame in frames]
    return json.dumps({"label": label, "start": start, "width": first.shape[1],
                       "height": first.shape[0],
                       "whole": _uri(_few_colours(first)), "frames": rows}, ensure_ascii=False)


def _pixels(png: bytes) -> NDArray:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


def _few_colours(pixels: NDArray) -> Image.Image:
    return Image.fromarray(np.ascontiguousarray(pixels), "RGB").quantize(
        PALETTE, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).convert("RGB")


def _difference(pixels: NDArray, first: NDArray) -> Image.Image:
    """A picture that is transparent where it is as the first one."""
    if pixels.shape != first.shape:
        return _few_colours(pixels)
    same = (pixels == first).all(axis=2)
    changed = np.asarray(_few_colours(np.where(same[..., None], np.uint8(255), pixels)))
    seen = np.dstack([np.where(same[..., None], np.uint8(0), changed),
                      np.where(same, np.uint8(0), np.uint8(255))])
    return Image.fromarray(seen, "RGBA")


def _uri(image: Image.Image) -> str:
    stream = io.BytesIO()
    image.save(stream, "webp", lossless=True, quality=80, method=4)
    return "data:image/webp;base64," + base64.b64encode(stream.getvalue()).decode("ascii")


View = Callable[..., str]
Pick = Callable[[float, float], Mapping[str, Any] | None]


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

    view: from the controls' values, by name, to the reading. kept: the figure that it changes.
    pick: from a point of the figure, as shares of its width and height from the lower left, to new
    values of controls, or None; with it a click on the picture sets them. start: called before the
    reset, for a view that remembers. Where there is no kernel, as in a stored notebook, the first
    picture and its reading stand in its place, and in the static book a flip-book of at most
    `frames` pictures along the first slider.
    """

    def __init__(self, view: View, kept: KeptFigure, controls: Mapping[str, Any],
                 pick: Pick | None = None,
                 start: Callable[[], None] | None = None, frames: int = FRAMES) -> None:
        self.frames = frames
        self.view, self.kept, self.controls = view, kept, dict(controls)
        self.pick, self.start = pick, start
        self.initial = {name: control.value for name, control in controls.items()}
        self.image = PictureWidget(clickable=pick is not None)
        self.image.on_msg(self._clicked)
        self.reset = widgets.Button(description="Reset", tooltip="Back to the first values",
                                    layout={"width": "7em"})
        self.reset.on_click(self._back)
        for control in self.controls.values():
            control.style.description_width = wide_enough(control.description
                                                          for control in controls.values())
            control.observe(self._show, "value")
        self._show()
        self.image.width = kept.width
        # now, while the figure shows it
        self._first = Picture(kept.figure, self.reading)._repr_mimebundle_()
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
        reading, there = self._asked({name: control.value
                                      for name, control in self.controls.items()})
        still, moving = self.kept.layers() if there else (self.kept.greyed(), b"")
        with self.image.hold_sync():
            self.image.reading, self.image.still, self.image.moving = reading, still, moving

    def flipbook(self) -> dict[str, str]:
        """What is seen along the first slider, the other controls as at the start, for a page
        without a kernel.
        """
        name = main_control(self.controls)
        if name is None:
            return {}
        main, frames = self.controls[name], []
        if self.start:
            self.start()  # a view that remembers begins the book anew
        for value in slider_values(main, self.frames, self.initial[name]):
            reading, there = self._asked(self.initial | {name: value})
            frames.append(Frame(shown(main, value), reading,
                                self.kept.png() if there else self.kept.greyed()))
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
        """Set what `pick` finds at a place in the figure; what does not look like one is passed
        over.
        """
        place = [content.get(axis) for axis in ("x", "y")] if isinstance(content, dict) else [None]
        if self.pick and all(isinstance(v, (int, float)) and 0 <= v <= 1
                             for v in place) and (found := self.pick(*place)):
            self.set(**found)

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        return super()._repr_mimebundle_(**kwargs) | self._first | self.flipbook()


def wide_enough(words: Iterable[str], more: float = 1.0) -> str:
    """A width that holds the longest of some words in JupyterLab's letters, and `more`, in em."""
    return f"{0.56 * max(map(len, words)) + more:.1f}em"


def slider(description: str, value: float, low: float, high: float, step: float,
           digits: int) -> widgets.FloatSlider:
    """A slider in the explorers' layout, sent while it moves."""
    return widgets.FloatSlider(value=value, min=low, max=high, step=step, description=description,
                               readout_format=f".{digits}f", layout={"width": "min(46em, 98%)"})


def whole(description: str, value: int, low: int, high: int) -> widgets.IntSlider:
    """A slider over whole numbers, in the same layout."""
    return widgets.IntSlider(value=value, min=low, max=high, description=description,
                             layout={"width": "min(46em, 98%)"})


def steps(description: str, value: int, options: list[int]) -> widgets.SelectionSlider:
    """A slider over some numbers, in the same layout."""
    return widgets.SelectionSlider(value=value, options=options, description=description,
                                   layout={"width": "min(46em, 98%)"})


def choice(description: str, value: str, options: list[str]) -> widgets.ToggleButtons:
    """Buttons of which one is down."""
    return widgets.ToggleButtons(value=value, options=options, description=description,
                                 style={"button_width": wide_enough(options, 2.0)})


class Explorer(FigureExplorer):
    """A `FigureExplorer` of a view that returns a `Picture`: of one kept figure, which is quickest,
    or of a new one.

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
