"""Records: orders come back from every kind of file, with the uncertainty they have; bad files get
a sentence.
"""

import math

import numpy as np
import pytest

from hydrolab import BadInput, HarmonicBalance, load_machine, made_up_record, read_record, rpm
from hydrolab.dynamics.harmonics import ellipse, fourier_rows
from hydrolab.dynamics.probes import Probe, ProbeRecord

ANGLES = math.radians(30), math.radians(100)  # not at a right angle
SPEED = rpm(150)
# [mean, sin ½, cos ½, sin 1, cos 1, …] of x and z, µm
TRUE = np.zeros((2, 17))
TRUE[0, :9] = 120, 2, -1, 180, 40, 0, 0, 5, -3
TRUE[1, :9] = -60, 1, 0.5, -30, 150, 0, 0, 2, 6
TIME = np.arange(0.013, 6.9, 1 / 517)  # neither whole revolutions nor whole samples in one
PROBES = np.array([[math.sin(a), math.cos(a)] for a in ANGLES])


def readings(time=TIME, noise=0.0, seed=0):
    """What the two probes read at some times, µm, (2, N)."""
    clean = PROBES @ TRUE @ fourier_rows(8, SPEED * time / 2)
    return clean + np.random.default_rng(seed).normal(0, noise, clean.shape)


def text(columns, apart=",", point="."):
    """A CSV of columns by name."""
    rows = zip(*columns.values(), strict=True)
    return "\n".join([apart.join(columns), *(apart.join(f"{v:.9g}".replace(".", point)
                                                        for v in row) for row in rows)])


def named(scale=1.0, unit="µm"):
    """The columns of the two probes."""
    return {f"guide {math.degrees(a):.0f}° [{unit}]": scale * u
            for a, u in zip(ANGLES, readings(), strict=True)}


def pulses(width=0.05):
    """A keyphasor's voltage with the edges of a slot as a probe sees them."""
    turn = (SPEED * TIME / (2 * math.pi) + width / 4) % 1
    return np.clip(np.minimum(turn, width - turn) / (width / 2), 0, 1) * -8 - 1


FILES = {
    "speed given": (text({"time [s]": TIME, **named()}), {"speed": SPEED}),
    "mil and ms": (text({"time [ms]": 1e3 * TIME, **named(1 / 25.4, "mil")}), {"speed": SPEED}),
    "decimal comma": (text({"time [s]": TIME, **named(1e-3, "mm")}, ";", ","), {"speed": SPEED}),
    "phase": (text({"time [s]": TIME, "phase [deg]": np.degrees(SPEED * TIME) % 360, **named()}),
              {}),
    "column of speeds": (text({"time [s]": TIME, "speed [rpm]": np.full(len(TIME), 150.0),
                               **named()}), {"mark": SPEED * TIME[0]}),
    "volts": (text({"time [s]": TIME, **named(7.87e-3, "V")}),
              {"speed": SPEED, "sensitivity": 7870.0}),
    "own names": (text({"time [s]": TIME, "CH1 [µm]": readings()[0], "CH2 [um]": readings()[1]}),
                  {"speed": SPEED, "probes": {"CH1": ("guide", ANGLES[0]),
                                              "CH2": ("guide", ANGLES[1])}}),
}


@pytest.mark.parametrize("kind", FILES)
def test_orders_come_back(kind, tmp_path):
    content, options = FILES[kind]
    (tmp_path / "r.csv").write_text(content, encoding="utf-8")
    for record in (read_record(content, **options), read_record(tmp_path / "r.csv", **options)):
        assert record.half_orders("guide")[0] == pytest.approx(1e-6 * TRUE, abs=1e-12)
        assert record.speed == pytest.approx(SPEED, rel=1e-6)
        assert record.order("guide", 1)[0] == pytest.approx(1e-6 * ellipse(TRUE, 2).major)
        assert record.coefficients("guide")[0][:, 4] == pytest.approx(1e-6 * TRUE[:, 8])


def test_a_keyphasor_sets_phase_and_speed():
    """To the accuracy of its edges: 207 samples a revolution, 17 pulses."""
    record = read_record(text({"time [s]": TIME, "key [V]": pulses(), **named()}))
    assert record.speed == pytest.approx(SPEED, rel=1e-4)
    first = record.coefficients("guide")[0]
    turn = np.angle(first[:, 2] + 1j * first[:, 1]) - np.angle(TRUE[:, 4] + 1j * TRUE[:, 3])
    assert np.abs(turn - turn.mean()).max() < 1e-3 and abs(turn.mean()) < 2 * math.pi * 0.03
    assert record.order("guide", 1)[0] == pytest.approx(1e-6 * ellipse(TRUE, 2).major, rel=1e-3)


def test_the_errors_are_those_of_many_records():
    """Of 300 records with noise the orders scatter by the standard errors that each one states."""
    away = []
    for seed in range(300):
        u = 1e-6 * readings(TIME[:800], 4.0, seed)
        probes = tuple(Probe("guide", a, s) for a, s in zip(ANGLES, u, strict=True))
        record = ProbeRecord("noisy", SPEED * TIME[:800], SPEED, probes)
        found, errors = record.half_orders("guide")
        away.append((found - 1e-6 * TRUE) / errors)
    assert np.std(away, axis=0) == pytest.approx(np.ones((2, 17)), abs=0.2)
    assert np.std(away) == pytest.approx(1, abs=0.03) and abs(np.mean(away)) < 0.05


