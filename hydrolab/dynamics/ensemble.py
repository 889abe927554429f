"""The motion split in two parts that each have an exact solution (Strang 1968).

The linear rotor with its unbalance and the negative stiffness of the centred pull is advanced
exactly, by the exponential of its constant matrix about its own steady response. What that linear
pull misses acts as a kick on the velocities in the middle of each step. Second order in the step,
no stability limit, and one small matrix product moves thousands of motions at once.

Which steady state does the rotor end in? Thousands of starts, advanced together.

What a machine does when its eccentricity grows and shrinks slowly: jumps and hysteresis, in time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.reduction import reduce
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput
from hydrolab.machine.model import Model


@dataclass(frozen=True, eq=False)
class Split:
    """A reduced model at one speed, ready to be advanced; a state is [q, q̇] less the linear
    response, (2r, …).

    constant: matrix of the linear part, (2r, 2r). watch, watch_rate: the c nonlinear coordinates of
    a state and their velocities, (c, 2r); the generator's (x, z) are first. push: change of a state
    by a unit impulse on them, (2r, c). slope: that of the forces at rest, in the linear part, N/m,
    (c, c). turning, static: the linear response at phase φ is Re(turning e^{iφ}) + static · centre;
    (2r,) complex, (2r, 2).
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
    slope = small.law.linearise(rest, rest, 0.0, speed)[1]
    stiffness = small.K - small.selection.T @ slope @ small.selection
    velocity = small.velocity_matrix(speed)
    constant = np.block([[np.zeros((r, r)), np.eye(r)],
                         [-inverse @ stiffness, -inverse @ velocity]])
    zeros = np.zeros_like(small.selection)
    push = np.vstack([zeros.T, inverse @ small.selection.T])
    forced = np.linalg.solve(stiffness - speed**2 * small.M + 1j * speed * velocity,
                             speed**2 * (small.unbalance_cos - 1j * small.unbalance_sin))
    static = np.linalg.solve(stiffness, -small.selection.T @ slope[:, :2])
    return Split(small, float(speed), constant, np.hstack([small.selection, zeros]),
                 np.hstack([zeros, small.selection]),
                 push, slope, np.concatenate([forced, 1j * speed * forced]),
                 np.vstack([static, np.zeros_like(static)]))


@lru_cache(maxsize=64)
def flows(system: Split, steps: int) -> tuple[NDArray, NDArray]:
    """Exponentials of the constant part over one of `steps` steps in a revolution, and over half of
    one.
    """
    h = 2 * math.pi / system.speed / steps
    return scipy.linalg.expm(system.constant * h), scipy.linalg.expm(system.constant * (h / 2))


class Advanced(NamedTuple):
    """Where many motions came to.

    states: (2r, members). contact: revolution at which a member touched the stator, nan where it
    did not; such a member is left there. revolutions: whole revolutions made, fewer than asked for
    after an interrupt.
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
        raise BadInput(f"{system.model.name} has a force that depends on velocity or phase; many "
                       "motions at once are "
                       "made for forces of position alone. Use `integrate`.")
    h = 2 * math.pi / system.speed / steps
    flow, half = flows(system, steps)
    middle = 2 * math.pi * (np.arange(steps) + 0.5) / steps
    forced = np.outer(np.exp(1j * middle), system.watch
                      @ system.turning).real + system.watch @ system.static @ centre
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
                new = ~(law.smallest_gap(place) > 0) & ~touched
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


CONTACT, OTHER = -1, -2
CLOSE = 0.02  # of the gap: how near an orbit a motion must end to count as having reached it


@dataclass(frozen=True, eq=False)
class Basins:
    """Where each start ends, on a grid of displacements (columns) and velocities (rows).

    displacement: m, (columns,). velocity: m/s, (rows,). Both are added to the first orbit at phase
    0, along x, in the shape of the static deflection under the pull. ends: index of the orbit
    reached, −1 for contact, −2 for anything else, (rows, columns). contact: revolutions until
    contact, nan where there was none. orbits: as given. revolutions: as many as were made, fewer
    than asked for after an interrupt.
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
        return (f"{self.ends.size} starts after {self.revolutions} revolutions: "
                f"{', '.join(shares)}, "
                f"{100 * self.share(CONTACT):.1f} % in contact, {100 * self.share(OTHER):.1f} % on "
                "none of these.")


