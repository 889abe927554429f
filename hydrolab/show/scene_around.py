"""What stands around the 3D machine: floor, axis, lights, views, names, and the orbit in its gap circle as an inset."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from viser import ViserServer

from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.machine.parts import Machine
from hydrolab.show import solids
from hydrolab.show.live_orbit import gap_words
from hydrolab.show.scene_parts import AZIMUTH, LEFT, Sizes, rgb
from hydrolab.show.style import COLOURS

INSET = 1.9  # m; radius of the gap circle in the inset
LENS = math.radians(36)  # vertical field of view: a longer lens than a page's usual 75 degrees bends the machine less

Point = tuple[float, float, float]


def inset_place(sizes: Sizes) -> NDArray:
    """Centre of the inset, m: to the left in the first view, under the stator where there is room, beside it where not."""
    rise = INSET + 1.4
    tucked = sizes.bottom + rise + INSET + 1.2 < sizes.top - 2 * sizes.height
    return (INSET + 1.0 + (0.62 if tucked else 1.2) * max(sizes.stator, 2.0)) * LEFT + [0.0, 0.0, sizes.bottom + rise]


def views_of(sizes: Sizes) -> dict[str, tuple[Point, Point]]:
    """Camera position and the point it looks at, for each view: the machine, the air gap from above, the lower end."""
    height = sizes.top - sizes.bottom + 2.4
    distance = max(0.5 * height, 1.6 * sizes.stator) / math.tan(LENS / 2) * 1.2

    def seen(away: float, rise: float, at: float, aside: float = 0.0) -> tuple[Point, Point]:
        towards = np.array([math.cos(rise) * math.cos(AZIMUTH), math.cos(rise) * math.sin(AZIMUTH), math.sin(rise)])
        centre = np.array([0.0, 0.0, at]) - aside * LEFT
        return tuple((centre + away * towards).tolist()), tuple(centre.tolist())

    return {"machine": seen(distance, 0.44, 0.5 * (sizes.top + sizes.bottom) + 0.05, 0.3),
            "air gap": seen(0.5 * distance + 1.0, 0.85, sizes.top - 0.6, 0.4),
            "lower end": seen(0.42 * distance + 1.0, 0.35, sizes.bottom + 1.2, 0.4)}


def add_surroundings(server: ViserServer, sizes: Sizes, dark: bool) -> None:
    """Floor, axis and lights; no environment map, which flashes white where a recording loops."""
    scene = server.scene
    scene.set_up_direction("+z")
    scene.configure_environment_map(None)
    scene.configure_default_lights(False)
    scene.add_light_ambient("/lights/ambient", intensity=0.7 if dark else 0.9)
    scene.add_light_hemisphere("/lights/sky", sky_color=(255, 255, 255), ground_color=(170, 175, 190), intensity=0.9)
    scene.add_light_directional("/lights/sun", intensity=2.1, cast_shadow=True,
                                position=(5.0 * math.cos(AZIMUTH + 0.9), 5.0 * math.sin(AZIMUTH + 0.9), 12.0))
    plane, cells, sections = (((40, 43, 50), (62, 66, 74), (84, 90, 100)) if dark else
                              ((244, 246, 248), (226, 230, 235), (202, 208, 215)))
    scene.add_grid("/floor", 30.0, 30.0, cell_size=1.0, section_size=5.0, cell_color=cells, section_color=sections,
                   plane_color=plane, plane_opacity=1.0, position=(0.0, 0.0, sizes.bottom - 1.2), shadow_opacity=0.16,
                   fade_distance=46.0, fade_strength=2.0)
    z = np.arange(sizes.bottom - 1.1, sizes.top + 1.9, 0.3)
    dashes = np.zeros((len(z), 2, 3))
    dashes[:, 0, 2], dashes[:, 1, 2] = z, z + 0.17
    scene.add_line_segments("/axis", dashes.astype(np.float32), (190, 190, 190) if dark else (64, 64, 64), thickness=2.0,
                            thickness_units="screen")


@dataclass(frozen=True, eq=False)
class Inset:
    """The gap circle seen from above, x to the right and z up, with the orbit and a dot that moves on it."""

    server: ViserServer
    gap: float
    dot: Any

    def draw(self, orbit: PeriodicOrbit, verdict: str) -> None:
        """Draw an orbit in the circle, in the colour of its verdict."""
        path = self.place(orbit.positions(2 * np.pi * np.arange(193) / 192) - orbit.centre[:, None])
        lines = np.stack([path[:-1], path[1:]], axis=1).astype(np.float32)
        self.server.scene.add_line_segments("/inset/orbit", lines, rgb(COLOURS[verdict]), thickness=5.0,
                                            thickness_units="screen")

    def place(self, eccentricity: NDArray) -> NDArray:
        """Points of the inset for the rotor's place from the stator's centre, (2,) or (2, P), m."""
        return np.stack([*(eccentricity * INSET / self.gap), np.full(np.shape(eccentricity)[1:], 0.03)], axis=-1)


def add_inset(server: ViserServer, sizes: Sizes, gap: float) -> Inset:
    """The inset's plate, circle and dot; nothing of them but the dot moves."""
    turn = np.column_stack([-LEFT, [0.0, 0.0, 1.0], np.cross(-LEFT, [0.0, 0.0, 1.0])])
    server.scene.add_frame("/inset", show_axes=False, wxyz=np.roll(Rotation.from_matrix(turn).as_quat(), 1),
                           position=inset_place(sizes))
    plain = {"side": "double", "cast_shadow": False, "receive_shadow": False}
    plate = solids.ring(0.001, INSET, -0.03, -0.01, steps=96)
    server.scene.add_mesh_simple("/inset/plate", *plate, color=(250, 251, 253), opacity=0.9, **plain)
    rim = solids.ring(INSET, 1.07 * INSET, -0.06, 0.04, steps=96)
    server.scene.add_mesh_simple("/inset/rim", *rim, color=(34, 48, 68), flat_shading=True, **plain)
    cross = np.array([[[-0.12, 0, 0], [0.12, 0, 0]], [[0, -0.12, 0], [0, 0.12, 0]]])
    server.scene.add_line_segments("/inset/centre", cross.astype(np.float32), (70, 78, 90), thickness=2.0,
                                   thickness_units="screen")
    dot = server.scene.add_icosphere("/inset/dot", 0.085, color=rgb(COLOURS["unstable"]), cast_shadow=False)
    return Inset(server, gap, dot)


