"""Which force laws a machine's parts bring, and on which coordinates u = S q.

The first two coordinates are the (x, z) of the generator's centre; the pull's law may have more (`air_gap_law`), and each
nonlinear bearing and crack adds its own two. One plain law stays as it is, several go side by side.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hydrolab.machine.fault_parts import Crack
from hydrolab.machine.forces import CircularPull, ForceLaw, LinearPull
from hydrolab.machine.parts import Machine
from hydrolab.machine.several import Placed, SeveralLaws
from hydrolab.machine.shapes import shaped_law
from hydrolab.machine.tangential import TangentialPull
from hydrolab.machine.tilted_pull import TiltedPull


def air_gap_law(machine: Machine, centre: NDArray) -> tuple[ForceLaw, NDArray]:
    """The law of the air gap and the rows of its coordinates, (c, n).

    centre: the rows of the (x, z) of the body in the gap, (2, n). Without an air gap the law is zero everywhere.
    """
    air = machine.air_gap
    if air is None:
        return CircularPull(0.0, math.inf), centre
    law, rows = upright_law(machine), centre
    if air.tilt:
        law = TiltedPull(law, air.length)
        rows = np.vstack([centre, slopes(machine.body(air.body).node, centre.shape[1])])
    if air.tangential:
        across = TangentialPull(air.tangential * air.pull_stiffness, air.gap)
        law = SeveralLaws((Placed(law, slice(0, len(rows)), magnetic=True), Placed(across, slice(0, 2), magnetic=True)))
    return law, rows


def upright_law(machine: Machine) -> ForceLaw:
    """The pull of the air gap along the eccentricity, of a rotor that does not tilt."""
    air = machine.air_gap
    if machine.poles:
        return machine.poles.law(air.pull_stiffness, air.gap)
    if machine.shapes:
        stator, rotor = (tuple(s.bulge() for s in machine.shapes if s.of == side) for side in ("stator", "rotor"))
        return shaped_law(air.pull_stiffness, air.gap, stator, rotor)
    return (LinearPull if air.linear else CircularPull)(air.pull_stiffness, air.gap)


def slopes(node: int, size: int) -> NDArray:
    """Rows of the slopes (∂x/∂y, ∂z/∂y) = (−θz, θx) at a node of a shaft, (2, size)."""
    rows = np.zeros((2, size))
    rows[0, 4 * node + 3], rows[1, 4 * node + 2] = -1.0, 1.0
    return rows


def place(node: int, per_node: int, size: int) -> NDArray:
    """Rows of the (x, z) of a node, (2, size)."""
    return np.eye(size)[per_node * node:per_node * node + 2]


def crack_law(machine: Machine, crack: Crack) -> ForceLaw:
    """The law of a crack in its element."""
    shaft, i = machine.shaft, crack.element
    return crack.law(shaft.young, shaft.poisson, float(shaft.diameter[i]), float(shaft.young * shaft.second_moment[i]),
                     float(np.diff(shaft.nodes)[i]))


def attach(machine: Machine, per_node: int, centre: NDArray) -> tuple[ForceLaw, NDArray]:
    """The law of a whole machine and its selection S, (c, n). centre: as in `air_gap_law`."""
    size = centre.shape[1]
    pull, rows = air_gap_law(machine, centre)
    more = [(pads.law(), place(pads.node, per_node, size)) for pads in machine.pad_bearings]
    more += [(film.law(machine.speed), place(film.node, per_node, size)) for film in machine.films]
    more += [(crack_law(machine, crack), slopes(crack.element + 1, size) - slopes(crack.element, size))
             for crack in machine.cracks]
    if not more:
        return pull, rows
    placed = [Placed(pull, slice(0, len(rows)), magnetic=True)]
    for law, own in more:
        placed.append(Placed(law, slice(len(rows), len(rows) + 2)))
        rows = np.vstack([rows, own])
    return SeveralLaws(tuple(placed)), rows
