"""A section through any machine, to scale, lying where its shaft lies.

The generator's rotor has the size of its air gap; any other body is the solid cylinder of its mass
and moments of inertia. Stators, bearings and marks have no size on a card: theirs is a sign.

depths, ends: along the axis, m. away: from it, m. parts: names and where they are. thick, reach:
lengths of the drawing, m. colour, alpha: of a part. machine: what is drawn. draw: it.
"""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from hydrolab.figures.picture import Picture
from hydrolab.figures.readings import listed
from hydrolab.figures.rotor import supports
from hydrolab.figures.style import COLOURS, house_style, new_figure
from hydrolab.machine.parts import Machine, RigidBody

STUB = 1.0  # m of shaft drawn above and below a point mass
LEVELS = 3  # of names above a shaft that lies
SIGNS = {"load": "▶", "bow": ")", "crack": "✕"}


class Drawn:
    """Axes on which things are placed along and away from the axis of the rotor; they lie down with
    it.
    """

    def __init__(self, axes: Axes, lying: bool) -> None:
        self.axes, self.lying = axes, lying

    def at(self, depths: ArrayLike, away: ArrayLike) -> tuple[ArrayLike, ArrayLike]:
        """Places on the page."""
        return (depths, away) if self.lying else (away, depths)

    def box(self, depths: tuple[float, float], away: tuple[float, float], colour: str,
            alpha: float = 1.0) -> None:
        """A rectangle between two depths, on both sides of the axis between two distances."""
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


def draw_shaft(draw: Drawn, machine: Machine) -> tuple[float, float]:
    """The shaft with its steps, tapers and bore; returns its ends, m."""
    shaft = machine.shaft
    if shaft is None:
        draw.box((-STUB, STUB), (0.0, 0.02 * STUB), "axis", 0.45)
        return -STUB, STUB
    lower = np.where(shaft.lower_diameter, shaft.lower_diameter, shaft.diameter)
    depths = np.repeat(shaft.nodes, 2)[1:-1]
    edge = np.column_stack([shaft.diameter, lower]).ravel() / 2
    bore = np.repeat(shaft.inner_diameter, 2) / 2
    for side in (-1, 1):
        if draw.lying:
            draw.axes.fill_between(depths, side * bore, side * edge, color=COLOURS["axis"],
                                   alpha=0.45, linewidth=0)
        else:
            draw.axes.fill_betweenx(depths, side * bore, side * edge, color=COLOURS["axis"],
                                    alpha=0.45, linewidth=0)
    return 0.0, shaft.length


def draw_bodies(draw: Drawn, machine: Machine, thick: float) -> list[tuple[float, float, str]]:
    """Bodies, and the stator around the generator's rotor; returns depth, outer edge, m, and name
    of each.
    """
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


def draw_supports(draw: Drawn, machine: Machine, thick: float) -> list[tuple[float, float, str]]:
    """Bearings, cracks, loads and bows as signs; returns depth, outer edge, m, and name of each."""
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


def name_beside(draw: Drawn, parts: list[tuple[float, float, str]], ends: tuple[float, float],
                reach: float) -> None:
    """Names with lines to what they name: in a column beside a shaft that stands, above one that
    lies.
    """
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
    """A section through a machine, to scale, with its bodies, bearings, loads and faults named."""
    lying = machine.gravity is not None
    figure = new_figure(*((12, 5) if lying else (10, 6.5)))
    draw = Drawn(figure.subplots(), lying)
    low, high = draw_shaft(draw, machine)
    thick = 0.03 * (high - low)
    bodies = draw_bodies(draw, machine, thick)
    parts = bodies + draw_supports(draw, machine, thick)
    reach = max(edge for _, edge, _ in parts)
    low, high = min([low, *(y for y, *_ in parts)]), max([high, *(y for y, *_ in parts)])
    draw.axes.plot(*draw.at([low - thick, high + thick], [0, 0]), "-.", color=COLOURS["axis"],
                   linewidth=1.2)
    name_beside(draw, parts, (low, high), reach)
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
