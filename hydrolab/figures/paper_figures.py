"""The figures of the paper's study, computed, each with the sentence that it says.

Figures 3 and 4: harmonic balance against integration. 5 to 7: the static eccentricity. 8, which the
paper could not show: the branch past its folds, and what the rotor does beyond them. Percentages in
titles are those of the machine at hand.
"""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from hydrolab.dynamics.branches import orbits_at
from hydrolab.dynamics.harmonics import PERIOD, ellipse, self_crossings, synthesise
from hydrolab.dynamics.results import PeriodicOrbit, Trajectory
from hydrolab.figures.drawing import (
    MM,
    REVOLUTION,
    UM,
    draw_arrow,
    draw_axis,
    draw_gap,
    draw_orbit,
    draw_place,
    draw_sense,
    frame,
)
from hydrolab.figures.orbits import curve, draw_branch
from hydrolab.figures.picture import Picture
from hydrolab.figures.readings import (
    first_along,
    listed,
    microns,
    percent,
    stability_sentence,
)
from hydrolab.figures.rotor import (
    ELEVATION,
    draw_bearings,
    draw_rotor,
    draw_z,
    exaggeration,
    name_parts,
    on_page,
    rotor_stations,
)
from hydrolab.figures.style import (
    COLOURS,
    LINES,
    eccentricity_colours,
    house_style,
    new_figure,
    plane,
)
from hydrolab.paper.study import BEYOND, REPEATED, REPEATS, VALIDATION, SteadyStudy, Study

# the paper's percentages; `eccentricity` says what they stand for on another machine
EVOLUTION = (0.0, 3.0, 5.0, 7.0, 8.0, 8.5, 8.8, 8.9)
ROTOR = (1.0, 5.0, 7.0, 8.9)
LEG_POINTS = 161  # steady states that Figure 5 is drawn through
WIDE = 1.35  # width over height of the small panels of Figure 6
SMALLEST_SHOWN = 1e-2  # µm; below it an amplitude is not worth a decade of the logarithmic panels
SHOWN = 40  # revolutions of a motion that stays in the gap
LAST = 3  # of these, and of any other such motion, the orbit of the last ones
# inches that names, titles, labels and legend of Figure 7 take beside and above its four panels
BESIDE, ABOVE = 3.6, 2.1


def quoted(study: SteadyStudy, percentage: float) -> str:
    """A percentage of the paper as it is on this machine, "8.8 %"."""
    return percent(study.eccentricity(percentage))


def _validation(study: Study) -> tuple[NDArray, NDArray, NDArray]:
    """Times (s) of the check's last three revolutions, positions and harmonic balance there, m."""
    times, path = study.check.last(min(3.0, study.check.revolutions))
    return times, path, study.orbits[VALIDATION].positions(study.speed * times)


def _reading_3(study: Study) -> str:
    _, path, balance = _validation(study)
    orbit = study.orbits[VALIDATION]
    apart, size = float(np.hypot(*(balance - path)).max()), orbit.vibration
    stopped = "" if study.check.finished else f" {study.check.stopped}"
    return (f"At {quoted(study, VALIDATION)} static eccentricity the orbits by harmonic balance "
            f"({orbit.harmonics} harmonics) and by direct integration (the last 3 of "
            f"{study.check.revolutions:.0f} revolutions) are at most {microns(apart)} apart, "
            f"{100 * apart / size:.3f} % of the largest vibration of {microns(size)}; the smallest "
            f"gap is {MM * orbit.smallest_gap:.3f} mm of {MM * study.model.gap:.3f} mm.{stopped}")


def _reading_4(study: Study) -> str:
    times, path, balance = _validation(study)
    apart, swing = np.abs(balance - path).max(axis=1), np.ptp(balance, axis=1)
    turns = (times[-1] - times[0]) * study.speed / (2 * math.pi)
    return (f"Over the last {turns:.0f} revolutions at {quoted(study, VALIDATION)} static "
            f"eccentricity x swings over {microns(swing[0])} and z over {microns(swing[1])} (peak "
            "to peak); harmonic balance and direct integration differ by at most "
            f"{microns(apart[0])} in x and {microns(apart[1])} in z.")


