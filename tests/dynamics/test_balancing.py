"""Balancing: influence coefficients against Jeffcott's, by runs and by the model, and what is left.
"""

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

from hydrolab import (
    BadInput,
    HarmonicBalance,
    TrialRun,
    balance,
    load_machine,
    made_up_record,
    vary,
)
from hydrolab.dynamics.balancing import first_order

UNIT = load_machine("kaplan-150rpm")
PLACES = ["generator guide bearing", "turbine guide bearing"]
TRIALS = {"generator": (30.0, 1.0), "turbine": (15.0, 4.0)}


def record(machine, masses=None, field=1.0, noise=0.0, places=PLACES):
    """The machine with more unbalance on its bodies."""
    numbers = {}
    for name, (size, angle) in (masses or {}).items():
        body = machine.body(name)
        whole = cmath.rect(body.unbalance, body.phase) + cmath.rect(size, angle)
        numbers |= dict(zip((f"{body.key}.unbalance", f"{body.key}.phase"), cmath.polar(whole),
                            strict=True))
    orbit = HarmonicBalance(4).solve(vary(machine, numbers).model().with_field(field),
                                     machine.speed)
    return made_up_record(orbit, places, noise=noise, seed=3, field=field)


@pytest.mark.parametrize("field", [0.0, 1.0])
def test_jeffcott_against_his_formula(field):
    """H = Ω²/(k − k_pull − mΩ² + icΩ), where the pull is linear; a probe at φ sees it turned by φ.
    """
    machine = load_machine("jeffcott")
    machine = replace(machine, air_gap=replace(machine.air_gap, linear=True))
    spring, body, w = machine.bearings[0], machine.bodies[0], machine.speed
    pull = field * machine.air_gap.pull_stiffness
    h = w**2 / (spring.stiffness[0, 0] - pull - body.mass * w**2 + 1j * w * spring.damping[0, 0])
    found = balance(machine, record(machine, field=field, places=["generator"]))
    assert found.influence[:, 0] == pytest.approx(
        [h * cmath.exp(-1j * math.radians(45)), h * cmath.exp(1j * math.radians(45))], rel=1e-7)
    (size, angle), = found.masses.values()
    assert size == pytest.approx(body.unbalance, rel=1e-7)
    assert abs(angle - math.pi) < 1e-7  # opposite to the unbalance, whose phase is 0
    assert np.abs(found.left).max() < 1e-12


def test_runs_and_model_agree_and_the_masses_do_their_work():
    """Without field the unit is linear: two planes, two runs, nothing is left."""
    runs = [TrialRun(record(UNIT, field=0.0)),
            *(TrialRun(record(UNIT, {name: mass}, field=0.0), {name: mass})
              for name, mass in TRIALS.items())]
    measured = balance(UNIT, runs)
    model = balance(UNIT, runs[0].record, planes=["generator", "turbine"])
    assert measured.influence == pytest.approx(model.influence, rel=1e-6)
    after = first_order(record(UNIT, measured.masses, field=0.0))[0]
    assert np.abs(after).max() < 1e-6 * np.abs(measured.before).max()
    assert "2 trial runs" in str(measured) and "the model" in str(model)


def test_the_pull_changes_what_a_mass_does():
    """Masses by runs without field do not balance the unit with it; those by runs with it do,
    as far as the pull is linear.
    """
    found = balance(UNIT, record(UNIT))
    left = {name: np.abs(first_order(record(UNIT, masses))[0]).max() / np.abs(found.before).max()
            for name, masses in (("with", found.masses), ("without", balance(
                UNIT, replace(record(UNIT), field=0.0)).masses))}
    assert left["with"] < 0.12 < 0.5 < left["without"]
    assert np.linalg.norm(found.with_field) > 2 * np.linalg.norm(found.without_field)
    assert np.abs(found.by_wrong_field).max() == pytest.approx(
        left["without"] * np.abs(found.before).max(), rel=0.1)


def test_a_noisy_run_says_how_well_it_is_known():
    found = balance(UNIT, record(UNIT, noise=5e-6))
    assert found.errors == pytest.approx(np.full(4, 5e-6 * math.sqrt(2 / 2048)), rel=0.1)


RUN = record(UNIT)
BAD = [
    ((UNIT.model(), RUN), {}, "machine is a Model"),
    ((UNIT, []), {}, "records is empty"),
    ((UNIT, [TrialRun(RUN, TRIALS)]), {}, "without masses"),
    ((UNIT, [TrialRun(RUN), TrialRun(RUN, TRIALS)]), {}, "one trial mass"),
    ((UNIT, [TrialRun(RUN), TrialRun(RUN, {"rotor": (1.0, 0.0)})]), {}, "no body is called"),
    ((UNIT, [TrialRun(RUN), TrialRun(RUN, {"turbine": (0.0, 0.0)})]), {}, "trial mass on turbine"),
    ((UNIT, RUN), {"planes": ["generator", "turbine", "generator", "turbine", "turbine"]},
     "planes has 5"),
]


@pytest.mark.parametrize(("given", "options", "words"), BAD)
def test_what_is_no_balance_gets_a_sentence(given, options, words):
    with pytest.raises(BadInput, match=words):
        balance(*given, **options)
