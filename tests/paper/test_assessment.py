"""What an engineer asks of a unit: beside independent numbers, and for units that have little."""

import math

import numpy as np
import pytest

from hydrolab import BadInput, RungeKutta, critical_speeds, integrate, load_machine, rpm, vary
from hydrolab.paper.assessment import AT_TOLERANCE, CENTRED, assess, first_loss, nearest
from hydrolab.paper.study import PAPER_LIMIT


@pytest.fixture(scope="module")
def kaplan():
    return assess(load_machine("kaplan-150rpm"))


def answers(found, start):
    return [one for one in found.answers() if one.asked.startswith(start)]


def test_the_paper_s_unit(kaplan):
    """The fold that it was calibrated to with four harmonics, the grade by hand."""
    assert first_loss(kaplan) == pytest.approx(PAPER_LIMIT, rel=2e-4)
    grade, turbine = answers(kaplan, "Balance of")
    assert grade.found.startswith(f"G {83.9152 / 119 * math.pi * 5:.3g}:") and grade.kept is False
    assert turbine.kept is False
    lost = answers(kaplan, "Static eccentricity")[0]
    assert "8.93 % of the gap, 1.8 times the tolerance" in lost.found and lost.kept
    assert len(answers(kaplan, "Critical speed")) == 6 and not kaplan.troubles


def test_the_force_on_a_bearing_is_that_of_a_motion_in_time(kaplan):
    orbit = kaplan.orbits[AT_TOLERANCE]
    motion = integrate(kaplan.model, RungeKutta(), speed=rpm(150), static_eccentricity=0.05,
                       start=orbit, revolutions=2)
    assert motion.coefficients(4)[0, 0] == pytest.approx(orbit.mean[0], rel=1e-4)
    force = answers(kaplan, "Force on generator guide bearing, stator 5 %")[0].found
    spring = kaplan.machine.bearings[0]
    mean = orbit.node_coefficients(spring.name)[:, 0]
    static = 1e-3 * float(np.hypot(*(spring.stiffness @ mean)))
    assert f"static {static:.4g} kN" in force


@pytest.mark.parametrize(("card", "met"), [("kaplan-150rpm", False), ("pelton-horizontal", True)])
def test_a_margin_counts_the_critical_speeds_that_an_unbalance_meets(card, met):
    """A backward whirl only where bearings differ between x and z: with a tenth of the damping the
    linear response peaks there, or does not.
    """
    machine = load_machine(card)
    calm = {f"bearings.{b.name}.damping": 0.1 * b.damping for b in machine.bearings}
    machine = vary(machine, calm | {"damping.ratio": (0.001, 0.001)} if machine.damping else calm)
    model = machine.model().with_field(0)
    found = critical_speeds(model)
    backward = float(found.speeds[np.array(found.direction) == "backward"][0])
    near = backward * np.linspace(0.97, 1.03, 61)
    size = [float(np.linalg.norm(response(model, speed))) for speed in near]
    peaks = 0 < int(np.argmax(size)) < 60
    assert peaks == met
    assert (nearest(found, backward) == backward) == met


def response(model, speed):
    """Complex 1X of all coordinates to the unbalance."""
    stiffness = model.K - speed**2 * model.M + 1j * speed * model.velocity_matrix(speed)
    return np.linalg.solve(stiffness, model.loads(speed)[1])


def test_a_unit_that_has_no_gap_or_no_steady_state_still_gets_its_answers():
    bare, moving = assess(load_machine("three-disc")), assess(load_machine("two-pole"))
    assert not answers(bare, "Smallest air gap") and bare.branch is None and not bare.troubles
    assert answers(moving, "Balance of")[0].found.startswith("G 4.76") and not moving.orbits
    assert "do not repeat" in moving.troubles[0]
    # a generator above 950 rpm is judged by the finer grade
    assert answers(moving, "Balance of")[0].kept is False


def test_a_field_that_pulls_the_rotor_in_is_said():
    strong = assess(vary(load_machine("jeffcott"), {"field": 0.53}))
    lost = answers(strong, "Static eccentricity")[0]
    assert CENTRED in strong.orbits and AT_TOLERANCE not in strong.orbits
    assert lost.kept is False and "no steady state" in strong.troubles[0]


def test_bearings_and_shapes_are_judged_by_their_clearance_and_the_gap():
    machine = vary(load_machine("francis-three-guides"), {
        "bearings.upper guide.clearance": 2e-4, "bearings.upper guide.x": 1e-4,
        "bearings.lower guide.z": 0.0})
    line = answers(assess(machine), "upper guide out of line")[0]
    assert line.found.startswith("25 %") and line.kept is False


def test_speeds_are_as_given_and_a_machine_that_stands_is_refused():
    found = assess(load_machine("pump-turbine"), overspeed=rpm(690))
    assert found.assumed == ("runaway speed",)
    assert "overspeed, 690 rpm" in answers(found, "Critical speed")[2].asked
    with pytest.raises(BadInput, match="needs the rated speed"):
        assess(vary(load_machine("jeffcott"), {"speed": 0.0}))
    with pytest.raises(BadInput, match="overspeed is -1"):
        assess(load_machine("jeffcott"), overspeed=-1)
