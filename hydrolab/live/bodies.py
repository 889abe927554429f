"""The parts of the 3D machine in its scene: what stands still and what moves by its pose.

Here away, largest: distances from rest, m. weights: of the bones at each vertex. colour: as in CSS.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from viser import ViserServer

from hydrolab.figures.style import COLOURS
from hydrolab.live import solids
from hydrolab.live.poses import STUB, drawn_rotor_radius, out_of_round
from hydrolab.machine.parts import Machine, RigidBody

# where the camera of the first view stands, and with it the cut in stator and bearings
AZIMUTH, LYING_AZIMUTH = math.radians(-58), math.radians(35)
CUT = math.radians(50)  # half of the sector that is cut away
ASLANT = 0.35  # rad; a shaft that lies is seen so far from its side
BLADES = 5
TIP = 1.75  # a runner's blades reach so far beyond the solid disc of its mass and inertia
POLES = 32  # drawn where the card names none
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
PAINT = COLOURS["unstable"]  # on whatever turns, so that its turning is seen
# of a runner's hub, (radius, height) over the radius of its disc
HUB = [[0.001, -0.95], [0.16, -0.9], [0.42, -0.62], [0.62, -0.25], [0.66, 0.1], [0.58, 0.34],
       [0.3, 0.46], [0.001, 0.46]]
# of the parts in the gap; `gap_solids` has their shapes
STEEL, COPPER, BLUE_PAINT = "#8C98A4", "#B4652C", "#3F668F"
GAP_COLOURS = {"/stator/wall": BLUE_PAINT, "/stator/rims": "#26384F", "/stator/winding": COPPER,
               "/stator/slots": "#23282E", "/rotor/rim": "#4A545F", "/rotor/spider": STEEL,
               "/rotor/coils": COPPER, "/rotor/poles": "#616D79", "/rotor/other poles": "#A3AFBA",
               "/rotor/painted pole": PAINT}
TEETH, BORE = 72, 0.998  # on the whole bore, and where they are seen, of its radius
SLOT = 0.3 * math.pi / TEETH  # rad; half of a slot
GATES, GATE = 20, 2.2  # around a runner, and how far out, of the disc's radius
# colours of the pull's pressure on the bore, from half to twice that of a rotor in the middle
PRESSURE = colormaps["coolwarm"](np.linspace(0, 1, 65))[:, :3]


def rgb(colour: str) -> tuple[int, int, int]:
    """A colour for a mesh, which reads sRGB."""
    return tuple(round(255 * c) for c in to_rgb(colour))


def linear_rgb(colours: NDArray) -> NDArray:
    """Colours (…, 3) from 0 to 1 for the points of lines, which read linear light (one colour of
    all does not).
    """
    c = np.asarray(colours)
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return np.round(255 * linear).astype(np.uint8)


def orbit_colours(away: NDArray, largest: float) -> NDArray:
    """Colours of points that are so far from rest, m: from dark violet to orange, never near white.
    """
    share = np.clip(away / largest if largest else away, 0, 1)
    return linear_rgb(colormaps["inferno"](0.15 + 0.63 * share)[..., :3])


SHADES = linear_rgb(PRESSURE)


@dataclass(frozen=True)
class Sizes:
    """Sizes of the drawing, m: inner radius of the stator, height of the rotor, radius of the slim
    shaft; Z of the top, the bottom and the rotor's middle; whether the shaft lies, so that Y is up.
    """

    stator: float
    height: float
    shaft: float
    top: float
    bottom: float
    middle: float = 0.0
    lying: bool = False

    @property
    def up(self) -> NDArray:
        """The unit vector up."""
        return np.array([0.0, 1.0, 0.0] if self.lying else [0.0, 0.0, 1.0])

    @property
    def near(self) -> NDArray:
        """The level unit vector towards the first view."""
        if self.lying:
            return np.array([math.cos(ASLANT), 0.0, math.sin(ASLANT)])
        return np.array([math.cos(AZIMUTH), math.sin(AZIMUTH), 0.0])

    @property
    def uncut(self) -> tuple[float, float]:
        """The ends of what is left of stator and bearings, cut towards the first view, rad."""
        middle = LYING_AZIMUTH if self.lying else AZIMUTH
        return middle + CUT, middle + 2 * math.pi - CUT

    @property
    def unit(self) -> float:
        """What stands around the machine grows with it, m: 1 for a unit ten metres high."""
        return max((self.top - self.bottom) / 10, self.stator / 3)


def sizes_of(machine: Machine) -> Sizes:
    """Sizes from the card; a machine without an air gap has a stator radius of 0."""
    gap = machine.air_gap
    stator = gap.mean_radius + gap.gap / 2 if gap else 0.0
    if machine.shaft is None:
        return Sizes(stator, gap.length if gap else 0.5, 0.12, STUB, -STUB)
    nodes, length = machine.shaft.nodes, machine.shaft.length
    bodies = {body.name: -float(nodes[body.node] + body.offset) for body in machine.bodies}
    ends = [0.0, -length, *bodies.values()]
    radius = min(float(machine.shaft.diameter.max()) / 2, 0.022 * length)
    return Sizes(stator, gap.length if gap else 0.0, radius, max(ends), min(ends),
                 bodies[gap.body] if gap else 0.0, machine.gravity is not None)


def disc_radius(body: RigidBody) -> float:
    """Radius of a solid disc with the body's mass and polar inertia, m: the size it is drawn with
    where none is known.
    """
    return math.sqrt(2 * body.Ip / body.mass) if body.Ip else 0.5


def is_runner(machine: Machine, body: RigidBody) -> bool:
    """Whether a body is drawn as a Kaplan runner: at the lower end of an upright shaft that carries
    a generator.
    """
    below = machine.shaft is not None and body.node == machine.nodes - 1
    return below and machine.air_gap is not None and machine.gravity is None


def drawn_radius(machine: Machine, body: RigidBody) -> float:
    """How far from the axis a body that is not the generator's rotor is drawn, m."""
    return (GATE if is_runner(machine, body) else 1.0) * disc_radius(body)


