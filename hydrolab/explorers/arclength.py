"""Natural and arclength continuation on three curves, with steps of one length."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.continuation import Step, correct
from hydrolab.explorers.widget import FigureExplorer, View, at_work, choice, slider, whole
from hydrolab.figures.drawing import PALE
from hydrolab.figures.style import COLOURS

KAPPA = 1.64  # stiffness of the springs over that of the pull
TENTHS = 10.0  # both lengths of the pull-in curve are counted in tenths of the gap
WAYS = ("natural", "arclength")
System = Callable[[NDArray, float], tuple[NDArray, NDArray, NDArray]]


def circle(y: NDArray, parameter: float) -> tuple[NDArray, NDArray, NDArray]:
    """y² + λ² = 1, λ the parameter: residual, its derivative in y, its derivative in λ."""
    return y**2 + parameter**2 - 1, np.array([[2 * y[0]]]), np.array([2 * parameter])


def s_curve(y: NDArray, parameter: float) -> tuple[NDArray, NDArray, NDArray]:
    """y³ − y = λ, the parameter: a curve that folds twice."""
    return y**3 - y - parameter, np.array([[3 * y[0] ** 2 - 1]]), np.array([-1.0])


def pull_in(y: NDArray, parameter: float) -> tuple[NDArray, NDArray, NDArray]:
    """ε − ε/(κ (1 − ε²)^{3/2}) = e_s, a rotor at rest; y = 10 ε, the parameter is 10 e_s."""
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


def walk(system: System, start: NDArray, step: float, count: int,
         natural: bool) -> tuple[list[Step], NDArray, str]:
    """Take count steps of a length on a system from start (y, λ), and correct each across the way
    it went: along λ (natural) or along the tangent. Return the points from the start on; where each
    step led before its correction, (steps, 2); and where it stopped, or "".
    """
    upwards = np.array([0.0, 1.0])
    found, guesses = [correct(system, start, upwards)], []
    for _ in range(count):
        way = upwards if natural else found[-1].tangent
        guess = np.append(found[-1].y, found[-1].parameter) + step * way
        new = correct(system, guess, way, max_steps=20 if natural else 8)
        if new is None:
            return found, np.array(guesses).reshape(-1, 2), (
                f"Newton fails at λ = {guess[1]:.3f}" if natural else
                f"the corrector fails after λ = {found[-1].parameter:.3f}")
        found.append(new)
        guesses.append(guess)
    return found, np.array(guesses), ""


class ArclengthView(View):
    """A curve, and the points that natural or arclength continuation finds on it."""

    @at_work()
    def __init__(self) -> None:
        self._curve = ""
        self.axes = self.panels(9, 5.4)
        self.whole, = self.axes.plot([], [], color=PALE, linewidth=7, label="the curve")
        self.ways = self.line(self.axes, color=COLOURS["1X"], linewidth=1.4,
                              label="predicted, then corrected")
        self.points = self.line(self.axes, "o", color=COLOURS["rotor"], label="found")
        self.last = self.line(self.axes, "X", color=COLOURS["unstable"], markersize=14)
        self.axes.legend(loc="upper left", fontsize=11)
        self("circle", "natural", 0.2, 1)  # so that the margins are those of a drawn curve

    def __call__(self, curve: str, way: str, step: float, count: int) -> str:
        """Show so many steps of a length on a curve, one way or the other; return the reading."""
        system, start, whole, limits = CURVES[curve]
        if curve != self._curve:
            self._curve = curve
            self.whole.set_data(*whole)
            self.axes.set(**limits)
            self.kept.redraw()
        natural = way == WAYS[0]
        found, guesses, stopped = walk(system, np.array(start), step, count, natural)
        at = np.array([[p.parameter, p.y[0]] for p in found])
        zigzag = np.stack([at[:-1], guesses[:, ::-1], at[1:]], axis=1)
        self.points.set_data(*at.T)
        self.ways.set_data(*zigzag.reshape(-1, 2).T)
        self.last.set_data(*at[-1:].T if stopped else ([], []))
        turns = int((np.diff(np.sign(np.diff(at[:, 0]))) != 0).sum())
        work = sum(p.iterations for p in found[1:])
        leapt = natural and np.abs(np.diff(at[:, 1])).max(initial=0) > 0.35 * np.ptp(limits["ylim"])
        leap = " One step leapt to another part of the curve." if leapt else ""
        ended = (f"after {len(found) - 1} of {count} steps {stopped}; the last point is" if stopped
                 else f"after all {count} steps it is")
        return (f"{way.capitalize()} continuation on the curve “{curve}” with steps of {step:.2f}: "
                f"{ended} at λ = {at[-1, 0]:.3f}, y = {at[-1, 1]:.3f}; folds passed: {turns}; "
                f"Newton steps: {work}.{leap}")


def arclength_explorer() -> FigureExplorer:
    """Natural and arclength continuation on a circle, an S and the static pull-in curve."""
    return FigureExplorer(ArclengthView(), {
        "curve": choice("curve", "circle", list(CURVES)),
        "way": choice("continuation", WAYS[0], list(WAYS)),
        "step": slider("length of a step", 0.2, 0.02, 0.6, 0.02, 2),
        "count": whole("steps", 12, 1, 60)})
