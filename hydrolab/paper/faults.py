"""Which fault explains a spectrum? What each does to the mean, 1X, 2X, 3X and the orbit, with the
field and the speed.

An engineer switches the excitation off and looks again: what goes away was the pull's. Every line
here is a steady state of the whole machine with one thing wrong, solved by harmonic balance, and
its stability.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.harmonics import Ellipse, ellipse
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.stability import floquet
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.bearings import JournalFilm, PadBearing
from hydrolab.machine.crack import Crack
from hydrolab.machine.parts import Machine

STEPS = 24  # from a preload to the clearance, where a solver does not find the orbit at once


@dataclass(frozen=True)
class Fault:
    """A machine with one thing wrong, and the static eccentricity of its stator (fraction of the
    gap).
    """

    name: str
    machine: Machine
    static_eccentricity: float


@dataclass(frozen=True, eq=False)
class FaultRow:
    """The steady state of a faulty machine at a field (times its own) and a speed (rad/s).

    orbit: None where none was found; said then says why. verdict: "stable", "unstable" or
    "unknown"; "" without an orbit.
    """

    fault: str
    field: float
    speed: float
    orbit: PeriodicOrbit | None
    verdict: str
    said: str = ""

    @property
    def mean(self) -> float:
        """Distance of the mean position from the axis, m."""
        return float(np.hypot(*self.orbit.mean)) if self.orbit else math.nan

    def size(self, harmonic: int) -> float:
        """Major half axis of a harmonic's ellipse, m 0-to-peak."""
        return ellipse(self.orbit.coefficients, harmonic).major if self.orbit else math.nan

    @property
    def shape(self) -> Ellipse | None:
        """The ellipse of 1X."""
        return ellipse(self.orbit.coefficients) if self.orbit else None

    def __str__(self) -> str:
        start = f"{self.fault:<18} {self.field:5.3g} {self.speed * 30 / math.pi:6.4g}"
        if self.orbit is None:
            return f"{start}  {self.said}"
        sizes = " ".join(f"{1e6 * v:7.1f}" for v in (self.mean, self.size(1), self.size(2),
                                                     self.size(3)))
        turns = "forward" if self.shape.forward else "backward"
        return f"{start} {sizes}  {self.shape.ratio:4.2f} {turns:<8}  {self.verdict}"


@dataclass(frozen=True, eq=False)
class FaultTable:
    """Steady states of a machine with each fault, field and speed; prints as a table in µm,
    0-to-peak.
    """

    machine: Machine
    rows: tuple[FaultRow, ...]

    def row(self, fault: str, field: float = 1.0, speed: float | None = None) -> FaultRow:
        """The row of a fault at a field and a speed (rad/s; the machine's own by default).

        Raises BadInput if it is not in the table.
        """
        speed = self.machine.speed if speed is None else speed
        for row in self.rows:
            if row.fault == fault and row.field == field and math.isclose(row.speed, speed):
                return row
        raise BadInput(f"no row has fault {fault!r}, field {field:g} and speed {speed:g} rad/s; "
                       "faults are "
                       f"{', '.join(self.faults)}.")

    @property
    def faults(self) -> tuple[str, ...]:
        """The faults, in order."""
        return tuple(dict.fromkeys(row.fault for row in self.rows))

    def __str__(self) -> str:
        head = (f"{self.machine.name}: major half axes of the generator centre's motion, µm "
                "0-to-peak; 1X shape is minor "
                f"over major\n{'fault':<18} {'field':>5} {'rpm':>6} {'mean':>7} {'1X':>7} "
                f"{'2X':>7} {'3X':>7}  1X shape")
        return "\n".join([head, *map(str, self.rows)])


def typical_faults(machine: Machine, static_eccentricity: float = 0.02) -> list[Fault]:
    """The machine as it is, and with five things wrong, each of a size that is met in practice; own
    choice of numbers.

    The first radial bearing is replaced by pads or a film, or keeps its place above a crack in the
    element below it. Offset: 7 %; clearance: 100 µm, eight pads, each as stiff as the linear
    bearing; film: 30 mPa s, clearance 0.4 per mille of the journal's radius (1.1 times the
    shaft's), length 0.6 of it; crack: 20 % of the diameter. Raises BadInput for a machine without a
    shaft, an air gap or a radial bearing with an element below it.
    """
    shaft = machine.shaft
    if shaft is None or machine.air_gap is None or not machine.bearings:
        raise BadInput(f"{machine.name} lacks a shaft, an air gap or a radial bearing, so it has "
                       "no typical faults.")
    guide, others = machine.bearings[0], machine.bearings[1:]
    if guide.node >= machine.nodes - 1:
        raise BadInput(f"bearings.{guide.name}.node is {guide.node}, the last one; a crack needs "
                       "an element below it.")
    radius = 0.55 * float(shaft.diameter[guide.node])
    pads = PadBearing("pads", guide.node, 8, float(guide.stiffness[0, 0]), 1e-4)
    film = JournalFilm("film", guide.node, 0.03, radius, 0.6 * radius, 4e-4 * radius)
    crack = Crack("crack", guide.node, 0.2)
    return [Fault("none", machine, static_eccentricity),
            Fault("stator offset", machine, 0.07),
            Fault("pad clearance", replace(machine, bearings=others, pad_bearings=(pads,)),
                  static_eccentricity),
            Fault("oil film", replace(machine, bearings=others, films=(film,)),
                  static_eccentricity),
            Fault("breathing crack", replace(machine, cracks=(crack,)), static_eccentricity),
            Fault("slot", replace(machine, cracks=(replace(crack, breathing="open"),)),
                  static_eccentricity)]


def fault_table(machine: Machine, faults: Iterable[Fault] | None = None, *,
                fields: Iterable[float] = (1.0, 0.0),
                speeds: Iterable[float] | None = None, harmonics: int = 24) -> FaultTable:
    """Solve for the steady state of every fault at every field (times the machine's own) and speed
    (rad/s).

    By default the typical faults, with the field on and off, at the rated speed and four fifths of
    it.
    """
    speeds = (machine.speed, 0.8 * machine.speed) if speeds is None else tuple(speeds)
    method = HarmonicBalance(harmonics)
    rows = [_row(fault, float(field), float(speed), method)
            for fault in (typical_faults(machine) if faults is None else faults)
            for speed in speeds for field in fields]
    return FaultTable(machine, tuple(rows))


def _row(fault: Fault, field: float, speed: float, method: HarmonicBalance) -> FaultRow:
    try:
        orbit = _steady_state(fault, field, speed, method)
    except (NoConvergence, Contact) as failure:
        return FaultRow(fault.name, field, speed, None, "", f"no steady state found: {failure}")
    return FaultRow(fault.name, field, speed, orbit, floquet(orbit).verdict)


def _steady_state(fault: Fault, field: float, speed: float,
                  method: HarmonicBalance) -> PeriodicOrbit:
    """The steady state, for pads reached from a preload that is opened step by step."""
    orbit = None
    for closed in np.linspace(3, 0, STEPS) if fault.machine.pad_bearings else (0.0,):
        pads = tuple(replace(p, clearance=p.clearance - closed * abs(p.clearance),
                             rounding=p.law().rounding)
                     for p in fault.machine.pad_bearings)
        model = replace(fault.machine, pad_bearings=pads).model().with_field(field)
        orbit = method.solve(model, speed, fault.static_eccentricity, start=orbit)
    return orbit
