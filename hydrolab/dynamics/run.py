"""A machine that is started, stopped or let go: speed and field follow a schedule, `run` moves it.

The angle θ of the rotor is no longer Ωt. With ω = θ̇ and α = ω̇ a mass off the axis, which turns as
e^{iθ}, is accelerated by (iα − ω²) e^{iθ}: beside e ω² there is e α, a quarter turn behind. Eq. (9)
is now

M q̈ + (C + ωG) q̇ + K q = Re{[(ω² − iα) (F₂ − iF₁) + f₀ + iω f₁] e^{iθ}} + Sᵀ F + what stands still

(F. M. Lewis, J. Appl. Mech. 1932, for one mass). The driving torque is taken along the axis of the
body it drives; one about the vertical would add Ip α times the tilt, which is not here.

The linear machine is advanced exactly, with its turning loads, in pieces of `PIECE` steps at the
speed in the middle of each; a law's force goes evenly from one step to the next, and the new one is
solved for. Second order in the step. A step is a share of a revolution, or of one at `SLOWEST` of
the highest speed.

Here times, seconds: s. speed, to: rad/s, and as a factor on it. place: a node, or None for the
centre of the generator.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.integrate import (
    Progress,
    Task,
    implicit_forces,
    implicit_pull,
    on_basis,
    up_to_the_end,
)
from hydrolab.dynamics.reduction import truncation_error
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.model import Model
from hydrolab.machine.quantities import (
    RPM,
    number,
    require_model,
    shown,
    turning,
    vector,
    whole,
)

PIECE = 32  # steps for which the linear machine is that of one speed
SLOWEST = 0.25  # of the highest speed: below it a step is as long as there
CORNERS = 24  # straight lines in place of a curve
TOO_MUCH = 0.1  # of the largest motion: an error of the step that is said to be too much
DECAY = 2.0  # s; in which a field that is switched off dies away
EVEN = 2 * np.pi * np.arange(64) / 64  # angles in a revolution at which a motion is looked at


@dataclass(frozen=True, eq=False)
class Schedule:
    """Speed and field over time, by straight lines between instants.

    times: ascending, (k,). speeds: rad/s, none below 0, (k,). fields: factors on the field of the
    machine, (k,), or one for all. story: what it is, in words. Raises BadInput for other lists.
    """

    times: NDArray | Any
    speeds: NDArray | Any
    fields: NDArray | Any = 1.0
    story: str = "a schedule of one's own"

    def __post_init__(self) -> None:
        if not np.iterable(self.fields):
            object.__setattr__(self, "fields", [self.fields] * np.size(self.times))
        for name, least in (("times", -math.inf), ("speeds", 0.0), ("fields", 0.0)):
            object.__setattr__(self, name, vector(partial(number, least=least), name,
                                                  getattr(self, name)))
        if len({len(self.times), len(self.speeds), len(self.fields)}) > 1 or len(self.times) < 2:
            raise BadInput(f"times, speeds and fields have {len(self.times)}, {len(self.speeds)} "
                           f"and {len(self.fields)} entries; give two or more of each, as many of "
                           "one as of the others.")
        if (np.diff(self.times) <= 0).any():
            raise BadInput(f"times is {shown(self.times.tolist())}; each must lie after the one "
                           "before.")
        if not self.speeds.max() > 0:
            raise BadInput("speeds is 0 throughout; a machine at rest needs no run.")

    def speed(self, time: Any) -> Any:
        """Speed ω at a time or at many, rad/s."""
        return np.interp(time, self.times, self.speeds)

    def field(self, time: Any) -> Any:
        """Factor on the field at a time or at many."""
        return np.interp(time, self.times, self.fields)

    def acceleration(self, time: Any) -> Any:
        """ω̇ at a time or at many, rad/s²; after a corner that of the line that begins there."""
        return self._lines[0][self._line(time)]

    def angle(self, time: Any) -> Any:
        """Angle θ since the first instant, rad, exactly."""
        line = self._line(time)
        since = time - self.times[line]
        return (self._lines[1][line] + self.speeds[line] * since
                + self._lines[0][line] * since**2 / 2)

    def _line(self, time: Any) -> Any:
        return np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, len(self.times) - 2)

    @cached_property
    def _lines(self) -> tuple[NDArray, NDArray]:
        """Acceleration along each line, and the angle at each instant."""
        lengths = np.diff(self.times)
        means = (self.speeds[1:] + self.speeds[:-1]) / 2
        return np.diff(self.speeds) / lengths, np.append(0.0, np.cumsum(means * lengths))

    def __str__(self) -> str:
        return (f"{self.story[:1].upper()}{self.story[1:]}: {self.times[-1] - self.times[0]:.4g} s,"
                f" {self._lines[1][-1] / (2 * math.pi):.4g} revolutions, from "
                f"{self.speeds[0] / RPM:.4g} to {self.speeds[-1] / RPM:.4g} rpm, at most "
                f"{self.speeds.max() / RPM:.4g} rpm.")


def start_up(speed: float, *, run_up: float = 30.0, flash: float = 40.0, build: float = 5.0,
             seconds: float = 60.0) -> Schedule:
    """From rest evenly to a speed in `run_up` seconds without field; at the instant `flash` the
    field is switched on and builds up evenly in `build` seconds.
    """
    _ordered(run_up=run_up, flash=flash, flash_and_build=flash + build, seconds=seconds)
    times = np.array([0.0, run_up, flash, flash + build, seconds])
    return Schedule(times, turning(speed) * np.array([0.0, 1, 1, 1, 1]), [0, 0, 0, 1, 1],
                    f"a start to {speed / RPM:.4g} rpm")


def load_rejection(speed: float, *, to: float = 1.4, at: float = 5.0, rise: float = 5.0,
                   back: float = 25.0, trip: float | None = None,
                   seconds: float = 60.0) -> Schedule:
    """The load is lost at the instant `at`: the gates close evenly, so that the torque falls to 0
    in `rise` seconds and the speed goes along a parabola to its highest, `to` times; then it is
    brought back in `back` seconds. trip: seconds after the loss at which the field is switched off;
    None leaves it on.
    """
    _ordered(at=at, at_and_rise=at + rise, all_of_it=at + rise + back, seconds=seconds)
    number("to", to, above=1)
    up = np.linspace(0, 1, CORNERS + 1)
    curve = np.concatenate([[0.0], (2 - up) * up, (1 + np.cos(np.pi * up[1:])) / 2, [0.0]])
    times = np.concatenate([[0.0], at + rise * up, at + rise + back * up[1:], [seconds]])
    return _tripped(times, turning(speed) * (1 + (to - 1) * curve), at, trip,
                    f"a load rejection to {to:g} times {speed / RPM:.4g} rpm")


def coast_down(speed: float, *, half: float = 20.0, brakes: float = 0.2,
               braking: float = 20.0) -> Schedule:
    """Without torque, the field switched off at once: drag that grows with the square of the speed
    halves it in `half` seconds; at the share `brakes` the brakes stop it in `braking` seconds.
    """
    number("half", half, above=0, unit="s")
    number("brakes", brakes, above=0, below=1)
    number("braking", braking, above=0, unit="s")
    shares = np.geomspace(1, brakes, CORNERS + 1)
    times = half * (1 / shares - 1)
    return _tripped(np.append(times, times[-1] + braking), turning(speed) * np.append(shares, 0.0),
                    0.0, 0.0, f"a coast down from {speed / RPM:.4g} rpm")


def runaway(speed: float, *, to: float = 2.5, at: float = 5.0, rise: float = 10.0,
            trip: float | None = 1.0, seconds: float = 60.0) -> Schedule:
    """The load is lost at the instant `at` and the gates stay open: the torque falls evenly with
    the speed, which comes within 37 % of the way to its limit, `to` times, every `rise` seconds.
    trip: as for `load_rejection`.
    """
    _ordered(at=at, seconds=seconds)
    number("rise", rise, above=0, unit="s")
    number("to", to, above=1)
    passed = np.linspace(0, 1, 2 * CORNERS + 1) * (seconds - at)
    times, grown = np.append(0.0, at + passed), np.append(0.0, 1 - np.exp(-passed / rise))
    return _tripped(times, turning(speed) * (1 + (to - 1) * grown), at, trip,
                    f"a runaway to {to:g} times {speed / RPM:.4g} rpm")


def _ordered(**instants: float) -> None:
    """Raise BadInput where instants do not follow one another, the first after 0."""
    last, before = 0.0, "0"
    for name, value in instants.items():
        if not number(name, value, unit="s") > last:
            raise BadInput(f"{name.replace('_', ' ')} is {value:g} s; it must be later than "
                           f"{before}, {last:g} s.")
        last, before = value, name.replace("_", " ")


def _tripped(times: NDArray, speeds: NDArray, lost: float, trip: float | None,
             story: str) -> Schedule:
    """A schedule whose field is switched off so many seconds after the load is lost, or left on."""
    if trip is None:
        return Schedule(times, speeds, 1.0, f"{story}, the field left on")
    off = [lost + number("trip", trip, least=0, unit="s"), lost + trip + DECAY]
    every = np.union1d(times, [t for t in off if t < times[-1]])
    return Schedule(every, np.interp(every, times, speeds), np.interp(every, off, [1, 0]),
                    f"{story}, the field off after {trip:g} s")


@dataclass(frozen=True)
class Moving(Task):
    """A `Task` with the speed and the field of a schedule."""

    schedule: Any = None

    def phase(self, time: Any) -> Any:
        """Angle of the rotor, rad."""
        return self.schedule.angle(time)

    def pace(self, time: Any) -> Any:
        """Speed, rad/s."""
        return self.schedule.speed(time)

    def field(self, time: float) -> float:
        """Factor on the flux density."""
        return float(self.schedule.field(time))


class Step(NamedTuple):
    """How a state [q, q̇] of 2r moves in a step: flow x + turned y + still + now f + new f'.

    y: the turning loads' e^{iθ} with their factors at its beginning, (6,): real and imaginary part
    of each. f, f': the laws' forces at its beginning and its end, (c,).
    """

    flow: NDArray
    turned: NDArray
    still: NDArray
    now: NDArray
    new: NDArray


@lru_cache(maxsize=256)
def step_at(model: Model, speed: float, h: float) -> Step:
    """The step of length h, s, of a model at a speed: one exponential of the machine together with
    what makes its loads (C. F. Van Loan, 1978).
    """
    m, r, c = model.at(speed), model.size, len(model.selection)
    inverse = np.linalg.inv(m.M)
    loads = np.stack([m.unbalance_cos - 1j * m.unbalance_sin, *m.turning])
    shaken = inverse @ np.stack([loads.real, -loads.imag], axis=1).reshape(6, r).T
    push = inverse @ np.column_stack([m.selection.T, m.static])
    a = np.zeros((n := 2 * r + 6 + 2 * (c + 1), n))
    x, f, g = 2 * r, 2 * r + 6, 2 * r + 6 + c + 1
    a[:r, r:x], a[r:x, :r] = np.eye(r), -inverse @ m.K
    a[r:x, r:x], a[r:x, x:f], a[r:x, f:g] = -inverse @ m.velocity_matrix(speed), shaken, push
    a[x:f, x:f] = np.kron(np.eye(3), [[0, -speed], [speed, 0]])
    a[f:g, g:] = np.eye(c + 1)
    e = scipy.linalg.expm(h * a)[:x]
    new = e[:, g:g + c] / h
    return Step(e[:, :x], e[:, x:f], e[:, g - 1], e[:, f:f + c] - new, new)


def instants(schedule: Schedule, steps: int) -> NDArray:
    """Where the pieces begin and end, s, an even number: steps in a revolution."""
    fine = np.union1d(np.linspace(schedule.times[0], schedule.times[-1], 2001), schedule.times)
    least = SLOWEST * schedule.speeds.max()
    pace = np.maximum(schedule.speed((fine[1:] + fine[:-1]) / 2), least)
    turned = np.append(0.0, np.cumsum(pace * np.diff(fine))) / (2 * math.pi)
    pairs = math.ceil(turned[-1] * steps / PIECE / 2)
    return np.interp(np.linspace(0, turned[-1], 2 * pairs + 1), turned, fine)


def pieces(task: Moving, ends: NDArray, x: NDArray) -> Iterator[tuple[NDArray, NDArray]]:
    """The motion from a state x, (2r,), a piece at a time: its times, (p,), and states, (2r, p).

    ends: of the pieces, s.
    """
    m, plan, r = task.model, task.schedule, task.model.size
    watch = m.selection
    force = task.force(ends[0], watch @ x[:r], watch @ x[r:])
    for begin, end in pairwise(ends):
        times = np.linspace(begin, end, PIECE + 1)
        h, middle = (end - begin) / PIECE, (times[1:] + times[:-1]) / 2
        speed = float(plan.speed((begin + end) / 2))
        step = step_at(m, round(speed, 9), float(f"{h:.9e}"))
        give, follow = watch @ step.new[:r], watch @ step.new[r:]
        pull = (implicit_pull(task, give) if m.law.closed_form
                else implicit_forces(task, give, follow))
        # the loads turn with the speed of the piece through where they are in the middle of a step
        w = plan.speed(middle)
        y = (np.stack([w**2 - 1j * plan.acceleration(middle), np.ones(PIECE), 1j * w])
             * np.exp(1j * (plan.angle(middle) - speed * h / 2)))
        drive = np.stack([y.real, y.imag], axis=1).reshape(6, PIECE).T @ step.turned.T + step.still
        states, u = np.empty((PIECE, 2 * r)), watch @ x[:r]
        for i in range(PIECE):
            free = step.flow @ x + step.now @ force + drive[i]
            force = pull(times[i + 1], watch @ free[:r], u, watch @ free[r:])
            states[i] = x = free + step.new @ force
            u = watch @ x[:r]
        yield times[1:], states.T


def _at_first(task: Moving, eccentricity: float, direction: float) -> NDArray:
    """The state [q, q̇] in which a run begins: the steady state at its first speed and field, or
    the place where it rests.
    """
    time = float(task.schedule.times[0])
    speed, m = float(task.pace(time)), task.model.at(task.pace(time))
    if speed:
        m = m.with_field(task.field(time))
        return HarmonicBalance(4).solve(m, speed, eccentricity, direction=direction).state().ravel()
    flexible = np.linalg.solve(m.K, np.column_stack([m.selection.T, m.static + m.turning[0].real]))
    free, c = m.selection @ flexible[:, -1], m.selection @ flexible[:, :-1]
    try:
        force = implicit_forces(task, c, 0 * c)(time, free, free, 0 * free)
    except (np.linalg.LinAlgError, NoConvergence):
        force = np.full(len(c), np.nan)
    if not np.isfinite(force).all():
        raise BadInput(f"{m.name} does not rest anywhere in its gap and its bearings at the field "
                       f"it begins with, {task.field(time):g} times its own; begin with less "
                       "field, or at a speed.")
    q = flexible @ np.append(force, 1.0)
    return np.concatenate([q, 0 * q])


class Extreme(NamedTuple):
    """A largest or smallest value, when, s, at which speed, rad/s, and of what."""

    value: float
    time: float
    speed: float
    name: str = ""


class Passage(NamedTuple):
    """How far the generator moves about its mean in a revolution, m, when, s, at which speed,
    rad/s, and how far in the steady state there, m; nan where none was found.
    """

    amplitude: float
    time: float
    speed: float
    steady: float


@dataclass(frozen=True, eq=False)
class Waterfall:
    """Spectra while the speed changes: amplitudes (long half axes, m 0-to-peak) by line and order.

    times: the middle of each line, s, (l,). speeds: there, rad/s, (l,). orders: multiples of the
    speed, (o,). amplitudes: (l, o).
    """

    times: NDArray
    speeds: NDArray
    orders: NDArray
    amplitudes: NDArray

    def of(self, order: float) -> NDArray:
        """The amplitude of one order in each line, m, (l,)."""
        return self.amplitudes[:, np.abs(self.orders - order).argmin()]


@dataclass(frozen=True, eq=False)
class Run:
    """A motion through a schedule; it prints as its story.

    model: on the basis it was moved in. centre: of the stator, m. times: (T,). states:
    displacement and velocity of its DOFs, (2, r, T). stopped: why it ends, in words. interrupted:
    whether by Ctrl-C. step_error: how far the path moves with twice the step, m, some three times
    its own error, but in the last revolution before a contact; nan where that was not tried.
    basis_error: largest relative error of the basis' answer to a force at the generator, 0X to 4X,
    at a quarter to all of the highest speed.
    """

    model: Model
    schedule: Schedule
    static_eccentricity: float
    direction: float
    centre: NDArray
    times: NDArray
    states: NDArray
    stopped: str
    interrupted: bool
    step_error: float
    basis_error: float

    @cached_property
    def angles(self) -> NDArray:
        """Angle of the rotor, rad, (T,)."""
        return self.schedule.angle(self.times)

    @cached_property
    def speeds(self) -> NDArray:
        """Speed, rad/s, (T,)."""
        return self.schedule.speed(self.times)

    def path(self, place: int | float | str | None = None) -> CubicHermiteSpline:
        """(x, z) of a place, m, as a function of time; called with (n,) times it returns (2, n)."""
        q, v = (self.model.selection[:2] @ part if place is None else
                self.model.at_nodes(part)[self.model.node_at(place), :2] for part in self.states)
        return CubicHermiteSpline(self.times, q, v, axis=1)

    def turned(self, angles: NDArray, place: int | float | str | None = None) -> NDArray:
        """(x, z) of a place, m, (2, …), at angles of the rotor, rad, (…)."""
        return self.path(place)(np.interp(angles, self.angles, self.times))

    @property
    def positions(self) -> NDArray:
        """(x, z) of the generator's centre, m, (2, T)."""
        return self.model.selection[:2] @ self.states[0]

    def orbit(self, time: float, revolutions: float = 1.0,
              place: int | float | str | None = None) -> NDArray:
        """(x, z) of a place in so many revolutions before a time, m, (2, 360 a revolution + 1)."""
        last = self.schedule.angle(number("time", time, least=self.times[0], most=self.times[-1]))
        angles = last - 2 * math.pi * np.linspace(revolutions, 0, round(360 * revolutions) + 1)
        if angles[0] < 0:
            raise BadInput(f"time is {time:g} s, before which it turned "
                           f"{last / (2 * math.pi):.3g} times; ask for a later instant.")
        return self.turned(angles, place)

    @cached_property
    def gaps(self) -> NDArray:
        """Smallest air gap around the circumference, m, (T,); inf where there is none."""
        place = self.model.relative(self.model.selection @ self.states[0], self.centre[:, None])
        return np.broadcast_to(self.model.law.smallest_gap(place, self.angles), self.times.shape)

    @cached_property
    def bearing_forces(self) -> dict[str, NDArray]:
        """Size of the force on each radial bearing by its name, N, (T,)."""
        found: dict[str, NDArray] = {name: np.empty(len(self.times))
                                     for name in self.model.supports}
        for first in range(0, len(self.times), PIECE):
            part = slice(first, first + PIECE)
            q, v = self.states[:, :, part]
            speeds: Any = self.speeds[part]
            for name, s in self.model.at(float(speeds.mean())).supports.items():
                force = s.force(s.rows @ q, s.rows @ v, self.angles[part], speeds)
                found[name][part] = np.hypot(*force)
        return found

    def _extreme(self, values: NDArray, at: int, name: str = "") -> Extreme:
        return Extreme(float(values[at]), float(self.times[at]), float(self.speeds[at]), name)

    @property
    def smallest_gap(self) -> Extreme:
        """The smallest air gap, m, and when."""
        return self._extreme(self.gaps, int(self.gaps.argmin()))

    @property
    def largest_bearing_force(self) -> Extreme:
        """The largest force on a radial bearing, N, when, and on which."""
        if not self.bearing_forces:
            raise BadInput(f"{self.model.name} has no radial bearings.")
        name, forces = max(self.bearing_forces.items(), key=lambda item: item[1].max())
        return self._extreme(forces, int(forces.argmax()), name)

    @cached_property
    def revolutions(self) -> tuple[NDArray, NDArray]:
        """The middle of each whole revolution, s, (n,), and the largest distance in it of the
        generator's centre from its mean, m, (n,): that of four revolutions, with Hann's window,
        which a motion that grows or beats does not move.
        """
        starts = 2 * math.pi * np.arange(int(self.angles[-1] / (2 * math.pi)))
        wide = min(4, len(starts))
        around = np.clip(starts - math.pi * (wide - 1), 0, self.angles[-1] - 2 * math.pi * wide)
        n = wide * len(EVEN)
        window = np.hanning(n + 1)[:n] if wide > 1 else np.ones(n)
        mean = self.turned(around[:, None] + EVEN[1] * np.arange(n)) @ window
        away = np.hypot(*(self.turned(starts[:, None] + EVEN)
                          - mean[:, :, None] / window.sum())).max(axis=1, initial=0.0)
        return np.interp(starts + math.pi, self.angles, self.times), away

    def steady(self, times: ArrayLike) -> NDArray:
        """Largest distance from the mean in the steady state at the speed and the field of each
        instant, m; nan where none was found. It need not be stable.
        """
        return np.array([self._steady(float(time)) for time in np.atleast_1d(times)])

    def _steady(self, time: float) -> float:
        speed, model = float(self.schedule.speed(time)), self.model
        if not speed:
            return math.nan
        try:
            model = model.at(speed).with_field(float(self.schedule.field(time)))
            return HarmonicBalance(4).solve(model, speed, self.static_eccentricity,
                                            direction=self.direction).vibration
        except (NoConvergence, Contact):
            return math.nan

    @cached_property
    def passage(self) -> Passage | None:
        """The revolution in which the generator moves most; None before the first is over."""
        times, amplitudes = self.revolutions
        if not len(times):
            return None
        at = int(amplitudes.argmax())
        return Passage(float(amplitudes[at]), float(times[at]),
                       float(self.schedule.speed(times[at])), self._steady(float(times[at])))

    def waterfall(self, place: int | float | str | None = None, *, lines: int = 60,
                  revolutions: int = 8, highest: float = 5.0) -> Waterfall:
        """Spectra of a place in so many lines, at equal angles, a Hann window of so many
        revolutions each.

        highest: order that is kept. Raises BadInput where it turned fewer revolutions.
        """
        turns, n = self.angles[-1] / (2 * math.pi), len(EVEN) * whole("revolutions", revolutions, 2)
        if turns < revolutions:
            raise BadInput(f"revolutions is {revolutions}, and it turned {turns:.3g}; take fewer.")
        starts = 2 * math.pi * np.linspace(0, turns - revolutions, whole("lines", lines, 2))
        x, z = self.turned(starts[:, None] + EVEN[1] * np.arange(n), place)
        window = np.hanning(n + 1)[:n]
        moved = z + 1j * x
        moved = (moved - (moved @ window / window.sum())[:, None]) * window
        spectrum = np.abs(np.fft.fft(moved)) / window.sum()
        orders = np.arange(round(highest * revolutions) + 1)
        middle = np.interp(starts + math.pi * revolutions, self.angles, self.times)
        return Waterfall(middle, self.schedule.speed(middle), orders / revolutions,
                         spectrum[:, orders] + spectrum[:, -orders])

    def __str__(self) -> str:
        said = [f"{self.schedule} {self.model.name}, static eccentricity "
                f"{100 * self.static_eccentricity:.4g} %. {self.stopped}"]
        if p := self.passage:
            than = ("no steady state that moves was found there" if not p.steady > 0 else
                    f"{p.amplitude / p.steady:.3g} times the steady {1e6 * p.steady:.4g} µm there")
            said.append(f"It moves most, {1e6 * p.amplitude:.4g} µm about its mean, at "
                        f"{p.time:.3g} s and {p.speed / RPM:.4g} rpm: {than}.")
        if math.isfinite(self.model.gap):
            gap = self.smallest_gap
            said.append(f"Smallest gap {1e3 * gap.value:.3f} mm at {gap.time:.3g} s, "
                        f"{gap.speed / RPM:.4g} rpm.")
        if self.bearing_forces:
            force = self.largest_bearing_force
            said.append(f"Largest bearing force {1e-3 * force.value:.4g} kN on the {force.name} at "
                        f"{force.time:.3g} s, {force.speed / RPM:.4g} rpm.")
        tried = ("twice the step was not tried" if math.isnan(self.step_error) else
                 f"twice the step moves the path by {1e6 * self.step_error:.2g} µm at most")
        if p and self.step_error > TOO_MUCH * p.amplitude:
            tried += ", too much; use more steps"
        said.append(f"Error: {tried}; of its answer the basis leaves out {self.basis_error:.1g}.")
        return " ".join(said)


