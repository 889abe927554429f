"""The report on a unit: complete, self-contained, and judged by no paper's claims."""

import json
import math
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from hydrolab import HarmonicBalance, card_names, card_text, load_machine
from hydrolab.cli import main
from hydrolab.figures.rotor import cylinder, unit_picture
from hydrolab.machine.parts import RigidBody

VOID = {"meta", "img", "br"}


class Elements(HTMLParser):
    """Its elements, and those that are open at the end."""

    def __init__(self, page):
        super().__init__()
        self.open, self.seen, self.words = [], [], []
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.seen.append((tag, dict(attributes)))
        self.open += [] if tag in VOID else [tag]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


@pytest.mark.parametrize("card", ["kaplan-150rpm", "two-pole"])
def test_a_report_has_every_number_and_asks_no_other_computer(card, tmp_path):
    out = tmp_path / "unit.html"
    assert main(["report", card, "--out", str(out), "--runaway", "9000"]) == 0
    page = out.read_text(encoding="utf-8")
    elements = Elements(page)
    assert not elements.open
    assert not re.search(r"https?:|url\(|@import|<script|<link", page)
    pictures = [attributes for tag, attributes in elements.seen if tag == "img"]
    assert all(p["src"].startswith("data:image/svg") and len(p["alt"]) > 40 for p in pictures)
    machine = load_machine(card)
    assert {key for key, *_ in machine.rows()} <= set(elements.words)
    assert any("9000 rpm" in words for words in elements.words)
    titles = [words for words in elements.words if words.startswith(("Critical", "Bearings"))]
    assert "Critical speeds" in titles and ("Bearings" in titles) == (card != "two-pole")


def test_a_record_stands_beside_the_card(tmp_path):
    """The card's own motion, stored as two probes see it: record and model are one."""
    machine = load_machine("jeffcott")
    orbit = HarmonicBalance(8).solve(machine.model(), machine.speed)
    phase = np.arange(3600) * 2.0
    x, z = 1e6 * orbit.positions(np.radians(phase))
    rows = [f"{p:g},150,{a:.6f},{b:.6f}" for p, a, b in zip(phase, x, z, strict=True)]
    stored = tmp_path / "record.csv"
    stored.write_text("\n".join(["phase [deg],speed [rpm],generator x [µm],generator z [µm]",
                                *rows]), encoding="utf-8")
    out = tmp_path / "unit.html"
    assert main(["report", "jeffcott", "--out", str(out), "--record", str(stored)]) == 0
    page = out.read_text(encoding="utf-8")
    assert "1X is 200.0 µm at the generator, 200.0 by the model" in page
    assert "the worst minute" in page.lower() and "In the load rejection" not in page


def test_a_unit_of_one_s_own_is_not_judged_by_the_paper(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["study", "jeffcott", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "claims hold" not in printed and "8.8 %" not in printed
    assert "7.83 % of the gap" in printed and "G 5.76" in printed
    record = json.loads((tmp_path / "report.json").read_text())
    assert {one["kept"] for one in record["answers"]} == {True, None}
    assert (tmp_path / "report.html").is_file()


def test_a_name_is_no_markup(tmp_path, capsys):
    own = tmp_path / "mine.toml"
    own.write_text(card_text("jeffcott").replace('name = "jeffcott"', 'name = "<b>$[red]"'),
                   encoding="utf-8")
    assert main(["report", str(own), "--out", str(tmp_path / "a.html")]) == 0
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert "<b>" not in page and "&lt;b&gt;$[red]" in page


@pytest.mark.parametrize(("arguments", "words"), [
    (["jeffcott", "--out", "page.pdf"], "its name ends in .html"),
    (["jeffcott", "--out", "page.html", "--overspeed", "-3"], "overspeed is -0.3"),
    (["no-such", "--out", "page.html"], "is not a shipped card"),
])
def test_what_cannot_be_reported_is_a_sentence(arguments, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["report", *arguments]) == 2
    assert words in capsys.readouterr().err


def test_a_body_is_drawn_as_the_cylinder_of_its_mass_and_inertias():
    """By quadrature over a cylinder of steel 2 m across and 0.7 m high."""
    r = np.linspace(0, 1, 20001)
    y = np.linspace(-0.35, 0.35, 2001)
    mass = 7850 * math.pi * 0.7
    polar = 7850 * 0.7 * 2 * math.pi * np.trapezoid(r**3, r)
    across = polar / 2 + 7850 * math.pi * np.trapezoid(y**2, y)
    body = RigidBody("disc", 0, mass, across, polar)
    assert cylinder(body) == pytest.approx((1.0, 0.7), rel=1e-6)


@pytest.mark.parametrize("card", card_names())
def test_a_section_names_every_part_and_lies_where_the_shaft_lies(card):
    machine = load_machine(card)
    picture = unit_picture(machine)
    axes = picture.figure.axes[0]
    written = {text.get_text().strip().split(",")[0] for text in axes.texts}
    assert written == {part.name for part in (*machine.bodies, *machine.all_bearings,
                                              *machine.loads)}
    (left, right), (low, high) = axes.dataLim.intervalx, axes.dataLim.intervaly
    if machine.shaft is not None and machine.gravity is not None:
        assert right - left > machine.shaft.length
    elif machine.shaft is not None:
        assert high - low > machine.shaft.length