def bearing_places(machine: Machine, radius: float) -> dict[str, float]:
    """Height of each bearing's middle in the scene, m, for a shaft of the drawn radius.

    Bearings of one node stand one below the other. A point mass hangs on its springs, which are the
    drawn shaft; any other bearing of it stands below it.
    """
    places: dict[str, float] = {}
    taken: dict[int, int] = {}
    top = -0.5 * (machine.air_gap.length if machine.air_gap else 0.2) - 3 * radius
    for bearing in machine.all_bearings:
        if machine.shaft is None and bearing in machine.bearings:
            continue
        above = taken[bearing.node] = taken.get(bearing.node, -1) + 1
        depth = -float(machine.shaft.nodes[bearing.node]) if machine.shaft else top
        places[bearing.name] = depth - 2.8 * radius * above
    return places


def teeth(sizes: Sizes) -> NDArray:
    """Angles of the teeth that are left of the bore, rad."""
    low, high = sizes.uncut
    return np.arange(low + math.pi / TEETH, high - 0.5 * math.pi / TEETH, 2 * math.pi / TEETH)


def gap_solids(machine: Machine, sizes: Sizes, factor: float) -> dict[str, solids.Solid]:
    """The stator, cut away, and the generator's rotor, with a gap and shapes drawn `factor` times
    as large: poles as many as the card says, in two colours and one painted.
    """
    inner, height, uncut = sizes.stator, sizes.height, sizes.uncut
    half, rim, coil = 0.62 * height, 0.05 * height, 0.16 * height
    wall = solids.ring(inner, 1.16 * inner, -half, half, *uncut, 96)
    rims = [solids.ring(inner, 1.16 * inner, z, z + rim, *uncut, 96) for z in (-half - rim, half)]
    coils = [solids.swept(np.array([[1.02 * inner, z], [1.07 * inner, z], [1.08 * inner, z + coil],
                                    [1.03 * inner, z + coil]]), uncut[0] + 0.02, uncut[1] - 0.02,
                          96) for z in (-half - rim - coil, half + rim)]
    slots = [solids.turned(solids.ring(BORE * inner, inner, -half, half, -SLOT, SLOT, 1), a)
             for a in teeth(sizes) + math.pi / TEETH]
    still = {"wall": wall, "rims": solids.joined(*rims), "winding": solids.joined(*coils),
             "slots": solids.joined(*slots[:-1])}

    radius = drawn_rotor_radius(inner, machine.air_gap.gap, factor)
    poles = 2 * machine.poles.pole_pairs if machine.poles else POLES
    wide = 0.36 * 2 * math.pi / poles
    pole = solids.ring(0.9 * radius, radius, -height / 2, height / 2, -wide, wide,
                       2 * math.ceil(20 * wide))
    coil = solids.ring(0.9 * radius, 0.955 * radius, -0.53 * height, 0.53 * height, -1.22 * wide,
                       1.22 * wide, 2 * math.ceil(20 * wide))
    around = [solids.turned(pole, 2 * math.pi * k / poles) for k in range(poles)]
    arm = solids.box(0.05 * radius, 0.77 * radius, 0.12 * radius, -0.2 * height, 0.12 * height)
    arms = [solids.turned(arm, 2 * math.pi * k / 6) for k in range(6)]
    turning = {"rim": solids.ring(0.8 * radius, 0.9 * radius, -0.42 * height, 0.42 * height),
               "spider": solids.joined(*arms, solids.ring(0.001, 0.2 * radius, -0.5 * height,
                                                          0.3 * height)),
               "coils": solids.joined(*(solids.turned(coil, 2 * math.pi * k / poles)
                                        for k in range(poles))),
               "other poles": solids.joined(*around[1::2]), "painted pole": around[0]}
    if poles > 2:
        turning["poles"] = solids.joined(*around[2::2])
    shapes = {side: out_of_round(machine, side, factor) for side in ("stator", "rotor")}
    return {f"/{side}/{name}": solids.widened(solid, 0.95 * edge, shapes[side])
            for side, edge, parts in (("stator", inner, still), ("rotor", radius, turning))
            for name, solid in parts.items()}


