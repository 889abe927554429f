"""A branch as a line: smooth between its points, stable stretches solid and the others dashed, folds as diamonds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from hydrolab.dynamics.results import Branch
from hydrolab.dynamics.stability import Floquet
from hydrolab.show.drawing import UM
from hydrolab.show.readings import verdicts
from hydrolab.show.style import COLOURS, LINES

Number = Callable[[NDArray], NDArray]  # coefficients, shape (points, 2, 2m + 1) → a length of each point, m


@dataclass(frozen=True)
class Curve:
    """A branch as a smooth curve through its points and folds, for the eye.

    at_points, at_folds: position of each along the curve. spline: position → [eccentricity, coefficients …].
    """

    at_points: NDArray
    at_folds: NDArray
    spline: CubicSpline

    def __call__(self, position: NDArray) -> tuple[NDArray, NDArray]:
        """Static eccentricity (fraction of the gap) and coefficients (m, (…, 2, 2m + 1)) at these positions."""
        rows = self.spline(position)
        return rows[..., 0], rows[..., 1:].reshape(*rows.shape[:-1], 2, -1)


def curve(branch: Branch) -> Curve:
    """A cubic spline over the chord length; the folds are among its knots, so it turns where the branch does."""
    length = branch.equations.length
    points = np.column_stack([branch.static_eccentricity, length * branch.unknowns])
    after = np.array([fold.after for fold in branch.folds], dtype=int)
    if len(after):
        folds = np.array([np.append(fold.value, length * fold.unknowns) for fold in branch.folds])
        points = np.insert(points, after + 1, folds, axis=0)
    rows = after + 1 + np.arange(len(after))
    scale = np.append(1.0, np.full(points.shape[1] - 1, 1 / branch.equations.model.length_scale))
    chord = np.linalg.norm(np.diff(points * scale, axis=0), axis=1)
    position = np.concatenate([[0.0], np.cumsum(np.maximum(chord, 1e-12))])
    return Curve(np.delete(position, rows), position[rows], CubicSpline(position, points))


def stretches(branch_curve: Curve, words: Sequence[str]) -> list[tuple[str, float, float]]:
    """Stretches of one verdict and their ends along the curve: at a fold between two points, else half way."""
    points, folds = branch_curve.at_points, branch_curve.at_folds
    found = [(words[0], points[0], points[-1])]
    for i in range(1, len(words)):
        if words[i] != words[i - 1]:
            between = folds[(folds > points[i - 1]) & (folds < points[i])]
            change = float(between[0]) if len(between) else float(points[i - 1] + points[i]) / 2
            found[-1] = (*found[-1][:2], change)
            found.append((words[i], change, points[-1]))
    return found


def draw_branch(axes: Axes, branch: Branch, number: Number, stability: Sequence[Floquet] | None = None) -> None:
    """Draw one number of a branch (m, in µm) over the static eccentricity (%)."""
    if len(branch) == 1:
        axes.plot(100 * branch.static_eccentricity, UM * number(branch.coefficients), "o", color=COLOURS["rotor"],
                  label="steady state")
        return
    smooth = curve(branch)
    words = verdicts(branch, stability) if stability else [""] * len(branch)
    seen: set[str] = set()
    for verdict, start, end in stretches(smooth, words):
        share = (end - start) / (smooth.at_points[-1] - smooth.at_points[0])
        eccentricity, coefficients = smooth(np.linspace(start, end, 16 + round(1000 * share)))
        axes.plot(100 * eccentricity, UM * number(coefficients), LINES.get(verdict, "-"),
                  color=COLOURS.get(verdict, COLOURS["rotor"]),
                  label="" if verdict in seen else f"{verdict} steady state".strip())
        seen.add(verdict)
    if len(smooth.at_folds):
        eccentricity, coefficients = smooth(smooth.at_folds)
        axes.plot(100 * eccentricity, UM * number(coefficients), "D", color=COLOURS["fold"], label="fold", zorder=5)
