"""The whole rotor from the side, bent, with its orbits, and the parts that hold it.

Seen from the side and from above: x is to the right, the depth y points down, and z points away
from the reader, which an orthographic view from above turns into up. Displacements are exaggerated,
by the same factor everywhere.

factor: that factor. path: (2, …), m.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.harmonics import synthesise
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput
from hydrolab.figures.drawing import MM, REVOLUTION, UM
from hydrolab.figures.picture import Picture
from hydrolab.figures.readings import listed, microns
from hydrolab.figures.style import COLOURS, house_style, new_figure
from hydrolab.machine.parts import Machine

ELEVATION = math.radians(38)  # of the eye above the plane of an orbit
DRAWN_SHARE = 0.25  # the largest displacement is drawn at most this share of the rotor's length
CLOSE = 0.03  # of the shaft's length: names nearer than this share a line


def rotor_stations(machine: Machine, orbit: PeriodicOrbit) -> tuple[NDArray, NDArray]:
    """Depths (m) and coefficients (m) of the shaft's nodes and, after them, of the bodies' centres.
    """
    nodes = range(len(orbit.model.depths))
    depths = [*orbit.model.depths, *(orbit.model.depths[b.node] + b.offset for b in machine.bodies)]
    return np.array(depths), np.array([*(orbit.node_coefficients(i) for i in nodes),
                                       *map(orbit.body_coefficients, machine.bodies)])


def exaggeration(paths: NDArray, length: float) -> float:
    """A round factor (1, 2 or 5 times a power of ten) that draws the largest displacement large but
    not too large. paths: m, (…, 2, N). length: of the rotor, m.
    """
    most = DRAWN_SHARE * length / float(np.hypot(*np.moveaxis(paths, -2, 0)).max())
    power = 10.0 ** math.floor(math.log10(most))
    return max(f * power for f in (1, 2, 5) if f * power <= most)


def on_page(path: NDArray, depth: NDArray | float, factor: float) -> tuple[NDArray, NDArray]:
    """Where points (x, z), m, at a depth are drawn: x in mm, and a depth in m that z lifts."""
    return MM * path[0], depth - factor * math.tan(ELEVATION) * path[1]


def supports(machine: Machine) -> list[tuple[float, str, str]]:
    """What holds or weakens the shaft, from the top: depth (m), name, and how it is drawn, "radial"
    for a bearing of any kind that holds it sideways, "across" for one against tilt, "crack", "load"
    for a force and "bow" for the middle of a bent stretch.
    """
    shaft = machine.shaft
    found = [(float(shaft.nodes[b.node]), b.name,
              "across" if b in machine.thrust_bearings else "radial") for b in machine.all_bearings]
    found += [(float(shaft.nodes[c.element:c.element + 2].mean()), c.name, "crack")
              for c in machine.cracks]
    if shaft is not None:
        found += [(float(shaft.nodes[p.node] + p.offset), p.name, "load") for p in machine.loads]
        found += [(float(shaft.nodes[[b.node, b.end_node]].mean()), b.name, "bow")
                  for b in machine.bows]
    return sorted(found)


def draw_bearings(axes: Axes, machine: Machine, half_width: float) -> None:
    """Radial bearings as wedges from both sides, thrust bearings as a bar across, cracks as a notch
    on the right, loads as an arrow to the right, bows as an arc; half_width in mm of the axes.
    """
    for depth, _, kind in supports(machine):
        if kind == "radial":
            for side, marker in ((-1, ">"), (1, "<")):
                axes.plot(side * half_width, depth, marker, color=COLOURS["bearing"],
                          markersize=14, zorder=1)
        elif kind == "across":
            axes.plot([-1.4 * half_width, 1.4 * half_width], [depth, depth], zorder=1,
                      color=COLOURS["bearing"], linewidth=6, solid_capstyle="butt")
        else:
            mark = {"crack": "", "load": ">", "bow": "$)$"}[kind]
            axes.plot([0, half_width], [depth, depth], color=COLOURS["unstable"], linewidth=2.5,
                      marker=mark, markevery=[1], markersize=9)


def name_parts(axes: Axes, machine: Machine) -> None:
    """The names of all parts on the right of a panel, at their depths; close ones share a line."""
    parts = [(depth, name) for depth, name, _ in supports(machine)]
    parts += [(machine.shaft.nodes[b.node] + b.offset, b.name) for b in machine.bodies]
    lines: list[tuple[float, str]] = []
    for y, name in sorted(parts):
        if lines and y - lines[-1][0] < CLOSE * machine.shaft.length:
            lines[-1] = (lines[-1][0], f"{lines[-1][1]}, {name}")
        else:
            lines.append((y, name))
    right = axes.secondary_yaxis("right")
    depths, names = zip(*lines, strict=True)
    # Matplotlib would read $…$ as a formula
    right.set_yticks(depths, [name.replace("$", r"\$") for name in names])
    right.spines["right"].set_visible(False)
    right.tick_params(length=0)


def draw_rotor(axes: Axes, machine: Machine, orbit: PeriodicOrbit, factor: float) -> None:
    """Draw the bent rotor: its axis without forces, its mean line, and every orbit with the rotor
    at Ωt = 0.

    Lines run along the shaft, and from a node to the centre of each body on a link.
    """
    depths, coefficients = rotor_stations(machine, orbit)
    nodes = len(orbit.model.depths)
    axes.plot([0, 0], [depths.min(), depths.max()], "-.", color=COLOURS["axis"], linewidth=1.2,
              label="bearing axis")
    for i, (depth, path) in enumerate(zip(depths, synthesise(coefficients, REVOLUTION),
                                          strict=True)):
        axes.plot(*on_page(path, depth, factor), color=COLOURS["rotor"],
                  linewidth=1.3 if i < nodes else 2.8)
    now, mean = synthesise(coefficients, [0.0])[:, :, 0].T, coefficients[:, :, 0].T
    lines = [range(nodes), *((b.node, nodes + i) for i, b in enumerate(machine.bodies) if b.offset)]
    for i, line in enumerate(lines):
        at = list(line)
        words = ("", "") if i else ("rotor at Ωt = 0, with its orbits", "mean line")
        axes.plot(*on_page(now[:, at], depths[at], factor), "o-", color=COLOURS["rotor"],
                  linewidth=1.3, markersize=4, label=words[0])
        axes.plot(*on_page(mean[:, at], depths[at], factor), color=COLOURS["mean"], linewidth=3,
                  label=words[1])


@house_style()
def line_picture(orbit: PeriodicOrbit, machine: Machine | None = None) -> Picture:
    """The static line of the shaft: its mean along x and z, the centres of the bearings it passes
    through and of the stator. machine: that of the orbit's card unless given.

    Raises BadInput for a machine without a shaft, and for a model made by hand.
    """
    machine = machine or (orbit.model.origin and orbit.model.origin.machine)
    if machine is None or machine.shaft is None:
        raise BadInput("the line of a shaft needs a machine with a shaft; give line_picture(orbit, "
                       "machine).")
    depths, coefficients = rotor_stations(machine, orbit)
    lying, nodes = machine.gravity is not None, len(orbit.model.depths)
    figure = new_figure(12, 6)
    panels = figure.subplots(2, 1, sharex=True) if lying else figure.subplots(1, 2, sharey=True)
    for i, (axes, name) in enumerate(zip(panels, "xz", strict=True)):
        def put(depth: ArrayLike, away: ArrayLike, *look: str, axes: Axes = axes,
                **more: Any) -> None:
            axes.plot(*((depth, away) if lying else (away, depth)), *look, **more)

        put(depths[[0, nodes - 1]], [0, 0], "-.", color=COLOURS["axis"], linewidth=1.2)
        put(depths[:nodes], UM * coefficients[:nodes, i, 0], color=COLOURS["mean"], linewidth=3,
            label="mean line")
        put(depths[nodes:], UM * coefficients[nodes:, i, 0], "o", color=COLOURS["rotor"],
            label="bodies")
        for bearing in machine.all_bearings:
            if bearing.name in orbit.model.supports:
                put(depths[bearing.node], UM * orbit.model.supports[bearing.name].offset[i], "s",
                    color=COLOURS["bearing"], markersize=10, label="bearing centres")
        if machine.air_gap:
            at = nodes + [body.name for body in machine.bodies].index(machine.air_gap.body)
            put(depths[at], UM * orbit.centre[i], "x", color=COLOURS["stator"], markersize=10,
                markeredgewidth=2.5, label="stator's middle")
        words = (axes.set_xlabel, axes.set_ylabel)
        words[lying](f"{name}, µm")
        if i == 0:
            words[not lying]("" if lying else "depth y, m")
    if lying:
        panels[1].set_xlabel("along the shaft, m")
    else:
        panels[0].invert_yaxis()
    handles, names = panels[0].get_legend_handles_labels()
    kept = dict(zip(names, handles, strict=True))
    panels[0].legend(kept.values(), kept.keys())
    figure.suptitle("Static line of the shaft")
    return Picture(figure, line_reading(orbit))


def line_reading(orbit: PeriodicOrbit) -> str:
    """Where the mean line passes each radial bearing and the stator's middle."""
    shaft, said = orbit.shaft[:, 0], []
    for name, force in orbit.bearing_forces.items():
        support = orbit.model.supports[name]
        away = float(np.hypot(*(support.rows @ shaft - support.offset)))
        said.append(f"{name} {microns(away)} from its centre, which carries "
                    f"{1e-3 * np.hypot(*force.static):.4g} kN")
    gap = (f"; the rotor stands {microns(float(np.hypot(*(orbit.mean - orbit.centre))))} from the "
           "stator's middle" if math.isfinite(orbit.model.gap) else "")
    return f"The mean line of the shaft passes {listed(said)}{gap}."


def draw_z(axes: Axes, x: float, depth: float, factor: float, largest: float) -> None:
    """An arrow of a round length along z; x in mm, depth and the largest displacement in m."""
    length = 10.0 ** math.floor(math.log10(largest))
    (start, end), (low, high) = on_page(np.array([[x / MM, x / MM], [0.0, length]]), depth, factor)
    axes.annotate("", xy=(end, high), xytext=(start, low),
                  arrowprops={"arrowstyle": "-|>", "color": COLOURS["axis"], "shrinkA": 0,
                              "shrinkB": 0, "linewidth": 1.6})
    axes.annotate(f"z: {MM * length:g} mm", (end, high), xytext=(0, 5), ha="center", fontsize=12,
                  textcoords="offset points", color=COLOURS["axis"])
