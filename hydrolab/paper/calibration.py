"""The unknown half of the paper's machine: free data, their ranges, and how the rest is fixed; the
family of machines that this gives.

Figure 1 of Villa, Carvalho and Salomon is lost, and with it the masses, inertias, bearing
positions, the turbine's link and the two unbalances. What the paper states is kept as stated. A
member of the family is a draw of the free data `FREE`; then
- the unbalances are scaled so that the centred generator moves 200 µm (0-to-peak), with the field
  or without, since the paper does not say which;
- the depth of the guide bearing is found so that the first fold lies at 8.925 % of the gap.
A draw for which no depth does that is rejected, with its reason. No claim of the paper takes part
in this. book/gallery/kaplan_family.py draws the family and chooses the member that ships.
"""

from __future__ import annotations

import json
import math
import os
import signal
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from hydrolab.dynamics.following import Arclength, follow
from hydrolab.dynamics.harmonic_balance import condense
from hydrolab.dynamics.harmonics import to_complex
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.bearings import RadialBearing, ThrustBearing
from hydrolab.machine.model import Model
from hydrolab.machine.parts import AirGap, Machine, RayleighDamping, RigidBody, Shaft
from hydrolab.paper.claims import judge
from hydrolab.paper.study import run_study

SPEED = 150 * math.pi / 30
AMPLITUDE = 200e-6  # m, 0-to-peak, at the generator centre (paper, section 2)
# the paper shows an orbit at 8.9 % and finds none "beyond about 8.9 %"
FOLD_RANGE = (0.0890, 0.0895)
FOLD = 0.08925
ROTOR_RADIUS = 2.989  # m, Table 1: u0 − g0/2
DEPTH_RANGE = (0.70, 1.30)  # m, where the guide bearing is looked for
READINGS = {"with field": True, "without field": False}


@dataclass(frozen=True)
class Free:
    """A free datum: what it is, its unit, the range it is drawn from, and why that range."""

    meaning: str
    unit: str
    low: float
    high: float
    why: str


FREE: dict[str, Free] = {
    "generator_mass": Free("mass of the generator rotor", "kg", 6e4, 1.5e5,
                           "unit of some 22 MVA, H = 3 to 4 s"),
    "generator_gyration": Free("radius of gyration about the axis over the rotor radius", "1",
                               0.60, 0.85, "between a solid disc, 0.71, and a rim, with spokes"),
    "generator_shape": Free("Id/Ip of the generator", "1", 0.52, 0.65, "a disc 1 to 2 m high"),
    "turbine_mass": Free("mass of the runner with its hub", "kg", 2e4, 6e4,
                         "Kaplan runner of 4 to 5 m"),
    "turbine_gyration": Free("radius of gyration of the runner", "m", 0.9, 1.6,
                             "Kaplan runner of 4 to 5 m"),
    "turbine_shape": Free("Id/Ip of the runner", "1", 0.52, 0.90, "hub nearly as high as wide"),
    "turbine_offset": Free("runner centre below the shaft end", "m", 0.0, 1.0,
                           "a link like the generator's"),
    "thrust_depth": Free("depth of the thrust bearing", "m", 4.0, 5.0, "'near the middle span'"),
    "turbine_bearing_depth": Free("depth of the turbine bearing", "m", 7.8, 8.7,
                                  "'close to the turbine'"),
    "unbalance_share": Free("generator's share of the sum of the unbalances", "1", 0.5, 1.0,
                            "'in both generator and turbine'"),
    "unbalance_phase": Free("angle of the turbine's unbalance ahead of the generator's", "rad",
                            0.0, 2 * math.pi, "unknown"),
}


@dataclass(frozen=True)
class Member:
    """One machine of the family: its free data, and what was calibrated.

    reading: how "200 µm" was read. bearing_depth: of the guide bearing, m. unbalance: sum of both,
    kg m. fold: first fold, fraction of the gap.
    """

    number: int
    reading: str
    free: Mapping[str, float]
    bearing_depth: float
    unbalance: float
    fold: float

    def machine(self) -> Machine:
        """The member as a machine."""
        return build(self.free, self.bearing_depth, self.unbalance, name=f"member {self.number}, "
                                                                         f"{self.reading}")


