"""The model of a machine as figures that move: how many elements are enough, and modes over the
speed.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.modes import campbell, modes
from hydrolab.explorers.widget import KeptFigure
from hydrolab.figures.drawing import RPM
from hydrolab.figures.readings import listed
from hydrolab.figures.style import COLOURS, house_style, new_figure
from hydrolab.machine.parts import Machine, RadialBearing, Shaft

MODES = 4
MOST = 16  # elements
COLOUR = (COLOURS["x"], COLOURS["z"], COLOURS["2X"], COLOURS["3X"])


class ElementsView:
    """A shaft pinned at both ends in 1 to 16 Timoshenko elements, against its exact bending
    frequencies.

    The exact shapes are sines, and each frequency follows from a quadratic (S. P. Timoshenko,
    1921): E I k⁴ − ω² (ρA + ρI k² + ρ E I k²/(κG)) + ω⁴ ρ² I/(κG) = 0 with k = nπ/L.
    """

    def __init__(self, shaft: Shaft) -> None:
        self.shaft = _uniform(shaft, 1)
        self.exact = np.array([self._frequency(n) for n in range(1, MODES + 1)])
        found = {count: self.modes(count)[0] for count in range(1, MOST + 1)}
        with house_style():
            figure = new_figure(11, 5)
            left, right = figure.subplots(1, 2)
            y = np.linspace(0, 1, 201)
            self.y = y
            self.sine, = left.plot([], [], color="#C8C8C8", linewidth=7, label="exact")
            self.line, = left.plot([], [], "o-", color=COLOURS["rotor"], label="at the nodes")
            left.set(xlim=(0, 1), ylim=(-1.25, 1.25), xlabel="depth / length", title="Shape")
            left.legend(loc="upper right", ncols=2)
            for n, colour in enumerate(COLOUR):
                known = [(count, 100 * (f[n] / self.exact[n] - 1)) for count, f in found.items()
                         if len(f) > n]
                right.plot(*zip(*known, strict=True), color=colour, marker=".",
                           label=f"mode {n + 1}")
            right.set(xscale="log", yscale="log", xlabel="elements", ylim=(1e-4, 300),
                      xlim=(0.9, 18),
                      title="Frequency too high by, %")
            right.set_xticks([1, 2, 3, 4, 6, 8, 12, 16], [1, 2, 3, 4, 6, 8, 12, 16])
            right.minorticks_off()
            right.legend(loc="lower left")
            self.here, = right.plot([], [], "o", markersize=14, fillstyle="none",
                                    color=COLOURS["mean"])
        self.kept = KeptFigure(figure, [self.sine, self.line, self.here])

    def _frequency(self, n: int) -> float:
        s = self.shaft
        area, second = float(s.area[0]), float(s.second_moment[0])
        shear = s.shear_coefficient * s.young / (2 * (1 + s.poisson))
        k = n * math.pi / s.length
        a, c = s.density**2 * second / shear, s.young * second * k**4
        b = s.density * (area + second * k**2 + s.young * second * k**2 / shear)
        return math.sqrt(2 * c / (b + math.sqrt(b * b - 4 * a * c)))

    def modes(self, count: int) -> tuple[NDArray, NDArray]:
        """Frequencies (rad/s, ascending) and shapes x at the nodes (nodes, modes) of the bending in
        (x, y).
        """
        # a machine needs some; pinned below
        ends = RadialBearing("top", 0, 1.0), RadialBearing("bottom", count, 1.0)
        model = Machine("shaft", 0.0, _uniform(self.shaft, count), (), ends).model()
        # x inside, every θz
        free = [4 * i + dof for i in range(count + 1) for dof in (0, 3) if dof or 0 < i < count]
        squares, vectors = eigh(model.K[np.ix_(free, free)], model.M[np.ix_(free, free)])
        shapes = np.zeros((count + 1, len(free)))
        shapes[1:-1] = vectors[[i for i, dof in enumerate(free) if dof % 4 == 0]]
        return np.sqrt(squares), shapes

    def __call__(self, elements: int, mode: int) -> str:
        """Show a mode of the shaft in so many elements; return the reading."""
        frequencies, shapes = self.modes(elements)
        shape = shapes[:, mode - 1] if len(frequencies) >= mode else np.full(elements + 1, np.nan)
        sine = np.sin(mode * math.pi * self.y)
        nodes = np.linspace(0, 1, elements + 1)
        at_nodes = np.sin(mode * math.pi * nodes)
        # all nodes at rest
        size = shape @ at_nodes / (at_nodes @ at_nodes) if at_nodes @ at_nodes > 1e-9 else math.inf
        self.sine.set_data(self.y, sine)
        self.line.set_data(nodes, shape / size)
        if len(frequencies) < mode:
            self.here.set_data([], [])
            return f"With {elements} element{'s' * (elements > 1)} there is no mode {mode}."
        error = 100 * (frequencies[mode - 1] / self.exact[mode - 1] - 1)
        self.here.set_data([elements], [error])
        return (f"With {elements} element{'s' * (elements > 1)} mode {mode} is at "
                f"{frequencies[mode - 1] / 2 / math.pi:.3f} Hz, {error:.3g} % above the exact "
                f"{self.exact[mode - 1] / 2 / math.pi:.3f} Hz.")


def _uniform(shaft: Shaft, count: int) -> Shaft:
    """A shaft's length in equal Timoshenko elements of its mean diameters."""
    return replace(shaft, nodes=np.linspace(0, shaft.length, count + 1), element="timoshenko",
                   diameter=float(np.mean(shaft.diameter)),
                   inner_diameter=float(np.mean(shaft.inner_diameter)))


