"""The house style: one look, and one colour for one thing, in every figure of the library and the
course.

The colours are those of Okabe and Ito (2008), which readers with any colour vision tell apart; what
must not be confused also differs in line style. Nothing here touches pyplot or the reader's own
settings.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType

import numpy as np
from matplotlib import colormaps, style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILLION, PURPLE = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7")

COLOURS: Mapping[str, str] = MappingProxyType({
    "x": BLUE, "z": VERMILLION,
    "mean": BLACK, "1X": ORANGE, "2X": GREEN, "3X": PURPLE, "4X": SKY,
    "stable": GREEN, "unstable": VERMILLION, "unknown": "#7F7F7F", "fold": BLACK,
    "stator": "#7F7F7F", "rotor": BLUE, "axis": "#595959", "bearing": "#BFBFBF",
    "harmonic balance": SKY, "integration": BLACK,
})
LINES: Mapping[str, str] = MappingProxyType({
    "mean": "-", "1X": "-", "2X": "--", "3X": "-.", "4X": ":", "stable": "-", "unstable": "--",
    "unknown": ":"})

DOTS_PER_INCH = 144  # of a stored picture; shown at CSS_DOTS_PER_INCH, so sharp on a dense screen
CSS_DOTS_PER_INCH = 96

STYLE: Mapping[str, object] = MappingProxyType({
    "figure.facecolor": "white", "figure.dpi": CSS_DOTS_PER_INCH,
    "figure.constrained_layout.use": True,
    "figure.titlesize": 16, "figure.labelsize": 14,
    "font.family": ["DejaVu Sans"], "font.size": 13, "mathtext.fontset": "dejavusans",
    "axes.titlesize": 14, "axes.labelsize": 14, "axes.grid": True, "axes.axisbelow": True,
    "axes.linewidth": 1.0,
    "axes.spines.top": False, "axes.spines.right": False,
    "grid.color": "#DDDDDD", "grid.linewidth": 0.8,
    "xtick.labelsize": 12, "ytick.labelsize": 12, "legend.fontsize": 12, "legend.framealpha": 0.9,
    "legend.edgecolor": "#DDDDDD", "legend.handlelength": 2.4,
    "lines.linewidth": 2.2, "lines.markersize": 7, "lines.solid_capstyle": "round",
    "svg.hashsalt": "hydrolab", "svg.fonttype": "path",
})


@contextmanager
def house_style() -> Iterator[None]:
    """Draw in the house style inside a `with`, or in a whole function as a decorator."""
    with style.context(["default", dict(STYLE)]):
        yield


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, width by height inches, with an Agg canvas: pyplot never hears of it."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def eccentricity_colours(count: int) -> list[tuple[float, ...]]:
    """Colours for rising eccentricity, from dark to light; also apart in grey."""
    return [tuple(c) for c in colormaps["viridis"](np.linspace(0.0, 0.86, count))]


def plane(axes: Axes, title: str = "") -> None:
    """Make axes a view of the transverse plane from above, with a title: x to the right, z up,
    equal aspect, so spin is clockwise.
    """
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x, mm")
    axes.set_ylabel("z, mm")
    axes.set_title(title)
