"""The figures of the paper's study in words, one sentence each, computed from the study."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.orbit_shape import ellipse, self_crossings
from hydrolab.dynamics.results import Branch, PeriodicOrbit
from hydrolab.dynamics.stability import Floquet
from hydrolab.dynamics.trajectory import Trajectory
from hydrolab.machine.model import Model
from hydrolab.machine.parts import Machine
from hydrolab.show.readings import PHASE, listed, microns, percent, second_share, stability_sentence, vibration

VALIDATION = 8.8  # the paper's percentages; `eccentricity` says what they stand for on another machine
BEYOND = 9.0
EVOLUTION = (0.0, 3.0, 5.0, 7.0, 8.0, 8.5, 8.8, 8.9)
ROTOR = (1.0, 5.0, 7.0, 8.9)
REPEATS = 1e-3  # two revolutions that differ by less than this share of the motion are the same


class StudyResult(Protocol):
    """What the figures see of a study: the attributes of `hydrolab.study.Study`."""

    machine: Machine
    model: Model
    speed: float
    branch: Branch
    orbits: dict[float, PeriodicOrbit]
    natural: Branch
    stability: tuple[Floquet, ...]
    check: Trajectory
    beyond: Trajectory
    beyond_orbits: tuple[tuple[PeriodicOrbit, Floquet], ...]

    def eccentricity(self, percentage: float) -> float:
        """Fraction of the gap that stands for a percentage of the paper on this machine."""


def quoted(study: StudyResult, percentage: float) -> str:
    """A percentage of the paper as it is on this machine, "8.8 %"."""
    return percent(study.eccentricity(percentage))


def validation(study: StudyResult) -> tuple[NDArray, NDArray, NDArray]:
    """Times (s) of the last three revolutions of the check, integrated positions, and harmonic balance there, m."""
    times, path = study.check.last(min(3.0, study.check.revolutions))
    return times, path, study.orbits[VALIDATION].positions(study.speed * times)


def figure_3_reading(study: StudyResult) -> str:
    """How far the two orbits are apart, and the smallest gap."""
    _, path, balance = validation(study)
    orbit = study.orbits[VALIDATION]
    apart = float(np.hypot(*(balance - path)).max())
    stopped = "" if study.check.finished else f" {study.check.stopped}"
    return (f"At {quoted(study, VALIDATION)} static eccentricity the orbits by harmonic balance ({orbit.harmonics} "
            f"harmonics) and by direct integration (the last 3 of {study.check.revolutions:.0f} revolutions) are at "
            f"most {microns(apart)} apart, {100 * apart / vibration(orbit):.3f} % of the largest vibration of "
            f"{microns(vibration(orbit))}; the smallest gap is {1e3 * orbit.smallest_gap:.3f} mm of "
            f"{1e3 * study.model.gap:.3f} mm.{stopped}")


def figure_4_reading(study: StudyResult) -> str:
    """How far x(t) and z(t) of the two methods are apart."""
    times, path, balance = validation(study)
    apart = np.abs(balance - path).max(axis=1)
    swing = np.ptp(balance, axis=1)
    return (f"Over the last {(times[-1] - times[0]) * study.speed / (2 * math.pi):.0f} revolutions at "
            f"{quoted(study, VALIDATION)} static eccentricity x swings over {microns(swing[0])} and z over "
            f"{microns(swing[1])} (peak to peak); harmonic balance and direct integration differ by at most "
            f"{microns(apart[0])} in x and {microns(apart[1])} in z.")


def figure_5_reading(study: StudyResult) -> str:
    """How mean, 1X and 2X grow on the first leg."""
    start, end = study.orbits[0.0], study.orbits[8.9]
    marks = [f"{microns(study.orbits[p].amplitudes[0, 0])} at {quoted(study, p)}" for p in (0.0, 4.0, 8.0, 8.9)]
    last = (f"the first fold, at {percent(study.branch.folds[0].value, 4)}" if study.branch.folds else
            f"the end of the branch, at {percent(study.branch.static_eccentricity[-1], 4)}")
    return (f"Up to {last} static eccentricity: 1X in x (0-to-peak) is {listed(marks)}, "
            f"{end.amplitudes[0, 0] / start.amplitudes[0, 0]:.2f} times that at 0 %; the mean in x is "
            f"{microns(abs(end.mean[0]))} at {quoted(study, 8.9)}; 2X is "
            f"{100 * second_share(study.orbits[4.0].coefficients):.1f} % of 1X at "
            f"{quoted(study, 4.0)} and {100 * second_share(end.coefficients):.1f} % at {quoted(study, 8.9)}.")


def figure_6_reading(study: StudyResult) -> str:
    """How far the orbit travels, how round it is, and where it has a loop."""
    orbits = [study.orbits[p] for p in EVOLUTION]
    ratios = [f"{ellipse(study.orbits[p].coefficients).ratio:.2f} at {quoted(study, p)}" for p in (0.0, 5.0, 7.0, 8.9)]
    looped = [quoted(study, p) for p, o in zip(EVOLUTION, orbits, strict=True) if self_crossings(o.positions(PHASE))]
    travelled = 1e3 * float(np.hypot(*(orbits[-1].mean - orbits[0].mean)))
    loops = f"the orbit crosses itself at {listed(looped)}" if looped else "no orbit crosses itself"
    return (f"From 0 to {quoted(study, EVOLUTION[-1])} static eccentricity the orbit at the generator travels "
            f"{travelled:.2f} mm towards the smallest gap; the axes of its 1X ellipse have the ratio "
            f"{listed(ratios)}; {loops}.")


def figure_7_reading(study: StudyResult) -> str:
    """The mean bend and the largest 1X over the whole rotor."""
    nodes = range(len(study.model.depths))

    def largest(p: float) -> tuple[float, float]:
        found = [study.orbits[p].node_coefficients(n) for n in nodes] + [study.orbits[p].coefficients]
        return max(math.hypot(*c[:, 0]) for c in found), max(ellipse(c).major for c in found)

    said = [f"{microns(mean)} and {microns(first)} at {quoted(study, p)}" for p, (mean, first) in zip(
        ROTOR, map(largest, ROTOR), strict=True)]
    return f"Largest mean displacement and largest 1X (0-to-peak, long half axis) of the rotor: {', '.join(said)}."


def outcome(trajectory: Trajectory) -> str:
    """What a motion comes to: contact, an orbit of one or two revolutions, or neither."""
    if not trajectory.finished:
        return trajectory.stopped.rstrip(".")[0].lower() + trajectory.stopped.rstrip(".")[1:]
    if trajectory.revolutions < 5:
        return f"is still in the gap after {trajectory.revolutions:.0f} revolutions"
    for count, words in ((1, "one revolution"), (2, "two revolutions")):
        if trajectory.recurrence(count) <= REPEATS:
            return f"the motion settles on an orbit that repeats after {words}"
    return "the motion stays in the gap and does not repeat"


def figure_8_reading(study: StudyResult, stability: Sequence[Floquet]) -> str:
    """Folds, stability, and what integration finds beyond the last orbit that the paper shows."""
    branch, beyond = study.branch, study.beyond
    folds = (f"The branch folds at {listed(percent(f.value, 4) for f in branch.folds)} static eccentricity"
             if branch.folds else "The branch has no fold")
    there = [f"{f.verdict} (largest multiplier {f'{f.largest:.2f}' if f.largest < 100 else 'above 100'})"
             for _, f in study.beyond_orbits]
    states = f"it has {len(there)} steady state{'s' * (len(there) > 1)}, {listed(there)}" if there else (
        "it has no steady state" if study.eccentricity(BEYOND) < branch.static_eccentricity.max() or branch.folds else
        "nothing is known of it, for it was followed no further")
    return (f"{folds}; {stability_sentence(branch, stability)}. At {quoted(study, BEYOND)} {states}; started there on "
            f"the {quoted(study, 8.9)} orbit, {outcome(beyond)}.")
