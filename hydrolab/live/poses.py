"""From an orbit to where everything is: places and tilts of shaft and bodies at any phase.

The scene has X = x, Y = z and Z up, so Z = −y: seen from above the spin is clockwise, as in the
machine. One factor exaggerates displacements and the air gap: the stator is drawn with the radius
R_s, the rotor with R_s − k·gap, so that they touch on the screen exactly where they touch in the
machine. Another one exaggerates the bow of the shaft, by which it leaves the straight line from the
generator to its far end: as steel bends little, the bow would not be seen with the first.

Here motion: of each station. stator_radius: m. factor: of exaggeration. side: which of the two.
depths: y of the stations, m. where: the stations. flat: what draws the bow no larger than the rest.
turn: with the spin, rad.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.harmonics import PERIOD, synthesise
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.machine.model import rigid_link
from hydrolab.machine.parts import Machine
from hydrolab.machine.pull import outline

STEEPEST = 0.15  # rad; a tilt drawn steeper than this no longer looks like a small one
BENT = 0.3  # rad; the same for the bow of the shaft
STUB = 2.0  # m; half length of the shaft drawn for a point mass on springs, which has none


@dataclass(frozen=True, eq=False)
class Stations:
    """What moves, along the machine: the shaft's nodes first, then the bodies' centres, then the
    middles of cracked elements.

    depths: y, m, (S,). coefficients: [mean, sin 1, cos 1, …] of x, z (m), θx, θz (rad),
    (S, 4, 2m + 1). nodes: how many of them are on the shaft. revolutions: in a period.
    """

    depths: NDArray
    coefficients: NDArray
    nodes: int
    revolutions: int = 1

    def motion(self, phase: NDArray | float) -> NDArray:
        """x, z, θx, θz at a phase Ωt, (S, 4), or at many, (S, 4, P)."""
        found = synthesise(self.coefficients, np.atleast_1d(phase) / self.revolutions)
        return found if np.ndim(phase) else found[..., 0]

    def whole(self, phases: NDArray = PERIOD) -> NDArray:
        """The motion at phases of its whole period, (S, 4, P)."""
        return self.motion(self.revolutions * phases)

    def towards(self, other: Stations, share: float) -> Stations:
        """A motion on the way to another one of the same machine, for the eye: share 0 is this one,
        1 the other.
        """
        q = math.lcm(self.revolutions, other.revolutions)
        size = max(one.coefficients.shape[-1] // 2 * q // one.revolutions for one in (self, other))
        here, there = (one._over(q, size) for one in (self, other))
        return Stations(self.depths, (1 - share) * here + share * there, self.nodes, q)

    def _over(self, revolutions: int, size: int) -> NDArray:
        """The coefficients of the same motion, with `size` harmonics of so many revolutions."""
        own, by = self.coefficients, revolutions // self.revolutions
        found = np.zeros((*own.shape[:-1], 2 * size + 1))
        found[..., 0] = own[..., 0]
        found[..., 2 * by - 1::2 * by][..., :own.shape[-1] // 2] = own[..., 1::2]
        found[..., 2 * by::2 * by][..., :own.shape[-1] // 2] = own[..., 2::2]
        return found


def stations(machine: Machine, orbit: PeriodicOrbit) -> Stations:
    """The stations of a machine on an orbit."""
    nodes, depths, coefficients = at_stations(machine, orbit.model.at_nodes(orbit.shaft))
    return Stations(depths, coefficients, nodes, orbit.revolutions)


def at_stations(machine: Machine, nodes: NDArray) -> tuple[int, NDArray, NDArray]:
    """How many nodes there are, all stations' depths, and x, z, θx, θz there, (S, 4, columns), from
    those of the shaft's nodes, (N, 4, columns). A point mass is drawn in the middle of a shaft held
    at both ends.
    """
    columns = nodes.shape[2]
    if machine.shaft is None:
        disc = np.zeros((3, 4, columns))
        disc[1, :2] = nodes[0]
        return 3, np.array([-STUB, 0.0, STUB, 0.0]), np.concatenate([disc, disc[1:2]])
    depths = machine.shaft.nodes
    bodies = [rigid_link(body.offset) @ nodes[body.node] for body in machine.bodies]
    ends = np.array([[crack.element, crack.element + 1] for crack in machine.cracks], int)
    middles = nodes[ends.reshape(-1, 2)].mean(axis=1)
    return (len(nodes),
            np.concatenate([depths, [depths[b.node] + b.offset for b in machine.bodies],
                            depths[ends.reshape(-1, 2)].mean(axis=1)]),
            np.concatenate([nodes, np.reshape(bodies, (-1, 4, columns)), middles]))


@dataclass(frozen=True, eq=False)
class Magnified:
    """How displacements and tilts are drawn: k times as large, and bow times the bow of the shaft,
    by which it leaves the straight line through two of the stations.

    keeps: the stations that ride on that line.
    """

    depths: NDArray
    ends: tuple[int, int]
    keeps: tuple[int, ...]
    k: float
    bow: float

    def __call__(self, motion: NDArray) -> NDArray:
        """A motion (S, 4, …) as it is drawn."""
        bent = motion - self.line(motion)
        bent[list(self.keeps)] = 0.0
        return self.k * motion + (self.bow - self.k) * bent

    def line(self, motion: NDArray) -> NDArray:
        """The straight line, as a motion of all stations."""
        one, other = self.ends
        length = self.depths[other] - self.depths[one]
        if not length:
            return motion.copy()
        slope = (motion[other, :2] - motion[one, :2]) / length
        away = (self.depths - self.depths[one]).reshape(-1, *[1] * (motion.ndim - 1))
        # θx = ∂z/∂y, θz = −∂x/∂y
        tilt = np.stack([slope[1], -slope[0]])
        return np.concatenate([motion[one, :2] + away * slope,
                               np.broadcast_to(tilt, (len(motion), *tilt.shape))], axis=1)


def magnified(machine: Machine, where: Stations, k: float, bow: float) -> Magnified:
    """Displacements times `k`; the bow between the generator and the end far from it times `bow`.
    """
    spinning = [where.nodes + i for i in range(len(machine.bodies))]
    if machine.shaft is None:
        return Magnified(where.depths, (0, 0), (), k, bow)
    gap = machine.air_gap
    one = where.nodes + [body.name for body in machine.bodies].index(gap.body) if gap else 0
    other = max((0, where.nodes - 1), key=lambda i: abs(where.depths[i] - where.depths[one]))
    on_line = [i for i in spinning if i == one or where.depths[i] == where.depths[other]]
    return Magnified(where.depths, (one, other), tuple(on_line), k, bow)


def steepest(where: Stations) -> float:
    """Largest tilt over a revolution, rad."""
    return float(np.hypot(*where.whole()[:, 2:].transpose(1, 0, 2)).max())


def largest_exaggeration(where: Stations) -> float:
    """The factor at which the steepest tilt would be drawn with STEEPEST; inf where nothing tilts.
    """
    tilt = steepest(where)
    return STEEPEST / tilt if tilt else math.inf


def largest_bow(flat: Magnified, where: Stations) -> float:
    """The factor of the bow at which it would be drawn with a tilt of BENT; inf where it is
    straight.
    """
    tilt = float(np.hypot(*replace(flat, k=0.0, bow=1.0)(where.whole())[:, 2:]
                          .transpose(1, 0, 2)).max())
    return flat.k + BENT / tilt if tilt else math.inf


def positions(depths: NDArray, motion: NDArray) -> NDArray:
    """Points in the scene, m, (S, 3), from a motion (S, 4) as it is drawn."""
    return np.column_stack([motion[:, 0], motion[:, 1], -depths])


def quaternions(motion: NDArray, turn: float = 0.0) -> NDArray:
    """Orientations wxyz, (S, 4): the tilt as it is drawn after a turn with the spin, rad.

    A rotation vector (θx, θy, θz) of the machine is (θx, θz, −θy) in the scene; the spin is about
    +y, so about −Z.
    """
    tilt = motion[:, 2:]
    angle = np.hypot(*tilt.T)
    sine = 0.5 * np.sinc(angle / (2 * np.pi))  # sin(angle/2)/angle, also at 0
    leaning = np.column_stack([np.cos(angle / 2), sine * tilt[:, 0], sine * tilt[:, 1],
                               np.zeros(len(tilt))])
    c, s = math.cos(turn / 2), -math.sin(turn / 2)
    w, x, y, z = leaning.T
    return np.column_stack([c * w - s * z, c * x + s * y, c * y - s * x, c * z + s * w])


def drawn_rotor_radius(stator_radius: float, gap: float, factor: float) -> float:
    """R_s − k·gap, m: the rotor's radius that makes contact on the screen contact in the machine.
    """
    return stator_radius - factor * gap


def out_of_round(machine: Machine, side: str, factor: float) -> Callable[[NDArray], NDArray]:
    """By how much the "stator" or the "rotor" is drawn wider at angles about Z, from X, m.

    Shapes are drawn larger by the factor of the gap. Gap angles run from z towards x, so that of
    an angle about Z is π/2 less the angle; the rotor's are those at phase 0.
    """
    bulges = tuple(shape.bulge() for shape in machine.shapes if shape.of == side)
    return lambda angle: factor * outline(bulges, np.pi / 2 - angle)


def orbit_rings(depths: NDArray, path: NDArray, radius: float,
                points: int = 48) -> tuple[NDArray, NDArray]:
    """What a shaft of the drawn `radius` (m) sweeps at each node in a period, and how far from rest
    that takes its axis, m.

    depths: of the nodes, m, (N,). path: x, z of their axis as drawn, m, (N, 2, P). Points
    (N, points, 3) and distances (N, points). A drawn shaft hides its axis' orbit, so this is the
    orbit's convex outline grown by the radius: in each direction the farthest point of the orbit,
    and the radius on.
    """
    angle = 2 * np.pi * np.arange(points) / points
    towards = np.stack([np.cos(angle), np.sin(angle)])
    farthest = np.argmax(np.einsum("ncp,ca->nap", path, towards), axis=2)
    reached = np.take_along_axis(path, farthest[:, None, :], axis=2)
    place = np.stack([*(reached + radius * towards).transpose(1, 0, 2),
                      np.broadcast_to(-depths[:, None], farthest.shape)], axis=-1)
    return place, np.hypot(reached[:, 0], reached[:, 1])