def basins(orbits: Sequence[PeriodicOrbit], displacement: ArrayLike, velocity: ArrayLike, *,
           revolutions: int = 200,
           steps: int = 128, modes: int = 6,
           progress: Callable[[int, int], None] | None = None) -> Basins:
    """Start the generator off the first orbit with every pair of displacement (m) and velocity
    (m/s), and see.

    orbits: steady states of one model at one speed and eccentricity; usually the stable ones.
    Raises BadInput where they are not, or a start is not finite. A start outside the gap counts as
    contact at once.
    """
    displacement, velocity = np.atleast_1d(displacement).astype(float), np.atleast_1d(velocity).astype(float)
    if not orbits:
        raise BadInput("orbits is empty; give at least one steady state to start from.")
    first = orbits[0]
    if any(o.model is not first.model or o.speed != first.speed
           or np.abs(o.centre - first.centre).max() > 1e-12
           for o in orbits):
        raise BadInput("the orbits belong to different models, speeds or eccentricities; basins "
                       "are of one.")
    if not (np.isfinite(displacement).all() and np.isfinite(velocity).all()):
        raise BadInput("a starting displacement or velocity is not finite.")
    system = split(first.model, first.speed, modes)
    small, r = system.model, system.model.size
    generator = small.selection[:2]
    shape = np.linalg.solve(small.K, generator.T)
    shape = shape @ np.linalg.solve(generator @ shape, [1.0, 0.0])
    grid_v, grid_d = np.meshgrid(velocity, displacement, indexing="ij")
    start = system.state(first, first.model)[:, None] + np.vstack([np.outer(shape, grid_d),
                                                                   np.outer(shape, grid_v)])
    states, contact, made = advance(system, start, first.centre, revolutions, steps,
                                    progress=progress)

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
    return Basins(displacement, velocity, ends.reshape(grid), contact.reshape(grid), tuple(orbits),
                  made)


@dataclass(frozen=True, eq=False)
class Passage:
    """A motion while the static eccentricity moved in small steps.

    static_eccentricity: shape (n,), in the order passed. section: (x, z) of the generator centre at
    phase 0 after each of the last revolutions at that value, m, (n, kept, 2). stopped: why it ends,
    in words.
    """

    static_eccentricity: NDArray
    section: NDArray
    stopped: str

    @property
    def settled(self) -> NDArray:
        """Whether the motion repeats every revolution to 1 µm at each value, (n,)."""
        return np.ptp(self.section, axis=1).max(axis=1) < 1e-6

    def __str__(self) -> str:
        return (f"Motion through {len(self.static_eccentricity)} eccentricities, on an orbit of "
                "one revolution at "
                f"{int(self.settled.sum())} of them. {self.stopped}")


def sweep_in_time(start: PeriodicOrbit, values: Iterable[float], *, revolutions: int = 80,
                  keep: int = 8,
                  steps: int = 128, modes: int = 12,
                  progress: Callable[[int, int], None] | None = None) -> Passage:
    """Begin on an orbit and move the stator through these eccentricities, waiting `revolutions` at
    each.

    keep: revolutions at each value whose Poincaré section is kept. Ends early at contact or an
    interrupt (Ctrl-C); the values passed before are kept. Raises BadInput for values or numbers
    that do not fit.
    """
    values = np.array([float(v) for v in values])
    if not len(values) or not np.isfinite(values).all() or np.abs(values).max() >= 1:
        raise BadInput("values must be eccentricities, finite fractions of the gap between -1 and "
                       "1, at least one.")
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


def poincare(start: PeriodicOrbit, static_eccentricity: float, *, revolutions: int = 600,
             keep: int = 300,
             steps: int = 256, modes: int = 12) -> Passage:
    """The Poincaré section at one eccentricity, of a motion that begins on an orbit found
    elsewhere.
    """
    return sweep_in_time(start, [static_eccentricity], revolutions=revolutions, keep=keep,
                         steps=steps, modes=modes)


def direction(orbit: PeriodicOrbit) -> NDArray:
    """Unit vector (x, z) along which the stator is offset; along x where it is not."""
    if not orbit.static_eccentricity:
        return np.array([1.0, 0.0])
    return orbit.centre / (orbit.static_eccentricity * orbit.model.gap)


def _move(system: Split, state: NDArray, centre: NDArray, revolutions: int,
          steps: int) -> tuple[NDArray, str]:
    """A whole state [q, q̇] moved on by whole revolutions, and what kept it from making them all.
    """
    base = system.response(0.0, centre)
    moved, contact, made = advance(system, (state - base)[:, None], centre, revolutions, steps)
    stopped = "The rotor touches the stator" if np.isfinite(contact[0]) else "It was interrupted"
    return moved[:, 0] + base, stopped if np.isfinite(contact[0]) or made < revolutions else ""
