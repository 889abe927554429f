"""The board beside the 3D machine: the orbit about its mean, large, and the branch with a ball at
the machine.

It is a part of the scene, so that every page and every recording shows it at the machine's own
instant: what moves on it moves by its pose, but for the tail.

Here points, segments: on the board, in units of the drawing. above: how far in front of it, the
same. first: 1X, µm. path: of a node in the scene. place: m. right, up: of a camera. colour: as in
CSS or RGB. thickness: in pixels. at: where. anchor: as viser has it. size: times EM. verdict: on
an orbit. tail: places of the rotor, m. eccentricity: %. origin, direction: of a ray in the scene.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from viser import ViserServer

from hydrolab.dynamics.harmonics import PERIOD, synthesise
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.explorers.legs import Legs
from hydrolab.figures.readings import microns
from hydrolab.figures.style import BLUE, COLOURS, PURPLE
from hydrolab.live import solids
from hydrolab.live.bodies import PAINT, PRESSURE, linear_rgb, rgb

EM = 0.4  # units of the drawing: height of letters; 18 pixels at least on a screen of 768
WIDTH, PAD, LINE = 0.6, 0.3, 1.45  # em: of a letter on average, beside the words, of a line


@dataclass(eq=False)
class Label:
    """A text that faces the camera. place: in its parent's frame, m; em: height of its letters, m;
    anchor: as viser has it.
    """

    handle: Any
    text: str
    place: NDArray
    em: float
    anchor: str

    @classmethod
    def add(cls, server: ViserServer, path: str, text: str, place: NDArray, em: float,
            anchor: str = "center-left") -> Label:
        """Write a text into a scene."""
        place = np.asarray(place, float)
        handle = server.scene.add_label(path, text, position=place, anchor=anchor,
                                        font_size_mode="scene", font_scene_height=em)
        return cls(handle, text, place, em, anchor)

    def say(self, text: str, place: NDArray | None = None) -> None:
        """Change the text, and where it is."""
        if text != self.text:
            self.handle.text = self.text = text
        if place is not None and not np.array_equal(place, self.place):
            self.place = np.asarray(place, float)
            self.handle.position = self.place

    def corners(self, right: NDArray, up: NDArray) -> NDArray:
        """Two opposite corners of its box, m, for a camera with these directions, (2, 3); all in
        its parent's frame.
        """
        row, column = self.anchor.split("-")
        wide, high = self.em * (WIDTH * len(self.text) + 2 * PAD), self.em * LINE
        x = {"left": 0.0, "center": -0.5, "right": -1.0}[column]
        y = {"bottom": 0.0, "center": -0.5, "top": -1.0}[row]
        low = self.place + x * wide * right + y * high * up
        return np.stack([low, low + wide * right + high * up])


# in units of the drawing: half of the orbit's square, the branch's width and height, the margin
HALF, WIDE, HIGH, MARGIN = 3.1, 5.3, 2.7, 0.35
ORBIT = np.array([0.0, 2.6])  # middle of the orbit's square on the board
BRANCH = np.array([-0.42 * WIDE, -4.75])  # where the branch's axes meet
KEY = np.array([-3.1, -6.45])  # the colours of the pressure begin here
LOW, TOP, SIDE = -6.85, ORBIT[1] + HALF + MARGIN, HALF + MARGIN
HEAD = 1.0  # of the line above the board
DIAMOND = 0.11 * np.array([[-1, 0], [0, 1], [1, 0], [0, -1], [-1, 0]])
TRIANGLE = 0.14 * np.array([[-1, -0.7], [0, 1], [1, -0.7], [-1, -0.7]])
TAIL, LONG = 24, 0.45  # segments of the tail, and its length in revolutions
FILLED = 0.8  # of half the square, by the farthest point of the orbit
WALL = 256  # points of the gap's wall


def bottom(branch: bool) -> float:
    """The lower edge of a board with a branch or without."""
    return LOW if branch else ORBIT[1] - HALF - 0.7


def round_down(value: float) -> float:
    """The largest round number that is not above a value."""
    ten = 10.0 ** math.floor(math.log10(value))
    return next(step * ten for step in (8, 6, 5, 4, 3, 2, 1.5, 1)
                if step * ten <= value * (1 + 1e-9))


def lines_of(points: NDArray, dashed: bool = False) -> NDArray:
    """Segments (N, 2, 2) along points (2, P); where one is nan there is a gap, and where dashed
    every third is left out.
    """
    segments = np.stack([points[:, :-1].T, points[:, 1:].T], axis=1)
    kept = np.isfinite(segments).all(axis=(1, 2))
    return segments[kept & (np.arange(len(kept)) % 5 < 3) if dashed else kept]


@dataclass(eq=False)
class Board:
    """The board of one scene. `place` puts it beside the machine, or `above` it where a picture is
    higher than wide; `turn` has it face the first view.

    unit: of the drawing, m. reach: of the branch's axes, % and µm. times: how much larger than in
    the machine the orbit is drawn. mean: what it is drawn about, m. labels: what is written on it,
    by name. tall: whether the picture is higher than wide.
    """

    server: ViserServer
    unit: float
    place: NDArray
    above: NDArray
    turn: NDArray
    labels: dict[str, Label] = field(default_factory=dict)
    moving: dict[str, Any] = field(default_factory=dict)
    reach: tuple[float, float] = (1.0, 1.0)
    times: float = 1.0
    mean: NDArray = field(default_factory=lambda: np.zeros(2))
    branch: bool = False

    def __post_init__(self) -> None:
        scene = self.server.scene
        self.stand(scene, tall=False)
        ball = {"color": rgb(PAINT), "cast_shadow": False}
        self.moving["dot"] = scene.add_icosphere("/board/dot", 0.13 * self.unit, **ball)
        self.moving["ball"] = scene.add_icosphere("/board/ball", 0.2 * self.unit, visible=False,
                                                  **ball)

    # ------------------------------------------------------------------ where things are

    def stand(self, scene: Any, tall: bool) -> None:
        """Put the board where it is seen, for all or in the scene of one client."""
        scene.add_frame("/board", show_axes=False, position=self.above if tall else self.place,
                        wxyz=np.roll(Rotation.from_matrix(self.turn).as_quat(), 1))

    def flat(self, points: NDArray, above: float = 0.02) -> NDArray:
        """Points (…, 2) of the board in its frame, m."""
        height = np.full((*points.shape[:-1], 1), above)
        return self.unit * np.concatenate([points, height], axis=-1)

    def in_square(self, displacement: NDArray) -> NDArray:
        """Places on the board, (…, 2), of the rotor at x, z, m."""
        return ORBIT + self.times / self.unit * (displacement - self.mean)

    def on_branch(self, eccentricity: NDArray, first: NDArray) -> NDArray:
        """Places on the board of an eccentricity, %, and 1X, µm, (…, 2)."""
        share = np.stack([eccentricity / self.reach[0], first / self.reach[1]], axis=-1)
        return BRANCH + share * [WIDE, HIGH]

    def picked(self, origin: NDArray, direction: NDArray, tall: bool) -> tuple[float, float]:
        """Eccentricity, %, and 1X, µm, under a ray in the scene; nan where it misses the board."""
        place = self.above if tall else self.place
        start, along = self.turn.T @ (origin - place), self.turn.T @ direction
        if abs(along[2]) < 1e-9:
            return math.nan, math.nan
        at = (start - along * start[2] / along[2])[:2] / self.unit
        share = (at - BRANCH) / [WIDE, HIGH]
        inside = (share > -0.05).all() and (share < 1.1).all()
        return tuple((share * self.reach).tolist()) if inside else (math.nan, math.nan)

    def corners(self, tall: bool, orbit: bool = False) -> NDArray:
        """The corners in the scene, m, (4, 3), of the board and what is written above it; of the
        `orbit` alone.
        """
        low = bottom(self.branch and not orbit)
        flat = np.array([[x, y] for x in (-SIDE, SIDE) for y in (low, TOP + HEAD)])
        return self.flat(flat) @ self.turn.T + (self.above if tall else self.place)

    # ------------------------------------------------------------------ drawing

    def line(self, name: str, segments: NDArray, colour: Any, thickness: float,
             above: float = 0.02) -> None:
        """Segments (N, 2, 2) on the board."""
        self.server.scene.add_line_segments(
            f"/board/{name}", self.flat(segments, above).astype(np.float32), colour,
            thickness=thickness, thickness_units="screen", visible=len(segments) > 0)

    def write(self, name: str, text: str, at: Sequence[float], anchor: str = "center-center",
              size: float = 1.0) -> None:
        """Write a text on the board, or change it."""
        label = self.labels.get(name)
        if label is None:
            place = self.flat(np.asarray(at), 0.1)
            label = self.labels[name] = Label.add(self.server, f"/board/words/{name}", text, place,
                                                  EM * size * self.unit, anchor)
        label.say(text, self.flat(np.asarray(at), 0.1))

    def dress(self, dark: bool) -> None:
        """The plate and its frames, light or dark."""
        plate, frame = ((46, 50, 58), (120, 130, 145)) if dark else ((251, 252, 253),
                                                                    (150, 160, 172))
        low, u = bottom(self.branch), self.unit
        block = solids.box(-SIDE * u, 2 * SIDE * u, 1.0, -0.06 * u, 0.0)
        block[0][:, 1] = u * np.where(block[0][:, 1] > 0, TOP, low)
        self.server.scene.add_mesh_simple("/board/plate", *block, color=plate, side="double",
                                          cast_shadow=False, receive_shadow=False)
        square = ORBIT + HALF * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
        cross = ORBIT + HALF * np.array([[[-1, 0], [1, 0]], [[0, -1], [0, 1]]])
        self.line("square", np.concatenate([lines_of(square.T), 0.06 * (cross - ORBIT) + ORBIT]),
                  frame, 2.0)
        if self.branch:
            axes = BRANCH + np.array([[0, 1.06 * HIGH], [0, 0], [1.04 * WIDE, 0]])
            self.line("axes", lines_of(axes.T), frame, 2.0)
            colours = linear_rgb(PRESSURE[:-1:8])
            x = KEY[0] + 0.26 * np.arange(9)
            key = np.stack([np.column_stack([x[:-1], KEY[1] + 0 * x[1:]]),
                            np.column_stack([x[1:], KEY[1] + 0 * x[1:]])], axis=1)
            self.line("key", key, np.repeat(colours[:, None], 2, axis=1), 14.0)
            self.write("key", "pressure ½ to 2×", KEY + [2.25, 0.0], "center-left")
        ink = (235, 235, 235) if dark else (40, 40, 40)
        self.tail_colours = np.linspace(np.array(plate) / 255, np.array(ink) / 255, TAIL + 1)
        if "tail" in self.moving:
            self.moving.pop("tail").remove()

    def show_orbit(self, orbit: PeriodicOrbit, verdict: str,
                   path: NDArray | None = None) -> None:
        """Draw an orbit about its mean, with its 1X and 2X; or a motion that goes `path`, (2, P) m,
        about the mean of the orbit where it began.
        """
        whole = orbit.positions(orbit.revolutions * np.append(PERIOD, PERIOD[0]))
        seen = whole if path is None else path
        self.mean = orbit.mean.copy() if path is None else np.nanmean(path, axis=1)
        extent = float(np.nanmax(np.hypot(*(seen - self.mean[:, None])))) or 1.0
        self.times = round_down(FILLED * HALF * self.unit / max(extent, 1e-9))
        colour = PURPLE if orbit.revolutions > 1 else BLUE if verdict == "stable" else (
            COLOURS[verdict])
        self.line("orbit", lines_of(self.in_square(seen.T).T) if path is None
                  else np.empty((0, 2, 2)), rgb(colour), 5.0)
        for name, order, thick in (("1X", 1, 2.5), ("2X", 2, 2.5)):
            k = order * orbit.revolutions
            own = np.zeros_like(orbit.coefficients)
            own[:, 2 * k - 1:2 * k + 1] = orbit.coefficients[:, 2 * k - 1:2 * k + 1]
            turn = synthesise(own, np.append(PERIOD, PERIOD[0]) / k)
            part = lines_of(self.in_square(turn.T + self.mean).T, dashed=order == 1)
            self.line(name, part if path is None else part[:0], rgb(COLOURS[name]), thick, 0.03)
            across = orbit.amplitudes[:, k - 1]
            self.write(name, f"{name} {microns(across[0])}", (ORBIT[0] - HALF + (
                0.95 if order == 1 else 4.0), ORBIT[1] - HALF - 0.32), "center-left")
            y, x = ORBIT[1] - HALF - 0.32, ORBIT[0] - HALF + (0.15 if order == 1 else 3.2)
            self.line(f"{name} of the legend", np.array([[[x, y], [x + 0.65, y]]]),
                      rgb(COLOURS[name]), 4.0)
        self._wall(orbit)
        said = "the motion" if path is not None else "orbit" if orbit.revolutions == 1 else (
            f"orbit of {orbit.revolutions} revolutions")
        self.write("orbit", f"{said}, × {self.times:g}",
                   (ORBIT[0], ORBIT[1] + HALF - 0.35))
        bar = round_down(0.5 * HALF * self.unit / self.times)
        ends = ORBIT + [[HALF - 0.2 - bar * self.times / self.unit, -HALF + 0.3],
                        [HALF - 0.2, -HALF + 0.3]]
        self.line("bar", ends[None], (90, 90, 90), 5.0)
        self.write("bar", microns(bar), (ends[:, 0].mean(), ends[0, 1] + 0.33))

    def _wall(self, orbit: PeriodicOrbit) -> None:
        """The gap's wall, where it is near enough to be on the board."""
        if not math.isfinite(orbit.model.gap):
            return
        angle = 2 * np.pi * np.arange(WALL * 8 + 1) / (WALL * 8)
        around = orbit.centre + orbit.model.gap * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        place = self.in_square(around)
        place[(np.abs(place - ORBIT) > HALF).any(axis=1)] = np.nan
        self.line("wall", lines_of(place.T), rgb(COLOURS["stator"]), 9.0)

    def show_branch(self, legs: Legs, doubled: Sequence[Legs] = (),
                    flips: Sequence[PeriodicOrbit] = ()) -> None:
        """Draw steady states over the eccentricity: stable, unstable, of two revolutions; diamonds
        at folds, triangles at flips.
        """
        stable = [some.lines(some.first).get("stable", ([], [0.0]))[1] for some in (legs, *doubled)]
        highest = max(float(np.nanmax(heights)) for heights in stable)
        self.reach = 100 * max(legs.reach, 0.01), 1.15 * highest
        drawn: dict[str, list[NDArray]] = {"stable": [], "unstable": [], "two": []}
        for some in (legs, *doubled):
            for word, line in some.lines(some.first).items():
                two = some is not legs and word == "stable"
                place = self.on_branch(*line)
                place[place[:, 1] > BRANCH[1] + HIGH] = np.nan  # far above what a machine can do
                segments = lines_of(place.T, dashed=word != "stable")
                drawn["two" if two else "stable" if word == "stable" else "unstable"].append(
                    segments)
        colours = {"stable": COLOURS["stable"], "unstable": COLOURS["unstable"], "two": PURPLE}
        for word, parts in drawn.items():
            self.line(f"branch {word}", np.concatenate([*parts, np.empty((0, 2, 2))]),
                      rgb(colours[word]), 4.0)
        for name, orbits, colour, mark in (("folds", legs.at_folds(), COLOURS["fold"], DIAMOND),
                                           ("flips", flips, PURPLE, TRIANGLE)):
            places = [self.on_branch(100 * orbit.static_eccentricity,
                                     legs.first(np.empty(0), orbit.local[None])[0])
                      for orbit in orbits]
            marks = [lines_of((at + mark).T) for at in places if at[1] < BRANCH[1] + HIGH]
            self.line(name, np.concatenate([*marks, np.empty((0, 2, 2))]), rgb(colour), 4.0, 0.04)
        self.moving["ball"].visible = True
        step = round_down(0.6 * self.reach[0])
        for k, share in enumerate((0.0, step)):
            self.write(f"tick {k}", f"{share:g} %", self.on_branch(share, 0.0) - [0, 0.3])
        self.write("eccentricity", "static eccentricity", BRANCH + [0.62 * WIDE, -0.9])
        height = round_down(0.9 * self.reach[1])
        self.write("height", f"{height:g} µm", self.on_branch(0.0, height) + [0.12, 0],
                   "center-left")
        tick = self.on_branch(np.array([step, step, 0, 0]), np.array([0, 0, height, height]))
        tick[1] -= [0, 0.12]
        tick[3] -= [0.12, 0]
        self.line("ticks", tick.reshape(2, 2, 2), (120, 120, 120), 3.0)
        two = ", two revolutions violet" if any(map(len, drawn["two"])) else ""
        self.write("1X of the branch", f"1X{two}", BRANCH + [0.1, HIGH + 0.35], "center-left")

    # ------------------------------------------------------------------ moving

    def move(self, at: NDArray, tail: NDArray) -> None:
        """The rotor is at x, z (m) after a way, (TAIL + 1, 2)."""
        self.moving["dot"].position = self.flat(self._inside(self.in_square(at)), 0.1)
        way = self._inside(self.in_square(tail))
        points = self.flat(np.stack([way[:-1], way[1:]], axis=1), 0.05).astype(np.float32)
        if "tail" in self.moving:
            self.moving["tail"].points = points
        else:
            colours = np.stack([self.tail_colours[:-1], self.tail_colours[1:]], axis=1)
            self.moving["tail"] = self.server.scene.add_line_segments(
                "/board/tail", points, linear_rgb(colours), thickness=7.0, thickness_units="screen")

    def roll(self, eccentricity: float, first: float) -> None:
        """Put the ball where the machine is, a fraction and m."""
        place = self.on_branch(np.array(100 * eccentricity), np.array(1e6 * first))
        self.moving["ball"].position = self.flat(np.minimum(place, BRANCH + [WIDE, 1.1 * HIGH]),
                                                 0.12)

    def _inside(self, place: NDArray) -> NDArray:
        return np.clip(place, ORBIT - HALF, ORBIT + HALF)


def phases_of_tail(phase: float) -> NDArray:
    """The phases at which the tail passes, oldest first."""
    return phase - 2 * np.pi * LONG * np.linspace(1, 0, TAIL + 1)
