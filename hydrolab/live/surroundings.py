"""What stands around the 3D machine: floor, a person, axis, lights, the views, and the names.

Here aspect: width over height. path: of a node in the scene. lines, colours: of segments.
thickness: in pixels. dark: whether the page is. branch: whether there is one to draw. gap, scale:
words. shown: whether names are. near: m. heights: of names, m. board: it. rows: names.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from viser import ViserServer

from hydrolab.live import solids
from hydrolab.live.board import EM, SIDE, TOP, Board, Label, bottom
from hydrolab.live.bodies import Sizes, bearing_places, drawn_radius
from hydrolab.machine.parts import Machine

# vertical field of view: a longer lens than a page's usual 75 degrees bends the machine less
LENS = math.radians(32)
RISE = 0.36  # rad; how far above the horizon the first view stands
ASPECT = 1.36  # width over height of the picture beside the panel on a screen of 1366 × 768
LINE_GAP = 3.0  # em between two names: from above they come nearer to one another
PERSON = 1.75  # m
PORTRAIT = 0.9  # below this a picture has the board above the machine, not beside it
# of the height of such a picture: what lies under the folded panel, and under a warning
FOOT, STRIP = 0.25, 0.05
ROOM = 1.04  # what a view shows, over what it must show

Point = tuple[float, float, float]


def turn_of(sizes: Sizes, rise: float) -> NDArray:
    """Directions to the right, up and towards the camera of a view at an angle rise above the
    horizon, rad, as columns; sizes: of what is seen.
    """
    facing = math.cos(rise) * sizes.near + math.sin(rise) * sizes.up
    right = np.cross(sizes.up, sizes.near)
    return np.column_stack([right, np.cross(facing, right), facing])


def floor_of(sizes: Sizes) -> float:
    """How high the floor is, m."""
    return -1.4 * sizes.stator - sizes.unit if sizes.lying else sizes.bottom - 1.2 * sizes.unit


def add_board(server: ViserServer, sizes: Sizes, branch: bool) -> Board:
    """The board to the left of the machine, facing the first view; on the ground."""
    u, turn, low = sizes.unit, turn_of(sizes, RISE), bottom(branch)
    half, raised = 1.3 * max(sizes.stator, 1.2 * u), -0.5 * (low + TOP) * u
    middle = 0.5 * (sizes.top + sizes.bottom) + 0.5 * u
    if sizes.lying:
        half, raised = 0.5 * (sizes.top - sizes.bottom) + u, floor_of(sizes) - low * u
    aside = half + (SIDE + 0.3) * u
    place = [0.0, 0.0, middle] - aside * turn[:, 0] + raised * turn[:, 1]
    along, over = (whole(sizes) @ turn).T[:2]
    above = turn @ np.array([0.5 * (along.max() + along.min()), over.max() + (0.4 - low) * u, 0.0])
    return Board(server, u, place, above, turn, branch=branch)


def around(sizes: Sizes, height: float, share: float = 1.0) -> NDArray:
    """Points around the machine at a height, (12, 3) m; share: of the distance that clears it."""
    wide = share * max(1.2 * sizes.stator, 1.5 * sizes.unit)
    return np.array([[wide * math.cos(a), wide * math.sin(a), height]
                     for a in np.linspace(0, 2 * math.pi, 12, endpoint=False)])


def whole(sizes: Sizes) -> NDArray:
    """Points around the whole machine, m, (P, 3)."""
    u = sizes.unit
    return np.concatenate([around(sizes, sizes.top + 0.6 * u),
                           around(sizes, sizes.middle - 0.75 * sizes.height),
                           around(sizes, sizes.bottom - 0.9 * u, 0.55)])


@dataclass(frozen=True, eq=False)
class Sight:
    """What a camera shall show: points in the scene, m, (P, 3), and labels with their boxes."""

    points: NDArray
    labels: tuple[Label, ...] = ()


@dataclass(frozen=True, eq=False)
class View:
    """What a camera shall show. turn: its directions, as of `turn_of`. wide: in a picture
    wider than high; tall: in another, with the board above the machine where `board`. names: none
    of them is shown in part.
    """

    turn: NDArray
    wide: Sight
    tall: Sight
    board: bool = True
    names: tuple[Label, ...] = ()

    def camera(self, aspect: float) -> tuple[Point, Point]:
        """Position and target of a camera as near as it may be to show all of it in a picture of
        this width over height, above the folded panel where that is tall.
        """
        turn, sight = self.turn, self.tall if aspect < PORTRAIT else self.wide
        foot, strip = (FOOT, STRIP) if aspect < PORTRAIT else (0.0, 0.0)
        edge = math.tan(LENS / 2)
        high = edge / ROOM
        wide, up, down = aspect * high, (1 - 2 * strip) * high, (1 - 2 * foot) * high
        boxes = [label.corners(turn[:, 0], turn[:, 1]) @ turn for label in sight.labels]
        rest = [label.corners(turn[:, 0], turn[:, 1]) @ turn for label in self.names
                if label not in sight.labels]
        shown = np.concatenate([sight.points @ turn, *boxes])
        while True:
            a, b, c = shown.T
            # |a − x| ≤ wide (d − c) for all points, −down (d − c) ≤ b − y ≤ up (d − c)
            right, left = (a + wide * c).max(), (-a + wide * c).max()
            over, under = (b + up * c).max(), (-b + down * c).max()
            away = max((right + left) / (2 * wide), (over + under) / (up + down))
            x, y = (right - left) / 2, (over - under + (down - up) * away) / 2
            cut = next((box for box in rest
                        if _is_cut(box - [x, y, away], wide, up, down, edge)), None)
            if cut is None:
                break
            shown = np.concatenate([shown, cut])
            rest = [box for box in rest if box is not cut]
        target = turn @ np.array([x, y, float(c.mean())])
        position = target + (away - c.mean()) * turn[:, 2]
        return tuple(position.tolist()), tuple(target.tolist())


def _is_cut(box: NDArray, wide: float, up: float, down: float, edge: float) -> bool:
    """Whether a box, two corners as seen from the camera, is in a picture in part. edge: where the
    picture ends above; what covers its foot begins at `down`.
    """
    (left, low), (right, top) = box[:, :2] / -box[:, 2:]
    aside = wide * ROOM
    seen = left < aside and right > -aside and low < edge and top > -down * ROOM
    return bool(seen and (left < -wide or right > wide or low < -down or top > up))


def views_of(sizes: Sizes, names: Names, board: Board) -> dict[str, View]:
    """What each view shows: the machine, the air gap from above, the lower end, and the orbit as
    seen along the axis.
    """
    u, middle, half = sizes.unit, sizes.middle, 0.75 * sizes.height
    low = np.concatenate([around(sizes, sizes.bottom - 0.9 * u, 0.5),
                          around(sizes, sizes.bottom + 2.4 * u, 0.3)])
    near = tuple(label for label in names.names
                 if abs(label.place[2] - middle) < 0.6 * sizes.height)
    lowest = tuple(label for label in names.names if label.place[2] < sizes.bottom + 2.5 * u)
    every = (*names.names, names.scale)
    gap = Sight(np.concatenate([around(sizes, middle + half), around(sizes, middle - half)]), near)
    end = Sight(low, (*lowest, names.scale))
    machine = [Sight(np.concatenate([whole(sizes), board.corners(tall)]), every)
               for tall in (False, True)]
    axis = [Sight(board.corners(tall, orbit=not tall)) for tall in (False, True)]
    first, steep, flat = (turn_of(sizes, rise) for rise in (RISE, 0.75, 0.3))
    return {"machine": View(first, *machine), "air gap": View(steep, gap, gap, False, every),
            "lower end": View(flat, end, end, False, every),
            "along the axis": View(first, *axis, names=every)}


def add_lines(server: ViserServer, path: str, lines: NDArray, colours: Any,
              thickness: float) -> None:
    """Line segments, (N, 2, 3) m, so many pixels thick."""
    server.scene.add_line_segments(path, lines.astype(np.float32), colours, thickness=thickness,
                                   thickness_units="screen")


def add_person(server: ViserServer, sizes: Sizes) -> None:
    """A person on the floor, for scale."""
    outline = np.array([[0.001, 0.0], [0.15, 0.0], [0.17, 0.8], [0.25, 1.4], [0.08, 1.5],
                        [0.11, 1.6], [0.11, 1.7], [0.001, PERSON]])
    points, faces = solids.swept(outline, steps=24)
    right, up, near = turn_of(sizes, 0.0).T
    aside = -0.8 * near - 1.5 * right if sizes.lying else -1.12 * right
    where = max(sizes.stator, sizes.unit) * aside + floor_of(sizes) * up
    server.scene.add_mesh_simple("/person", points @ np.stack([right, -near, up]) + where, faces,
                                 color=(66, 84, 110), receive_shadow=False)


def add_surroundings(server: ViserServer, sizes: Sizes, dark: bool) -> None:
    """Floor, axis and lights; no environment map, which flashes white where a recording loops."""
    scene, u = server.scene, sizes.unit
    scene.set_up_direction("+y" if sizes.lying else "+z")
    scene.configure_environment_map(None)
    scene.configure_default_lights(False)
    scene.add_light_ambient("/lights/ambient", intensity=0.7 if dark else 0.9)
    scene.add_light_hemisphere("/lights/sky", sky_color=(255, 255, 255),
                               ground_color=(170, 175, 190), intensity=0.9)
    scene.add_light_directional("/lights/sun", intensity=2.1, cast_shadow=True,
                                position=tuple(Rotation.from_rotvec(0.9 * sizes.up).apply(
                                    5.0 * sizes.near) + 12.0 * sizes.up))
    plane, cells, sections = (((40, 43, 50), (62, 66, 74), (84, 90, 100)) if dark else
                              ((244, 246, 248), (226, 230, 235), (202, 208, 215)))
    scene.add_grid("/floor", 30.0 * u, 30.0 * u, cell_size=u, section_size=5.0 * u,
                   cell_color=cells, section_color=sections, plane_color=plane, plane_opacity=1.0,
                   position=tuple(floor_of(sizes) * sizes.up), shadow_opacity=0.16,
                   plane="xz" if sizes.lying else "xy", fade_distance=46.0 * u, fade_strength=2.0)
    light, deep = ((58, 63, 72), (24, 26, 31)) if dark else ((208, 219, 230), (246, 248, 250))
    scene.set_background_image(np.linspace(light, deep, 64).astype(np.uint8)[:, None].repeat(2, 1),
                               format="png")
    if u > PERSON / 6:
        add_person(server, sizes)
    z = np.arange(sizes.bottom - 1.1 * u, sizes.top + 1.9 * u, 0.3 * u)
    dashes = np.zeros((len(z), 2, 3))
    dashes[:, 0, 2], dashes[:, 1, 2] = z, z + 0.17 * u
    add_lines(server, "/axis", dashes, (190, 190, 190) if dark else (64, 64, 64), 2.0)


@dataclass(eq=False)
class Names:
    """The labels: names that can be switched off, the smallest gap, and the scale of the drawing.
    """

    names: list[Label]
    gap: Label | None
    scale: Label

    def say(self, gap: str, scale: str, shown: bool) -> None:
        """Bring the words up to date."""
        self.scale.say(scale)
        if self.gap is not None:
            self.gap.say(gap)
        for label in self.names:
            label.handle.visible = shown


def places_to_name(machine: Machine, sizes: Sizes,
                   depths: NDArray) -> Iterator[tuple[str, NDArray]]:
    """The name of every part beside it, m, or above it in steps where the shaft lies; parts at one
    height share a line.

    depths: of the bodies and then the cracks as drawn, m.
    """
    gap, u = machine.air_gap, sizes.unit
    heights = bearing_places(machine, sizes.shaft) | {
        crack.name: -depth
        for crack, depth in zip(machine.cracks, depths[len(machine.bodies):], strict=True)}
    aside = {}
    for body, depth in zip(machine.bodies, depths, strict=False):
        heights[body.name] = -float(depth)
        aside[body.name] = (1.24 * sizes.stator if gap and body.name == gap.body
                            else 1.1 * drawn_radius(machine, body) + 0.2 * u)
    rows = sorted(heights, key=heights.get)
    below = -math.inf
    out, line = turn_of(sizes, RISE)[:, 0], LINE_GAP * EM * u
    above = max(1.3 * sizes.stator, *aside.values()) + 0.5 * line
    for i, words in enumerate(together(rows, heights, line)):
        # no two lines nearer than a line is high
        below = max(heights[words[0]], below + line)
        outer = max(aside.get(name, 5.4 * sizes.shaft) for name in words)
        if sizes.lying:
            out, outer = sizes.up, above + i % 3 * 1.15 * line
        yield ", ".join(words), outer * out + [0, 0, below]


def together(rows: Iterable[str], heights: dict[str, float], near: float) -> list[list[str]]:
    """Names in groups at (nearly) one height."""
    groups: list[list[str]] = []
    for name in rows:
        if groups and heights[name] - heights[groups[-1][0]] < 0.35 * near:
            groups[-1].append(name)
        else:
            groups.append([name])
    return groups


def add_names(server: ViserServer, machine: Machine, sizes: Sizes, depths: NDArray,
              board: Board) -> Names:
    """Names of the parts to their right, the smallest gap above the board, the scale at the foot.

    depths: as in `places_to_name`.
    """
    u, gap = sizes.unit, machine.air_gap
    names = [Label.add(server, f"/names/{text}", text, place, EM * u,
                       "bottom-center" if sizes.lying else "center-left")
             for text, place in places_to_name(machine, sizes, depths)]
    foot = [0.0, 0.0, sizes.middle] if sizes.lying else [0.0, 0.0, 0.0]
    scale = Label.add(server, "/scale", "…", foot + (floor_of(sizes) - 0.2 * u) * sizes.up, EM * u,
                      "top-center")
    if gap is None:
        return Names(names, None, scale)
    above = board.flat(np.array([0.0, TOP + 0.15]), 0.1)
    return Names(names, Label.add(server, "/board/words/gap", "…", above, 1.35 * EM * u,
                                  "bottom-center"), scale)
