"""The motion split in two parts that each have an exact solution (Strang 1968).

The linear rotor with its unbalance and the negative stiffness of the centred pull is advanced exactly, by the
exponential of its constant matrix about its own steady response. What that linear pull misses acts as a kick on the
velocities in the middle of each step. Second order in the step, no stability limit, and one small matrix product
moves thousands of motions at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from hydrolab.dynamics.reduction import reduce
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput
from hydrolab.machine.model import Model
from hydrolab.machine.several import linearise_at


@dataclass(frozen=True, eq=False)
class Split:
    """A reduced model at one speed, ready to be advanced; a state is [q, q̇] less the linear response, (2r, …).

    constant: matrix of the linear part, (2r, 2r). watch, watch_rate: the c nonlinear coordinates of a state and their
    velocities, (c, 2r); the generator's (x, z) are first. push: change of a state by a unit impulse on them, (2r, c).
    slope: that of the forces at rest, in the linear part, N/m, (c, c). turning, static: the linear response at phase φ
    is Re(turning e^{iφ}) + static · centre; (2r,) complex, (2r, 2).
    """

    model: Model
    speed: float
    constant: NDArray
    watch: NDArray
    watch_rate: NDArray
    push: NDArray
    slope: NDArray
    turning: NDArray
    static: NDArray

    def response(self, phase: float, centre: NDArray) -> NDArray:
        """The linear steady response [q, q̇] at a phase with the stator at `centre` (m), (2r,)."""
        return (self.turning * np.exp(1j * phase)).real + self.static @ centre

    def state(self, orbit: PeriodicOrbit, full: Model) -> NDArray:
        """State of an orbit of the full model at phase 0, (2r,), by mass-weighted projection."""
        k = np.arange(1, orbit.harmonics + 1) / orbit.revolutions
        shaft = orbit.shaft
        q, v = shaft[:, 0] + shaft[:, 2::2].sum(axis=1), shaft[:, 1::2] @ (k * orbit.speed)
        small = self.model
        project = np.linalg.solve(small.M, small.shaft_map.T @ full.M @ full.shaft_map)
        return np.concatenate([project @ q, project @ v]) - self.response(0.0, orbit.centre)


def split(model: Model, speed: float, modes: int = 12) -> Split:
    """Split a model on its modal basis (`reduce`) at a speed (rad/s)."""
    small = reduce(model, modes, gyroscopic=True)
    r, inverse = small.size, np.linalg.inv(small.M)
    rest = np.zeros(len(small.selection))
    slope = linearise_at(small.law, rest, rest, 0.0, speed)[1]
    stiffness = small.K - small.selection.T @ slope @ small.selection
    velocity = small.velocity_matrix(speed)
    constant = np.block([[np.zeros((r, r)), np.eye(r)], [-inverse @ stiffness, -inverse @ velocity]])
    zeros = np.zeros_like(small.selection)
    push = np.vstack([zeros.T, inverse @ small.selection.T])
    forced = np.linalg.solve(stiffness - speed**2 * small.M + 1j * speed * velocity,
                             speed**2 * (small.unbalance_cos - 1j * small.unbalance_sin))
    static = np.linalg.solve(stiffness, -small.selection.T @ slope[:, :2])
    return Split(small, float(speed), constant, np.hstack([small.selection, zeros]), np.hstack([zeros, small.selection]),
                 push, slope, np.concatenate([forced, 1j * speed * forced]),
                 np.vstack([static, np.zeros_like(static)]))


@lru_cache(maxsize=64)
def flows(system: Split, steps: int) -> tuple[NDArray, NDArray]:
    """Exponentials of the constant part over one of `steps` steps in a revolution, and over half of one."""
    h = 2 * math.pi / system.speed / steps
    return scipy.linalg.expm(system.constant * h), scipy.linalg.expm(system.constant * (h / 2))


class Advanced(NamedTuple):
    """Where many motions came to.

    states: (2r, members). contact: revolution at which a member touched the stator, nan where it did not; such a
    member is left there. revolutions: whole revolutions made, fewer than asked for after an interrupt.
    """

    states: NDArray
    contact: NDArray
    revolutions: int


def advance(system: Split, states: NDArray, centre: NDArray, revolutions: int, steps: int = 128, *,
            progress: Callable[[int, int], None] | None = None) -> Advanced:
    """Advance many states by whole revolutions, from phase 0.

    states: (2r, members). centre: stator centre, m, (2,). steps: in a revolution.
    An interrupt (Ctrl-C) returns the state after the last whole revolution.
    Raises BadInput for a force that depends on the velocity or the phase, which `integrate` takes.
    """
    if system.model.law.moving:
        raise BadInput(f"{system.model.name} has a force that depends on velocity or phase; many motions at once are "
                       "made for forces of position alone. Use `integrate`.")
    h = 2 * math.pi / system.speed / steps
    flow, half = flows(system, steps)
    middle = 2 * math.pi * (np.arange(steps) + 0.5) / steps
    forced = np.outer(np.exp(1j * middle), system.watch @ system.turning).real + system.watch @ system.static @ centre
    forced[:, :2] -= centre
    law, watch, push, slope = system.model.law, system.watch, h * system.push, system.slope
    out, contact = states.copy(), np.full(states.shape[1], np.nan)
    active = np.arange(states.shape[1])
    now, done = states, 0
    try:
        for revolution in range(revolutions):
            now = half @ now
            touched = np.zeros(now.shape[1], dtype=bool)
            for n in range(steps):
                place = watch @ now + forced[n][:, None]
                new = ~(law.smallest_gap(place[:2]) > 0) & ~touched
                if new.any():
                    contact[active[new]] = revolution + (n + 0.5) / steps
                    out[:, active[new]] = now[:, new]
                    touched |= new
                    now[:, touched] = 0.0  # parked inside the gap until the revolution ends
                    place = watch @ now + forced[n][:, None]
                now = now + push @ (law.force(place) - slope @ place)
                now = (flow if n < steps - 1 else half) @ now
            if touched.any():
                active, now = active[~touched], now[:, ~touched]
            out[:, active] = now
            done = revolution + 1
            if progress:
                progress(revolution + 1, revolutions)
            if not len(active):
                return Advanced(out, contact, revolutions)
    except KeyboardInterrupt:
        pass
    return Advanced(out, contact, done)
