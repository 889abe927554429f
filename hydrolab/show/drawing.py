"""Pieces that several figures share: an orbit with its sense of rotation, the gap, the smallest gap, limits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.show.style import COLOURS

REVOLUTION = np.linspace(0.0, 2 * np.pi, 721)
MM, UM = 1e3, 1e6  # from metres


def draw_orbit(axes: Axes, path: NDArray, colour: Any, *, label: str = "", width: float = 2.2, line: str = "-",
               sense: bool = True) -> None:
    """Draw one revolution, path (2, n) in m from Ωt = 0, in mm: a dot at Ωt = 0 and an arrow the way it goes."""
    x, z = MM * path
    axes.plot(x, z, line, color=colour, linewidth=width, label=label)
    if sense:
        axes.plot(x[0], z[0], "o", color=colour, markersize=6, markeredgecolor="white", markeredgewidth=0.8, zorder=5)
        draw_arrow(axes, path, colour)


def draw_arrow(axes: Axes, path: NDArray, colour: Any, at: float = 0.12) -> None:
    """An arrowhead on a path (2, n) in m, the way it goes, at a share of its samples."""
    here = round(at * (path.shape[1] - 1))
    tail, tip = (MM * path[:, i] for i in (here, here + max(1, path.shape[1] // 120)))
    axes.annotate("", xy=tip, xytext=tail, arrowprops={"arrowstyle": "-|>", "color": colour, "mutation_scale": 17,
                                                       "shrinkA": 0, "shrinkB": 0})


def draw_gap(axes: Axes, centre: NDArray, gap: float, *, label: bool = True) -> None:
    """The circle the rotor centre may not leave, radius g0 about the stator centre; that centre; the bearing axis."""
    words = (f"contact: radius $g_0$ = {MM * gap:.3g} mm", "stator centre", "bearing axis") if label else ("",) * 3
    circle = centre[:, None] + gap * np.array([np.sin(REVOLUTION), np.cos(REVOLUTION)])
    axes.plot(*(MM * circle), color=COLOURS["stator"], linewidth=3, label=words[0])
    axes.plot(*(MM * centre), "x", color=COLOURS["stator"], markersize=8, markeredgewidth=2, label=words[1])
    draw_axis(axes, words[2])


def draw_axis(axes: Axes, label: str = "") -> None:
    """The bearing axis, where the rotor rests without any force."""
    axes.plot(0, 0, "+", color=COLOURS["axis"], markersize=11, markeredgewidth=1.6, label=label)


def draw_smallest_gap(axes: Axes, orbit: PeriodicOrbit) -> None:
    """A measure from the orbit to the circle where the gap is smallest."""
    path = orbit.positions(REVOLUTION)
    away = path - orbit.centre[:, None]
    at = int(np.argmax(np.hypot(*away)))
    radius = math.hypot(*away[:, at])
    touch = orbit.centre + away[:, at] * orbit.model.gap / radius
    axes.annotate("", xy=MM * touch, xytext=MM * path[:, at],
                  arrowprops={"arrowstyle": "<|-|>", "color": COLOURS["axis"], "shrinkA": 0, "shrinkB": 0})
    middle = MM * (touch + path[:, at]) / 2
    axes.annotate(f"{MM * orbit.smallest_gap:.2f} mm", middle, xytext=(0, 9), textcoords="offset points",
                  ha="center", fontsize=12)


def frame(axes: Axes, points: ArrayLike, margin: float = 0.12) -> None:
    """Set the limits around points (2, n) in m, in mm, with a margin; the same aspect fills the rest."""
    x, z = MM * np.asarray(points)
    pad = max(margin * max(np.ptp(x), np.ptp(z)), 1e-3)
    axes.set_xlim(x.min() - pad, x.max() + pad, auto=None)  # not fixed: equal aspect widens them
    axes.set_ylim(z.min() - pad, z.max() + pad, auto=None)


def frame_gap(axes: Axes, centre: NDArray, gap: float) -> None:
    """Set the limits around the whole gap."""
    frame(axes, centre[:, None] + gap * np.array([[-1.0, 1.0], [-1.0, 1.0]]), 0.04)
