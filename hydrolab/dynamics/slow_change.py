"""What a machine does when it is changed slowly: `drift` continuously, `sweep_in_time` in steps.

A real machine reaches a fold by moving. What it does there may depend on how it is moved: a stator
moved by 11 µm at one instant kicks the rotor, and can throw it out of a basin that a slow change
would not leave.

static_eccentricity: a fraction of the gap. steps: in a revolution. revolutions, keep: how many
pass, and how many of the last are kept. modes: of the basis.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.ensemble import CLOSE, Course, Progress, Setting, Split, motions, split_for
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput
from hydrolab.machine.quantities import number

KEPT = 4  # revolutions whose section a drift looks at, at each of its values
REPEATS = 0.01  # of the gap: how closely a motion must come back in a drift to count as repeating
BACK = 3  # times as far: how closely it must come back after a transient
STILL = 1e-6  # the same, m, where nothing moves any more


@dataclass(frozen=True, eq=False)
class Passage:
    """A motion while a parameter moved.

    parameter: its name. values: of it, in the order passed, (n,). section: (x, z) of the generator
    centre at phase 0 after each of the last revolutions before each value was left, m,
    (n, kept, 2). near: how closely a motion must come back to count as repeating, m. stopped: why
    it ends, in words. doubt: what shows that the end depends on how the values were stepped, in
    words; empty where nothing does. basis: what the
    motion leaves out, in words.
    """

    parameter: str
    values: NDArray
    section: NDArray
    near: float
    stopped: str
    doubt: str = ""
    basis: str = ""

    @cached_property
    def period(self) -> NDArray:
        """Revolutions after which the motion repeats at each value, 1 or 2, or 0 for neither:
        on its way from one motion to another, or on a torus; (n,).
        """
        found = np.zeros(len(self.values), dtype=int)
        for q in (2, 1):
            if self.section.shape[1] > q:
                moved = self.section[:, q:] - self.section[:, :-q]
                found[np.hypot(*moved.T).max(axis=0) < self.near] = q
        return found if self.section.shape[1] > 1 else np.ones_like(found)

    @property
    def settled(self) -> NDArray:
        """Whether the motion repeats every revolution at each value, (n,)."""
        return self.period == 1

    @property
    def rotation_number(self) -> float:
        """Turns around the closed curve of the last section in a revolution, from 0 to ½, where the
        motion is on a torus; nan where it repeats.

        At a Neimark–Sacker point it is the angle of the multipliers over 2π. The turns are averaged
        with weights that vanish at both ends (Das and others 2017).
        """
        if not len(self.values) or self.period[-1]:
            return math.nan
        points = self.section[-1] - self.section[-1].mean(axis=0)
        # as a circle: the curve may be long and thin
        points = np.linalg.solve(np.linalg.cholesky(np.cov(points.T)), points.T)
        turns = np.diff(np.arctan2(*points)) / (2 * math.pi)
        turns = (turns + 0.5) % 1 - 0.5
        at = np.arange(1, len(turns) + 1) / (len(turns) + 1)
        return float(abs(np.average(turns, weights=np.exp(-1 / (at * (1 - at))))))

    @cached_property
    def story(self) -> list[tuple[int, float, float]]:
        """What it did, in order: (period, first value, last value) of each run of values with the
        same `period`; a transient that comes back to where it began is passed over.
        """
        runs: list[tuple[int, float, float]] = []
        where = self.section.mean(axis=1)
        left = 0  # the last value before the transient
        for i, (period, value) in enumerate(zip(self.period.tolist(), self.values.tolist(),
                                                strict=True)):
            back = len(runs) > 1 and runs[-1][0] == 0 and runs[-2][0] == period
            if back and np.hypot(*(where[i] - where[left])) < BACK * self.near:
                runs.pop()
            if runs and runs[-1][0] == period:
                runs[-1] = (period, runs[-1][1], value)
            else:
                runs.append((period, value, value))
            left = i if period else left
        return runs

    @property
    def told(self) -> str:
        """The story in words, without its end."""
        kinds = {1: "repeats every revolution", 2: "repeats every two revolutions",
                 0: "does not repeat"}

        def say(value: float) -> str:
            return _say(self.parameter, value)

        return "; ".join(f"{kinds[p]} " + (f"at {say(a)}" if a == b else
                                           f"from {say(a)} to {say(b)}")
                         for p, a, b in self.story)

    def __str__(self) -> str:
        told = f"Motion while {self.parameter} moved: it {self.told}. " if self.told else ""
        return f"{told}{self.stopped} {self.doubt}".rstrip() + self.basis


def settings(orbit: PeriodicOrbit, parameter: str) -> tuple[float, Callable[[NDArray], Setting]]:
    """An orbit's own value of a parameter, and the setting at other values, one for each member.

    Raises BadInput for a parameter that does not move in time, or an eccentricity without a gap.
    """
    model, eccentricity = orbit.model, orbit.static_eccentricity
    if not math.isfinite(model.gap) and parameter in ("static_eccentricity", "direction"):
        raise BadInput(f"{model.name} has no air gap, so there is no {parameter} to move.")
    unit = direction(orbit)[:, None]
    here = Setting(orbit.centre[:, None])
    makers: dict[str, tuple[float, Callable[[NDArray], Setting]]] = {
        "static_eccentricity": (eccentricity, lambda v: Setting(model.gap * unit * v)),
        "direction": (math.atan2(*unit[:, 0]), lambda v: Setting(
            eccentricity * model.gap * np.array([np.sin(v), np.cos(v)]))),
        "field": (1.0, lambda v: here._replace(field=v)),
        "unbalance": (1.0, lambda v: here._replace(unbalance=v)),
    }
    if parameter not in makers:
        raise BadInput(f"parameter is {parameter!r}; what can move in time is {', '.join(makers)}. "
                       "Follow anything else with `follow`, or go in steps with `integrate`.")
    return makers[parameter]


def direction(orbit: PeriodicOrbit) -> NDArray:
    """Unit vector (x, z) along which the stator is offset; along x where it is not."""
    if not orbit.static_eccentricity:
        return np.array([1.0, 0.0])
    return orbit.centre / (orbit.static_eccentricity * orbit.model.gap)


def _allowed(parameter: str, values: ArrayLike) -> NDArray:
    """Values to go to, checked; (n,)."""
    found = np.atleast_1d(np.asarray(values, dtype=float))
    if not len(found) or not np.isfinite(found).all():
        raise BadInput(f"the values of {parameter} must be finite numbers, at least one.")
    if parameter == "static_eccentricity" and np.abs(found).max() >= 1:
        raise BadInput("values must be eccentricities, fractions of the gap between -1 and 1 "
                       f"(8 % is 0.08); one is {found[np.argmax(np.abs(found))]:g}.")
    if parameter in ("field", "unbalance") and found.min() < 0:
        raise BadInput(f"a value of {parameter} is {found.min():g}; it is a factor, 0 or more.")
    return found


def _say(parameter: str, value: float) -> str:
    return f"{100 * value:.4g} %" if parameter == "static_eccentricity" else f"{value:.5g}"


def _watched(system: Split, start: PeriodicOrbit, course: Course, members: int, steps: int,
             spans: tuple[int, int], progress: Progress | None) -> tuple[NDArray, NDArray]:
    """The generator's (x, z) after each revolution, m, (made, 2, members), and contacts as
    `motions` has them, of members that begin on an orbit; spans: revolutions in one, how many.
    """
    begin = np.repeat(system.state(start)[:, None], members, axis=1)
    places, contact, (each, count) = [], np.full(members, np.nan), spans
    with suppress(KeyboardInterrupt):
        for states, now in motions(system, begin, course, steps):
            places.append(system.watch[:2] @ states)
            contact = now
            if progress and len(places) % each == 0:
                progress(len(places) // each, count)
            if len(places) == each * count:
                break
    return np.array(places).reshape(-1, 2, members), contact


def drift(start: PeriodicOrbit, parameter: str = "static_eccentricity", *, to: ArrayLike,
          per_revolution: float, steps: int = 128, modes: int = 6,
          progress: Progress | None = None) -> Passage:
    """Begin on an orbit and move a parameter evenly and continuously.

    parameter: static_eccentricity (fraction of the gap), direction (gap angle of the offset, rad),
    field or unbalance (factors on the machine's own). to: where it goes; several values are gone to
    one after another. per_revolution: how far it moves in a revolution, above 0. steps: in a
    revolution; the parameter moves with each. modes: of the basis (`reduce`). progress: called with
    the revolutions done and all. Ends at contact or an interrupt (Ctrl-C); what was passed is kept.
    Raises BadInput for what does not fit.
    """
    first, setting = settings(start, parameter)
    corners = np.array([first, *_allowed(parameter, to)])
    number("per_revolution", per_revolution, above=0)
    times = np.append(0.0, np.cumsum(np.abs(np.diff(corners))) / per_revolution)
    total = math.ceil(times[-1] - 1e-9)
    if not total:
        raise BadInput(f"to is {to!r}, where the motion begins; give another value of {parameter}.")
    before = 2 * math.pi * np.arange(-KEPT + 1, 1)
    system = split_for(start, steps, modes)
    course = _moving(setting, lambda time: np.interp([time], times, corners))
    places, contact = _watched(system, start, course, 1, steps, (1, total), progress)
    touched = bool(np.isfinite(contact[0]))
    done = len(places) - touched
    section = [*start.positions(before).T, *places[:done, :, 0]]
    why = ("The rotor touches the stator" if touched else
           "It went all the way" if done == total else "It was interrupted")
    there = _say(parameter, float(np.interp(done + touched, times, corners)))
    windows = np.lib.stride_tricks.sliding_window_view(np.array(section), KEPT, axis=0)[1:]
    return Passage(parameter, np.interp(np.arange(1, done + 1), times, corners),
                   windows.transpose(0, 2, 1), REPEATS * start.model.length_scale,
                   f"{why}, at {there}.", basis=system.told)


def _moving(setting: Callable[[NDArray], Setting], value: Callable[[float], NDArray]) -> Course:
    """The course of members with given values over time; the same setting while no value moves."""
    last: list[tuple[NDArray, Setting]] = []

    def course(time: float) -> Setting:
        now = value(time)
        if not last or not np.array_equal(last[0][0], now):
            last[:] = [(now, setting(now))]
        return last[0][1]

    return course


def sweep_in_time(start: PeriodicOrbit, values: Iterable[float],
                  parameter: str = "static_eccentricity", *, revolutions: int = 80, keep: int = 8,
                  steps: int = 128, modes: int = 12, progress: Progress | None = None) -> Passage:
    """Begin on an orbit and move a parameter through these values at one instant each, waiting
    `revolutions` at each.

    A step is a kick. So two more motions are made: one with half the steps, in as many revolutions,
    and one that is moved half a revolution later; where either ends elsewhere, `doubt` says so.
    parameter: as for `drift`. keep: revolutions at each value whose Poincaré section is kept.
    steps, modes: in a revolution, and of the basis. progress: called with the values done and all.
    Ends early at contact or an interrupt (Ctrl-C); the values passed before are kept. Raises
    BadInput for values or numbers that do not fit.
    """
    first, setting = settings(start, parameter)
    wanted = _allowed(parameter, list(values))
    if not 1 <= keep <= revolutions:
        raise BadInput(f"keep is {keep}; it must lie between 1 and the {revolutions} revolutions.")
    at = np.append(first, wanted)

    def value(time: float) -> NDArray:
        """As asked, with half the steps, and half a revolution later."""
        step, within = divmod(time, revolutions)
        i = min(int(step), len(wanted) - 1)
        half = at[i] if within < revolutions / 2 else at[i + 1]
        late = at[i] if within < 0.5 else at[i + 1]
        return np.array([at[i + 1], (half + at[i + 1]) / 2, late])

    system = split_for(start, steps, modes)
    kept, contact = _watched(system, start, _moving(setting, value), 3, steps,
                             (revolutions, len(wanted)), progress)
    ended = np.isfinite(contact).all() or len(kept) == revolutions * len(wanted)
    passed = np.where(np.isfinite(contact), contact, len(kept)).astype(int) // revolutions
    n, stopped = int(passed[0]), "It passed all the values asked for."
    if n < len(wanted):
        why = "It was interrupted" if np.isnan(contact[0]) else "The rotor touches the stator"
        stopped = f"{why} at {_say(parameter, wanted[n])}."
    section = kept[:n * revolutions].reshape(n, revolutions, 2, 3)[:, -keep:]
    doubt = ""
    if ended:
        where = ["" if i == len(wanted) else _say(parameter, wanted[i]) for i in passed]
        last = kept[-1] if n < len(wanted) else section[-1].mean(axis=0)
        doubt = _doubt(where, last, CLOSE * start.model.length_scale)
    return Passage(parameter, wanted[:n], section[..., 0], STILL, stopped, doubt, system.told)


def _doubt(touched: list[str], last: NDArray, near: float) -> str:
    """Whether motions that were stepped otherwise end otherwise; touched: where each did, in words;
    last: mean of its last sections, (2, 3).
    """
    said = []
    for i, how in ((1, "with half the steps"), (2, "with steps half a revolution later")):
        if touched[i] != touched[0]:
            said.append(f"{how} it "
                        + (f"touches at {touched[i]}" if touched[i] else "passes them all"))
        elif not touched[0] and np.hypot(*(last[:, i] - last[:, 0])) > near:
            said.append(f"{how} it ends on another motion")
    if not said:
        return ""
    return f"How it ends depends on the steps: {', '.join(said)}. `drift` moves it continuously."


def poincare(start: PeriodicOrbit, static_eccentricity: float, *, revolutions: int = 600,
             keep: int = 300, steps: int = 256, modes: int = 12) -> Passage:
    """The Poincaré section at one eccentricity, of a motion that begins on an orbit found
    elsewhere; arguments as for `sweep_in_time`.
    """
    return sweep_in_time(start, [static_eccentricity], revolutions=revolutions, keep=keep,
                         steps=steps, modes=modes)
