"""Flip-books: what an explorer shows along its main slider, computed in advance for pages that have no kernel.

A stored notebook carries the frames beside the first picture; JupyterLab ignores them, the static book shows them
with a slider. The first frame is kept whole, the others as what differs from it, so that ten of them are small.
"""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

MIME = "text/vnd.hydrolab.flipbook"  # JSON as text, so that nbval compares the readings
FRAMES = 11
COLOURS = 31  # of a frame


@dataclass(frozen=True, eq=False)
class Frame:
    """A value of the slider in words, what is said there, and what is seen: pixels (height, width, 4)."""

    value: str
    reading: str
    pixels: NDArray


def main_control(controls: Iterable[Any]) -> Any | None:
    """The first of an explorer's controls that is a slider, or None."""
    return next((control for control in controls
                 if all(getattr(control, name, None) is not None for name in ("min", "max", "step"))), None)


def slider_values(control: Any, count: int = FRAMES) -> list[float]:
    """At most `count` values of a slider, both ends and the value it has among them, ascending."""
    steps = max(1, round((control.max - control.min) / control.step))
    taken = {round(place) for place in np.linspace(0, steps, min(count, steps + 1))}
    now = round((control.value - control.min) / control.step)
    if now not in taken:
        inner = [place for place in taken if 0 < place < steps] or [0]
        taken = (taken - {min(inner, key=lambda place: abs(place - now))}) | {now}
    kind = int if isinstance(control.value, int) else float
    return [control.value if place == now else kind(round(control.min + place * control.step, 12))
            for place in sorted(taken)]


def shown(control: Any, value: float) -> str:
    """A value as the slider writes it."""
    return format(value, getattr(control, "readout_format", "") or "g")


def flipbook(label: str, frames: Sequence[Frame], start: int) -> str:
    """The frames as JSON: label of the slider, number of the frame to begin with, the whole frame, and all frames."""
    first = frames[start].pixels[..., :3]
    rows = [{"value": frame.value, "reading": frame.reading, "picture": _uri(_difference(frame.pixels[..., :3], first))}
            for frame in frames]
    return json.dumps({"label": label, "start": start, "width": first.shape[1], "height": first.shape[0],
                       "whole": _uri(_few_colours(first)), "frames": rows}, ensure_ascii=False)


def _few_colours(pixels: NDArray) -> Image.Image:
    return Image.fromarray(np.ascontiguousarray(pixels), "RGB").quantize(
        COLOURS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).convert("RGB")


def _difference(pixels: NDArray, first: NDArray) -> Image.Image:
    """A picture that is transparent where it is as the first one."""
    if pixels.shape != first.shape:
        return _few_colours(pixels)
    same = (pixels == first).all(axis=2)
    changed = np.asarray(_few_colours(np.where(same[..., None], np.uint8(255), pixels)))
    return Image.fromarray(np.dstack([np.where(same[..., None], np.uint8(0), changed), 255 * ~same]).astype(np.uint8), "RGBA")


def _uri(image: Image.Image) -> str:
    stream = io.BytesIO()
    image.save(stream, "webp", lossless=True, quality=80, method=4)
    return "data:image/webp;base64," + base64.b64encode(stream.getvalue()).decode("ascii")
