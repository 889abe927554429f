"""The orbit that the 3D machine shows: solved along the branch as settings change, with words for
what happens.

Here leg: 0 is the first. field, unbalance: factors on the machine's own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from threadpoolctl import threadpool_limits

from hydrolab.dynamics.branches import Branch, branch_stability
from hydrolab.dynamics.following import update_branch
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.explorers.legs import Legs, legs_of
from hydrolab.figures.readings import percent
from hydrolab.machine.parts import Machine

FIELDS, UNBALANCES = (0.5, 1.2), (0.1, 2.0)
NO_GAP = "The card has no air gap, so no pull: a linear rotor with its unbalance."
STRAIGHT = "The card has neither air gap nor unbalance: the shaft turns straight."


@dataclass(frozen=True, eq=False)
class Shown:
    """An orbit with the leg it is on (0 is the first), its verdict, and what is to be said. jumped:
    from another orbit.
    """

    orbit: PeriodicOrbit
    leg: int
    verdict: str
    words: str
    jumped: bool = False


class LiveOrbit:
    """The steady states of a machine at its rated speed, ready to be asked for one.

    legs: the branch over the static eccentricity with its stability, None for a machine without an
    air gap.
    """

    def __init__(self, machine: Machine, branch: Branch | None = None) -> None:
        self.machine, self.model = machine, machine.model()
        self.balance = HarmonicBalance(4)
        self.legs: Legs | None = None
        self.strength = (1.0, 1.0)
        if branch is not None:
            self.legs = Legs(branch, branch_stability(branch, locate=False).points)
        elif machine.air_gap is not None:
            self.legs = legs_of(machine)
        elif not machine.speed > 0:
            raise BadInput("speed is 0 rad/s; the 3D view shows a turning machine.")
        self.own = self.legs

    @property
    def reach(self) -> float:
        """The largest static eccentricity at which there is a steady state, fraction of the gap."""
        return max(leg.high for leg in self.legs.all) if self.legs else 0.0

    def at(self, eccentricity: float, leg: int, field: float, unbalance: float,
           before: Shown | None = None) -> Shown:
        """The steady state asked for, or the one the machine would go to, or the one before with
        the reason in words.
        """
        with threadpool_limits(1):
            if self.legs is None:
                orbit = self.balance.solve(self.model.with_unbalance(unbalance), self.machine.speed)
                turned = any(body.unbalance for body in self.machine.bodies)
                return Shown(orbit, 0, "stable", NO_GAP if turned else STRAIGHT)
            try:
                self._strengthen(field, unbalance)
            except (NoConvergence, Contact, BadInput):
                return self._kept(before, f"With {percent(field)} of the field and "
                                  f"{percent(unbalance)} of the unbalance no steady state begins "
                                  "at the centre.")
            orbit = self.legs.orbit(eccentricity, leg)
            if orbit is None:
                return self._elsewhere(eccentricity, leg, before)
            verdict = self.legs.verdict(orbit, leg)
            stays = "" if verdict == "stable" else " A machine does not stay on it."
            return Shown(orbit, leg, verdict, f"Leg {leg + 1}, {verdict}.{stays}")

    def _strengthen(self, field: float, unbalance: float) -> None:
        """Move the branch to another field and unbalance."""
        if (field, unbalance) == self.strength:
            return
        if (field, unbalance) == (1.0, 1.0):
            self.legs = self.own
        else:
            branch = update_branch(self.legs.branch,
                                   self.model.with_field(field).with_unbalance(unbalance))
            self.legs = Legs(branch, branch_stability(branch, quick=True, locate=False).points)
        self.strength = (field, unbalance)

    def _elsewhere(self, eccentricity: float, leg: int, before: Shown | None) -> Shown:
        """Where the leg asked for has no orbit: a stable one of another leg, if there is one."""
        gone = f"At {percent(eccentricity, 4)} leg {leg + 1} has no steady state"
        for other in range(len(self.legs.all)):
            orbit = self.legs.orbit(eccentricity, other)
            if orbit is not None and self.legs.verdict(orbit, other) == "stable":
                words = f"{gone}: the machine jumps to leg {other + 1}, which is stable there."
                return Shown(orbit, other, "stable", words, jumped=True)
        return self._kept(before, f"{gone}, and no other leg has a stable one; the last orbit "
                                  "found is shown.")

    def _kept(self, before: Shown | None, words: str) -> Shown:
        if before is not None:
            return replace(before, verdict="unknown", words=words, jumped=False)
        return Shown(self.legs.branch[0], 0, "unknown", words)


def gap_words(orbit: PeriodicOrbit) -> str:
    """The smallest gap, large: "7.84 mm of 11 mm"."""
    gap = orbit.model.gap
    if not math.isfinite(gap):
        return "no air gap"
    return f"{1e3 * orbit.smallest_gap:.2f} mm of {1e3 * gap:.3g} mm"
