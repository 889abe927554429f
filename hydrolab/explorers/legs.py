"""What explorers ask of a machine: its branch, leg by leg, ready to be drawn and to be asked for
its orbit at any eccentricity; the parts that it needs; its radial bearings, of whatever kind.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.branches import Branch, branch_stability, orbits_at
from hydrolab.dynamics.following import Arclength, follow
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.stability import Floquet
from hydrolab.errors import BadInput
from hydrolab.figures.drawing import UM, nearest
from hydrolab.figures.orbits import curve, stretches
from hydrolab.figures.readings import first_along, verdicts
from hydrolab.figures.style import COLOURS, LINES
from hydrolab.machine import Machine, load_machine
from hydrolab.machine.quantities import dotted, numbers_of

SHOWN = {"N/m": ("GN/m", 1e-9), "Pa s": ("mPa s", 1e3)}  # what sliders show SI units in
STEP = 0.05  # % of eccentricity, between two stops of a slider
# static eccentricity (points,), local coefficients (points, c, 2m + 1) → what is drawn, (points,)
Number = Callable[[NDArray, NDArray], NDArray]


@dataclass(frozen=True, eq=False)
class Leg:
    """A stretch of a branch between folds or ends: least and greatest eccentricity, its rows."""

    low: float
    high: float
    rows: slice

    def holds(self, eccentricity: float) -> bool:
        """Whether the leg passes this eccentricity."""
        return self.low <= eccentricity <= self.high

    def stop(self, percentage: float) -> float:
        """The stop (%) on the leg nearest to a percentage; the middle where a leg has none."""
        first, last = math.ceil(100 * self.low / STEP), math.floor(100 * self.high / STEP)
        if last < first:
            return 50 * (self.low + self.high)
        return STEP * min(max(round(percentage / STEP), first), last)


@dataclass(frozen=True, eq=False)
class Legs:
    """A branch from zero eccentricity, cut at its folds, with the verdict on each of its points."""

    branch: Branch
    stability: Sequence[Floquet]

    @cached_property
    def all(self) -> tuple[Leg, ...]:
        """The legs in the order met, without the tail after the last fold that was asked for."""
        folds, values = self.branch.folds, self.branch.static_eccentricity
        ends = [values[0], *(fold.value for fold in folds), values[-1]]
        rows = [0, *(fold.after + 1 for fold in folds), len(values)]
        legs = [Leg(float(min(ends[i:i + 2])), float(max(ends[i:i + 2])), slice(*rows[i:i + 2]))
                for i in range(len(rows) - 1)]
        return tuple(legs[:-1] if self.goes_on else legs)

    @property
    def goes_on(self) -> bool:
        """Whether the branch goes on behind the legs: a sweep never gets to a fold."""
        return len(self.branch.folds) >= getattr(self.branch.method, "max_folds", math.inf)

    @property
    def where(self) -> str:
        """Words for where steady states were looked for, if that is not the whole branch."""
        return f" on its first {len(self.all)} legs" if self.goes_on else ""

    @property
    def reach(self) -> float:
        """The greatest eccentricity of any leg, fraction of the gap."""
        return max(leg.high for leg in self.all)

    @cached_property
    def words(self) -> list[str]:
        """"stable", "unstable" or "unknown" for each point of the branch."""
        return verdicts(self.branch, self.stability)

    def orbit(self, eccentricity: float, leg: int) -> PeriodicOrbit | None:
        """The steady state on a leg (0 is the first) at an eccentricity; None: there is none."""
        if not (0 <= leg < len(self.all) and self.all[leg].holds(eccentricity)):
            return None
        place = sum(other.holds(eccentricity) for other in self.all[:leg])
        found = orbits_at(self.branch, eccentricity)
        return found[place] if place < len(found) else None

    def orbits(self, eccentricity: float) -> list[PeriodicOrbit]:
        """The steady states of all legs that pass an eccentricity, in their order."""
        return orbits_at(self.branch, eccentricity)[:sum(leg.holds(eccentricity)
                                                         for leg in self.all)]

    def verdict(self, eccentricity: float, leg: int) -> str:
        """The verdict on the point of a leg (0 is the first) nearest to an eccentricity."""
        rows = range(*self.all[leg].rows.indices(len(self.branch)))
        away = np.abs(self.branch.static_eccentricity[rows.start:rows.stop] - eccentricity)
        return self.words[rows.start + int(np.argmin(away))] if len(away) else "unknown"

    def stable_at(self, eccentricity: float) -> tuple[int, ...]:
        """The legs (0 is the first) that a machine can be on at an eccentricity."""
        return tuple(i for i, leg in enumerate(self.all)
                     if leg.holds(eccentricity) and self.verdict(eccentricity, i) == "stable")

    def first(self, eccentricity: NDArray, local: NDArray) -> NDArray:
        """1X along the eccentricity, µm 0-to-peak, of local coefficients: a `Number`."""
        return UM * first_along(self.branch, local)

    def lines(self, number: Number, per_branch: int = 240) -> dict[str, tuple[NDArray, NDArray]]:
        """Eccentricity (%) and `number` by verdict, nan between stretches; per_branch: points."""
        smooth = curve(self.branch)
        whole = smooth.at_points[-1] - smooth.at_points[0]
        pieces: dict[str, list] = {}
        for word, start, end in stretches(smooth, self.words):
            count = 8 + round(per_branch * (end - start) / whole)
            eccentricity, local = smooth(np.linspace(start, end, count))
            piece = 100 * eccentricity, number(eccentricity, local)
            pieces.setdefault(word, []).append([np.append(part, np.nan) for part in piece])
        return {word: tuple(np.concatenate(column) for column in zip(*found, strict=True))
                for word, found in pieces.items()}

    def dense(self, number: Number) -> tuple[NDArray, NDArray, NDArray]:
        """Eccentricity (%), `number` and the leg (1 is the first), at 300 points of each leg."""
        smooth = curve(self.branch)
        ends = np.concatenate([[0.0], smooth.at_folds, smooth.at_points[-1:]])
        place = np.concatenate([np.linspace(*ends[i:i + 2], 300) for i in range(len(self.all))])
        eccentricity, local = smooth(place)
        legs = np.repeat(np.arange(len(self.all)) + 1, 300)
        return 100 * eccentricity, number(eccentricity, local), legs

    def at_folds(self) -> list[PeriodicOrbit]:
        """The orbits at the folds in which a leg of `all` ends."""
        return [self.branch.at_fold(i) for i in range(min(len(self.branch.folds), len(self.all)))]


@lru_cache(maxsize=4)
def legs_of(machine: Machine) -> Legs:
    """The branch of a machine at its rated speed, counted stability and all; several explorers of
    one machine share it.

    Raises BadInput for a machine without an air gap or at rest, NoConvergence where there is no
    first steady state.
    """
    machine_with(machine, "", "air_gap")
    if not machine.speed > 0:
        raise BadInput("speed is 0 rad/s; an explorer of steady states needs a turning rotor.")
    with threadpool_limits(1):
        # three legs: what comes after the third fold is never stable, and a slider has little time
        branch = follow(machine.model(), speed=machine.speed, to=0.5, method=Arclength(max_folds=3))
        return Legs(branch, branch_stability(branch, locate=False).points)


class Diagram:
    """1X along the eccentricity over all legs, drawn once, and where a click on it lands."""

    def __init__(self, axes: Axes, legs: Legs) -> None:
        self.axes, self.legs = axes, legs
        self.dense = legs.dense(legs.first)
        for word, line in legs.lines(legs.first).items():
            axes.plot(*line, LINES[word], color=COLOURS[word], label=word)
        axes.plot(*self.place(*legs.at_folds()), "D", color=COLOURS["fold"], markersize=6)
        axes.set(title="Steady states: 1X in x", xlabel="static eccentricity, %",
                 ylabel="µm (0-to-peak)", xlim=(0, 104 * legs.reach),
                 ylim=(0, 1.25 * max(self.dense[1])))
        axes.legend(loc="upper right", ncols=2, fontsize=11)
        self.cursor = axes.axvline(0.0, color=COLOURS["axis"], linewidth=1)

    def place(self, *orbits: PeriodicOrbit) -> tuple[list[float], list[float]]:
        """Where some orbits lie in the diagram: eccentricities (%) and 1X (µm)."""
        value = [self.legs.first(np.empty(0), orbit.local[None])[0] for orbit in orbits]
        return [100 * orbit.static_eccentricity for orbit in orbits], value

    def pick(self, x: float, y: float) -> tuple[float, int] | None:
        """A stop of the slider (%) and the leg (1 is the first) nearest to a place in the figure,
        or None off the diagram; x, y as `View.pick` takes them.
        """
        eccentricity, values, legs = self.dense
        at = nearest(self.axes, x, y, np.column_stack([eccentricity, values]))
        if at is None:
            return None
        return self.legs.all[legs[at] - 1].stop(eccentricity[at]), int(legs[at])


def machine_with(machine: Machine | None, card: str, *parts: str) -> Machine:
    """A machine, by default the one of a card; BadInput where it lacks one of these parts."""
    machine = machine or load_machine(card)
    if lacks := [part for part in parts if getattr(machine, part) is None]:
        raise BadInput(f"{machine.name} has no {' and no '.join(lacks)}; this explorer needs "
                       f"{' and '.join(parts)}.")
    return machine


@dataclass(frozen=True, eq=False)
class Guide:
    """A radial bearing: its name and node, the key of its stiffness, and that number, SI; unit and
    scale say how a slider shows it.
    """

    name: str
    node: int
    key: str
    value: NDArray | float
    unit: str
    scale: float

    @property
    def shown(self) -> float:
        """Its stiffness as a slider shows it."""
        return self.scale * float(np.abs(self.value).max())


def guides(machine: Machine) -> list[Guide]:
    """All bearings of a machine but those against tilt."""
    found = []
    for bearing in machine.all_bearings:
        if bearing not in machine.thrust_bearings:
            name = bearing.told_by
            unit = numbers_of(type(bearing))[name].unit
            found.append(Guide(bearing.name, bearing.node, dotted(bearing.key, name),
                               getattr(bearing, name), *SHOWN.get(unit, (unit, 1.0))))
    return found


def guide_of(machine: Machine) -> Guide:
    """The radial bearing nearest to the body in the air gap; BadInput for a machine without one."""
    home, found = machine.body(machine.air_gap.body).node, guides(machine)
    if not found:
        raise BadInput(f"{machine.name} has no radial bearing; this explorer changes the stiffness "
                       "of one.")
    return min(found, key=lambda guide: abs(guide.node - home))
