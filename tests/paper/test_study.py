"""The study from end to end: what it computes, what it claims, what it writes, and how it fails."""

from __future__ import annotations

import json
import math
import os
import time
from dataclasses import replace

import numpy as np
import pytest

from hydrolab import BadInput, CentralDifference, NoConvergence, integrate, load_machine, rpm
from hydrolab.cli import main
from hydrolab.dynamics.harmonics import PERIOD, ellipse, self_crossings
from hydrolab.figures.paper_figures import figure_7
from hydrolab.machine.bearings import JournalFilm, PadBearing
from hydrolab.machine.cards import card_text, vary
from hydrolab.machine.crack import Crack
from hydrolab.machine.elements import shaft_element
from hydrolab.machine.gap_shape import GapShape
from hydrolab.machine.pole_pairs import Poles
from hydrolab.machine.pull import ShapedPull
from hydrolab.paper.calibration import Verdicts, load_family
from hydrolab.paper.claims import CLAIMS, judge
from hydrolab.paper.report import machine_record, report
from hydrolab.paper.study import run_study, stable_steps, stress_fluctuation
from hydrolab.progress import progress_bar, progress_bars


@pytest.fixture(scope="module")
def study():
    """The shipped unit with a short integration: everything but claim 1 is as in the full study."""
    return run_study(load_machine("kaplan-150rpm"), revolutions=120, ramp=40)


@pytest.fixture(scope="module")
def claims(study):
    return judge(study)


def test_the_unit_is_the_one_the_paper_describes(study):
    machine = study.machine
    assert len(machine.shaft.nodes) == 13 and machine.shaft.length == 9.04
    assert machine.body("generator").offset == -0.472
    assert study.speed == pytest.approx(rpm(150), rel=1e-15)
    assert 0.0890 <= study.limit <= 0.0895
    assert study.scale == 1.0
    # 200 µm, counted with field, on a circle
    assert study.orbits[0.0].amplitudes[:, 0] == pytest.approx([200e-6, 200e-6], rel=1e-5)


def test_all_orbits_lie_on_the_first_leg(study):
    leg = study.branch.first_leg
    known = study.branch.static_eccentricity[leg], study.branch.amplitudes[leg, 0, 0]
    for percentage, orbit in study.orbits.items():
        assert orbit.static_eccentricity == pytest.approx(percentage / 100)
        assert orbit.amplitudes[0, 0] == pytest.approx(np.interp(percentage / 100, *known),
                                                       rel=0.02)
    growth = [orbit.amplitudes[0, 0] for orbit in study.orbits.values()]
    assert (np.diff(growth) > 0).all()


def test_every_claim_is_judged_with_numbers(claims):
    assert [c.id for c in claims] == list(range(1, 13)) and len(CLAIMS) == 12
    assert all(isinstance(c.holds, bool) and c.criterion and any(ch.isdigit() for ch in c.measured)
               for c in claims)


def test_the_sentence_about_stresses_is_printed_as_failed(claims):
    assert not claims[11].holds and "false" in claims[11].measured


def test_a_claim_fails_where_the_machine_is_plain(study):
    """Without field there is no 2X, no loop, no growth: the claims must say so."""
    linear = {p: replace(o, local=np.where(np.arange(9) < 3, o.local, 0.0))
              for p, o in study.orbits.items()}
    centred = study.orbits[0.0]
    linear = {p: replace(centred, static_eccentricity=o.static_eccentricity)
              for p, o in linear.items()}
    held = {c.id: c.holds for c in judge(replace(study, orbits=linear))}
    assert not any(held[i] for i in (2, 3, 4, 5, 7, 9, 10))


def test_a_falsified_integration_fails_claim_1(study, claims):
    moved = replace(study.check, positions=study.check.positions + 20e-6)
    assert not judge(replace(study, check=moved))[0].holds


def test_stress_of_a_static_bend_against_beam_theory():
    """A shaft bent statically while it turns: a fibre feels M c / I, fully reversed; a circular
    whirl feels nothing.
    """
    machine = vary(load_machine("kaplan-150rpm"), {"unbalance": 0.0, "field": 0.0})
    model = machine.model()
    load = np.array([1e5, 0.0])
    q = np.linalg.solve(model.K, model.selection.T @ load)
    from hydrolab import HarmonicBalance
    orbit = HarmonicBalance(1).solve(model, machine.speed)
    shaft = np.zeros((model.size, 3))
    shaft[:, 0] = q
    object.__setattr__(orbit, "shaft", shaft)  # cached_property of a frozen result
    # Above the guide bearing the moment grows from F·0.472 at the top to F·(0.472 + depth) at the
    # bearing.
    arm = 0.472 + machine.shaft.nodes[1]
    expected = load[0] * arm * (0.71 / 2) / (math.pi / 64 * 0.71**4)
    assert stress_fluctuation(machine.shaft, orbit) == pytest.approx(expected, rel=1e-6)