@dataclass(eq=False)
class Names:
    """The labels: names that can be switched off, the smallest gap, and the scale of the drawing."""

    names: list[Any]
    gap: Any
    scale: Any

    def say(self, orbit: PeriodicOrbit, factor: float, slow_motion: float, shown: bool) -> None:
        """Bring the words up to date."""
        self.scale.text = f"displacements and gap × {factor:.0f}, {slow_motion:.3g} times slower"
        if self.gap is not None:
            self.gap.text = f"smallest gap {gap_words(orbit)}"
        for label in self.names:
            label.visible = shown


def add_names(server: ViserServer, machine: Machine, sizes: Sizes, body_depths: NDArray) -> Names:
    """Names of the parts to their right, the smallest gap above the inset, the scale at the foot."""
    right, gap, names = -LEFT, machine.air_gap, []

    def label(path: str, text: str, place: NDArray, scale: float, anchor: str = "center-left") -> Any:
        return server.scene.add_label(path, text, position=tuple(place.tolist()), font_screen_scale=scale, anchor=anchor)

    def name(text: str, place: NDArray, anchor: str = "center-left") -> None:
        names.append(label(f"/names/{text}", text, place, 1.15, anchor))

    for body, depth in zip(machine.bodies, body_depths, strict=True):
        reach = 1.24 * sizes.stator if gap and body.name == gap.body else 1.7
        name(body.name, right * reach + [0, 0, -depth])
    if machine.shaft is not None:
        for bearing in (*machine.bearings, *machine.thrust_bearings):
            name(bearing.name, right * 5.4 * sizes.shaft + [0, 0, -float(machine.shaft.nodes[bearing.node])])
    foot = np.array([0.0, 0.0, sizes.bottom - 1.5])
    scale = label("/scale", "", foot, 1.0, "top-center")
    if gap is None:
        return Names(names, None, scale)
    inset = inset_place(sizes)
    name("stator, cut away", LEFT * 1.22 * sizes.stator + [0, 0, 0.2], "center-right")
    name(f"orbit in its gap of {1e3 * gap.gap:.3g} mm", inset - [0, 0, 1.1 * INSET + 0.1], "top-center")
    return Names(names, label("/gap", "", inset + [0, 0, 1.1 * INSET + 0.2], 1.9, "bottom-center"), scale)
