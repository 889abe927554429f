"""The paper's Figures 3 to 6, computed: harmonic balance against integration, and the static eccentricity.

Each takes a `hydrolab.study.Study`. Percentages in titles are those of the machine at hand.
"""

from __future__ import annotations

import numpy as np

from hydrolab.dynamics.harmonic_balance import orbit_from
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.solvers import newton
from hydrolab.show.branches import curve
from hydrolab.show.drawing import MM, REVOLUTION, UM, draw_axis, draw_gap, draw_orbit, draw_sense, frame, frame_gap
from hydrolab.show.fold_figure import figure_8
from hydrolab.show.picture import Picture
from hydrolab.show.rotor_figure import figure_7
from hydrolab.show.study_readings import (
    EVOLUTION,
    VALIDATION,
    StudyResult,
    figure_3_reading,
    figure_4_reading,
    figure_5_reading,
    figure_6_reading,
    quoted,
    validation,
)
from hydrolab.show.style import COLOURS, LINES, eccentricity_colours, house_style, new_figure, plane

LEG_POINTS = 161  # steady states that Figure 5 is drawn through
WIDE = 1.35  # width over height of the small panels of Figure 6
SMALLEST_SHOWN = 1e-2  # µm; below it an amplitude is not worth a decade of the logarithmic panels


@house_style()
def figure_3(study: StudyResult) -> Picture:
    """Orbits at 8.8 %: harmonic balance, and the three last periods of direct integration."""
    _, path, balance = validation(study)
    orbit = study.orbits[VALIDATION]
    figure = new_figure(12, 6)
    near, far = figure.subplots(1, 2, width_ratios=(1.6, 1))
    plane(near, f"Orbit at {quoted(study, VALIDATION)} static eccentricity")
    around = orbit.positions(REVOLUTION)
    draw_orbit(near, around, COLOURS["harmonic balance"], width=7, sense=False,
               label=f"harmonic balance, {orbit.harmonics} harmonics")
    near.plot(*(MM * path), "--", color=COLOURS["integration"], linewidth=1.6,
              label="direct integration, last 3 revolutions")
    draw_sense(near, around, COLOURS["integration"], "Ωt = 0")
    frame(near, balance, 0.3)
    near.legend(loc="upper left")
    plane(far, "Where it lies in the gap")
    draw_gap(far, orbit.centre, study.model.gap)
    draw_orbit(far, around, COLOURS["harmonic balance"], sense=False)
    frame_gap(far, orbit.centre, study.model.gap)
    return Picture(figure, figure_3_reading(study))


@house_style()
def figure_4(study: StudyResult) -> Picture:
    """x(t) and z(t) over the last three periods by both methods, and what is between them."""
    times, path, balance = validation(study)
    figure = new_figure(12, 8)
    top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(1.2, 1.2, 1))
    for axes, name, b, p in zip((top, middle), "xz", balance, path, strict=True):
        axes.plot(times, MM * b, color=COLOURS["harmonic balance"], linewidth=7, label="harmonic balance")
        axes.plot(times, MM * p, "--", color=COLOURS["integration"], linewidth=1.6, label="direct integration")
        axes.set_ylabel(f"{name}, mm")
    for name, line, b, p in zip("xz", ("-", "--"), balance, path, strict=True):
        bottom.plot(times, UM * (b - p), line, color=COLOURS[name], linewidth=1.8, label=f"difference in {name}")
    largest = 1.15 * UM * float(np.abs(balance - path).max()) or 1.0
    bottom.set_ylim(-largest, largest)
    bottom.set_ylabel("difference, µm")
    bottom.set_xlabel("time, s")
    bottom.set_xlim(times[0], times[-1])
    figure.suptitle(f"Rotor centre at {quoted(study, VALIDATION)} static eccentricity, last three revolutions")
    for axes in (top, bottom):
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, borderaxespad=0.2)
    figure.align_ylabels()
    return Picture(figure, figure_4_reading(study))


def first_leg(study: StudyResult) -> list[PeriodicOrbit]:
    """Steady states from zero eccentricity to the first fold (or the end), each solved for, and the last one there.

    They lie evenly along the branch, so that they crowd where it turns up; each is looked for on the smooth curve.
    """
    branch = study.branch
    smooth, eq = curve(branch), branch.equations
    last = smooth.at_folds[0] if branch.folds else smooth.at_points[branch.first_leg.stop - 1]
    eccentricity, coefficients = smooth(np.linspace(0.0, last, LEG_POINTS)[:-1])
    orbits = [branch[0]]
    for value, guess in zip(eccentricity[1:], coefficients[1:], strict=True):
        centre = value * study.model.gap * branch.direction
        found = newton(lambda y, centre=centre: eq.linearise(y, centre), guess.ravel() / eq.length)
        if found.converged:
            orbits.append(orbit_from(eq, float(value), centre, found))
    return [*orbits, branch.at_fold(0) if branch.folds else branch[branch.first_leg.stop - 1]]


