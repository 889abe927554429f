"""What an explorer shows along its main slider, computed in advance for pages that have no kernel.

A stored notebook carries the frames beside the first picture; JupyterLab ignores them, the static
book shows them with a slider. The first frame is kept whole, the others as what differs from it, so
that ten of them are small.
"""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

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
    return next((name for name, control in controls.items() if hasattr(control, "readout")
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
    if hasattr(control, "options"):
        return str(value)
    return format(value, getattr(control, "readout_format", "") or "g")


def flipbook(label: str, frames: Sequence[Frame], start: int) -> str:
    """The frames as JSON: label of the slider, number of the frame to begin with, the whole frame,
    and all frames.
    """
    first = _pixels(frames[start].png)
    rows = [{"value": frame.value, "reading": frame.reading,
             "picture": _uri(_difference(_pixels(frame.png), first))} for frame in frames]
    book = {"label": label, "start": start, "width": first.shape[1], "height": first.shape[0],
            "whole": _uri(_few_colours(first)), "frames": rows}
    return json.dumps(book, ensure_ascii=False)


def _pixels(png: bytes) -> NDArray:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


def _few_colours(pixels: NDArray) -> Image.Image:
    return Image.fromarray(np.ascontiguousarray(pixels), "RGB").quantize(
        PALETTE, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).convert("RGB")


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
    stream = io.BytesIO()
    image.save(stream, "webp", lossless=True, quality=80, method=4)
    return "data:image/webp;base64," + base64.b64encode(stream.getvalue()).decode("ascii")
