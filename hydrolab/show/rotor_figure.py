"""Figure 7 of the paper: the whole rotor under the pull, bent, with the orbit of every node.

Seen from the side and from above: x is to the right, the depth y points down, and z points away from the reader,
which an orthographic view from above turns into up. Displacements are exaggerated, by the same factor everywhere.
"""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.machine.model import rigid_link
from hydrolab.machine.parts import Machine
from hydrolab.show.drawing import MM, REVOLUTION, draw_axis, draw_orbit, frame
from hydrolab.show.picture import Picture
from hydrolab.show.study_readings import ROTOR, StudyResult, figure_7_reading, quoted
from hydrolab.show.style import COLOURS, house_style, new_figure, plane

ELEVATION = math.radians(38)  # of the eye above the plane of an orbit
BESIDE, ABOVE = 3.6, 2.1  # inches that names, titles, labels and legend take beside and above the four panels
DRAWN_SHARE = 0.25  # the largest displacement is drawn at most this share of the rotor's length


def body_coefficients(machine: Machine, orbit: PeriodicOrbit, name: str) -> NDArray:
    """[mean, sin 1, cos 1, …] of x and z at the centre of a body, through its rigid link, m, shape (2, 2m + 1)."""
    body = machine.body(name)
    dofs = orbit.model.shaft_map @ orbit.shaft
    per_node = len(dofs) // len(orbit.model.depths)
    node = dofs[per_node * body.node:per_node * (body.node + 1)]
    return (rigid_link(body.offset)[:2, :per_node] if per_node == 4 else np.eye(2)) @ node


