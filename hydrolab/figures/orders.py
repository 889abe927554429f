"""A record beside the steady state of a model: the orbit at each place, and the orders."""

from __future__ import annotations

import numpy as np

from hydrolab.dynamics.harmonics import long_axis, synthesise
from hydrolab.dynamics.probes import ProbeRecord, motion_at
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.figures.drawing import MM, REVOLUTION, UM, draw_orbit, frame
from hydrolab.figures.picture import Picture
from hydrolab.figures.readings import listed
from hydrolab.figures.style import COLOURS, house_style, new_figure, plane

SHOWN = (0.5, 1, 2, 3, 4)  # orders
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
