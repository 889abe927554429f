"""Where the negative stiffness of design tools is safe, and where a two-pole rotor is unstable:
maps with a reading.
"""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes

from hydrolab.dynamics.parametric import StabilityChart
from hydrolab.dynamics.practice import PracticeErrors
from hydrolab.errors import BadInput
from hydrolab.figures.picture import Picture
from hydrolab.figures.style import COLOURS, house_style, new_figure

NAMES = {"critical_speed": "critical speed", "amplitude": "1X amplitude",
         "bearing_force": "bearing force",
         "bend": "static bend"}
TOLERANCES = (0.05, 0.1, 0.2)
LEVELS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)


@house_style()
def practice_map(errors: PracticeErrors) -> Picture:
    """The error of the practice in each of the four numbers over static eccentricity and field,
    with the fold.

    Raises BadInput for fewer than two eccentricities or fields.
    """
    if min(errors.worst.shape) < 2:
        raise BadInput(f"the map has {len(errors.eccentricities)} eccentricities and "
                       f"{len(errors.fields)} fields; a picture "
                       "of it needs at least 2 of each, and `practice_reading` needs no more than "
                       "one.")
    figure = new_figure(13, 9)
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for axes, (name, words) in zip(panels.flat, NAMES.items(), strict=True):
        _draw_error(axes, errors, name)
        axes.set_title(f"{words}: practice less nonlinear, %")
    for axes in panels[1]:
        axes.set_xlabel("static eccentricity, % of the gap")
    for axes in panels[:, 0]:
        axes.set_ylabel("flux density over the card's")
    handles, words = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, words, loc="outside lower center")
    return Picture(figure, practice_reading(errors))


def _draw_error(axes: Axes, errors: PracticeErrors, name: str) -> None:
    """One number's error: filled by its size, lines with its value, the folds as the border of the
    steady states.
    """
    x, values = 100 * errors.eccentricities, 100 * getattr(errors, name)
    levels = [0, *(100 * level for level in LEVELS)]
    axes.contourf(x, errors.fields, np.abs(values), levels=levels, cmap="cividis", extend="max")
    if np.nanmax(np.abs(values)) > levels[1]:
        lines = axes.contour(x, errors.fields, values,
                             levels=[*(-level for level in levels[:0:-1]), *levels[1:]],
                             colors="white", linewidths=1.2)
        axes.clabel(lines, fmt="%g %%", fontsize=11)
    seen = np.isfinite(errors.folds)
    axes.plot(100 * errors.folds[seen], errors.fields[seen], "D-", color=COLOURS["unstable"],
              label="first fold; beyond it this leg has no steady state")
    axes.set_xlim(x[0], x[-1])


def practice_reading(errors: PracticeErrors) -> str:
    """Up to which eccentricity the practice is safe at the card's field, what goes wrong first, and
    at the last orbit.
    """
    row = int(np.argmin(np.abs(errors.fields - 1)))
    said = []
    for tolerance in TOLERANCES:
        safe = errors.safe_to(tolerance)[row]
        said.append(f"{100 * tolerance:g} % "
                    + ("nowhere" if math.isnan(safe) else f"up to {100 * safe:.3g} %"))
    last = np.flatnonzero(np.isfinite(errors.worst[row]))
    text = (f"At {errors.fields[row]:.3g} of the card's field the negative stiffness keeps all "
            "four numbers within "
            f"{', within '.join(said)} static eccentricity")
    if len(last):
        at = last[-1]
        sizes = {words: getattr(errors, name)[row, at] for name, words in NAMES.items()}
        text += (f"; at {100 * errors.eccentricities[at]:.3g} %, the last point of the map before "
                 "the fold, its errors are "
                 + ", ".join(f"{100 * size:+.3g} % ({words})" for words, size in sizes.items()))
    fold = errors.folds[row]
    return text + ("." if math.isnan(fold) else f". The fold at {100 * fold:.4g} % has no "
                                                "counterpart in it.")


@house_style()
def stability_map(chart: StabilityChart, band: tuple[list[float], list[float], list[float]]
                  | None = None) -> Picture:
    """The chart over speed and field, red where unstable; band: exact (fields, low, high), rad/s,
    where known.
    """
    figure = new_figure(10, 6)
    axes = figure.subplots()
    speeds = chart.speeds * 30 / math.pi
    size = np.nanmax(np.abs(chart.growth))
    filled = axes.pcolormesh(speeds, chart.fields, chart.growth, cmap="RdBu_r", vmin=-size,
                             vmax=size, shading="nearest")
    figure.colorbar(filled, ax=axes, label="growth of a disturbance, 1/s")
    if band:
        fields, low, high = band
        for edge, words in ((low, "exact edges, frame that turns with the field"), (high, "")):
            axes.plot(np.array(edge) * 30 / math.pi, fields, "--", color=COLOURS["fold"],
                      linewidth=3, label=words)
        axes.legend(loc="lower left")
    axes.set_xlabel("speed, rpm")
    axes.set_ylabel("flux density over the card's")
    return Picture(figure, stability_reading(chart))


def stability_reading(chart: StabilityChart) -> str:
    """Where the strongest field of the chart makes the rotor unstable."""
    row = len(chart.fields) - 1
    band = chart.band(row)
    share = 100 * np.mean(chart.unstable)
    if band is None:
        return f"The rotor is stable at every speed of the chart up to {chart.fields[row]:.3g} of the card's field."
    low, high = (value * 30 / math.pi for value in band)
    return (f"At {chart.fields[row]:.3g} of the card's field the centred rotor is unstable from "
            f"{low:.4g} to {high:.4g} "
            f"rpm, where a disturbance grows by up to {np.nanmax(chart.growth[row]):.3g} a second "
            "in the exponent; "
            f"{share:.3g} % of the chart is unstable.")
