"""How a rotor leaves its orbit: where it arrives beyond a fold, and how much push it takes before.

Beyond a fold there is no orbit to stay on, and two machines moved on by the same amount may end
differently: it depends on the phase. `arrivals` counts. Long before the fold the basin of the orbit
shrinks, so that a push that was harmless throws the rotor out: `integrity` after Soliman and
Thompson (1989), who found that it goes suddenly and far from the loss of stability itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.branches import Branch, SpecialPoint, orbits_at, stable_orbits_at
from hydrolab.dynamics.ensemble import (
    CONTACT,
    OTHER,
    Progress,
    Setting,
    Split,
    advance,
    reached,
    split_for,
    starts,
)
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput
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
    unit = branch.direction[:, None] * orbit.model.gap
    after = np.repeat(beyond, phases)
    there = Setting(unit * after)

    def course(time: float) -> Setting:
        """Each is moved at its own phase of the first period."""
        if time >= q:
            return there
        return Setting(unit * np.where(time < turns.ravel(), point.value, after))

    begin = np.repeat(system.state(orbit)[:, None], turns.size, axis=1)
    states, _, made = advance(system, begin, course, q + revolutions, steps, progress=progress)
    ends, families = _families(system, states.reshape(len(states), len(sizes), phases),
                               [branch, *among], beyond)
    return Arrivals(point, sizes, 2 * math.pi * turns, ends, families, max(0, made - q),
                    system.told)


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
