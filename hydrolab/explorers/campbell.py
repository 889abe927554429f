"""Modes over the speed, with softer or stiffer bearings and less gyroscopic effect."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.modes import campbell, modes
from hydrolab.explorers.guide import guides
from hydrolab.explorers.widget import FigureExplorer, KeptFigure, View, slider
from hydrolab.figures.drawing import RPM
from hydrolab.figures.readings import listed
from hydrolab.figures.style import COLOURS, house_style, new_figure
from hydrolab.machine import Machine, load_machine, vary


class CampbellView(View):
    """The modes over the speed, those at one speed, and the critical speeds.

    Damping of the material is left out: modes that hardly oscillate would hide the others.
    """

    @house_style()
    def __init__(self, machine: Machine, to: float, branches: int = 8, points: int = 17) -> None:
        self.machine, self.branches = replace(machine, damping=None), branches
        self.speeds = np.linspace(0, to, points)
        self._key: tuple[float, float] | None = None
        self.diagram = campbell(self.machine.model(), self.speeds, branches)
        top = min(1.25 * float(np.nanmax(self.diagram.hertz[:, :branches])), 1.5 * to / 2 / math.pi)
        figure = new_figure(11, 5.4)
        axes = figure.subplots()
        rpm = self.speeds / RPM
        axes.plot(rpm, rpm / 60, color=COLOURS["1X"], linewidth=1.6)
        axes.annotate("1X", (rpm[-1], min(rpm[-1] / 60, top)), xytext=(-6, -16), ha="right",
                      va="top", textcoords="offset points", color=COLOURS["1X"], fontsize=14)
        self.lines = {way: axes.plot([], [], line, color=colour, label=way)[0]
                      for way, line, colour in (("forward", "-", COLOURS["x"]),
                                                ("backward", "--", COLOURS["z"]),
                                                ("planar", ":", COLOURS["unknown"]))}
        self.critical, = axes.plot([], [], "D", color=COLOURS["fold"], label="critical speed",
                                   linestyle="none")
        self.cursor = axes.axvline(0, color=COLOURS["axis"], linewidth=1)
        self.now, = axes.plot([], [], "o", color=COLOURS["rotor"], markeredgecolor="white",
                              markersize=9)
        axes.set(xlim=(0, rpm[-1]), ylim=(0, top), xlabel="speed, rpm", ylabel="frequency, Hz",
                 title=f"Campbell diagram of {machine.name}")
        axes.legend(loc="upper left", ncols=2)
        self.kept = KeptFigure(figure, [*self.lines.values(), self.critical, self.cursor, self.now])

    def _varied(self, stiffness: float, gyroscopic: float) -> Machine:
        changes = {f"bodies.{b.name}.Ip": gyroscopic * b.Ip for b in self.machine.bodies}
        changes |= {guide.key: stiffness * guide.value for guide in guides(self.machine)}
        return vary(self.machine, changes)

    def __call__(self, speed: float, stiffness: float, gyroscopic: float) -> str:
        """Show the diagram at a speed (rpm), bearings and polar inertias as multiples of the
        card's; return the reading.
        """
        model = self._varied(stiffness, gyroscopic).model()
        with threadpool_limits(1):
            if (stiffness, gyroscopic) != self._key:
                self.diagram = campbell(model, self.speeds, self.branches)
                self._key = stiffness, gyroscopic
            now = modes(model, speed * RPM)
        rpm, hertz, whirl = self.speeds / RPM, self.diagram.hertz, self.diagram.whirl
        ways = {"forward": whirl >= 0.05, "backward": whirl <= -0.05,
                "planar": np.abs(whirl) < 0.05}
        found, apart = hertz.shape[1], np.full(hertz.shape[1], np.nan)
        for way, line in self.lines.items():
            near = ways[way].copy()
            near[1:] |= ways[way][:-1]  # so that a line reaches the point where it changes its kind
            line.set_data(np.tile([*rpm, np.nan], found),
                          np.vstack([np.where(near, hertz, np.nan), apart]).T.ravel())
        critical = self.diagram.critical_speeds
        self.critical.set_data(critical / RPM, critical / 2 / math.pi)
        self.cursor.set_xdata([speed, speed])
        shown = now.hertz[:self.branches]
        self.now.set_data(np.full(len(shown), speed), shown)
        said = listed(f"{c / RPM:.0f}" for c in critical) if len(critical) else "none up to here"
        lowest = [f"{f:.2f} Hz {way}" for f, way in zip(now.hertz[:4], now.direction, strict=False)]
        return (f"Bearings {stiffness:.2f} times as stiff as on the card, gyroscopic effect "
                f"{100 * gyroscopic:.0f} %. At {speed:.0f} rpm the lowest modes are at "
                f"{listed(lowest)}. Critical speeds (1X), rpm: {said}.")


def campbell_explorer(machine: Machine | None = None, to: float | None = None) -> FigureExplorer:
    """The Campbell diagram of a machine up to a speed (rpm), with softer or stiffer bearings and
    less gyroscopic effect.

    machine: by default the card "three-disc". to: by default 1.2 times its rated speed.
    """
    machine = machine or load_machine("three-disc")
    end = 1.2 * machine.speed / RPM if to is None else to
    return FigureExplorer(CampbellView(machine, end * RPM), {
        "speed": slider("speed, rpm", round(end / 2), 0, round(end), max(round(end / 200), 1), 0),
        "stiffness": slider("bearing stiffness, × the card's", 1.0, 0.1, 5.0, 0.05, 2),
        "gyroscopic": slider("gyroscopic effect, × the card's", 1.0, 0.0, 1.0, 0.05, 2)})