@dataclass(eq=False)
class Parts:
    """The machine in a scene.

    gap: meshes that change with the exaggeration, by path. moving: what moves by its pose, by
    name. riding: the names of what rides on a station of `poses.Stations`, with the station and
    whether it spins.
    """

    server: ViserServer
    machine: Machine
    sizes: Sizes
    gap: dict[str, Any] = field(default_factory=dict)
    moving: dict[str, Any] = field(default_factory=dict)
    riding: list[tuple[str, int, bool]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._out = {side: out_of_round(self.machine, side, 1.0) for side in ("stator", "rotor")}

    def add(self, depths: NDArray, factor: float) -> None:
        """Add all parts. depths: of the shaft's nodes as drawn, m. factor: the exaggeration."""
        machine, stations = self.machine, len(depths)
        self.add_shaft(depths)
        for bearing in machine.thrust_bearings:
            self.add_thrust(bearing)
        self.add_guides()
        if machine.air_gap:
            self.add_gap(factor)
            self.add_pull(0.06 * self.sizes.unit)
        for station, body in enumerate(machine.bodies, stations):
            if not (machine.air_gap and body.name == machine.air_gap.body):
                self.add_body(body)
            self.riding.append((body.name, station, True))
        for station, crack in enumerate(machine.cracks, stations + len(machine.bodies)):
            self.add_crack(crack)
            self.riding.append((f"crack {crack.name}", station, True))
        for load in machine.loads:
            self.add_load(load)

    def solid(self, path: str, solid: solids.Solid, colour: str, flat: bool = True,
              **look: Any) -> Any:
        """Add one solid; without `flat` its edges are smooth."""
        return self.server.scene.add_mesh_simple(
            path, *solid, color=rgb(colour), flat_shading=flat,
            **{"receive_shadow": False, **look})

    def frame(self, name: str, path: str) -> None:
        """Add a frame that carries what lies under its path."""
        self.moving[name] = self.server.scene.add_frame(path, show_axes=False)

    def bones(self, name: str, path: str, solid: solids.Solid, places: NDArray, weights: NDArray,
              colour: str, **look: Any) -> None:
        """Add a solid that bends with bones at `places`, (B, 3)."""
        self.moving[name] = self.server.scene.add_mesh_skinned(
            path, solid[0].astype(np.float32), solid[1].astype(np.uint32),
            bone_wxyzs=np.tile(UPRIGHT, (len(places), 1)), bone_positions=places,
            skin_weights=weights.astype(np.float32), color=rgb(colour), **look)

    def add_shaft(self, depths: NDArray) -> None:
        """The shaft: one skinned mesh with a bone at each node."""
        tube = solids.tube(self.sizes.shaft, -float(depths[-1]), -float(depths[0]), 97)
        places = np.column_stack([np.zeros((len(depths), 2)), -depths])
        self.bones("shaft", "/shaft", tube, places, solids.hat_weights(-tube[0][:, 2], depths),
                   "#A4AEBA", receive_shadow=False)

    def add_gap(self, factor: float) -> None:
        """Stator and rotor of the generator."""
        self.frame("stator", "/stator")
        self.frame(self.machine.air_gap.body, "/rotor")
        for path, solid in gap_solids(self.machine, self.sizes, factor).items():
            self.gap[path] = self.solid(path, solid, GAP_COLOURS[path])
        inner, half, angle = self.sizes.stator, 0.62 * self.sizes.height, teeth(self.sizes)
        wide = math.pi / TEETH - SLOT
        tooth = solids.ring(BORE * inner, inner, -half, half, -wide, wide, 2)
        turns = np.stack([np.cos(angle / 2), 0 * angle, 0 * angle, np.sin(angle / 2)], axis=1)
        self.moving["teeth"] = self.server.scene.add_batched_meshes_simple(
            "/stator/teeth", *tooth, turns, self._bulges(factor), flat_shading=True, lod="off",
            batched_colors=np.full((len(angle), 3), 200, np.uint8), cast_shadow=False,
            receive_shadow=False)

    def _bulges(self, factor: float) -> NDArray:
        """Where the teeth lie on a bore that is not round, m, (T, 3)."""
        angle = teeth(self.sizes)
        out = out_of_round(self.machine, "stator", factor)(angle) * np.ones(len(angle))
        return np.stack([out * np.cos(angle), out * np.sin(angle), 0 * angle], axis=1)

    def dress_pressure(self, away: NDArray, phase: float) -> None:
        """Colour the teeth by the pressure on them, (gap / local gap)² as of a field that the gap
        alone weakens, for a rotor at x, z from the stator's centre, m, turned by its phase, rad.
        """
        gap, angle = self.machine.air_gap.gap, teeth(self.sizes)
        local = gap + self._out["stator"](angle) - self._out["rotor"](angle + phase) - (
            away[0] * np.cos(angle) + away[1] * np.sin(angle))
        share = np.clip(0.5 + np.log2(gap / np.maximum(local, 0.01 * gap)), 0, 1)
        self.moving["teeth"].batched_colors = SHADES[np.round(64 * share).astype(int)]

    def dress_ghost(self, rings: NDArray, colours: NDArray) -> None:
        """What the shaft sweeps: rings at its nodes, (N, P, 3) and their colours, and the ghost
        between them.
        """
        rows, points = rings.shape[:2]
        i, j = np.meshgrid(np.arange(rows - 1), np.arange(points), indexing="ij")
        a, b = i * points + j, i * points + (j + 1) % points
        faces = np.concatenate([np.stack([a, b, b + points], -1).reshape(-1, 3),
                                np.stack([a, b + points, a + points], -1).reshape(-1, 3)])
        self.solid("/sweep", (rings.reshape(-1, 3), faces), "#8058A8", flat=False, opacity=0.2,
                   side="double", cast_shadow=False)
        segments = np.stack([rings, np.roll(rings, -1, axis=1)], axis=2).reshape(-1, 2, 3)
        shades = np.stack([colours, np.roll(colours, -1, axis=1)], axis=2).reshape(-1, 2, 3)
        self.server.scene.add_line_segments("/orbits", segments.astype(np.float32), shades,
                                            thickness=4.0, thickness_units="screen")

    def dress_gap(self, factor: float) -> None:
        """Draw the gap with another exaggeration."""
        for path, (vertices, _) in gap_solids(self.machine, self.sizes, factor).items():
            self.gap[path].vertices = vertices.astype(np.float32)
        if self.machine.shapes:
            self.moving["teeth"].batched_positions = self._bulges(factor).astype(np.float32)

    def add_body(self, body: RigidBody) -> None:
        """A body that is not the generator: a Kaplan runner at the lower end of the shaft, a disc
        anywhere else.
        """
        radius, path = disc_radius(body), f"/bodies/{body.name}"
        self.frame(body.name, path)
        if is_runner(self.machine, body):
            plate = solids.blade(0.5 * radius, TIP * radius, 0.32)
            around = [solids.turned(plate, 2 * math.pi * k / BLADES) for k in range(BLADES)]
            self.solid(f"{path}/hub", solids.swept(np.array(HUB) * radius), "#42545C", flat=False)
            self.solid(f"{path}/blades", solids.joined(*around[1:]), "#87A59A", flat=False,
                       side="double")
            self.add_casing(-float(self.machine.shaft.nodes[body.node] + body.offset), radius)
            self.solid(f"{path}/painted", around[0], PAINT, flat=False, side="double")
            return
        thick = max(0.06 * radius, 0.02)
        self.solid(f"{path}/disc", solids.ring(0.001, radius, -thick, thick), COLOURS["rotor"])
        self.solid(f"{path}/mark", solids.box(0.55 * radius, 0.44 * radius, 0.16 * radius,
                                              -1.05 * thick, 1.05 * thick), PAINT)

    def add_casing(self, height: float, radius: float) -> None:
        """What stands around a runner of a radius, m, at a height, m, cut towards the view: its
        cone, and the wicket gates.
        """
        tip, (low, high) = 1.06 * TIP * radius, self.sizes.uncut
        cone = np.array([[tip, -0.3], [1.15 * tip, -1.0], [1.18 * tip, -1.0], [1.03 * tip, -0.3],
                         [1.03 * tip, 0.35], [tip, 0.35]]) * [1.0, radius]
        self.solid("/casing/cone", solids.raised(solids.swept(cone, low, high, 64), height),
                   "#5C7F8C", opacity=0.45, side="double", cast_shadow=False)
        plate = solids.turned(solids.box(-0.17 * radius, 0.34 * radius, 0.05 * radius,
                                         0.42 * radius, 0.95 * radius), math.radians(55))
        plate = plate[0] + [(GATE - 0.17) * radius, 0.0, 0.0], plate[1]
        around = [solids.turned(plate, a) for a in np.linspace(low, high, GATES, endpoint=False)]
        ring = solids.ring((GATE - 0.35) * radius, GATE * radius, 0.36 * radius, 0.42 * radius, low,
                           high)
        self.solid("/casing/gates", solids.raised(solids.joined(*around, ring), height), "#6C8A96")

    def add_guides(self) -> None:
        """Every bearing that is no thrust bearing, in a housing cut towards the view."""
        r = self.sizes.shaft
        thrust = [bearing.name for bearing in self.machine.thrust_bearings]
        places = bearing_places(self.machine, r)
        for bearing in self.machine.all_bearings:
            if bearing.name in thrust or bearing.name not in places:
                continue
            path, z = f"/bearings/{bearing.name}", places[bearing.name]
            colour, sectors = self.inside_of(bearing)
            pads = [solids.ring(1.9 * r, 3.0 * r, -r, r, *ends, 24) for ends in sectors]
            housing = solids.ring(3.0 * r, 3.9 * r, -1.3 * r, 1.3 * r, *self.sizes.uncut)
            self.solid(f"{path}/pads", solids.raised(solids.joined(*pads), z), colour)
            self.solid(f"{path}/housing", solids.raised(housing, z), "#6E7680")
            if bearing in self.machine.films:
                oil = solids.raised(solids.ring(1.2 * r, 1.9 * r, -r, r), z)
                self.solid(f"{path}/oil", oil, "#E8B93C", opacity=0.5, cast_shadow=False)

    def inside_of(self, bearing: Any) -> tuple[str, list[tuple[float, float]]]:
        """What a guide bearing holds, as a colour and sectors, rad: the bush of a film, the pads of
        the card, all around so that they can be counted, or some that stand for any bearing.
        """
        if bearing in self.machine.films:
            return "#96703C", [self.sizes.uncut]
        if bearing in self.machine.pad_bearings:
            x, z = bearing.law_in_line(self.machine.speed).directions
            wide = min(0.25, 0.8 * math.pi / len(x))
            return "#D69E24", [(a - wide, a + wide) for a in np.arctan2(z, x)]
        low, high = self.sizes.uncut
        return "#D69E24", [(a, a + 0.5) for a in np.arange(low + 0.06, high - 0.5, 0.62)]

    def add_thrust(self, bearing: Any) -> None:
        """A thrust bearing: a broad ring, and on it the collar, which moves with its node."""
        r, z = self.sizes.shaft, bearing_places(self.machine, self.sizes.shaft)[bearing.name]
        seat = solids.ring(1.9 * r, 4.6 * r, -1.4 * r, -0.6 * r, *self.sizes.uncut)
        self.solid(f"/bearings/{bearing.name}", solids.raised(seat, z), "#966E28")
        collar = solids.ring(0.5 * r, 4.0 * r, -0.5 * r, 0.1 * r)
        self.moving[bearing.name] = self.solid(f"/collars/{bearing.name}", collar, "#BEC4CA",
                                               receive_shadow=True)
        self.riding.append((bearing.name, bearing.node, False))

    def add_crack(self, crack: Any) -> None:
        """A crack: its mouth on the surface of the shaft, as wide as its depth makes it."""
        r = self.sizes.shaft
        half = max(math.acos(1 - 2 * crack.depth), 0.1)
        middle = math.pi / 2 - crack.phase
        mouth = solids.ring(0.7 * r, 1.06 * r, -0.1 * r, 0.1 * r, middle - half, middle + half, 24)
        self.frame(f"crack {crack.name}", f"/cracks/{crack.name}")
        self.solid(f"/cracks/{crack.name}/mouth", mouth, PAINT)

    def add_load(self, load: Any) -> None:
        """A force that stands still: an arrow that ends at the shaft."""
        r, depth = self.sizes.shaft, load.offset
        if self.machine.shaft:
            depth += float(self.machine.shaft.nodes[load.node])
        arrow = solids.swept(np.array([[0.001, 0], [0.8 * r, 1.6 * r], [0.3 * r, 1.6 * r],
                                       [0.3 * r, 8 * r], [0.001, 8 * r]]), steps=24)
        # its axis, Z, is laid against the force (x, z) = (sin φ, cos φ)
        push = math.sin(load.direction), math.cos(load.direction)
        out, side = -np.append(push, 0.0), np.array([-push[1], push[0], 0.0])
        turned = arrow[0] @ np.stack([side, [0.0, 0.0, 1.0], out]) + r * out
        self.solid(f"/loads/{load.name}", solids.raised((turned, arrow[1]), -depth),
                   COLOURS["unstable"], side="double")

    def add_pull(self, radius: float) -> None:
        """The pull: an arrow of two bones, its tail and its head, so that it grows by poses alone.
        """
        shaft = np.array([[0.001, 0.0], [radius, 0.0], [radius, 1.0], [0.001, 1.0]])
        head = np.array([[0.001, 1.0], [2.4 * radius, 1.0], [0.001, 1.0 + 5 * radius]])
        vertices, faces = solids.joined(*(solids.swept(part, steps=24) for part in (shaft, head)))
        share = np.minimum(vertices[:, 2], 1.0)
        # the page wants four bones at least
        weights = np.stack([1.0 - share, share, 0 * share, 0 * share], axis=1)
        places = np.eye(4, 3, k=-1) * [1.0, 0.0, 0.0]
        self.bones("pull", "/pull", (vertices[:, [2, 1, 0]] * [1, 1, -1], faces),  # along X
                   places, weights, COLOURS["1X"], side="double")
