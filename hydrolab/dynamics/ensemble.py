"""Thousands of motions at once: the motion split in two parts that each have an exact solution.

The linear rotor with its unbalance and the slope of the pull at rest is advanced exactly, by the
exponential of its constant matrix about its own steady response. What that linear pull misses acts
as a kick on the velocities in the middle of each step (Strang 1968). Second order in the step, and
one small matrix product moves thousands of motions. Forces that are stiff beside the step (pads, a
crack) or damp (a film) are solved for at the end of each step instead, by the trapezoidal rule,
which has no stability limit. Stator, field and unbalance may be each motion's own and may move.

Which steady state does the rotor end in? `basins` starts it off one of them everywhere.

Here modes: how many are kept. steps: in a revolution. course: where stator, field and unbalance are
at a time. begin: the first phase. progress: called with (done, all).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.reduction import deflection, reduce
from hydrolab.dynamics.results import PeriodicOrbit, left_out
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.model import Model
from hydrolab.machine.quantities import whole

Progress = Callable[[int, int], None]


class Setting(NamedTuple):
    """What may differ between motions and move in time.

    centre: of the stator, m, (2, members). field, unbalance: factors on the machine's own,
    (members,). One column or number stands for all members.
    """

    centre: NDArray
    field: NDArray | float = 1.0
    unbalance: NDArray | float = 1.0

    def of(self, members: NDArray) -> Setting:
        """That of some of the members."""
        def some(x: Any) -> Any:
            return x[..., members] if np.ndim(x) and np.shape(x)[-1] > 1 else x

        return Setting(*map(some, self))


Course = Callable[[float], Setting]  # the setting at a time, counted in revolutions


@dataclass(frozen=True, eq=False)
class Split:
    """A reduced model at one speed, ready to be advanced; a state is [q, q̇], (2r, members).

    constant: matrix of the linear part, (2r, 2r). watch, watch_rate: the c nonlinear coordinates of
    a state and their velocities, (c, 2r); the generator's (x, z) are first. push: change of a state
    by a unit impulse on them, (2r, c). slope: that of the pull at rest, in the linear part, N/m,
    (c, c). shake: change of a state's rate by the unbalance at phase φ, Re(shake e^{iφ}), and
    turning: the linear response to it, (2r,) complex. static: that to the stator's centre, (2r, 2).
    loaded: that to the model's other loads, mean and 1X, (2r, 2) complex. implicit: whether forces
    are solved for at the end of a step, not applied as kicks.
    """

    model: Model
    speed: float
    constant: NDArray
    watch: NDArray
    watch_rate: NDArray
    push: NDArray
    slope: NDArray
    shake: NDArray
    turning: NDArray
    static: NDArray
    loaded: NDArray
    implicit: bool = False

    @property
    def told(self) -> str:
        """How far motions of it are to be trusted, in words."""
        return (f"{left_out(self.model)} A period's steps are known to {100 * ROUGH:g} % of the "
                "gap.")

    def under_loads(self, phases: NDArray) -> NDArray:
        """The linear steady response to all loads but the unbalance at phases, (2r, phases)."""
        return (self.loaded @ [1 + 0j * phases, np.exp(1j * phases)]).real

    def response(self, phase: float, setting: Setting) -> NDArray:
        """The linear steady response [q, q̇] at a phase, (2r, members)."""
        turning = np.outer((self.turning * np.exp(1j * phase)).real, setting.unbalance)
        return turning + self.static @ setting.centre + self.under_loads(np.array([phase]))

    def state(self, orbit: PeriodicOrbit, phase: float = 0.0) -> NDArray:
        """State of the full model's orbit at a phase (rad), (2r,), by mass-weighted projection."""
        full, small = orbit.model, self.model
        project = np.linalg.solve(small.M, small.shaft_map.T @ full.M @ full.shaft_map)
        return (orbit.state(phase) @ project.T).ravel()


