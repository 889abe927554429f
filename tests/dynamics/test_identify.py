"""From records to numbers: values and errors against a closed form, their coverage, wrong models
rejected, and what cannot be told said.
"""

import cmath
import math

import numpy as np
import pytest

from hydrolab import BadInput, HarmonicBalance, identify, load_machine, made_up_record, vary
from hydrolab.dynamics.balancing import first_order, influence
from hydrolab.dynamics.identify import NORMAL_95
from hydrolab.machine.crack import Crack
from hydrolab.machine.gap_shape import GapShape
from hydrolab.machine.loads import Load
from hydrolab.paper.calibration import family_prior
from tests.machines import unit

UNIT = load_machine("kaplan-150rpm")
GUIDE = "bearings.generator guide bearing.stiffness"
SIZE, PHASE = "bodies.generator.unbalance", "bodies.generator.phase"
TRUE = {SIZE: 61.0, PHASE: 2.1, "static_eccentricity": 0.045, "direction": 3.9}
PLACES = ["generator", "generator guide bearing", "turbine guide bearing"]


def records(machine, seed, fields=(1.0, 0.0), eccentricity=0.045, direction=3.9, **options):
    """The machine with field and without, 16 revolutions with 3 µm rms of noise."""
    found = []
    for field in fields:
        orbit = HarmonicBalance(6).solve(machine.model().with_field(field), machine.speed,
                                         eccentricity, direction=direction)
        found.append(made_up_record(orbit, PLACES, noise=3e-6, seed=2 * seed + int(field),
                                    revolutions=16, field=field, name=f"field {field:g}"))
    return found


def other_unit():
    """The unit with another unbalance."""
    return vary(UNIT, {SIZE: 61.0, PHASE: 2.1})


def test_an_unbalance_without_field_against_the_closed_form():
    """Without field the motion is linear in the complex unbalance W: weighted least squares has a
    solution in one line, W = Σ h̄ v/σ² / Σ |h|²/σ², and a standard error 1/√(Σ |h|²/σ²).
    """
    record, = records(other_unit(), 5, fields=(0.0,))
    found = identify(UNIT, record, [SIZE, PHASE], orders=(1,))
    (v, sigma), h = first_order(record), influence(UNIT, record, ["generator"], field=0.0)[:, 0]
    still = HarmonicBalance(4).solve(UNIT.model().with_field(0), UNIT.speed)
    clean = first_order(made_up_record(still, PLACES, noise=0.0, seed=0, revolutions=16))[0]
    own = clean - h * cmath.rect(UNIT.bodies[0].unbalance, UNIT.bodies[0].phase)
    weight = (np.abs(h) ** 2 / sigma**2).sum()
    w = ((v - own) * h.conj() / sigma**2).sum() / weight
    assert found.values[SIZE] == pytest.approx(abs(w), rel=1e-6)
    assert found.values[PHASE] == pytest.approx(cmath.phase(w), rel=1e-6)
    assert found.errors[SIZE] == pytest.approx(weight**-0.5, rel=2e-3)
    assert found.errors[PHASE] == pytest.approx(weight**-0.5 / abs(w), rel=2e-3)
    assert found.chi_square == pytest.approx(
        (np.abs(v - own - h * w) ** 2 / sigma**2).sum(), rel=2e-3)


def test_true_values_scatter_by_the_stated_errors():
    """In a reduced form; tests/benchmarks/coverage.py counts 100 runs."""
    machine = other_unit()
    away, chances = [], []
    for seed in range(12, 24):
        found = identify(UNIT, records(machine, seed), list(TRUE))
        away += [(found.values[key] - value) / found.errors[key] for key, value in TRUE.items()]
        chances.append(found.chance)
    away = np.abs(away)
    assert 0.75 < np.sqrt(np.mean(away**2)) < 1.25 and away.max() < 4
    assert 0.88 <= np.mean(away < NORMAL_95) and min(chances) > 0.001


def test_an_oval_gap_and_a_bearing_are_found():
    shaped = unit(shapes=(GapShape("oval", "stator", 2, 5e-4, 0.4),))
    start = unit(shapes=(GapShape("oval", "stator", 2, 1e-4, 1.5),))
    free = ["shapes.oval.size", "shapes.oval.angle", GUIDE]
    found = identify(start, records(vary(shaped, {GUIDE: 1.2e9}), 3, eccentricity=0.0), free)
    for key, value in zip(free, (5e-4, 0.4, 1.2e9), strict=True):
        assert abs(found.values[key] - value) < 4 * found.errors[key]
        assert found.errors[key] < 0.02 * value
    assert not found.rejected and not found.untold
    assert found.machine.number(GUIDE)[0] == found.values[GUIDE]


