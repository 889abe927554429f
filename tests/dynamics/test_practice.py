"""Design practice against the nonlinear answer: exact cases, limits, and what the map says at its
border.
"""

import math

import numpy as np
import pytest

from hydrolab import BadInput, HarmonicBalance, LinearPull, load_machine, modes
from hydrolab.dynamics.practice import DesignNumbers, compare, critical_speed, practice, practice_errors


def test_numbers_of_a_point_mass_are_exact(peer, speed):
    """(k − k_m − m Ω² + i c Ω) r = U Ω² and bend = −k_m e/(k − k_m)."""
    k, pull, mass, damping = peer.K[0, 0], peer.law.stiffness, peer.M[0, 0], peer.C[0, 0]
    linear, exact = compare(peer, speed, 0.03)
    unbalance = np.hypot(peer.unbalance_cos, peer.unbalance_sin).max()
    assert linear.critical_speed == pytest.approx(math.sqrt((k - pull) / mass), rel=1e-10)
    dynamic = complex(k - pull - mass * speed**2, damping * speed)
    assert linear.amplitude == pytest.approx(abs(unbalance * speed**2 / dynamic), rel=1e-10)
    assert linear.bend == pytest.approx(pull * 0.03 * peer.gap / (k - pull), rel=1e-10)
    total = linear.amplitude + linear.bend
    assert linear.bearing_force == pytest.approx(k * total, rel=1e-4)  # the largest of 360 samples
    assert exact.critical_speed < linear.critical_speed and exact.bend > linear.bend


def test_critical_speed_is_where_a_whirl_meets_the_rotation():
    unit = load_machine("kaplan-150rpm").model()
    bare = unit.with_field(0)
    found = critical_speed(bare, bare.K)
    whirls = modes(bare, found).frequencies
    assert np.abs(whirls - found).min() < 1e-3 * found  # damping of 1 % moves them by 5e-5
    assert math.isnan(critical_speed(bare, bare.K - 1e12 * bare.selection.T @ bare.selection))


def test_errors_vanish_with_the_eccentricity(unit, speed):
    """In a weak field the bend lacks 3/2 ε², the first term that a negative stiffness leaves out.
    """
    weak = practice_errors(unit.with_unbalance(1e-3), speed, [0.0, 0.02, 0.05], [0.05])
    assert weak.bend[0, 1:] == pytest.approx(-1.5 * np.array([0.02, 0.05]) ** 2, rel=0.02)
    assert max(np.abs(weak.amplitude).max(), np.abs(weak.critical_speed).max()) < 1e-4
    errors = practice_errors(unit, speed, [0.0, 0.02, 0.05], [0.05, 1.0])
    assert errors.worst[1, 0] < 2e-3 < errors.worst[1, 2]
    assert (np.diff(errors.worst, axis=1) > 0).all()
    linear, exact = compare(unit, speed, 0.05)
    for name, simple, true in zip(DesignNumbers._fields, linear, exact, strict=True):
        assert getattr(errors, name)[1, 2] == pytest.approx(simple / true - 1, rel=1e-6)


def test_the_map_ends_at_the_fold(peer, speed):
    errors = practice_errors(peer, speed, np.linspace(0, 0.1, 11), [1.0])
    assert errors.folds[0] == pytest.approx(0.078325643, rel=1e-6)  # the benchmark's fold
    assert np.isfinite(errors.worst[0]).tolist() == [True] * 8 + [False] * 3
    assert errors.safe_to(1e9)[0] == pytest.approx(0.07)
    assert math.isnan(errors.safe_to(1e-9)[0])


def test_practice_is_the_same_machine_with_another_law(unit, speed):
    linear = practice(unit)
    assert type(linear.law) is LinearPull and linear.K is unit.K
    orbit = HarmonicBalance(3).solve(linear, speed, 0.05)
    assert orbit.amplitudes[:, 1:].max() < 1e-15  # a linear machine has 1X only
    with pytest.raises(BadInput, match="LinearPull"):
        practice(linear)
    with pytest.raises(BadInput, match="ascend"):
        practice_errors(unit, speed, [0.02, 0.01], [1.0])