def _reading_5(study: SteadyStudy) -> str:
    branch, start, end = study.branch, study.orbits[0.0], study.orbits[8.9]
    marks = [f"{microns(study.orbits[p].amplitudes[0, 0])} at {quoted(study, p)}"
             for p in (0.0, 4.0, 8.0, 8.9)]
    last = (f"the first fold, at {percent(branch.folds[0].value, 4)}" if branch.folds else
            f"the end of the branch, at {percent(branch.static_eccentricity[-1], 4)}")
    second = [100 * study.orbits[p].second_share for p in (4.0, 8.9)]
    return (f"Up to {last} static eccentricity: 1X in x (0-to-peak) is {listed(marks)}, "
            f"{end.amplitudes[0, 0] / start.amplitudes[0, 0]:.2f} times that at 0 %; the mean in x "
            f"is {microns(abs(end.mean[0]))} at {quoted(study, 8.9)}; 2X is {second[0]:.1f} % of "
            f"1X at {quoted(study, 4.0)} and {second[1]:.1f} % at {quoted(study, 8.9)}.")


def _reading_6(study: SteadyStudy) -> str:
    orbits = [study.orbits[p] for p in EVOLUTION]
    ratios = [f"{ellipse(study.orbits[p].coefficients).ratio:.2f} at {quoted(study, p)}"
              for p in (0.0, 5.0, 7.0, 8.9)]
    looped = [quoted(study, p) for p, o in zip(EVOLUTION, orbits, strict=True)
              if self_crossings(o.positions(PERIOD))]
    travelled = MM * float(np.hypot(*(orbits[-1].mean - orbits[0].mean)))
    loops = f"the orbit crosses itself at {listed(looped)}" if looped else "no orbit crosses itself"
    return (f"From 0 to {quoted(study, EVOLUTION[-1])} static eccentricity the orbit at the "
            f"generator travels {travelled:.2f} mm towards the smallest gap; the axes of its 1X "
            f"ellipse have the ratio {listed(ratios)}; {loops}.")


def _reading_7(study: SteadyStudy) -> str:
    said = []
    for p in ROTOR:
        orbit = study.orbits[p]
        found = [*map(orbit.node_coefficients, range(len(study.model.depths))), orbit.coefficients]
        mean = max(math.hypot(*c[:, 0]) for c in found)
        first = max(ellipse(c).major for c in found)
        said.append(f"{microns(mean)} and {microns(first)} at {quoted(study, p)}")
    return ("Largest mean displacement and largest 1X (0-to-peak, long half axis) of the rotor: "
            f"{', '.join(said)}.")


def outcome(trajectory: Trajectory) -> str:
    """What a motion comes to: contact, an orbit of one or two revolutions, or neither."""
    if not trajectory.finished:
        return trajectory.stopped.rstrip(".")[0].lower() + trajectory.stopped.rstrip(".")[1:]
    if trajectory.revolutions < 5:
        return f"is still in the gap after {trajectory.revolutions:.0f} revolutions"
    for count, words in REPEATED.items():
        if trajectory.recurrence(count) <= REPEATS:
            return f"the motion settles on an orbit that repeats after {words}"
    return "the motion stays in the gap and does not repeat"


def _reading_8(study: Study) -> str:
    branch = study.branch
    folds = [percent(fold.value, 4) for fold in branch.folds]
    turns = (f"The branch folds at {listed(folds)} static eccentricity" if folds
             else "The branch has no fold")
    there = study.states_beyond
    if there:
        states = f"it has {len(there)} steady state{'s' * (len(there) > 1)}, {listed(there)}"
    elif branch.folds or study.eccentricity(BEYOND) < branch.static_eccentricity.max():
        states = "it has no steady state"
    else:
        states = "nothing is known of it, for it was followed no further"
    return (f"{turns}; {stability_sentence(branch, study.stability)}. At {quoted(study, BEYOND)} "
            f"{states}; started there on the {quoted(study, 8.9)} orbit, {outcome(study.beyond)}.")


@house_style()
def figure_3(study: Study) -> Picture:
    """Orbits at 8.8 %: harmonic balance, and the three last periods of direct integration."""
    _, path, balance = _validation(study)
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
    draw_place(far, orbit, COLOURS["harmonic balance"])
    return Picture(figure, _reading_3(study))