def test_ellipse_and_crossings_on_known_curves():
    circle = np.array([[0.0, 2.0, 0.0], [0.0, 0.0, 2.0]])  # x = 2 sin, z = 2 cos: forward
    e = ellipse(circle)
    assert (e.major, e.ratio, e.forward) == (2.0, 1.0, True)
    assert not ellipse(circle[::-1]).forward
    tilted = ellipse(np.array([[0.0, 3 * math.sin(0.3), math.cos(0.3)],
                               [0.0, 3 * math.cos(0.3), -math.sin(0.3)]]))
    assert (tilted.major, tilted.minor, tilted.angle) == pytest.approx((3.0, 1.0, 0.3))
    def limacon(b):
        return np.stack([np.sin(PERIOD) + b * np.sin(2 * PERIOD),
                         np.cos(PERIOD) + b * np.cos(2 * PERIOD)])
    assert self_crossings(limacon(0.4)) == 0 and self_crossings(limacon(0.7)) == 1
    # a figure of eight
    assert self_crossings(np.stack([np.sin(PERIOD + 0.01), np.sin(2 * PERIOD)])) == 1


def test_report_lets_another_code_rebuild_the_study(study, claims):
    """Rebuild the force balance from the JSON alone: the mean and 1X of the orbits solve the
    machine's equations.
    """
    record = json.loads(json.dumps(report(study, claims)))
    assert record["schema"] == 1 and record["branch"]["folds"][0] == pytest.approx(study.limit)
    machine = record["machine"]
    shaft, gap, damping = machine["shaft"], machine["air_gap"], machine["damping"]
    n = 4 * len(shaft["nodes"])
    M, G, K = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    area, second = math.pi * shaft["diameter"]**2 / 4, math.pi * shaft["diameter"]**4 / 64
    for i, length in enumerate(np.diff(shaft["nodes"])):
        at = slice(4 * i, 4 * i + 8)
        for matrix, part in zip((M, G, K), shaft_element(shaft["element"], length, shaft["young"],
                                                         shaft["density"], area,
                                                         second, shaft["poisson"],
                                                         shaft["shear_coefficient"]),
                                strict=True):
            matrix[at, at] += part
    force = np.zeros(n, dtype=complex)
    for body in machine["bodies"]:
        link = np.eye(4)
        link[0, 3], link[1, 2] = -body["offset"], body["offset"]
        at = slice(4 * body["node"], 4 * body["node"] + 4)
        spin = np.zeros((4, 4))
        spin[2, 3], spin[3, 2] = -body["Ip"], body["Ip"]
        M[at, at] += link.T @ np.diag([body["mass"], body["mass"], body["Id"], body["Id"]]) @ link
        G[at, at] += link.T @ spin @ link
        turning = body["unbalance"] * np.exp(1j * body["phase"])
        # sin(Ωt + ψ) and cos(Ωt + ψ) as Re(… e^{iΩt})
        force[at] += link[:2].T @ [-1j * turning, turning]
        if body["name"] == "generator":
            watch = np.zeros((2, n))
            watch[:, at] = link[:2]
    for bearing in machine["bearings"]:
        for dof in (0, 1):
            K[4 * bearing["node"] + dof, 4 * bearing["node"] + dof] += bearing["stiffness"]
            K[4 * bearing["node"] + 2 + dof,
              4 * bearing["node"] + 2 + dof] += bearing["tilt_stiffness"]
    C = damping["alpha"] * M + damping["beta"] * K
    w = machine["speed_rpm"] * math.pi / 30
    pull = math.pi * gap["field"]**2 * gap["mean_radius"] * gap["length"] / (4e-7 * math.pi
                                                                             * gap["gap"])
    law = ShapedPull(pull, gap["gap"], np.full(256, gap["gap"]))
    for orbit in (*record["orbits"], *record["further_orbits"]):
        phase = 2 * math.pi * np.arange(256) / 256
        series = [orbit[c]["mean"] + sum(a * np.cos(k * phase) + b * np.sin(k * phase)
                                         for k, (a, b) in enumerate(
            zip(orbit[c]["cos"], orbit[c]["sin"], strict=True), 1)) for c in "xz"]
        position = np.array(series) - np.array([[orbit["static_eccentricity"] * gap["gap"]], [0.0]])
        spectrum = np.fft.rfft(law.force(position), axis=1) / 256
        for k in range(5):
            load = watch.T @ spectrum[:, k] * (2 if k else 1) + (w**2 * force if k == 1 else 0)
            answer = watch @ np.linalg.solve(K - (k * w)**2 * M + 1j * k * w * (C + w * G), load)
            stated = [orbit[c]["cos"][k - 1] - 1j * orbit[c]["sin"][k - 1] if k
                      else orbit[c]["mean"] for c in "xz"]
            assert np.abs(answer - stated).max() < 1e-9