@threadpool_limits.wrap(limits=1)
def run(model: Model, schedule: Schedule, *, static_eccentricity: float = 0.0,
        direction: float = math.pi / 2, steps_per_revolution: int = 256, modes: int | None = 12,
        check: bool = True, progress: Progress | None = None) -> Run:
    """Move a machine through a schedule, from the steady state at its first speed and field, or
    from rest.

    static_eccentricity: fraction of the gap. direction: gap angle of the stator's offset, rad.
    steps_per_revolution: see the module. modes: of the basis, as for `integrate`. check: move it
    again with twice the step. progress: called with the pieces done and all. Contact, a step
    without a solution and an interrupt (Ctrl-C) end it early; what was computed is kept. Raises
    BadInput for what does not fit, such as speeds beyond the table of a bearing, and what
    `HarmonicBalance.solve` raises where there is no steady state to begin with.
    """
    require_model(model)
    if not isinstance(schedule, Schedule):
        raise BadInput(f"schedule is {shown(schedule)}; make one by start_up, load_rejection, "
                       "coast_down or runaway, or Schedule(times, speeds, fields).")
    steps = whole("steps_per_revolution", steps_per_revolution, 16)
    fastest = float(schedule.speeds.max())
    small = on_basis(model, modes, fastest)
    centre = model.centre(number("static_eccentricity", static_eccentricity), direction)
    task = Moving(small, fastest, centre, 0.0, 0.0, schedule)
    first = _at_first(task, static_eccentricity, direction)
    ends = instants(schedule, steps)
    total, done = len(ends) - 1 + check * (len(ends) // 2), 0

    def tell() -> None:
        nonlocal done
        done += 1
        if progress:
            progress(done, total)

    times, states, stopped, interrupted = _moved(task, ends, first, tell)
    found = Run(small, schedule, float(static_eccentricity), direction, centre, times,
                states.reshape(2, small.size, -1),
                stopped or "It went all the way.", interrupted, math.nan,
                max(truncation_error(model.at(w), small.at(w), w)
                    for w in fastest * np.array([0.25, 0.5, 1])) if modes else 0.0)
    if check and not interrupted:
        rough, coarse, *_ = _moved(task, ends[::2], first, tell)
        both = schedule.angle(rough) <= found.angles[-1] - 2 * math.pi * bool(stopped)
        away = small.selection[:2] @ coarse[:small.size, both] - found.path()(rough[both])
        return replace(found, step_error=float(np.hypot(*away).max(initial=0.0)))
    return found


def _moved(task: Moving, ends: NDArray, first: NDArray,
           tell: Callable[[], None]) -> tuple[NDArray, NDArray, str, bool]:
    """Times, (T,), and states, (2r, T), of a motion, why it ended early in words or "", and whether
    that was an interrupt.
    """
    r, watch = task.model.size, task.model.selection
    times, states, stopped, interrupted = [ends[:1]], [first[:, None]], "", False
    try:
        with np.errstate(all="ignore"):
            for t, x in pieces(task, ends, first):
                before = (times[-1], watch @ states[-1][:r], states[-1])
                (t, _, _), stopped = up_to_the_end(task, (t, watch @ x[:r], x), before)
                times.append(t)
                states.append(x[:, :len(t)])
                if stopped:
                    break
                tell()
    except KeyboardInterrupt:
        interrupted, stopped = True, f"Interrupted at {times[-1][-1]:.4g} s; this much is kept."
    except NoConvergence as failure:
        stopped = str(failure)
    return np.concatenate(times), np.concatenate(states, axis=1), stopped, interrupted
