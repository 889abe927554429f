"""What stands around the 3D machine: floor, axis, lights, views, names, and the orbit in its gap
circle as an inset.

Here aspect: width over height. path: of a node in the scene. lines, colours: of segments.
thickness: in pixels. dark: whether the page is. gap, factor: drawn over real. slow_motion, shown:
what the scene is set to.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from viser import ViserServer

from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.figures.style import COLOURS
from hydrolab.live import solids
from hydrolab.live.bodies import AZIMUTH, LEFT, Sizes, bearing_places, drawn_radius, rgb
from hydrolab.live.moving_orbit import gap_words
from hydrolab.machine.parts import Machine

INSET = 1.9  # units of the drawing: radius of the gap circle in the inset
# vertical field of view: a longer lens than a page's usual 75 degrees bends the machine less
LENS = math.radians(36)
# units of the drawing: height of a name's letters, so that words and machine keep their places at
# any size
LETTERS = 0.3
RISE = 0.44  # rad; how far above the horizon the first view stands
ASPECT = 1.3  # width over height of the picture that the views fill

Point = tuple[float, float, float]


def inset_place(sizes: Sizes) -> NDArray:
    """Centre of the inset, m: to the left in the first view, under the stator where there is room,
    beside it where not.
    """
    rise = (INSET + 1.4) * sizes.unit
    tucked = sizes.bottom + rise + (INSET + 1.2) * sizes.unit < sizes.top - 2 * sizes.height
    aside = (INSET + 1.0) * sizes.unit + (0.62 if tucked else 1.2) * sizes.stator
    return aside * LEFT + [0.0, 0.0, sizes.bottom + rise]


def views_of(sizes: Sizes) -> dict[str, tuple[Point, Point]]:
    """Camera position and the point it looks at, for each view: the machine, the air gap from
    above, the lower end.
    """
    u, height = sizes.unit, sizes.top - sizes.bottom + 2.4 * sizes.unit
    distance = max(0.5 * height, 1.6 * sizes.stator) / math.tan(LENS / 2) * 1.2

    def seen(away: float, rise: float, at: float, aside: float = 0.0) -> tuple[Point, Point]:
        centre = np.array([0.0, 0.0, at]) - aside * LEFT
        return tuple((centre + away * towards_view(rise)).tolist()), tuple(centre.tolist())

    return {"machine": seen(distance, RISE, 0.5 * (sizes.top + sizes.bottom) + 0.05 * u, 0.3 * u),
            "air gap": seen(0.66 * distance + u, 0.85, sizes.middle - 0.8 * u, 0.5 * u),
            "lower end": seen(0.42 * distance + u, 0.35, sizes.bottom + 1.2 * u, 0.4 * u)}


def fitted(view: tuple[Point, Point], aspect: float) -> tuple[Point, Point]:
    """A view from so far away that a picture of this width over height, as on a telephone, shows
    all of it too.
    """
    position, target = np.array(view)
    return tuple((target + max(1.0, ASPECT / aspect) * (position - target)).tolist()), view[1]


def towards_view(rise: float) -> NDArray:
    """Unit vector towards the first view's side, at an angle above the horizon, rad."""
    return np.array([math.cos(rise) * math.cos(AZIMUTH), math.cos(rise) * math.sin(AZIMUTH),
                     math.sin(rise)])


def add_lines(server: ViserServer, path: str, lines: NDArray, colours: Any,
              thickness: float) -> None:
    """Line segments, (N, 2, 3) m, so many pixels thick."""
    server.scene.add_line_segments(path, lines.astype(np.float32), colours, thickness=thickness,
                                   thickness_units="screen")


def add_surroundings(server: ViserServer, sizes: Sizes, dark: bool) -> None:
    """Floor, axis and lights; no environment map, which flashes white where a recording loops."""
    scene, u = server.scene, sizes.unit
    scene.set_up_direction("+z")
    scene.configure_environment_map(None)
    scene.configure_default_lights(False)
    scene.add_light_ambient("/lights/ambient", intensity=0.7 if dark else 0.9)
    scene.add_light_hemisphere("/lights/sky", sky_color=(255, 255, 255),
                               ground_color=(170, 175, 190), intensity=0.9)
    scene.add_light_directional("/lights/sun", intensity=2.1, cast_shadow=True,
                                position=(5.0 * math.cos(AZIMUTH + 0.9),
                                          5.0 * math.sin(AZIMUTH + 0.9), 12.0))
    plane, cells, sections = (((40, 43, 50), (62, 66, 74), (84, 90, 100)) if dark else
                              ((244, 246, 248), (226, 230, 235), (202, 208, 215)))
    scene.add_grid("/floor", 30.0 * u, 30.0 * u, cell_size=u, section_size=5.0 * u,
                   cell_color=cells, section_color=sections, plane_color=plane, plane_opacity=1.0,
                   position=(0.0, 0.0, sizes.bottom - 1.2 * u), shadow_opacity=0.16,
                   fade_distance=46.0 * u, fade_strength=2.0)
    z = np.arange(sizes.bottom - 1.1 * u, sizes.top + 1.9 * u, 0.3 * u)
    dashes = np.zeros((len(z), 2, 3))
    dashes[:, 0, 2], dashes[:, 1, 2] = z, z + 0.17 * u
    add_lines(server, "/axis", dashes, (190, 190, 190) if dark else (64, 64, 64), 2.0)


