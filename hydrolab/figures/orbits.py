"""An orbit, and a branch as a line: smooth between its points, stable stretches solid and the
others dashed, folds as diamonds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from hydrolab.dynamics.branches import Branch
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.stability import Floquet
from hydrolab.figures.drawing import (
    MM,
    REVOLUTION,
    UM,
    draw_axis,
    draw_orbit,
    draw_place,
    draw_sense,
    draw_smallest_gap,
    frame,
)
from hydrolab.figures.picture import Picture
from hydrolab.figures.readings import (
    along,
    branch_reading,
    direction_words,
    first_along,
    followed,
    orbit_reading,
    percent,
    verdicts,
)
from hydrolab.figures.style import COLOURS, LINES, house_style, new_figure, plane
from hydrolab.machine.quantities import RPM

# coefficients of the c nonlinear coordinates, (points, c, 2m + 1) → a length of each point, m
Number = Callable[[NDArray], NDArray]


@dataclass(frozen=True)
class Curve:
    """A branch as a smooth curve through its points and folds, for the eye.

    at_points, at_folds: position of each along the curve. spline: position → [value of the
    parameter, coefficients of the c nonlinear coordinates …]. coordinates: c.
    """

    at_points: NDArray
    at_folds: NDArray
    spline: CubicSpline
    coordinates: int

    def __call__(self, position: NDArray) -> tuple[NDArray, NDArray]:
        """Value of the parameter (static eccentricity: fraction of the gap) and coefficients of the
        c nonlinear coordinates (m or rad, (…, c, 2m + 1)) at these positions; the generator's x and
        z come first.
        """
        rows = self.spline(position)
        return rows[..., 0], rows[..., 1:].reshape(*rows.shape[:-1], self.coordinates, -1)


def curve(branch: Branch) -> Curve:
    """A cubic spline over the chord length; its knots hold the folds, so it turns there."""
    length = branch.equations.length
    points = np.column_stack([branch.values, length * branch.unknowns])
    after = np.array([fold.after for fold in branch.folds], dtype=int)
    if len(after):
        folds = np.array([np.append(fold.value, length * fold.unknowns) for fold in branch.folds])
        points = np.insert(points, after + 1, folds, axis=0)
    rows = after + 1 + np.arange(len(after))
    scale = np.full(points.shape[1], 1 / branch.equations.model.length_scale)
    scale[0] = 1 / branch.path.scale
    chord = np.linalg.norm(np.diff(points * scale, axis=0), axis=1)
    position = np.concatenate([[0.0], np.cumsum(np.maximum(chord, 1e-12))])
    return Curve(np.delete(position, rows), position[rows], CubicSpline(position, points),
                 len(branch.equations.linear))


def stretches(branch_curve: Curve, words: Sequence[str]) -> list[tuple[str, float, float]]:
    """Stretches of one verdict, of the words of all points, and their ends along the curve: at a
    fold between two points, else half way.
    """
    points, folds = branch_curve.at_points, branch_curve.at_folds
    found = [(words[0], points[0], points[-1])]
    for i in range(1, len(words)):
        if words[i] != words[i - 1]:
            between = folds[(folds > points[i - 1]) & (folds < points[i])]
            change = float(between[0]) if len(between) else float(points[i - 1] + points[i]) / 2
            found[-1] = (*found[-1][:2], change)
            found.append((words[i], change, points[-1]))
    return found


def draw_branch(axes: Axes, branch: Branch, number: Number,
                stability: Sequence[Floquet] | None = None) -> None:
    """Draw a number of a branch (m, in µm) over its parameter (the static eccentricity in %)."""
    scale, _ = parameter_axis(branch)
    if len(branch) == 1:
        axes.plot(scale * branch.values, UM * number(branch.local), "o", color=COLOURS["rotor"],
                  label="steady state")
        return
    smooth = curve(branch)
    words = verdicts(branch, stability) if stability else [""] * len(branch)
    seen: set[str] = set()
    for verdict, start, end in stretches(smooth, words):
        share = (end - start) / (smooth.at_points[-1] - smooth.at_points[0])
        values, local = smooth(np.linspace(start, end, 16 + round(1000 * share)))
        axes.plot(scale * values, UM * number(local), LINES.get(verdict, "-"),
                  color=COLOURS.get(verdict, COLOURS["rotor"]),
                  label="" if verdict in seen else f"{verdict} steady state".strip())
        seen.add(verdict)
    if len(smooth.at_folds):
        values, local = smooth(smooth.at_folds)
        axes.plot(scale * values, UM * number(local), "D", color=COLOURS["fold"], label="fold",
                  zorder=5)


def parameter_axis(branch: Branch) -> tuple[float, str]:
    """What the values of a branch's parameter are multiplied by on an axis, and the axis' label."""
    if branch.parameter == "static_eccentricity":
        return 100.0, "static eccentricity, % of the gap"
    if branch.parameter == "speed":
        return 1 / RPM, "speed, rpm"
    unit = branch.path.unit
    return 1.0, f"{followed(branch)}, {unit}" if unit else followed(branch)


@house_style()
def orbit_picture(orbit: PeriodicOrbit) -> Picture:
    """The orbit of the rotor centre, seen from above: its shape, and where it lies in the gap."""
    path = orbit.positions(orbit.revolutions * REVOLUTION)
    has_gap = math.isfinite(orbit.model.gap)
    figure = new_figure(12, 6) if has_gap else new_figure(7, 6)
    near, *far = figure.subplots(1, 2 if has_gap else 1, squeeze=False)[0]
    plane(near, f"Orbit at {percent(orbit.static_eccentricity)} static eccentricity")
    draw_orbit(near, path, COLOURS["rotor"], label="rotor centre", sense=False)
    draw_sense(near, path, COLOURS["rotor"], "Ωt = 0")
    near.plot(*(MM * orbit.mean), "+", color=COLOURS["mean"], markersize=10, markeredgewidth=1.6,
              label="mean")
    frame(near, path, 0.25)
    near.legend(loc="upper right")
    for axes in far:
        draw_place(axes, orbit, COLOURS["rotor"])
        draw_smallest_gap(axes, orbit)
    if not far:
        draw_axis(near)
    return Picture(figure, orbit_reading(orbit))


@house_style()
def branch_picture(branch: Branch, stability: Sequence[Floquet] | None = None) -> Picture:
    """A branch over the parameter that it follows: the mean and 1X, both along the eccentricity,
    with folds.

    stability: of each of its points, as `branch_stability` gives it; without it nothing is said
    about stability.
    """
    figure = new_figure(12, 5.5)
    left, right = figure.subplots(1, 2, sharex=True)
    draw_branch(left, branch, lambda c: along(branch, c)[:, 0], stability)
    draw_branch(right, branch, lambda c: first_along(branch, c), stability)
    left.set_ylabel("mean displacement, µm")
    right.set_ylabel("1X amplitude, µm (0-to-peak)")
    left.legend(loc="best")
    scale, label = parameter_axis(branch)
    figure.supxlabel(label)
    figure.suptitle(f"Steady states, {direction_words(branch)}")
    if branch.parameter == "static_eccentricity":
        left.set_xlim(left=min(0.0, scale * float(np.min(branch.values))))
    right.set_ylim(bottom=0)
    return Picture(figure, branch_reading(branch, stability))
