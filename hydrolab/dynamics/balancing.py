"""Balancing: influence coefficients, by trial runs or by the model, and the masses they ask for.

An unbalance W = U e^{iψ}, kg m, at a plane (a body) changes the 1X of every probe by H W, where a
probe reads Re(v e^{iΩt}). One trial run a plane measures a column of H, (v₁ − v₀)/W₁; the masses
that leave least are −H⁺ v₀ (T. P. Goodman 1964). The model has H from its own steady states, with
field and without: the pull is a negative stiffness, so H is not the same. With Jeffcott's rotor it
is H = Ω²/(k − k_pull − mΩ² + icΩ), exact where the pull is linear.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.identify import same_probes
from hydrolab.dynamics.probes import ProbeRecord, motion_at, whole_orders
from hydrolab.errors import BadInput
from hydrolab.machine.quantities import number, require_machine

if TYPE_CHECKING:
    from hydrolab.machine.parts import Machine

TRIAL = 0.01  # of a machine's unbalance: a step for derivatives


@dataclass(frozen=True, eq=False)
class TrialRun:
    """A record of a machine with trial masses: by body the mass × radius, kg m, and the angle ψ of
    its unbalance, rad. Without any it is the first run, that of the machine as it was found.
    """

    record: ProbeRecord
    masses: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, repr=False)
class Balanced:
    """What takes the 1X away, and what the pull changes.

    planes: bodies. influence: H of all probes, complex, m/(kg m), (probes, planes), by `how`.
    with_field, without_field: the model's. before: 1X of the probes as found, complex, m. errors:
    standard ones of its parts, m.
    """

    planes: tuple[str, ...]
    how: str
    influence: NDArray
    with_field: NDArray
    without_field: NDArray
    before: NDArray
    errors: NDArray

    @property
    def masses(self) -> dict[str, tuple[float, float]]:
        """By plane the mass × radius, kg m, and the angle, rad, that leave the smallest 1X."""
        return _polar(self.planes, _least(self.influence, self.before))

    @property
    def left(self) -> NDArray:
        """1X that the masses leave at the probes, complex, m, where influences add up."""
        return self.before + self.influence @ _least(self.influence, self.before)

    @property
    def by_wrong_field(self) -> NDArray:
        """1X with field that masses by the influence without it leave, complex, m."""
        return self.before + self.influence @ _least(self.without_field, self.before)

    def __str__(self) -> str:
        said = [f"{size:.4g} kg m at {math.degrees(angle):.1f}° on {plane}"
                for plane, (size, angle) in self.masses.items()]
        was, now, wrong = (1e6 * np.abs(v).max() for v in (self.before, self.left,
                                                           self.by_wrong_field))
        ratio = np.linalg.norm(self.with_field) / np.linalg.norm(self.without_field)
        return (f"Put {' and '.join(said)} ({self.how}): the largest 1X of a probe goes from "
                f"{was:.1f} to {now:.2g} µm (0-to-peak; it is known to "
                f"{1e6 * self.errors.max():.2g} µm). With field a mass moves the probes "
                f"{ratio:.2f} times as much as without; masses by the influence without field "
                f"would leave {wrong:.2g} µm.")

    __repr__ = __str__


def _least(influence: NDArray, before: NDArray) -> NDArray:
    """W that makes before + influence W least, complex, kg m, (planes,)."""
    return -np.linalg.lstsq(influence, before, rcond=None)[0]


def _polar(planes: Sequence[str], weights: NDArray) -> dict[str, tuple[float, float]]:
    return {plane: (abs(w), cmath.phase(w) % (2 * math.pi))
            for plane, w in zip(planes, weights.tolist(), strict=True)}


def first_order(record: ProbeRecord) -> tuple[NDArray, NDArray]:
    """1X of each probe, complex, m, and the standard errors of its parts, m, of a record."""
    found, errors = (part[:, whole_orders(1)] for part in record.fitted)
    return found[:, 1] - 1j * found[:, 0], errors.max(axis=1)


def influence(machine: Machine, record: ProbeRecord, planes: Sequence[str], *, field: float = 1.0,
              static_eccentricity: float = 0.0, direction: float = math.pi / 2) -> NDArray:
    """H of a machine at the probes and the speed of a record, complex, m/(kg m), (probes, planes).

    planes: bodies. field: as a share of the machine's. static_eccentricity, direction: of the
    stator, fraction of the gap and rad. About its own steady state; a strong pull also answers the
    mirror image of a mass, which is left out.
    """
    method = HarmonicBalance(4)
    step = TRIAL * (sum(body.unbalance for body in machine.bodies) or 1.0)

    def seen(weights: Mapping[str, complex]) -> NDArray:
        numbers: dict[str, float] = {}
        for plane, w in weights.items():
            body = machine.body(plane)
            whole = cmath.rect(body.unbalance, body.phase) + w
            size, angle = cmath.polar(whole)
            numbers |= {f"{body.key}.unbalance": size, f"{body.key}.phase": angle}
        model = machine.with_numbers(numbers).model().with_field(field)
        orbit = method.solve(model, record.speed, static_eccentricity, direction=direction)
        motion = [probe.row @ motion_at(orbit, probe.place) for probe in record.probes]
        return np.array([u[2] - 1j * u[1] for u in motion])

    along, across = (np.stack([(seen({p: w}) - seen({p: -w})) / (2 * step) for p in planes], axis=1)
                     for w in (step, 1j * step))
    return (along - 1j * across) / 2


def balance(machine: Machine, trial_runs: Sequence[TrialRun] | ProbeRecord, *,
            planes: Sequence[str] = (), static_eccentricity: float = 0.0,
            direction: float = math.pi / 2) -> Balanced:
    """The masses that take the 1X away at all probes as well as can be, by influence coefficients.

    trial_runs: the first without trial masses, then one for each plane, of which one body carries
    one; with the first alone, or a record, the influence is that of the machine's model at the
    planes, by default the body in the air gap. static_eccentricity, direction: of the stator in the
    model, fraction of the gap and rad. Raises BadInput where the runs do not make a balance.
    """
    require_machine(machine)
    runs = [TrialRun(trial_runs)] if isinstance(trial_runs, ProbeRecord) else list(trial_runs)
    same_probes([run.record for run in runs])
    first, *trials = runs
    if first.masses or any(len(run.masses) != 1 for run in trials):
        raise BadInput("trial_runs must begin with the machine as it was found, without masses, "
                       "and each further one has one trial mass, such as "
                       "{\"generator\": (20.0, 0.0)}.")
    before, errors = first_order(first.record)
    columns = {}
    for run in trials:
        (plane, (size, angle)), = run.masses.items()
        machine.body(plane)
        trial = cmath.rect(number(f"the trial mass on {plane}", size, above=0, unit="kg m"), angle)
        columns[plane] = (first_order(run.record)[0] - before) / trial
    air = machine.air_gap
    planes = tuple(columns or planes or [air.body if air else machine.bodies[0].name])
    if len(planes) > len(before):
        raise BadInput(f"planes has {len(planes)} bodies; {len(before)} probes tell no more masses "
                       "than that.")
    on, off = (influence(machine, first.record, planes, field=share,
                         static_eccentricity=static_eccentricity, direction=direction)
               for share in (first.record.field or 1.0, 0.0))
    by_model = on if first.record.field else off
    return Balanced(planes, f"by {len(trials)} trial run{'s' * (len(trials) > 1)}" if trials else
                    "by the model", np.stack([*columns.values()], axis=1) if trials else by_model,
                    on, off, before, errors)
