"""Loads that no motion makes, against beam theory, the rigid shift of a whole machine, the bowed
rotor's formula and an asymmetric shaft under its weight.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from hydrolab import (
    BadInput,
    HarmonicBalance,
    Newmark,
    RungeKutta,
    basins,
    follow,
    integrate,
    load_machine,
    rpm,
    steady_map,
)
from hydrolab.dynamics import equilibrium
from hydrolab.figures import line_picture
from hydrolab.machine.bearings import RadialBearing, ThrustBearing
from hydrolab.machine.crack import Crack
from hydrolab.machine.loads import Bow, Gravity, Load
from hydrolab.machine.parts import Machine, RigidBody, Shaft
from tests.machines import MACHINES

L, D, E, RHO, NU, KAPPA = 6.0, 0.5, 2e11, 7850.0, 0.3, 0.886
EI, GA = E * math.pi * D**4 / 64, KAPPA * E / 2.6 * math.pi * D**2 / 4
WEIGHT = RHO * math.pi * D**2 / 4 * 9.81  # N/m
STIFF = 1e14


def span(*bearings, density=RHO, bodies=(), elements=6, **parts):
    """A uniform shaft, by default on two supports without give at its ends."""
    nodes = np.linspace(0, L, elements + 1)
    bearings = bearings or (RadialBearing("top", 0, STIFF), RadialBearing("bottom", elements,
                                                                          STIFF))
    return Machine("span", 10.0, Shaft(nodes, D, E, density, NU, KAPPA, "timoshenko"), bodies,
                   bearings, **parts)


def sag(machine, node=3):
    """Where a node rests, (x, z), m."""
    return equilibrium(machine.model(), 0.0).displacement[4 * node:4 * node + 2]


def test_weight_bends_a_beam_as_in_the_book():
    expected = 5 * WEIGHT * L**4 / (384 * EI) + WEIGHT * L**2 / (8 * GA)
    assert sag(span(gravity=Gravity(9.81))) == pytest.approx([0, -expected], rel=1e-5, abs=1e-12)
    leaning = span(gravity=Gravity(9.81, math.pi / 2))
    assert sag(leaning) == pytest.approx([expected, 0], rel=1e-5, abs=1e-12)


def test_a_side_load_and_one_below_its_node():
    one = span(loads=(Load("thrust", 3, 1e5, math.pi / 6),))
    size = 1e5 * (L**3 / (48 * EI) + L / (4 * GA))
    assert sag(one) == pytest.approx([size / 2, size * math.sqrt(3) / 2], rel=1e-6)
    end = span(RadialBearing("a", 0, STIFF), RadialBearing("b", 3, STIFF),
               loads=(Load("thrust", 6, 1e5, 0.0, 0.4),))
    forces = HarmonicBalance(1).solve(end.model(), 10.0).bearing_forces
    lever = (L / 2 + 0.4) / (L / 2)
    assert forces["a"].static == pytest.approx([0, -1e5 * lever], rel=1e-6, abs=1e-3)
    assert forces["b"].static == pytest.approx([0, 1e5 * (1 + lever)], rel=1e-6, abs=1e-3)


def test_the_weight_of_a_body_on_its_link_is_carried_by_the_bearings():
    body = RigidBody("runner", 6, 2e4, 1e3, 1e3, offset=0.5)
    machine = span(bodies=(body,), density=1e-6, gravity=Gravity(9.81))
    forces = HarmonicBalance(1).solve(machine.model(), 10.0).bearing_forces
    assert forces["bottom"].static[1] == pytest.approx(-2e4 * 9.81 * (L + 0.5) / L, rel=1e-6)
    assert forces["top"].static[1] == pytest.approx(2e4 * 9.81 * 0.5 / L, rel=1e-6)


def test_a_guide_bearing_out_of_line_is_loaded_as_a_three_bearing_beam():
    k, off = 2e9, 3e-4
    three = span(RadialBearing("top", 0, k), RadialBearing("middle", 3, k, x=off),
                 RadialBearing("bottom", 6, k))
    force = off / (L**3 / (48 * EI) + L / (4 * GA) + 1 / k + 1 / (2 * k))
    orbit = HarmonicBalance(1).solve(three.model(), 10.0)
    assert orbit.bearing_forces["middle"].static == pytest.approx([-force, 0], rel=1e-9, abs=1e-6)
    assert orbit.bearing_forces["top"].static == pytest.approx([force / 2, 0], rel=1e-9, abs=1e-6)
    two = span(RadialBearing("top", 0, k, z=-1e-4), RadialBearing("bottom", 6, k, z=3e-4))
    assert sag(two) == pytest.approx([0, 1e-4], abs=1e-15)  # on two bearings it stays straight


@pytest.mark.parametrize("name", ["round", "pads", "film", "crack", "tilted", "point mass"])
def test_all_bearings_out_of_line_together_are_a_stator_out_of_line(name):
    here = MACHINES[name]()
    shift = 0.01 * here.air_gap.gap
    moved = replace(here, **{group: tuple(replace(b, x=-shift) for b in getattr(here, group))
                             for group in ("bearings", "pad_bearings", "films")})
    method = HarmonicBalance(5)
    one = method.solve(here.model(), here.speed, 0.02)
    other = method.solve(moved.model(), here.speed, 0.01)
    assert other.mean + [shift, 0] == pytest.approx(one.mean, abs=1e-9)
    assert other.amplitudes == pytest.approx(one.amplitudes, abs=1e-9)
    for bearing, force in one.bearing_forces.items():
        assert other.bearing_forces[bearing].static == pytest.approx(force.static, rel=1e-5,
                                                                     abs=1.0)


def bowed(speed, unbalance=0.0, size=2e-4, phase=0.4):
    """A disc on a shaft without mass between hinges that is bowed."""
    disc = RigidBody("disc", 3, 1e4, unbalance=unbalance)
    machine = span(bodies=(disc,), density=1e-9, bows=(Bow("bow", 0, 6, size, phase),))
    orbit = HarmonicBalance(1).solve(machine.model(), speed)
    stiffness = 1 / (L**3 / (48 * EI) + L / (4 * GA))
    return orbit.node_coefficients(3)[:, 1:], stiffness, 1e4


@pytest.mark.parametrize("share", [1e-3, 0.5, 0.9, 1.3])
def test_a_bowed_rotor_answers_as_its_formula(share):
    stiffness = 1 / (L**3 / (48 * EI) + L / (4 * GA))
    speed = share * math.sqrt(stiffness / 1e4)
    found, k, m = bowed(speed, unbalance=2.0)
    # r = (k b e^{iψ} + U Ω²)/(k − m Ω²), in z + ix
    r = (k * 2e-4 * np.exp(0.4j) + 2.0 * speed**2) / (k - m * speed**2)
    assert found == pytest.approx(np.array([[r.real, r.imag], [-r.imag, r.real]]), rel=1e-5)


def test_a_kink_turns_the_free_end_of_a_shaft_about_it():
    kink, angle = Bow("kink", 2, 3, 1e-4), 8 * 1e-4 / (L / 6)  # the turn of a whole arc
    machine = span(RadialBearing("a", 0, STIFF), RadialBearing("b", 2, STIFF), density=1e-6,
                   bows=(kink,))
    orbit = HarmonicBalance(1).solve(machine.model(), 1e-3)
    assert np.hypot(*orbit.node_coefficients(6)[1, 1:]) == pytest.approx(angle * 3.5, rel=1e-6)


def test_a_collar_out_of_square_makes_a_slow_shaft_lean():
    collar = ThrustBearing("collar", 2, 5e8, out_of_square=1e-4, phase=0.3)
    machine = span(RadialBearing("guide", 2, 1e9), density=1e-6, thrust_bearings=(collar,))
    orbit = HarmonicBalance(1).solve(machine.model(), 1e-3)
    away = 1e-4 * 4.0 * np.array([math.cos(0.3), math.sin(0.3)])  # at the end, 4 m below
    assert orbit.node_coefficients(6)[:, 1:] == pytest.approx(
        np.array([away, [-away[1], away[0]]]), rel=1e-6)


def test_a_slot_under_its_weight_makes_the_2x_of_an_asymmetric_shaft():
    """In axes that turn with the shaft its weight turns backward, which is a linear problem."""
    disc = RigidBody("disc", 2, 3e3)
    nodes = [0.0, 1.0, 2.0, 4.0]
    shaft = Shaft(nodes, 0.2, E, 1e-9, NU, KAPPA, "timoshenko")
    slot = Crack("slot", 1, 0.3, breathing="open")
    machine = Machine("slotted", 10.0, shaft, (disc,), (
        RadialBearing("top", 0, STIFF), RadialBearing("bottom", 3, STIFF)), cracks=(slot,),
        gravity=Gravity(9.81))
    model, speed, weight = machine.model(), 20.0, 3e3 * 9.81
    orbit = HarmonicBalance(6).solve(model, speed)
    # stiffness of the disc along the slot and across it, from two shafts: cracked and whole
    unit = np.eye(model.size)[8:10]
    opening = model.selection[2:] if len(model.selection) > 2 else model.selection
    loss = model.law.parts[1].law.loss

    def stiffness(lost):
        K = model.K - lost * np.outer(opening[0], opening[0])
        return 1 / (unit[0] @ np.linalg.solve(K, unit[0]))

    soft, hard, m = stiffness(loss), stiffness(0.0), 3e3
    # ξ = u cos Ωt and η = −v sin Ωt in turning axes are 0X, (u + v)/2, and 2X in fixed ones
    A = np.array([[soft - 2 * m * speed**2, 2 * m * speed**2],
                  [2 * m * speed**2, hard - 2 * m * speed**2]])
    u, v = np.linalg.solve(A, [weight, weight])
    node = orbit.node_coefficients(2)
    assert np.hypot(*node[0, 3:5]) == pytest.approx(abs(u - v) / 2, rel=1e-6)
    assert -node[1, 0] == pytest.approx((u + v) / 2, rel=1e-6)


def loaded():
    """The paper's unit with every load there is."""
    return MACHINES["loaded"]()