def path_of(coefficients: NDArray, phase: NDArray = REVOLUTION) -> NDArray:
    """Positions (x, z) at the phases Ωt from [mean, sin 1, cos 1, …], m, shape (2, len(phase))."""
    k = np.arange(1, coefficients.shape[1] // 2 + 1)[:, None]
    return coefficients[:, :1] + coefficients[:, 1::2] @ np.sin(k * phase) + coefficients[:, 2::2] @ np.cos(k * phase)


def rotor_stations(machine: Machine, orbit: PeriodicOrbit) -> tuple[NDArray, NDArray]:
    """Depths (m) and coefficients (m) of the shaft's nodes and, after them, of the bodies' centres."""
    depths = [*orbit.model.depths, *(orbit.model.depths[b.node] + b.offset for b in machine.bodies)]
    nodes = [orbit.node_coefficients(i) for i in range(len(orbit.model.depths))]
    return np.array(depths), np.array(nodes + [body_coefficients(machine, orbit, b.name) for b in machine.bodies])


def exaggeration(paths: NDArray, length: float) -> float:
    """A round factor (1, 2 or 5 times a power of ten) that draws the largest displacement large but not too large."""
    most = DRAWN_SHARE * length / float(np.hypot(*np.moveaxis(paths, -2, 0)).max())
    power = 10.0 ** math.floor(math.log10(most))
    return max(f * power for f in (1, 2, 5) if f * power <= most)


def on_page(path: NDArray, depth: NDArray | float, factor: float) -> tuple[NDArray, NDArray]:
    """Where points (x, z), m, at a depth are drawn: x in mm, and a depth in m that z lifts."""
    return MM * path[0], depth - factor * math.tan(ELEVATION) * path[1]


def draw_bearings(axes: Axes, machine: Machine, half_width: float) -> None:
    """Radial bearings as wedges from both sides, thrust bearings as a bar across; half_width in mm of the axes."""
    nodes = machine.shaft.nodes
    for bearing in machine.bearings:
        for side, marker in ((-1, ">"), (1, "<")):
            axes.plot(side * half_width, nodes[bearing.node], marker, color=COLOURS["bearing"], markersize=14, zorder=1)
    for bearing in machine.thrust_bearings:
        axes.plot([-1.4 * half_width, 1.4 * half_width], [nodes[bearing.node]] * 2, color=COLOURS["bearing"],
                  linewidth=6, solid_capstyle="butt", zorder=1)


def name_parts(axes: Axes, machine: Machine) -> None:
    """The names of bodies and bearings on the right side of a panel, at their depths; close ones share a line."""
    nodes = machine.shaft.nodes
    parts = [(nodes[b.node], b.name) for b in (*machine.bearings, *machine.thrust_bearings)]
    parts += [(nodes[b.node] + b.offset, b.name) for b in machine.bodies]
    lines: list[tuple[float, str]] = []
    for y, name in sorted(parts):
        if lines and y - lines[-1][0] < 0.03 * machine.shaft.length:
            lines[-1] = (lines[-1][0], f"{lines[-1][1]}, {name}")
        else:
            lines.append((y, name))
    right = axes.secondary_yaxis("right")
    depths, names = zip(*lines, strict=True)
    right.set_yticks(depths, [name.replace("$", r"\$") for name in names])  # Matplotlib would read $…$ as a formula
    right.spines["right"].set_visible(False)
    right.tick_params(length=0)


def draw_rotor(axes: Axes, machine: Machine, orbit: PeriodicOrbit, factor: float) -> None:
    """Draw the bent rotor: its axis without forces, its mean line, and every orbit with the rotor at Ωt = 0.

    Lines run along the shaft, and from a node to the centre of each body on a link.
    """
    depths, coefficients = rotor_stations(machine, orbit)
    nodes = len(orbit.model.depths)
    axes.plot([0, 0], [depths.min(), depths.max()], "-.", color=COLOURS["axis"], linewidth=1.2, label="bearing axis")
    for i, (depth, c) in enumerate(zip(depths, coefficients, strict=True)):
        axes.plot(*on_page(path_of(c), depth, factor), color=COLOURS["rotor"], linewidth=1.3 if i < nodes else 2.8)
    now = np.array([path_of(c, np.zeros(1))[:, 0] for c in coefficients]).T
    lines = [range(nodes), *((b.node, nodes + i) for i, b in enumerate(machine.bodies) if b.offset)]
    for i, line in enumerate(lines):
        at = list(line)
        words = ("rotor at Ωt = 0, with its orbits", "mean line") if i == 0 else ("", "")
        axes.plot(*on_page(now[:, at], depths[at], factor), "o-", color=COLOURS["rotor"], linewidth=1.3, markersize=4,
                  label=words[0])
        axes.plot(*on_page(coefficients[at, :, 0].T, depths[at], factor), color=COLOURS["mean"], linewidth=3,
                  label=words[1])


def draw_z(axes: Axes, x: float, depth: float, factor: float, largest: float) -> None:
    """An arrow along z, away from the reader, of a round length; x in mm, depth and the largest displacement in m."""
    length = 10.0 ** math.floor(math.log10(largest))
    tail = np.array([[x / MM], [0.0]])
    start, end = (on_page(tail + [[0.0], [z]], depth, factor) for z in (0.0, length))
    axes.annotate("", xy=(end[0][0], end[1][0]), xytext=(start[0][0], start[1][0]),
                  arrowprops={"arrowstyle": "-|>", "color": COLOURS["axis"], "shrinkA": 0, "shrinkB": 0,
                              "linewidth": 1.6})
    axes.annotate(f"z: {MM * length:g} mm", (end[0][0], end[1][0]), xytext=(0, 5), textcoords="offset points",
                  ha="center", fontsize=12, color=COLOURS["axis"])


@house_style()
def figure_7(study: StudyResult) -> Picture:
    """The rotor at 1, 5, 7 and 8.9 %, bent, with the orbits of all nodes; a machine without a shaft: its orbits."""
    if study.machine.shaft is None:
        return orbits_only(study)
    stations = [rotor_stations(study.machine, study.orbits[p]) for p in ROTOR]
    paths = np.array([[path_of(c) for c in coefficients] for _, coefficients in stations])
    depths = stations[0][0]
    length = float(np.ptp(depths))
    factor = exaggeration(paths, length)
    x, y = on_page(np.moveaxis(paths, -2, 0), depths[:, None], factor)
    half_width = 0.03 * MM * length / factor
    left, right = min(x.min(), -2 * half_width) - half_width, max(x.max(), 2 * half_width) + half_width
    top, bottom = y.min() - 0.04 * length, y.max() + 0.04 * length
    slender = (right - left) * factor / MM / ((bottom - top) * math.cos(ELEVATION))  # width over height of a panel
    height = min(6.0, (14.0 - BESIDE) / (4 * slender))
    figure = new_figure(4 * slender * height + BESIDE, height + ABOVE)
    panels = figure.subplots(1, 4, sharex=True, sharey=True)
    for axes, p in zip(panels, ROTOR, strict=True):
        axes.set_xlim(left, right)
        axes.set_ylim(bottom, top)
        axes.set_aspect(math.cos(ELEVATION) * MM / factor, adjustable="box")
        axes.set_title(f"{quoted(study, p)} eccentricity")
        axes.grid(axis="y", visible=False)
        draw_bearings(axes, study.machine, half_width)
        draw_rotor(axes, study.machine, study.orbits[p], factor)
        axes.set_xlabel("x, mm")
    panels[0].set_ylabel("depth y, m (down)")
    draw_z(panels[0], left + 0.22 * (right - left), bottom - 0.2 * length, factor, float(np.abs(paths).max()))
    name_parts(panels[-1], study.machine)
    figure.suptitle(f"The rotor, seen from the side and above; displacements drawn {factor:.0f} times as large")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return Picture(figure, figure_7_reading(study))


def orbits_only(study: StudyResult) -> Picture:
    """Figure 7 of a machine that is one point: its orbits at the same eccentricities, on one scale."""
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
    return Picture(figure, figure_7_reading(study))