class CampbellView:
    """The Campbell diagram of a machine while its bearings and its gyroscopic effect change, with
    the modes at a speed.

    Damping of the material is left out: modes that hardly oscillate would hide the others.
    """

    def __init__(self, machine: Machine, to: float, branches: int = 8, points: int = 17) -> None:
        self.machine, self.branches = replace(machine, damping=None), branches
        self.speeds = np.linspace(0, to, points)
        self._key: tuple[float, float] | None = None
        self.diagram = campbell(self.machine.model(), self.speeds, branches)
        top = min(1.25 * float(np.nanmax(self.diagram.hertz[:, :branches])), 1.5 * to / 2 / math.pi)
        with house_style():
            figure = new_figure(11, 5.4)
            axes = figure.subplots()
            rpm = self.speeds / RPM
            axes.plot(rpm, rpm / 60, color=COLOURS["1X"], linewidth=1.6)
            axes.annotate("1X", (rpm[-1], min(rpm[-1] / 60, top)), xytext=(-6, -16),
                          textcoords="offset points",
                          color=COLOURS["1X"], ha="right", va="top", fontsize=14)
            self.lines = {way: axes.plot([], [], line, color=colour, label=way)[0]
                          for way, line, colour in
                          (("forward", "-", COLOURS["x"]), ("backward", "--", COLOURS["z"]),
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
        bodies = tuple(replace(b, Ip=gyroscopic * b.Ip) for b in self.machine.bodies)
        bearings = tuple(replace(b, stiffness=stiffness * b.stiffness)
                         for b in self.machine.bearings)
        return replace(self.machine, bodies=bodies, bearings=bearings)

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
        for way, line in self.lines.items():
            near = ways[way].copy()
            near[1:] |= ways[way][:-1]  # so that a line reaches the point where it changes its kind
            line.set_data(np.tile([*rpm, np.nan], self.branches),
                          np.vstack([np.where(near, hertz, np.nan),
                                     np.full(self.branches, np.nan)]).T.ravel())
        critical = self.diagram.critical_speeds
        self.critical.set_data(critical / RPM, critical / 2 / math.pi)
        self.cursor.set_xdata([speed, speed])
        shown = now.hertz[:self.branches]
        self.now.set_data(np.full(len(shown), speed), shown)
        said = listed(f"{c / RPM:.0f}" for c in critical) if len(critical) else "none up to here"
        lowest = [f"{f:.2f} Hz {way}" for f, way in zip(now.hertz[:4], now.direction, strict=False)]
        return (f"Bearings {stiffness:.2f} times as stiff as on the card, gyroscopic effect "
                f"{100 * gyroscopic:.0f} %. At "
                f"{speed:.0f} rpm the lowest modes are at {listed(lowest)}. Critical speeds (1X), "
                f"rpm: {said}.")
