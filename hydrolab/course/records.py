"""Vibration records of the unit with one fault, as a monitoring system would store them: what
chapter 12 reads.

The motion is a steady state by harmonic balance, sampled in step with the revolution, with noise.
Each machine is recorded twice, with the field and without. Which fault a numbered machine has
follows from its number by a hash, so that it stands nowhere in the record.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.harmonics import ellipse, fit, fourier_rows
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput
from hydrolab.machine.cards import load_machine, vary
from hydrolab.machine.parts import Machine
from hydrolab.machine.pull import ShapedPull

ECCENTRICITY, UNBALANCE, OVALITY, SOFT = FAULTS = ("static eccentricity", "unbalance",
                                                   "gap ovality", "soft bearing")
# fraction of the gap, factor, fraction of the gap, factor
SIZES: Mapping[str, tuple[float, float]] = {
    ECCENTRICITY: (0.055, 0.083), UNBALANCE: (1.8, 3.0), OVALITY: (0.05, 0.11), SOFT: (0.5, 0.75)}
PLACES = ("generator", "guide bearing", "turbine bearing")
# which number of a `Condition` it changes
FIELDS = {ECCENTRICITY: "static_eccentricity", UNBALANCE: "unbalance", OVALITY: "ovality",
          SOFT: "bearing"}
REVOLUTIONS, SAMPLES = 32, 128  # of a record, and in a revolution
NOISE = 3e-6  # m rms, of each probe
HARMONICS = 6
ANGLES = 96  # at which an oval gap is sampled
GUIDE_STIFFNESS = "bearings.generator guide bearing.stiffness"


@dataclass(frozen=True)
class Condition:
    """What a machine is like: its fault and the imperfections that every machine has.

    static_eccentricity: fraction of the gap, with the gap angle `direction` (rad) of the stator's
    offset. unbalance: factor on the card's. ovality: the gap is g0 (1 − ovality cos 2(φ − axis)).
    bearing: factor on the stiffness of the guide bearing.
    """

    static_eccentricity: float = 0.01
    direction: float = math.pi / 2
    unbalance: float = 1.0
    ovality: float = 0.0
    axis: float = 0.0
    bearing: float = 1.0


@dataclass(frozen=True, eq=False)
class Record:
    """Displacements (x, z) of the shaft, m, sampled in step with the revolution.

    times: s, shape (N,). positions: by place (`PLACES`), each of shape (2, N). speed: rad/s.
    """

    times: NDArray
    positions: Mapping[str, NDArray]
    speed: float

    def coefficients(self, place: str = "generator", harmonics: int = 4) -> NDArray:
        """[mean, sin 1, cos 1, …] of x and z at a place, m, by least squares, shape (2, 2m + 1).

        Raises BadInput for a place that has no probes.
        """
        if place not in self.positions:
            raise BadInput(f"place is {place!r}; there are probes at {', '.join(self.positions)}.")
        return fit(self.positions[place], self.speed * self.times, harmonics)


@dataclass(frozen=True, eq=False)
class Recording:
    """A machine recorded with the field and without, at the same speed."""

    name: str
    with_field: Record
    without_field: Record


@dataclass(frozen=True)
class Evidence:
    """What two records say in numbers; lengths in m, 0-to-peak, at the generator.

    pulled: how far the field draws the mean position. first, first_off: long half axis of 1X with
    and without field. roundness: ratio of the axes of 1X with field. second: 2X, long half axis.
    bearing_share: 1X at the guide bearing over 1X at the generator, without field.
    """

    pulled: float
    first: float
    first_off: float
    roundness: float
    second: float
    bearing_share: float

    def __str__(self) -> str:
        return (f"field draws the mean by {1e6 * self.pulled:.0f} µm; 1X {1e6 * self.first:.0f} µm "
                f"with field, {1e6 * self.first_off:.0f} µm without; roundness "
                f"{self.roundness:.2f}; 2X {1e6 * self.second:.1f} µm; guide bearing moves "
                f"{100 * self.bearing_share:.0f} % as much as the generator")


@cache
def unit() -> Machine:
    """The course's machine."""
    return load_machine("kaplan-150rpm")


def steady_state(condition: Condition, *, field: bool = True) -> PeriodicOrbit:
    """The steady state of the unit in a condition, with its field or without."""
    model = vary(unit(), {GUIDE_STIFFNESS: condition.bearing
                          * unit().bearings[0].stiffness}).model()
    if condition.ovality:
        angle = 2 * np.pi * np.arange(ANGLES) / ANGLES
        shape = model.gap * (1 - condition.ovality * np.cos(2 * (angle - condition.axis)))
        model = replace(model, law=ShapedPull(model.law.stiffness, model.gap, shape))
    model = model.with_unbalance(condition.unbalance).with_field(float(field))
    return HarmonicBalance(HARMONICS).solve(model, unit().speed, condition.static_eccentricity,
                                            direction=condition.direction)