@house_style()
def figure_5(study: StudyResult) -> Picture:
    """Mean and harmonics of x and of z over the static eccentricity, up to the first fold, on two scales."""
    orbits = first_leg(study)
    eccentricity = [100 * orbit.static_eccentricity for orbit in orbits]
    figure = new_figure(12, 9)
    panels = figure.subplots(2, 2, sharex=True, sharey="row")
    for column, name in enumerate("xz"):
        parts = {"mean": [abs(o.mean[column]) for o in orbits]}
        for k in range(1, min(4, orbits[0].harmonics) + 1):
            parts[f"{k}X"] = [o.amplitudes[column, k - 1] for o in orbits]
        for axes, first in zip(panels[:, column], (0, 1), strict=True):  # a logarithmic scale has no 0 %
            for part, values in parts.items():
                axes.plot(eccentricity[first:], UM * np.array(values[first:]), LINES[part], color=COLOURS[part],
                          label=part, linewidth=2.6)
            if study.branch.folds:
                axes.axvline(100 * study.branch.folds[0].value, color=COLOURS["stator"], linewidth=1.2, zorder=0)
        panels[0, column].set_title(f"{name}: {'along' if name == 'x' else 'across'} the eccentricity")
    for axes in panels[:, 0]:
        axes.set_ylabel("mean and amplitudes, µm (0-to-peak)")
    panels[0, 0].set_ylim(bottom=0)
    panels[1, 0].set_yscale("log")
    panels[1, 0].yaxis.set_major_formatter("{x:g}")
    panels[1, 0].set_ylim(SMALLEST_SHOWN, 3 * panels[0, 0].get_ylim()[1])
    panels[0, 0].set_xlim(0, 1.02 * eccentricity[-1])
    figure.supxlabel("static eccentricity, % of the gap" + (" (line: first fold)" if study.branch.folds else ""))
    panels[0, 0].legend(loc="upper left")
    return Picture(figure, figure_5_reading(study))


@house_style()
def figure_6(study: StudyResult) -> Picture:
    """Orbits at the generator as the eccentricity grows: as they travel, and each one centred on its mean."""
    orbits = [study.orbits[p] for p in EVOLUTION]
    paths = [orbit.positions(REVOLUTION) for orbit in orbits]
    colours = eccentricity_colours(len(orbits))
    figure = new_figure(12, 10)
    grid = figure.add_gridspec(3, 4, height_ratios=(1.5, 1, 1))
    travel, gap = figure.add_subplot(grid[0, :3]), figure.add_subplot(grid[0, 3])
    for axes, title in ((travel, "As they travel (+: bearing axis)"), (gap, "In the gap (circle: contact)")):
        plane(axes, title)
        for path, colour, p in zip(paths, colours, EVOLUTION, strict=True):
            draw_orbit(axes, path, colour, sense=False, width=2.2 if axes is travel else 1.2, label=quoted(study, p))
    draw_axis(travel)
    frame(travel, np.hstack(paths), 0.04)
    travel.legend(loc="lower right", ncols=4, handlelength=1.2, columnspacing=1.2)
    draw_gap(gap, orbits[-1].centre, study.model.gap, label=False)
    frame(gap, orbits[-1].centre[:, None] + study.model.gap * np.array([[-1, 1], [-1, 1]]), 0.04)
    centred = [path - orbit.mean[:, None] for path, orbit in zip(paths, orbits, strict=True)]
    reach = 1.1 * MM * np.abs(centred).max(axis=(0, 2))
    height = max(reach[1], reach[0] / WIDE)
    small = grid[1:, :].subgridspec(2, 4).subplots(sharex=True, sharey=True)
    for axes, path, colour, p in zip(small.flat, centred, colours, EVOLUTION, strict=True):
        plane(axes, quoted(study, p))
        draw_orbit(axes, path, colour)
        axes.set_aspect("equal", adjustable="box")
        axes.set_xlim(-WIDE * height, WIDE * height)
        axes.set_ylim(-height, height)
        axes.label_outer()
        axes.set_xlabel("x − mean, mm" if axes in small[1] else "")
        axes.set_ylabel("z − mean, mm" if axes in small[:, 0] else "")
    return Picture(figure, figure_6_reading(study))


def study_pictures(study: StudyResult) -> dict[str, Picture]:
    """All figures of the study by their name, "figure-3" to "figure-8"."""
    makers = (figure_3, figure_4, figure_5, figure_6, figure_7, figure_8)
    return {f"figure-{number}": make(study) for number, make in enumerate(makers, 3)}
