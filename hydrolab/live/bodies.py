"""The parts of the 3D machine as nodes of the scene: what stands still and what moves by its pose.
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
from hydrolab.live.poses import STUB
from hydrolab.machine.parts import Machine, RigidBody

# where the camera of the first view stands, and with it the cut in the stator
AZIMUTH = math.radians(-58)
CUT = math.radians(50)  # half of the sector that is cut away
BLADES = 5
LEFT = np.array([math.sin(AZIMUTH), -math.cos(AZIMUTH), 0.0])  # to the left of the first view
TIP = 1.75  # a runner's blades reach so far beyond the solid disc of its mass and inertia


def rgb(colour: str) -> tuple[int, int, int]:
    """A colour for a mesh, which reads sRGB."""
    return tuple(round(255 * c) for c in to_rgb(colour))


def linear_rgb(colours: NDArray) -> NDArray:
    """Colours (…, 3) from 0 to 1 for the points of lines, which read linear light (one colour of
    all does not).
    """
    c = np.asarray(colours)
    return np.round(255 * np.where(c <= 0.04045, c / 12.92,
                                   ((c + 0.055) / 1.055) ** 2.4)).astype(np.uint8)


def orbit_colours(away: NDArray, largest: float) -> NDArray:
    """Colours of points that are so far from rest, m: from dark violet to orange, never near white.
    """
    share = np.clip(away / largest if largest else away, 0, 1)
    return linear_rgb(colormaps["inferno"](0.15 + 0.63 * share)[..., :3])


@dataclass(frozen=True)
class Sizes:
    """Sizes of the drawing, m: inner radius of the stator, height of the rotor, radius of the slim
    shaft, top and bottom.
    """

    stator: float
    height: float
    shaft: float
    top: float
    bottom: float

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
    length = machine.shaft.length
    ends = [0.0, -length] + [-(float(machine.shaft.nodes[b.node]) + b.offset)
                             for b in machine.bodies]
    return Sizes(stator, gap.length if gap else 0.0,
                 min(float(machine.shaft.diameter.max()) / 2, 0.022 * length),
                 max(ends), min(ends))


def disc_radius(body: RigidBody) -> float:
    """Radius of a solid disc with the body's mass and polar inertia, m: the size it is drawn with
    where none is known.
    """
    return math.sqrt(2 * body.Ip / body.mass) if body.Ip else 0.5


def is_runner(machine: Machine, body: RigidBody) -> bool:
    """Whether a body is drawn as a Kaplan runner: at the lower end of a shaft that carries a
    generator.
    """
    return machine.air_gap is not None and machine.shaft is not None and body.node == len(machine.shaft.nodes) - 1


def drawn_radius(machine: Machine, body: RigidBody) -> float:
    """How far from the axis a body that is not the generator's rotor is drawn, m."""
    return (TIP if is_runner(machine, body) else 1.0) * disc_radius(body)


@dataclass(eq=False)
class Nodes:
    """Handles of what changes: meshes by name, and whatever moves by its pose."""

    meshes: dict[str, Any] = field(default_factory=dict)
    moving: dict[str, Any] = field(default_factory=dict)


def rotor_solids(machine: Machine, radius: float) -> dict[str, solids.Solid]:
    """The generator's rotor with the drawn radius: rim, spider, and its poles in two colours and
    one painted.
    """
    height, poles = machine.air_gap.length, 32
    depth = 0.1 * radius
    block = solids.box(radius - depth, depth, 0.72 * 2 * math.pi * radius / poles, -height / 2,
                       height / 2)
    around = [solids.turned(block, 2 * math.pi * k / poles) for k in range(poles)]
    rim = solids.ring(0.8 * radius, radius - depth, -0.42 * height, 0.42 * height, steps=96)
    arms = [solids.turned(solids.box(0.05 * radius, 0.77 * radius, 0.12 * radius, -0.2 * height,
                                     0.12 * height),
                          2 * math.pi * k / 6) for k in range(6)]
    hub = solids.ring(0.001, 0.2 * radius, -0.5 * height, 0.3 * height)
    return {"rim": rim, "spider": solids.joined(*arms, hub), "poles": solids.joined(*around[2::2]),
            "other poles": solids.joined(*around[1::2]), "painted pole": around[0]}