def test_the_study_of_a_machine_with_other_laws():
    """A stiffer basis gets more steps, and every claim is still judged and reported."""
    unit = load_machine("kaplan-150rpm")
    cracked = replace(unit, cracks=(Crack("crack", 2, 0.2),)).model()
    assert stable_steps(cracked, unit.speed) > 512
    study = run_study(replace(unit, air_gap=replace(unit.air_gap, tilt=True)), revolutions=6,
                      ramp=2)
    assert study.check.finished and stable_steps(study.model, study.speed) > 512
    judged = judge(study)
    assert len(judged) == len(CLAIMS)
    json.dumps(report(study, judged))


@pytest.mark.parametrize("changes", [
    {"poles": Poles(19, pole_angle=0.37)}, {"shapes": (GapShape("oval", "stator", 2, 3.1e-4,
                                                                0.77),)},
    {"air_gap": replace(load_machine("kaplan-150rpm").air_gap, tangential=0.123)},
    {"cracks": (Crack("crack", 2, 0.213),)},
    {"pad_bearings": (PadBearing("pads", 1, 8, 1.1e9, 1.7e-4),),
     "films": (JournalFilm("film", 11, 0.041, 0.4, 0.3, 2e-4),)}, {}],
                         ids=lambda changes: "+".join(changes) or "paper")
def test_the_report_has_every_number_of_the_machine(study, changes):
    """Each of `Machine.numbers` that is not zero, so that another code can rebuild a machine with
    other laws too.
    """
    machine = replace(study.machine, **changes)
    record = json.loads(json.dumps(machine_record(machine, study.model)))
    assert set(changes) <= set(record)

    def leaves(value):
        if isinstance(value, dict | list):
            return {leaf for v in (value.values() if isinstance(value, dict) else value)
                    for leaf in leaves(v)}
        return {value}
    written = leaves(record)
    for key, value in machine.numbers().items():
        if key != "speed":
            assert set(np.ravel(value).tolist()) - {0.0} <= written, key


def interrupted(at, *, revolutions=12):
    """A study that is interrupted in the third revolution of the integration at this percentage."""
    def tell(what, done, of):
        if what == f"direct integration at {at} %" and done == 3:
            raise KeyboardInterrupt
    return run_study(load_machine("kaplan-150rpm"), tell, revolutions=revolutions, ramp=4)


@pytest.mark.parametrize(("at", "left"), [(8.8, {1, 6}), (9.0, {6})])
def test_an_interrupt_is_no_verdict(at, left):
    """Neither a difference (claim 1) nor contact (claim 6) may be read from a motion that was cut
    off.
    """
    study = interrupted(at)
    assert study.interrupted and study.check.interrupted == (at == 8.8)
    claims = judge(study)
    assert {c.id for c in claims if c.holds is None} == left
    assert {c.id for c in claims if c.verdict == "not judged"} == left
    record = json.loads(json.dumps(report(study, claims)))
    # all that was computed is kept
    assert len(record["orbits"]) == 12 and len(record["branch"]["folds"]) == 3
    assert {c["id"] for c in record["claims"] if c["holds"] is None} == left
    assert (record["time_integration"]["beyond"] is None) == (at == 8.8)


def test_command_after_an_interrupt(tmp_path, capsys, monkeypatch):
    import hydrolab.paper.report as module
    monkeypatch.setattr(module, "run_study", lambda machine, tell: interrupted(8.8))
    assert main(["study", "--out", str(tmp_path), "--family"]) == 130
    printed = capsys.readouterr().out
    assert "not judged" in printed and "Stopped by Ctrl-C" in printed
    # no figure of a motion that was cut off
    assert [path.name for path in tmp_path.iterdir()] == ["report.json"]