@dataclass(frozen=True, eq=False)
class Inset:
    """The gap circle of `radius` m seen from above, x to the right and z up, with the orbit and a
    dot that moves on it.
    """

    server: ViserServer
    gap: float
    radius: float
    dot: Any

    def dress(self, dark: bool) -> None:
        """The plate and the stator's bore on it, light or dark."""
        plain = {"side": "double", "cast_shadow": False, "receive_shadow": False}
        plate, bore = ((52, 57, 66), (150, 162, 178)) if dark else ((250, 251, 253), (34, 48, 68))
        r, add = self.radius, self.server.scene.add_mesh_simple
        add("/inset/plate", *solids.ring(0.001 * r, r, -0.016 * r, -0.005 * r, steps=96),
            color=plate, opacity=0.92, **plain)
        add("/inset/bore", *solids.ring(r, 1.07 * r, -0.03 * r, 0.02 * r, steps=96), color=bore,
            flat_shading=True, **plain)
        cross = 0.06 * r * np.array([[[-1, 0, 0], [1, 0, 0]], [[0, -1, 0], [0, 1, 0]]])
        add_lines(self.server, "/inset/centre", cross, bore, 2.0)

    def draw(self, orbit: PeriodicOrbit, verdict: str) -> None:
        """Draw an orbit in the circle, in the colour of its verdict."""
        path = self.place(orbit.positions(2 * np.pi * np.arange(193) / 192) - orbit.centre[:, None])
        add_lines(self.server, "/inset/orbit", np.stack([path[:-1], path[1:]], axis=1),
                  rgb(COLOURS[verdict]), 5.0)

    def place(self, eccentricity: NDArray) -> NDArray:
        """Points of the inset for the rotor's place from the stator's centre, (2,) or (2, P), m."""
        height = np.full(np.shape(eccentricity)[1:], 0.015 * self.radius)
        return np.stack([*(eccentricity * self.radius / self.gap), height], axis=-1)


def add_inset(server: ViserServer, sizes: Sizes, gap: float) -> Inset:
    """The inset, facing the first view; nothing of it but the dot moves."""
    radius, right, facing = INSET * sizes.unit, -LEFT, towards_view(RISE)
    turn = np.column_stack([right, np.cross(facing, right), facing])
    server.scene.add_frame("/inset", show_axes=False, position=inset_place(sizes),
                           wxyz=np.roll(Rotation.from_matrix(turn).as_quat(), 1))
    dot = server.scene.add_icosphere("/inset/dot", 0.045 * radius, color=rgb(COLOURS["unstable"]),
                                     cast_shadow=False)
    return Inset(server, gap, radius, dot)


@dataclass(eq=False)
class Names:
    """The labels: names that can be switched off, the smallest gap, and the scale of the drawing.
    """

    names: list[Any]
    gap: Any
    scale: Any

    def say(self, orbit: PeriodicOrbit, factor: float, slow_motion: float, shown: bool) -> None:
        """Bring the words up to date."""
        self.scale.text = (f"displacements{' and gap' if self.gap else ''} × {factor:.0f}, "
                           f"{slow_motion:.3g} times slower")
        if self.gap is not None:
            self.gap.text = f"smallest gap {gap_words(orbit)}"
        for label in self.names:
            label.visible = shown


def places_to_name(machine: Machine, sizes: Sizes,
                   depths: NDArray) -> Iterator[tuple[str, NDArray]]:
    """The name of every part beside it, m; parts at one height share a line.

    depths: of the bodies and then the cracks as drawn, m.
    """
    gap, u = machine.air_gap, sizes.unit
    for body, depth in zip(machine.bodies, depths, strict=False):
        outer = (1.24 * sizes.stator if gap and body.name == gap.body
                 else 1.1 * drawn_radius(machine, body) + 0.2 * u)
        yield body.name, outer * -LEFT + [0, 0, -depth]
    heights = bearing_places(machine, sizes.shaft) | {
        crack.name: -depth
        for crack, depth in zip(machine.cracks, depths[len(machine.bodies):], strict=True)}
    rows = sorted(heights, key=heights.get)
    for _, together in groupby(rows, key=lambda name: round(heights[name] / (LETTERS * u))):
        words = [*together]
        yield ", ".join(words), 5.4 * sizes.shaft * -LEFT + [0, 0, heights[words[0]]]


def add_names(server: ViserServer, machine: Machine, sizes: Sizes, depths: NDArray) -> Names:
    """Names of the parts to their right, the smallest gap above the inset, the scale at the foot.

    depths: as in `places_to_name`.
    """
    gap, names, u = machine.air_gap, [], sizes.unit

    def label(path: str, text: str, place: NDArray, scale: float,
              anchor: str = "center-left") -> Any:
        return server.scene.add_label(path, text, position=tuple(place.tolist()), anchor=anchor,
                                      font_size_mode="scene", font_scene_height=LETTERS * scale * u)

    def name(text: str, place: NDArray, anchor: str = "center-left") -> None:
        names.append(label(f"/names/{text}", text, place, 1.0, anchor))

    for text, place in places_to_name(machine, sizes, depths):
        name(text, place)
    scale = label("/scale", "", np.array([0.0, 0.0, sizes.bottom - 2.1 * u]), 1.0, "top-center")
    if gap is None:
        return Names(names, None, scale)
    inset = inset_place(sizes)
    middle = sizes.middle
    name("stator, cut away", LEFT * 1.22 * sizes.stator + [0, 0, middle - 0.25 * u], "center-right")
    name("arrow: magnetic pull", -LEFT * 0.35 * u + [0, 0, middle + 0.78 * gap.length + 0.3 * u])
    name(f"orbit in its gap of {1e3 * gap.gap:.3g} mm", inset - [0, 0, (1.1 * INSET + 0.3) * u],
         "top-center")
    return Names(names, label("/gap", "", inset + [0, 0, (1.1 * INSET + 0.2) * u], 1.55,
                              "bottom-center"), scale)