@house_style()
def figure_4(study: Study) -> Picture:
    """x(t) and z(t) over the last three periods by both methods, and what is between them."""
    times, path, balance = _validation(study)
    figure = new_figure(12, 8)
    top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(1.2, 1.2, 1))
    for axes, name, b, p in zip((top, middle), "xz", balance, path, strict=True):
        axes.plot(times, MM * b, color=COLOURS["harmonic balance"], linewidth=7,
                  label="harmonic balance")
        axes.plot(times, MM * p, "--", color=COLOURS["integration"], linewidth=1.6,
                  label="direct integration")
        axes.set_ylabel(f"{name}, mm")
    for name, line, b, p in zip("xz", ("-", "--"), balance, path, strict=True):
        bottom.plot(times, UM * (b - p), line, color=COLOURS[name], linewidth=1.8,
                    label=f"difference in {name}")
    largest = 1.15 * UM * float(np.abs(balance - path).max()) or 1.0
    bottom.set(xlabel="time, s", ylabel="difference, µm", xlim=(times[0], times[-1]),
               ylim=(-largest, largest))
    figure.suptitle(f"Rotor centre at {quoted(study, VALIDATION)} static eccentricity, last three "
                    "revolutions")
    for axes in (top, bottom):
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, borderaxespad=0.2)
    figure.align_ylabels()
    return Picture(figure, _reading_4(study))


def first_leg(study: SteadyStudy) -> list[PeriodicOrbit]:
    """Steady states from zero eccentricity to the first fold (or the end), each solved for, and the
    last one there.

    They lie evenly along the branch, so that they crowd where it turns up.
    """
    branch, end = study.branch, study.branch.first_leg.stop - 1
    smooth = curve(branch)
    last = smooth.at_folds[0] if branch.folds else smooth.at_points[end]
    values, _ = smooth(np.linspace(0.0, last, LEG_POINTS)[1:-1])
    orbits = [orbit for value in values for orbit in orbits_at(branch, value)[:1]]
    return [branch[0], *orbits, branch.at_fold(0) if branch.folds else branch[end]]


@house_style()
def figure_5(study: SteadyStudy) -> Picture:
    """Mean and harmonics of x and z over the eccentricity up to the first fold, on two scales."""
    orbits = first_leg(study)
    eccentricity = [100 * orbit.static_eccentricity for orbit in orbits]
    figure = new_figure(12, 9)
    panels = figure.subplots(2, 2, sharex=True, sharey="row")
    for column, name in enumerate("xz"):
        parts = {"mean": [abs(o.mean[column]) for o in orbits]}
        for k in range(1, min(4, orbits[0].harmonics) + 1):
            parts[f"{k}X"] = [o.amplitudes[column, k - 1] for o in orbits]
        # a logarithmic scale has no 0 %
        for axes, first in zip(panels[:, column], (0, 1), strict=True):
            for part, values in parts.items():
                axes.plot(eccentricity[first:], UM * np.array(values[first:]), LINES[part],
                          color=COLOURS[part], label=part, linewidth=2.6)
            if study.branch.folds:
                axes.axvline(100 * study.branch.folds[0].value, color=COLOURS["stator"],
                             linewidth=1.2, zorder=0)
        panels[0, column].set_title(f"{name}: {'along' if name == 'x' else 'across'} the "
                                    "eccentricity")
    for axes in panels[:, 0]:
        axes.set_ylabel("mean and amplitudes, µm (0-to-peak)")
    panels[0, 0].set_ylim(bottom=0)
    panels[1, 0].set(yscale="log", ylim=(SMALLEST_SHOWN, 3 * panels[0, 0].get_ylim()[1]))
    panels[1, 0].yaxis.set_major_formatter("{x:g}")
    panels[0, 0].set_xlim(0, 1.02 * eccentricity[-1])
    figure.supxlabel("static eccentricity, % of the gap"
                     + (" (line: first fold)" if study.branch.folds else ""))
    panels[0, 0].legend(loc="upper left")
    return Picture(figure, _reading_5(study))


