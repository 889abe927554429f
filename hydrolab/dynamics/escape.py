"""How a rotor leaves its orbit: where it arrives beyond a fold, and how much push it takes before.

Beyond a fold there is no orbit to stay on, and two machines moved on by the same amount may end
differently: it depends on the phase. `arrivals` counts, a `Jump` follows some of them. Long before
the fold the basin of the orbit shrinks, so that a push that was harmless throws the rotor out:
`integrity` after Soliman and Thompson (1989), who found that it goes suddenly and far from the loss
of stability itself.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.branches import Branch, SpecialPoint, orbits_at, stable_orbits_at
from hydrolab.dynamics.ensemble import (
    CONTACT,
    OTHER,
    Course,
    Progress,
    Setting,
    Split,
    advance,
    reached,
    shifted,
    split_for,
    starts,
    turn,
)
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.slow_change import direction
from hydrolab.errors import BadInput
from hydrolab.machine.model import Model
from hydrolab.machine.quantities import number, whole

SAME = 0.05  # of the gap: orbits at neighbouring values that are this near belong to one family
SIZES = tuple(np.geomspace(3e-5, 1e-3, 40))  # of the gap: 0.3 to 11 µm where it is 11 mm


@dataclass(frozen=True, eq=False)
class Arrivals:
    """Where motions end that were moved past a fold.

    fold: it. sizes: how far beyond it they were moved at one instant, in units of the parameter,
    (n,). phases: of the rotation at that instant, rad, (n, m). ends: index of the orbit reached, −1
    for contact, −2 for none of these, (n, m). orbits: one of each family reached, as it is beyond
    the smallest step. revolutions: made after the step. basis: what the motions leave out, in
    words.
    """

    fold: SpecialPoint
    sizes: NDArray
    phases: NDArray
    ends: NDArray
    orbits: tuple[PeriodicOrbit, ...]
    revolutions: int
    basis: str = ""

    def share(self, end: int) -> float:
        """Share of all motions that end so."""
        return float(np.mean(self.ends == end))

    def interval(self, end: int, confidence: float = 0.95) -> tuple[float, float]:
        """Interval in which that share lies with this confidence, if phases come at random (Wilson
        1927).
        """
        from scipy.stats import binomtest  # takes as long to import as the rest of SciPy
        count = binomtest(int(np.sum(self.ends == end)), self.ends.size)
        low, high = count.proportion_ci(confidence, method="wilson")
        return float(low), float(high)

    def __str__(self) -> str:
        def say(end: int) -> str:
            low, high = (100 * x for x in self.interval(end))
            return f"{100 * self.share(end):.1f} % ({low:.1f} to {high:.1f} %)"

        parts = [f"{say(CONTACT)} touch the stator"]
        parts += [f"{say(i)} end on the orbit with a mean displacement of "
                  f"{1e6 * np.hypot(*orbit.mean):.0f} µm"
                  for i, orbit in enumerate(self.orbits)]
        if self.share(OTHER):
            parts.append(f"{say(OTHER)} on neither")
        return (f"{self.ends.size} motions moved past the {self.fold} by "
                f"{100 * self.sizes.min():.1g} to {100 * self.sizes.max():.1g} % at one instant, "
                f"at any phase; after {self.revolutions} revolutions {', '.join(parts)}. In "
                f"brackets: 95 % confidence.{self.basis}")


def arrivals(branch: Branch, fold: int = 0, *, sizes: ArrayLike = SIZES, phases: int = 25,
             among: Sequence[Branch] = (), revolutions: int = 180, steps: int = 1024,
             modes: int = 4, seed: int = 0, progress: Progress | None = None) -> Arrivals:
    """Move a machine past a fold of the static eccentricity and see where it ends.

    Each motion is on the orbit at the fold, the last there is, when the stator is moved on at one
    instant. branch: along the static eccentricity. fold: which of its folds, 0 is the first. sizes:
    of the steps, fractions of the gap. phases: how many for each size, one at random (`seed`) in
    each of as many parts of the period. among:
    other branches whose stable orbits a motion may reach. revolutions: after the step, of `steps`
    steps, on `modes` modes. progress: called with the revolutions done and all. An interrupt
    (Ctrl-C) keeps what was done. Raises BadInput for another parameter, a fold that is not there,
    or sizes that are not above 0.
    """
    orbit = _along_eccentricity(branch).at_fold(fold)
    point = branch.folds[fold]
    sizes = np.atleast_1d(np.asarray(sizes, dtype=float))
    number("the smallest of sizes", float(sizes.min()), above=0)
    whole("phases", phases, 1)
    beyond = point.value + math.copysign(1.0, point.value - branch.values[point.after]) * sizes
    system, q = split_for(orbit, steps, modes), orbit.revolutions
    # one at random in each of as many equal parts of the period
    parts = np.arange(phases) + np.random.default_rng(seed).random((len(sizes), phases))
    turns = q * parts / phases
    course = _moved_on(orbit, np.repeat(beyond, phases), turns.ravel())
    begin = np.repeat(system.state(orbit)[:, None], turns.size, axis=1)
    states, _, made = advance(system, begin, course, q + revolutions, steps, progress=progress)
    ends, families = _families(system, states.reshape(len(states), len(sizes), phases),
                               [branch, *among], beyond)
    return Arrivals(point, sizes, 2 * math.pi * turns, ends, families, max(0, made - q),
                    system.told)


def _moved_on(orbit: PeriodicOrbit, after: NDArray, turns: NDArray) -> Course:
    """The course of machines on an orbit whose stators move on to their static eccentricities
    `after`, each at its own time `turns` of the first period, (members,).
    """
    unit = direction(orbit)[:, None] * orbit.model.gap
    there = Setting(unit * after)

    def course(time: float) -> Setting:
        if time >= orbit.revolutions:
            return there
        return Setting(unit * np.where(time < turns, orbit.static_eccentricity, after))

    return course


def _families(system: Split, states: NDArray, branches: Sequence[Branch],
              values: NDArray) -> tuple[NDArray, tuple[PeriodicOrbit, ...]]:
    """Which family of stable orbits each motion, (2r, values, motions), is on, and the families."""
    ends = np.full(states.shape[1:], OTHER)
    families: list[PeriodicOrbit] = []
    newest: list[PeriodicOrbit] = []
    for i, value in enumerate(values):
        here = [o for branch in branches for o in stable_orbits_at(branch, value)]
        number_of = []
        for orbit in here:
            known = [k for k, o in enumerate(newest) if _near(o, orbit)]
            if not known:
                known = [len(families)]
                families.append(orbit)
                newest.append(orbit)
            newest[known[0]] = orbit
            number_of.append(known[0])
        found = reached(system, states[:, i], here)
        ends[i] = np.where(found < 0, found, np.array([*number_of, OTHER])[found])
    return ends, tuple(families)


def _near(one: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    """Whether two orbits at neighbouring values belong to one family."""
    return (one.revolutions == other.revolutions and one.harmonics == other.harmonics
            and np.abs(one.coefficients - other.coefficients).max() < SAME * one.model.gap)


def _along_eccentricity(branch: Branch) -> Branch:
    """The branch, if it runs along the static eccentricity."""
    if branch.parameter != "static_eccentricity":
        raise BadInput(f"the branch runs along {branch.parameter}; this takes one along "
                       "static_eccentricity.")
    return branch


@dataclass(frozen=True, eq=False)
class Integrity:
    """How the safe part of the basin shrinks along a leg.

    values: static eccentricity, fraction of the gap, (n,). displacement: m, (columns,), and
    velocity: m/s, (rows,), of the starts off the orbit at each value, at phase 0 along x. ends: 0
    back on the orbit, −1 contact, −2 anything else, (n, rows, columns). fold: where the leg ends,
    nan where it has no fold. speed, gap: of the model, rad/s and m. stopped: what was done.
    basis: what the motions leave out, in words.
    """

    values: NDArray
    displacement: NDArray
    velocity: NDArray
    ends: NDArray
    fold: float
    speed: float
    gap: float
    stopped: str
    basis: str = ""

    @property
    def safe(self) -> NDArray:
        """Share of the starts that do not touch over that at the first value, (n,): the integrity
        of Soliman and Thompson (1989).
        """
        share = np.mean(self.ends != CONTACT, axis=(1, 2))
        return share / share[0] if len(share) else share

    @property
    def returning(self) -> NDArray:
        """Share of the starts that come back to the orbit, over that at the first value, (n,)."""
        share = np.mean(self.ends == 0, axis=(1, 2))
        return share / share[0] if len(share) else share

    @property
    def reach(self) -> NDArray:
        """The smallest push, in gaps (velocities over gap · Ω), that does not come back, (n,)."""
        away = np.hypot(self.displacement / self.gap,
                        (self.velocity / (self.gap * self.speed))[:, None])
        return np.where(self.ends == 0, np.inf, away).min(axis=(1, 2))

    def falls_to(self, share: float) -> float:
        """The value at which `safe` first falls to a share, by straight lines; nan: it does not."""
        below = np.flatnonzero(self.safe < share)
        if not len(below) or not below[0]:
            return math.nan
        i = below[0]
        return float(np.interp(-share, -self.safe[i - 1:i + 1], self.values[i - 1:i + 1]))

    def __str__(self) -> str:
        if not len(self.values):
            return self.stopped
        half = self.falls_to(0.5)
        start, end = (f"{100 * v:.3g} %" for v in self.values[[0, -1]])
        halved = f"to half of it at {100 * half:.3g} % and " if math.isfinite(half) else ""
        fold = f", the fold is at {100 * self.fold:.4g} %" if self.fold < math.inf else ""
        return (f"{self.ends.shape[1]} × {self.ends.shape[2]} pushes at each of "
                f"{len(self.values)} eccentricities: the share that does not end in contact falls "
                f"from that at {start} {halved}to {100 * self.safe[-1]:.0f} % of it at {end}"
                f"{fold}. The smallest push that does not come back falls from "
                f"{self.reach[0]:.2f} to {self.reach[-1]:.2f} of the gap. {self.stopped}"
                ).rstrip() + self.basis


def integrity(branch: Branch, values: ArrayLike | None = None, *,
              displacement: ArrayLike | None = None, velocity: ArrayLike | None = None,
              revolutions: int = 100, steps: int = 128, modes: int = 4,
              progress: Progress | None = None) -> Integrity:
    """Push the generator off its orbit on the first leg in all ways, at each eccentricity.

    branch: along the static eccentricity. values: fractions of the gap on its first leg; by default
    30 from its start nearly to the fold. displacement: m, velocity: m/s, of the pushes; by default
    48 of each up to 0.7 of the gap and 0.7 of gap · Ω to either side. revolutions: made, of `steps`
    steps, on `modes` modes. progress: called with the values done and all. An interrupt (Ctrl-C)
    keeps the values done. Raises BadInput for another parameter or values beyond the leg.
    """
    model, speed = _along_eccentricity(branch).equations.model, branch.equations.speed
    leg = branch.values[branch.first_leg]
    first, last = leg[0], branch.folds[0].value if branch.folds else leg[-1]
    window = 0.7 * model.gap * np.linspace(-1, 1, 48)
    values = np.atleast_1d(np.asarray(np.linspace(first, last - 1e-3 * (last - first), 30)
                                      if values is None else values, dtype=float))
    if not ((values - first) * (values - last) <= 0).all():
        raise BadInput(f"values must lie on the first leg, from {100 * first:.4g} to "
                       f"{100 * last:.4g} %.")
    push = np.atleast_1d(window if displacement is None else displacement)
    kick = np.atleast_1d(speed * window if velocity is None else velocity)
    ends: list[NDArray] = []
    with suppress(KeyboardInterrupt):
        for value in values:
            orbit = orbits_at(branch, value)[0]
            system = split_for(orbit, steps, modes)
            states, _, made = advance(system, starts(system, orbit, push, kick),
                                      Setting(orbit.centre[:, None]), revolutions, steps)
            if made < revolutions:
                break
            ends.append(reached(system, states, [orbit]).reshape(len(kick), len(push)))
            if progress:
                progress(len(ends), len(values))
    done = len(ends)
    stopped = ("" if done == len(values) else
               f"It was interrupted after {done} of {len(values)} eccentricities.")
    return Integrity(values[:done], push, kick,
                     np.array(ends, dtype=int).reshape(done, len(kick), len(push)),
                     float(last) if branch.folds else math.nan, speed, model.gap, stopped,
                     system.told if done else "")


# ------------------------------------------------------------------ one motion over an edge

STAYS = 4  # revolutions for which a motion must be on an orbit
LEAVES = 0.02  # of the gap: farther from where it was, it has left
BEFORE, AFTER = 4, 6  # revolutions shown before it leaves and after it has arrived


class Jump:
    """What a machine does that is on the last orbit there is when the stator moves on: as many
    motions side by side as phases of that instant, integrated as long as one asks for it.

    start: the orbit. value: to which the static eccentricity moves. orbits: the stable ones there,
    labels: what they are called. members: how many motions. steps, modes: in a revolution, and of
    the basis. most: revolutions after which a motion that has not ended is said not to repeat. ends
    and contact: as in `Basins`, (members,); OTHER where a motion goes on. Raises BadInput where the
    steps are too few.
    """

    def __init__(self, start: PeriodicOrbit, value: float, orbits: Sequence[PeriodicOrbit],
                 labels: Sequence[Any], *, members: int = 24, steps: int = 96, modes: int = 6,
                 most: int = 260) -> None:
        self.start, self.value, self.steps, self.most = start, value, steps, most
        self.orbits, self.labels = tuple(orbits), tuple(labels)
        self.system = split_for(start, steps, modes)
        self.turns = start.revolutions * np.arange(members) / members
        self.course = _moved_on(start, np.full(members, value), self.turns)
        self.states = np.repeat(self.system.state(start)[:, None], members, axis=1)
        self.contact = np.full(members, np.nan)
        self.kept: list[NDArray] = []
        self.on = np.zeros(members, int)  # revolutions for which a motion has been on an orbit
        self.ends, self.arrived = np.full(members, OTHER), np.full(members, most)

    @property
    def made(self) -> int:
        """Revolutions integrated."""
        return len(self.kept)

    def work(self, seconds: float = math.inf) -> bool:
        """Integrate for some seconds; True when all have ended."""
        until = time.perf_counter() + seconds
        while not (done := self.made >= self.most or bool((self.ends != OTHER).all())):
            self._turn()
            if time.perf_counter() > until:
                break
        return done

    def _turn(self) -> None:
        """One more revolution of all that go on."""
        seen: list[NDArray] = []
        going = np.flatnonzero(np.isnan(self.contact))
        ends, self.contact[going] = turn(self.system, self.states[:, going], self.course, self.made,
                                         self.steps, going, seen)
        self.states[:, going] = np.where(np.isnan(self.contact[going]), ends, np.nan)
        kept = np.full((self.steps // 2, self.system.model.size, len(self.ends)), np.nan)
        kept[:, :, going] = seen[::2]
        self.kept.append(kept)
        found = reached(self.system, self.states, self.orbits)
        self.on = np.where(found >= 0, self.on + 1, 0)
        ended = (self.ends == OTHER) & ((found == CONTACT) | (self.on >= STAYS))
        self.ends[ended] = found[ended]
        self.arrived[ended] = self.made - STAYS * (found[ended] >= 0)

    def member(self, ending: str, phase: float) -> int:
        """The motion moved next to a phase (rad) among those of an ending: "orbit", "stator" or
        "any".
        """
        touches = self.ends == CONTACT
        fits = {"orbit": ~touches, "stator": touches}.get(ending, touches | True)
        away = np.abs((self.turns - phase / (2 * math.pi) + 0.5) % 1 - 0.5)
        return int(np.argmin(np.where(fits, away, 9.0) if fits.any() else away))

    def flight(self, member: int) -> Flight:
        """One of the motions, from where it leaves to where it ends."""
        q = np.concatenate([revolution[:, :, member] for revolution in self.kept])
        start, touched = self.start, float(self.contact[member])
        times = (2 * np.arange(len(q)) + (1 if self.system.implicit else 0.5)) / self.steps
        if math.isfinite(touched):  # from the last sample straight on to the stator
            end = int(np.searchsorted(times, touched))
            q = np.concatenate([q[:end], [_touching(self, q[end - 2], q[end - 1],
                                                              touched)]])
            times = np.append(times[:end], touched)
        place = self.system.watch[:, :q.shape[1]] @ q.T
        gaps = self._gaps(place, times)
        away = np.hypot(*(place[:2] - start.positions(2 * math.pi * times)))
        left = np.flatnonzero(away > LEAVES * start.model.length_scale)
        first = max(int(times[left[0]] if len(left) else 0) - BEFORE, 0)
        last = min(self.arrived[member] + AFTER, self.made)
        if math.isfinite(touched):
            gaps[-1], last = 0.0, touched
        return Flight(self.system.model, q, place[:2].T, gaps, times, float(first),
                      float(last) - 1e-6, int(self.ends[member]), self.value)

    def _gaps(self, place: NDArray, times: NDArray) -> NDArray:
        """Smallest gaps at places of the nonlinear coordinates, (c, T), m, (T,)."""
        centre = self.course(math.inf).centre[:, :1]
        law = self.start.model.law
        return law.smallest_gap(shifted(place, -centre), 2 * math.pi * times)

    def __str__(self) -> str:
        touching = int((self.ends == CONTACT).sum())
        return (f"Of {len(self.ends)} machines moved at as many phases {touching} touch the "
                "stator.")


def _touching(jump: Jump, before: NDArray, last: NDArray, touched: float) -> NDArray:
    """Where a motion that goes on straight from its last two samples meets the stator, (r,)."""
    onward = last + np.linspace(0, 4, 401)[:, None] * (last - before)
    gaps = jump._gaps(jump.system.watch[:, :len(last)] @ onward.T, np.full(401, touched))
    return onward[int(np.argmax(~(gaps > 0)))]


@dataclass(frozen=True, eq=False)
class Flight:
    """A motion in time: q, (T, r), the rotor's x, z (m), (T, 2), and the smallest gap (m) at times
    in revolutions, of which those from `first` to `last` are shown. ends: index of the orbit, −1
    for the stator, −2 for none. value: of the static eccentricity.
    """

    model: Model
    q: NDArray
    path: NDArray
    gaps: NDArray
    times: NDArray
    first: float
    last: float
    ends: int
    value: float

    def _at(self, rows: NDArray, phase: NDArray | float) -> NDArray:
        """Rows at phases Ωt of the flight, linearly between the samples."""
        moment = np.minimum(np.asarray(phase) / (2 * math.pi), self.last)
        end = int(np.searchsorted(self.times, self.last))  # the last sample that is shown
        place = np.clip(np.interp(moment, self.times, np.arange(len(self.times))), 0, end)
        low = np.minimum(np.floor(place).astype(int), end - 1)
        share = (place - low)[..., None]
        return (1 - share) * rows[low] + share * rows[low + 1]

    def nodes(self, phase: float) -> NDArray:
        """x, z, θx, θz of the shaft's nodes at a phase, (nodes, 4, 1)."""
        return self.model.at_nodes(self._at(self.q, phase)[:, None])

    def rotor(self, phase: NDArray) -> NDArray:
        """x, z of the rotor at phases, m, (…, 2)."""
        return self._at(self.path, phase)

    def first_harmonic(self, phase: float) -> float:
        """1X in x over the revolution before a phase, m 0-to-peak."""
        turns = phase + 2 * math.pi * np.arange(-24, 0) / 24
        return float(abs(2 * np.mean(self.rotor(turns)[:, 0] * np.exp(1j * turns))))

    def smallest_gap(self, phase: float) -> float:
        """The smallest gap up to a phase, m; 0 where the stator is touched."""
        now = phase / (2 * math.pi)
        if self.ends == CONTACT and now >= self.last:
            return 0.0
        passed = self.gaps[(self.times >= self.first) & (self.times <= min(now, self.last))]
        return float(passed.min()) if len(passed) else math.nan

    @property
    def shown(self) -> NDArray:
        """The part of the path that is shown, m, (2, P)."""
        return self.path[(self.times >= self.first) & (self.times <= self.last)].T

    def words(self, names: Sequence[str]) -> str:
        """What happens in it."""
        end = ("it touches the stator, where the model ends" if self.ends == CONTACT else
               "it does not come to repeat" if self.ends == OTHER else
               f"it settles on {names[self.ends]}")
        return f"Moved to {100 * self.value:.4g} %, {end} after {self.last:.0f} revolutions."
