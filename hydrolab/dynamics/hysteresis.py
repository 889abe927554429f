"""What a machine does when its eccentricity grows and shrinks slowly: jumps and hysteresis, in time."""

from __future__ import annotations

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

    def __str__(self) -> str:
        return (f"Motion through {len(self.static_eccentricity)} eccentricities, on an orbit of one revolution at "
                f"{int(self.settled.sum())} of them. {self.stopped}")


def sweep_in_time(start: PeriodicOrbit, values: Iterable[float], *, revolutions: int = 80, keep: int = 8,
                  steps: int = 128, modes: int = 12, progress: Callable[[int, int], None] | None = None) -> Passage:
    """Begin on an orbit and move the stator through these eccentricities, waiting `revolutions` at each.

    keep: revolutions at each value whose Poincaré section is kept. Ends early at contact or an interrupt (Ctrl-C); the
    values passed before are kept.
    Raises BadInput for values or numbers that do not fit.
    """
    values = np.array([float(v) for v in values])
    if not len(values) or not np.isfinite(values).all() or np.abs(values).max() >= 1:
        raise BadInput("values must be eccentricities, finite fractions of the gap between -1 and 1, at least one.")
    if not 1 <= keep <= revolutions:
        raise BadInput(f"keep is {keep}; it must lie between 1 and the {revolutions} revolutions.")
    system = split(start.model, start.speed, modes)
    unit = direction(start)
    centre = start.centre
    state = system.state(start, start.model) + system.response(0.0, centre)
    sections: list[NDArray] = []
    for i, value in enumerate(values):
        centre = value * start.model.gap * unit
        state, stopped = _move(system, state, centre, revolutions - keep, steps)
        section = []
        while not stopped and len(section) < keep:
            state, stopped = _move(system, state, centre, 1, steps)
            section.append(system.watch[:2] @ state)
        if stopped:
            stopped = f"{stopped} at {100 * value:.4g} %."
            return Passage(values[:i], np.array(sections).reshape(i, keep, 2), stopped)
        sections.append(np.array(section))
        if progress:
            progress(i + 1, len(values))
    return Passage(values, np.array(sections), "It passed all the values asked for.")


def poincare(start: PeriodicOrbit, static_eccentricity: float, *, revolutions: int = 600, keep: int = 300,
             steps: int = 256, modes: int = 12) -> Passage:
    """The Poincaré section at one eccentricity, of a motion that begins on an orbit found elsewhere."""
    return sweep_in_time(start, [static_eccentricity], revolutions=revolutions, keep=keep, steps=steps, modes=modes)


def direction(orbit: PeriodicOrbit) -> NDArray:
    """Unit vector (x, z) along which the stator is offset; along x where it is not."""
    if not orbit.static_eccentricity:
        return np.array([1.0, 0.0])
    return orbit.centre / (orbit.static_eccentricity * orbit.model.gap)


def _move(system: Split, state: NDArray, centre: NDArray, revolutions: int, steps: int) -> tuple[NDArray, str]:
    """A whole state [q, q̇] moved on by whole revolutions, and what kept it from making them all."""
    base = system.response(0.0, centre)
    moved, contact, made = advance(system, (state - base)[:, None], centre, revolutions, steps)
    stopped = "The rotor touches the stator" if np.isfinite(contact[0]) else "It was interrupted"
    return moved[:, 0] + base, stopped if np.isfinite(contact[0]) or made < revolutions else ""