@dataclass(frozen=True)
class Family:
    """Members, and the draws that were rejected with their reasons."""

    seed: int
    members: tuple[Member, ...]
    rejected: tuple[tuple[int, str, str], ...]


def build(free: Mapping[str, float], bearing_depth: float, unbalance: float,
          name: str = "kaplan") -> Machine:
    """The Kaplan unit of the paper with these free data, a bearing_depth of its guide bearing (m),
    an unbalance (kg m, the sum of both) and a name.

    Twelve elements: shaft top to guide bearing, five to the thrust bearing, five to the turbine
    bearing, one to the end. Equal elements do not fit: bearings on their nodes would be at 0.75 or
    1.51 m, far too stiff or too soft.
    """
    bearing, thrust, turbine = bearing_depth, free["thrust_depth"], free["turbine_bearing_depth"]
    nodes = np.concatenate([[0.0], np.linspace(bearing, thrust, 6),
                            np.linspace(thrust, turbine, 6)[1:], [9.04]])
    polar = free["generator_mass"] * (free["generator_gyration"] * ROTOR_RADIUS) ** 2
    runner = free["turbine_mass"] * free["turbine_gyration"] ** 2
    share = free["unbalance_share"]
    return Machine(
        name, SPEED,
        Shaft(nodes, 0.71, 2e11, 7850.0, poisson=0.3, shear_coefficient=0.9),
        (RigidBody("generator", 0, free["generator_mass"], free["generator_shape"] * polar, polar,
                   -0.472, share * unbalance),
         RigidBody("turbine", 12, free["turbine_mass"], free["turbine_shape"] * runner, runner,
                   free["turbine_offset"], (1 - share) * unbalance, free["unbalance_phase"])),
        (RadialBearing("generator guide bearing", 1, 1.37e9),
         RadialBearing("turbine guide bearing", 11, 1.64e9)),
        (ThrustBearing("thrust bearing", 6, 5e7),),
        RayleighDamping((0.01, 0.01)),
        AirGap("generator", field=0.5, mean_radius=2.9945, length=0.97, gap=0.011),
    )


def member_of(machine: Machine, reading: str) -> Member:
    """The member that a machine built by `build` is, its 200 µm counted as reading says: its free
    data read back from its parts.
    """
    generator, turbine = machine.body("generator"), machine.body("turbine")
    assert machine.shaft is not None  # `build` gives one
    nodes, total = machine.shaft.nodes, generator.unbalance + turbine.unbalance
    free = {"generator_mass": generator.mass,
            "generator_gyration": math.sqrt(generator.Ip / generator.mass) / ROTOR_RADIUS,
            "generator_shape": generator.Id / generator.Ip, "turbine_mass": turbine.mass,
            "turbine_gyration": math.sqrt(turbine.Ip / turbine.mass),
            "turbine_shape": turbine.Id / turbine.Ip,
            "turbine_offset": turbine.offset, "thrust_depth": float(nodes[6]),
            "turbine_bearing_depth": float(nodes[11]),
            "unbalance_share": generator.unbalance / total,
            "unbalance_phase": turbine.phase - generator.phase}
    return Member(-1, reading, free, float(nodes[1]), total, first_fold(machine.model()))


