"""Which steady state does the rotor end in? Thousands of starts, advanced together."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.splitting import advance, split
from hydrolab.errors import BadInput

CONTACT, OTHER = -1, -2
CLOSE = 0.02  # of the gap: how near an orbit a motion must end to count as having reached it


@dataclass(frozen=True, eq=False)
class Basins:
    """Where each start ends, on a grid of displacements (columns) and velocities (rows).

    displacement: m, (columns,). velocity: m/s, (rows,). Both are added to the first orbit at phase 0, along x, in the
    shape of the static deflection under the pull. ends: index of the orbit reached, −1 for contact, −2 for anything
    else, (rows, columns). contact: revolutions until contact, nan where there was none. orbits: as given. revolutions:
    as many as were made, fewer than asked for after an interrupt.
    """

    displacement: NDArray
    velocity: NDArray
    ends: NDArray
    contact: NDArray
    orbits: tuple[PeriodicOrbit, ...]
    revolutions: int

    def share(self, end: int) -> float:
        """Share of the starts that end so."""
        return float(np.mean(self.ends == end))

    def __str__(self) -> str:
        shares = [f"{100 * self.share(i):.1f} % on orbit {i}" for i in range(len(self.orbits))]
        return (f"{self.ends.size} starts after {self.revolutions} revolutions: {', '.join(shares)}, "
                f"{100 * self.share(CONTACT):.1f} % in contact, {100 * self.share(OTHER):.1f} % on none of these.")


def basins(orbits: Sequence[PeriodicOrbit], displacement: ArrayLike, velocity: ArrayLike, *, revolutions: int = 200,
           steps: int = 128, modes: int = 6, progress: Callable[[int, int], None] | None = None) -> Basins:
    """Start the generator off the first orbit with every pair of displacement (m) and velocity (m/s), and see.

    orbits: steady states of one model at one speed and eccentricity; usually the stable ones.
    Raises BadInput where they are not, or a start is not finite. A start outside the gap counts as contact at once.
    """
    displacement, velocity = np.atleast_1d(displacement).astype(float), np.atleast_1d(velocity).astype(float)
    if not orbits:
        raise BadInput("orbits is empty; give at least one steady state to start from.")
    first = orbits[0]
    if any(o.model is not first.model or o.speed != first.speed or np.abs(o.centre - first.centre).max() > 1e-12
           for o in orbits):
        raise BadInput("the orbits belong to different models, speeds or eccentricities; basins are of one.")
    if not (np.isfinite(displacement).all() and np.isfinite(velocity).all()):
        raise BadInput("a starting displacement or velocity is not finite.")
    system = split(first.model, first.speed, modes)
    small, r = system.model, system.model.size
    generator = small.selection[:2]
    shape = np.linalg.solve(small.K, generator.T)
    shape = shape @ np.linalg.solve(generator @ shape, [1.0, 0.0])
    grid_v, grid_d = np.meshgrid(velocity, displacement, indexing="ij")
    start = system.state(first, first.model)[:, None] + np.vstack([np.outer(shape, grid_d), np.outer(shape, grid_v)])
    states, contact, made = advance(system, start, first.centre, revolutions, steps, progress=progress)

    scale = np.concatenate([np.full(2, small.gap), np.full(2, small.gap * first.speed)])
    ends = np.full(states.shape[1], OTHER)
    nearest = np.full(states.shape[1], math.inf)
    look = np.zeros((4, 2 * r))
    look[:2, :r] = look[2:, r:] = generator
    for index, orbit in enumerate(orbits):
        there = look @ system.state(orbit, first.model)
        away = np.abs((look @ states - there[:, None]) / scale[:, None]).max(axis=0)
        closer = (away < CLOSE) & (away < nearest)
        ends[closer], nearest[closer] = index, away[closer]
    ends[np.isfinite(contact)] = CONTACT
    grid = (len(velocity), len(displacement))
    return Basins(displacement, velocity, ends.reshape(grid), contact.reshape(grid), tuple(orbits), made)