def add_rotor(server: ViserServer, nodes: Nodes, machine: Machine, radius: float) -> None:
    """The generator's rotor; its meshes are replaced when the exaggeration changes."""
    nodes.moving[machine.air_gap.body] = server.scene.add_frame("/rotor", show_axes=False)
    colours = {"rim": "#3A4656", "spider": "#8FA3B3", "poles": "#0072B2", "other poles": "#56B4E9",
               "painted pole": COLOURS["unstable"]}
    for name, solid in rotor_solids(machine, radius).items():
        nodes.meshes[name] = server.scene.add_mesh_simple(f"/rotor/{name}", *solid,
                                                          color=rgb(colours[name]),
                                                          flat_shading=True, receive_shadow=False)


def add_stator(server: ViserServer, nodes: Nodes, sizes: Sizes) -> None:
    """The stator, cut away towards the first view: a clear wall between dark rims, and the ends of
    its copper winding.
    """
    inner, outer, half = sizes.stator, 1.16 * sizes.stator, 0.62 * sizes.height
    start, end = AZIMUTH + CUT, AZIMUTH + 2 * math.pi - CUT
    nodes.moving["stator"] = server.scene.add_frame("/stator", show_axes=False)
    rim, coil = 0.05 * sizes.height, 0.16 * sizes.height
    wall = solids.ring(inner, outer, -half, half, start, end, 96)
    rims = [solids.ring(inner, outer, z, z + rim, start, end, 96) for z in (-half - rim, half)]
    low, high = 1.02 * inner, 1.07 * inner
    coils = [solids.swept(np.array([[low, z], [high, z], [high + 0.01 * inner, z + coil],
                                    [low + 0.01 * inner, z + coil]]),
                          start + 0.02, end - 0.02, 96) for z in (-half - rim - coil, half + rim)]
    still = {"flat_shading": True, "receive_shadow": False}
    server.scene.add_mesh_simple("/stator/wall", *wall, color=(72, 96, 130), opacity=0.38,
                                 cast_shadow=False, **still)
    server.scene.add_mesh_simple("/stator/rims", *solids.joined(*rims), color=(28, 42, 62), **still)
    server.scene.add_mesh_simple("/stator/winding", *solids.joined(*coils), color=(184, 104, 52),
                                 **still)


def add_body(server: ViserServer, nodes: Nodes, machine: Machine, body: RigidBody) -> None:
    """A body that is not the generator: a Kaplan runner at the lower end of the shaft, a disc
    anywhere else.
    """
    radius, path = disc_radius(body), f"/bodies/{body.name}"
    nodes.moving[body.name] = server.scene.add_frame(path, show_axes=False)
    if is_runner(machine, body):
        outline = [[0.001, -0.95], [0.16, -0.9], [0.42, -0.62], [0.62, -0.25], [0.66, 0.1],
                   [0.58, 0.34], [0.3, 0.46],
                   [0.001, 0.46]]
        hub = solids.swept(np.array(outline) * radius)
        plate = solids.blade(0.5 * radius, TIP * radius, 0.32)
        around = [solids.turned(plate, 2 * math.pi * k / BLADES) for k in range(BLADES)]
        server.scene.add_mesh_simple(f"{path}/hub", *hub, color=(66, 84, 92), receive_shadow=False)
        server.scene.add_mesh_simple(f"{path}/blades", *solids.joined(*around[1:]),
                                     color=rgb(COLOURS["stable"]),
                                     side="double", receive_shadow=False)
        server.scene.add_mesh_simple(f"{path}/painted", *around[0], color=rgb(COLOURS["unstable"]),
                                     side="double",
                                     receive_shadow=False)
        return
    thick = max(0.06 * radius, 0.02)
    server.scene.add_mesh_simple(f"{path}/disc", *solids.ring(0.001, radius, -thick, thick),
                                 color=rgb(COLOURS["rotor"]),
                                 flat_shading=True, receive_shadow=False)
    mark = solids.box(0.55 * radius, 0.44 * radius, 0.16 * radius, -1.05 * thick, 1.05 * thick)
    server.scene.add_mesh_simple(f"{path}/mark", *mark, color=rgb(COLOURS["unstable"]),
                                 flat_shading=True)


