"""Design practice against the nonlinear answer: exact cases, limits, and where the map ends."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from hydrolab import HarmonicBalance, LinearPull, load_machine, modes
from hydrolab.machine import RadialBearing


def test_numbers_of_a_point_mass_are_exact(script, make_jeffcott, speed):
    """(k − k_m − m Ω² + i c Ω) r = U Ω², bend = −k_m e/(k − k_m), force |k + i c Ω| r + k bend."""
    machine = make_jeffcott()
    model = machine.model()
    k, pull, mass, damping = model.K[0, 0], model.law.stiffness, model.M[0, 0], model.C[0, 0]
    linear, exact = script.compare(machine, 0.03)
    unbalance = machine.bodies[0].unbalance
    assert linear.critical_speed == pytest.approx(math.sqrt((k - pull) / mass), rel=1e-10)
    dynamic = complex(k - pull - mass * speed**2, damping * speed)
    assert linear.amplitude == pytest.approx(abs(unbalance * speed**2 / dynamic), rel=1e-10)
    assert linear.bend == pytest.approx(pull * 0.03 * model.gap / (k - pull), rel=1e-10)
    total = abs(complex(k, damping * speed)) * linear.amplitude + k * linear.bend
    assert linear.bearing_force == pytest.approx(total, rel=1e-4)  # the largest of 360 samples
    assert exact.critical_speed < linear.critical_speed and exact.bend > linear.bend


def test_the_damper_is_part_of_the_bearing_force(script):
    """107.8 kN by the spring alone, 128.0 kN with it: the unit with 1e7 N s/m on its guide
    bearings, centred, from the dynamic stiffness of all its coordinates.
    """
    unit = load_machine("kaplan-150rpm")
    damped = replace(unit, bearings=tuple(replace(b, damping=1e7 * np.eye(2))
                                          for b in unit.bearings))
    model = script.practice(damped).model()
    omega = unit.speed
    pull = model.law.stiffness * model.selection.T @ model.selection
    dynamic = model.K - pull - omega**2 * model.M + 1j * omega * (model.C + omega * model.G)
    q = np.linalg.solve(dynamic, omega**2 * (model.unbalance_cos - 1j * model.unbalance_sin))
    forces = [np.abs(b.stiffness[0, 0] + 1j * omega * 1e7) * abs(q[4 * b.node])
              for b in unit.bearings]
    found = script.compare(damped, 0.0)[0].bearing_force
    assert found == pytest.approx(max(forces), rel=1e-4)


def test_anisotropic_bearings_have_a_force(script):
    unit = load_machine("kaplan-150rpm")
    first = unit.bearings[0]
    oval = replace(unit, bearings=(RadialBearing(first.name, first.node, [1.2e9, 1.6e9]),
                                   *unit.bearings[1:]))
    force = [script.compare(machine, 0.02)[0].bearing_force for machine in (unit, oval)]
    assert force[1] == pytest.approx(force[0], rel=0.2) and force[1] != force[0]


def test_critical_speed_is_where_a_forward_whirl_meets_the_rotation(script):
    """374 rpm; the backward whirl meets it at 187 rpm, which an unbalance of a round machine does
    not drive.
    """
    model = script.practice(load_machine("kaplan-150rpm")).model()
    stiffness = model.K - model.law.stiffness * model.selection.T @ model.selection
    found = script.forward_critical(model.M, model.G, stiffness)
    assert found * 30 / np.pi == pytest.approx(374, abs=1)
    whirls = modes(replace(model.with_field(0), K=stiffness), found)
    at = np.abs(whirls.frequencies - found).argmin()
    assert whirls.frequencies[at] == pytest.approx(found, rel=1e-3)  # 1 % damping moves it by 5e-5
    assert whirls.direction[at] == "forward"
    both = scipy.linalg.eigh(model.M - 1j * model.G, stiffness, eigvals_only=True)[-1] ** -0.5
    assert both * 30 / np.pi == pytest.approx(187, abs=1)
    pulled = model.K - 1e12 * model.selection.T @ model.selection
    assert math.isnan(script.forward_critical(model.M, model.G, pulled))


def test_errors_vanish_with_the_eccentricity(script, make_kaplan):
    """In a weak field the bend lacks 3/2 ε², the first term that a negative stiffness leaves out.
    """
    pytest.importorskip("xarray", reason="maps need the extra `maps`")
    machine = make_kaplan()
    weak = replace(machine, air_gap=replace(machine.air_gap, field=0.025),
                   bodies=tuple(replace(b, unbalance=1e-3 * b.unbalance) for b in machine.bodies))
    for eccentricity in (0.02, 0.05):
        linear, exact = script.compare(weak, eccentricity)
        assert linear.bend / exact.bend - 1 == pytest.approx(-1.5 * eccentricity**2, rel=0.02)
    at = np.array([0.0, 0.02, 0.05])
    errors = script.practice_errors(machine, at, np.array([0.05, 1.0]))
    assert np.abs(errors.amplitude[0]).max() < 1e-4
    assert (np.diff(np.abs(errors.amplitude[1])) > 0).all()
    linear, exact = script.compare(machine, 0.05)
    assert linear.amplitude / exact.amplitude - 1 == pytest.approx(errors.amplitude[1, 2], rel=0.02)


def test_the_map_ends_at_the_fold(script, make_jeffcott):
    """The 2-DOF benchmark's fold, 0.078325643, computed by two peers of the library."""
    pytest.importorskip("xarray", reason="maps need the extra `maps`")
    eccentricities = np.linspace(0, 0.1, 11)
    errors = script.practice_errors(make_jeffcott(), eccentricities, np.array([0.9, 1.0]))
    assert errors.folds[1] == pytest.approx(0.078325643, rel=1e-6)
    assert np.isfinite(errors.amplitude[1]).tolist() == [True] * 8 + [False] * 3
    assert errors.safe_to(eccentricities, 1e9)[1] == pytest.approx(0.07)
    assert math.isnan(errors.safe_to(eccentricities, 1e-9)[1])
    picture = script.picture(errors, eccentricities, np.array([0.9, 1.0]))
    assert "fold at 7.833 %" in picture.reading and "at 7 %, the last point" in picture.reading


def test_practice_is_the_same_machine_with_another_law(script, make_kaplan, speed):
    linear = script.practice(make_kaplan()).model()
    assert type(linear.law) is LinearPull
    orbit = HarmonicBalance(3).solve(linear, speed, 0.05)
    assert orbit.amplitudes[:, 1:].max() < 1e-15  # a linear machine has 1X only
