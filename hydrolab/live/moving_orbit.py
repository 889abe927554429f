"""The orbit that the 3D machine shows: solved along the branch as settings change, with words for
what happens.

Here leg: 0 is the first. field, unbalance: factors on the machine's own.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from threading import Thread

from threadpoolctl import threadpool_limits

from hydrolab.dynamics.branches import Branch, branch_stability
from hydrolab.dynamics.escape import Jump
from hydrolab.dynamics.following import follow, update_branch
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.steady_states import branch_off
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.explorers.legs import Legs, legs_of
from hydrolab.figures.readings import percent, verdicts
from hydrolab.machine.parts import Machine

SLOWED = 2.0  # how many times slower than the machine a jump is shown
ENDINGS = ("any", "orbit", "stator")
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
            jump = Jump(start, eccentricity, orbits, stable) if same else None
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