def split(model: Model, speed: float, modes: int = 12, *, checked: bool = False) -> Split:
    """Split a model on its modal basis (`reduce`) at a speed (rad/s).

    checked: compare the basis with all DOFs there and add what it lacks.
    """
    small = reduce(model, modes, gyroscopic=True, speed=speed if checked else None)
    r, inverse = small.size, np.linalg.inv(small.M)
    rest = np.zeros(len(small.selection))
    slope = np.zeros((len(rest), len(rest)))  # of the pull: bearings and cracks keep their springs
    slope[:2, :2] = small.law.linearise(rest, rest, 0.0, speed)[1][:2, :2]
    stiffness = small.K - small.selection.T @ slope @ small.selection
    velocity = small.velocity_matrix(speed)
    constant = np.block([[np.zeros((r, r)), np.eye(r)],
                         [-inverse @ stiffness, -inverse @ velocity]])
    zeros = np.zeros_like(small.selection)
    push = np.vstack([zeros.T, inverse @ small.selection.T])
    load = speed**2 * (small.unbalance_cos - 1j * small.unbalance_sin)
    still, all_turning = small.loads(speed)
    forced, other = np.linalg.solve(stiffness - speed**2 * small.M + 1j * speed * velocity,
                                    np.stack([load, all_turning - load], axis=1)).T
    sag = np.linalg.solve(stiffness, still)
    static = np.linalg.solve(stiffness, -small.selection.T @ slope[:, :2])
    return Split(small, float(speed), constant, np.hstack([small.selection, zeros]),
                 np.hstack([zeros, small.selection]), push, slope,
                 shake=np.concatenate([np.zeros(r), inverse @ load]),
                 turning=np.concatenate([forced, 1j * speed * forced]),
                 static=np.vstack([static, np.zeros_like(static)]),
                 loaded=np.vstack([np.stack([sag, other], axis=1),
                                   np.stack([0 * sag, 1j * speed * other], axis=1)]))


STIFF = 0.1  # largest stiffness of a kick times the square of the step, over the mass moved
WILD = 100  # times as much left over as before: a Newton step that went astray
ROUGH = 1e-3  # of the gap: most that a period on an orbit may change with twice the steps


def split_for(orbit: PeriodicOrbit, steps: int, modes: int) -> Split:
    """The split for motions around an orbit, of `steps` steps in a revolution: kicks for forces of
    place and phase, implicit for those that damp or are stiff beside the step.

    Raises BadInput where a period from the orbit is not known to `ROUGH` with these steps.
    """
    whole("steps", steps, 8)
    system = split(orbit.model, orbit.speed, modes, checked=True)
    phases = 2 * math.pi * np.arange(64 * orbit.revolutions) / 64
    place = orbit.model.relative(orbit.coordinates(phases), orbit.centre[:, None])
    _, slope, damping = orbit.model.law.linearise(place, 0 * place, phases, orbit.speed)
    kicks = (system.watch_rate @ system.push) @ (slope.transpose(2, 0, 1) - system.slope)
    stiff = np.abs(np.linalg.eigvals(kicks)).max() * (2 * math.pi / orbit.speed / steps) ** 2
    system = replace(system, implicit=damping is not None or bool(stiff > STIFF))
    begin, setting = system.state(orbit)[:, None], Setting(orbit.centre[:, None])
    once, twice = (advance(system, begin, setting, orbit.revolutions, n).states
                   for n in (steps, 2 * steps))
    away = float(np.abs(system.watch[:2] @ (once - twice)).max()) / orbit.model.length_scale
    if not away <= ROUGH:
        enough = (f" Use {math.ceil(steps * math.sqrt(away / ROUGH))}, or `integrate`."
                  if math.isfinite(away) else " Use more, or `integrate`.")
        raise BadInput(f"steps is {steps}; a motion of {orbit.model.name} over a period of the "
                       f"orbit is then known to {100 * away:.2g} % of the gap, and it takes "
                       f"{100 * ROUGH:g} %.{enough}")
    return system


@lru_cache(maxsize=64)
def flows(system: Split, steps: int) -> tuple[NDArray, NDArray]:
    """Exponentials of the constant part over one of `steps` steps a revolution, and over half."""
    h = 2 * math.pi / system.speed / steps
    return scipy.linalg.expm(system.constant * h), scipy.linalg.expm(system.constant * (h / 2))


