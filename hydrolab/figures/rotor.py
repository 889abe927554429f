"""The whole rotor from the side, bent, with its orbits, and the parts that hold it.

Seen from the side and from above: x is to the right, the depth y points down, and z points away
from the reader, which an orthographic view from above turns into up. Displacements are exaggerated,
by the same factor everywhere. A section is to scale, and lies where the shaft lies.

factor: that factor. path: (2, …), m.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.harmonics import synthesise
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput
from hydrolab.figures.drawing import MM, REVOLUTION, UM
from hydrolab.figures.picture import Picture
from hydrolab.figures.readings import listed, microns
from hydrolab.figures.style import COLOURS, house_style, new_figure
from hydrolab.machine.parts import Machine, RigidBody

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


# ------------------------------------------------------------------ a section, to scale

STUB = 1.0  # m of shaft drawn above and below a point mass
LEVELS = 3  # of names above a shaft that lies
SIGNS = {"load": "▶", "bow": ")", "crack": "✕"}


class _Section:
    """Axes on which things are placed along and away from the rotor's axis, and lie with it."""

    def __init__(self, axes: Axes, lying: bool) -> None:
        self.axes, self.lying = axes, lying

    def at(self, depths: ArrayLike, away: ArrayLike) -> tuple[ArrayLike, ArrayLike]:
        return (depths, away) if self.lying else (away, depths)

    def box(self, depths: tuple[float, float], away: tuple[float, float], colour: str,
            alpha: float = 1.0) -> None:
        """A rectangle between two depths, on both sides of the axis."""
        tall, wide = depths[1] - depths[0], away[1] - away[0]
        for left in (away[0], -away[1]):
            corner = self.at(depths[0], left)
            self.axes.add_patch(Rectangle(corner, *self.at(tall, wide), color=COLOURS[colour],
                                          alpha=alpha, linewidth=0))


def cylinder(body: RigidBody) -> tuple[float, float]:
    """Radius and height, m, of the solid cylinder with the mass and moments of inertia of a body, 0
    where none is stated: Ip = m r²/2, Id = m (r²/4 + h²/12).
    """
    flat = 12 * (body.Id - body.Ip / 2) / body.mass
    return math.sqrt(2) * body.gyration, math.sqrt(max(flat, 0.0))


def _draw_shaft(draw: _Section, machine: Machine) -> tuple[float, float]:
    """The shaft with its steps, tapers and bore; its ends, m."""
    shaft = machine.shaft
    if shaft is None:
        draw.box((-STUB, STUB), (0.0, 0.02 * STUB), "axis", 0.45)
        return -STUB, STUB
    lower = np.where(shaft.lower_diameter, shaft.lower_diameter, shaft.diameter)
    depths = np.repeat(shaft.nodes, 2)[1:-1]
    edge = np.column_stack([shaft.diameter, lower]).ravel() / 2
    bore = np.repeat(shaft.inner_diameter, 2) / 2
    fill = draw.axes.fill_between if draw.lying else draw.axes.fill_betweenx
    for side in (-1, 1):
        fill(depths, side * bore, side * edge, color=COLOURS["axis"], alpha=0.45, linewidth=0)
    return 0.0, shaft.length


def _draw_bodies(draw: _Section, machine: Machine, thick: float) -> list[tuple[float, float, str]]:
    """Bodies, and the stator around the generator's rotor; depth, outer edge and name of each."""
    air, parts = machine.air_gap, []
    for body in machine.bodies:
        y = body.offset + (float(machine.shaft.nodes[body.node]) if machine.shaft else 0.0)
        turns = air is not None and air.body == body.name
        radius, tall = (air.mean_radius - air.gap / 2, air.length) if turns else cylinder(body)
        radius, tall = radius or 2 * thick, tall or 0.5 * thick
        draw.box((y - tall / 2, y + tall / 2), (0.0, radius), "rotor", 0.75)
        if turns:
            bore = max(air.mean_radius + air.gap / 2, 1.01 * radius)
            draw.box((y - tall / 2, y + tall / 2), (bore, 1.15 * bore), "stator")
            radius = 1.15 * bore
        mass = f"{body.mass / 1e3:.4g} t" if body.mass > 1e3 else f"{body.mass:.4g} kg"
        parts.append((y, radius, f"{body.name}, {mass}"))
    return parts


