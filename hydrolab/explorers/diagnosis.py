"""One cause of a vibration at a time, and what a sensor at the generator reads."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.harmonics import ellipse
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.explorers.legs import guide_of, machine_with
from hydrolab.explorers.widget import FigureExplorer, View, at_work, choice, slider
from hydrolab.figures.drawing import MM, UM, about_mean, close_up
from hydrolab.figures.readings import microns
from hydrolab.figures.style import COLOURS
from hydrolab.machine import Machine, vary

CAUSES = ("more unbalance", "static eccentricity", "stronger field", "softer guide bearing")
SIZES = ("mean", "1X, long axis", "1X, short axis", "2X, long axis")
HEALTHY = 0.01  # static eccentricity: every machine stands a little off centre


class DiagnosisView(View):
    """One cause at a time: how it changes the orbit at the generator and what a sensor reads.

    Size 1 of a cause is twice the unbalance, 8 % static eccentricity in all, 10 % more field, or
    half the stiffness of the guide bearing.
    """

    @at_work()
    def __init__(self, machine: Machine) -> None:
        self.machine, self.guide = machine, guide_of(machine)
        self.healthy = self._orbit(CAUSES[0], 0.0)
        self.base = _sizes(self.healthy)
        left, right = self.panels(11, 5, 2, width_ratios=(1, 1.2))
        close_up(left, "Orbit at the generator about its mean", about_mean(self.healthy),
                 "healthy", 1000)
        self.path = self.line(left, color=COLOURS["rotor"], label="now")
        places = np.arange(len(SIZES))
        right.bar(places, self.base, 0.8, color="#DDDDDD", label="healthy")
        self.bars = right.bar(places, self.base, 0.4, color=COLOURS["rotor"], label="now")
        self.kept.moves(*self.bars)
        right.set(yscale="log", ylim=(0.01, 1e4), ylabel="µm (0-to-peak)", title="What is read")
        right.set_xticks(places, [name.replace(", ", ",\n") for name in SIZES])
        right.grid(axis="x", visible=False)
        for axes in (left, right):
            axes.legend(loc="upper right")

    def _orbit(self, cause: str, size: float) -> PeriodicOrbit:
        eccentricity = HEALTHY + (0.08 - HEALTHY) * size * (cause == CAUSES[1])
        changes = {CAUSES[0]: {"unbalance": 1 + size},
                   CAUSES[2]: {"field": self.machine.air_gap.field * (1 + 0.1 * size)},
                   CAUSES[3]: {self.guide.key: self.guide.value * (1 - 0.5 * size)}}
        model = vary(self.machine, changes.get(cause, {})).model()
        return HarmonicBalance(harmonics=8).solve(model, self.machine.speed, eccentricity)

    def __call__(self, cause: str, size: float) -> str:
        """Show a cause of a size from 0 to 1; return the reading."""
        orbit = self._orbit(cause, size)
        self.path.set_data(*about_mean(orbit))
        sizes, base = _sizes(orbit), self.base
        for bar, value in zip(self.bars, sizes, strict=True):
            bar.set_height(value)
        mean, major, minor, _ = sizes
        second, before = (100 * o.second_share for o in (orbit, self.healthy))
        return (f"{cause.capitalize()}, {100 * size:.0f} % of its range: the mean is "
                f"{microns(mean / UM)} ({mean / base[0]:.2f} times the healthy one), 1X is an "
                f"ellipse of {microns(major / UM)} by {microns(minor / UM)} (0-to-peak; "
                f"{major / base[1]:.2f} and {minor / base[2]:.2f} times), 2X is {second:.2f} % of "
                f"1X ({before:.2f} % when healthy), the smallest gap "
                f"{MM * orbit.smallest_gap:.2f} mm.")


def _sizes(orbit: PeriodicOrbit) -> NDArray:
    """Mean and half axes, µm, in the order of SIZES."""
    first, second = ellipse(orbit.coefficients, 1), ellipse(orbit.coefficients, 2)
    return UM * np.array([math.hypot(*orbit.mean), first.major, abs(first.minor), second.major])


def diagnosis_explorer(machine: Machine | None = None) -> FigureExplorer:
    """One cause of a vibration at a time, and what a sensor at the generator reads.

    machine: with an air gap and a radial bearing; by default the card "kaplan-150rpm". Raises
    BadInput for one without them.
    """
    view = DiagnosisView(machine_with(machine, "kaplan-150rpm", "air_gap"))
    return FigureExplorer(view, {
        "cause": choice("cause", CAUSES[0], list(CAUSES)),
        "size": slider("size, share of its range", 0.5, 0.0, 1.0, 0.02, 2)})
