"""A figure that follows a slider: a PNG of what stands still, sent once, and the pixels that differ
from it. To draw, write and read it whole takes ten times as long.

For pages that have no kernel it becomes a flip-book: what is seen along the main slider, computed
in advance. A stored notebook carries it beside the first picture; JupyterLab ignores it, the static
book shows it with a slider.
"""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from hydrolab.figures.picture import as_webp, few_colours
from hydrolab.figures.style import COLOURS, CSS_DOTS_PER_INCH, house_style

MIME = "text/vnd.hydrolab.flipbook"  # JSON as text, so that nbval compares the readings
FRAMES = 11
PALETTE = 31  # colours of a frame


class KeptFigure:
    """A figure with its own Agg canvas, and the artists of it that move.

    Change the artists, then ask for `png()`, or for `layers()`. After changing anything else
    (limits, ticks, titles) call `redraw()`.
    """

    def __init__(self, figure: Figure, moving: Iterable[Artist] = ()) -> None:
        self.figure, self.moving = figure, []
        self.moves(*moving)
        self._still: Any = None
        self._ground: tuple[NDArray, bytes] | None = None  # the still part, as pixels and as PNG
        self._last: NDArray | None = None

    def moves(self, *artists: Artist) -> None:
        """Count these artists of the figure among those that move."""
        for artist in artists:
            # left out when the still part is drawn, and in when the figure is saved
            artist.set_animated(True)
        self.moving = sorted([*self.moving, *artists], key=lambda artist: artist.get_zorder())

    @property
    def width(self) -> int:
        """Width in CSS pixels."""
        return round(self.figure.get_figwidth() * CSS_DOTS_PER_INCH)

    def redraw(self) -> None:
        """Forget the still part; it is drawn anew when the next picture is asked for."""
        self._still = None

    def png(self) -> bytes:
        """The figure as it is now, as PNG."""
        return quick_png(self.pixels())

    def layers(self) -> tuple[bytes, bytes]:
        """The figure as it is now: what stands still, as PNG, and what is `differing` from it."""
        pixels = self.pixels()
        if self._ground is None:
            canvas = self.figure.canvas
            canvas.restore_region(self._still)
            still = np.array(canvas.buffer_rgba())
            self._ground = still, quick_png(still)
        return self._ground[1], differing(self._ground[0], pixels)

    def pixels(self) -> NDArray:
        """The figure as it is now, (height, width, 4) of bytes, opaque."""
        canvas = self.figure.canvas
        if self._still is None:
            with house_style():
                canvas.draw()  # also lays the panels out
            self.figure.set_layout_engine("none")
            self._still, self._ground = canvas.copy_from_bbox(self.figure.bbox), None
        canvas.restore_region(self._still)
        for artist in self.moving:
            artist.draw(canvas.get_renderer())
        self._last = np.array(canvas.buffer_rgba())
        return self._last

    def greyed(self) -> NDArray:
        """The last picture in pale grey with words across it, however often it is asked for."""
        if self._last is None:
            self.pixels()
        # anew, where the figure was saved at another resolution
        renderer = self.figure.canvas.get_renderer()
        pixels = np.asarray(renderer.buffer_rgba())
        pixels[...] = 255 - 0.35 * (255 - self._last[..., :3].mean(axis=2, keepdims=True))
        pixels[..., 3] = 255
        with house_style():
            box = {"facecolor": "white", "edgecolor": COLOURS["unstable"], "pad": 12}
            note = self.figure.text(0.5, 0.5, "nothing to show here", ha="center", va="center",
                                    fontsize=22, color=COLOURS["unstable"], bbox=box)
            note.draw(renderer)
        note.remove()
        return np.array(pixels)


def differing(still: NDArray, now: NDArray) -> bytes:
    """The pixels of `now` that differ from `still`, in runs along the rows, as 4-byte numbers,
    little end first: how many runs, where each begins, how long each is, and all their pixels.
    """
    pixels = now.reshape(-1, 4).view("<u4")[:, 0]
    at = np.flatnonzero(still.reshape(-1, 4).view("<u4")[:, 0] != pixels)
    first = np.flatnonzero(np.diff(at, prepend=-2) != 1)
    lengths = np.diff(first, append=len(at))
    return np.concatenate([[len(first)], at[first], lengths, pixels[at]]).astype("<u4").tobytes()


def quick_png(pixels: NDArray) -> bytes:
    """A PNG of pixels (height, width, 4) of bytes, as fast as can be: it leaves no computer."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "png", compress_level=1)
    return stream.getvalue()


class Frame(NamedTuple):
    """A value of the slider in words, what is said there, and the pixels seen."""

    value: str
    reading: str
    pixels: NDArray


def main_control(controls: Mapping[str, Any]) -> str | None:
    """The name of the first of an explorer's controls that is a slider, or None."""
    return next((name for name, control in controls.items() if hasattr(control, "readout")
                 and (hasattr(control, "options") or hasattr(control, "step"))), None)


def slider_values(control: Any, count: int = FRAMES, keep: Any = None) -> list[Any]:
    """At most `count` values of a slider control, both ends and `keep` (its value) among them."""
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
    """A value as a slider control writes it."""
    if hasattr(control, "options"):
        return str(value)
    return format(value, getattr(control, "readout_format", "") or "g")


def flipbook(label: str, frames: Sequence[Frame], start: int) -> str:
    """The frames as JSON: label of the slider, the start (number of the frame to begin with), the
    first frame whole, and of all frames what differs from it, so that ten of them are small.
    """
    first = frames[0].pixels[..., :3]
    rows = [{"value": frame.value, "reading": frame.reading,
             "picture": _uri(_difference(frame.pixels[..., :3], first))} for frame in frames]
    book = {"label": label, "start": start, "width": first.shape[1], "height": first.shape[0],
            "whole": _uri(_few_colours(first)), "frames": rows}
    return json.dumps(book, ensure_ascii=False)


def _few_colours(pixels: NDArray) -> Image.Image:
    image = Image.fromarray(np.ascontiguousarray(pixels), "RGB")
    return few_colours(image, PALETTE).convert("RGB")


def _difference(pixels: NDArray, first: NDArray) -> Image.Image:
    """A picture that is transparent where it is as the first one."""
    if pixels.shape != first.shape:
        return _few_colours(pixels)
    same = (pixels == first).all(axis=2)[..., None]
    changed = np.asarray(_few_colours(np.where(same, np.uint8(255), pixels)))
    seen = np.dstack([np.where(same, np.uint8(0), changed),
                      np.where(same, np.uint8(0), np.uint8(255))])
    return Image.fromarray(seen, "RGBA")


def _uri(image: Image.Image) -> str:
    return "data:image/webp;base64," + base64.b64encode(as_webp(image)).decode("ascii")
