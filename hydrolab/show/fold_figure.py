"""Figure 8, which the paper could not show: the branch past its folds, and what the rotor does beyond them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from hydrolab.dynamics.stability import Floquet
from hydrolab.show.branches import draw_branch
from hydrolab.show.drawing import MM, REVOLUTION, UM, draw_arrow, draw_gap, draw_orbit, frame
from hydrolab.show.picture import Picture
from hydrolab.show.readings import first_along
from hydrolab.show.study_readings import BEYOND, StudyResult, figure_8_reading, quoted
from hydrolab.show.style import COLOURS, LINES, house_style, new_figure, plane

SHOWN = 40  # revolutions of a motion that stays in the gap
LAST = 3  # of these, and of any other such motion, the orbit of the last ones


@house_style()
def figure_8(study: StudyResult, stability: Sequence[Floquet] | None = None) -> Picture:
    """The whole branch with its stability, and what direct integration finds just beyond the paper's last orbit.

    stability: of every point of the branch; by default the study's.
    """
    stability = study.stability if stability is None else stability
    figure = new_figure(14, 8)
    panels = figure.subplot_mosaic([["branch", "gap"], ["branch", "orbit"]], width_ratios=(1, 1.05),
                                   height_ratios=(1, 1.35))
    _draw_folds(panels["branch"], study, stability)
    _draw_gap_left(panels["gap"], study)
    _draw_motion(panels["orbit"], study)
    named = {label: handle for key in ("orbit", "branch")
             for handle, label in zip(*panels[key].get_legend_handles_labels(), strict=True)}
    figure.legend(named.values(), named.keys(), loc="outside lower center", ncols=4)
    return Picture(figure, figure_8_reading(study, stability))


def _draw_folds(axes: Axes, study: StudyResult, stability: Sequence[Floquet]) -> None:
    """1X over the eccentricity, from a little before everything that lies past the first fold."""
    branch = study.branch
    draw_branch(axes, branch, lambda c: first_along(branch, c), stability)
    last = study.natural[len(study.natural) - 1]
    axes.plot(100 * last.static_eccentricity, UM * last.amplitudes[0, 0], "s", color=COLOURS["harmonic balance"],
              markeredgecolor="black", markersize=9, label="last orbit of the paper's procedure", zorder=6)
    axes.axvline(100 * study.eccentricity(BEYOND), color=COLOURS["stator"], linewidth=1.4, zorder=0)
    later = 100 * branch.static_eccentricity[branch.first_leg.stop:]
    left = later.min() - 0.8 * np.ptp(later) if len(later) else 0.0
    axes.set_xlim(left=max(0.0, left))
    axes.set_ylim(bottom=0)
    axes.set_xlabel(f"static eccentricity, % of the gap (line: {quoted(study, BEYOND)})")
    axes.set_ylabel("1X amplitude in x, µm (0-to-peak)")
    axes.set_title("The branch past its folds" if branch.folds else "The branch")


def _draw_gap_left(axes: Axes, study: StudyResult) -> None:
    """The smallest gap in time: to contact, or over the first revolutions of a motion that stays in the gap."""
    beyond = study.beyond
    turns = (beyond.times - beyond.times[0]) * study.speed / (2 * math.pi)
    shown = turns <= SHOWN if beyond.finished else np.ones(len(turns), dtype=bool)
    gap = MM * study.model.law.smallest_gap(beyond.positions[:, shown] - beyond.centre[:, None])
    axes.plot(turns[shown], gap, color=COLOURS["integration"], linewidth=1.4)
    axes.axhline(0, color=COLOURS["stator"], linewidth=5)
    axes.set_xlim(0, turns[shown][-1])
    axes.set_ylim(0, 1.1 * gap.max())
    cut = turns[-1] > turns[shown][-1]
    axes.set_xlabel(f"revolutions, the first {SHOWN} of {beyond.revolutions:.0f}" if cut else "revolutions")
    axes.set_ylabel("smallest gap, mm")
    axes.set_title(f"Started at {quoted(study, BEYOND)} on the {quoted(study, 8.9)} orbit")


def _draw_motion(axes: Axes, study: StudyResult) -> None:
    """The motion in the plane, with where it started and the steady states that the branch has there."""
    beyond = study.beyond
    plane(axes)
    start = study.orbits[8.9].positions(REVOLUTION)
    draw_orbit(axes, start, COLOURS["harmonic balance"], width=4, sense=False, label=f"orbit at {quoted(study, 8.9)}")
    shown = [start]
    for orbit, floquet in study.beyond_orbits:
        shown.append(orbit.positions(REVOLUTION))
        draw_orbit(axes, shown[-1], COLOURS[floquet.verdict], line=LINES[floquet.verdict], sense=False,
                   width=5 if floquet.verdict == "stable" else 1.8,
                   label=f"{floquet.verdict} steady state")
    if beyond.finished:
        path, words = beyond.last(min(LAST, beyond.revolutions))[1], f"integration, last {LAST} revolutions"
        axes.plot(*(MM * path), "--", color=COLOURS["integration"], linewidth=1.4, label=words)
    else:
        path = beyond.positions
        axes.plot(*(MM * path), color=COLOURS["integration"], linewidth=1.0, label="integration, to contact")
        draw_arrow(axes, path, COLOURS["integration"], at=1.0)
    draw_gap(axes, beyond.centre, study.model.gap)
    frame(axes, np.hstack([path, *shown]), 0.08)
