"""What `hydrolab study` prints and writes: the claims beside the numbers, the figures, and
report.json.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from hydrolab.dynamics.branches import orbits_at
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.stability import floquet_all
from hydrolab.errors import BadInput
from hydrolab.machine.cards import load_machine
from hydrolab.machine.parts import Machine
from hydrolab.paper.claims import Claim, judge
from hydrolab.paper.study import FAMILY_CARD, REVOLUTIONS_BEYOND, Study, run_study
from hydrolab.progress import progress_bars

SCHEMA = 1
COLOURS = {"holds": "green", "fails": "red", "not judged": "yellow"}


def machine_record(study: Study) -> dict[str, Any]:
    """The machine in numbers, SI units, enough for another code to rebuild it."""
    machine, (alpha, beta) = study.machine, study.model.rayleigh
    shaft, gap = machine.shaft, machine.air_gap
    record: dict[str, Any] = {
        "name": machine.name, "speed_rpm": machine.speed * 30 / math.pi,
        "shaft": None if shaft is None else {
            "element": shaft.element, "diameter": one_or_list(shaft.diameter),
            "inner_diameter": one_or_list(shaft.inner_diameter), "density": shaft.density,
            "young": shaft.young,
            "poisson": shaft.poisson, "shear_coefficient": shaft.shear_coefficient,
            "nodes": shaft.nodes.tolist()},
        "bodies": [{"name": b.name, "node": b.node, "offset": b.offset, "mass": b.mass, "Id": b.Id,
                    "Ip": b.Ip,
                    "unbalance": b.unbalance, "phase": b.phase} for b in machine.bodies],
        "bearings": [{"name": b.name, "node": b.node, "stiffness": one_or_matrix(b.stiffness),
                      "damping": one_or_matrix(b.damping), "tilt_stiffness": 0.0}
                     for b in machine.bearings]
        + [{"name": b.name, "node": b.node, "stiffness": 0.0, "damping": 0.0,
            "tilt_stiffness": b.tilt_stiffness}
           for b in machine.thrust_bearings],
        "damping": {"ratio": one_or_list(machine.damping.ratio) if machine.damping else None,
                    "alpha": alpha,
                    "beta": beta},
        "air_gap": {"field": gap.field, "mean_radius": gap.mean_radius, "length": gap.length,
                    "gap": gap.gap,
                    **{key: value for key in ("tilt", "linear", "tangential")
                       if (value := getattr(gap, key))}}}
    # what the paper's machine does not have, where there is some
    for key in ("pad_bearings", "films", "cracks", "shapes"):
        if parts := getattr(machine, key):
            record[key] = [asdict(part) for part in parts]
    if machine.poles:
        record["poles"] = asdict(machine.poles)
    return record


def one_or_list(values: Iterable[float]) -> float | list[float]:
    """One number where all are the same, else the list."""
    values = [float(v) for v in values]
    return values[0] if len(set(values)) == 1 else values


def one_or_matrix(matrix: Any) -> float | list[list[float]]:
    """The scalar of an isotropic 2 × 2 matrix, else its rows."""
    isotropic = matrix[0, 0] == matrix[1, 1] and matrix[0, 1] == matrix[1, 0] == 0
    return float(matrix[0, 0]) if isotropic else matrix.tolist()


def orbit_record(orbit: PeriodicOrbit) -> dict[str, Any]:
    """Fourier coefficients of the generator centre, m: cos(kΩt) and sin(kΩt) for k = 1 … m."""
    rows = {name: {"mean": float(c[0]), "cos": c[2::2].tolist(), "sin": c[1::2].tolist()}
            for name, c in zip("xz", orbit.coefficients, strict=True)}
    return {"static_eccentricity": orbit.static_eccentricity, "harmonics": orbit.harmonics, **rows}


def further_orbits(study: Study) -> list[dict[str, Any]]:
    """Steady states off the first leg, at the study's eccentricities from 8 % up, each with its
    stability.
    """
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
    """The content of report.json. Axes and phases as in the README's conventions."""
    check, beyond = study.check, study.beyond
    return {
        "schema": SCHEMA,
        "machine": machine_record(study),
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
                           "stopped": check.stopped, **coefficients_record(check)},
            "beyond": None if beyond is None else {
                "static_eccentricity": beyond.static_eccentricity,
                "revolutions": beyond.revolutions,
                "revolutions_asked": REVOLUTIONS_BEYOND, "stopped": beyond.stopped}},
        "claims": [{"id": c.id, "claim": c.claim, "criterion": c.criterion, "measured": c.measured,
                    "holds": c.holds,
                    "family": family[c.id] if family else None} for c in claims]}


