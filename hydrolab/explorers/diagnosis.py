"""One cause of a vibration at a time, and what a sensor at the generator reads."""

from __future__ import annotations

import math

import numpy as np
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.harmonics import ellipse
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput
from hydrolab.explorers.guide import guide_of
from hydrolab.explorers.widget import FigureExplorer, KeptFigure, View, choice, slider
from hydrolab.figures.drawing import MM, REVOLUTION, UM
from hydrolab.figures.readings import microns, second_share
from hydrolab.figures.style import COLOURS, house_style, new_figure, plane
from hydrolab.machine import Machine, load_machine, vary

CAUSES = ("more unbalance", "static eccentricity", "stronger field", "softer guide bearing")
SIZES = ("mean", "1X, long axis", "1X, short axis", "2X, long axis")


class DiagnosisView(View):
    """One cause at a time, from nothing to much: how it changes the orbit at the generator and what
    a sensor reads.

    The healthy machine stands a little off centre, as every machine does. size 1 of a cause is
    twice the unbalance, 8 % static eccentricity in all, 10 % more field, or half the stiffness of
    the guide bearing.
    """

    HEALTHY = 0.01  # static eccentricity

    @house_style()
    def __init__(self, machine: Machine) -> None:
        self.machine, self.guide = machine, guide_of(machine)
        self.healthy = self._orbit(CAUSES[0], 0.0)
        base = self._sizes(self.healthy)
        figure = new_figure(11, 5)
        left, right = figure.subplots(1, 2, width_ratios=(1, 1.2))
        plane(left, "Orbit at the generator about its mean")
        left.set(xlabel="x, µm", ylabel="z, µm", adjustable="box", xlim=(-1000, 1000),
                 ylim=(-1000, 1000),
                 xticks=range(-1000, 1001, 500), yticks=range(-1000, 1001, 500))
        left.plot(*(UM * (self.healthy.positions(REVOLUTION) - self.healthy.mean[:, None])),
                  color="#C8C8C8",
                  linewidth=6, label="healthy")
        self.path, = left.plot([], [], color=COLOURS["rotor"], label="now")
        left.legend(loc="upper right")
        places = np.arange(len(SIZES))
        right.bar(places, base, 0.8, color="#DDDDDD", label="healthy")
        self.bars = right.bar(places, base, 0.4, color=COLOURS["rotor"], label="now")
        right.set(yscale="log", ylim=(0.01, 1e4), ylabel="µm (0-to-peak)", title="What is read")
        right.set_xticks(places, [name.replace(", ", ",\n") for name in SIZES])
        right.grid(axis="x", visible=False)
        right.legend(loc="upper right")
        self.kept = KeptFigure(figure, [self.path, *self.bars])

    def _orbit(self, cause: str, size: float) -> PeriodicOrbit:
        eccentricity = self.HEALTHY
        changes: dict[str, float] = {}
        if cause == CAUSES[0]:
            changes = {"unbalance": 1 + size}
        elif cause == CAUSES[1]:
            eccentricity += (0.08 - eccentricity) * size
        elif cause == CAUSES[2]:
            changes = {"field": self.machine.air_gap.field * (1 + 0.1 * size)}
        else:
            changes = {self.guide.key: self.guide.value * (1 - 0.5 * size)}
        with threadpool_limits(1):
            return HarmonicBalance(harmonics=8).solve(vary(self.machine, changes).model(),
                                                      self.machine.speed, eccentricity)

    @staticmethod
    def _sizes(orbit: PeriodicOrbit) -> np.ndarray:
        """Mean and half axes, µm, in the order of SIZES."""
        first, second = ellipse(orbit.coefficients, 1), ellipse(orbit.coefficients, 2)
        return UM * np.array([math.hypot(*orbit.mean), first.major, abs(first.minor), second.major])

    def __call__(self, cause: str, size: float) -> str:
        """Show a cause of a size from 0 to 1; return the reading."""
        orbit = self._orbit(cause, size)
        self.path.set_data(*(UM * (orbit.positions(REVOLUTION) - orbit.mean[:, None])))
        sizes, base = self._sizes(orbit), self._sizes(self.healthy)
        for bar, value in zip(self.bars, sizes, strict=True):
            bar.set_height(value)
        mean, major, minor, _ = sizes
        second, before = (100 * second_share(o.coefficients) for o in (orbit, self.healthy))
        return (f"{cause.capitalize()}, {100 * size:.0f} % of its range: the mean is "
                f"{microns(mean / UM)} ({mean / base[0]:.2f} times the healthy one), 1X is an "
                f"ellipse of {microns(major / UM)} by {microns(minor / UM)} (0-to-peak; "
                f"{major / base[1]:.2f} and {minor / base[2]:.2f} times), 2X is {second:.2f} % of "
                f"1X ({before:.2f} % when healthy), the smallest gap "
                f"{MM * orbit.smallest_gap:.2f} mm.")


def diagnosis_explorer(machine: Machine | None = None) -> FigureExplorer:
    """One cause of a vibration at a time, and what a sensor at the generator reads.

    machine: with an air gap and a radial bearing; by default the card "kaplan-150rpm". Raises
    BadInput for one without them.
    """
    machine = machine or load_machine("kaplan-150rpm")
    if machine.air_gap is None:
        raise BadInput(f"{machine.name} has no air_gap; an explorer of its vibration needs one.")
    return FigureExplorer(DiagnosisView(machine), {
        "cause": choice("cause", CAUSES[0], list(CAUSES)),
        "size": slider("size, share of its range", 0.5, 0.0, 1.0, 0.02, 2)})
