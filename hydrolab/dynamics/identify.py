"""From records to the numbers of a machine: least squares on the harmonic balance.

With the numbers p of a card, its steady states u(p) and what probes stored, û ± σ,

    χ²(p) = Σ ((u(p) − û)/σ)² + Σ ((p − p₀)/σ₀)²

is smallest at the best values; the second sum is a prior, if there is one. There the covariance is
(JᵀJ)⁻¹ with J the derivative of the terms, and χ² of a right model is about the number of terms
less that of the unknowns. What is larger than chance allows, the model cannot be right (R. A.
Fisher 1925).

A size and its angle, such as an unbalance and its phase, are found as r cos nα and r sin nα, on
which the motion depends almost linearly, so that a first guess may point anywhere. The mean of a
probe counts only by its differences between records, since nobody knows where its zero is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import gammaincc

from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.probes import ProbeRecord, motion_at, whole_orders
from hydrolab.dynamics.results import PeriodicOrbit, require
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.quantities import number, quantity, require_machine, shown

if TYPE_CHECKING:
    from hydrolab.machine.parts import Machine

LEVEL = 0.01  # a right model is rejected once in so many
NORMAL_95 = 1.959964  # standard errors that hold 95 % of a normal distribution
# With sharp readings and the field on the search is lost in a curved valley. So it begins with the
# record of the least field, on which the motion depends almost linearly, and with rough readings.
STAGES = ((0.1, 1e4), (0.1, 1.0), (0.0, 1.0))  # error of the probes at least, factor beside field
TRIES = 3  # of beginnings, where the first ends at what is rejected
STEP = 1e-5  # of a scaled unknown, for derivatives
FLAT = 1e-9  # of the largest singular value: below it a direction is not seen at all
VAGUE = 0.5  # of a value, or of the prior's error: above it a number is not told
TIED = 0.95  # correlation of two numbers that are told only together
PARTNERS = {"unbalance": "phase", "size": "angle", "static_eccentricity": "direction"}
STATOR = {"static_eccentricity": (0.01, "1"), "direction": (math.pi / 2, "rad"),
          "unbalance": (1.0, "1")}  # what has no key on a card: where the search begins, its unit


@dataclass(frozen=True)
class Unknown:
    """One number, or a size and its angle, and how they are made of scaled unknowns.

    keys: one or two. lobes: n of r cos nα and r sin nα. scale: of a number, in its unit.
    """

    keys: tuple[str, ...]
    scale: float
    lobes: int = 1

    def values(self, y: NDArray) -> dict[str, float]:
        """The numbers by key, from the scaled unknowns."""
        if len(self.keys) == 1:
            return {self.keys[0]: self.scale * float(y[0])}
        angle = math.atan2(y[1], y[0]) / self.lobes % (2 * math.pi / self.lobes)
        return dict(zip(self.keys, (self.scale * math.hypot(*y), angle), strict=True))

    def scaled(self, values: Mapping[str, float]) -> list[float]:
        """The unknowns that make these numbers."""
        size = values[self.keys[0]] / self.scale
        if len(self.keys) == 1:
            return [size]
        turn = self.lobes * values[self.keys[1]]
        return [size * math.cos(turn), size * math.sin(turn)]


@dataclass(frozen=True, eq=False, repr=False)
class Identified:
    """The numbers that records say a machine has.

    values, errors: by key in SI, the errors are standard ones. correlation: of the values in their
    order, (n, n). chi_square: of freedom, the terms less the unknowns. untold: keys that the
    records do not tell. tied: pairs that they tell only together, with their correlation. worst:
    the term furthest from the model, in words. machine: with the values. orbits: its steady states
    in the records.
    """

    values: Mapping[str, float]
    errors: Mapping[str, float]
    units: Mapping[str, str]
    correlation: NDArray
    chi_square: float
    freedom: int
    untold: tuple[str, ...]
    tied: tuple[tuple[str, str, float], ...]
    worst: str
    machine: Machine
    orbits: tuple[PeriodicOrbit, ...]
    records: tuple[ProbeRecord, ...]

    @property
    def chance(self) -> float:
        """Chance of so large a χ², or a larger, where the model is right."""
        return float(gammaincc(self.freedom / 2, self.chi_square / 2))

    @property
    def rejected(self) -> bool:
        """Whether no machine of this model made the records, at the level of 1 %."""
        return self.chance < LEVEL

    def interval(self, key: str) -> tuple[float, float]:
        """Where the number of a key lies in 95 of 100 cases, in SI."""
        away = NORMAL_95 * self.errors[key]
        return self.values[key] - away, self.values[key] + away

    def __str__(self) -> str:
        lines = [f"{len(self.values)} numbers of {self.machine.name} from {len(self.records)} "
                 f"record{'s' * (len(self.records) > 1)} (± holds 95 %):"]
        wide = max(map(len, self.values))
        for key, value in self.values.items():
            held = quantity(float(f"{value:.6g}"), self.units[key])
            lines.append(f"  {key:<{wide}}  {held} ± {NORMAL_95 * self.errors[key]:.2g}")
        fit = f"χ² is {self.chi_square:.4g} at {self.freedom} degrees of freedom"
        if self.rejected:
            lines.append(f"{fit}: rejected at {100 * LEVEL:g} %. No such machine made these "
                         f"records, so the numbers above mean nothing. Furthest off: {self.worst}.")
        else:
            lines.append(f"{fit}, a chance of {100 * self.chance:.2g} %: the model agrees with "
                         "what the probes saw.")
        if self.untold:
            lines.append(f"The records do not tell {', '.join(self.untold)}.")
        lines += [f"{one} and {other} are told only together (correlation {r:.3f})."
                  for one, other, r in self.tied]
        return "\n".join(lines)

    __repr__ = __str__


class _Fit:
    """The terms of χ² as a function of the scaled unknowns y, and the search for the least."""

    def __init__(self, machine: Machine, records: Sequence[ProbeRecord], unknowns: list[Unknown],
                 prior: Mapping[str, tuple[float, float]], orders: Sequence[int],
                 balance: HarmonicBalance) -> None:
        self.machine, self.records, self.balance = machine, records, balance
        self.unknowns, self.prior = unknowns, prior
        self.cuts = np.cumsum([len(unknown.keys) for unknown in unknowns])[:-1]
        self.orbits: Sequence[PeriodicOrbit | None] = [None] * len(records)
        self.columns = whole_orders(*orders)
        self.theirs = [c // 2 for c in self.columns]  # the same in a steady state
        self.orders = np.array([(c + 1) // 4 for c in self.columns])
        measured, self.sharp = (np.array([record.fitted[part][:, self.columns]
                                          for record in records]) for part in (0, 1))
        # each mean counts as it differs from that of all records, weighted
        self.weight = self.sharp**-2 / (self.sharp**-2).sum(axis=0)
        self.measured = self.centred(measured)
        same = self.orders[:, None] == self.orders
        self.sizes = np.sqrt(self.measured**2 @ same)
        self.lost = measured.shape[1] * int((self.orders == 0).sum())  # to those means

    def blur(self, probe_error: float, far: float = 1.0) -> None:
        """Count errors of the probes' sensitivity, a fraction of each order, with the others; far:
        a factor on all errors of a record with more field than the least.
        """
        fields = np.array([record.field for record in self.records])[:, None, None]
        self.errors = (np.hypot(self.sharp, probe_error * self.sizes)
                       * np.where(fields > fields.min(), far, 1.0))

    def centred(self, values: NDArray) -> NDArray:
        """Coefficients (records, probes, columns) with each mean counted from that of all records.
        """
        return values - (self.weight * values).sum(axis=0) * (self.orders == 0)

    def values(self, y: NDArray) -> dict[str, float]:
        """The numbers by key."""
        parts = zip(self.unknowns, np.split(y, self.cuts), strict=True)
        return {key: v for unknown, part in parts for key, v in unknown.values(part).items()}

    def machine_of(self, values: Mapping[str, float]) -> Machine:
        """The machine with these numbers of its card."""
        return self.machine.with_numbers({key: value for key, value in values.items()
                                          if key not in ("static_eccentricity", "direction")})

    def terms(self, y: NDArray) -> NDArray:
        """(u − û)/σ of all records, then of the prior; the orbits are kept as `found`."""
        now = self.values(y)
        model, seen, self.found = self.machine_of(now).model(), [], []
        for record, start in zip(self.records, self.orbits, strict=True):
            orbit = self.balance.solve(model.with_field(record.field), record.speed,
                                       now.get("static_eccentricity", 0.0), start=start,
                                       direction=now.get("direction", math.pi / 2))
            motion = {place: motion_at(orbit, place) for place in record.places}
            seen.append([(p.row @ motion[p.place])[self.theirs] for p in record.probes])
            self.found.append(orbit)
        of_prior = [away(now[key], p, key) / error for key, (p, error) in self.prior.items()
                    if key in now]
        return np.append((self.centred(np.array(seen)) - self.measured) / self.errors, of_prior)

    def slopes(self, y: NDArray) -> NDArray:
        """∂ terms/∂y by central differences, (terms, unknowns)."""
        self.terms(y)
        self.orbits = self.found  # a trial step that is not taken leaves no trace
        return np.stack([(self.terms(y + step) - self.terms(y - step)) / (2 * STEP)
                         for step in STEP * np.eye(len(y))], axis=1)

    def search(self, y: NDArray, probe_error: float) -> tuple[float, NDArray]:
        """The least χ² from y on, and where it is."""
        self.orbits = [None] * len(self.records)
        count = self.measured.size + sum(key in self.values(y) for key in self.prior)

        def tried(y: NDArray) -> NDArray:
            try:
                return self.terms(y)
            except (BadInput, NoConvergence, Contact):
                return np.full(count, math.nan)  # the search then takes a shorter step

        for share, far in STAGES:
            self.blur(max(share, probe_error), far)
            y = least_squares(tried, y, self.slopes, xtol=1e-4 if share else 1e-9, gtol=None,
                              ftol=1e-2 if share else 1e-7, x_scale="jac", max_nfev=40).x
        return float(self.terms(y) @ self.terms(y)), y

    def told(self, y: NDArray, freedom: int, units: Mapping[str, str]) -> Identified:
        """The result at the best unknowns."""
        best, slopes, left = self.values(y), self.slopes(y), self.terms(y)
        _, s, rows = np.linalg.svd(slopes, full_matrices=False)
        root = rows.T / np.maximum(s, FLAT * s[0])  # (JᵀJ)⁻¹ is this times its transpose
        near = [self.values(y + step) for step in STEP * np.eye(len(y))]
        spread = np.array([[away(other[key], best[key], key) / STEP for other in near]
                           for key in best]) @ root
        error = np.linalg.norm(spread, axis=1)
        correlation, keys = (spread @ spread.T) / np.outer(error, error), list(best)
        own = {key: math.pi / 2 if is_angle(key) else abs(best[key]) for key in keys}
        own |= {key: spread for key, (_, spread) in self.prior.items()}
        return Identified(
            best, dict(zip(keys, error.tolist(), strict=True)), {k: units[k] for k in keys},
            correlation, float(left @ left), freedom,
            tuple(key for key, e in zip(keys, error, strict=True) if e > VAGUE * own[key]),
            tuple((keys[i], keys[j], float(correlation[i, j])) for i in range(len(keys))
                  for j in range(i) if abs(correlation[i, j]) > TIED),
            self.worst(left), self.machine_of(best), tuple(self.found), tuple(self.records))

    def worst(self, left: NDArray) -> str:
        """The term furthest from the model, in words."""
        grid = left[:self.measured.size].reshape(self.measured.shape)
        at, probe, column = np.unravel_index(np.abs(grid).argmax(), grid.shape)
        record, order = self.records[at], self.orders[column]
        return (f"{f'{order}X' if order else 'the mean'} of {record.probes[probe].name} in "
                f"{record.name}, field {100 * record.field:.3g} %, "
                f"{abs(grid[at, probe, column]):.3g} standard errors")


def identify(machine: Machine, records: ProbeRecord | Sequence[ProbeRecord], free: Sequence[str], *,
             prior: Mapping[str, tuple[float, float]] | None = None,
             start: Mapping[str, float] | None = None, orders: Sequence[int] = (0, 1, 2),
             probe_error: float = 0.0, balance: HarmonicBalance | None = None) -> Identified:
    """Find the numbers of a machine with which its steady states are those in the records.

    records: of the same probes, with and without field, or at several speeds. free: keys, as `vary`
    takes them, and "static_eccentricity" (fraction of the gap) and "direction" (rad), which are 0
    and π/2 unless free. prior: value and standard error, SI, of what else is known of numbers, such
    as `hydrolab.paper.family_prior(free)`. start: values of free numbers to begin from, by default
    the machine's own. orders: of the rotation that count, 0 for the mean. probe_error: of the
    sensitivity of a probe, as a fraction; no model is better than that. balance: by default with
    four harmonics.

    Raises BadInput for what cannot be identified, NoConvergence or Contact where the machine to
    begin from has no steady state.
    """
    require_machine(machine)
    records = [records] if isinstance(records, ProbeRecord) else list(records)
    same_probes(records)
    begin, units = _begin(machine, free, start or {}, prior or {})
    unknowns, method = _unknowns(machine, free, begin, prior or {}), balance or HarmonicBalance(4)
    known = range(min(method.harmonics, 4) + 1)
    if not set(orders) <= set(known) or not set(orders) - {0}:
        raise BadInput(f"orders is {shown(orders)}; it must be some of 0 to {known[-1]}, and not 0 "
                       "alone.")
    number("probe_error", probe_error, least=0, below=1)
    fit = _Fit(machine, records, unknowns, prior or {}, sorted(set(orders)), method)
    fit.blur(probe_error)
    y0 = np.concatenate([unknown.scaled(begin) for unknown in unknowns])
    if (freedom := fit.terms(y0).size - fit.lost - len(y0)) < 1:
        raise BadInput(f"free has {len(y0)} numbers; the records hold no more terms than that.")

    best, random = (math.inf, y0), np.random.default_rng(0)
    for _ in range(TRIES):
        with suppress(BadInput, NoConvergence, Contact):  # met a fold
            best = min(best, fit.search(y0, probe_error), key=lambda found: found[0])
        if gammaincc(freedom / 2, best[0] / 2) > LEVEL:
            break
        y0 = y0 + random.normal(0, 1, y0.size) * np.abs(y0).max() / 4
    return fit.told(best[1], freedom, units)


def is_angle(key: str) -> bool:
    """Whether a key is that of an angle."""
    return key.rpartition(".")[2] in PARTNERS.values()


def away(value: float, other: float, key: str) -> float:
    """How far a value of a key is from the other, the short way round where they are angles."""
    return ((value - other + math.pi) % (2 * math.pi) - math.pi if is_angle(key)
            else value - other)


def same_probes(records: Sequence[ProbeRecord]) -> None:
    """Raise BadInput for what are no records of the same probes."""
    if not records:
        raise BadInput("records is empty; give what read_record returns.")
    for record in records:
        require("records", record, ProbeRecord)
        own, first = ([p.name for p in r.probes] for r in (record, records[0]))
        if own != first:
            raise BadInput(f"{record.name} has the probes {', '.join(own)}, and {records[0].name} "
                           f"has {', '.join(first)}; records of one machine have the same.")


def _begin(machine: Machine, free: Sequence[str], start: Mapping[str, float],
           prior: Mapping[str, tuple[float, float]]) -> tuple[dict[str, float], dict[str, str]]:
    """Where the search begins and the units, by the keys that are free."""
    if isinstance(free, str) or not free or len(set(free)) < len(free):
        raise BadInput(f"free is {shown(free)}; it must be a list of different keys, such as "
                       '["bodies.generator.unbalance", "bodies.generator.phase"].')
    given = {key: STATOR[key] if key in STATOR else machine.number(key) for key in free}
    for name, more in (("start", start), ("prior", prior)):
        if unknown := set(more) - set(given):
            raise BadInput(f"{name} names {shown(min(unknown))}, which is not among the free "
                           f"numbers, {', '.join(free)}.")
    values = {key: value for key, (value, _) in given.items()}
    values |= {key: number(f"start[{key!r}]", value) for key, value in start.items()}
    return values, {key: unit for key, (_, unit) in given.items()}


def _unknowns(machine: Machine, free: Sequence[str], begin: Mapping[str, float],
              prior: Mapping[str, tuple[float, float]]) -> list[Unknown]:
    """The unknowns of the free numbers, a size and its angle as one."""
    lobes = {f"{shape.key}.size": shape.order for shape in getattr(machine, "shapes", ())}
    partners = {}
    for key in free:
        part, _, name = key.rpartition(".")
        angle = f"{part}.{PARTNERS.get(name)}" if part else str(PARTNERS.get(name))
        if angle in free:
            partners[key] = angle
    found = []
    for key in free:
        if key in partners.values():
            continue
        known = number(f"prior[{key!r}][1]", prior[key][1], above=0) if key in prior else 1.0
        scale = abs(begin[key]) or known
        keys = (key, partners[key]) if key in partners else (key,)
        found.append(Unknown(keys, scale, lobes.get(key, 1)))
    return found
