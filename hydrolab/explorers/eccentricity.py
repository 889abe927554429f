"""The steady state of a machine at any static eccentricity and on any leg of its branch."""

from __future__ import annotations

from itertools import chain

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from hydrolab.dynamics.harmonics import synthesise
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.explorers.legs import STEP, Diagram, Legs, legs_of
from hydrolab.explorers.widget import FigureExplorer, KeptFigure, View, at_work, choice, slider
from hydrolab.figures.drawing import (
    MM,
    REVOLUTION,
    UM,
    contact_line,
    gap_plane,
    narrowest,
    round_up,
)
from hydrolab.figures.readings import orbit_reading, percent
from hydrolab.figures.rotor import draw_bearings, rotor_stations
from hydrolab.figures.style import COLOURS, new_figure
from hydrolab.machine import Machine, load_machine

COARSE = REVOLUTION[::4]  # phases at which a moving orbit is drawn
FEW = 6  # frames of a flip-book: three explorers of a branch stand in one notebook
PARTS = ("mean", "1X", "2X", "3X", "4X")
LEAST, MOST = 0.1, 2e4  # µm, the scale of the harmonics
FADED = "#BBBBBB"
INSET = 0.66  # of the gap: side of the square inside the circle that shows the orbit enlarged


class EccentricityView(View):
    """The steady state on a leg of a branch, in the gap, in harmonics and along the shaft.

    Where there is none it says so and leaves the last one in grey.
    """

    @at_work()
    def __init__(self, machine: Machine, legs: Legs | None = None) -> None:
        self.machine, self.legs = machine, legs or legs_of(machine)
        self.shape: list[Line2D] = []
        model = self.legs.branch.equations.model
        self.gap, self.contact = model.gap, contact_line(model)
        self.kept = KeptFigure(new_figure(11.4, 5.5))
        shaft = machine.shaft is not None
        grid = self.kept.figure.add_gridspec(
            2, 3 if shaft else 2, height_ratios=(1.25, 1),
            width_ratios=(1.7, 1.1, 0.6) if shaft else (1.5, 1.3))
        self._draw_plane(self.kept.figure.add_subplot(grid[:, 0]))
        axes = self.kept.figure.add_subplot(grid[0, 1])
        self.diagram = Diagram(axes, self.legs)
        self.here = self.line(axes, "o", color=COLOURS["rotor"], markeredgecolor="white",
                              markersize=11)
        self.kept.moves(self.diagram.cursor)
        self._draw_bars(self.kept.figure.add_subplot(grid[1, 1]))
        if shaft:
            self._draw_shaft(self.kept.figure.add_subplot(grid[:, 2]))

    @property
    def names(self) -> list[tuple[str, int]]:
        """A name for each leg of the branch, and its number."""
        said = []
        for number, leg in enumerate(self.legs.all, 1):
            words = set(self.legs.words[leg.rows])
            said.append((f"{number}: {words.pop() if len(words) == 1 else 'in part stable'}",
                         number))
        return said

    def _draw_plane(self, axes: Axes) -> None:
        gap = MM * self.gap
        gap_plane(axes, "Rotor centre in its gap", self.gap)
        self.circle = self.line(axes, color=COLOURS["stator"], linewidth=3.5)
        self.stator = self.line(axes, "x", color=COLOURS["stator"], markersize=8, markeredgewidth=2)
        self.path = self.line(axes, color=COLOURS["rotor"], linewidth=2)
        self.measure = self.line(axes, ".-", color=COLOURS["axis"], linewidth=1.4, markersize=4)
        middle = {"ha": "center", "va": "center"}
        self.left = axes.annotate("", (0.08 * gap, 0.66 * gap), fontsize=15, **middle)
        self.none = axes.annotate("", (0.0, -0.72 * gap), fontsize=14, color=COLOURS["unstable"],
                                  **middle)
        # the orbit enlarged, about its mean
        box = axes.inset_axes([0.17 * gap, -INSET * gap / 2, INSET * gap, INSET * gap],
                              transform=axes.transData)
        box.set(xticks=[], yticks=[], xlim=(-1.08, 1.08), ylim=(-1.08, 1.08))
        box.grid(False)
        box.spines[["top", "right"]].set_visible(True)
        box.set_title("about its mean", fontsize=11, pad=3)
        self.large = self.line(box, color=COLOURS["rotor"], linewidth=2.4)
        self.now = self.line(box, "o", color=COLOURS["rotor"], markeredgecolor="white",
                             markersize=9)
        self.scale = box.text(0.5, -0.03, "", transform=box.transAxes, ha="center", va="top",
                              fontsize=11)
        self.kept.moves(self.scale, self.left, self.none)

    def _draw_bars(self, axes: Axes) -> None:
        places = np.arange(len(PARTS))
        axes.set(yscale="log", ylim=(LEAST, MOST), xlim=(-0.6, len(PARTS) - 0.4),
                 ylabel="µm (0-to-peak)", title="Mean and harmonics")
        axes.set_xticks(places, PARTS)
        axes.yaxis.set_major_formatter("{x:g}")
        axes.grid(axis="x", visible=False)
        self.bars = {name: axes.bar(places + 0.2 * side, np.full(len(PARTS), LEAST), 0.36,
                                    color=COLOURS[name], label=name)
                     for name, side in (("x", -1), ("z", 1))}
        axes.legend(loc="upper right", ncols=2, fontsize=11)
        self.kept.moves(*chain(*self.bars.values()))

    def _draw_shaft(self, axes: Axes) -> None:
        branch = self.legs.branch
        orbits = [branch[i] for leg in self.legs.all for i in range(*leg.rows.indices(len(branch)))]
        x = MM * np.array([_extent(rotor_stations(self.machine, o)[1]) for o in orbits[::3]])
        depths = rotor_stations(self.machine, orbits[0])[0]
        wide = np.ptp(x)
        axes.set(xlim=(x.min() - 0.1 * wide, x.max() + 0.1 * wide),
                 ylim=(depths.max() + 0.4, depths.min() - 0.4),
                 title="Shaft: depth, m", xlabel="x, mm")
        axes.axvline(0, color=COLOURS["axis"], linestyle="-.", linewidth=1.2)
        draw_bearings(axes, self.machine, 0.05 * wide)
        self.mean = self.line(axes, color=COLOURS["mean"], linewidth=2.6, label="mean")
        self.ends = [self.line(axes, color=COLOURS["rotor"], linewidth=1.2, label=words)
                     for words in ("reach", "")]
        self.bodies = self.line(axes, "o", color=COLOURS["rotor"], markersize=7)
        self.shape = [self.mean, *self.ends, self.bodies]
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 0.04), fontsize=10, handlelength=1.0,
                    borderpad=0.3)

    def __call__(self, eccentricity: float, leg: int = 1) -> str:
        """Show the steady state at an eccentricity (%) on a leg (1 is the first)."""
        self.diagram.cursor.set_xdata([eccentricity, eccentricity])
        orbit = self.legs.orbit(eccentricity / 100, leg - 1)
        if orbit is None:
            self._fade(f"leg {leg}: none at {percent(eccentricity / 100)}")
            return self._nothing(eccentricity / 100, leg)
        verdict = self.legs.verdict(orbit.static_eccentricity, leg - 1)
        self._show(orbit, verdict)
        return f"Leg {leg}, {verdict}. {orbit_reading(orbit)}"

    def _nothing(self, eccentricity: float, leg: int) -> str:
        """That a leg does not pass an eccentricity, how far it goes, and which others do."""
        legs = self.legs.all
        there = legs[leg - 1] if 0 < leg <= len(legs) else None
        also = [str(n) for n, other in enumerate(legs, 1) if other.holds(eccentricity)]
        reach = f" It spans {percent(there.low)} to {percent(there.high, 4)}." if there else ""
        others = (f"Of the others shown these pass here: {', '.join(also)}." if also
                  else "None of the others shown passes here.")
        return (f"Leg {leg} has no steady state at {percent(eccentricity)} of the gap; "
                f"the last one is left in grey.{reach} {others}")

    def pick(self, x: float, y: float) -> dict[str, float] | None:
        """Eccentricity (%) and leg of the branch's point nearest to x, y in the figure."""
        found = self.diagram.pick(x, y)
        return found and {"eccentricity": found[0], "leg": found[1]}

    def _fade(self, words: str) -> None:
        for artist in (self.path, self.large, self.now, self.here, self.measure, *self.shape):
            artist.set_color(FADED)
        for bar in chain(*self.bars.values()):
            bar.set_facecolor(FADED)
        self.none.set_text(words)
        self.left.set_text("")

    def _show(self, orbit: PeriodicOrbit, verdict: str) -> None:
        path = orbit.positions(COARSE)
        self.circle.set_data(*(MM * (orbit.centre[:, None] + self.contact)))
        self.stator.set_data(*(MM * orbit.centre[:, None]))
        self.path.set_data(*(MM * path))
        self.measure.set_data(*(MM * narrowest(orbit)))
        self.left.set_text(f"smallest gap {MM * orbit.smallest_gap:.2f} mm")
        self.none.set_text("")
        around = path - orbit.mean[:, None]
        size = round_up(1.02 * float(np.abs(around).max()))
        self.large.set_data(*(around / size))
        self.now.set_data(*(around[:, :1] / size))
        self.scale.set_text(f"± {UM * size:g} µm")
        colour = COLOURS[verdict] if verdict == "unstable" else COLOURS["rotor"]
        for artist in (self.path, self.large, self.now, self.here):
            artist.set_color(colour)
        self.measure.set_color(COLOURS["axis"])
        self.here.set_data(*self.diagram.place(orbit))
        for row, name in enumerate("xz"):
            sizes = [abs(orbit.mean[row]), *orbit.amplitudes[row, :len(PARTS) - 1]]
            for bar, value in zip(self.bars[name], sizes, strict=False):
                bar.set(y=LEAST, height=max(UM * value - LEAST, 0.0), facecolor=COLOURS[name])
        if self.machine.shaft is not None:
            self._show_shaft(orbit)

    def _show_shaft(self, orbit: PeriodicOrbit) -> None:
        depths, coefficients = rotor_stations(self.machine, orbit)
        order, nodes = np.argsort(depths), len(orbit.model.depths)
        self.mean.set_data(MM * coefficients[order, 0, 0], depths[order])
        for line, side in zip(self.ends, MM * _extent(coefficients), strict=True):
            line.set_data(side[order], depths[order])
        for artist in self.shape:
            artist.set_color(COLOURS["mean" if artist is self.mean else "rotor"])
        self.bodies.set_data(MM * coefficients[nodes:, 0, 0], depths[nodes:])


def _extent(coefficients: NDArray) -> NDArray:
    """Least and greatest x of each station over a revolution, m, (2, stations)."""
    x = synthesise(coefficients[:, 0], COARSE)
    return np.array([x.min(axis=1), x.max(axis=1)])


def eccentricity_explorer(machine: Machine | None = None,
                          eccentricity: float | None = None) -> FigureExplorer:
    """The steady state of a machine at any static eccentricity and on any leg of its branch.

    A click on the branch shows the orbit there; slider and buttons reach the same points from the
    keyboard. machine: by default the card "kaplan-150rpm". eccentricity: in per cent, to begin
    with; by default most of the way to the first fold. Raises BadInput for a machine without an air
    gap, NoConvergence where there is no first steady state.
    """
    view = EccentricityView(machine or load_machine("kaplan-150rpm"))
    start = round(90 * view.legs.all[0].high, 1) if eccentricity is None else eccentricity
    return FigureExplorer(view, {
        "eccentricity": slider("static eccentricity, %", start, 0.0,
                               round(104 * view.legs.reach, 1), STEP, 2),
        "leg": choice("leg of the branch", 1, view.names)}, frames=FEW)
