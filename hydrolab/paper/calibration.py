"""The unknown half of the paper's machine: free data, their ranges, and how the rest is fixed; the
family of machines that this gives, and the one of them that ships.

Figure 1 of Villa, Carvalho and Salomon is lost, and with it the masses, inertias, bearing
positions, the turbine's link and the two unbalances. What the paper states is kept as stated. A
member of the family is a draw of the free data (Latin hypercube over `FREE`); then
- the unbalances are scaled so that the centred generator moves 200 µm (0-to-peak), with the field
  or without, since the paper does not say which;
- the depth of the guide bearing is found so that the first fold lies at 8.925 % of the gap.
A draw for which no depth does that is rejected, with its reason. No claim of the paper takes part
in this.

Then each member is studied and judged, and the one that agrees with most claims becomes the card.
A member whose fold moves by more than 0.1 % of the gap when a mass or an inertia grows by 1 % is
passed over. Among equals the choice falls on the one whose stable steady states reach furthest past
the first fold, because there is most to show. `python -m hydrolab.paper.calibration` does all of
this again.
"""

from __future__ import annotations

import json
import math
import os
import signal
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import qmc

from hydrolab.dynamics.following import Arclength, follow
from hydrolab.dynamics.harmonic_balance import condense
from hydrolab.dynamics.harmonics import to_complex
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.bearings import RadialBearing, ThrustBearing
from hydrolab.machine.cards import read_card, write_card
from hydrolab.machine.model import Model
from hydrolab.machine.parts import AirGap, Machine, RayleighDamping, RigidBody, Shaft
from hydrolab.machine.quantities import Entry
from hydrolab.paper.claims import judge
from hydrolab.paper.study import FAMILY_CARD, Study, run_study

SPEED = 150 * math.pi / 30
AMPLITUDE = 200e-6  # m, 0-to-peak, at the generator centre (paper, section 2)
# the paper shows an orbit at 8.9 % and finds none "beyond about 8.9 %"
FOLD_RANGE = (0.0890, 0.0895)
FOLD = 0.08925
ROTOR_RADIUS = 2.989  # m, Table 1: u0 − g0/2
DEPTH_RANGE = (0.70, 1.30)  # m, where the guide bearing is looked for
READINGS = {"with field": True, "without field": False}
LARGEST_SENSITIVITY = 0.1  # % of the gap for 1 % of a mass or an inertia
INERTIAS = ("generator_mass", "generator_gyration", "generator_shape", "turbine_mass",
            "turbine_gyration", "turbine_shape")


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
                               0.60, 0.85,
                               "between a solid disc, 0.71, and a rim, with spokes"),
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
                            0.0, 2 * math.pi,
                            "unknown"),
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
    """The Kaplan unit of the paper with these free data, a guide-bearing depth (m) and a sum of
    unbalances (kg m).

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
                   -0.472,
                   share * unbalance),
         RigidBody("turbine", 12, free["turbine_mass"], free["turbine_shape"] * runner, runner,
                   free["turbine_offset"],
                   (1 - share) * unbalance, free["unbalance_phase"])),
        (RadialBearing("generator guide bearing", 1, 1.37e9),
         RadialBearing("turbine guide bearing", 11, 1.64e9)),
        (ThrustBearing("thrust bearing", 6, 5e7),),
        RayleighDamping((0.01, 0.01)),
        AirGap("generator", field=0.5, mean_radius=2.9945, length=0.97, gap=0.011),
    )


def depths(machine: Machine) -> NDArray:
    """Depths of the nodes of the unit's shaft, m."""
    if machine.shaft is None:
        raise BadInput(f"{machine.name} has no shaft; a member of the family has one.")
    return machine.shaft.nodes


def member_of(machine: Machine, reading: str) -> Member:
    """The member that a machine built by `build` is: its free data read back from its parts."""
    generator, turbine, nodes = machine.body("generator"), machine.body("turbine"), depths(machine)
    total = generator.unbalance + turbine.unbalance
    free = {"generator_mass": generator.mass,
            "generator_gyration": math.sqrt(generator.Ip / generator.mass) / ROTOR_RADIUS,
            "generator_shape": generator.Id / generator.Ip, "turbine_mass": turbine.mass,
            "turbine_gyration": math.sqrt(turbine.Ip / turbine.mass),
            "turbine_shape": turbine.Id / turbine.Ip,
            "turbine_offset": turbine.offset, "thrust_depth": float(nodes[6]),
            "turbine_bearing_depth": float(nodes[11]),
            "unbalance_share": generator.unbalance / total,
            "unbalance_phase": turbine.phase - generator.phase}
    return Member(-1, reading, free, float(nodes[1]), total,
                  first_fold(machine.model()))


