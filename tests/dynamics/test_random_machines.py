"""Hypothesis over random machines: each solves, and an independent check holds, or ends in a clear
error.

Nothing silent: no other exception, no warning (pytest turns warnings into errors).
"""

import math
from dataclasses import replace

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hydrolab import (
    HarmonicBalance,
    Newmark,
    floquet,
    follow,
    integrate,
    newton,
    powell_dog_leg,
    sweep,
)
from hydrolab.errors import BadInput, Contact, NoConvergence
from tests.benchmarks.verdicts import verdicts
from tests.reference.full_balance import dynamic_matrix

CLEAR = (BadInput, NoConvergence, Contact)
QUIET = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow],
                 derandomize=True)


def full_residual(orbit):
    """Left over in the equations of all DOFs, relative to the loads; the slow twin's matrices, an
    FFT for the pull.
    """
    model, samples = orbit.model, orbit.equations.samples
    turn = 2 * np.pi * np.arange(samples) / samples
    pull = model.law.force(orbit.positions(turn) - orbit.centre[:, None])
    forces = model.selection.T @ pull + orbit.speed**2 * (
        np.outer(model.unbalance_sin, np.sin(turn)) + np.outer(model.unbalance_cos, np.cos(turn)))
    spectrum = 2 / samples * np.fft.rfft(forces)[:, :orbit.harmonics + 1]
    parts = [spectrum[:, 0].real / 2]
    for k in range(1, orbit.harmonics + 1):
        parts += [-spectrum[:, k].imag, spectrum[:, k].real]
    matrix, loads = dynamic_matrix(model, orbit.speed, orbit.harmonics), np.concatenate(parts)
    unknowns = orbit.shaft.T.ravel()
    # what rounding alone leaves: the entries of Λ times the unknowns are far larger than their sum
    rounding = np.abs(matrix) @ np.abs(unknowns)
    return (np.abs(matrix @ unknowns - loads) / (rounding + np.abs(loads).max())).max()


@QUIET
@given(seed=st.integers(0, 10**6), eccentricity=st.floats(-0.5, 0.5), direction=st.floats(0, 6.3),
       harmonics=st.integers(1, 6), solver=st.sampled_from([newton, powell_dog_leg]))
def test_harmonic_balance(make_random, seed, eccentricity, direction, harmonics, solver):
    machine = make_random(np.random.default_rng(seed))
    method = HarmonicBalance(harmonics, solver=solver)
    try:
        orbit = method.solve(machine.model(), machine.speed, eccentricity, direction=direction)
    except CLEAR as error:
        assert str(error).endswith((".", "steady state.")) and len(str(error)) > 40
        return
    assert orbit.smallest_gap > 0
    assert orbit.residual < 1e-9 * orbit.equations.force
    assert full_residual(orbit) < 1e-9
    assert "smallest gap" in str(orbit)


@QUIET
@given(seed=st.integers(0, 10**6))
def test_branches(make_random, seed):
    machine = make_random(np.random.default_rng(seed))
    model = machine.model()
    try:
        branch = follow(model, to=0.6, speed=machine.speed)
        natural = sweep(model, HarmonicBalance(), branch.static_eccentricity[branch.first_leg],
                        speed=machine.speed)
    except CLEAR:
        return
    assert len(branch.stopped) > 10
    assert np.isfinite(branch.unknowns).all()
    assert np.diff(branch.static_eccentricity[branch.first_leg]).min(initial=0) >= 0 or branch.folds
    for index in (1, len(branch) // 2, len(branch) - 1):
        if branch.smallest_gaps[index] > 0:
            assert full_residual(branch[index]) < 1e-9
    for fold in range(len(branch.folds)):
        orbit = branch.at_fold(fold)
        jacobian = orbit.equations.linearise(orbit.coefficients.ravel() / orbit.equations.length,
                                             orbit.centre)[1]
        assert np.linalg.svd(jacobian, compute_uv=False)[-1] < 1e-6
    assert len(natural) > 0


@settings(QUIET, max_examples=20)
@given(seed=st.integers(0, 10**6), eccentricity=st.floats(0, 0.2))
def test_integration_stays_on_the_orbit_or_leaves_it_as_floquet_says(make_random, seed,
                                                                     eccentricity):
    machine = make_random(np.random.default_rng(seed))
    model = machine.model()
    try:
        orbit = HarmonicBalance(6).solve(model, machine.speed, eccentricity)
        verdict = floquet(orbit)
        run = integrate(model, Newmark(256), speed=machine.speed, static_eccentricity=eccentricity,
                        revolutions=8,
                        start=orbit)
    except CLEAR:
        return
    assert np.isfinite(run.positions).all()
    assert math.isfinite(verdict.largest)
    if verdict.verdict == "stable" and verdict.error < 1e-6:
        distance = np.abs(run.positions - orbit.positions(machine.speed * run.times)).max()
        swing = np.abs(orbit.coefficients[:, 1:]).max()
        assert run.finished
        assert distance < 0.2 * swing + 1e-3 * model.gap


@QUIET
@given(seed=st.integers(0, 10**6), which=st.sampled_from(["no bearings", "one bearing",
                                                          "no damping", "no field",
                                                          "no unbalance", "at a resonance",
                                                          "huge field"]))
def test_degenerate_machines(make_random, seed, which):
    machine = make_random(np.random.default_rng(seed))
    speed = machine.speed
    if which == "no bearings":
        machine = replace(machine, bearings=(), damping=None)
    elif which == "one bearing":
        machine = replace(machine, bearings=machine.bearings[:1], damping=None)
    elif which in ("no damping", "at a resonance"):
        bearings = tuple(replace(b, damping=0.0) for b in machine.bearings)
        machine = replace(machine, bearings=bearings, damping=None)
    model = machine.model()
    model = model.with_field({"no field": 0.0, "huge field": 30.0}.get(which, 1.0))
    if which == "no unbalance":
        model = model.with_unbalance(0.0)
    elif which == "at a resonance":
        rest = np.linalg.eigvals(np.block([[np.zeros_like(model.K), np.eye(model.size)],
                                           [-np.linalg.solve(model.M, model.K), 0 * model.K]]))
        speed = float(np.sort(np.abs(rest.imag))[2])
    try:
        orbit = HarmonicBalance().solve(model, speed, 0.05)
        assert full_residual(orbit) < 1e-8
        run = integrate(model, Newmark(64), speed=speed, static_eccentricity=0.05, revolutions=2,
                        start=orbit)
        assert np.isfinite(run.positions).all()
        assert floquet(orbit).verdict in ("stable", "unstable", "unknown")
    except CLEAR as error:
        assert len(str(error)) > 40
        if which in ("no bearings", "one bearing"):
            assert isinstance(error, BadInput)
    else:
        assert which not in ("no bearings", "one bearing")


# ------------------------------------------------------------------ verdicts on all degrees of
# freedom

def test_verdicts_are_those_of_all_degrees_of_freedom():
    """Seals, dampers, films, pads, damping from 1e-5 or none, with and without the pull."""
    judged = list(verdicts(range(40)))
    assert len(judged) > 30
    assert {verdict.found.verdict for verdict in judged} >= {"stable", "unstable"}
    assert not [v for v in judged if v.wrong or v.miscounted]
    assert sum(v.found.verdict == "unknown" for v in judged) <= 1
