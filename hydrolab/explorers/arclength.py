"""Natural and arclength continuation on three curves, with steps of one length."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.continuation import Step, correct
from hydrolab.explorers.widget import FigureExplorer, KeptFigure, View, choice, slider, whole
from hydrolab.figures.style import COLOURS, house_style, new_figure

KAPPA = 1.64  # stiffness of the springs over that of the pull
TENTHS = 10.0  # both lengths of the pull-in curve are counted in tenths of the gap
WAYS = ("natural", "arclength")
System = Callable[[NDArray, float], tuple[NDArray, NDArray, NDArray]]


def circle(y: NDArray, parameter: float) -> tuple[NDArray, NDArray, NDArray]:
    """y² + λ² = 1: residual, its derivative in y, its derivative in λ."""
    return y**2 + parameter**2 - 1, np.array([[2 * y[0]]]), np.array([2 * parameter])


def s_curve(y: NDArray, parameter: float) -> tuple[NDArray, NDArray, NDArray]:
    """y³ − y = λ, which folds twice."""
    return y**3 - y - parameter, np.array([[3 * y[0] ** 2 - 1]]), np.array([-1.0])


def pull_in(y: NDArray, parameter: float) -> tuple[NDArray, NDArray, NDArray]:
    """ε − ε/(κ (1 − ε²)^{3/2}) = e_s, the rotor at rest between springs and pull, with y = 10 ε and
    λ = 10 e_s.
    """
    eps = y[0] / TENTHS
    s = 1 - eps**2
    if s <= 0:  # the rotor in the stator
        return np.array([np.nan]), np.ones((1, 1)), np.zeros(1)
    value = eps - eps / (KAPPA * s**1.5)
    slope = 1 - (1 + 2 * eps**2) / (KAPPA * s**2.5)
    return np.array([TENTHS * value - parameter]), np.array([[slope]]), np.array([-1.0])


# system, where the walk begins (y, λ), the whole curve (λ, y), axes' limits and labels
TURN = np.linspace(-np.pi, np.pi, 401)
CUBIC, EPS = np.linspace(-1.6, 1.6, 401), np.linspace(-0.2, 0.62, 401)
PULL_IN = TENTHS * (EPS - EPS / (KAPPA * (1 - EPS**2) ** 1.5)), TENTHS * EPS
CURVES = {
    "circle": (circle, (1.0, 0.0), (np.sin(TURN), np.cos(TURN)),
               {"xlim": (-2.2, 2.2), "ylim": (-1.3, 1.3), "xlabel": "λ", "ylabel": "y"}),
    "S": (s_curve, (-1.4, -1.344), (CUBIC**3 - CUBIC, CUBIC),
          {"xlim": (-2, 2), "ylim": (-1.7, 1.7), "xlabel": "λ", "ylabel": "y"}),
    "static pull-in": (pull_in, (0.0, 0.0), PULL_IN,
                       {"xlim": (-1.4, 1.6), "ylim": (-2, 8),
                        "xlabel": "static eccentricity, tenths of the gap",
                        "ylabel": "displacement, tenths of the gap"}),
}


def natural_walk(system: System, y: float, parameter: float, step: float,
                 count: int) -> tuple[list[Step], str]:
    """Newton at λ + Δλ from the last y, again and again; the points, and where it stopped, or "".
    """
    found: list[Step] = []
    z = np.array([y])
    for _ in range(count):
        parameter += step
        iterations = 0
        while iterations < 20:
            iterations += 1
            residual, slope, _ = system(z, parameter)
            if not np.isfinite(residual[0]) or not slope[0, 0] or abs(residual[0]) < 1e-10:
                break
            z = z - residual / slope[0, 0]
        if not abs(residual[0]) < 1e-10:
            return found, f"Newton fails at λ = {parameter:.3f}"
        found.append(Step(z, parameter, np.array([0.0, 1.0]), abs(float(residual[0])), iterations))
    return found, ""


def arclength_walk(system: System, y: float, parameter: float, step: float,
                   count: int) -> tuple[list[Step], str]:
    """Steps Δs along the tangent, each corrected across it; the points, and where it stopped, or
    "".
    """
    here = correct(system, np.array([y, parameter]), np.array([0.0, 1.0]))
    found: list[Step] = []
    for _ in range(count):
        new = correct(system, np.append(here.y, here.parameter) + step * here.tangent, here.tangent)
        if new is None:
            return found, f"the corrector fails after λ = {here.parameter:.3f}"
        found.append(new)
        here = new
    return found, ""


class ArclengthView(View):
    """A curve, and the points that natural or arclength continuation finds on it with steps of one
    length.
    """

    @house_style()
    def __init__(self) -> None:
        self._curve = ""
        figure = new_figure(9, 5.4)
        self.axes = figure.subplots()
        self.whole, = self.axes.plot([], [], color="#C8C8C8", linewidth=7, label="the curve")
        self.ways, = self.axes.plot([], [], "-", color=COLOURS["1X"], linewidth=1.4,
                                    label="predicted, then corrected")
        self.points, = self.axes.plot([], [], "o", color=COLOURS["rotor"], label="found")
        self.last, = self.axes.plot([], [], "X", color=COLOURS["unstable"], markersize=14,
                                    linestyle="none")
        self.axes.legend(loc="upper left", fontsize=11)
        self.kept = KeptFigure(figure, [self.ways, self.points, self.last])
        self("circle", "natural", 0.2, 1)  # so that the margins are those of a drawn curve

    def __call__(self, curve: str, way: str, step: float, count: int) -> str:
        """Show so many steps of a length; return the reading."""
        system, (y, parameter), whole, limits = CURVES[curve]
        if curve != self._curve:
            self._curve = curve
            self.whole.set_data(*whole)
            self.axes.set(**limits)
            self.kept.redraw()
        walk = natural_walk if way == WAYS[0] else arclength_walk
        found, stopped = walk(system, y, parameter, step, count)
        # each step goes along its tangent to what was predicted, then to what was found
        at = np.array([[parameter, y], *([p.parameter, p.y[0]] for p in found)])
        tangents = np.array([[1.0, 0.0], *(p.tangent[::-1] for p in found)])
        if way == WAYS[1]:
            start = correct(system, np.array([y, parameter]), np.array([0.0, 1.0]))
            tangents[0] = start.tangent[::-1]
        zigzag = np.stack([at[:-1], at[:-1] + step * tangents[:-1], at[1:]], axis=1)
        self.points.set_data(*at.T)
        self.ways.set_data(*zigzag.reshape(-1, 2).T)
        self.last.set_data(*at[-1:].T if stopped else ([], []))
        turns = int((np.diff(np.sign(np.diff(at[:, 0]))) != 0).sum())
        work = sum(p.iterations for p in found)
        far = np.abs(np.diff(at[:, 1])).max() if len(found) else 0.0
        leapt = way == WAYS[0] and far > 0.35 * np.ptp(limits["ylim"])
        leap = " One step leapt to another part of the curve." if leapt else ""
        ended = (f"after {len(found)} of {count} steps {stopped}; the last point is" if stopped else
                 f"after all {count} steps it is")
        return (f"{way.capitalize()} continuation on the curve “{curve}” with steps of {step:.2f}: "
                f"{ended} at λ = {at[-1, 0]:.3f}, y = {at[-1, 1]:.3f}; folds passed: {turns}; "
                f"Newton steps: {work}.{leap}")


def arclength_explorer() -> FigureExplorer:
    """Natural and arclength continuation on a circle, an S and the static pull-in curve, with steps
    of one length.
    """
    return FigureExplorer(ArclengthView(), {
        "curve": choice("curve", "circle", list(CURVES)),
        "way": choice("continuation", WAYS[0], list(WAYS)),
        "step": slider("length of a step", 0.2, 0.02, 0.6, 0.02, 2),
        "count": whole("steps", 12, 1, 60)})
