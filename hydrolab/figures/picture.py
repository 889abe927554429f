"""A figure that carries its reading: the caption, the alt text and what nbval compares are one
sentence.
"""

from __future__ import annotations

import base64
import html
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from hydrolab.errors import BadInput
from hydrolab.figures.style import CSS_DOTS_PER_INCH, DOTS_PER_INCH, house_style

PALETTE = 128  # colours of a stored picture


def few_colours(image: Image.Image, count: int) -> Image.Image:
    """An image with a palette of so many colours, count."""
    return image.convert("RGB").quantize(count, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)


def as_webp(image: Image.Image) -> bytes:
    """An image as WebP without loss."""
    stream = io.BytesIO()
    image.save(stream, "webp", lossless=True, quality=80, method=4)
    return stream.getvalue()


@dataclass(frozen=True, eq=False, repr=False)
class Picture:
    """A Matplotlib figure and what it says in words, computed from the same result.

    In a notebook it shows as an HTML figure whose alt text and caption are the reading. Its plain
    text is the reading alone, so a test that compares stored outputs sees when a figure says
    something else.
    """

    figure: Figure
    reading: str

    @house_style()
    def _written(self, kind: str, metadata: dict[str, str | None]) -> bytes:
        stream = io.BytesIO()
        self.figure.savefig(stream, format=kind, dpi=DOTS_PER_INCH, metadata=metadata)
        return stream.getvalue()

    def _few_colours(self) -> Image.Image:
        """The picture with a palette: a notebook with ten of them opens quickly."""
        return few_colours(Image.open(io.BytesIO(self._written("png", {"Software": None}))),
                           PALETTE)

    def png(self) -> bytes:
        """The picture as PNG, the same bytes each time, with the reading as its description."""
        words = PngInfo()
        words.add_itxt("Description", self.reading)
        stream = io.BytesIO()
        self._few_colours().save(stream, "png", optimize=True, dpi=(DOTS_PER_INCH, DOTS_PER_INCH),
                                 pnginfo=words)
        return stream.getvalue()

    def webp(self) -> bytes:
        """The picture as WebP without loss, two thirds of the PNG, for pages that hold it."""
        return as_webp(self._few_colours().convert("RGB"))

    def svg(self) -> bytes:
        """The picture as SVG, the same bytes each time; the reading is its title."""
        return self._written("svg", {"Date": None, "Creator": None, "Title": self.reading,
                                     "Description": self.reading})

    def save(self, path: str | Path) -> Path:
        """Write a PNG or an SVG, as the name ends, and return where it is.

        Raises BadInput for another ending.
        """
        path = Path(path)
        writers = {".png": self.png, ".svg": self.svg}
        if path.suffix.lower() not in writers:
            raise BadInput(f"path is {str(path)!r}; a picture is written as .png or .svg.")
        path.write_bytes(writers[path.suffix.lower()]())
        return path

    def _repr_html_(self) -> str:
        data = base64.b64encode(self.webp()).decode("ascii")
        words = html.escape(self.reading, quote=True)
        width = round(self.figure.get_figwidth() * CSS_DOTS_PER_INCH)
        return (f'<figure style="margin: 0"><img alt="{words}" src="data:image/webp;base64,{data}" '
                f'style="width: {width}px; max-width: '
                f'100%"/><figcaption>{words}</figcaption></figure>')

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, str]:
        return {"text/html": self._repr_html_(), "text/plain": self.reading}

    def __repr__(self) -> str:
        return self.reading
