"""The whole branch of a machine while its field, unbalance, rotor mass and guide bearing change."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from hydrolab.dynamics.following import update_branch
from hydrolab.dynamics.harmonics import synthesise
from hydrolab.dynamics.results import PeriodicOrbit, clearances
from hydrolab.dynamics.stability import floquet_all
from hydrolab.explorers.eccentricity import COARSE, FEW
from hydrolab.explorers.legs import Legs, Number, guide_of, legs_of
from hydrolab.explorers.widget import FigureExplorer, KeptFigure, View, at_work, slider
from hydrolab.figures.drawing import MM, draw_axis, nearest, round_up
from hydrolab.figures.readings import listed, percent
from hydrolab.figures.style import COLOURS, LINES, new_figure, plane
from hydrolab.machine import Machine, load_machine, vary

WORDS = ("stable", "unstable", "unknown")
SEVERAL = 4  # orbits shown at one eccentricity
LIMITS = (2, 4, 6, 8, 12, 16, 24, 32, 48, 64, 100)  # %, where the eccentricity axis may end


class BranchView(View):
    """The branch of a machine as its numbers change, and its orbits at one eccentricity.

    Call it with an eccentricity (%) and values of some of `numbers`. The points of the last branch
    are moved to the new one; stability is a quick look, so a point in doubt is dotted.

    numbers: by name, the key that `vary` takes, its value on the card, and that as it is shown.
    """

    def __init__(self, machine: Machine) -> None:
        self.card = self.legs = legs_of(machine)
        self.machine, self.gap = machine, machine.air_gap.gap
        self.body, self.guide = machine.body(machine.air_gap.body), guide_of(machine)
        field, mass = machine.air_gap.field, self.body.mass
        self.numbers = {"field": ("field", field, field), "unbalance": ("unbalance", 1.0, 1.0),
                        "mass": (f"bodies.{self.body.name}.mass", mass, mass / 1e3),
                        "stiffness": (self.guide.key, self.guide.value, self.guide.shown)}
        self._ratios: dict[str, float] = {}
        self._size = 0.0
        self._draw()

    @at_work()
    def _draw(self) -> None:
        figure = new_figure(11.4, 5.7)
        self.kept = KeptFigure(figure)
        grid = figure.add_gridspec(2, 2, width_ratios=(1.1, 1))
        self.axes = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
        self.plane = figure.add_subplot(grid[:, 1])
        first, gaps = self.axes
        first.set(title="1X in x, µm (0-to-peak)")
        gaps.set(title="Smallest gap, mm", xlabel="static eccentricity, %",
                 ylim=(0, 1.05 * MM * self.gap))
        self.lines = {word: [self.line(axes, LINES[word], color=COLOURS[word], label=word)
                             for axes in self.axes] for word in WORDS}
        self.folds = [self.line(axes, "D", color=COLOURS["fold"], markersize=6)
                      for axes in self.axes]
        self.cursors = [self.upright(axes) for axes in self.axes]
        self.dots = [self.line(axes, "o", color=COLOURS["rotor"], markersize=8,
                               markeredgecolor="white") for axes in self.axes]
        for axes, number in zip(self.axes, self._numbers(self.card), strict=True):
            for i, line in enumerate(self.card.lines(number).values()):
                axes.plot(*line, color="#D0D0D0", linewidth=5, zorder=1,
                          label="" if i else "as on the card")
        # below both diagrams, where it covers no fold
        figure.legend(*first.get_legend_handles_labels(), loc="outside lower left", ncols=4,
                      fontsize=11)
        self._draw_plane(self.plane)
        self._limits(self.card, 0.0)

    def _draw_plane(self, axes: Axes) -> None:
        plane(axes, "Orbits at the generator (numbers: smallest gap)")
        draw_axis(axes)
        self.orbits = [self.line(axes) for _ in range(SEVERAL)]
        self.names = [axes.annotate("", (0.98, 0.97 - 0.06 * i), xycoords="axes fraction",
                                    ha="right", va="top", fontsize=13) for i in range(SEVERAL)]
        self.stator = self.line(axes, "x", color=COLOURS["stator"], markersize=8, markeredgewidth=2)
        self.none = axes.annotate("", (0.5, 0.04), xycoords="axes fraction", ha="center",
                                  fontsize=14, color=COLOURS["unstable"])
        self.kept.moves(*self.names, self.none)

    def _numbers(self, legs: Legs) -> tuple[Number, Number]:
        """What the diagrams draw of a branch: 1X along the eccentricity, µm; smallest gap, mm."""
        def left(eccentricity: NDArray, local: NDArray) -> NDArray:
            centres = self.gap * eccentricity[:, None] * legs.branch.direction
            return MM * clearances(legs.branch.equations, local, centres).min(axis=1)

        return legs.first, left

    def _limits(self, legs: Legs, eccentricity: float) -> None:
        """Ends of the axes, in a few fixed steps, so that the still part is seldom drawn again."""
        shown = legs.branch.coefficients[:legs.all[-1].rows.stop]
        first = float(legs.first(np.empty(0), shown).max())
        reach = min(max(102 * legs.reach, eccentricity), 100)
        wanted = (0, next(limit for limit in LIMITS if limit >= reach)), (0, round_up(1.15 * first))
        size = round_up(MM * float(np.abs(synthesise(shown, COARSE)).max()) / 1.5)
        upper, lower = self.axes
        if wanted == (upper.get_xlim(), upper.get_ylim()) and size == self._size:
            return
        self._size = size
        lower.set_xlim(wanted[0])
        upper.set(xlim=wanted[0], ylim=wanted[1])
        self.plane.set(adjustable="box", xlim=(-1.6 * size, 0.6 * size),
                       ylim=(-1.1 * size, 1.1 * size))
        self.kept.redraw()

    def __call__(self, eccentricity: float, **values: float) -> str:
        """Show the branch with these values, and its orbits at an eccentricity (%)."""
        ratios = {name: value / self.numbers[name][2] for name, value in values.items()}
        ratios = {name: ratio for name, ratio in ratios.items() if abs(ratio - 1) > 1e-9}
        for cursor in self.cursors:
            cursor.set_xdata([eccentricity, eccentricity])
        orbits, verdicts = self._solve(eccentricity / 100, ratios)
        self._show_branch(eccentricity)
        self._show_orbits(orbits, verdicts)
        folds = [percent(fold.value, 4) for fold in self.legs.branch.folds]
        turns = f"folds at {listed(folds)} static eccentricity" if folds else "has no fold"
        there = [f"{word} with a smallest gap of {MM * orbit.smallest_gap:.2f} mm"
                 for orbit, word in zip(orbits, verdicts, strict=True)]
        states = f"{len(there) or 'no'} steady state{'s' * (len(there) != 1)}"
        told = f": {listed(there)}" if there else ""
        return (f"The branch {turns}. At {percent(eccentricity / 100)} it has "
                f"{states}{self.legs.where}{told}.")

    def pick(self, x: float, y: float) -> dict[str, float] | None:
        """Eccentricity (%) of the branch's point nearest to x, y in either diagram."""
        for axes, number in zip(self.axes, self._numbers(self.legs), strict=True):
            eccentricity, values, _ = self.legs.dense(number)
            if (at := nearest(axes, x, y, np.column_stack([eccentricity, values]))) is not None:
                return {"eccentricity": round(eccentricity[at], 1)}
        return None

    def _solve(self, eccentricity: float,
               ratios: dict[str, float]) -> tuple[list[PeriodicOrbit], list[str]]:
        """The orbits at an eccentricity and their verdicts, on the branch of these ratios."""
        if ratios == self._ratios:
            orbits = self.legs.orbits(eccentricity)[:SEVERAL]
            return orbits, [f.verdict for f in floquet_all(orbits, quick=True)]
        changes = {self.numbers[name][0]: ratio * self.numbers[name][1]
                   for name, ratio in ratios.items()}
        branch = update_branch(self.legs.branch, vary(self.machine, changes).model(),
                               self.machine.speed)
        orbits = Legs(branch, ()).orbits(eccentricity)[:SEVERAL]
        points = floquet_all([*branch, *orbits], quick=True)  # all in one batch
        self.legs, self._ratios = Legs(branch, points[:len(branch)]), ratios
        return orbits, [point.verdict for point in points[len(branch):]]

    def _show_branch(self, eccentricity: float) -> None:
        self._limits(self.legs, eccentricity)
        for which, number in enumerate(self._numbers(self.legs)):
            found = self.legs.lines(number)
            for word in WORDS:
                self.lines[word][which].set_data(*found.get(word, ([], [])))
        self._mark(self.folds, self.legs.at_folds())

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
        at = [100 * orbit.static_eccentricity for orbit in orbits]
        for mark, number in zip(marks, self._numbers(self.legs), strict=True):
            mark.set_data(at, [number(np.array([o.static_eccentricity]), o.local[None])[0]
                               for o in orbits])