def unbalance_scale(model: Model, speed: float, amplitude: float, *, with_field: bool) -> float:
    """Factor on the unbalances that makes the centred orbit a circle of this radius (m); exact.

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


def first_fold(model: Model, speed: float = SPEED) -> float:
    """First fold along the static eccentricity, fraction of the gap; 0 if there is no steady state
    to begin with, nan if there is no fold up to contact."""
    try:
        branch = follow(model, speed=speed, to=0.5, method=Arclength(max_folds=1, tail=0))
    except (NoConvergence, Contact):
        return 0.0
    return branch.folds[0].value if branch.folds else math.nan


def with_amplitude(free: Mapping[str, float], depth: float, reading: str) -> Machine:
    """The machine at this guide-bearing depth with its unbalances scaled to the 200 µm."""
    scale = unbalance_scale(build(free, depth, 1.0).model(), SPEED, AMPLITUDE,
                            with_field=READINGS[reading])
    return build(free, depth, scale)


def calibrate(free: Mapping[str, float], reading: str, number: int = 0) -> Member | str:
    """Find the guide-bearing depth that puts the first fold at 8.925 %; a sentence if there is
    none.
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


def draw_family(draws: int = 40, seed: int = 1,
                progress: Callable[[int, int], None] | None = None) -> Family:
    """Draw the free data and calibrate both readings of each draw."""
    unit = qmc.LatinHypercube(len(FREE), seed=seed).random(draws)
    members, rejected = [], []
    for number, row in enumerate(unit):
        free = {key: f.low + u * (f.high - f.low)
                for (key, f), u in zip(FREE.items(), row, strict=True)}
        for reading in READINGS:
            found = calibrate(free, reading, number)
            if isinstance(found, Member):
                members.append(found)
            else:
                rejected.append((number, reading, found))
        if progress:
            progress(number + 1, draws)
    return Family(seed, tuple(members), tuple(rejected))


@dataclass(frozen=True)
class Nudge:
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
    for key, step in STEPS.items():
        moved = {**member.free, key: member.free[key] * step.factor + step.summand}
        changes[key] = 100 * (fold(moved, member.bearing_depth) - base)
    changes["guide_bearing_depth"] = 100 * (fold(member.free, member.bearing_depth + 0.01) - base)
    return changes


def family_file() -> Path:
    """Where the family that ships with hydrolab is kept."""
    return Path(str(files("hydrolab.machine") / "cards" / "kaplan-family.json"))


def save_family(family: Family, path: Path) -> None:
    """Write a family as JSON, with the ranges it was drawn from."""
    free = {key: asdict(f) for key, f in FREE.items()}
    content = {"seed": family.seed, "free": free, "members": [asdict(m) for m in family.members],
               "rejected": [{"number": n, "reading": r, "reason": w}
                            for n, r, w in family.rejected]}
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def load_family(path: Path | None = None) -> Family:
    """Read a family written by `save_family`; the shipped one by default."""
    content = json.loads((path or family_file()).read_text(encoding="utf-8"))
    return Family(content["seed"], tuple(Member(**m) for m in content["members"]),
                  tuple((r["number"], r["reading"], r["reason"]) for r in content["rejected"]))


@dataclass(frozen=True)
class Verdicts:
    """What the study of one member found: its kind, which claims hold, or why it could not be
    studied.

    first_loss: eccentricity at which stability is lost before the first fold, or None. folds:
    fractions of the gap. stable_reach: largest eccentricity at which a steady state past the folds
    was found stable, or 0.
    """

    member: Member
    kind: str
    holds: dict[int, bool]
    folds: tuple[float, ...] = ()
    first_loss: float | None = None
    stable_reach: float = 0.0
    failure: str = ""


def judge_member(member: Member) -> Verdicts:
    """Study one member and judge it."""
    try:
        study = run_study(member.machine())
        if study.interrupted:
            raise KeyboardInterrupt  # half a study is no verdict
        return Verdicts(member, study.kind, {c.id: bool(c.holds) for c in judge(study)},
                        tuple(f.value for f in study.branch.folds), study.first_loss,
                        stable_reach(study))
    except (BadInput, NoConvergence, Contact) as error:
        return Verdicts(member, "not studied", {}, failure=str(error))