def unbalance_scale(model: Model, speed: float, amplitude: float, *, with_field: bool) -> float:
    """Factor on the unbalances of a model that makes its centred orbit at a speed (rad/s) a circle
    of this amplitude (m), with_field or without; exact.

    A forward circle of radius r feels the radial pull k (1 − r²/g0²)^{−3/2} r, so that one complex
    equation d w = d w_lin + k(r) w holds for w = z + ix, with d the forward dynamic stiffness.
    Axisymmetric machines only.
    """
    eq = condense(model, speed, 1, 8)
    blocks = eq.stiffness.reshape(2, 3, 2, 3) * (eq.force / eq.length)
    dynamic = blocks[:, 1, :, 1] + 1j * blocks[:, 2, :, 1]
    forward = np.array([-1j, 1.0])
    d = forward.conj() @ dynamic @ forward / 2
    if np.abs(dynamic @ forward - d * forward).max() > 1e-6 * abs(d):
        raise BadInput(f"{model.name} is not axisymmetric, so its centred orbit is not a circle.")
    linear = forward.conj() @ to_complex(eq.length * eq.linear)[:, 1] / 2
    pull = model.law.scaled(float(with_field))
    radial = pull.force(np.array([amplitude, 0.0]))[0] / amplitude
    return float(abs(d - radial) * amplitude / abs(d * linear))


def first_fold(model: Model) -> float:
    """First fold of a model along the static eccentricity at 150 rpm, fraction of the gap; 0 if
    there is no steady state to begin with, nan if there is no fold up to contact.
    """
    try:
        branch = follow(model, speed=SPEED, to=0.5, method=Arclength(max_folds=1, tail=0))
    except (NoConvergence, Contact):
        return 0.0
    return branch.folds[0].value if branch.folds else math.nan


def with_amplitude(free: Mapping[str, float], depth: float, reading: str) -> Machine:
    """The machine of these free data at a guide-bearing depth (m) with its unbalances scaled to the
    200 µm, counted as reading says.
    """
    scale = unbalance_scale(build(free, depth, 1.0).model(), SPEED, AMPLITUDE,
                            with_field=READINGS[reading])
    return build(free, depth, scale)


def calibrate(free: Mapping[str, float], reading: str, number: int = 0) -> Member | str:
    """Find the guide-bearing depth that puts the first fold of these free data at 8.925 %, with
    the 200 µm counted as reading says; a sentence if there is none. number: of the draw.
    """
    def excess(depth: float) -> float:
        fold = first_fold(with_amplitude(free, depth, reading).model())
        return (1.0 if math.isnan(fold) else fold) - FOLD  # no fold: too stiff

    if not excess(DEPTH_RANGE[0]) > 0 > excess(DEPTH_RANGE[1]):
        return (f"no guide bearing between {DEPTH_RANGE[0]} and {DEPTH_RANGE[1]} m brackets a fold "
                "at 8.925 %")
    depth = brentq(excess, *DEPTH_RANGE, xtol=1e-6)
    fold = excess(depth) + FOLD
    if not FOLD_RANGE[0] <= fold <= FOLD_RANGE[1]:
        return ("the first fold jumps past 8.90 to 8.95 % as the guide bearing moves (to "
                f"{100 * fold:.2f} %)")
    machine = with_amplitude(free, depth, reading)
    return Member(number, reading, dict(free), depth, sum(b.unbalance for b in machine.bodies),
                  fold)


class Nudge(NamedTuple):
    """A small change of a free datum: a factor and a summand, and both in words."""

    factor: float
    summand: float
    said: str


STEPS = {
    "generator_mass": Nudge(1.01, 0, "+1 %"), "turbine_mass": Nudge(1.01, 0, "+1 %"),
    "generator_shape": Nudge(1.01, 0, "+1 % of Id"), "turbine_shape": Nudge(1.01, 0, "+1 % of Id"),
    "generator_gyration": Nudge(math.sqrt(1.01), 0, "+1 % of Ip and Id"),
    "turbine_gyration": Nudge(math.sqrt(1.01), 0, "+1 % of Ip and Id"),
    "turbine_offset": Nudge(1, 0.01, "+1 cm"), "thrust_depth": Nudge(1, 0.01, "+1 cm"),
    "turbine_bearing_depth": Nudge(1, 0.01, "+1 cm"), "unbalance_share": Nudge(1, -0.01, "−0.01"),
    "unbalance_phase": Nudge(1, 0.1, "+0.1 rad"),
}