def turn(system: Split, states: NDArray, course: Course, first: float, steps: int,
         members: NDArray, seen: list[NDArray] | None = None) -> tuple[NDArray, NDArray]:
    """One revolution of many motions, from phase 0 at the time `first` (in revolutions).

    states: [q, q̇], (2r, m). members: their numbers in the course, (m,). seen: takes q in the middle
    of each step, (r, m), or at its end where forces are solved for. Returns the states at the end,
    and the time at which each touched, nan where it did not; the state of one that touched means
    nothing.
    """
    if system.implicit:
        return _turn_implicitly(system, states, course, first, steps, members, seen)
    flow, half = flows(system, steps)
    h = 2 * math.pi / system.speed / steps
    phases = 2 * math.pi * (np.arange(steps) + 0.5) / steps
    law, push, contact = system.model.law, h * system.push, np.full(len(members), np.nan)
    # the state is measured from the linear response to the setting at the start
    start = course(first)
    base = start.of(members)
    response = system.response(0.0, base)
    linear = _linear_path(system, base, system.watch, phases)
    now = half @ (states - response)
    for n, phase in enumerate(phases):
        time = first + (n + 0.5) / steps
        setting = course(time)
        here = base if setting is start else setting.of(members)
        if seen is not None:
            seen.append((now + system.response(phase, base))[:system.model.size])
        place = system.watch @ now + linear(n)
        moved = place if here is base else shifted(place, base.centre - here.centre)
        touching = ~(law.smallest_gap(moved, phase) > 0)
        if touching.any():
            contact[touching & np.isnan(contact)] = time
            now[:, touching] = place[:, touching] = 0.0  # parked until the revolution ends
            moved = np.where(touching, 0.0, moved)
        now = now + push @ (_force(system, moved, phase, here.field) - system.slope @ place)
        if here is not base and np.any(here.unbalance != base.unbalance):
            now += np.outer(h * (system.shake * np.exp(1j * phase)).real,
                            here.unbalance - base.unbalance)
        now = (flow if n < steps - 1 else half) @ now
    return now + response, contact


def _linear_path(system: Split, base: Setting, rows: NDArray,
                 phases: NDArray) -> Callable[[int], NDArray]:
    """Rows of the linear response at the n-th phase, (rows, members), (x, z) from the stator."""
    wave = np.outer(np.exp(1j * phases), rows @ system.turning).real
    rest, loaded = rows @ system.static @ base.centre, rows @ system.under_loads(phases)
    rest[:2] -= base.centre
    return lambda n: np.outer(wave[n], base.unbalance) + rest + loaded[:, [n]]


def _turn_implicitly(system: Split, states: NDArray, course: Course, first: float, steps: int,
                     members: NDArray,
                     seen: list[NDArray] | None) -> tuple[NDArray, NDArray]:
    """As `turn`, by the trapezoidal rule: x' = flow x + push (f + f'), solved for the new f'."""
    h, one = 2 * math.pi / system.speed / steps, np.eye(len(system.constant))
    back = np.linalg.inv(one - h / 2 * system.constant)
    flow, push = back @ (one + h / 2 * system.constant), h / 2 * back @ system.push
    law, contact, both = system.model.law, np.full(len(members), np.nan), np.vstack(
        [system.watch, system.watch_rate])
    phases = 2 * math.pi * np.arange(steps + 1) / steps
    start = course(first)
    base = start.of(members)
    response = system.response(0.0, base)
    linear = _linear_path(system, base, both, phases)
    now, force = states - response, np.zeros((len(system.watch), len(members)))
    before: NDArray | None = None  # where they were
    for n, phase in enumerate(phases):
        setting = course(first + n / steps)
        here = base if setting is start else setting.of(members)
        if n:
            now = flow @ now + push @ force
            if here is not base and np.any(here.unbalance != base.unbalance):
                shaken = back @ (h * (system.shake * np.exp(1j * (phase - math.pi / steps))).real)
                now += np.outer(shaken, here.unbalance - base.unbalance)
        free = both @ now + linear(n)
        # the forces at the very start are those of a known place
        gain = both @ push if n else 0 * both @ push
        force = _solved(system, free, gain, base.centre - here.centre, phase, here.field, force,
                        before)
        now = now + push @ force if n else now
        if n and seen is not None:
            seen.append((now + system.response(phase, base))[:system.model.size])
        before = (free + gain @ force)[:len(force)]
        place = shifted(before, base.centre - here.centre)
        touching = ~(law.smallest_gap(place, phase) > 0)  # true for nan
        contact[touching & np.isnan(contact)] = first + n / steps
        now[:, touching] = force[:, touching] = 0.0
    return now + response, contact