def coefficients_record(trajectory: Any) -> dict[str, Any]:
    """Mean and harmonics of the last revolution, as in `orbit_record`; none where it ended early.
    """
    if not trajectory.finished:
        return {}
    return {name: {"mean": float(c[0]), "cos": c[2::2].tolist(), "sin": c[1::2].tolist()}
            for name, c in zip("xz", trajectory.coefficients(4), strict=True)}


def claims_table(claims: Iterable[Claim], family: dict[int, Any] | None = None) -> Table:
    """The claims beside what was computed."""
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
    """The free data of the paper's machine: ranges they were drawn from, this unit's values, and
    what its fold does.
    """
    from hydrolab.paper.calibration import FREE, STEPS, member_of, sensitivity
    member = member_of(machine, "with field")
    changes = sensitivity(member)
    table = Table(title="What the paper does not say, and how the first fold depends on it",
                  title_justify="left",
                  caption="The 200 µm are kept. A centimetre of guide-bearing depth moves the fold "
                          "by about 0.3 % of the "
                          "gap on any unit, so equal elements, with bearings at 0.75 or 1.51 m, do "
                          "not fit.",
                  caption_justify="left")
    for name in ("datum", "drawn from", "this unit", "step", "fold moves, % of the gap"):
        table.add_column(name, justify="left" if name == "datum" else "right")
    for key, datum in FREE.items():
        table.add_row(datum.meaning, f"{datum.low:.6g} to {datum.high:.6g} "
                                     f"{datum.unit.removeprefix('1')}".strip(),
                      f"{member.free[key]:.6g}", STEPS[key].said, f"{changes[key]:+.4f}")
    table.add_row("depth of the guide bearing", "calibrated, m", f"{member.bearing_depth:.4g}",
                  "+1 cm",
                  f"{changes['guide_bearing_depth']:+.4f}")
    return table


def judged_family(tell: Any) -> tuple[dict[int, Any], int, int]:
    """How many members agree with each claim, by kind of branch; how many were judged, and of how
    many.
    """
    from hydrolab.paper.calibration import judge_family, load_family, tally
    members = load_family().members
    verdicts = judge_family(members, progress=lambda done, of: tell("family", done, of))
    return {claim: tally(verdicts, claim) for claim in range(1, 13)}, len(verdicts), len(members)


def study_command(card: str = FAMILY_CARD, *, out: Path = Path("hydrolab-study"),
                  family: bool = False,
                  draw: Callable[[Study], dict[str, Any]] | None = None) -> int:
    """Run the study on a card, print its claims, and write report.json and what `draw` makes of the
    study, pictures by name, into `out`.

    report.json is written before the family is run and again after it, so that an interrupt
    (Ctrl-C) loses nothing. Returns 0, or 130 after an interrupt: what was computed until then is
    printed and written. Raises BadInput for a bad card, or for --family with a card other than the
    paper's machine.
    """
    console = Console(markup=False, highlight=False)  # a machine's name may have brackets
    machine: Machine = load_machine(card)
    if family and str(card) != FAMILY_CARD:  # a copy may keep the name and change the numbers
        raise BadInput(f"--family was given with {card}; the family is one of the paper's machine, "
                       "the shipped card "
                       f"{FAMILY_CARD}.")
    out.mkdir(parents=True, exist_ok=True)
    pictures, counts, cut = {}, None, ""
    with progress_bars(console) as tell:
        study = run_study(machine, tell)
        claims = judge(study)
        write(out / "report.json", report(study, claims))
        if study.interrupted:
            cut = "Stopped by Ctrl-C in direct integration; what was computed before is above."
        else:
            if draw:
                pictures = draw(study)
                for name, picture in pictures.items():
                    picture.save(out / f"{name}.png")
            if family:
                counts, judged, members = judged_family(tell)
                if judged < members:
                    cut = f"Stopped after {judged} of {members} members of the family; these are counted above."
    if counts:
        write(out / "report.json", report(study, claims, counts))
    console.print(claims_table(claims, counts))
    if counts:
        console.print(sensitivity_table(machine))
    if study.scale != 1:
        console.print(f"The paper's percentages are stretched by {study.scale:.4g}: on this "
                      "machine the first fold is at "
                      f"{100 * study.limit:.3f} %, so its 8.8 % stands for "
                      f"{100 * study.eccentricity(8.8):.3f} %.")
    for picture in pictures.values():
        console.print(f"• {picture.reading}")
    held = sum(c.verdict == "holds" for c in claims)
    console.print(f"{held} of {len(claims)} claims hold on {machine.name}. Written to {out}: "
                  "report.json"
                  + (f" and {len(pictures)} figures." if pictures else "."))
    if cut:
        console.print(cut)
    return 130 if cut else 0


def write(path: Path, content: dict[str, Any]) -> None:
    """Write JSON whole or not at all."""
    part = path.with_suffix(".part")
    part.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    part.replace(path)
