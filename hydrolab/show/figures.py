"""Results as figures that carry their readings."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hydrolab.dynamics.results import Branch, PeriodicOrbit
from hydrolab.dynamics.stability import Floquet
from hydrolab.show.branches import draw_branch
from hydrolab.show.drawing import (
    MM,
    REVOLUTION,
    draw_axis,
    draw_gap,
    draw_orbit,
    draw_sense,
    draw_smallest_gap,
    frame,
    frame_gap,
)
from hydrolab.show.picture import Picture
from hydrolab.show.readings import along, branch_reading, first_along, orbit_reading, percent
from hydrolab.show.style import COLOURS, house_style, new_figure, plane


@house_style()
def orbit_picture(orbit: PeriodicOrbit) -> Picture:
    """The orbit of the rotor centre, seen from above: its shape, and where it lies in the gap."""
    path = orbit.positions(REVOLUTION)
    has_gap = math.isfinite(orbit.model.gap)
    figure = new_figure(12, 6) if has_gap else new_figure(7, 6)
    near, *far = figure.subplots(1, 2 if has_gap else 1, squeeze=False)[0]
    plane(near, f"Orbit at {percent(orbit.static_eccentricity)} static eccentricity")
    draw_orbit(near, path, COLOURS["rotor"], label="rotor centre", sense=False)
    draw_sense(near, path, COLOURS["rotor"], "Ωt = 0")
    near.plot(*(MM * orbit.mean), "+", color=COLOURS["mean"], markersize=10, markeredgewidth=1.6, label="mean")
    frame(near, path, 0.25)
    near.legend(loc="upper right")
    for axes in far:
        plane(axes, "Where it lies in the gap")
        draw_gap(axes, orbit.centre, orbit.model.gap)
        draw_orbit(axes, path, COLOURS["rotor"], sense=False)
        draw_smallest_gap(axes, orbit)
        frame_gap(axes, orbit.centre, orbit.model.gap)
    if not far:
        draw_axis(near)
    return Picture(figure, orbit_reading(orbit))


@house_style()
def branch_picture(branch: Branch, stability: Sequence[Floquet] | None = None) -> Picture:
    """A branch over the static eccentricity: the mean and 1X, both along the eccentricity, with folds.

    stability: of each of its points, as `branch_stability` gives it; without it nothing is said about stability.
    """
    figure = new_figure(12, 5.5)
    left, right = figure.subplots(1, 2, sharex=True)
    draw_branch(left, branch, lambda c: along(branch, c)[:, 0], stability)
    draw_branch(right, branch, lambda c: first_along(branch, c), stability)
    left.set_ylabel("mean displacement, µm")
    right.set_ylabel("1X amplitude, µm (0-to-peak)")
    left.legend(loc="lower left")
    figure.supxlabel("static eccentricity, % of the gap")
    figure.suptitle("Steady states, along the eccentricity")
    left.set_xlim(left=min(0.0, 100 * float(np.min(branch.static_eccentricity))))
    right.set_ylim(bottom=0)
    return Picture(figure, branch_reading(branch, stability))
