"""The motion over the edge: what a machine does when the orbit it was on has ended.

A machine is on the last orbit there is when the setting moves on. Where it ends depends on the
phase of that instant, so several machines are moved, at as many phases, and integrated side by
side; one of them is shown, from where it leaves the orbit to where it ends.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.ensemble import CONTACT, OTHER, Setting, reached, split_for, turn
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput
from hydrolab.figures.readings import percent
from hydrolab.live.poses import at_stations
from hydrolab.machine.model import Model
from hydrolab.machine.parts import Machine

MEMBERS, STEPS, MODES, EVERY = 24, 96, 6, 2  # of each revolution's steps every second is kept
MOST = 260  # revolutions after which a motion that has not ended is said not to repeat
STAYS = 4  # revolutions for which it must be on an orbit
LEAVES = 0.02  # of the gap: farther from where it was, it has left
BEFORE, AFTER = 4, 6  # revolutions shown before it leaves and after it has arrived
SLOWED = 2.0  # how many times slower than the machine it is shown
ENDINGS = ("any", "orbit", "stator")


class Jump:
    """Motions from `start`, an orbit, with the stator moved on to `value` (fraction of the gap).

    orbits: the stable ones there, and legs: those they are on. `work` integrates for a while and
    says whether all have ended; then `flight` gives one of them. Raises BadInput for a machine
    whose forces many motions at once are not made for.
    """

    def __init__(self, machine: Machine, start: PeriodicOrbit, value: float,
                 orbits: Sequence[PeriodicOrbit], legs: Sequence[int]) -> None:
        self.machine, self.start, self.value = machine, start, value
        self.orbits, self.legs = tuple(orbits), tuple(legs)
        self.system = split_for(start, STEPS, MODES)
        if self.system.implicit:
            raise BadInput(f"Forces of {machine.name} damp or are stiff; its motion over an edge "
                           "is not shown.")
        turns = start.revolutions * np.arange(MEMBERS) / MEMBERS
        unit = np.array([[start.model.gap], [0.0]])
        there = Setting(unit * np.full(MEMBERS, value))

        def course(moment: float) -> Setting:
            if moment >= start.revolutions:
                return there
            return Setting(unit * np.where(moment < turns, start.static_eccentricity, value))

        self.course, self.turns = course, turns
        self.states = np.repeat(self.system.state(start)[:, None], MEMBERS, axis=1)
        self.contact = np.full(MEMBERS, np.nan)
        self.kept: list[NDArray] = []
        self.on = np.zeros(MEMBERS, int)  # revolutions for which a motion has been on an orbit
        self.ends = np.full(MEMBERS, OTHER)
        self.arrived = np.full(MEMBERS, MOST)

    @property
    def made(self) -> int:
        """Revolutions integrated."""
        return len(self.kept)

    def work(self, seconds: float) -> bool:
        """Integrate for some seconds; True when all have ended."""
        until = time.perf_counter() + seconds
        while not (done := self.made >= MOST or bool((self.ends != OTHER).all())):
            self._turn()
            if time.perf_counter() > until:
                break
        return done

    def _turn(self) -> None:
        """One more revolution of all that go on."""
        seen: list[NDArray] = []
        going = np.flatnonzero(np.isnan(self.contact))
        ends, self.contact[going] = turn(self.system, self.states[:, going], self.course, self.made,
                                         STEPS, going, seen)
        self.states[:, going] = np.where(np.isnan(self.contact[going]), ends, np.nan)
        kept = np.full((STEPS // EVERY, len(self.system.model.M), MEMBERS), np.nan)
        kept[:, :, going] = seen[::EVERY]
        self.kept.append(kept)
        found = reached(self.system, self.states, self.orbits)
        self.on = np.where(found >= 0, self.on + 1, 0)
        ended = (self.ends == OTHER) & ((found == CONTACT) | (self.on >= STAYS))
        self.ends[ended] = found[ended]
        self.arrived[ended] = self.made - STAYS * (found[ended] >= 0)

    def member(self, ending: str, phase: float) -> int:
        """The motion that ends on an "orbit" or at the "stator", or "any", moved at a phase (rad)
        next to this one.
        """
        touches = self.ends == CONTACT
        fits = {"orbit": ~touches, "stator": touches}.get(ending, touches | True)
        away = np.abs((self.turns - phase / (2 * np.pi) + 0.5) % 1 - 0.5)
        return int(np.argmin(np.where(fits, away, 9.0) if fits.any() else away))

    def flight(self, member: int) -> Flight:
        """One of the motions, from where it leaves to where it ends."""
        q = np.concatenate([revolution[:, :, member] for revolution in self.kept])
        place = q @ self.system.watch[:, :q.shape[1]].T
        per, start, path = STEPS // EVERY, self.start, place[:, :2].copy()
        times = (np.arange(len(q)) * EVERY + 0.5) / STEPS
        place[:, 0] -= self.value * start.model.gap
        law = start.model.law
        gaps = law.smallest_gap(place.T, 2 * np.pi * times)
        away = np.hypot(*(path - start.positions(2 * np.pi * times).T).T)
        left = np.flatnonzero(away > LEAVES * start.model.gap)
        first = max((left[0] // per if len(left) else 0) - BEFORE, 0)
        touched = float(self.contact[member])
        if math.isfinite(touched):  # from the last sample straight on to the stator
            end = int(np.searchsorted(times, touched))
            far, near = place[end - 1] - place[end - 2], 2 * np.pi * touched
            steps = np.linspace(0, 4, 401)
            left = law.smallest_gap((place[end - 1] + steps[:, None] * far).T,
                                    np.full(len(steps), near))
            share = steps[int(np.argmax(~(left > 0)))]

            def on(rows: NDArray) -> NDArray:
                return np.concatenate([rows[:end], [rows[end - 1] + share * (
                    rows[end - 1] - rows[end - 2])]])

            q, path = on(q), on(path)
            gaps, times = np.append(gaps[:end], 0.0), np.append(times[:end], touched)
        last = touched if math.isfinite(touched) else min(self.arrived[member] + AFTER, self.made)
        return Flight(self.machine, self.system.model, q, path, gaps, times,
                      float(first), float(last) - 1e-6, int(self.ends[member]), self.value)

    def words(self) -> str:
        """How many of them ended how."""
        touching = int((self.ends == CONTACT).sum())
        return f"Of {MEMBERS} machines moved at as many phases {touching} touch the stator."


@dataclass(frozen=True, eq=False)
class Flight:
    """A motion in time: q, (T, r), the rotor's x, z (m), (T, 2), and the smallest gap (m) at times
    in revolutions, of which those from `first` to `last` are shown. ends: index of the orbit, or −1
    for the stator.
    """

    machine: Machine
    model: Model
    q: NDArray
    path: NDArray
    gaps: NDArray
    times: NDArray
    first: float
    last: float
    ends: int
    value: float

    def _at(self, rows: NDArray, moment: NDArray | float) -> NDArray:
        """Rows at times, linearly between the samples."""
        place = np.clip(np.interp(np.minimum(moment, self.last), self.times,
                                  np.arange(len(self.times))), 0, self._end)
        low = np.minimum(np.floor(place).astype(int), self._end - 1)
        share = (place - low)[..., None]
        return (1 - share) * rows[low] + share * rows[low + 1]

    @property
    def _end(self) -> int:
        """The last sample that is shown."""
        return int(np.searchsorted(self.times, self.last))

    def motion(self, phase: float) -> NDArray:
        """x, z, θx, θz of all stations at a phase Ωt of the flight, (S, 4)."""
        nodes = self.model.at_nodes(self._at(self.q, phase / (2 * np.pi))[:, None])
        return at_stations(self.machine, nodes)[2][..., 0]

    def rotor(self, phase: NDArray) -> NDArray:
        """x, z of the rotor at phases, m, (…, 2)."""
        return self._at(self.path, np.asarray(phase) / (2 * np.pi))

    def first_harmonic(self, phase: float) -> float:
        """1X in x over the revolution before a phase, m 0-to-peak."""
        turn = phase + 2 * np.pi * np.arange(-24, 0) / 24
        x = self.rotor(turn)[:, 0]
        return float(abs(2 * np.mean(x * np.exp(1j * turn))))

    def smallest_gap(self, phase: float) -> float:
        """The smallest gap up to a phase, m; 0 where the stator is touched."""
        now = phase / (2 * np.pi)
        if self.ends == CONTACT and now >= self.last:
            return 0.0
        passed = self.gaps[(self.times >= self.first) & (self.times <= min(now, self.last))]
        return float(passed.min()) if len(passed) else math.nan

    @property
    def shown(self) -> NDArray:
        """The part of the path that is shown, m, (2, P)."""
        inside = (self.times >= self.first) & (self.times <= self.last)
        return self.path[inside].T

    def words(self, names: Sequence[str]) -> str:
        """What happens in it."""
        end = ("it touches the stator, where the model ends" if self.ends == CONTACT else
               "it does not come to repeat" if self.ends == OTHER else
               f"it settles on {names[self.ends]}")
        return (f"Moved to {percent(self.value, 4)}, {end} after {self.last:.0f} "
                "revolutions.")