def add_shaft(server: ViserServer, nodes: Nodes, depths: NDArray, radius: float) -> None:
    """The shaft: one skinned mesh with a bone at each node."""
    low, high = -float(depths[-1]), -float(depths[0])
    vertices, faces = solids.tube(radius, low, high, 97)
    weights = solids.hat_weights(-vertices[:, 2], depths)
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (len(depths), 1))
    rest = np.column_stack([np.zeros((len(depths), 2)), -depths])
    nodes.moving["shaft"] = server.scene.add_mesh_skinned(
        "/shaft", vertices.astype(np.float32), faces.astype(np.uint32), bone_wxyzs=upright,
        bone_positions=rest,
        skin_weights=weights.astype(np.float32), color=(164, 174, 186), receive_shadow=False)


def add_bearings(server: ViserServer, machine: Machine, sizes: Sizes) -> None:
    """Guide bearings as pads in a housing cut towards the view; the thrust bearing as a broad ring
    below a collar.
    """
    if machine.shaft is None:
        return
    start, end = AZIMUTH + CUT, AZIMUTH + 2 * math.pi - CUT
    r = sizes.shaft
    for bearing in machine.bearings:
        z = -float(machine.shaft.nodes[bearing.node])
        pads = [solids.ring(1.9 * r, 3.0 * r, -r, r, a, a + 0.5, 10)
                for a in np.arange(start + 0.06, end - 0.5, 0.62)]
        housing = solids.joined(solids.ring(3.0 * r, 3.9 * r, -1.3 * r, 1.3 * r, start, end))
        path = f"/bearings/{bearing.name}"
        server.scene.add_mesh_simple(f"{path}/pads", *solids.moved(solids.joined(*pads), z=z),
                                     color=(214, 158, 36),
                                     flat_shading=True, receive_shadow=False)
        server.scene.add_mesh_simple(f"{path}/housing", *solids.moved(housing, z=z),
                                     color=(110, 118, 128),
                                     flat_shading=True, receive_shadow=False)
    for bearing in machine.thrust_bearings:
        z = -float(machine.shaft.nodes[bearing.node])
        ring = solids.moved(solids.ring(1.9 * r, 4.6 * r, -1.4 * r, -0.6 * r, start, end), z=z)
        server.scene.add_mesh_simple(f"/bearings/{bearing.name}", *ring, color=(150, 110, 40),
                                     flat_shading=True,
                                     receive_shadow=False)


def add_collars(server: ViserServer, nodes: Nodes, machine: Machine, sizes: Sizes) -> None:
    """The collar that rests on each thrust bearing; it moves with its node."""
    for bearing in machine.thrust_bearings:
        collar = solids.ring(0.5 * sizes.shaft, 4.0 * sizes.shaft, -0.5 * sizes.shaft,
                             0.1 * sizes.shaft)
        nodes.moving[bearing.name] = server.scene.add_mesh_simple(f"/collars/{bearing.name}",
                                                                  *collar,
                                                                  color=(190, 196, 202),
                                                                  flat_shading=True)


def add_pull(server: ViserServer, nodes: Nodes, radius: float) -> None:
    """The pull: an arrow of two bones, its tail and its head, so that it grows by poses alone."""
    shaft = np.array([[0.001, 0.0], [radius, 0.0], [radius, 1.0], [0.001, 1.0]])
    head = np.array([[0.001, 1.0], [2.4 * radius, 1.0], [0.001, 1.0 + 5 * radius]])
    vertices, faces = solids.joined(solids.swept(shaft, steps=24), solids.swept(head, steps=24))
    share = np.minimum(vertices[:, 2], 1.0)
    # the page wants four bones at least
    weights = np.stack([1.0 - share, share, 0 * share, 0 * share], axis=1)
    vertices = vertices[:, [2, 1, 0]] * [1, 1, -1]  # along X
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (4, 1))
    nodes.moving["pull"] = server.scene.add_mesh_skinned(
        "/pull", vertices.astype(np.float32), faces.astype(np.uint32), bone_wxyzs=upright,
        bone_positions=np.array([[0.0, 0, 0], [1.0, 0, 0], [0.0, 0, 0], [0.0, 0, 0]]),
        skin_weights=weights.astype(np.float32), color=rgb(COLOURS["1X"]), side="double")