def test_every_verb_feels_the_loads():
    machine = loaded()
    model, speed = machine.model(), machine.speed
    orbit = HarmonicBalance(6).solve(model, speed, 0.02)
    bare = HarmonicBalance(6).solve(load_machine("kaplan-150rpm").model(), speed, 0.02)
    assert np.abs(orbit.mean - bare.mean).max() > 3e-5
    # from the loads' own linear answer, 200 revolutions later, on a basis
    motion = integrate(model, Newmark(256), speed=speed, static_eccentricity=0.02,
                       revolutions=200, ramp=40)
    assert motion.coefficients(4) == pytest.approx(orbit.coefficients[:, :9], abs=2e-6)
    twice = follow(model, "unbalance", to=2.0, speed=speed, static_eccentricity=0.02)
    there = HarmonicBalance(4).solve(model.with_unbalance(2.0), speed, 0.02, start=orbit)
    assert twice[-1].coefficients == pytest.approx(there.coefficients, abs=1e-12)
    assert follow(model, "loads.radial thrust.force", to=2e5, speed=speed)[-1].smallest_gap \
        == pytest.approx(HarmonicBalance(4).solve(
            replace(machine, loads=(replace(machine.loads[0], force=2e5),)).model(),
            speed).smallest_gap, rel=1e-9)