def _solved(system: Split, free: NDArray, gain: NDArray, shift: NDArray, phase: float,
            field: NDArray | float, force: NDArray, before: NDArray | None) -> NDArray:
    """What the linear part misses of the forces, N, (c, members), at the place and velocity free +
    gain · force, (2c, members), by Newton from a guess, or where that is beyond a film from the
    place `before`, (c, members); nan where there is no force there.

    Raises NoConvergence where a member finds none.
    """
    c, small = len(force), CLOSE * 1e-9 * system.model.length_scale
    last, step, left = force, np.zeros_like(force), np.full(force.shape[1], np.inf)
    for _ in range(40):
        state = free + gain @ force
        there, slope, damping = _linear(system, shifted(state[:c], shift), state[c:], phase, field)
        wanted = there - system.slope @ state[:c] - force
        size = np.abs(gain[:c] @ wanted).max(axis=0)
        # beyond a film or the gap, or nearly: half the step
        lost = ~(size <= np.maximum(WILD * left, small))
        left = np.where(lost, left, size)
        if before is not None and lost.any() and np.isinf(left).any():
            force = np.where(lost, np.linalg.solve(gain[:c], before - free[:c]), force)
            last, before = force, None
            continue
        matrix = np.eye(c) - (slope.transpose(2, 0, 1) - system.slope) @ gain[:c]
        if damping is not None:
            matrix = matrix - damping.transpose(2, 0, 1) @ gain[c:]
        with np.errstate(all="ignore"):
            ahead = np.linalg.solve(matrix, wanted.T[..., None])[..., 0].T
        step = np.where(lost, step / 2, ahead)
        last = np.where(lost, last, force)
        force = last + step
        moved = np.abs(gain[:c] @ step).max(axis=0)
        if not (moved > small).any():
            return np.where(lost, np.nan, force)
    raise NoConvergence(f"{int((moved > small).sum())} of {len(moved)} motions of "
                        f"{system.model.name} found no place in a step. Use more steps in a "
                        "revolution.")


def _linear(system: Split, place: NDArray, rate: NDArray, phase: float,
            field: NDArray | float) -> tuple[NDArray, NDArray, NDArray | None]:
    """Forces, N, and their derivatives by place and velocity with the field at a factor."""
    law = system.model.law
    full = law.linearise(place, rate, phase, system.speed)
    if np.all(field == 1):
        return full
    without = law.scaled(0.0).linearise(place, rate, phase, system.speed)
    force, slope = (b + field**2 * (a - b) for a, b in zip(full[:2], without[:2], strict=True))
    return force, slope, full[2]


def shifted(place: NDArray, by: NDArray) -> NDArray:
    """Coordinates with the generator's (x, z) moved. place: (c, members), m. by: (2, members), m.
    """
    moved = place.copy()
    moved[:2] += by
    return moved


def _force(system: Split, place: NDArray, phase: float, field: NDArray | float) -> NDArray:
    """Forces on the nonlinear coordinates with the field at a factor, N, (c, members)."""
    law = system.model.law
    more = (None, phase, system.speed) if law.moving else ()
    force = law.force(place, *more)
    if np.all(field == 1):
        return force
    without = law.scaled(0.0).force(place, *more)
    return without + field**2 * (force - without)  # the pull goes with the square


def motions(system: Split, states: NDArray, course: Course, steps: int = 128,
            first: int = 0) -> Iterator[tuple[NDArray, NDArray]]:
    """Many motions from phase 0 of the revolution `first`: after each revolution their states,
    (2r, members), and when each touched the stator, in revolutions (nan where it did not).

    A member that touched is left out from then on, and its state is nan. Goes on for ever, or until
    all have touched.
    """
    states, contact = states.copy(), np.full(states.shape[1], np.nan)
    while len(going := np.flatnonzero(np.isnan(contact))):
        ends, contact[going] = turn(system, states[:, going], course, first, steps, going)
        states[:, going] = np.where(np.isnan(contact[going]), ends, np.nan)
        first += 1
        yield states.copy(), contact.copy()


class Advanced(NamedTuple):
    """Where many motions came to.

    states: [q, q̇], (2r, members), nan for one that touched. contact: revolution at which a member
    touched the stator, nan where it did not. revolutions: whole revolutions made, fewer than asked
    for after an interrupt.
    """

    states: NDArray
    contact: NDArray
    revolutions: int


def advance(system: Split, begin: NDArray, setting: Setting | Course, revolutions: int,
            steps: int = 128, *, progress: Progress | None = None) -> Advanced:
    """Advance many states, (2r, members), by whole revolutions of `steps` steps, from phase 0.

    An interrupt (Ctrl-C) returns the state after the last whole revolution.
    """
    course = (lambda time: setting) if isinstance(setting, Setting) else setting
    out = Advanced(begin, np.full(begin.shape[1], np.nan), 0)
    with suppress(KeyboardInterrupt):
        for states, contact in motions(system, begin, course, steps):
            out = Advanced(states, contact, out.revolutions + 1)
            if progress:
                progress(out.revolutions, revolutions)
            if out.revolutions == revolutions:
                return out
        return out._replace(revolutions=revolutions)  # all touched: nothing is left to do
    return out


CONTACT, OTHER = -1, -2
CLOSE = 0.02  # of the gap: how near an orbit a motion must end to count as having reached it


