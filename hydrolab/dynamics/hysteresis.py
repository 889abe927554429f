"""What a machine does when its eccentricity grows and shrinks slowly: jumps and hysteresis, in time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.splitting import Split, advance, split
from hydrolab.errors import BadInput


@dataclass(frozen=True, eq=False)
class Passage:
    """A motion while the static eccentricity moved in small steps.

    static_eccentricity: shape (n,), in the order passed. section: (x, z) of the generator centre at phase 0 after each
    of the last revolutions at that value, m, (n, kept, 2). stopped: why it ends, in words.
    """

    static_eccentricity: NDArray
    section: NDArray
    stopped: str

    @property
    def settled(self) -> NDArray:
        """Whether the motion repeats every revolution to 1 µm at each value, (n,)."""
        return np.ptp(self.section, axis=1).max(axis=1) < 1e-6


def sweep_in_time(start: PeriodicOrbit, values: Iterable[float], *, revolutions: int = 80, keep: int = 8,
                  steps: int = 128, modes: int = 12, progress: Callable[[int, int], None] | None = None) -> Passage:
    """Begin on an orbit and move the stator through these eccentricities, waiting `revolutions` at each.

    keep: revolutions at each value whose Poincaré section is kept. Ends early at contact.
    Raises BadInput for values or numbers that do not fit.
    """
    values = np.array([float(v) for v in values])
    if not len(values) or not np.isfinite(values).all() or np.abs(values).max() >= 1:
        raise BadInput("values must be eccentricities, finite fractions of the gap between -1 and 1, at least one.")
    if not 1 <= keep <= revolutions:
        raise BadInput(f"keep is {keep}; it must lie between 1 and the {revolutions} revolutions.")
    system = split(start.model, start.speed, modes)
    unit = np.array([math.sin(direction := _direction(start)), math.cos(direction)])
    centre = start.centre
    state = system.state(start, start.model) + system.response(0.0, centre)
    sections: list[NDArray] = []
    for i, value in enumerate(values):
        centre = value * start.model.gap * unit
        state, contact = _move(system, state, centre, revolutions - keep, steps)
        section = []
        for _ in range(keep):
            if contact is None:
                state, contact = _move(system, state, centre, 1, steps)
                section.append(system.watch @ state)
        if contact is not None:
            stopped = f"The rotor touches the stator at {100 * value:.4g} %."
            return Passage(values[:i], np.array(sections).reshape(i, keep, 2), stopped)
        sections.append(np.array(section))
        if progress:
            progress(i + 1, len(values))
    return Passage(values, np.array(sections), "It passed all the values asked for.")


def poincare(start: PeriodicOrbit, static_eccentricity: float, *, revolutions: int = 600, keep: int = 300,
             steps: int = 256, modes: int = 12) -> Passage:
    """The Poincaré section at one eccentricity, of a motion that begins on an orbit found elsewhere."""
    return sweep_in_time(start, [static_eccentricity], revolutions=revolutions, keep=keep, steps=steps, modes=modes)


def _direction(orbit: PeriodicOrbit) -> float:
    return math.atan2(*orbit.centre) if orbit.centre.any() else math.pi / 2


def _move(system: Split, state: NDArray, centre: NDArray, revolutions: int, steps: int) -> tuple[NDArray, float | None]:
    """A whole state [q, q̇] moved on by whole revolutions, and when it touched the stator, if it did."""
    if not revolutions:
        return state, None
    base = system.response(0.0, centre)
    moved, contact = advance(system, (state - base)[:, None], centre, revolutions, steps)
    return moved[:, 0] + base, float(contact[0]) if math.isfinite(contact[0]) else None
