"""The family put to the paper's claims, and the choice of the unit that ships.

Members were selected on the stated data alone (`hydrolab.calibration`). Here each is studied and judged, and
`python -m hydrolab.family` writes the card of the member that agrees with most claims. A member whose fold moves by
more than 0.1 % of the gap when a mass or an inertia grows by 1 % is passed over. Among equals the choice falls on the
one whose stable steady states reach furthest past the first fold, because there is most to show.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydrolab.calibration import Member, calibrate, family_file, load_family, sensitivity
from hydrolab.claims import judge
from hydrolab.dynamics.batch import Outcome, newton_batch, stack
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.cards import read_card, write_card
from hydrolab.machine.parts import Entry
from hydrolab.study import FAMILY_CARD, Study, run_study

LARGEST_SENSITIVITY = 0.1  # % of the gap for 1 % of a mass or an inertia

INERTIAS = ("generator_mass", "generator_gyration", "generator_shape", "turbine_mass", "turbine_gyration",
            "turbine_shape")


@dataclass(frozen=True)
class Verdicts:
    """What the study of one member found: its kind, which claims hold, or why it could not be studied.

    first_loss: eccentricity at which stability is lost before the first fold, or None. folds: fractions of the gap.
    stable_reach: largest eccentricity at which a steady state past the folds was found stable, or 0.
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
        return Verdicts(member, study.kind, {c.id: c.holds for c in judge(study)},
                        tuple(f.value for f in study.branch.folds), study.first_loss, stable_reach(study))
    except (BadInput, NoConvergence, Contact) as error:
        return Verdicts(member, "not studied", {}, failure=str(error))


def judge_family(members: Iterable[Member], progress: Callable[[int, int], None] | None = None,
                 workers: int | None = None) -> list[Verdicts]:
    """Judge members in parallel processes, in their order.

    An interrupt, or a process that dies, keeps what is done: fewer verdicts than members. Each process uses one BLAS
    thread, and ends at once at a Ctrl-C in the terminal, which all processes get.
    """
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


def family_orbits(members: Sequence[Member], static_eccentricity: float, *, harmonics: int = 4,
                  steps: int = 10) -> tuple[NDArray, NDArray]:
    """The steady states of all members at one eccentricity as one batch, raised to it in `steps` steps.

    Returns the coefficients of the generator's x and z, m, (members, 2, 2m + 1), nan where a member has none on its
    first leg, and an `Outcome` for each.
    """
    balance = HarmonicBalance(harmonics)
    machines = [member.machine() for member in members]
    batch = stack([balance.equations(machine.model(), machine.speed) for machine in machines])
    y = batch.linear
    outcome = np.zeros(len(batch), dtype=np.int8)
    for share in np.linspace(0, 1, steps + 1):
        centre = share * static_eccentricity * batch.law.gap * [1.0, 0.0]
        y, now = newton_batch(batch, y, centre)
        outcome = np.where(outcome == Outcome.CONVERGED, now, outcome)
    coefficients = batch.length[:, None, None] * y.reshape(len(y), 2, -1)
    coefficients[outcome != Outcome.CONVERGED] = np.nan
    return coefficients, outcome


def tally(verdicts: Iterable[Verdicts], claim: int) -> dict[str, dict[str, int]]:
    """How many members of each kind agree with a claim: {kind: {"agree": n, "of": n}}."""
    counts: dict[str, dict[str, int]] = {}
    for v in verdicts:
        row = counts.setdefault(v.kind, {"agree": 0, "of": 0})
        row["of"] += 1
        row["agree"] += int(v.holds.get(claim, False))
    return counts


def stable_reach(study: Study) -> float:
    """Largest eccentricity past the first fold at which a point of the later legs is stable; 0 if there is none."""
    if study.kind == "plain":
        return 0.0
    beyond = zip(study.branch.static_eccentricity, study.stability, strict=True)
    return max((float(value) for value, point in beyond if value > study.limit and point.verdict == "stable"),
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
    raise BadInput(f"on every member 1 % of a mass or an inertia moves the fold by over {LARGEST_SENSITIVITY} % of the gap.")


def rounded(value: float, digits: int = 4) -> float:
    """A number with so many significant digits."""
    return float(f"{value:.{digits}g}")


def ship(member: Member, path: Path) -> Member:
    """Write a member as the card `kaplan-150rpm`, its free data rounded to four digits and calibrated anew."""
    member = calibrate({key: rounded(value) for key, value in member.free.items()}, member.reading, member.number)
    if isinstance(member, str):
        raise BadInput(f"the rounded member cannot be calibrated: {member}.")
    machine, card = member.machine(), read_card(FAMILY_CARD)

    def put(table: dict[str, Any], key: str, value: Any, unit: str, note: str = "") -> None:
        table[key] = Entry(value, unit, "calibrated", note, value)

    card["about"] = (
        "A large vertical generator unit after the paper's Kaplan plant in the north of Brazil. What the paper states is "
        f"kept. Its Figure 1 is lost, so the rest is our own calibration and not the paper's: member {member.number} of "
        f"the family of hydrolab.calibration, with 200 µm counted {member.reading}, chosen because it agrees with most "
        "claims of the paper.")
    put(card["shaft"], "nodes", [rounded(y, 7) for y in machine.shaft.nodes], "m",
        "12 elements and 9.04 m: paper; guide bearing at node 1: puts the first fold at 8.925 %; thrust bearing at node 6 "
        "and turbine bearing at node 11: drawn")
    for table, body in zip(card["bodies"], machine.bodies, strict=True):
        put(table, "mass", body.mass / 1000, "t", "drawn")
        put(table, "Id", rounded(body.Id, 6), "kg m^2", "drawn, by its share of Ip")
        put(table, "Ip", rounded(body.Ip, 6), "kg m^2", "drawn, by its radius of gyration")
        put(table, "unbalance", rounded(body.unbalance, 6), "kg m",
            f"share drawn; size: 200 µm (0-to-peak) at the generator centre, {member.reading}, without eccentricity")
        put(table, "phase", body.phase, "rad", "drawn" if body.phase else "reference")
    put(card["bodies"][1], "offset", machine.bodies[1].offset, "m", "drawn")
    write_card(card, path)
    return member


if __name__ == "__main__":
    judged = judge_family(load_family().members, lambda done, of: print(f"{done}/{of} members", end="\r", flush=True))
    unit = ship(choose(judged), family_file().parent / f"{FAMILY_CARD}.toml")
    print(f"{FAMILY_CARD} is member {unit.number}, {unit.reading}. Its fold moves, in % of the gap, by")
    for key, change in sensitivity(unit).items():
        print(f"  {key:24s} {change:+.4f}")