def test_the_spectrum_has_lines_at_the_orders():
    record = read_record(FILES["speed given"][0], speed=SPEED)
    orders, lines = record.spectrum("guide")
    for order, size in ((1, math.hypot(180, 40)), (2, math.hypot(5, 3))):
        at = int(np.abs(orders - order).argmin())
        assert 1e6 * lines[0, at] == pytest.approx(size, rel=0.02)
    assert lines[0, np.abs(orders - 3).argmin()] < 0.2e-6


def test_run_out_is_taken_away_as_a_record_and_as_vectors():
    slow = 1e6 * np.array([[20e-6], [10e-6]]) * np.cos(SPEED * TIME - 0.7)
    both = {name: u + s for (name, u), s in zip(named().items(), slow, strict=True)}
    dirty = text({"time [s]": TIME, **both})
    roll = read_record(text({"time [s]": TIME, **dict(zip(named(), slow + 500, strict=True))}),
                       speed=SPEED)
    vectors = {"guide 30°": (20e-6, 0.7), "guide 100°": (10e-6, 0.7)}
    for run_out in (roll, vectors):
        record = read_record(dirty, speed=SPEED, run_out=run_out)
        assert record.half_orders("guide")[0] == pytest.approx(1e-6 * TRUE, abs=1e-11)


def test_a_made_up_record_is_the_steady_state_it_was_made_of():
    unit = load_machine("kaplan-150rpm")
    orbit = HarmonicBalance(4).solve(unit.model(), unit.speed, 0.05)
    record = made_up_record(orbit, ["generator", "turbine guide bearing"], noise=1e-15, seed=1)
    assert record.coefficients("generator")[0] == pytest.approx(orbit.coefficients, abs=1e-14)
    assert record.coefficients("turbine guide bearing")[0] == pytest.approx(
        orbit.node_coefficients("turbine guide bearing"), abs=1e-14)
    assert "1X" in str(record) and "150 rpm" in str(record)


GOOD = {"time [s]": TIME, **named()}
BAD = [
    ("", {}, ["no rows"]),
    ("time [s],guide 30° [µm]\n", {}, ["no rows"]),
    (text({"guide 30° [µm]": TIME, "guide 100° [µm]": TIME}), {}, ["no clock", "time [s]"]),
    (text(GOOD), {}, ["no speed", "rpm(150)"]),
    (text(GOOD), {"speed": -1.0}, ["speed is -1"]),
    (text(GOOD), {"speed": SPEED, "field": -1.0}, ["field is -1", "at least 0"]),
    (text({"time [h]": TIME, **named()}), {"speed": SPEED}, ["'h'", "s, ms"]),
    (text({"time [s]": TIME, **named(1, "cm")}), {"speed": SPEED}, ["'cm'", "mil"]),
    (text({"time [s]": TIME, **named(1, "V")}), {"speed": SPEED}, ["'V'", "sensitivity"]),
    (text({"time [s]": TIME, "CH1 [µm]": TIME}), {"speed": SPEED}, ["CH1", "probes="]),
    (text({"time [s]": TIME, "guide 30° [µm]": TIME}), {"speed": SPEED}, ["needs two"]),
    (text({"time [s]": TIME, "guide 30° [µm]": TIME, "guide 211° [µm]": TIME}), {"speed": SPEED},
     ["different sides"]),
    (text({"time [s]": TIME, **named(1e-3, "m")}), {"speed": SPEED}, ["reads up to", "0.1 m"]),
    (text({"time [s]": TIME[::-1], **named()}), {"speed": SPEED}, ["does not rise"]),
    (text(GOOD).replace("\n", "\nx,", 3), {"speed": SPEED}, ["line 2", "'x'", "finite"]),
    (text({k: v[:200] for k, v in GOOD.items()}), {"speed": SPEED}, ["0.96", "at least 3"]),
    (text({k: v[::20] for k, v in GOOD.items()}), {"speed": SPEED}, ["10.4 samples", "16"]),
    (text({"key [V]": np.ones(len(TIME)), **GOOD}), {}, ["rises 0 times"]),
    (text({"key [V]": np.where((TIME > 3) & (TIME < 3.6), -1, pulses()), **GOOD}), {},
     ["lost or doubled"]),
    (text(GOOD), {"speed": SPEED, "run_out": {"guide 45°": (1e-5, 0.0)}}, ["guide 45°"]),
    (text(GOOD), {"speed": SPEED, "run_out": 3.0}, ["run_out is 3.0"]),
    ("no such file.csv", {"speed": SPEED}, ["cannot be read"]),
]


@pytest.mark.parametrize(("content", "options", "words"), BAD)
def test_what_is_no_record_gets_a_sentence(content, options, words):
    with pytest.raises(BadInput) as error:
        read_record(content if content.endswith(".csv") else content + "\n", **options)
    for word in words:
        assert word in str(error.value)
    assert "\n" not in str(error.value)


def test_places_and_orders_that_are_not_there():
    record = read_record(text(GOOD), speed=SPEED)
    with pytest.raises(BadInput, match="has probes at guide"):
        record.order("turbine", 1)
    with pytest.raises(BadInput, match=r"order is 0\.7"):
        record.order("guide", 0.7)