def record(condition: Condition, *, field: bool = True, seed: int = 0) -> Record:
    """A record of the unit in a condition, with its field or without; the seed fixes the noise."""
    orbit = steady_state(condition, field=field)
    phase = 2 * np.pi * np.arange(REVOLUTIONS * SAMPLES) / SAMPLES
    rows, noise = fourier_rows(HARMONICS, phase), np.random.default_rng([seed, field])
    guide, turbine = (orbit.node_coefficients(bearing.node) for bearing in unit().bearings)
    positions = {place: c @ rows + noise.normal(0.0, NOISE, (2, len(phase)))
                 for place, c in zip(PLACES, (orbit.coefficients, guide, turbine), strict=True)}
    return Record(phase / orbit.speed, positions, orbit.speed)


def recording(condition: Condition, name: str = "", seed: int = 0) -> Recording:
    """A machine in a condition, with its name, recorded with field and without; seed: of noise."""
    return Recording(name, record(condition, seed=seed), record(condition, field=False, seed=seed))


def healthy() -> Recording:
    """The unit when it was put into service: 1 % static eccentricity and the card's unbalance."""
    return recording(Condition(), "in service")


def condition_of(number: int) -> tuple[str, Condition]:
    """The fault of a numbered machine and its condition, both from a hash of the number."""
    digest = hashlib.sha256(f"hydrolab unit {number}".encode()).digest()
    fault = FAULTS[digest[0] % 4]
    u = np.frombuffer(digest[1:9], dtype=np.uint8) / 255
    low, high = SIZES[fault]
    size = low + u[0] * (high - low)
    condition = Condition(0.005 + 0.01 * u[1], 2 * math.pi * u[2], 0.9 + 0.2 * u[3])
    return fault, replace(condition, **{FIELDS[fault]: size},
                          axis=math.pi * u[4] if fault == OVALITY else 0.0)


def unknown_machine(number: int) -> Recording:
    """The records of a machine with one of the four faults; the number is any whole number."""
    if isinstance(number, bool) or number != int(number):
        raise BadInput(f"number is {number!r}; the machines have whole numbers.")
    number = int(number)
    return recording(condition_of(number)[1], f"machine {number}", seed=abs(number))


def record_text(name: str) -> str:
    """The CSV of a record of the unit that nobody knows, chapter 14: "with-field", "without-field"
    or "slow-roll".
    """
    return (files("hydrolab.course") / "unknown-unit" / f"{name}.csv").read_text(encoding="utf-8")


def evidence(case: Recording) -> Evidence:
    """The numbers by which chapter 12 tells the faults apart."""
    on, off = case.with_field.coefficients(), case.without_field.coefficients()
    first_off = ellipse(off).major
    return Evidence(float(np.hypot(*(on - off)[:, 0])), ellipse(on).major, first_off,
                    ellipse(on).ratio, ellipse(on, 2).major,
                    ellipse(case.without_field.coefficients("guide bearing")).major / first_off)


def diagnose(found: Evidence, reference: Evidence) -> str:
    """The fault to which the evidence found points, against the machine's reference in service."""
    if found.bearing_share > 1.1 * reference.bearing_share:
        return SOFT
    if found.first_off > 1.4 * reference.first_off:
        return UNBALANCE
    if found.pulled > 3 * reference.pulled:
        return ECCENTRICITY
    return OVALITY if found.roundness < 0.9 else "none"


TELLS: Mapping[frozenset[str], str] = {  # what tells two faults apart
    frozenset((ECCENTRICITY, UNBALANCE)): "Without field an eccentric stator does nothing, and an "
                                          "unbalance stays.",
    frozenset((ECCENTRICITY, OVALITY)): "An eccentric stator draws the mean position to one side; "
                                        "an oval gap pulls to both sides alike. Look at the mean.",
    frozenset((ECCENTRICITY, SOFT)): "A soft bearing lets the guide bearing move more for the same "
                                     "motion of the generator, "
                                     "with field or without. Look at its share.",
    frozenset((UNBALANCE, OVALITY)): "An unbalance leaves the orbit round and is there without "
                                     "field. Look at the axes of "
                                     "1X, and at the record without field.",
    frozenset((UNBALANCE, SOFT)): "Both make 1X larger and leave it round. An unbalance scales "
                                  "every place alike; a soft "
                                  "bearing raises the share of the guide bearing.",
    frozenset((OVALITY, SOFT)): "An oval gap flattens the orbit and does nothing without field. "
                                "Look at the share of the guide bearing without field.",
}
SAID: Mapping[str, str] = {
    ECCENTRICITY: "a static eccentricity of {:.1%} of the gap", UNBALANCE: "{:.2f} times the "
    "unbalance",
    OVALITY: "an oval gap, ± {:.1%}", SOFT: "a guide bearing at {:.0%} of its stiffness"}


def size_said(number: int) -> str:
    """The fault of a numbered machine with its size, in words."""
    fault, condition = condition_of(number)
    return SAID[fault].format(getattr(condition, FIELDS[fault])).replace("%", " %")


def grade(number: int, fault: str) -> str:
    """What to say to whoever names the fault of the machine of a number: right, or what would have
    told the two apart.

    Raises BadInput for a fault that is none of the four.
    """
    if fault not in FAULTS:
        raise BadInput(f"fault is {fault!r}; it must be one of {', '.join(FAULTS)}.")
    true = condition_of(int(number))[0]
    if fault == true:
        return f"right. Machine {number} has {size_said(number)}."
    tells = TELLS[frozenset((fault, true))]
    return f"not {fault}. {tells} Machine {number} has {size_said(number)}."
