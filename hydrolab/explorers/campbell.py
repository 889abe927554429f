"""Modes over the speed, with softer or stiffer bearings and less gyroscopic effect."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from hydrolab.dynamics.modes import campbell, modes
from hydrolab.explorers.legs import guides
from hydrolab.explorers.widget import FigureExplorer, View, at_work, slider
from hydrolab.figures.readings import listed
from hydrolab.figures.style import COLOURS
from hydrolab.machine import Machine, Model, load_machine, vary
from hydrolab.machine.quantities import RPM

MOST, POINTS = 8, 17  # modes, speeds


class CampbellView(View):
    """The modes over the speed, those at one speed, and the critical speeds.

    Damping of the material is left out: modes that hardly oscillate would hide the others.
    """

    @at_work()
    def __init__(self, machine: Machine, to: float) -> None:
        self.machine, self.speeds = replace(machine, damping=None), np.linspace(0, to, POINTS)
        self._key = 1.0, 1.0
        self.diagram = campbell(self.machine.model(), self.speeds, MOST)
        top = min(1.25 * float(np.nanmax(self.diagram.hertz[:, :MOST])), 1.5 * to / 2 / math.pi)
        axes, self.rpm = self.panels(11, 5.4), self.speeds / RPM
        end = self.rpm[-1]
        axes.plot([0, end], [0, end / 60], color=COLOURS["1X"], linewidth=1.6)
        axes.annotate("1X", (end, min(end / 60, top)), xytext=(-6, -16), ha="right", va="top",
                      textcoords="offset points", color=COLOURS["1X"], fontsize=14)
        self.lines = {way: self.line(axes, form, color=colour, label=way)
                      for way, form, colour in (("forward", "-", COLOURS["x"]),
                                                ("backward", "--", COLOURS["z"]),
                                                ("planar", ":", COLOURS["unknown"]))}
        self.critical = self.line(axes, "D", color=COLOURS["fold"], label="critical speed")
        self.cursor = self.upright(axes)
        self.now = self.line(axes, "o", color=COLOURS["rotor"], markeredgecolor="white",
                             markersize=9)
        axes.set(xlim=(0, end), ylim=(0, top), xlabel="speed, rpm", ylabel="frequency, Hz",
                 title=f"Campbell diagram of {machine.name}")
        axes.legend(loc="upper left", ncols=2)

    def _model(self, stiffness: float, gyroscopic: float) -> Model:
        changes = {f"bodies.{b.name}.Ip": gyroscopic * b.Ip for b in self.machine.bodies}
        changes |= {guide.key: stiffness * guide.value for guide in guides(self.machine)}
        return vary(self.machine, changes).model()

    def __call__(self, speed: float, stiffness: float, gyroscopic: float) -> str:
        """Show the diagram at a speed (rpm), stiffness and polar inertia over the card's."""
        model = self._model(stiffness, gyroscopic)
        if (stiffness, gyroscopic) != self._key:
            self.diagram = campbell(model, self.speeds, MOST)
            self._key = stiffness, gyroscopic
        now = modes(model, speed * RPM)
        hertz, whirl = self.diagram.hertz, self.diagram.whirl
        ways = {"forward": whirl >= 0.05, "backward": whirl <= -0.05,
                "planar": np.abs(whirl) < 0.05}
        found, apart = hertz.shape[1], np.full(hertz.shape[1], np.nan)
        for way, line in self.lines.items():
            near = ways[way].copy()
            near[1:] |= ways[way][:-1]  # so that a line reaches the point where it changes its kind
            line.set_data(np.tile([*self.rpm, np.nan], found),
                          np.vstack([np.where(near, hertz, np.nan), apart]).T.ravel())
        critical = self.diagram.critical_speeds
        self.critical.set_data(critical / RPM, critical / 2 / math.pi)
        self.cursor.set_xdata([speed, speed])
        shown = now.hertz[:MOST]
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