def branch_explorer(machine: Machine | None = None,
                    eccentricity: float | None = None) -> FigureExplorer:
    """The whole branch of a machine while its field, unbalance, rotor mass and guide-bearing
    stiffness change.

    A click on the branch shows the orbits at that eccentricity.
    machine: by default the card "kaplan-150rpm". eccentricity: in per cent, where orbits are shown;
    by default a little before the first fold. Raises BadInput for a machine without an air gap,
    NoConvergence where there is no first steady state.
    """
    view = BranchView(machine or load_machine("kaplan-150rpm"))
    first = 100 * view.card.all[0].high
    most = round(max(2 * first, 104 * view.card.reach), 1)
    start = round(0.95 * first, 1) if eccentricity is None else eccentricity
    field, mass, stiffness = (view.numbers[name][2] for name in ("field", "mass", "stiffness"))
    return FigureExplorer(view, {
        "eccentricity": slider("static eccentricity, %", start, 0.0, most, 0.1, 1),
        "field": slider("field, T", field, 0.8 * field, 1.12 * field, 0.004 * field, 3),
        "unbalance": slider("unbalance, × the card's", 1.0, 0.1, 2.0, 0.02, 2),
        "mass": slider(f"mass of the {view.body.name}, t", mass, 0.6 * mass, 1.5 * mass,
                       0.005 * mass, 1),
        "stiffness": slider(f"{view.guide.name}, {view.guide.unit}", stiffness, 0.6 * stiffness,
                            2 * stiffness, 0.005 * stiffness, 3)}, frames=FEW)