def judge_family(members: Iterable[Member], progress: Callable[[int, int], None] | None = None,
                 workers: int | None = None) -> list[Verdicts]:
    """Judge members in parallel processes, in their order.

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
    """How many members of each kind agree with a claim: {kind: {"agree": n, "of": n}}."""
    counts: dict[str, dict[str, int]] = {}
    for v in verdicts:
        row = counts.setdefault(v.kind, {"agree": 0, "of": 0})
        row["of"] += 1
        row["agree"] += int(v.holds.get(claim, False))
    return counts


def stable_reach(study: Study) -> float:
    """Largest eccentricity past the first fold at which a point of the later legs is stable; 0 if
    there is none.
    """
    if study.kind == "plain":
        return 0.0
    beyond = zip(study.branch.static_eccentricity, study.stability, strict=True)
    return max((float(value) for value, point in beyond if value > study.limit
                and point.verdict == "stable"),
               default=0.0)


def choose(verdicts: Iterable[Verdicts]) -> Member:
    """The member that agrees with most claims; see the module for ties.

    Raises BadInput where no member's fold is firm enough.
    """
    def rank(v: Verdicts) -> tuple[int, float]:
        return sum(v.holds.values()), v.stable_reach

    for best in sorted(verdicts, key=rank, reverse=True):
        changes = sensitivity(best.member)
        if max(abs(changes[key]) for key in INERTIAS) <= LARGEST_SENSITIVITY:
            return best.member
    raise BadInput("on every member 1 % of a mass or an inertia moves the fold by over "
                   f"{LARGEST_SENSITIVITY} % of the gap.")


def rounded(value: float, digits: int = 4) -> float:
    """A number with so many significant digits."""
    return float(f"{value:.{digits}g}")


def ship(member: Member, path: Path) -> Member:
    """Write a member as the card `kaplan-150rpm`, its free data rounded to four digits and
    calibrated anew.
    """
    found = calibrate({key: rounded(value) for key, value in member.free.items()}, member.reading,
                      member.number)
    if isinstance(found, str):
        raise BadInput(f"the rounded member cannot be calibrated: {found}.")
    member = found
    machine, card = member.machine(), read_card(FAMILY_CARD)

    def put(table: dict[str, Any], key: str, value: Any, unit: str, note: str = "") -> None:
        table[key] = Entry(value, unit, "calibrated", note, value)

    card["about"] = (
        "A large vertical generator unit after the paper's Kaplan plant in the north of Brazil. "
        "What the paper states is kept. Its Figure 1 is lost, so the rest is our own calibration "
        f"and not the paper's: member {member.number} of the family of hydrolab.paper.calibration, "
        f"with 200 µm counted {member.reading}, chosen because it agrees with most claims of the "
        "paper.")
    put(card["shaft"], "nodes", [rounded(y, 7) for y in depths(machine)], "m",
        "12 elements and 9.04 m: paper; guide bearing at node 1: puts the first fold at 8.925 %; "
        "thrust bearing at node 6 and turbine bearing at node 11: drawn")
    for table, body in zip(card["bodies"], machine.bodies, strict=True):
        put(table, "mass", body.mass / 1000, "t", "drawn")
        put(table, "Id", rounded(body.Id, 6), "kg m^2", "drawn, by its share of Ip")
        put(table, "Ip", rounded(body.Ip, 6), "kg m^2", "drawn, by its radius of gyration")
        put(table, "unbalance", rounded(body.unbalance, 6), "kg m",
            f"share drawn; size: 200 µm (0-to-peak) at the generator centre, {member.reading}, "
            "without eccentricity")
        put(table, "phase", body.phase, "rad", "drawn" if body.phase else "reference")
    put(card["bodies"][1], "offset", machine.bodies[1].offset, "m", "drawn")
    write_card(card, path)
    return member


def main(path: Path) -> None:
    """Draw the family, judge it, and write the family's file and the card beside it.

    path: of the family's file.
    """
    def tell(what: str) -> Callable[[int, int], None]:
        return lambda done, of: print(f"{done}/{of} {what}", end="\r", flush=True)

    family = draw_family(progress=tell("draws"))
    save_family(family, path)
    print(f"{len(family.members)} members, {len(family.rejected)} rejected, written to {path.name}")
    judged = judge_family(family.members, tell("members"))
    if len(judged) < len(family.members):
        raise SystemExit(f"Stopped after {len(judged)} of {len(family.members)} members: no choice "
                         "is made and no card written.")
    unit = ship(choose(judged), path.parent / f"{FAMILY_CARD}.toml")
    print(f"{FAMILY_CARD} is member {unit.number}, {unit.reading}. Its fold moves, in % of the "
          "gap, by")
    for key, change in sensitivity(unit).items():
        print(f"  {key:24s} {change:+.4f}")


if __name__ == "__main__":
    main(family_file())