@house_style()
def figure_6(study: SteadyStudy) -> Picture:
    """Orbits at the generator as the eccentricity grows: as they travel; about their means."""
    orbits = [study.orbits[p] for p in EVOLUTION]
    paths = [orbit.positions(REVOLUTION) for orbit in orbits]
    colours = eccentricity_colours(len(orbits))
    figure = new_figure(12, 10)
    grid = figure.add_gridspec(3, 4, height_ratios=(1.5, 1, 1))
    travel, gap = figure.add_subplot(grid[0, :3]), figure.add_subplot(grid[0, 3])
    for axes, title in ((travel, "As they travel (+: bearing axis)"),
                        (gap, "In the gap (circle: contact)")):
        plane(axes, title)
        for path, colour, p in zip(paths, colours, EVOLUTION, strict=True):
            draw_orbit(axes, path, colour, sense=False, width=2.2 if axes is travel else 1.2,
                       label=quoted(study, p))
    draw_axis(travel)
    frame(travel, np.hstack(paths), 0.04)
    travel.legend(loc="lower right", ncols=4, handlelength=1.2, columnspacing=1.2)
    draw_gap(gap, orbits[-1].centre, study.model, label=False)
    frame(gap, orbits[-1].centre[:, None] + study.model.gap * np.array([[-1, 1], [-1, 1]]), 0.04)
    centred = [path - orbit.mean[:, None] for path, orbit in zip(paths, orbits, strict=True)]
    reach = 1.1 * MM * np.abs(centred).max(axis=(0, 2))
    height = max(reach[1], reach[0] / WIDE)
    small = grid[1:, :].subgridspec(2, 4).subplots(sharex=True, sharey=True)
    for axes, path, colour, p in zip(small.flat, centred, colours, EVOLUTION, strict=True):
        plane(axes, quoted(study, p))
        draw_orbit(axes, path, colour)
        axes.set_aspect("equal", adjustable="box")
        axes.label_outer()
        axes.set(xlim=(-WIDE * height, WIDE * height), ylim=(-height, height),
                 xlabel="x − mean, mm" if axes in small[1] else "",
                 ylabel="z − mean, mm" if axes in small[:, 0] else "")
    return Picture(figure, _reading_6(study))


@house_style()
def figure_7(study: SteadyStudy) -> Picture:
    """The bent rotor at 1, 5, 7 and 8.9 % with the orbits of all nodes; of a point: its orbits."""
    if study.machine.shaft is None:
        return orbits_only(study)
    stations = [rotor_stations(study.machine, study.orbits[p]) for p in ROTOR]
    paths = synthesise(np.array([coefficients for _, coefficients in stations]), REVOLUTION)
    depths = stations[0][0]
    length = float(np.ptp(depths))
    factor = exaggeration(paths, length)
    x, y = on_page(np.moveaxis(paths, -2, 0), depths[:, None], factor)
    half_width = 0.03 * MM * length / factor
    left = min(x.min(), -2 * half_width) - half_width
    right = max(x.max(), 2 * half_width) + half_width
    top, bottom = y.min() - 0.04 * length, y.max() + 0.04 * length
    # width over height of a panel
    slender = (right - left) * factor / MM / ((bottom - top) * math.cos(ELEVATION))
    height = min(6.0, (14.0 - BESIDE) / (4 * slender))
    figure = new_figure(4 * slender * height + BESIDE, height + ABOVE)
    panels = figure.subplots(1, 4, sharex=True, sharey=True)
    for axes, p in zip(panels, ROTOR, strict=True):
        axes.set(xlim=(left, right), ylim=(bottom, top), xlabel="x, mm",
                 title=f"{quoted(study, p)} eccentricity")
        axes.set_aspect(math.cos(ELEVATION) * MM / factor, adjustable="box")
        axes.grid(axis="y", visible=False)
        draw_bearings(axes, study.machine, half_width)
        draw_rotor(axes, study.machine, study.orbits[p], factor)
    panels[0].set_ylabel("depth y, m (down)")
    draw_z(panels[0], left + 0.22 * (right - left), bottom - 0.2 * length, factor,
           float(np.abs(paths).max()))
    name_parts(panels[-1], study.machine)
    figure.suptitle(f"The rotor, seen from the side and above; displacements drawn {factor:.0f} "
                    "times as large")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return Picture(figure, _reading_7(study))


def orbits_only(study: SteadyStudy) -> Picture:
    """Figure 7 of a machine that is one point: its orbits at the same eccentricities, on one scale.
    """
    paths = [study.orbits[p].positions(REVOLUTION) for p in ROTOR]
    everything = np.hstack([*paths, np.zeros((2, 1))])
    wide, high = np.ptp(everything, axis=1)
    figure = new_figure(12, 2 * min(4.5, 5.4 * (high + 0.16 * wide) / (1.16 * wide)) + 2.2)
    panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    for axes, path, p in zip(panels, paths, ROTOR, strict=True):
        plane(axes, f"{quoted(study, p)} eccentricity")
        axes.set_aspect("equal", adjustable="box")
        draw_orbit(axes, path, COLOURS["rotor"])
        draw_axis(axes)
        frame(axes, everything, 0.08)
        axes.label_outer()
    figure.suptitle("Orbits of the point mass (+: bearing axis)")
    return Picture(figure, _reading_7(study))


