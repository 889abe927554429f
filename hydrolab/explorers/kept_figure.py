"""A figure that follows a slider: a PNG of what stands still, sent once, and the pixels that differ
from it. To draw, write and read it whole takes ten times as long.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hydrolab.figures.style import COLOURS, CSS_DOTS_PER_INCH, house_style

COMPRESSION = 1  # of the PNG: the quickest; larger files do not leave this computer


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
        return quick_png(self._pixels())

    def layers(self) -> tuple[bytes, bytes]:
        """The figure as it is now: what stands still, as PNG, and what is `differing` from it."""
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
        canvas.restore_region(self._still)
        for artist in self.moving:
            artist.draw(canvas.get_renderer())
        self._last = np.array(canvas.buffer_rgba())
        return self._last

    def greyed(self) -> bytes:
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
            box = {"facecolor": "white", "edgecolor": COLOURS["unstable"], "pad": 12}
            note = self.figure.text(0.5, 0.5, "nothing to show here", ha="center", va="center",
                                    fontsize=22, color=COLOURS["unstable"], bbox=box)
            note.draw(renderer)
        note.remove()
        return quick_png(pixels)


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
    """A PNG of pixels (height, width, 4) of bytes, without filters: in half the usual time."""
    height, width = pixels.shape[:2]
    rows = np.zeros((height, 1 + 4 * width), dtype=np.uint8)  # each row begins with its filter, 0
    rows[:, 1:] = pixels.reshape(height, -1)

    def chunk(kind: bytes, content: bytes) -> bytes:
        check = zlib.crc32(kind + content)
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)

    # 8 bits, RGBA, the only compression and filter
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
            + chunk(b"IDAT", zlib.compress(rows, COMPRESSION)) + chunk(b"IEND", b""))
