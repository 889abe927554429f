"""A whole branch that follows the machine's numbers, as a figure that moves: the view behind
`branch_explorer`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.batch import update_branch
from hydrolab.dynamics.branches import orbits_at
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.stability import floquet_all
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.explorers.legs import Legs, legs_of, round_up
from hydrolab.explorers.widget import KeptFigure
from hydrolab.figures.drawing import MM, REVOLUTION, UM, draw_axis, nearest
from hydrolab.figures.readings import listed, percent
from hydrolab.figures.style import COLOURS, LINES, house_style, new_figure, plane
from hydrolab.machine.cards import vary
from hydrolab.machine.parts import Machine

COARSE = REVOLUTION[::4]
WORDS = ("stable", "unstable", "unknown")
SEVERAL = 4  # orbits shown at one eccentricity
FADED = "#BBBBBB"
LIMITS = (2, 4, 6, 8, 12, 16, 24, 32, 48, 64, 100)  # %, where the eccentricity axis may end


class BranchView:
    """The branch of a machine as its numbers change, and its orbits at one eccentricity.

    Call it with an eccentricity (%) and changes as `vary` takes them; it changes its kept figure
    and returns the reading. The points of the last branch are moved to the new one; stability is
    without the slow guards, so a point in doubt is dotted. Where there is no branch it says so and
    leaves the last one in grey.
    """

    def __init__(self, machine: Machine) -> None:
        self.machine, self.gap = machine, machine.air_gap.gap if machine.air_gap else math.nan
        self.card = self.legs = legs_of(machine)
        self._changes: dict[str, float] = {}
        with house_style():
            self._draw()

    def _draw(self) -> None:
        figure = new_figure(11.4, 5.5)
        grid = figure.add_gridspec(2, 2, width_ratios=(1.1, 1))
        self.first, self.gaps = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
        self.plane = figure.add_subplot(grid[:, 1])
        self.first.set(title="1X in x, µm (0-to-peak)")
        self.gaps.set(title="Smallest gap, mm", xlabel="static eccentricity, %",
                      ylim=(0, 1.05 * MM * self.gap))
        self.lines = {word: tuple(axes.plot([], [], LINES[word], color=COLOURS[word],
                                            label=word if axes is self.first else "")[0]
                                  for axes in (self.first, self.gaps)) for word in WORDS}
        self.folds = [axes.plot([], [], "D", color=COLOURS["fold"], markersize=6)[0]
                      for axes in (self.first, self.gaps)]
        self.cursors = [axes.axvline(0, color=COLOURS["axis"], linewidth=1)
                        for axes in (self.first, self.gaps)]
        self.dots = [axes.plot([], [], "o", color=COLOURS["rotor"], markersize=8,
                               markeredgecolor="white")[0]
                     for axes in (self.first, self.gaps)]
        for axes, pair in zip((self.first, self.gaps), ((0, 1), (2, 3)), strict=True):
            self._draw_card(axes, pair[0] // 2)
        self.first.legend(loc="upper left", fontsize=11)
        moving = [line for pair in self.lines.values()
                  for line in pair] + self.folds + self.cursors + self.dots
        self.kept = KeptFigure(figure, [*moving, *self._draw_plane(self.plane)])
        self._limits(self.card)

    def _draw_card(self, axes: Axes, number: int) -> None:
        """The branch of the card, as a pale line that stays."""
        for i, (eccentricity, values) in enumerate(self.card.lines(self._numbers(number)).values()):
            axes.plot(eccentricity, values, color="#D0D0D0", linewidth=5, zorder=1,
                      label="" if i else "as on the card")

    def _draw_plane(self, axes: Axes) -> list:
        plane(axes, "Orbits at the generator (numbers: smallest gap)")
        draw_axis(axes)
        self.orbits = [axes.plot([], [])[0] for _ in range(SEVERAL)]
        self.names = [axes.annotate("", (0.98, 0.97 - 0.06 * i), xycoords="axes fraction",
                                    ha="right", va="top", fontsize=13)
                      for i in range(SEVERAL)]
        self.stator, = axes.plot([], [], "x", color=COLOURS["stator"], markersize=8,
                                 markeredgewidth=2)
        self.none = axes.annotate("", (0.5, 0.04), xycoords="axes fraction", ha="center",
                                  fontsize=14,
                                  color=COLOURS["unstable"])
        return [*self.orbits, *self.names, self.stator, self.none]

    def _numbers(self, which: int):
        """A function of eccentricity and coefficients: 1X along the eccentricity in µm (0),
        smallest gap in mm (1).
        """
        direction, gap = self.card.branch.direction, self.gap
        rows = _rows(self.card.branch.equations.harmonics)

        def first(_: NDArray, coefficients: NDArray) -> NDArray:
            return UM * np.hypot(*np.einsum("i,pik->pk", direction, coefficients)[:, 1:3].T)

        def left(eccentricity: NDArray, coefficients: NDArray) -> NDArray:
            away = coefficients @ rows - gap * np.einsum("p,i->pi", eccentricity,
                                                         direction)[:, :, None]
            return MM * (gap - np.hypot(away[:, 0], away[:, 1]).max(axis=1))

        return left if which else first

    def _limits(self, legs: Legs) -> None:
        """Ends of the axes, in a few fixed steps, so that the still part is seldom drawn again."""
        reach = 102 * max(leg.high for leg in legs.all)
        first = max(self._numbers(0)(np.empty(0), legs.branch.coefficients[leg.rows]).max()
                    for leg in legs.all)
        wanted = (0, next(limit for limit in LIMITS
                          if limit >= min(reach, 100))), (0, round_up(1.15 * first))
        far = legs.branch.coefficients[:legs.all[-1].rows.stop] @ _rows(legs.branch.equations.harmonics)
        size = round_up(MM * float(np.abs(far).max()) / 1.5)
        if wanted != (self.first.get_xlim(), self.first.get_ylim()) or size != getattr(self,
                                                                                       "_size",
                                                                                       None):
            self._size = size
            for axes in (self.first, self.gaps):
                axes.set_xlim(wanted[0])
            self.first.set_ylim(wanted[1])
            self.plane.set(adjustable="box", xlim=(-1.6 * size, 0.6 * size),
                           ylim=(-1.1 * size, 1.1 * size))
            self.kept.redraw()

    def __call__(self, eccentricity: float, changes: Mapping[str, float] | None = None) -> str:
        """Show the branch with these changes and its orbits at an eccentricity (%); return the
        reading.
        """
        for cursor in self.cursors:
            cursor.set_xdata([eccentricity, eccentricity])
        with threadpool_limits(1):
            try:
                orbits, verdicts = self._solve(eccentricity / 100, dict(changes or {}))
            except (NoConvergence, Contact, BadInput) as error:
                self._fade()
                return f"No branch here; the last one is left in grey. {error}"
        self._show_branch()
        self._show_orbits(orbits, verdicts)
        folds = self.legs.branch.folds
        turns = f"folds at {listed(percent(f.value, 4) for f in folds)} static eccentricity" if folds else "has no fold"
        there = [f"{word} with a smallest gap of {MM * orbit.smallest_gap:.2f} mm"
                 for orbit, word in zip(orbits, verdicts, strict=True)]
        states = (f"{len(there)} steady state{'s' * (len(there) > 1)}: {listed(there)}" if there
                  else "no steady state")
        return f"The branch {turns}. At {percent(eccentricity / 100)} it has {states}."

    def pick(self, x: float, y: float) -> dict[str, float] | None:
        """Eccentricity (%) of the branch's point nearest to a place in either diagram, or None off
        both.

        x, y: shares of the figure's width and height from its lower left corner.
        """
        for which, axes in enumerate((self.first, self.gaps)):
            eccentricity, values, _ = self.legs.dense(self._numbers(which))
            if (at := nearest(axes, x, y, np.column_stack([eccentricity, values]))) is not None:
                return {"eccentricity": round(eccentricity[at], 1)}
        return None

    def _solve(self, eccentricity: float, changes: dict[str, float]) -> tuple[list[PeriodicOrbit],
                                                                              list[str]]:
        """The orbits at one eccentricity and their verdicts; the branch is moved if the machine has
        changed.
        """
        if changes.keys() == self._changes.keys() and all(np.array_equal(changes[k],
                                                                         self._changes[k])
                                                          for k in changes):
            orbits = orbits_at(self.legs.branch, eccentricity)[:SEVERAL]
            return orbits, [f.verdict for f in floquet_all(orbits, guard=False)]
        branch = update_branch(self.legs.branch, vary(self.machine, changes).model(),
                               self.machine.speed)
        orbits = orbits_at(branch, eccentricity)[:SEVERAL]
        points = floquet_all([*branch, *orbits], guard=False)  # all in one batch
        self.legs, self._changes = Legs(branch, points[:len(branch)]), changes
        return orbits, [point.verdict for point in points[len(branch):]]

    def _show_branch(self) -> None:
        self._limits(self.legs)
        for which in (0, 1):
            found = self.legs.lines(self._numbers(which))
            for word in WORDS:
                self.lines[word][which].set_data(*found.get(word, ([], [])))
                self.lines[word][which].set_color(COLOURS[word])
        turns = [self.legs.branch.at_fold(i) for i in range(len(self.legs.branch.folds))]
        self._mark(self.folds, turns)

    def _fade(self) -> None:
        for artist in (*(line for pair in self.lines.values() for line in pair), *self.orbits):
            artist.set_color(FADED)
        for name in self.names:
            name.set_text("")
        for dots in self.dots:
            dots.set_data([], [])
        self.none.set_text("no branch to be found")

    def _show_orbits(self, orbits: list[PeriodicOrbit], verdicts: list[str]) -> None:
        for line, name in zip(self.orbits, self.names, strict=True):
            line.set_data([], [])
            name.set_text("")
        for line, name, orbit, word in zip(self.orbits, self.names, orbits, verdicts, strict=False):
            line.set_data(*(MM * orbit.positions(COARSE)))
            line.set(color=COLOURS[word], linestyle=LINES[word],
                     linewidth=3 if word == "stable" else 1.8)
            name.set(text=f"{MM * orbit.smallest_gap:.2f} mm", color=COLOURS[word])
        self._mark(self.dots, orbits)
        centres = np.array([orbit.centre for orbit in orbits[:1]]).reshape(-1, 2)
        self.stator.set_data(*(MM * centres.T))
        self.none.set_text("" if orbits else "no steady state here")

    def _mark(self, marks: Sequence[Line2D], orbits: Sequence[PeriodicOrbit]) -> None:
        """Put the marks of both diagrams on these orbits."""
        for which, mark in enumerate(marks):
            number = self._numbers(which)
            mark.set_data([100 * orbit.static_eccentricity for orbit in orbits],
                          [number(np.array([o.static_eccentricity]), o.coefficients[None])[0]
                           for o in orbits])


def _rows(harmonics: int) -> NDArray:
    """Rows 1, sin φ, cos φ, … at the coarse phases, (2m + 1, n)."""
    k = np.arange(1, harmonics + 1)[:, None] * COARSE
    return np.vstack([np.ones_like(COARSE), np.stack([np.sin(k), np.cos(k)],
                                                     axis=1).reshape(2 * harmonics, -1)])