@house_style()
def figure_8(study: Study) -> Picture:
    """The whole branch with its stability, and the motion beyond the paper's last orbit."""
    figure = new_figure(14, 8)
    panels = figure.subplot_mosaic([["branch", "gap"], ["branch", "orbit"]], width_ratios=(1, 1.05),
                                   height_ratios=(1, 1.35))
    _draw_folds(panels["branch"], study)
    _draw_gap_left(panels["gap"], study)
    _draw_motion(panels["orbit"], study)
    named = {label: handle for key in ("orbit", "branch")
             for handle, label in zip(*panels[key].get_legend_handles_labels(), strict=True)}
    figure.legend(named.values(), named.keys(), loc="outside lower center", ncols=4)
    return Picture(figure, _reading_8(study))


def _draw_folds(axes: Axes, study: Study) -> None:
    """1X over the eccentricity, from a little before everything that lies past the first fold."""
    branch = study.branch
    draw_branch(axes, branch, lambda c: first_along(branch, c), study.stability)
    last = study.natural[len(study.natural) - 1]
    axes.plot(100 * last.static_eccentricity, UM * last.amplitudes[0, 0], "s", markersize=9,
              color=COLOURS["harmonic balance"], markeredgecolor="black", zorder=6,
              label="last orbit of the paper's procedure")
    axes.axvline(100 * study.eccentricity(BEYOND), color=COLOURS["stator"], linewidth=1.4, zorder=0)
    later = 100 * branch.static_eccentricity[branch.first_leg.stop:]
    left = later.min() - 0.8 * np.ptp(later) if len(later) else 0.0
    axes.set(xlim=(max(0.0, left), None), ylim=(0, None),
             xlabel=f"static eccentricity, % of the gap (line: {quoted(study, BEYOND)})",
             ylabel="1X amplitude in x, µm (0-to-peak)",
             title="The branch past its folds" if branch.folds else "The branch")


def _draw_gap_left(axes: Axes, study: Study) -> None:
    """The smallest gap in time: to contact, or over the first revolutions where there is none."""
    beyond = study.beyond
    turns = (beyond.times - beyond.times[0]) * study.speed / (2 * math.pi)
    shown = turns <= SHOWN if beyond.finished else np.ones(len(turns), dtype=bool)
    place = beyond.positions[:, shown] - beyond.centre[:, None]
    gap = MM * study.model.law.smallest_gap(place, study.speed * beyond.times[shown])
    axes.plot(turns[shown], gap, color=COLOURS["integration"], linewidth=1.4)
    axes.axhline(0, color=COLOURS["stator"], linewidth=5)
    cut = turns[-1] > turns[shown][-1]
    axes.set(xlim=(0, turns[shown][-1]), ylim=(0, 1.1 * gap.max()), ylabel="smallest gap, mm",
             xlabel=f"revolutions, the first {SHOWN} of {beyond.revolutions:.0f}" if cut
             else "revolutions",
             title=f"Started at {quoted(study, BEYOND)} on the {quoted(study, 8.9)} orbit")


def _draw_motion(axes: Axes, study: Study) -> None:
    """The motion in the plane, with where it started and the branch's steady states there."""
    beyond = study.beyond
    plane(axes)
    start = study.orbits[8.9].positions(REVOLUTION)
    draw_orbit(axes, start, COLOURS["harmonic balance"], width=4, sense=False,
               label=f"orbit at {quoted(study, 8.9)}")
    shown = [start]
    for orbit, floquet in study.beyond_orbits:
        shown.append(orbit.positions(REVOLUTION))
        draw_orbit(axes, shown[-1], COLOURS[floquet.verdict], line=LINES[floquet.verdict],
                   sense=False, width=5 if floquet.verdict == "stable" else 1.8,
                   label=f"{floquet.verdict} steady state")
    if beyond.finished:
        path = beyond.last(min(LAST, beyond.revolutions))[1]
        axes.plot(*(MM * path), "--", color=COLOURS["integration"], linewidth=1.4,
                  label=f"integration, last {LAST} revolutions")
    else:
        path = beyond.positions
        axes.plot(*(MM * path), color=COLOURS["integration"], linewidth=1.0,
                  label="integration, to contact")
        draw_arrow(axes, path, COLOURS["integration"], at=1.0)
    draw_gap(axes, beyond.centre, study.model)
    frame(axes, np.hstack([path, *shown]), 0.08)


def study_pictures(study: Study) -> dict[str, Picture]:
    """All figures of the study by their name, "figure-3" to "figure-8"."""
    makers = (figure_3, figure_4, figure_5, figure_6, figure_7, figure_8)
    return {f"figure-{number}": make(study) for number, make in enumerate(makers, 3)}
