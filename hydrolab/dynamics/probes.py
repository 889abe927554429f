"""Records of a shaft's vibration: what probes and a keyphasor stored, as orders of the rotation,
each with its uncertainty.

A probe at the gap angle φ, from z towards x, reads u = x sin φ + z cos φ. Its samples are fitted by
least squares with a mean and the orders ½, 1, 1½, … in the phase Ωt, which is counted from the
keyphasor's pulse. What is left over is taken for noise that differs from sample to sample: with
rows R, N samples and p coefficients the covariance is s² (R Rᵀ)⁻¹, s² = |left over|²/(N − p)
(C. F. Gauss 1823). Slower changes, such as a swaying load, are more uncertain than that.

Throughout place: where a probe looks, the name of a body or a bearing. record: a `ProbeRecord`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.harmonics import ellipse, fourier_rows, synthesise
from hydrolab.dynamics.results import PeriodicOrbit, require
from hydrolab.errors import BadInput
from hydrolab.machine.gap_shape import csv_rows, csv_value
from hydrolab.machine.quantities import UNITS, micro, number, shown, turning

HIGHEST = 4  # order that is fitted
SHORTEST = 3  # revolutions from which half orders stand apart from the mean
FAR = 0.1  # m
STEADY = 0.02  # of a revolution: how far pulses may lie from a speed that changes evenly
SQUARE = 0.2  # sine of the angle between two probes below which they look the same way
CLOCK = {"time": {"s": 1.0, "ms": 1e-3, "µs": 1e-6},
         "phase": {"deg": math.pi / 180, "°": math.pi / 180, "rad": 1.0, "rev": 2 * math.pi},
         "speed": {unit: a / b for unit, (a, b) in UNITS["rad/s"].items()}}
LENGTHS = {unit: a / b for unit, (a, b) in UNITS["m"].items()} | {"um": 1e-6}
HEADER = re.compile(r"(.*?)\s*(?:[\[(]([^\])]*)[\])])?$")
PROBE = re.compile(r"(.+?)[ _,]+(?:([+-]?\d+(?:\.\d+)?)\s*(?:°|deg)|([xz]))$")


@dataclass(frozen=True, eq=False)
class Probe:
    """A proximity probe: where it looks, from which gap angle, rad, and its samples, m, (N,)."""

    place: str
    angle: float
    samples: NDArray

    @property
    def name(self) -> str:
        """Place and angle, "generator 45°"."""
        return f"{self.place} {math.degrees(self.angle):.4g}°"

    @property
    def row(self) -> NDArray:
        """(sin φ, cos φ), which makes its reading of (x, z)."""
        return np.array([math.sin(self.angle), math.cos(self.angle)])


@dataclass(frozen=True, eq=False, repr=False)
class ProbeRecord:
    """A steady stretch of vibration as probes saw it.

    name: of the file. phase: Ωt of the samples, rad, (N,), 0 at a pulse of the keyphasor. speed:
    mean, rad/s. probes: at least two a place. field: of the machine at the time, as a share of the
    card's. run_out: standard error, m, of what was subtracted as run-out, (probes, columns of
    `fitted`), or 0.
    """

    name: str
    phase: NDArray
    speed: float
    probes: tuple[Probe, ...]
    field: float = 1.0
    run_out: NDArray | float = 0.0

    @cached_property
    def fitted(self) -> tuple[NDArray, NDArray]:
        """[mean, sin ½, cos ½, sin 1, cos 1, …] of each probe and the standard errors, m, both
        (probes, 4m + 1).
        """
        rows = fourier_rows(2 * HIGHEST, self.phase / 2)
        samples = np.array([probe.samples for probe in self.probes])
        found = np.linalg.lstsq(rows.T, samples.T, rcond=None)[0].T
        left = samples - found @ rows
        variance = (left**2).sum(axis=1) / (len(self.phase) - len(rows))
        spread = np.diag(np.linalg.inv(rows @ rows.T))
        return found, np.sqrt(variance[:, None] * spread + self.run_out**2)

    @property
    def revolutions(self) -> float:
        """Length in revolutions."""
        return float(np.ptp(self.phase) / (2 * math.pi))

    @property
    def places(self) -> list[str]:
        """Where there are probes."""
        return list(dict.fromkeys(probe.place for probe in self.probes))

    def _to_xz(self, place: str) -> tuple[list[int], NDArray]:
        """Rows of the probes at a place, and what makes (x, z) of their readings, (2, probes)."""
        rows = [i for i, probe in enumerate(self.probes) if probe.place == place]
        if not rows:
            raise BadInput(f"place is {shown(place)}; {self.name} has probes at "
                           f"{', '.join(self.places)}.")
        return rows, np.linalg.pinv(np.array([self.probes[i].row for i in rows]))

    def positions(self, place: str) -> NDArray:
        """The samples of (x, z) at a place, m, (2, N)."""
        rows, to_xz = self._to_xz(place)
        return to_xz @ np.array([self.probes[i].samples for i in rows])

    def half_orders(self, place: str) -> tuple[NDArray, NDArray]:
        """[mean, sin ½, cos ½, …] of x and z and the standard errors, m, both (2, 4m + 1)."""
        rows, to_xz = self._to_xz(place)
        found, errors = self.fitted
        return to_xz @ found[rows], np.sqrt(to_xz**2 @ errors[rows] ** 2)

    def coefficients(self, place: str) -> tuple[NDArray, NDArray]:
        """[mean, sin 1, cos 1, …] of x and z, as of a steady state, and the standard errors, m,
        both (2, 2m + 1).
        """
        found, errors = self.half_orders(place)
        return found[:, whole_orders()], errors[:, whole_orders()]

    def order(self, place: str, order: float) -> tuple[float, float]:
        """Long half axis of an order's ellipse (½, 1, 1½ …) and its standard error, m.

        Raises BadInput for an order that is not fitted.
        """
        k = 2 * number("order", order)
        if k != int(k) or not 1 <= k <= 2 * HIGHEST:
            raise BadInput(f"order is {order:g}; {', '.join(f'{i / 2:g}' for i in range(1, 9))} "
                           "are fitted.")
        found, errors = self.half_orders(place)
        return float(ellipse(found, int(k)).major), float(errors[:, 2 * int(k)].max())

    def orbit(self, place: str, phase: ArrayLike) -> NDArray:
        """(x, z) of the fitted whole orders at phases Ωt (rad, (n,)), m, (2, n)."""
        return synthesise(self.coefficients(place)[0], phase)

    def spectrum(self, place: str) -> tuple[NDArray, NDArray]:
        """Orders, (n,), and amplitudes of x and z, m 0-to-peak, (2, n), over whole revolutions."""
        turns = math.floor(self.revolutions)
        each = len(self.phase) // turns
        even = self.phase[0] + 2 * math.pi * np.arange(turns * each) / each
        path = np.array([np.interp(even, self.phase, u) for u in self.positions(place)])
        lines = 2 * np.abs(np.fft.rfft(path - path.mean(axis=1)[:, None])) / path.shape[1]
        return np.arange(lines.shape[1]) / turns, lines

    def without(self, slow: ProbeRecord) -> ProbeRecord:
        """The record without the run-out that a slow roll shows, a record of the same probes: all
        its orders, and not its mean.
        """
        require("run_out", slow, ProbeRecord)
        if [p.name for p in slow.probes] != [p.name for p in self.probes]:
            raise BadInput(f"run_out is of {', '.join(p.name for p in slow.probes)}; {self.name} "
                           f"has {', '.join(p.name for p in self.probes)}.")
        found, errors = slow.fitted
        shape = (found * (np.arange(found.shape[1]) > 0)) @ fourier_rows(
            2 * HIGHEST, self.phase / 2)
        probes = tuple(replace(probe, samples=probe.samples - u)
                       for probe, u in zip(self.probes, shape, strict=True))
        away = errors * (np.arange(errors.shape[1]) > 0)
        return replace(self, probes=probes, run_out=np.hypot(self.run_out, away))

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.revolutions:.4g} revolutions at "
                 f"{self.speed * 30 / math.pi:.4g} rpm, field {100 * self.field:.4g} %; µm, "
                 "0-to-peak, ± one standard error"]
        for place in self.places:
            said = [f"{k:g}X {1e6 * a:.2f} ± {1e6 * e:.2f}"
                    for k in (0.5, 1, 2) for a, e in [self.order(place, k)]]
            mean = 1e6 * self.coefficients(place)[0][:, 0]
            lines.append(f"  {place}: {', '.join(said)}; mean x {mean[0]:.1f}, z {mean[1]:.1f}")
        return "\n".join(lines)

    __repr__ = __str__


def whole_orders(*orders: int) -> list[int]:
    """Columns of `ProbeRecord.fitted` of the mean (order 0) and of whole orders, by default all."""
    return [c for k in orders or range(HIGHEST + 1) for c in ([4 * k - 1, 4 * k] if k else [0])]


def motion_at(orbit: PeriodicOrbit, place: str) -> NDArray:
    """[mean, sin 1, cos 1, …] of x and z, m, (2, 2m + 1), that probes at a place would see: at the
    centre of a body, at the node of a bearing.
    """
    bodies = orbit.model.origin.machine.bodies if orbit.model.origin else ()
    for body in bodies:
        if body.name == place:
            return orbit.body_coefficients(body)
    return orbit.node_coefficients(place)


def made_up_record(orbit: PeriodicOrbit, places: Sequence[str], *, noise: float, seed: int,
                   angles: Sequence[float] = (math.pi / 4, -math.pi / 4), revolutions: int = 32,
                   samples: int = 64, field: float = 1.0, name: str = "") -> ProbeRecord:
    """What probes at places would store of a steady state: a record that is computed, not measured.

    noise: m rms, of each sample, drawn from a seed. angles: of the probes at each place, rad.
    revolutions: long. samples: in a revolution. field: to be noted, as a share of the card's. name:
    of the record.
    """
    phase = 2 * math.pi * np.arange(revolutions * samples) / samples
    random = np.random.default_rng(seed)
    probes = []
    for place in places:
        path = synthesise(motion_at(orbit, place), phase / orbit.revolutions)
        for angle in angles:
            probe = Probe(place, angle, np.zeros(()))
            u = probe.row @ path + random.normal(0.0, noise, len(phase))
            probes.append(replace(probe, samples=u))
    return ProbeRecord(name or "a made-up record", phase, orbit.speed, tuple(probes), field)


def read_record(source: str | Path, *, speed: float | None = None, field: float = 1.0,
                probes: Mapping[str, tuple[str, float]] | None = None,
                sensitivity: float | None = None, mark: float = 0.0,
                run_out: ProbeRecord | Mapping[str, tuple[float, float]] | None = None,
                ) -> ProbeRecord:
    """Read a steady stretch of vibration from a CSV whose first line names columns and units.

    `time [s], key [V], generator 45° [µm], generator -45° [µm], guide bearing 45° [mil], …`: a
    clock, and probes by place and gap angle, from z towards x (x stands for 90°, z for 0°), two or
    more a place. The clock is `phase [deg]`, or `time [s]` with one pulse a revolution in `key`,
    with a column `speed [rpm]`, or with `speed` given, and then phase 0 is at time 0. Columns are
    apart by commas, or by semicolons, and then a comma may mark the decimals.

    source: the path of a file, or its text. speed: rad/s. field: of the machine at the time, as a
    share of its card's (0 is off). probes: place and gap angle, rad, of columns that have other
    names. sensitivity: V/m of probes in V, whose voltage rises as the shaft comes nearer. mark:
    phase of the rotor, rad, at the pulse. run_out: a slow roll, or amplitude, m, and lag, rad, of
    the 1X of probes by name, a cos(Ωt − lag), to be subtracted. Raises BadInput with one sentence.
    """
    is_text = isinstance(source, str) and "\n" in source
    name = "the record" if is_text else Path(source).name
    rows = csv_rows(source if is_text else Path(source))
    header = [micro(cell.strip()).replace("−", "-") for cell in rows[0][1]] if rows else []
    columns = [(match[1], (match[2] or "").strip())
               for cell in header if (match := HEADER.match(cell))]
    values = _values(name, header, rows)
    clock = {kind: values[i] * (1.0 if kind == "key" else _unit(name, header[i], unit, CLOCK[kind]))
             for i, (kind, unit) in enumerate(columns) if kind in (*CLOCK, "key")}
    phase, mean = _phases(name, clock, speed)
    if sensitivity is not None:
        number("sensitivity", sensitivity, above=0, unit="V/m")
    lengths = LENGTHS | ({"V": 1 / sensitivity} if sensitivity else {})
    seen = tuple(Probe(*_looks(name, header[i], word, probes or {}),
                       values[i] * _unit(name, header[i], unit, lengths))
                 for i, (word, unit) in enumerate(columns) if word not in (*CLOCK, "key"))
    inside = np.isfinite(phase)
    record = ProbeRecord(name, phase[inside] + number("mark", mark), mean,
                         tuple(replace(p, samples=p.samples[inside]) for p in seen),
                         number("field", field, least=0))
    _check(record)
    if isinstance(run_out, Mapping):
        run_out = _vectors(record, run_out)
    return record.without(run_out) if run_out is not None else record


def _values(name: str, header: list[str], rows: list[tuple[int, list[str]]]) -> NDArray:
    """The numbers of all columns, (columns, N)."""
    if len(rows) < 2:
        raise BadInput(f"{name} has no rows under its first line; it must name columns such as "
                       "time [s],key [V],generator 45° [µm],generator -45° [µm] and hold a row for "
                       "each sample.")
    return np.array([[csv_value(name, line, column, row, at) for at, column in enumerate(header)]
                     for line, row in rows[1:]]).T


def _unit(name: str, column: str, unit: str, known: Mapping[str, float]) -> float:
    """What a column of a unit is multiplied by."""
    if unit not in known:
        hint = " (give read_record its sensitivity, V/m)" if unit == "V" else ""
        raise BadInput(f"{name}: the column {shown(column)} has the unit {unit or 'of nothing'!r}; "
                       f"it must be one of {', '.join(known)}, in brackets{hint}.")
    return known[unit]


def _looks(name: str, column: str, word: str,
           given: Mapping[str, tuple[str, float]]) -> tuple[str, float]:
    """Place and gap angle of a probe, from what is given or from the word over its column."""
    if word in given:
        place, angle = given[word]
        return place, number(f"probes[{word!r}]", angle, unit="rad")
    match = PROBE.match(word)
    if not match:
        raise BadInput(f"{name}: the column {shown(column)} is no clock (time, key, phase, speed) "
                       "and names no place and angle; call it \"generator 45° [µm]\", or give "
                       f"probes={{{word!r}: (\"generator\", math.pi / 4)}}.")
    angle = float(match[2]) if match[2] else {"x": 90.0, "z": 0.0}[match[3]]
    return match[1], math.radians(angle)


def _phases(name: str, clock: Mapping[str, NDArray],
            speed: float | None) -> tuple[NDArray, float]:
    """Ωt of the samples, rad, nan outside of the first and the last pulse, and the mean speed."""
    if "phase" in clock and "time" not in clock:
        phase = np.unwrap(clock["phase"])
        return _rising(name, "phase", phase), turning(speed if speed is not None else
                                                      clock.get("speed", np.zeros(1)).mean())
    if "time" not in clock:
        raise BadInput(f"{name} has no clock; it needs a column time [s], with key, speed [rpm] or "
                       "read_record(…, speed=rpm(150)), or phase [deg] with a speed.")
    time = _rising(name, "time", clock["time"])
    if "phase" in clock:
        phase = _rising(name, "phase", np.unwrap(clock["phase"]))
    elif "key" in clock:
        phase = _from_pulses(name, time, clock["key"])
    elif "speed" in clock and speed is None:
        steps = np.diff(time) * (clock["speed"][1:] + clock["speed"][:-1]) / 2
        phase = np.append(0.0, np.cumsum(steps))
    elif speed is not None:
        return turning(speed) * time, turning(speed)
    else:
        raise BadInput(f"{name} has a time and no speed; add a column key or speed [rpm], or give "
                       "read_record(…, speed=rpm(150)).")
    inside = np.isfinite(phase)
    return phase, turning(float(np.ptp(phase[inside]) / np.ptp(time[inside])))


def _rising(name: str, kind: str, values: NDArray) -> NDArray:
    """A clock that goes on."""
    if (np.diff(values) <= 0).any():
        row = int(np.argmax(np.diff(values) <= 0)) + 2
        raise BadInput(f"{name}: {kind} does not rise from row {row - 1} to row {row} of its "
                       "numbers; a record goes on in time, one row a sample.")
    return values


def _from_pulses(name: str, time: NDArray, key: NDArray) -> NDArray:
    """Ωt from one pulse a revolution, a parabola through the times at which it rises half way, so
    that the sampling of a pulse does not shake the phase; nan before the first and after the last.
    """
    level = (key.min() + key.max()) / 2
    at = np.flatnonzero((key[:-1] < level) & (key[1:] >= level))
    if len(at) < SHORTEST:
        raise BadInput(f"{name}: key rises {len(at)} times; a record needs at least {SHORTEST} "
                       "pulses, one a revolution.")
    share = (level - key[at]) / (key[at + 1] - key[at])
    pulses, turns = time[at] + share * (time[at + 1] - time[at]), np.arange(len(at))
    law = np.polynomial.Polynomial.fit(pulses, turns, 2)
    worst = float(np.abs(law(pulses) - turns).max())
    if worst > STEADY + float(np.diff(time).max() / np.diff(pulses).min()):
        raise BadInput(f"{name}: the pulses of key lie up to {worst:.2g} of a revolution from an "
                       "even change of speed; a pulse is lost or doubled, or the speed is not "
                       "steady: cut out a shorter stretch.")
    inside = (time >= pulses[0]) & (time <= pulses[-1])
    return np.where(inside, 2 * math.pi * law(time), math.nan)


def _check(record: ProbeRecord) -> None:
    """Raise BadInput for a record that orders cannot be fitted to."""
    if record.revolutions < SHORTEST:
        raise BadInput(f"{record.name} holds {record.revolutions:.3g} revolutions; orders need at "
                       f"least {SHORTEST}.")
    each = len(record.phase) / record.revolutions
    if each <= 4 * HIGHEST:
        raise BadInput(f"{record.name} has {each:.3g} samples a revolution; order {HIGHEST} needs "
                       f"more than {4 * HIGHEST}.")
    for probe in record.probes:
        if not (largest := np.abs(probe.samples).max()) < FAR:
            raise BadInput(f"{record.name}: {probe.name} reads up to {largest:.3g} m; no probe "
                           f"sees further than {FAR:g} m, so its unit is another.")
    names = [probe.name for probe in record.probes]
    for place in record.places or [""]:
        rows = [probe.row for probe in record.probes if probe.place == place]
        if len(rows) < 2 or np.linalg.svd(np.array(rows))[1][-1] < SQUARE:
            raise BadInput(f"{record.name} has the probes {', '.join(names) or 'of no place'}; "
                           "each place needs two that look from different sides.")


def _vectors(record: ProbeRecord, vectors: Mapping[str, tuple[float, float]]) -> ProbeRecord:
    """A slow roll made of amplitudes, m, and lags, rad, of 1X by the names of probes."""
    names = [probe.name for probe in record.probes]
    if unknown := set(vectors) - set(names):
        raise BadInput(f"run_out names {shown(min(unknown))}; {record.name} has the probes "
                       f"{', '.join(names)}.")
    given = [vectors.get(name, (0.0, 0.0)) for name in names]
    return replace(record, probes=tuple(
        replace(probe, samples=a * np.cos(record.phase - lag))
        for probe, (a, lag) in zip(record.probes, given, strict=True)))
