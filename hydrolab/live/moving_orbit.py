"""The orbit that the 3D machine shows: solved along the branch as settings change, with words for
what happens.

Here leg: 0 is the first. field, unbalance: factors on the machine's own.

The motion over an edge: a machine is on the last orbit there is when the stator moves on. Where it
ends depends on the phase of that instant, so several machines are moved, at as many phases, and
integrated side by side; one is shown, from where it leaves the orbit to where it ends.

ending: "orbit", "stator" or "any".
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from threading import Thread

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.branches import Branch, branch_stability
from hydrolab.dynamics.ensemble import CONTACT, OTHER, Setting, reached, split_for, turn
from hydrolab.dynamics.following import follow, update_branch
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.steady_states import branch_off
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.explorers.legs import Legs, legs_of
from hydrolab.figures.readings import percent, verdicts
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


FIELDS, UNBALANCES = (0.5, 1.2), (0.1, 2.0)
NO_GAP = "The card has no air gap, so no pull: a linear rotor with its unbalance."
STRAIGHT = "The card has neither air gap nor unbalance: the shaft turns straight."


@dataclass(frozen=True, eq=False)
class Shown:
    """An orbit with the leg it is on (0 is the first), its verdict, and what is to be said. jump:
    how the machine leaves it, where it cannot stay.
    """

    orbit: PeriodicOrbit
    leg: int
    verdict: str
    words: str
    jump: Jump | None = None


@lru_cache(maxsize=4)
def all_legs(machine: Machine) -> Legs:
    """The whole branch of a machine at its rated speed, to where it ends."""
    with threadpool_limits(1):
        branch = follow(machine.model(), speed=machine.speed, to=0.5)
        return Legs(branch, branch_stability(branch, locate=False).points)


@lru_cache(maxsize=4)
def doubled_of(branch: Branch) -> tuple[tuple[Legs, ...], tuple[PeriodicOrbit, ...]]:
    """The motions of two revolutions that begin where a branch loses its stability in a flip, and
    the orbits at those flips.
    """
    found: list[Legs] = []
    at: list[PeriodicOrbit] = []
    stability = branch_stability(branch)
    words = verdicts(branch, stability.points)
    for flip in stability.flips:
        if "stable" not in words[max(flip.after - 1, 0):flip.after + 3]:
            continue  # between motions that no machine can be in
        at.append(branch.orbit(flip.value, flip.unknowns, 0.0))
        try:
            off, stability = branch_off(branch, flip)
        except NoConvergence:
            continue
        found.append(Legs(off, stability.points))
    return tuple(found), tuple(at)


class LiveOrbit:
    """The steady states of a machine at its rated speed, ready to be asked for one.

    legs: the branch over the static eccentricity with its stability, None for a machine without an
    air gap. doubled: motions of two revolutions, once `look_for_doubled` has been called; they are
    counted after the legs.
    """

    def __init__(self, machine: Machine, branch: Branch | None = None) -> None:
        self.machine, self.model = machine, machine.model()
        self.balance = HarmonicBalance(4)
        self.legs: Legs | None = None
        self.strength = (1.0, 1.0)
        self.doubled: tuple[Legs, ...] = ()
        self.flips: tuple[PeriodicOrbit, ...] = ()
        self.search: Thread | None = None  # for the motions of two revolutions, beside the loop
        if not machine.speed > 0:
            raise BadInput("speed is 0 rad/s; the 3D view shows a turning machine.")
        if branch is not None:
            self.legs = Legs(branch, branch_stability(branch, locate=False).points)
        elif machine.air_gap is not None:
            self.legs = all_legs(machine)
        self.own = self.legs

    @property
    def reach(self) -> float:
        """The largest static eccentricity at which there is a steady state, fraction of the gap."""
        return max(leg.high for leg in self.legs.all) if self.legs else 0.0

    @property
    def ways(self) -> list[tuple[Legs, int]]:
        """All legs that there are, those of motions of two revolutions last."""
        return [(legs, i) for legs in (self.legs, *self.doubled) if legs
                for i in range(len(legs.all))]

    def name(self, leg: int) -> str:
        """What a leg is called."""
        if self.legs is None or leg < len(self.legs.all):
            return f"leg {leg + 1}"
        return "a motion of two revolutions"

    def stable_at(self, eccentricity: float) -> tuple[int, ...]:
        """The legs that the machine can be on."""
        return tuple(i for i, (legs, leg) in enumerate(self.ways)
                     if leg in legs.stable_at(eccentricity))

    def orbit(self, eccentricity: float, leg: int) -> tuple[PeriodicOrbit | None, str]:
        """The steady state on a leg, None where the leg does not pass, and the verdict on it."""
        ways = self.ways
        if not 0 <= leg < len(ways):
            return None, "unknown"
        legs, own = ways[leg]
        orbit = legs.orbit(eccentricity, own)
        return orbit, "unknown" if orbit is None else legs.verdict(orbit.static_eccentricity, own)

    def search_doubled(self) -> None:
        """Begin `look_for_doubled` in a thread, once, so that what is drawn goes on."""
        if self.search is None and self.own is not None:
            self.search = Thread(target=self.look_for_doubled, name="hydrolab flips", daemon=True)
            self.search.start()

    @property
    def searching(self) -> bool:
        """Whether the motions of two revolutions are being looked for."""
        return self.search is not None and self.search.is_alive()

    def look_for_doubled(self) -> None:
        """Find the motions of two revolutions, of the card's field and unbalance; takes seconds."""
        if self.own and self.strength == (1.0, 1.0) and not self.doubled and (
                self.own.branch.equations.revolutions == 1):
            with threadpool_limits(1):
                # the first three legs hold every stable motion, and take a third of the time
                same = self.own is all_legs(self.machine) if self.machine.air_gap else False
                found = doubled_of((legs_of(self.machine) if same else self.own).branch)
            if self.strength == (1.0, 1.0):  # not changed meanwhile
                self.doubled, self.flips = found

    def at(self, eccentricity: float, leg: int, field: float, unbalance: float,
           before: Shown | None = None) -> Shown:
        """The steady state asked for, or the one before with how the machine leaves it, or with the
        reason in words.
        """
        with threadpool_limits(1):
            if self.legs is None:
                orbit = self.balance.solve(self.model.with_unbalance(unbalance), self.machine.speed)
                turned = any(body.unbalance for body in self.machine.bodies)
                return Shown(orbit, 0, "stable", NO_GAP if turned else STRAIGHT)
            same = (field, unbalance) == self.strength
            try:
                self._strengthen(field, unbalance)
            except (NoConvergence, Contact, BadInput):
                return self._kept(before, f"With {percent(field)} of the field and "
                                  f"{percent(unbalance)} of the unbalance no steady state begins "
                                  "at the centre.")
            orbit, verdict = self.orbit(eccentricity, leg)
            slid = before is not None and before.leg == leg and before.verdict == "stable"
            if slid and (orbit is None or verdict == "unstable"):
                return self._left(eccentricity, leg, before, orbit, same)
            if orbit is None:
                return self._kept(before, f"At {percent(eccentricity, 4)} {self.name(leg)} has no "
                                  "steady state; the last orbit found is shown.")
            stays = "" if verdict == "stable" else " A machine does not stay on it."
            named = self.name(leg)
            return Shown(orbit, leg, verdict, f"{named[0].upper()}{named[1:]}, {verdict}.{stays}")

    def _strengthen(self, field: float, unbalance: float) -> None:
        """Move the branch to another field and unbalance."""
        if (field, unbalance) == self.strength:
            return
        self.doubled, self.flips = (), ()
        if (field, unbalance) == (1.0, 1.0):
            self.legs = self.own
        else:
            branch = update_branch(self.legs.branch,
                                   self.model.with_field(field).with_unbalance(unbalance))
            self.legs = Legs(branch, branch_stability(branch, quick=True, locate=False).points)
        self.strength = (field, unbalance)

    def _left(self, eccentricity: float, leg: int, before: Shown | None,
              there: PeriodicOrbit | None, same: bool) -> Shown:
        """Where the leg asked for has ended, or is stable no more: how the machine leaves it. same:
        whether field and unbalance are those of before; only the stator is moved in time.
        """
        named = self.name(leg)
        how = "has ended" if there is None else "is stable no more"
        gone = f"At {percent(eccentricity, 4)} {named} {how}"
        if there is not None and there.revolutions == 1 and not self.searching:
            self.look_for_doubled()
        elif there is not None and self.searching:
            return self._kept(before, f"{gone}; what follows is being looked for.")
        stable = [i for i in self.stable_at(eccentricity) if i != leg]
        two = [i for i in stable if self.ways[i][0].branch.equations.revolutions > 1]
        if two and there is not None:  # a flip: the new motion grows out of the old one
            orbit, verdict = self.orbit(eccentricity, two[0])
            return Shown(orbit, two[0], verdict, f"{gone}: the motion repeats every two "
                         "revolutions only.")
        start = self._edge(eccentricity, leg, before)
        if start is None:
            return self._kept(before, f"{gone}; the last orbit found is shown.")
        orbits = [self.orbit(eccentricity, i)[0] for i in stable]
        jump = None
        with suppress(BadInput):  # of forces that many motions at once are not made for
            jump = Jump(self.machine, start, eccentricity, orbits, stable) if same else None
        if jump is None and not stable:
            return self._kept(before, f"{gone}, and no other leg has a stable one; the last orbit "
                              "found is shown.")
        if jump is None:
            return Shown(orbits[0], stable[0], "stable", f"{gone}; {self.name(stable[0])} is stable"
                         " there, and is shown.")
        return Shown(start, leg, "stable", f"{gone}: the machine leaves it.", jump)

    def _edge(self, eccentricity: float, leg: int, before: Shown | None) -> PeriodicOrbit | None:
        """The last orbit of a leg on the way to an eccentricity: that of its fold, or the one shown
        before.
        """
        if leg < len(self.ways):
            legs, own = self.ways[leg]
            if not legs.all[own].holds(eccentricity):
                ends = [legs.branch.at_fold(i) for i in (own - 1, own)
                        if 0 <= i < len(legs.branch.folds)]
                if ends:
                    return min(ends, key=lambda o: abs(o.static_eccentricity - eccentricity))
        return before.orbit if before is not None and before.leg == leg else None

    def _kept(self, before: Shown | None, words: str) -> Shown:
        if before is not None:
            return replace(before, verdict="unknown", words=words, jump=None)
        return Shown(self.legs.branch[0], 0, "unknown", words)