@pytest.mark.parametrize("fault", ["soft bearing", "crack"])
def test_a_wrong_model_is_rejected(fault):
    machine = {
        "soft bearing": lambda: vary(other_unit(), {GUIDE: 0.8 * 1.37e9}),
        "crack": lambda: unit(cracks=(Crack("crack", 3, 0.3, phase=0.7),),
                              loads=(Load("thrust", 12, 5e4, 1.0),))}[fault]()
    found = identify(UNIT, records(machine, 1), list(TRUE))
    assert found.rejected and found.chance < 1e-6
    assert "rejected at 1 %" in str(found) and "standard errors" in found.worst


def test_what_the_records_do_not_tell_is_said():
    """Without field nothing tells where the stator is."""
    found = identify(UNIT, records(other_unit(), 1, fields=(0.0,)), list(TRUE))
    assert set(found.untold) == {"static_eccentricity", "direction"}
    assert "do not tell static_eccentricity, direction" in str(found)
    assert abs(found.values[SIZE] - 61) < 4 * found.errors[SIZE]


def test_numbers_that_are_told_only_together():
    """At one speed and without field an orbit tells little of mass and unbalance apart."""
    record = records(UNIT, 4, fields=(0.0,), eccentricity=0.0)
    found = identify(UNIT, record, ["bodies.generator.mass", SIZE], orders=(1,))
    (one, other, correlation), = found.tied
    assert {one, other} == {SIZE, "bodies.generator.mass"} and abs(correlation) > 0.95
    assert "told only together" in str(found)


def test_a_prior_counts_as_one_more_reading():
    """Numbers that the records do not tell stay at what is known of them."""
    prior = {GUIDE: (1.37e9, 5e7)} | family_prior(["bodies.generator.mass"])
    record, = records(UNIT, 2, fields=(0.0,))
    told = identify(UNIT, record, [GUIDE, "bodies.generator.mass"], prior=prior)
    free = identify(UNIT, record, [GUIDE, "bodies.generator.mass"])
    assert told.freedom == free.freedom + 2
    assert told.errors[GUIDE] < free.errors[GUIDE] and told.errors[GUIDE] < 5e7
    weak = identify(UNIT, record, [GUIDE], prior={GUIDE: (1.37e9, 1e5)})
    assert weak.untold == (GUIDE,) and weak.errors[GUIDE] == pytest.approx(1e5, rel=0.1)


def test_the_family_knows_nothing_of_what_its_members_share():
    known = family_prior([GUIDE, PHASE, SIZE, "bodies.generator.mass", "static_eccentricity"])
    assert set(known) == {SIZE, "bodies.generator.mass"}
    mean, spread = known["bodies.generator.mass"]
    assert 9e4 < mean < 1.2e5 and 1e4 < spread < 4e4


def test_a_sensitivity_error_of_the_probes_widens_the_intervals():
    case = records(other_unit(), 7)
    sharp, wide = (identify(UNIT, case, list(TRUE), probe_error=e) for e in (0.0, 0.02))
    assert wide.errors[SIZE] > 5 * sharp.errors[SIZE]
    assert wide.chi_square < sharp.chi_square


RECORDS = records(UNIT, 0)
BAD = [
    ((UNIT.model(), RECORDS, [SIZE]), {}, "machine is a Model"),
    ((UNIT, [], [SIZE]), {}, "records is empty"),
    ((UNIT, [3], [SIZE]), {}, "records is 3"),
    ((UNIT, RECORDS, []), {}, r"free is \[\]"),
    ((UNIT, RECORDS, SIZE), {}, "it must be a list"),
    ((UNIT, RECORDS, ["bodies.rotor.mass"]), {}, "'bodies.rotor.mass' is not a number"),
    ((UNIT, RECORDS, [SIZE]), {"orders": (0,)}, "orders is"),
    ((UNIT, RECORDS, [SIZE]), {"orders": (1, 7)}, "0 to 4"),
    ((UNIT, RECORDS, [SIZE]), {"start": {GUIDE: 1.0}}, "start names"),
    ((UNIT, RECORDS, [SIZE]), {"prior": {GUIDE: (1.0, 1.0)}}, "prior names"),
    ((UNIT, RECORDS, [SIZE]), {"prior": {SIZE: (60.0, 0.0)}}, "larger than 0"),
    ((UNIT, RECORDS, [SIZE]), {"probe_error": 2.0}, "probe_error is 2"),
]


@pytest.mark.parametrize(("given", "options", "words"), BAD)
def test_what_cannot_be_identified_gets_a_sentence(given, options, words):
    with pytest.raises(BadInput, match=words):
        identify(*given, **options)


def test_angles_go_the_short_way_round():
    machine = vary(UNIT, {SIZE: 61.0, PHASE: 0.0})
    found = identify(UNIT, records(machine, 3, direction=0.0), list(TRUE))
    for key in (PHASE, "direction"):
        assert abs((found.values[key] + math.pi) % (2 * math.pi) - math.pi) < 4 * found.errors[key]
