"""Results in words: one sentence with units, computed from the result, in fixed formats.

Amplitudes are 0-to-peak. "Along" is the direction of the static eccentricity, in the paper x.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import singledispatch
from itertools import groupby, pairwise

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.branches import Branch
from hydrolab.dynamics.modes import Modes
from hydrolab.dynamics.results import PeriodicOrbit, Trajectory
from hydrolab.dynamics.stability import Floquet


def percent(fraction: float, digits: int = 3) -> str:
    """A fraction as a percentage with so many significant digits, "8.8 %"."""
    return f"{100 * fraction + 0.0:.{digits}g} %"


def microns(length: float) -> str:
    """A length in whole µm, with decimals where it is small: "519 µm", "0.042 µm"."""
    value = 1e6 * length
    size = abs(value)
    digits = 0 if size >= 10 or size < 5e-4 else 1 if size >= 1 else 3
    return f"{value if size >= 5e-4 else 0:.{digits}f} µm"


def listed(items: Iterable[str]) -> str:
    """ "a, b and c"."""
    *head, last = [*items] or ["none"]
    return f"{', '.join(head)} and {last}" if head else last


def along(branch: Branch, coefficients: NDArray | None = None) -> NDArray:
    """[mean, sin 1, cos 1, …] along the branch's direction, m, shape (points, 2m + 1); by default
    at its points, else from coefficients (points, c, 2m + 1) with x and z first.
    """
    if coefficients is None:
        coefficients = branch.coefficients
    return np.einsum("i,pik->pk", branch.direction, coefficients[:, :2])


def first_along(branch: Branch, coefficients: NDArray | None = None) -> NDArray:
    """1X along the eccentricity, m 0-to-peak, (points,); branch and coefficients as of `along`."""
    first = branch.equations.revolutions
    return np.hypot(*along(branch, coefficients)[:, 2 * first - 1:2 * first + 1].T)


def direction_words(branch: Branch) -> str:
    """What `along` is along, in words."""
    return "along the eccentricity" if math.isfinite(branch.equations.model.gap) else "in x"


def followed(branch: Branch) -> str:
    """The parameter that a branch follows, in words."""
    return branch.parameter.replace("_", " ")


def said(branch: Branch, value: float, digits: int = 3) -> str:
    """A value of a branch's parameter in words with so many digits, "8.8 %" of eccentricity."""
    if branch.parameter == "static_eccentricity":
        return percent(value, digits)
    if branch.parameter == "speed":
        return f"{value * 30 / math.pi:.{digits + 1}g} rpm"
    return branch.path.say(value, digits)


@singledispatch
def reading(result: object) -> str:
    """The sentence of a PeriodicOrbit, a Branch, a Trajectory or Modes; all else as it prints."""
    return str(result)


@reading.register
def orbit_reading(orbit: PeriodicOrbit) -> str:
    """Where the orbit is, how large each harmonic, and what is left of the gap."""
    x1, z1 = orbit.amplitudes[:, orbit.revolutions - 1]
    gap = "there is no air gap" if not math.isfinite(orbit.model.gap) else (
        f"the smallest gap is {1e3 * orbit.smallest_gap:.3f} mm of {1e3 * orbit.model.gap:.3f} mm")
    return (f"At {percent(orbit.static_eccentricity)} static eccentricity and "
            f"{orbit.speed * 30 / math.pi:.4g} rpm the mean position of the rotor is "
            f"{microns(math.hypot(*orbit.mean))} from the bearing axis; 1X is {microns(x1)} in x "
            f"and {microns(z1)} in z (0-to-peak), 2X is "
            f"{100 * orbit.second_share:.1f} % of 1X; {gap}.")


def verdicts(branch: Branch, stability: Sequence[Floquet], reach: int = 3) -> list[str]:
    """"stable", "unstable" or "unknown" for each point of a branch.

    At a fold a multiplier is 1, so the verdict on a point next to one may be open; it takes that of
    the nearest point on its own side of the fold, at most `reach` points away.
    """
    said = [s.verdict for s in stability]
    bounds = [0, *(fold.after + 1 for fold in branch.folds), len(said)]
    for start, end in pairwise(bounds):
        known = [i for i in range(start, min(end, len(said))) if stability[i].verdict != "unknown"]
        for i in set(range(start, min(end, len(said)))) - set(known):
            near = min(known, key=lambda j: abs(j - i), default=len(said) + reach)
            if abs(near - i) <= reach and (i - start < reach or end - 1 - i < reach):
                said[i] = said[near]
    return said


def stable_runs(words: Sequence[str]) -> list[tuple[int, int]]:
    """First and last row of each run of stable points."""
    runs = [[i for i, _ in run] for word, run in groupby(enumerate(words), key=lambda row: row[1])
            if word == "stable"]
    return [(run[0], run[-1]) for run in runs]


def stability_sentence(branch: Branch, stability: Sequence[Floquet]) -> str:
    """Where the points of a branch are stable, run by run; a run that ends at a fold is said to."""
    folds = {fold.after: fold.value for fold in branch.folds}

    def end(row: int, fold: float | None) -> str:
        return (said(branch, branch.values[row]) if fold is None
                else f"the fold at {said(branch, fold, 4)}")

    runs = [f"from {end(a, folds.get(a - 1))} to {end(b, folds.get(b))}" if b > a
            else f"at {end(a, None)}" for a, b in stable_runs(verdicts(branch, stability))]
    if not runs:
        return "no point of it is stable"
    nowhere = " and nowhere else" if len(stability) == len(branch) else ""
    return f"it is stable {listed(runs)}{nowhere}"


@reading.register
def branch_reading(branch: Branch, stability: Sequence[Floquet] | None = None) -> str:
    """Where the branch goes and folds, how 1X grows, and where it is stable if that is known."""
    first, folds = first_along(branch), [said(branch, fold.value, 4) for fold in branch.folds]
    words = (f"The branch starts at {said(branch, branch.values[0])} {followed(branch)}, "
             f"{f'folds at {listed(folds)}' if folds else 'has no fold'} and ends at "
             f"{said(branch, branch.values[-1])}; 1X {direction_words(branch)} (0-to-peak) starts "
             f"at {microns(first[0])} and is at most {microns(first.max())}")
    return f"{words}; {stability_sentence(branch, stability)}." if stability else f"{words}."


@reading.register
def trajectory_reading(trajectory: Trajectory) -> str:
    """How long the motion ran, how large it is at the end, and why it stopped."""
    path = trajectory.last(min(1.0, trajectory.revolutions))[1]
    middle = (path.max(axis=1) + path.min(axis=1)) / 2
    size = microns(float(np.hypot(*(path - middle[:, None])).max()))
    return (f"Over {trajectory.revolutions:.4g} revolutions at "
            f"{trajectory.speed * 30 / math.pi:.4g} rpm and "
            f"{percent(trajectory.static_eccentricity)} static eccentricity the rotor centre ends "
            f"within {size} of a point {microns(math.hypot(*middle))} from the bearing axis (last "
            f"revolution). {trajectory.stopped}")


@reading.register
def modes_reading(modes: Modes, shown: int = 4) -> str:
    """The lowest modes, so many as are shown: frequency, whirl and damping."""
    at = f"At {modes.speed * 30 / math.pi:.4g} rpm"
    lowest = [f"{hz:.2f} Hz ({way}, damping ratio {100 * ratio:.1f} %)" for hz, way, ratio in
              zip(modes.hertz[:shown], modes.direction, modes.damping_ratios, strict=False)]
    if not lowest:
        return f"{at} no mode oscillates."
    return f"{at} the lowest of {len(modes)} modes are at {listed(lowest)}."
