"""What `hydrolab study` prints and writes: the claims beside the numbers, the figures, and
report.json.
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from rich.text import Text

from hydrolab.dynamics.branches import orbits_at
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.stability import floquet_all
from hydrolab.errors import BadInput
from hydrolab.machine.bearings import BEARINGS
from hydrolab.machine.cards import load_machine
from hydrolab.machine.model import Model
from hydrolab.machine.parts import Machine
from hydrolab.machine.quantities import Part, declared, simplest
from hydrolab.paper.calibration import (
    FREE,
    STEPS,
    judge_family,
    load_family,
    member_of,
    sensitivity,
    tally,
)
from hydrolab.paper.claims import Claim, judge
from hydrolab.paper.study import FAMILY_CARD, REVOLUTIONS_BEYOND, Study, run_study
from hydrolab.progress import progress_bars

SCHEMA = 1
COLOURS = {"holds": "green", "fails": "red", "not judged": "yellow"}


def machine_record(machine: Machine, model: Model) -> dict[str, Any]:
    """A machine and its model in numbers, SI units, enough for another code to rebuild it."""
    alpha, beta = model.rayleigh
    none = {"stiffness": 0.0, "damping": 0.0, "tilt_stiffness": 0.0}
    ratio = part_record(machine.damping) if machine.damping else {"ratio": None}
    record: dict[str, Any] = {
        "name": machine.name, "speed_rpm": machine.speed * 30 / math.pi,
        "shaft": part_record(machine.shaft) if machine.shaft else None,
        "bodies": [part_record(body) for body in machine.bodies],
        "bearings": [none | part_record(bearing)
                     for bearing in (*machine.bearings, *machine.thrust_bearings)],
        "damping": {**ratio, "alpha": alpha, "beta": beta},
        "air_gap": part_record(machine.air_gap) if machine.air_gap else None}
    # what the paper's machine does not have, where there is some
    for key in (*(kind.group for kind in BEARINGS[2:]), "cracks", "shapes", "loads", "bows"):
        if parts := getattr(machine, key):
            record[key] = [part_record(part) for part in parts]
    for key in ("poles", "gravity"):
        if part := getattr(machine, key):
            record[key] = part_record(part)
    return record


def part_record(part: Part) -> dict[str, Any]:
    """The declared fields of a part as JSON takes them: one number where all are the same."""
    values = {name: getattr(part, name) for name in declared(type(part))}
    return {name: np.asarray(simplest(value)).tolist() for name, value in values.items()}


def series_record(coefficients: NDArray) -> dict[str, Any]:
    """Fourier coefficients of x and z, (2, 2m + 1), m: mean, cos(kΩt) and sin(kΩt) for k = 1 … m.
    """
    return {name: {"mean": float(c[0]), "cos": c[2::2].tolist(), "sin": c[1::2].tolist()}
            for name, c in zip("xz", coefficients, strict=True)}


def orbit_record(orbit: PeriodicOrbit) -> dict[str, Any]:
    """Where an orbit is, and the motion of the generator centre."""
    return {"static_eccentricity": orbit.static_eccentricity, "harmonics": orbit.harmonics,
            **series_record(orbit.coefficients)}


def further_orbits(study: Study) -> list[dict[str, Any]]:
    """Steady states off the first leg at the eccentricities from 8 % up, with stability."""
    found = []
    for percentage in (8.0, 8.5, 8.8, 8.9, 9.0):
        value = study.eccentricity(percentage)
        legs = orbits_at(study.branch, value)
        further = legs[1:] if value < study.limit else legs
        found += [{**orbit_record(orbit), "stability": point.verdict}
                  for orbit, point in zip(further, floquet_all(further), strict=True)]
    return found


def report(study: Study, claims: Iterable[Claim],
           family: dict[int, Any] | None = None) -> dict[str, Any]:
    """The content of report.json; axes and phases as the README says. family: counts by claim."""
    check, beyond = study.check, study.beyond
    return {
        "schema": SCHEMA,
        "machine": machine_record(study.machine, study.model),
        "orbits": [orbit_record(o) for o in study.orbits.values()],
        "further_orbits": further_orbits(study),
        "branch": {"static_eccentricity": study.branch.static_eccentricity.tolist(),
                   "folds": [f.value for f in study.branch.folds], "stopped": study.branch.stopped,
                   "kind": study.kind,
                   "stability_lost_at": study.first_loss,
                   "natural_continuation": study.natural.stopped},
        "time_integration": {
            "method": type(check.method).__name__,
            "steps_per_revolution": check.method.steps_per_revolution,
            "modes_and_static_deflections": check.model.size, "truncation_error": study.truncation,
            "validation": {"static_eccentricity": check.static_eccentricity,
                           "revolutions": check.revolutions,
                           "stopped": check.stopped,
                           # the last revolution; none where it ended early
                           **(series_record(check.coefficients(4)) if check.finished else {})},
            "beyond": None if beyond is None else {
                "static_eccentricity": beyond.static_eccentricity,
                "revolutions": beyond.revolutions,
                "revolutions_asked": REVOLUTIONS_BEYOND, "stopped": beyond.stopped}},
        "claims": [{"id": c.id, "claim": c.claim, "criterion": c.criterion, "measured": c.measured,
                    "holds": c.holds,
                    "family": family[c.id] if family else None} for c in claims]}


def claims_table(claims: Iterable[Claim], family: dict[int, Any] | None = None) -> Table:
    """The claims beside what was computed, and how the family agrees."""
    table = Table(title="The paper's claims, and what was computed", show_lines=True,
                  title_justify="left")
    table.add_column("", justify="right")
    table.add_column("Claim and criterion", ratio=5)
    table.add_column("Measured", ratio=5)
    table.add_column("Verdict", no_wrap=True)
    if family:
        table.add_column("Family", ratio=2)
    for c in claims:
        row = [Text(str(c.id)), Text.assemble(f"{c.claim}\n",
                                              (f"Criterion: {c.criterion}.", "dim")),
               Text(c.measured),
               Text(c.verdict, COLOURS[c.verdict])]
        if family:
            row.append(Text("\n".join(f"{kind}: {n['agree']} of {n['of']}"
                                      for kind, n in family[c.id].items())))
        table.add_row(*row)
    return table


def sensitivity_table(machine: Machine) -> Table:
    """The free data of the paper's machine: ranges, this unit's values, what its fold does."""
    member = member_of(machine, "with field")
    changes = sensitivity(member)
    table = Table(title="What the paper does not say, and how the first fold depends on it",
                  title_justify="left",
                  caption="The 200 µm are kept. A centimetre of guide-bearing depth moves the "
                          "fold by about 0.3 % of the gap on any unit, so equal elements, with "
                          "bearings at 0.75 or 1.51 m, do not fit.", caption_justify="left")
    for name in ("datum", "drawn from", "this unit", "step", "fold moves, % of the gap"):
        table.add_column(name, justify="left" if name == "datum" else "right")
    for key, datum in FREE.items():
        table.add_row(datum.meaning, f"{datum.low:.6g} to {datum.high:.6g} "
                                     f"{datum.unit.removeprefix('1')}".strip(),
                      f"{member.free[key]:.6g}", STEPS[key].said, f"{changes[key]:+.4f}")
    table.add_row("depth of the guide bearing", "calibrated, m", f"{member.bearing_depth:.4g}",
                  "+1 cm", f"{changes['guide_bearing_depth']:+.4f}")
    return table


def judged_family(tell: Any) -> tuple[dict[int, Any], int, int]:
    """How many members agree with each claim, by kind of branch; how many of all were judged."""
    members = load_family().members
    verdicts = judge_family(members, progress=lambda done, of: tell("family", done, of))
    return {claim: tally(verdicts, claim) for claim in range(1, 13)}, len(verdicts), len(members)


def study_command(*, out: Path, family: bool = False,
                  draw: Callable[[Study], dict[str, Any]] | None = None) -> int:
    """Run the study on the paper's machine, print its claims, and write report.json and what `draw`
    makes of the study, pictures by name, into `out`. family: whether to judge the family too.

    report.json is written before the family is run and again after it, so that an interrupt
    (Ctrl-C) loses nothing. Returns 0, or 130 after an interrupt: what was computed until then is
    printed and written. Raises BadInput where `out` cannot be written.
    """
    console = Console(markup=False, highlight=False)  # a machine's name may have brackets
    machine = load_machine(FAMILY_CARD)
    prepare(out)
    pictures: dict[str, Any] = {}
    counts, cut = None, ""
    with progress_bars(console) as tell:
        study = run_study(machine, tell)
        claims = judge(study)
        write(out / "report.json", report(study, claims))
        if study.interrupted:
            cut = "Stopped by Ctrl-C in direct integration; what was computed before is above."
        elif draw:
            pictures = draw(study)
            for name, picture in pictures.items():
                picture.save(out / f"{name}.png")
        if family and not cut:
            counts, judged, members = judged_family(tell)
            write(out / "report.json", report(study, claims, counts))
            if judged < members:
                cut = (f"Stopped after {judged} of {members} members of the family; these are "
                       "counted above.")
    console.print(claims_table(claims, counts))
    if counts:
        console.print(sensitivity_table(machine))
    for line in (*summary(study, claims, pictures, out), cut):
        if line:
            console.print(line)
    return 130 if cut else 0


def summary(study: Study, claims: Sequence[Claim], pictures: dict[str, Any],
            out: Path) -> list[str]:
    """What is said below the claims: the readings of pictures, and what was written where."""
    lines = [f"• {picture.reading}" for picture in pictures.values()]
    held = sum(c.verdict == "holds" for c in claims)
    figures = f" and {len(pictures)} figures." if pictures else "."
    return [*lines, f"{held} of {len(claims)} claims hold on {study.machine.name}. Written to "
                    f"{out}: report.json{figures}"]


def prepare(out: Path) -> None:
    """Make the folder and see that it can be written before a study that takes a minute.

    Raises BadInput where not.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise BadInput(f"{out} cannot be written ({error.strerror or error}); give another folder "
                       "with --out.") from None


def write(path: Path, content: dict[str, Any]) -> None:
    """Write a content as JSON, whole or not at all."""
    part = path.with_suffix(".part")
    part.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    part.replace(path)