def _draw_supports(draw: _Section, machine: Machine,
                   thick: float) -> list[tuple[float, float, str]]:
    """Bearings, cracks, loads and bows as signs; depth, outer edge and name of each."""
    parts = []
    found = supports(machine) if machine.shaft else [(0.0, b.name, "radial")
                                                     for b in machine.all_bearings]
    for y, name, kind in found:
        half = (machine.shaft.thickness(int(np.argmin(np.abs(machine.shaft.nodes - y)))) / 2
                if machine.shaft else 0.02 * STUB)
        if kind in SIGNS:
            draw.axes.plot(*draw.at([y], [half + thick]), marker=f"${SIGNS[kind]}$", markersize=11,
                           color=COLOURS["unstable"])
        elif kind == "across":
            draw.box((y - 0.3 * thick, y), (0.0, half + 1.4 * thick), "axis", 0.8)
            draw.box((y, y + 0.4 * thick), (half + 0.2 * thick, half + 1.4 * thick), "bearing")
        else:
            draw.box((y - 0.4 * thick, y + 0.4 * thick), (half, half + thick), "bearing")
        parts.append((y, half + thick, name))
    return parts


def _name_beside(draw: _Section, parts: list[tuple[float, float, str]], ends: tuple[float, float],
                reach: float) -> None:
    """Names with lines to what they name, beside a shaft that stands or above one that lies."""
    parts, places = sorted(parts), np.linspace(*ends, len(parts) + 2)[1:-1]
    for i, ((depth, edge, name), place) in enumerate(zip(parts, places, strict=True)):
        far = reach * (1.15 + 0.16 * (LEVELS - 1 - i % LEVELS) if draw.lying else 1.15)
        draw.axes.plot(*draw.at([depth, place], [edge, far]), color=COLOURS["axis"], linewidth=0.8)
        text = name.replace("$", r"\$")  # Matplotlib would read $…$ as a formula
        draw.axes.annotate(f" {text} ", draw.at(place, far), fontsize=12,
                           ha="center" if draw.lying else "left",
                           va="bottom" if draw.lying else "center")


@house_style()
def unit_picture(machine: Machine) -> Picture:
    """A section through any machine, to scale, with its parts named.

    The generator's rotor has the size of its air gap; any other body is the solid cylinder of its
    mass and moments of inertia. Stators, bearings and marks have no size on a card: a sign.
    """
    lying = machine.gravity is not None
    figure = new_figure(*((12, 5) if lying else (10, 6.5)))
    draw = _Section(figure.subplots(), lying)
    low, high = _draw_shaft(draw, machine)
    thick = 0.03 * (high - low)
    bodies = _draw_bodies(draw, machine, thick)
    parts = bodies + _draw_supports(draw, machine, thick)
    reach = max(edge for _, edge, _ in parts)
    low, high = min([low, *(y for y, *_ in parts)]), max([high, *(y for y, *_ in parts)])
    draw.axes.plot(*draw.at([low - thick, high + thick], [0, 0]), "-.", color=COLOURS["axis"],
                   linewidth=1.2)
    _name_beside(draw, parts, (low, high), reach)
    draw.axes.set_aspect("equal")
    draw.axes.grid(visible=False)
    if lying:
        draw.axes.set(xlabel="along the shaft, m", ylabel="z, m")
    else:
        draw.axes.invert_yaxis()
        draw.axes.set(ylabel="depth y, m", xlim=(-1.1 * reach, 1.15 * reach + 0.75 * (high - low)))
        draw.axes.set_xticks([])
        draw.axes.spines["bottom"].set_visible(False)
    whole = (f"a shaft of {machine.shaft.length:.4g} m, up to "
             f"{1e3 * machine.shaft.diameter.max():.4g} mm thick, " if machine.shaft else "")
    named = listed(f"{name} at {y:.4g} m" for y, _, name in sorted(parts))
    return Picture(figure, f"Section through {machine.name}, to scale: {whole}{named}.")