def sensitivity(member: Member) -> dict[str, float]:
    """Change of the first fold, in % of the gap, for each of `STEPS` and for 1 cm of guide-bearing
    depth.

    The 200 µm are kept by scaling the unbalances anew.
    """
    def fold(free: Mapping[str, float], depth: float) -> float:
        return first_fold(with_amplitude(free, depth, member.reading).model())

    base = fold(member.free, member.bearing_depth)
    changes = {}
    for key, (factor, summand, _) in STEPS.items():
        moved = {**member.free, key: member.free[key] * factor + summand}
        changes[key] = 100 * (fold(moved, member.bearing_depth) - base)
    changes["guide_bearing_depth"] = 100 * (fold(member.free, member.bearing_depth + 0.01) - base)
    return changes


def load_family() -> Family:
    """The family that ships with hydrolab."""
    path = files("hydrolab.machine") / "cards" / "kaplan-family.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    return Family(content["seed"], tuple(Member(**m) for m in content["members"]),
                  tuple((r["number"], r["reading"], r["reason"]) for r in content["rejected"]))


def family_prior(keys: Iterable[str]) -> dict[str, tuple[float, float]]:
    """What the family knows of numbers of its card before anything is measured: mean and standard
    deviation over the members by key, for `hydrolab.identify`.

    It says nothing of what all members share, nor of angles, which may be anything.
    """
    machines = [member.machine() for member in load_family().members]
    known = machines[0].numbers()
    found = {}
    for key in keys:
        if key in known and machines[0].number(key)[1] != "rad":
            values = np.array([machine.number(key)[0] for machine in machines])
            if np.ptp(values) > 1e-9 * np.abs(values).max():
                found[key] = float(values.mean()), float(values.std(ddof=1))
    return found


@dataclass(frozen=True)
class Verdicts:
    """What the study of one member found: its kind, or "not studied", and which claims hold."""

    member: Member
    kind: str
    holds: dict[int, bool]


def judge_member(member: Member) -> Verdicts:
    """Study one member and judge it."""
    try:
        study = run_study(member.machine())
    except (BadInput, NoConvergence, Contact):
        return Verdicts(member, "not studied", {})
    if study.interrupted:
        raise KeyboardInterrupt  # half a study is no verdict
    return Verdicts(member, study.kind, {c.id: bool(c.holds) for c in judge(study)})


def judge_family(members: Iterable[Member], progress: Callable[[int, int], None] | None = None,
                 workers: int | None = None) -> list[Verdicts]:
    """Judge members in parallel processes, by default as many workers as there are cores, in their
    order; progress is called with (done, all).

    An interrupt, or a process that dies, keeps what is done: fewer verdicts than members. Each
    process uses one BLAS thread, and ends at once at a Ctrl-C in the terminal, which all processes
    get.
    """
    # here, because a browser's Python has no processes
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from concurrent.futures.process import BrokenProcessPool

    members = list(members)
    done: dict[int, Verdicts] = {}
    with ProcessPoolExecutor(workers or os.cpu_count(), initializer=signal.signal,
                             initargs=(signal.SIGINT, signal.SIG_DFL)) as pool:
        waiting = {pool.submit(judge_member, m): i for i, m in enumerate(members)}
        try:
            for future in as_completed(waiting):
                done[waiting[future]] = future.result()
                if progress:
                    progress(len(done), len(members))
        except (KeyboardInterrupt, BrokenProcessPool):
            pool.shutdown(cancel_futures=True)
    return [done[i] for i in sorted(done)]


def tally(verdicts: Iterable[Verdicts], claim: int) -> dict[str, dict[str, int]]:
    """How many members agree with a claim, by their verdicts: {kind: {"agree": n, "of": n}}."""
    counts: dict[str, dict[str, int]] = {}
    for v in verdicts:
        row = counts.setdefault(v.kind, {"agree": 0, "of": 0})
        row["of"] += 1
        row["agree"] += int(v.holds.get(claim, False))
    return counts
