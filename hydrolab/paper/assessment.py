"""What an engineer asks of a unit: how far it is from its critical speeds, where its steady states
end, what its bearings carry, and the limits by which that is judged, each with its source.

It holds for any machine, not only for the paper's. What cannot be computed for one is said in
`troubles`. A limit that no source at hand states as a number is named, and not put in numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.branches import Branch
from hydrolab.dynamics.following import Arclength, follow
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.harmonics import PERIOD, synthesise
from hydrolab.dynamics.modes import OVERSPEED, RUNAWAY, CriticalSpeeds, critical_speeds
from hydrolab.dynamics.probes import ProbeRecord, motion_at
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.run import Run, load_rejection, run
from hydrolab.dynamics.stability import Floquet, floquet_all
from hydrolab.dynamics.winding import pull_alone
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.bearings import Guide
from hydrolab.machine.model import Model
from hydrolab.machine.parts import Machine
from hydrolab.machine.quantities import number, require_machine

HARMONICS = 8
CONCENTRIC, ROUND = 0.05, 0.05  # of the nominal gap
IN_LINE = 0.2  # of the clearance of a guide bearing, both over its diameter
GRADE, FINE_GRADE = 6.3e-3, 2.5e-3  # m/s
FINE_FROM = 950 * math.pi / 30  # rad/s; a faster generator is balanced to the fine one
EXCITED = -0.9  # a whirl from here on has enough of a forward part for an unbalance to excite it
LOOKS = 12  # at the stability along the first leg, where each takes a second
WORST = 36.0  # s: the load rejection, in which the speed is back after 35 s
MOST_FIELD = 3.0  # times the machine's own: how far the field is followed
MANUAL = ("Bureau of Reclamation, table of tolerances for vertical hydrounits where the maker "
          "states none (Duncan 1991, in Facilities Instructions, Standards, and Techniques 2-1)")


@dataclass(frozen=True)
class Limit:
    """What an answer is judged by: the limit in words, where it stands, and how sure that is."""

    words: str
    source: str
    sure: str


SPECIFIED = Limit("the margin that the plant's specification states", "the plant's specification",
                  "not at hand; no margin is assumed here")
TOLERANCE = Limit("stator concentric within 5 % of the nominal gap", MANUAL,
                  "the table was seen as a maintenance manual quotes it")
ROUNDNESS = Limit("stator and rotor round within 5 % of the nominal gap, each", MANUAL,
                  TOLERANCE.sure)
ALIGNED = Limit("guide bearings in line within 20 % of their diametral clearance", MANUAL,
                TOLERANCE.sure)
BALANCE = Limit("G 6.3 (e Ω at most 6.3 mm/s) for water turbines and generators up to 950 rpm, "
                "G 2.5 for faster generators", "ISO 21940-11",
                "the formula is public; the grades as a third party's table quotes them")
ZONES = Limit("zones A (new) to D (harmful), by kind of unit and place of the bearing",
              "ISO 20816-5", "named only: the boundaries stand in the standard")
CLEARANCE = Limit("the journal stays within its clearance", "geometry",
                  "sure; what share may be used is the maker's to say")
LOAD = Limit("the load for which the bearing and its bracket are made", "the maker of the bearing",
             "not at hand")
TOUCH = Limit("no contact: above 0 mm", "geometry", "sure, on the steady state; not in a start")


@dataclass(frozen=True)
class Answer:
    """A question, what was found, and the limit it is judged by. kept: whether it is; None where
    the limit has no number here.
    """

    asked: str
    found: str
    limit: Limit
    kept: bool | None = None

    @property
    def verdict(self) -> str:
        """In words."""
        return {True: "kept", False: "NOT KEPT", None: "to be judged"}[self.kept]


@dataclass(eq=False)
class Assessment:
    """What was computed of a machine at its rated speed.

    speeds: "rated speed", "overspeed" and "runaway speed", rad/s; assumed: which of them nobody
    stated. criticals: with "field off" and "field on". orbits, verdicts: steady states with the
    stator centred, and out of centre by the assembly tolerance where there is a gap, by the words
    for it. direction: gap angle of that, rad. branch: along the static eccentricity; rows:
    those of it whose stability was looked at. by_field: along the field, at the tolerance.
    run: through a load rejection to the overspeed with the field left on, the stator at its
    tolerance. record: of probes on the unit; recorded: the steady state at its speed and field.
    troubles: what could not be computed, and why.
    """

    machine: Machine
    model: Model
    speeds: Mapping[str, float]
    assumed: tuple[str, ...]
    direction: float = math.pi / 2
    criticals: dict[str, CriticalSpeeds] = field(default_factory=dict)
    orbits: dict[str, PeriodicOrbit] = field(default_factory=dict)
    verdicts: dict[str, Floquet] = field(default_factory=dict)
    branch: Branch | None = None
    rows: tuple[int, ...] = ()
    stability: tuple[Floquet, ...] = ()
    by_field: Branch | None = None
    run: Run | None = None
    record: ProbeRecord | None = None
    recorded: PeriodicOrbit | None = None
    troubles: list[str] = field(default_factory=list)

    @property
    def rated(self) -> float:
        """Rated speed, rad/s."""
        return self.speeds["rated speed"]

    def answers(self) -> list[Answer]:
        """Everything that was asked and found, in the order of a report."""
        return [answer for ask in (critical_answers, gap_answers, bearing_answers,
                                   worst_answers, balance_answers)
                for answer in ask(self)]


CENTRED, AT_TOLERANCE = "stator centred", "stator 5 % out of centre"
Told = Callable[[str, int, int], None]


def assess(machine: Machine, *, overspeed: float | None = None, runaway: float | None = None,
           worst: bool = False, record: ProbeRecord | None = None,
           progress: Told | None = None) -> Assessment:
    """Compute what an engineer asks of a machine at its rated speed.

    overspeed, runaway: rad/s; 1.4 and 2.5 times the rated speed unless given. worst: whether to
    move it through a load rejection too, which takes seconds. record: of probes on it, to compare.
    progress: called with (what is being done, done, all). Raises BadInput for a machine that does
    not turn, or a speed that is none.
    """
    require_machine(machine)
    if not machine.speed > 0:
        raise BadInput("speed is 0 rad/s; a report needs the rated speed.")
    given = {"rated speed": machine.speed, "overspeed": overspeed, "runaway speed": runaway}
    factors = {"overspeed": OVERSPEED, "runaway speed": RUNAWAY}
    speeds = {name: factors[name] * machine.speed if value is None else number(name, value, above=0)
              for name, value in given.items()}
    found = Assessment(machine, machine.model(), speeds,
                       tuple(name for name, value in given.items() if value is None))
    found.record = record
    steps = [_find_orbits, _find_criticals, _find_branch, _find_field]
    steps += [_find_run] * worst + [_find_recorded] * (record is not None)
    with threadpool_limits(1):
        for i, step in enumerate(steps):
            if progress:
                progress("the unit", i, len(steps))
            try:
                step(found)
            except (BadInput, NoConvergence, Contact) as error:
                found.troubles.append(f"{step.__doc__} Not computed: {error}")
    return found


def _find_orbits(a: Assessment) -> None:
    """Steady states at the rated speed."""
    balance = HarmonicBalance(HARMONICS)
    a.orbits[CENTRED] = centred = balance.solve(a.model, a.rated)
    a.verdicts[CENTRED] = floquet_all([centred])[0]
    if not math.isfinite(a.model.gap):
        return
    # the stator away from the rotor's mean, which then stands nearest to it
    if np.hypot(*centred.mean) > 1e-3 * a.model.gap:
        a.direction = math.atan2(*-centred.mean)
    try:
        orbit = balance.solve(a.model, a.rated, CONCENTRIC, direction=a.direction)
        a.orbits[AT_TOLERANCE], a.verdicts[AT_TOLERANCE] = orbit, floquet_all([orbit])[0]
    except (NoConvergence, Contact) as error:
        a.troubles.append(f"With the {AT_TOLERANCE} there is no steady state: {error}")


def _find_criticals(a: Assessment) -> None:
    """Critical speeds with the field on and off."""
    marks = {name.split()[0]: speed for name, speed in a.speeds.items()}
    off = a.model.with_field(0)
    free = HarmonicBalance(HARMONICS).solve(off, a.rated)
    a.criticals["field off"] = critical_speeds(off, pull=free, **marks)
    if CENTRED in a.orbits and a.machine.air_gap:
        a.criticals["field on"] = critical_speeds(a.model, pull=a.orbits[CENTRED], **marks)


def _find_branch(a: Assessment) -> None:
    """Steady states along the static eccentricity."""
    if CENTRED in a.orbits and math.isfinite(a.model.gap):
        method = Arclength(HarmonicBalance(HARMONICS), max_folds=1, tail=20)
        a.branch = follow(a.model, to=0.9, speed=a.rated, direction=a.direction,
                          start=a.orbits[CENTRED], method=method)
        spread = np.linspace(0, a.branch.first_leg.stop - 1, LOOKS).round().astype(int)
        rows = range(len(a.branch)) if pull_alone(a.model) else sorted(set(map(int, spread)))
        a.rows = tuple(rows)
        a.stability = tuple(floquet_all([a.branch[k] for k in a.rows]))


def _find_field(a: Assessment) -> None:
    """Steady states along the field, with the stator at its tolerance."""
    if AT_TOLERANCE in a.orbits:
        method = Arclength(HarmonicBalance(HARMONICS), max_folds=1, tail=0)
        a.by_field = follow(a.model, "field", to=MOST_FIELD, speed=a.rated,
                            start=a.orbits[AT_TOLERANCE], method=method)


def _find_run(a: Assessment) -> None:
    """The load rejection."""
    if not a.machine.air_gap or AT_TOLERANCE in a.orbits:
        rejection = load_rejection(a.rated, to=a.speeds["overspeed"] / a.rated, seconds=WORST)
        a.run = run(a.model, rejection, direction=a.direction, steps_per_revolution=128,
                    static_eccentricity=CONCENTRIC if a.machine.air_gap else 0.0)


def _find_recorded(a: Assessment) -> None:
    """The steady state at the speed and field of the record."""
    assert a.record is not None
    model = a.model.with_field(a.record.field) if a.machine.air_gap else a.model
    orbit = HarmonicBalance(HARMONICS).solve(model, a.record.speed)
    for place in a.record.places:
        motion_at(orbit, place)  # says which places there are
    a.recorded = orbit


def rpm_words(speed: float) -> str:
    """A speed, rad/s, in rpm."""
    return f"{speed * 30 / math.pi:.4g} rpm"


def _newtons(force: float) -> str:
    """A force, N, in kN to the newton."""
    return f"{1e-3 * round(force):.4g} kN"


def nearest(found: CriticalSpeeds, speed: float) -> float | None:
    """The critical speed nearest to a speed, rad/s, of those that an unbalance excites: all but
    those whose whirl is backward alone; None where there is none.
    """
    own = map(float, found.speeds[found.whirl > EXCITED])
    return min(own, key=lambda s: abs(s / speed - 1), default=None)


def critical_answers(a: Assessment) -> Iterator[Answer]:
    """The nearest critical speed to each speed that matters, field off and on."""
    for name, speed in a.speeds.items():
        for state, found in a.criticals.items():
            critical = nearest(found, speed)
            words = "there is none" if critical is None else (
                f"{rpm_words(critical)}, {100 * abs(critical / speed - 1):.1f} % "
                f"{'above' if critical > speed else 'below'}")
            yield Answer(f"Critical speed nearest to the {name}, {rpm_words(speed)}, {state}",
                         words, SPECIFIED)


def gap_answers(a: Assessment) -> Iterator[Answer]:
    """What is left of the air gap, where the steady states end, and the shapes in it."""
    air = a.machine.air_gap
    if air is None:
        return
    for words, orbit in a.orbits.items():
        yield Answer(f"Smallest air gap, {words}", f"{1e3 * orbit.smallest_gap:.2f} mm, "
                     f"{100 * orbit.smallest_gap / air.gap:.1f} % of the nominal "
                     f"{1e3 * air.gap:.4g} mm; {_verdict(a, words)}", TOUCH, orbit.smallest_gap > 0)
    if a.branch is not None:
        lost = first_loss(a)
        yield Answer("Static eccentricity at which the steady state is lost",
                     f"{100 * lost:.2f} % of the gap, {lost / CONCENTRIC:.2g} times the tolerance "
                     f"({_how_lost(a)})", TOLERANCE, lost > CONCENTRIC)
    elif AT_TOLERANCE not in a.orbits and CENTRED in a.orbits:
        yield Answer("Static eccentricity at which the steady state is lost",
                     "below the tolerance: none was found there", TOLERANCE, False)
    if a.by_field is not None:
        folds = a.by_field.folds
        yield Answer(f"Field at which the steady state is lost, {AT_TOLERANCE}",
                     f"{100 * folds[0].value:.1f} % of the card's {air.field:.3g} T" if folds else
                     f"not up to {MOST_FIELD:g} times the card's {air.field:.3g} T", SPECIFIED)
    for shape in a.machine.shapes:
        size = abs(shape.size) / air.gap
        yield Answer(f"Shape of the {shape.name}", f"{100 * size:.2g} % of the nominal gap",
                     ROUNDNESS, size <= ROUND)


def first_loss(a: Assessment) -> float:
    """Static eccentricity, fraction of the gap, at which the first leg of the branch ends, or of
    the first of its points looked at that is unstable.
    """
    assert a.branch is not None
    leg = a.branch.first_leg
    end = a.branch.folds[0].value if a.branch.folds else float(a.branch.values[leg][-1])
    return min([float(a.branch.values[row]) for row, point in zip(a.rows, a.stability, strict=True)
                if row < leg.stop and point.verdict == "unstable"] + [end])


def _how_lost(a: Assessment) -> str:
    """Why the first leg ends where it does."""
    assert a.branch is not None
    if a.branch.folds and first_loss(a) == a.branch.folds[0].value:
        return "a fold: there is no steady state beyond"
    return "it becomes unstable" if a.branch.folds else a.branch.stopped.rstrip(".").lower()


def _verdict(a: Assessment, words: str) -> str:
    """Whether the steady state of these words is stable."""
    said = a.verdicts[words].verdict
    return "its stability is not known" if said == "unknown" else said


def _journal(orbit: PeriodicOrbit, name: str) -> np.ndarray:
    """(x, z) of the shaft in a bearing about its centre over a period, m, (2, 360)."""
    support = orbit.model.supports[name]
    return synthesise(support.rows @ orbit.shaft, PERIOD) - support.offset[:, None]


def bearing_answers(a: Assessment) -> Iterator[Answer]:
    """What each guide bearing carries, how the shaft moves in it, and what of its clearance is
    used.
    """
    guides = [b for b in a.machine.all_bearings if isinstance(b, Guide)]
    for words, orbit in a.orbits.items():
        for bearing in guides:
            if bearing.name not in orbit.bearing_forces:
                continue
            force, path = orbit.bearing_forces[bearing.name], _journal(orbit, bearing.name)
            yield Answer(f"Force on {bearing.name}, {words}",
                         f"static {_newtons(float(np.hypot(*force.static)))}, 1X "
                         f"{_newtons(force.first)}, largest {_newtons(force.peak)}", LOAD)
            yield Answer(f"Vibration of the shaft in {bearing.name}, {words}",
                         f"{1e6 * np.ptp(path, axis=1).max():.3g} µm peak to peak", ZONES)
            clearance = getattr(bearing, "clearance", 0.0)
            if clearance > 0:
                share = float(np.hypot(*path).max()) / clearance
                yield Answer(f"Clearance of {bearing.name} that is used, {words}",
                             f"{100 * share:.0f} % of {1e6 * clearance:.3g} µm", CLEARANCE)
    for bearing in guides:
        clearance, away = getattr(bearing, "clearance", 0.0), math.hypot(bearing.x, bearing.z)
        if clearance > 0 and away:
            yield Answer(f"{bearing.name} out of line",
                         f"{100 * away / (2 * clearance):.0f} % of its diametral clearance",
                         ALIGNED, away <= 2 * IN_LINE * clearance)


def worst_answers(a: Assessment) -> Iterator[Answer]:
    """The smallest gap and the largest bearing force of the load rejection, and when."""
    if a.run is None:
        return
    if math.isfinite(a.model.gap):
        gap = a.run.smallest_gap
        yield Answer("Smallest air gap in the load rejection", f"{1e3 * gap.value:.2f} mm at "
                     f"{gap.time:.3g} s, {rpm_words(gap.speed)}", TOUCH, gap.value > 0)
    if a.run.bearing_forces:
        force = a.run.largest_bearing_force
        yield Answer("Largest bearing force in the load rejection", f"{_newtons(force.value)} on "
                     f"{force.name} at {force.time:.3g} s, {rpm_words(force.speed)}", LOAD)


def balance_answers(a: Assessment) -> Iterator[Answer]:
    """The balance grade of each body: e Ω with e = U/m."""
    air = a.machine.air_gap
    for body in a.machine.bodies:
        fast = air is not None and body.name == air.body and a.rated > FINE_FROM
        if body.unbalance:
            grade = body.unbalance / body.mass * a.rated
            kept = grade <= (FINE_GRADE if fast else GRADE)
            yield Answer(f"Balance of {body.name}", f"G {1e3 * grade:.3g}: {body.unbalance:.4g} "
                         f"kg m on {body.mass / 1e3:.4g} t", BALANCE, kept)
