"""Pieces that several figures share: an orbit with its sense of rotation, the gap, the smallest
gap, limits.

Here colour, line, width: as Matplotlib takes them. label: in the legend.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.harmonics import PERIOD
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.figures.style import COLOURS, plane
from hydrolab.machine.model import Model

REVOLUTION = np.linspace(0.0, 2 * np.pi, 721)
MM, UM = 1e3, 1e6  # from metres
PALE = "#C8C8C8"  # what something is compared with


def draw_orbit(axes: Axes, path: NDArray, colour: Any, *, label: str = "", width: float = 2.2,
               line: str = "-", sense: bool = True) -> None:
    """Draw one revolution, path (2, n) in m from Ωt = 0, in mm; sense: with its sense."""
    axes.plot(*(MM * path), line, color=colour, linewidth=width, label=label)
    if sense:
        draw_sense(axes, path, colour)


def draw_sense(axes: Axes, path: NDArray, colour: Any, label: str = "") -> None:
    """A dot where a revolution begins, at Ωt = 0, and an arrow the way it goes; path (2, n) in m.
    """
    axes.plot(*(MM * path[:, :1]), "o", color=colour, markersize=8, markeredgecolor="white",
              zorder=5, linestyle="none", label=label)
    draw_arrow(axes, path, colour)


def draw_arrow(axes: Axes, path: NDArray, colour: Any, at: float = 0.6) -> None:
    """An arrowhead on a path (2, n) in m, the way it goes, at a share of its samples."""
    here = min(round(at * (path.shape[1] - 1)), path.shape[1] - 7)
    if here < 0:
        return
    tail, tip = MM * path[:, here], MM * path[:, here + 6]
    axes.annotate("", xy=tip, xytext=tail, arrowprops={"arrowstyle": "-|>", "color": colour,
                                                       "mutation_scale": 17,
                                                       "shrinkA": 0, "shrinkB": 0})


def about_mean(orbit: PeriodicOrbit) -> NDArray:
    """One revolution of an orbit about its mean, µm, (2, 721)."""
    return UM * (orbit.positions(REVOLUTION) - orbit.mean[:, None])


def close_up(axes: Axes, title: str, path: NDArray, label: str, reach: float) -> None:
    """A plane with a title and a reach, µm, and a wide grey path (2, n) to compare another with."""
    plane(axes, title)
    axes.set(xlabel="x, µm", ylabel="z, µm", adjustable="box", xlim=(-reach, reach),
             ylim=(-reach, reach))
    axes.plot(*path, color=PALE, linewidth=7, label=label)


def contact_line(model: Model) -> NDArray:
    """Where the centre of a rotor that does not lean would touch, about the stator's centre, m, (2,
    181): a circle of radius g0 where stator and rotor are round, else found by halving.

    Of a rotor that is out of round it is where it touches somewhere in a revolution.
    """
    angle = np.linspace(0.0, 2 * np.pi, 181)
    turn = np.array([np.sin(angle), np.cos(angle)])
    phase = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)[:, None] if model.law.moving else 0.0
    low, high = 0 * angle, np.full_like(angle, 2 * model.gap)
    for _ in range(30):
        middle = (low + high) / 2
        clear = np.min(model.law.smallest_gap((middle * turn)[:, None], phase), axis=0) > 0
        low, high = np.where(clear, middle, low), np.where(clear, high, middle)
    return low * turn


def draw_gap(axes: Axes, centre: NDArray, model: Model, *, label: bool = True) -> None:
    """The line the rotor centre may not cross, about the stator centre (m), and both centres."""
    line = contact_line(model)
    is_round = np.ptp(np.hypot(*line)) < 1e-6 * model.gap
    contact = f"contact, radius {MM * model.gap:.3g} mm" if is_round else "contact"
    words = (contact, "stator centre", "bearing axis") if label else ("",) * 3
    axes.plot(*(MM * (centre[:, None] + line)), color=COLOURS["stator"], linewidth=3,
              label=words[0])
    axes.plot(*(MM * centre), "x", color=COLOURS["stator"], markersize=8, markeredgewidth=2,
              label=words[1])
    draw_axis(axes, words[2])


def gap_plane(axes: Axes, title: str, gap: float) -> None:
    """A plane with a title, the bearing axis and the limits of a whole gap, m, about it."""
    plane(axes, title)
    draw_axis(axes)
    reach = 1.12 * MM * gap
    axes.set(adjustable="box", xlim=(-reach, reach), ylim=(-reach, reach))


def draw_axis(axes: Axes, label: str = "") -> None:
    """The bearing axis, where the rotor rests without any force."""
    axes.plot(0, 0, "+", color=COLOURS["axis"], markersize=11, markeredgewidth=1.6, label=label)


def nearest(axes: Axes, x: float, y: float, points: NDArray) -> int | None:
    """Which of some points (P, 2) of the axes is nearest to a place in the figure, as it is seen;
    None off the axes.

    x, y: shares of the figure's width and height from its lower left corner.
    """
    box = axes.get_position()
    place = np.array([(x - box.x0) / box.width, (y - box.y0) / box.height])
    if not ((place > -0.03) & (place < 1.03)).all():
        return None
    return int(np.argmin(np.hypot(*((axes.transScale + axes.transLimits).transform(points)
                                    - place).T)))


def narrowest(orbit: PeriodicOrbit) -> NDArray:
    """The rotor centre where the gap is smallest on an orbit, and the point across that gap, m,
    (2, 2): the measure's ends in its columns.
    """
    phase = orbit.revolutions * PERIOD
    place = orbit.model.relative(orbit.coordinates(phase), orbit.centre[:, None])
    gap, angle = orbit.model.law.narrowest(place, phase)
    at = int(np.argmin(gap))
    start = orbit.positions(phase[at:at + 1])[:, 0]
    towards = np.array([math.sin(angle[at]), math.cos(angle[at])])
    return np.column_stack([start, start + gap[at] * towards])


def draw_smallest_gap(axes: Axes, orbit: PeriodicOrbit) -> None:
    """A measure from the orbit across the gap where it is smallest."""
    start, end = MM * narrowest(orbit).T
    if np.allclose(start, MM * orbit.centre, atol=1e-9):
        return  # at rest in the middle: the gap is the same all around
    axes.annotate("", xy=end, xytext=start,
                  arrowprops={"arrowstyle": "<|-|>", "color": COLOURS["axis"], "shrinkA": 0,
                              "shrinkB": 0})
    axes.annotate(f"{MM * orbit.smallest_gap:.2f} mm", (start + end) / 2, xytext=(0, 9),
                  textcoords="offset points", ha="center", fontsize=12)


def frame(axes: Axes, points: ArrayLike, margin: float = 0.12) -> None:
    """Set the limits around points (2, n), m, with a margin; the same aspect fills the rest."""
    x, z = MM * np.asarray(points)
    pad = max(margin * max(np.ptp(x), np.ptp(z)), 1e-3)
    axes.set_xlim(x.min() - pad, x.max() + pad, auto=None)  # not fixed: equal aspect widens them
    axes.set_ylim(z.min() - pad, z.max() + pad, auto=None)


def draw_place(axes: Axes, orbit: PeriodicOrbit, colour: Any) -> None:
    """Where an orbit lies in its whole gap, with the legend where the circle leaves room."""
    plane(axes, "Where it lies in the gap")
    centre, gap = orbit.centre, orbit.model.gap
    draw_gap(axes, centre, orbit.model)
    draw_orbit(axes, orbit.positions(orbit.revolutions * REVOLUTION), colour, sense=False)
    axes.legend(loc="center", bbox_to_anchor=tuple(MM * (centre - [0, 0.5 * gap])),
                bbox_transform=axes.transData, handlelength=1.5)
    frame(axes, centre[:, None] + gap * np.array([[-1.0, 1.0], [-1.0, 1.0]]), 0.04)


def round_up(value: float) -> float:
    """The next of 1, 1.5, 2, 3, 5, 7 times a power of ten."""
    if not value > 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return next(f * power for f in (1, 1.5, 2, 3, 5, 7, 10, 15) if f * power >= value * (1 - 1e-12))
