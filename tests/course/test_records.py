"""Records of faulty machines: each fault shows in the evidence that chapter 12 teaches, and only
there.
"""

import itertools
import math

import numpy as np
import pytest

from hydrolab import RungeKutta, identify, integrate, load_machine, read_record
from hydrolab.course import records
from hydrolab.course.records import (
    ECCENTRICITY,
    FAULTS,
    OVALITY,
    SIZES,
    SOFT,
    UNBALANCE,
    Condition,
    condition_of,
    diagnose,
    evidence,
    grade,
    healthy,
    record,
    recording,
    steady_state,
    unknown_machine,
)
from hydrolab.dynamics.stability import floquet
from hydrolab.errors import BadInput
from tests.course import unknown_unit

REFERENCE = evidence(healthy())
KEYS = {ECCENTRICITY: "static_eccentricity", UNBALANCE: "unbalance", OVALITY: "ovality",
        SOFT: "bearing"}
SMALL, LARGE = 0.7, 2.3  # rad, directions


def of_fault(fault, size, **more):
    return evidence(recording(Condition(**{"direction": SMALL, KEYS[fault]: size} | more), seed=5))


def test_a_healthy_machine_has_no_fault():
    for seed, direction in ((1, SMALL), (2, LARGE)):
        other = recording(Condition(direction=direction, unbalance=1.1, static_eccentricity=0.015),
                          seed=seed)
        assert diagnose(evidence(other), REFERENCE) == "none"


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_named_at_both_ends_of_its_sizes_in_every_setting(fault):
    """Setting: the imperfections that every machine has, at the corners of what `condition_of`
    draws.
    """
    corners = itertools.product(SIZES[fault], (0.9, 1.1), (0.005, 0.015), (0.0, 1.5))
    for size, unbalance, eccentricity, axis in corners:
        setting = {"unbalance": unbalance, "static_eccentricity": eccentricity, "axis": axis,
                   KEYS[fault]: size}
        assert diagnose(of_fault(fault, size, **setting), REFERENCE) == fault, setting


def test_the_evidence_is_the_one_the_chapter_teaches():
    eccentric, heavy, oval, soft = (of_fault(fault, sum(SIZES[fault]) / 2) for fault in FAULTS)
    for found in (eccentric, oval):  # nothing is left without field
        assert found.first_off == pytest.approx(REFERENCE.first_off, rel=0.01)
        assert found.roundness < 0.8
    assert eccentric.pulled > 5 * REFERENCE.pulled and oval.pulled < 2 * REFERENCE.pulled
    assert eccentric.second > 2 * oval.second
    for found in (heavy, soft):
        assert found.roundness > 0.9 and found.first > 1.3 * REFERENCE.first
    # without field: linear
    assert heavy.first_off / REFERENCE.first_off == pytest.approx(2.4, rel=0.01)
    assert heavy.bearing_share == pytest.approx(REFERENCE.bearing_share, rel=0.02)
    assert soft.bearing_share > 1.2 * REFERENCE.bearing_share
    # 2X goes with the square of 1X
    assert heavy.second / REFERENCE.second == pytest.approx(2.4**2, rel=0.15)


def test_an_oval_gap_alone_makes_no_second_harmonic_and_no_mean():
    """Turned by half a revolution the machine is the same, so the motion has odd harmonics only."""
    orbit = steady_state(Condition(static_eccentricity=0.0, ovality=0.1, axis=0.6))
    even, third = orbit.coefficients[:, [0, 3, 4, 7, 8]], orbit.coefficients[:, 5:7]
    assert np.abs(even).max() < 1e-12 < 1e-8 < np.abs(third).max()


@pytest.mark.parametrize("fault", FAULTS)
def test_recorded_states_are_stable_so_that_a_machine_can_be_in_them(fault):
    for size in SIZES[fault]:
        assert floquet(steady_state(Condition(**{"unbalance": 1.1,
                                                 KEYS[fault]: size}))).verdict == "stable"


def test_the_motion_of_an_oval_gap_is_what_integration_finds():
    condition = Condition(ovality=0.08, axis=0.6)
    orbit = steady_state(condition)
    motion = integrate(orbit.model, RungeKutta(rtol=1e-7), speed=orbit.speed,
                       static_eccentricity=0.01, revolutions=6,
                       start=orbit)
    times, path = motion.last(1)
    assert np.abs(path - orbit.positions(orbit.speed * times)).max() < 1e-7


def test_a_record_is_the_steady_state_with_noise():
    condition = Condition(static_eccentricity=0.07)
    taken, orbit = record(condition, seed=3), steady_state(condition)
    assert np.abs(taken.coefficients(harmonics=6)
                  - orbit.coefficients).max() < 5 * records.NOISE * math.sqrt(2 / 4096)
    noise = taken.positions["generator"] - orbit.positions(taken.speed * taken.times)
    assert noise.std() == pytest.approx(records.NOISE, rel=0.05)
    assert np.array_equal(record(condition, seed=3).positions["generator"],
                          taken.positions["generator"])
    with pytest.raises(BadInput, match="there are probes at"):
        taken.coefficients("spider")


def test_numbered_machines_are_found_out_and_all_faults_occur():
    numbers = range(1, 25)
    truth = [condition_of(n)[0] for n in numbers]
    assert set(truth) == set(FAULTS)
    assert [diagnose(evidence(unknown_machine(n)), REFERENCE) for n in numbers] == truth


def test_grades():
    for fault, number in {condition_of(n)[0]: n for n in range(1, 25)}.items():
        assert grade(number, fault).startswith("right.")
        hints = {grade(number, other).split("Machine")[0] for other in FAULTS if other != fault}
        assert len(hints) == 3 and all(hint.startswith("not ") for hint in hints)
    with pytest.raises(BadInput, match="one of static eccentricity"):
        grade(1, "ghosts")
    with pytest.raises(BadInput, match="whole numbers"):
        unknown_machine(0.5)


def test_the_shipped_unit_is_the_one_of_the_script_and_its_numbers_are_found():
    """Chapter 14's capstone: without run-out and with a softer bearing, and only so."""
    assert unknown_unit.files() == {name: records.record_text(name) for name in
                                    ("with-field", "without-field", "slow-roll")}
    slow = read_record(records.record_text("slow-roll"), field=0.0)
    raw = [read_record(records.record_text(f"{name}-field"), field=share)
           for name, share in (("with", 1.0), ("without", 0.0))]
    true, card = unknown_unit.truth(), load_machine("kaplan-150rpm")
    found = identify(card, [record.without(slow) for record in raw], list(true))
    assert not found.rejected
    for key, value in true.items():
        assert abs(found.values[key] - value) < 3.5 * found.errors[key]
    assert identify(card, raw, list(true)).rejected