def test_a_family_that_is_cut_short(tmp_path, capsys, study, monkeypatch):
    """An interrupt after two members, and a process that dies: what is done counts, and it is said
    how many.
    """
    import hydrolab.paper.report as module
    monkeypatch.setattr(module, "run_study", lambda machine, tell: study)
    monkeypatch.setattr(module, "sensitivity_table", lambda machine: "sensitivity")
    members = load_family().members
    two = [Verdicts(m, "plain", dict.fromkeys(range(1, 13), True)) for m in members[:2]]
    monkeypatch.setattr(module, "judge_family", lambda members, progress: two)
    assert main(["study", "--out", str(tmp_path), "--family", "--no-figures"]) == 130
    assert f"Stopped after 2 of {len(members)} members" in capsys.readouterr().out
    record = json.loads((tmp_path / "report.json").read_text())
    assert record["claims"][0]["family"] == {"plain": {"agree": 2, "of": 2}}


def test_the_family_belongs_to_the_shipped_card_alone(tmp_path, capsys):
    """A copy with other numbers under the old name is a machine of its own, whose family is not
    known.
    """
    copy = tmp_path / "mine.toml"
    copy.write_text(card_text("kaplan-150rpm").replace("field = {value = 0.5",
                                                       "field = {value = 0.45"), encoding="utf-8")
    assert main(["study", str(copy), "--family", "--out", str(tmp_path / "out")]) == 2
    assert "mine.toml; the family is one of the paper's machine" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_member_that_was_interrupted_has_no_verdict(monkeypatch):
    import hydrolab.paper.calibration as family
    study = interrupted(8.8)
    monkeypatch.setattr(family, "run_study", lambda machine: study)
    with pytest.raises(KeyboardInterrupt):
        family.judge_member(load_family().members[0])


def judge_or_die(member):
    """In a worker: all but the first member end their process."""
    if member.number:
        time.sleep(1)
        os._exit(1)
    return Verdicts(member, "plain", {})


def test_members_of_dead_workers_are_left_out(monkeypatch):
    import hydrolab.paper.calibration as family
    monkeypatch.setattr(family, "judge_member", judge_or_die)
    members = [replace(load_family().members[0], number=n) for n in (0, 1)]
    assert [v.member.number for v in family.judge_family(members, workers=1)] == [0]


def test_a_bar_follows_an_integration(monkeypatch):
    """What the bar shows is what `progress` was told, and it does not stay open after an interrupt.
    """
    shown = []
    monkeypatch.setattr("rich.progress.Progress.update", lambda self, task, completed: shown.append(
        (self.tasks[task].description, completed, self.tasks[task].total, self.live.is_started)))
    model = load_machine("jeffcott").model()
    with progress_bar("motion") as bar:
        integrate(model, CentralDifference(64), speed=rpm(150), revolutions=3, progress=bar)
    assert shown == [("motion", n, 3, True) for n in (1, 2, 3)]
    with pytest.raises(KeyboardInterrupt), progress_bars() as tell:
        tell("map [1/2]", 1, 2)
        bars = tell.__closure__
        raise KeyboardInterrupt
    assert shown[-1][1:3] == (1, 2)
    assert not next(c.cell_contents for c in bars
                    if hasattr(c.cell_contents, "live")).live.is_started


def test_command_writes_its_report(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    import hydrolab.paper.report as module
    monkeypatch.setattr(module, "run_study", lambda machine,
                        tell: run_study(machine, tell, revolutions=60, ramp=20))
    monkeypatch.setattr(module, "FAMILY_CARD", "jeffcott")  # quick, and some claims fail on it
    assert main(["study", "--out", str(tmp_path), "--no-figures"]) == 0
    record = json.loads((tmp_path / "report.json").read_text())
    assert record["machine"]["shaft"] is None and all(c["family"] is None for c in record["claims"])
    printed = capsys.readouterr().out
    assert "fails" in printed and "of 12 claims hold" in printed


def test_a_name_with_brackets_is_printed_as_it_stands(tmp_path, capsys, study, monkeypatch):
    """Rich takes brackets for markup: it would leave [red] out, and stumble over [/blue]."""
    import hydrolab.paper.report as module
    named = replace(study, machine=replace(study.machine, name="[red]unit[/blue]"))
    monkeypatch.setattr(module, "load_machine", lambda card: named.machine)
    monkeypatch.setattr(module, "run_study", lambda machine, tell: named)
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["study", "--out", str(tmp_path), "--no-figures"]) == 0
    printed = capsys.readouterr().out
    assert "claims hold on [red]unit[/blue]" in printed and "Criterion:" in printed
    assert "[dim]" not in printed


