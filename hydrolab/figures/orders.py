"""A record beside the steady state of a model: the orbit at each place, and the orders; a run over
time, and its orders over time.
"""

from __future__ import annotations

import math

import numpy as np
from matplotlib.colors import LogNorm

from hydrolab.dynamics.harmonics import long_axis, synthesise
from hydrolab.dynamics.probes import ProbeRecord, motion_at
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.run import Run
from hydrolab.figures.drawing import MM, REVOLUTION, UM, draw_orbit, frame
from hydrolab.figures.picture import Picture
from hydrolab.figures.readings import listed, microns
from hydrolab.figures.style import (
    BLUE,
    COLOURS,
    ORANGE,
    VERMILLION,
    house_style,
    new_figure,
    plane,
)
from hydrolab.machine.quantities import RPM

SHOWN = (0.5, 1, 2, 3, 4)  # orders
DARKEST = 1e-3  # of the largest amplitude: what is not told from nothing in a waterfall
CERTAIN = 3  # standard errors: what is within them may be noise


@house_style()
def record_picture(record: ProbeRecord, orbit: PeriodicOrbit | None = None) -> Picture:
    """A record's orbits about their mean, place by place, and its orders with three standard
    errors; over them those of the orbit of a model, if one is given.
    """
    figure = new_figure(4.3 * max(2, len(record.places)), 7.4)
    panels = figure.subplots(2, len(record.places), squeeze=False, height_ratios=(1.5, 1))
    for above, below, place in zip(*panels, record.places, strict=True):
        found = record.coefficients(place)[0]
        plane(above, place)
        above.plot(*(MM * (record.positions(place) - found[:, :1])), ",", color=COLOURS["axis"],
                   alpha=0.5)
        path = synthesise(found, REVOLUTION) - found[:, :1]
        draw_orbit(above, path, COLOURS["rotor"], label="record")
        frame(above, path, 0.2)
        at = np.arange(len(SHOWN))
        sizes, errors = UM * np.array([record.order(place, k) for k in SHOWN]).T
        below.errorbar(at, sizes, CERTAIN * errors, fmt="o", color=COLOURS["rotor"], capsize=4)
        below.set(yscale="log", ylim=(max(errors.min(), 1e-3) / 3, 3 * sizes.max()),
                  xticks=at, xticklabels=[f"{k:g}X" for k in SHOWN])
        if orbit is not None:
            own = motion_at(orbit, place)
            draw_orbit(above, synthesise(own, REVOLUTION) - own[:, :1], COLOURS["1X"],
                       label="model", line="--", sense=False)
            whole = range(1, min(orbit.harmonics, 4) + 1)
            below.plot(list(whole), [UM * long_axis(own, k) for k in whole], "D",
                       color=COLOURS["1X"], fillstyle="none", markersize=11)
    panels[1][0].set_ylabel("long half axis, µm")
    panels[0][0].legend(loc="upper right")
    return Picture(figure, record_reading(record, orbit))


def record_reading(record: ProbeRecord, orbit: PeriodicOrbit | None = None) -> str:
    """1X and 2X at each place with their standard error, which orders stand clear of the noise, and
    how far a model's orbit is from them.
    """
    said = []
    for place in record.places:
        (first, error), (second, _) = record.order(place, 1), record.order(place, 2)
        own = "" if orbit is None else (
            f", {UM * long_axis(motion_at(orbit, place)):.1f} by the model")
        said.append(f"{UM * first:.1f} µm at the {place}{own} (2X {UM * second:.1f} µm, "
                    f"± {UM * error:.2f})")
    half = [place for place in record.places
            for size, error in [record.order(place, 0.5)] if size > 2 * CERTAIN * error]
    return (f"{record.name}, {record.revolutions:.0f} revolutions at "
            f"{record.speed * 30 / np.pi:.4g} rpm: 1X is {listed(said)}, 0-to-peak; "
            + (f"½X stands clear of the noise at the {listed(half)}." if half
               else "½X is nowhere clear of the noise."))


@house_style()
def run_picture(run: Run, *, steady: int = 40) -> Picture:
    """A run over time: speed and field, the motion of the generator in each revolution with the
    steady one at so many instants (`steady`), the smallest gap, and the bearing forces.
    """
    figure = new_figure(10, 8)
    upper, motion, gap, force = figure.subplots(4, 1, sharex=True, height_ratios=(1, 1.6, 1, 1))
    times, every = run.times, np.linspace(run.times[0], run.times[-1], 600)
    upper.plot(every, run.schedule.speed(every) / RPM, color=BLUE, label="speed, rpm")
    highest = run.schedule.speeds.max() / RPM
    upper.plot(every, highest * run.schedule.field(every), "--", color=ORANGE,
               label=f"field, 1 at {highest:.4g}")
    middle, amplitudes = run.revolutions
    motion.plot(middle, UM * amplitudes, color=COLOURS["rotor"], label="in each revolution")
    at = np.linspace(*times[[0, -1]], steady)
    motion.plot(at, UM * run.steady(at), "o", color=VERMILLION, markersize=4,
                label="steady at that speed and field")
    motion.set_ylabel("about its mean, µm")
    motion.set_ylim(0, 1.25 * UM * amplitudes.max(initial=1e-9))
    if math.isfinite(run.model.gap):
        gap.plot(times, MM * run.gaps, color=COLOURS["stator"], linewidth=0.8)
    gap.set_ylabel("gap, mm")
    for (name, size), colour in zip(run.bearing_forces.items(), COLOURS.values(), strict=False):
        force.plot(times, 1e-3 * size, color=colour, linewidth=0.8, label=name)
    force.set(xlabel="time, s", ylabel="force, kN", ylim=(0, None))
    for axes in (upper, motion, force):
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2)
    return Picture(figure, str(run))


@house_style()
def waterfall_picture(run: Run, place: int | float | str | None = None, *, lines: int = 80,
                      revolutions: int = 8, highest: float = 4.0) -> Picture:
    """Spectra of a place in a run over time, by orders of the speed.

    lines, revolutions, highest: as of `Run.waterfall`.
    """
    fall = run.waterfall(place, lines=lines, revolutions=revolutions, highest=highest)
    figure = new_figure(10, 5.4)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(4, 1))
    top = fall.amplitudes.max()
    drawn = left.pcolormesh(fall.orders, fall.times, UM * np.maximum(fall.amplitudes,
                                                                     DARKEST * top),
                            norm=LogNorm(UM * DARKEST * top, UM * top), shading="nearest",
                            cmap="viridis")
    figure.colorbar(drawn, ax=left, label="µm (0-to-peak)")
    left.set(xlabel="order: frequency over speed", ylabel="time, s")
    left.grid(False)
    right.plot(fall.speeds / RPM, fall.times, color=BLUE)
    right.set(xlabel="speed, rpm", xlim=(0, None))
    words = []
    for order in range(1, int(highest) + 1):
        size = fall.of(order)
        i = int(size.argmax())
        words.append(f"{order}X {microns(size[i])} at {fall.times[i]:.3g} s")
    at = "the generator" if place is None else f"{place}"
    return Picture(figure, f"Spectra at {at} during {run.schedule.story}, by order. Largest "
                   f"(0-to-peak): {', '.join(words)}.")