def test_maps_feel_the_loads():
    pytest.importorskip("xarray", reason="maps need the extra [maps]")
    machine = loaded()
    orbit = HarmonicBalance(6).solve(machine.model(), machine.speed, 0.02)
    here = basins([orbit], [0.0, 1e-5], [0.0], revolutions=20, steps=256)
    assert (here.ends == 0).all()
    rows = steady_map(machine, "static_eccentricity", [0.02], "unbalance", [1.0])
    assert 1e3 * float(rows["smallest_gap"][0, 0]) == pytest.approx(1e3 * orbit.smallest_gap,
                                                                    rel=1e-5)


def test_a_crack_makes_2x_without_field_where_a_load_stands_still():
    unit = replace(load_machine("kaplan-150rpm"), cracks=(Crack("crack", 8, 0.2),))
    method, speed = HarmonicBalance(8), rpm(150)

    def second(machine):
        return method.solve(machine.model().with_field(0.0), speed).amplitudes[0, 1]

    thrust = Load("thrust", 12, 1e5)
    model = replace(unit, loads=(thrust,)).model().with_field(0.0)
    orbit = method.solve(model, speed)
    motion = integrate(model, RungeKutta(1e-8), speed=speed, start=orbit, revolutions=3)
    assert motion.coefficients(3)[0, 3:5] == pytest.approx(orbit.coefficients[0, 3:5], abs=2e-9)
    assert second(unit) < 1e-10 < 1e-7 < second(replace(unit, loads=(thrust,)))
    out = replace(unit, thrust_bearings=(replace(unit.thrust_bearings[0], out_of_square=1e-4),))
    assert second(out) < 1e-9  # a bend that turns with the crack leaves it as it is


def test_the_line_says_where_it_passes():
    orbit = HarmonicBalance(4).solve(loaded().model(), rpm(150), 0.02)
    said = line_picture(orbit).reading
    for name, force in orbit.bearing_forces.items():
        assert name in said and f"{1e-3 * np.hypot(*force.static):.4g} kN" in said
    with pytest.raises(BadInput, match="needs a machine with a shaft"):
        line_picture(HarmonicBalance(4).solve(load_machine("jeffcott").model(), rpm(150)))


@pytest.mark.parametrize("parts, said", [
    ({"loads": (Load("thrust", 9, 1e5),)}, "loads.thrust.node is 9, off the shaft"),
    ({"bows": (Bow("bow", 2, 9, 1e-4),)}, "bows.bow.end_node is 9, off the shaft"),
    ({"loads": (Load("thrust", 3, 1e5, offset=99.0),)}, "loads.thrust.offset is 99 m"),
    ({"loads": (Load("a", 1, 1.0), Load("a", 2, 1.0))}, "the name 'a' is used twice")])
def test_a_load_that_cannot_be_is_refused(parts, said):
    with pytest.raises(BadInput, match=said):
        span(**parts)


def test_a_bow_runs_down_and_needs_a_shaft():
    with pytest.raises(BadInput, match=r"bows.bow.end_node is 2; it must lie below bows.bow.node"):
        Bow("bow", 2, 2, 1e-4)
    with pytest.raises(BadInput, match="has no shaft to be in"):
        replace(load_machine("jeffcott"), bows=(Bow("bow", 0, 1, 1e-4),))