def reached(system: Split, states: NDArray, orbits: Sequence[PeriodicOrbit]) -> NDArray:
    """The orbit that each of the states at phase 0 is on, to `CLOSE`, CONTACT if nan, or OTHER."""
    small, speed = system.model, system.speed
    look = np.vstack([system.watch[:2], system.watch_rate[:2] / speed]) / small.gap
    ends, nearest = np.full(states.shape[1], OTHER), np.full(states.shape[1], CLOSE)
    for index, orbit in enumerate(orbits):
        for revolution in range(orbit.revolutions):
            there = look @ system.state(orbit, 2 * math.pi * revolution)
            away = np.abs(look @ states - there[:, None]).max(axis=0)
            closer = away < nearest  # false for nan
            ends[closer], nearest[closer] = index, away[closer]
    ends[np.isnan(states[0])] = CONTACT
    return ends


def starts(system: Split, orbit: PeriodicOrbit, displacement: NDArray,
           velocity: NDArray) -> NDArray:
    """States off an orbit at phase 0 by every pair of displacement (m) and velocity (m/s) along x,
    in the shape of the static deflection under the pull, (2r, velocities · displacements).
    """
    shape = deflection(system.model, (1.0, 0.0))
    v, d = np.meshgrid(velocity, displacement, indexing="ij")
    return system.state(orbit)[:, None] + np.vstack([np.outer(shape, d), np.outer(shape, v)])


@dataclass(frozen=True, eq=False)
class Basins:
    """Where each start ends, on a grid of displacements (columns) and velocities (rows).

    displacement: m, (columns,). velocity: m/s, (rows,). Both are added to the first orbit at phase
    0, along x, in the shape of the static deflection under the pull. ends: index of the orbit
    reached, −1 for contact, −2 for anything else, (rows, columns). contact: revolutions until
    contact, nan where there was none. orbits: as given. revolutions: as many as were made, fewer
    than asked for after an interrupt. basis: what its motions leave out, in words.
    """

    displacement: NDArray
    velocity: NDArray
    ends: NDArray
    contact: NDArray
    orbits: tuple[PeriodicOrbit, ...]
    revolutions: int
    basis: str = ""

    def share(self, end: int) -> float:
        """Share of the starts that end so."""
        return float(np.mean(self.ends == end))

    def __str__(self) -> str:
        shares = [f"{100 * self.share(i):.1f} % on orbit {i}" for i in range(len(self.orbits))]
        return (f"{self.ends.size} starts after {self.revolutions} revolutions: "
                f"{', '.join(shares)}, {100 * self.share(CONTACT):.1f} % in contact, "
                f"{100 * self.share(OTHER):.1f} % on none of these.{self.basis}")


def basins(orbits: Sequence[PeriodicOrbit], displacement: ArrayLike, velocity: ArrayLike, *,
           revolutions: int = 200, steps: int = 128, modes: int = 6,
           progress: Progress | None = None) -> Basins:
    """Start the generator off the first orbit with every pair of displacement (m) and velocity
    (m/s), and see.

    orbits: steady states of one model at one speed and eccentricity, of one revolution or several;
    usually the stable ones. revolutions: made, of `steps` steps, on `modes` modes. progress: called
    with the revolutions done and all. Raises BadInput where the orbits do not belong together, or a
    start is not finite. A start outside the gap counts as contact at once, as does one
    beyond the clearance of a film. Forces that damp or are stiff are solved for in each step, which
    takes up to ten times as long.
    """
    displacement = np.atleast_1d(np.asarray(displacement, dtype=float))
    velocity = np.atleast_1d(np.asarray(velocity, dtype=float))
    if not orbits:
        raise BadInput("orbits is empty; give at least one steady state to start from.")
    first = orbits[0]
    if any(o.model is not first.model or o.speed != first.speed
           or np.abs(o.centre - first.centre).max() > 1e-12 for o in orbits):
        raise BadInput("the orbits belong to different models, speeds or eccentricities; basins "
                       "are of one.")
    if not (np.isfinite(displacement).all() and np.isfinite(velocity).all()):
        raise BadInput("a starting displacement or velocity is not finite.")
    system = split_for(first, steps, modes)
    states, contact, made = advance(system, starts(system, first, displacement, velocity),
                                    Setting(first.centre[:, None]), revolutions, steps,
                                    progress=progress)
    grid = (len(velocity), len(displacement))
    return Basins(displacement, velocity, reached(system, states, orbits).reshape(grid),
                  contact.reshape(grid), tuple(orbits), made, system.told)
