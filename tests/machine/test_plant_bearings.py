"""Bearings as plants have them: tables over the speed, seals, brackets, clearance, water, units and
the other sense of rotation, each against a formula or another way to the same machine.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from hydrolab import (
    BadInput,
    HarmonicBalance,
    Newmark,
    campbell,
    critical_speeds,
    follow,
    integrate,
    load_machine,
    modes,
    rpm,
    vary,
)
from hydrolab.dynamics.stability import floquet
from hydrolab.machine.bearings import Bush, RadialBearing, Seal, TableBearing, ThrustBearing
from hydrolab.machine.cards import machine_from_card, read_card, write_card
from hydrolab.machine.loads import Load
from tests.machines import MACHINES

POINT = load_machine("jeffcott")
UNIT = load_machine("kaplan-150rpm")
MASS, U = POINT.bodies[0].mass, POINT.bodies[0].unbalance
ROWS = TableBearing("oil", 1, [0.0, 10.0, 20.0, 60.0], [2e9, 1.4e9, [1.2e9, 1e8, -2e8, 1.5e9], 1e9],
                    [1e6, 1e6, 2e6, 2e6])


def point(*bearings, **parts):
    """A point mass on these bearings, without a field."""
    return replace(POINT, bearings=tuple(b for b in bearings if isinstance(b, RadialBearing)),
                   seals=tuple(b for b in bearings if isinstance(b, Seal)),
                   tables=tuple(b for b in bearings if isinstance(b, TableBearing)),
                   air_gap=None, **parts)


def tabled(table=ROWS):
    return replace(UNIT, bearings=UNIT.bearings[1:], tables=(table,))


def frozen_at(speed):
    """The same unit with the bearing that its table gives at one speed."""
    stiffness, damping = ROWS.matrices(speed)
    return replace(UNIT, bearings=(RadialBearing("oil", 1, stiffness, damping), *UNIT.bearings[1:]))


@pytest.mark.parametrize("speed", [0.1, 15.0, 20.0, 47.0])
def test_a_table_is_the_bearing_at_each_speed(speed):
    one, other = tabled().model(), frozen_at(speed).model()
    # damping of the shaft is a property of the machine as rated
    other = replace(other, C=one.at(speed).C)
    assert one.at(speed).K == pytest.approx(other.K)
    assert np.allclose(modes(one, speed).eigenvalues, modes(other, speed).eigenvalues, rtol=1e-9)
    method = HarmonicBalance(4)
    orbits = [method.solve(model, speed, 0.01) for model in (one, other)]
    assert orbits[0].local == pytest.approx(orbits[1].local, rel=1e-9, abs=1e-15)
    assert floquet(orbits[0]).multipliers == pytest.approx(floquet(orbits[1]).multipliers, rel=1e-6)
    for name, force in orbits[0].bearing_forces.items():
        assert force.static == pytest.approx(orbits[1].bearing_forces[name].static, abs=1e-3)


def test_verbs_over_the_speed_follow_the_table():
    model, speed = tabled().model().with_field(0.0), 30.0
    branch = follow(model, "speed", to=speed, speed=UNIT.speed)
    alone = HarmonicBalance(4).solve(
        replace(frozen_at(speed).model().with_field(0.0), C=model.at(speed).C), speed)
    assert branch[-1].coefficients == pytest.approx(alone.coefficients, abs=1e-10)
    found = critical_speeds(model)
    assert len(found) and "tables of its bearings go" in str(found)
    for critical, shape in zip(found.speeds, found.shapes.T, strict=True):
        there = critical_speeds(model.at(critical).on_basis(np.eye(model.size)))
        assert np.abs(there.speeds - critical).min() < 1e-6 * critical and shape.any()
    damped = replace(model, C=1e-6 * model.C)
    meets = campbell(damped, np.linspace(1.0, 59.0, 30), branches=6)
    for critical in meets.critical.speeds:  # by its diagram
        assert np.abs(modes(damped, critical).frequencies - critical).min() < 1e-3 * critical
    motion = integrate(model, Newmark(256), speed=speed, start=branch[-1], revolutions=2)
    away = motion.positions - branch[-1].positions(motion.phases)
    assert np.abs(away).max() < 2e-6


def test_beyond_the_table_nothing_is_said():
    model = tabled().model()
    with pytest.raises(BadInput, match=r"table from 0 to 572.958 rpm; it says nothing at 600 rpm"):
        HarmonicBalance(2).solve(model, rpm(600))
    with pytest.raises(BadInput, match="so add a row"):
        vary(tabled(), {"speed": rpm(600)})
    branch = follow(model.with_field(0.0), "speed", to=rpm(600), speed=rpm(560))
    assert branch.values[-1] == pytest.approx(60.0, rel=1e-4)
    assert "No further point" in branch.stopped and "says nothing at" in branch.stopped


def test_a_number_of_a_table_unit_is_followed_at_another_speed():
    model = tabled().model()
    branch = follow(model, "bodies.generator.mass", to=1.3e5, speed=20.0)
    heavier = vary(tabled(), {"bodies.generator.mass": 1.3e5}).model()
    alone = HarmonicBalance(4).solve(replace(heavier, C=model.C), 20.0)
    assert branch[-1].coefficients == pytest.approx(alone.coefficients, rel=1e-6, abs=1e-12)


def test_a_table_comes_from_rows_or_a_file(tmp_path):
    card = read_card("kaplan-150rpm")
    del card["bearings"][0]["stiffness"]
    rows = "speed [rpm];kxx [MN/m];kxz [MN/m];kzx [MN/m];kzz [MN/m];cxx [kN s/m];czz [kN s/m]\n" \
           "0;1400,5;0;0;1400,5;900;900\n300;1200;100;-200;1300;800;800\n"
    (tmp_path / "guide.csv").write_text(rows, encoding="utf-8")
    card["bearings"][0]["speeds"] = {"value": [0, 300], "unit": "rpm", "source": "assumed"}
    card["bearings"][0]["stiffness_rows"] = {
        "value": [[1400.5, 0, 0, 1400.5], [1200, 100, -200, 1300]], "unit": "MN/m",
        "source": "assumed"}
    card["bearings"][0]["damping_rows"] = {"value": [900, 800], "unit": "kN s/m",
                                           "source": "assumed"}
    stated = write_card(card, tmp_path / "rows.toml")
    text = (tmp_path / "rows.toml").read_text(encoding="utf-8").split("\n")
    start = next(i for i, line in enumerate(text) if line.startswith("speeds"))
    end = next(i for i, line in enumerate(text) if line.startswith("damping_rows"))
    text[start:end + 1] = ['table = "guide.csv"']
    (tmp_path / "file.toml").write_text("\n".join(text), encoding="utf-8")
    one, other = (m.tables[0].matrices(12.0) for m in (stated, load_machine(tmp_path /
                                                                            "file.toml")))
    for mine, its in zip(one, other, strict=True):
        assert mine == pytest.approx(its)
    (tmp_path / "guide.csv").write_text("speed,kxx\n0,1\n", encoding="utf-8")
    with pytest.raises(BadInput, match=r"guide.csv begins with .* each kind in one unit"):
        load_machine(tmp_path / "file.toml")
    (tmp_path / "file.toml").write_text("\n".join(text).replace("guide.csv", "../guide.csv"),
                                        encoding="utf-8")
    with pytest.raises(BadInput, match="CSV file in the folder of the card"):
        load_machine(tmp_path / "file.toml")


def test_eight_coefficients_go_with_a_damping_ratio():
    """By the symmetric part: the ratio of the shaft is that of the same unit without cross terms.
    """
    cross = replace(UNIT.bearings[0], stiffness=np.array([[1.37e9, 3e8], [-3e8, 1.37e9]]))
    model = replace(UNIT, bearings=(cross, UNIT.bearings[1])).model()
    assert model.rayleigh == pytest.approx(UNIT.model().rayleigh)


@pytest.mark.parametrize("cross, sense", [(2e6, "forward"), (-2e6, "backward")])
def test_a_seal_drives_the_whirl_that_its_sign_says(cross, sense):
    k, kd = 1e8, -3e7
    model = point(RadialBearing("spring", 0, k), Seal("seal", 0, kd, cross, added_mass=2e3)).model()
    found = modes(model, 10.0)
    natural = np.sqrt((k + kd + 1j * np.array([1, -1]) * cross) / (MASS + 2e3))
    assert sorted(found.eigenvalues.real) == pytest.approx(sorted(natural.imag), rel=1e-9)
    growing = found.direction[int(found.eigenvalues.real.argmax())]
    assert growing == sense
    # damping c Ω against κ: the border of stability of a whirling rotor
    at = math.sqrt((k + kd) / (MASS + 2e3))
    held = point(RadialBearing("spring", 0, k), Seal("seal", 0, kd, cross, 1.01 * abs(cross) / at,
                                                     added_mass=2e3)).model()
    assert modes(held, 10.0).eigenvalues.real.max() < 0


def test_a_bracket_is_a_mass_between_two_springs():
    kb, mb, cb, k = 8e8, 1.2e4, 3e6, 1.37e9
    plain = UNIT.bearings[0]
    stand = replace(plain, bracket_stiffness=kb, bracket_mass=mb, bracket_damping=cb)
    unit = replace(UNIT, bearings=(stand, UNIT.bearings[1]), damping=None).model().with_field(0)
    speed = 20.0
    orbit = HarmonicBalance(1).solve(unit, speed)
    # eliminated by hand at this frequency
    series = k - k * k / (k + kb - mb * speed**2 + 1j * speed * cb)
    soft = replace(UNIT, bearings=(replace(plain, stiffness=series.real,
                                           damping=series.imag / speed), UNIT.bearings[1]),
                   damping=None).model().with_field(0)
    alone = HarmonicBalance(1).solve(soft, speed)
    assert orbit.node_coefficients(12) == pytest.approx(alone.node_coefficients(12), rel=1e-7,
                                                        abs=1e-15)
    assert orbit.bearing_forces["generator guide bearing"].first == pytest.approx(
        alone.bearing_forces["generator guide bearing"].first, rel=1e-7)
    assert len(modes(unit, speed).whirl) == len(modes(soft, speed).whirl) + 2
    nodes = unit.at_nodes(orbit.shaft)
    assert nodes.shape[:2] == (13, 4) and len(unit.shaft_map) == 54


def test_a_bracket_in_time_and_on_a_basis():
    stand = replace(UNIT.bearings[0], bracket_stiffness=8e8, bracket_mass=1.2e4, x=1e-4)
    model = replace(UNIT, bearings=(stand, UNIT.bearings[1])).model()
    orbit = HarmonicBalance(5).solve(model, UNIT.speed, 0.01)
    motion = integrate(model, Newmark(512), speed=UNIT.speed, start=orbit, static_eccentricity=0.01,
                       revolutions=2)
    assert np.abs(motion.positions - orbit.positions(motion.phases)).max() < 1e-6


def test_water_moves_but_is_not_carried():
    from hydrolab.machine.loads import Gravity
    wet = point(RadialBearing("spring", 0, 1e8), gravity=Gravity(9.81),
                bodies=(replace(POINT.bodies[0], added_mass=3e4),)).model()
    orbit = HarmonicBalance(1).solve(wet, 10.0)
    assert orbit.mean[1] == pytest.approx(-MASS * 9.81 / 1e8)
    size = U * 100.0 / (1e8 - (MASS + 3e4) * 100.0)
    assert orbit.amplitudes[0, 0] == pytest.approx(abs(size))


def test_a_clearance_holds_beyond_it_only():
    """A circular whirl in a bush: k (r − c) = m Ω² (r + e), the corner rounded."""
    c, k = 1e-4, 3e8
    speed = 0.5 * math.sqrt(k / MASS)
    model = point(RadialBearing("bush", 0, k, clearance=c)).model()
    r = 3 * c
    law = Bush((k, 0.0, 0.0, k), c, 1e-3 * c, k)
    force = law.force(np.array([0.0, r])) - [0, k * r]
    assert force == pytest.approx([0, -k * (r - c)], rel=1e-3, abs=1e-9)
    loaded = replace(point(RadialBearing("bush", 0, k, damping=1e6, clearance=c)),
                     loads=(Load("side", 0, 5e5),), bodies=(replace(POINT.bodies[0], unbalance=0),))
    rest = HarmonicBalance(2).solve(loaded.model(), speed).mean
    assert rest[1] == pytest.approx(5e5 / k + c, rel=5e-3)
    assert model.law.parts[1].law.clearance == c
    u = np.array([[2e-5, 1.1e-4], [1e-5, 3e-5]])
    slope = law.linearise(u)[1]
    for j in (0, 1):
        step = np.zeros((2, 1))
        step[j] = 1e-10
        by = (law.force(u + step) - law.force(u - step)) / 2e-10
        assert slope[:, j] == pytest.approx(by, rel=1e-4, abs=1e-3 * k)


def test_tilt_has_damping_and_two_stiffnesses():
    collar = ThrustBearing("collar", 6, [5e8, 9e8], 2e6)
    model = replace(UNIT, thrust_bearings=(collar,), damping=None).model()
    bare = replace(UNIT, thrust_bearings=(), damping=None).model()
    assert np.diag(model.K - bare.K)[26:28] == pytest.approx([5e8, 9e8])
    assert np.diag(model.C)[26:28] == pytest.approx([2e6, 2e6])


@pytest.mark.parametrize("name", ["loaded", "pads, crack and oval stator", "tabled", "many pole "
                                  "pairs", "shaped turning rotor"])
def test_the_other_sense_of_rotation_is_a_mirror(name):
    machine = tabled() if name == "tabled" else MACHINES[name]()
    other = machine.reversed()
    twice = other.reversed()
    assert all(np.array_equal(twice.numbers()[k], v) for k, v in machine.numbers().items())
    # turned by hand: backward in time is the other sense, so the mirrored forces are the machine's
    one, its = machine.model(), other.model()
    mirror = np.diag(np.resize([-1.0, 1.0, 1.0, -1.0], one.size))
    assert its.K == pytest.approx(mirror @ one.K @ mirror)
    assert its.M == pytest.approx(one.M) and its.G == pytest.approx(one.G)
    assert its.static == pytest.approx(mirror @ one.static)
    u = 1e-4 * np.random.default_rng(1).standard_normal((len(one.selection), 5))
    turned = np.diag(np.resize([-1.0, 1.0], len(u)))
    phase = np.linspace(0.3, 5.0, 5)
    rate = 0.01 * u if machine.films else None
    assert its.law.force(turned @ u, rate, phase, 10.0) == pytest.approx(
        turned @ one.law.force(u, rate, -phase, 10.0), rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("path, unit, value, expected", [
    ("mass", "lb", 1000, 453.59237), ("mass", "t", 100, 1e5),
    ("Ip", "t m^2 GD2", 400, 1e5), ("Id", "t m^2", 80, 8e4), ("offset", "in", 10, 0.254),
    ("unbalance", "g mm", 2e9, 2e3)])
def test_units_of_machine_data(path, unit, value, expected):
    card = read_card("kaplan-150rpm")
    card["bodies"][0] |= {
        "mass": {"value": 119, "unit": "t", "source": "assumed"}, "Ip": {
            "value": 100, "unit": "t m^2", "source": "assumed"}, "Id": {
            "value": 80, "unit": "t m^2", "source": "assumed"}}
    card["bodies"][1]["unbalance"]["value"] = 0
    card["bodies"][0]["unbalance"]["value"] = 1
    if path == "mass" and unit == "lb":
        card["bodies"][0] |= {"Ip": {"value": 300, "unit": "kg m^2", "source": "assumed"},
                              "Id": {"value": 200, "unit": "kg m^2", "source": "assumed"}}
    card["bodies"][0][path] = {"value": value, "unit": unit, "source": "assumed"}
    assert getattr(machine_from_card(card).bodies[0], path) == pytest.approx(expected)


@pytest.mark.parametrize("unit, size", [("GN/m", 1e9), ("MN/m", 1e6), ("kN/mm", 1e6),
                                        ("N/µm", 1e6), ("lbf/in", 175.126835)])
def test_units_of_stiffness(unit, size):
    card = read_card("kaplan-150rpm")
    card["bearings"][0]["stiffness"] = {"value": 2, "unit": unit, "source": "assumed"}
    assert machine_from_card(card).bearings[0].stiffness[0, 0] == pytest.approx(2 * size)


@pytest.mark.parametrize("made, said", [
    (lambda: replace(UNIT.bearings[0], bracket_stiffness=1e9), "a bracket has both"),
    (lambda: replace(ROWS, speeds=[0.0, 10.0, 5.0, 60.0]), "two speeds or more, ascending"),
    (lambda: replace(ROWS, speeds=[0.0, 10.0]), "has 4 rows; bearings.oil.speeds has 2"),
    (lambda: replace(ROWS, damping_rows=[[1, 2], [1, 2]]), "one number or four"),
    (lambda: point(RadialBearing("a", 0, 1e8, bracket_stiffness=1e9, bracket_mass=1.0)),
     "needs a shaft")])
def test_what_cannot_be_is_refused(made, said):
    with pytest.raises(BadInput, match=said):
        made()
