"""From an orbit to where everything is: places and tilts of shaft and bodies at any phase.

The scene has X = x, Y = z and Z up, so Z = −y: seen from above the spin is clockwise, as in the
machine. One factor exaggerates displacements, tilts and the air gap: the stator is drawn with the
radius R_s, the rotor with R_s − k·gap, so that they touch on the screen exactly where they touch in
the machine.

Here motion: of each station. stator_radius: m. factor: of exaggeration. side: which of the two.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.harmonics import PERIOD, synthesise
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.machine.model import rigid_link
from hydrolab.machine.parts import Machine
from hydrolab.machine.pull import outline

STEEPEST = 0.15  # rad; a tilt drawn steeper than this no longer looks like a small one
STUB = 2.0  # m; half length of the shaft drawn for a point mass on springs, which has none


@dataclass(frozen=True, eq=False)
class Stations:
    """What moves, along the machine: the shaft's nodes first, then the bodies' centres, then the
    middles of cracked elements.

    depths: y, m, (S,). coefficients: [mean, sin 1, cos 1, …] of x, z (m), θx, θz (rad),
    (S, 4, 2m + 1). nodes: how many of them are on the shaft.
    """

    depths: NDArray
    coefficients: NDArray
    nodes: int

    def motion(self, phase: NDArray | float) -> NDArray:
        """x, z, θx, θz at a phase Ωt, (S, 4), or at many, (S, 4, P)."""
        found = synthesise(self.coefficients, np.atleast_1d(phase))
        return found if np.ndim(phase) else found[..., 0]

    def towards(self, other: Stations, share: float) -> Stations:
        """A motion on the way to another one of the same machine, for the eye: share 0 is this one,
        1 the other.
        """
        return Stations(self.depths, (1 - share) * self.coefficients + share * other.coefficients,
                        self.nodes)


def stations(machine: Machine, orbit: PeriodicOrbit) -> Stations:
    """The stations of a machine on an orbit. A point mass is drawn in the middle of a shaft held at
    both ends.
    """
    nodes = orbit.model.at_nodes(orbit.shaft)
    columns = nodes.shape[2]
    if machine.shaft is None:
        disc = np.zeros((3, 4, columns))
        disc[1, :2] = nodes[0]
        return Stations(np.array([-STUB, 0.0, STUB, 0.0]), np.concatenate([disc, disc[1:2]]), 3)
    depths = machine.shaft.nodes
    bodies = [rigid_link(body.offset) @ nodes[body.node] for body in machine.bodies]
    ends = np.array([[crack.element, crack.element + 1] for crack in machine.cracks], int)
    middles = nodes[ends.reshape(-1, 2)].mean(axis=1)
    return Stations(np.concatenate([depths, [depths[b.node] + b.offset for b in machine.bodies],
                                    depths[ends.reshape(-1, 2)].mean(axis=1)]),
                    np.concatenate([nodes, np.reshape(bodies, (-1, 4, columns)), middles]),
                    len(nodes))


def steepest(where: Stations) -> float:
    """Largest tilt over a revolution, rad."""
    return float(np.hypot(*where.motion(PERIOD)[:, 2:].transpose(1, 0, 2)).max())


def largest_exaggeration(where: Stations) -> float:
    """The factor at which the steepest tilt would be drawn with STEEPEST; inf where nothing tilts.
    """
    tilt = steepest(where)
    return STEEPEST / tilt if tilt else math.inf


def positions(where: Stations, motion: NDArray, factor: float) -> NDArray:
    """Points in the scene, m, (S, 3), from a motion (S, 4) exaggerated by `factor`."""
    return np.column_stack([factor * motion[:, 0], factor * motion[:, 1], -where.depths])


def quaternions(motion: NDArray, factor: float, turn: float = 0.0) -> NDArray:
    """Orientations wxyz, (S, 4): the tilt exaggerated by `factor` after a turn with the spin, rad.

    A rotation vector (θx, θy, θz) of the machine is (θx, θz, −θy) in the scene; the spin is about
    +y, so about −Z.
    """
    tilt = factor * motion[:, 2:]
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


def orbit_rings(where: Stations, factor: float, radius: float,
                points: int = 96) -> tuple[NDArray, NDArray]:
    """What a shaft of the drawn `radius` (m) sweeps at each node in a turn, and how far from rest
    that takes its axis, m.

    Line segments (nodes · points, 2, 3) and distances (nodes · points, 2). A drawn shaft hides its
    axis' orbit, so this is the orbit's convex outline grown by the radius: in each direction the
    farthest point of the orbit, and the radius on.
    """
    path = where.motion(PERIOD)[:where.nodes, :2]
    angle = 2 * np.pi * np.arange(points + 1) / points
    towards = np.stack([np.cos(angle), np.sin(angle)])
    farthest = np.argmax(np.einsum("ncp,ca->nap", path, towards), axis=2)
    reached = np.take_along_axis(path, farthest[:, None, :], axis=2)
    place = np.stack([*(factor * reached + radius * towards).transpose(1, 0, 2),
                      np.broadcast_to(-where.depths[:where.nodes, None], farthest.shape)], axis=-1)
    away = np.hypot(reached[:, 0], reached[:, 1])
    return (np.stack([place[:, :-1], place[:, 1:]], axis=2).reshape(-1, 2, 3),
            np.stack([away[:, :-1], away[:, 1:]], axis=2).reshape(-1, 2))