def test_a_part_s_name_is_no_formula(study):
    """Matplotlib takes what stands between two dollars for TeX."""
    guide, lower = study.machine.bearings
    named = replace(study.machine, bearings=(replace(guide, name=r"guide $\frac $"), lower))
    figure = figure_7(replace(study, machine=named)).figure
    figure.canvas.draw()
    assert any(r"guide \$\frac \$" in label.get_text() for axes in figure.axes
               for right in axes.child_axes
               for label in right.get_yticklabels())


@pytest.mark.parametrize(("edit", "words"), [
    (("value = 119.0", "value = -119.0"), "generator.mass"),
    (("node = 12", "node = 13"), "node"),
    (("[air_gap]", "[air_gaps]"), "air_gap"),
])
def test_a_bad_card_is_one_sentence(tmp_path, capsys, edit, words):
    card = tmp_path / "mine.toml"
    card.write_text(card_text("kaplan-150rpm").replace(*edit), encoding="utf-8")
    assert main(["study", str(card), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr()
    assert words in said.err and said.err.count("\n") == 1 and "Traceback" not in said.err


@pytest.mark.parametrize(("changes", "words"), [
    ({"unbalance": 0.0}, "no unbalance"), ({"speed": 0.0}, "turning rotor"),
    ({"field": 0.0}, "needs a field"),
    ({"speed": rpm(0.001)}, "more than 8192 steps")])
def test_what_cannot_be_studied(changes, words):
    with pytest.raises(BadInput, match=words):
        run_study(vary(load_machine("kaplan-150rpm"), changes))
    with pytest.raises(BadInput, match="no air_gap"):
        run_study(load_machine("three-disc"))
    with pytest.raises(BadInput, match="no damping"):  # not a pull too strong
        run_study(replace(load_machine("kaplan-150rpm"), damping=None))


def test_damping_is_not_taken_for_a_pull_too_strong():
    """Guide bearings of 5e7 N s/m, as journal bearings have: well damped, whatever is known of it.
    """
    unit = load_machine("kaplan-150rpm")
    damped = vary(unit, {f"bearings.{b.name}.damping": 5e7 for b in unit.bearings})
    study = run_study(damped, revolutions=4, ramp=2)
    assert study.limit == pytest.approx(0.1081, abs=1e-4) and study.first_loss is None


def test_an_unstable_machine_without_field_does_not_blame_the_pull():
    """Cross-coupling of 6e8 N/m and hardly any damping: forward whirl, field or not."""
    unit = replace(load_machine("kaplan-150rpm"), damping=None)
    whirling = vary(unit, {f"bearings.{b.name}.damping": 1e5 for b in unit.bearings}
                    | {"bearings.turbine guide bearing.stiffness": [[1.64e9, 6e8],
                                                                    [-6e8, 1.64e9]]})
    with pytest.raises(NoConvergence, match="even without field: its bearings or films"):
        run_study(whirling)


def test_nine_percent_always_lies_past_the_first_fold():
    """A first fold at 9.01 %, where the paper's 9.0 % would still be on the first leg."""
    study = run_study(vary(load_machine("kaplan-150rpm"), {"field": 0.49922}), revolutions=12,
                      ramp=4)
    assert 0.0900 < study.limit < 0.0902 and study.scale > 1
    assert study.eccentricity(8.9) < study.limit < study.eccentricity(9.0)
    assert all(orbit.static_eccentricity > study.limit for orbit, _ in study.beyond_orbits)
    claim = judge(study)[5]
    assert "past its folds" in claim.measured


def test_the_study_is_of_a_machine(study):
    with pytest.raises(BadInput, match="machine is a Model; it must be a Machine"):
        run_study(study.model)


def test_a_folder_that_cannot_be_written_says_so_first(tmp_path, capsys):
    (tmp_path / "out").write_text("a file")
    assert main(["study", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "cannot be written" in said and "--out" in said and said.count("\n") == 1


def test_a_field_too_strong_ends_in_a_sentence():
    with pytest.raises(NoConvergence, match="too strong for its bearings"):
        run_study(vary(load_machine("kaplan-150rpm"), {"field": 2.0}))
