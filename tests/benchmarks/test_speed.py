"""How long things take. No test here fails for being slow: `python -m tests.benchmarks.report` prints the table.

`per` divides a benchmark's time by what it does, `target` is what issues ask for, s; BLAS runs on one thread.
"""

import subprocess
import sys

import numpy as np
import pytest

from hydrolab import (
    CentralDifference,
    HarmonicBalance,
    Newmark,
    RungeKutta,
    floquet,
    follow,
    integrate,
    powell_dog_leg,
    sweep,
)
from hydrolab.dynamics.condensation import condense
from hydrolab.dynamics.full_balance import solve_full

ROWS = np.arange(0, 0.089, 0.001)


def run(benchmark, action, what, *, per=1, target=None, rounds=15):
    """Time an action and note what the report needs."""
    benchmark.extra_info.update(what=what, per=per, target=target)
    return benchmark.pedantic(action, rounds=rounds, warmup_rounds=min(1, rounds - 1))


def test_reference_kernel(benchmark):
    """What a solver step is made of: small LAPACK solves and short array arithmetic, 1000 times."""
    random = np.random.default_rng(0)
    matrix, e = random.normal(size=(18, 18)) + 5 * np.eye(18), 0.1 * random.normal(size=(2, 64))

    def kernel():
        for _ in range(1000):
            np.linalg.solve(matrix, matrix[0])
            (1 / (1 - (e * e).sum(axis=0))) ** 1.5 * e
    run(benchmark, kernel, "reference kernel (18 × 18 solve, 64 samples)", per=1000)


@pytest.mark.parametrize("elements", [4, 12, 48])
def test_natural_point(benchmark, make_kaplan, speed, elements):
    model = make_kaplan(elements).model()
    branch = run(benchmark, lambda: sweep(model, HarmonicBalance(), ROWS, speed=speed),
                 f"natural point, {elements} elements", per=len(ROWS), target=200e-6)
    assert len(branch) == len(ROWS)


def test_natural_point_by_dog_leg(benchmark, unit, speed):
    method = HarmonicBalance(solver=powell_dog_leg)
    branch = run(benchmark, lambda: sweep(unit, method, ROWS, speed=speed), "natural point, 12 elements, dog-leg",
                 per=len(ROWS))
    assert len(branch) == len(ROWS)


@pytest.mark.parametrize("elements", [4, 12, 48])
def test_arclength_point(benchmark, make_kaplan, speed, elements):
    model = make_kaplan(elements).model()
    points = len(follow(model, to=0.2, speed=speed))
    branch = run(benchmark, lambda: follow(model, to=0.2, speed=speed), f"arclength point, {elements} elements",
                 per=points, target=180e-6)
    assert len(branch.folds) == 3


def test_whole_branch(benchmark, unit, speed):
    branch = run(benchmark, lambda: follow(unit, to=0.2, speed=speed), "branch to the third fold", target=40e-3)
    assert len(branch) >= 80


def test_floquet_of_an_orbit(benchmark, unit, speed):
    orbit = HarmonicBalance().solve(unit, speed, 0.08)
    assert run(benchmark, lambda: floquet(orbit), "Floquet multipliers of one orbit").verdict == "stable"


@pytest.mark.parametrize("elements", [12, 48])
def test_condensation(benchmark, make_kaplan, speed, elements):
    model = make_kaplan(elements).model()
    run(benchmark, lambda: condense.__wrapped__(model, speed, 4, 64), f"elimination of {elements} elements, once a speed")


@pytest.mark.parametrize("elements", [4, 12])
def test_full_twin(benchmark, make_kaplan, speed, elements):
    model = make_kaplan(elements).model()
    run(benchmark, lambda: solve_full(model, speed, 0.05, steps=1), f"steady state, all DOFs, {elements} elements",
        rounds=3)


def test_cold_steady_state(benchmark, unit, speed):
    run(benchmark, lambda: HarmonicBalance().solve(unit, speed, 0.05), "steady state, condensed, from the linear one")


def test_a_thousand_revolutions(benchmark, unit, speed):
    motion = run(benchmark, lambda: integrate(unit, CentralDifference(512), speed=speed, static_eccentricity=0.088,
                                              revolutions=1000, ramp=400),
                 "1000 revolutions, central difference, 512 steps, 12 modes", target=10.0, rounds=1)
    orbit = HarmonicBalance().solve(unit, speed, 0.088)
    assert np.abs(motion.coefficients(4) - orbit.coefficients).max() < 1e-3 * np.abs(orbit.coefficients).max()


@pytest.mark.parametrize("method", [CentralDifference(512), Newmark(512)], ids=["central", "newmark"])
def test_time_step(benchmark, unit, speed, method):
    run(benchmark, lambda: integrate(unit, method, speed=speed, static_eccentricity=0.05, revolutions=20),
        f"time step, {type(method).__name__}, 12 modes", per=20 * 512, rounds=3)


def test_steady_state_in_time(benchmark, unit, speed):
    """DOP853 until a harmonic balance of 8 harmonics agrees to 1e-6, started from the linear response."""
    orbit = HarmonicBalance(8).solve(unit, speed, 0.05)

    def until_steady():
        motion = None
        for _ in range(20):
            motion = integrate(unit, RungeKutta(1e-8), speed=speed, static_eccentricity=0.05, revolutions=10,
                               start=motion, modes=4)
            if np.abs(motion.coefficients(4) - orbit.coefficients[:, :9]).max() < 1e-5 * np.abs(orbit.coefficients).max():
                return motion
        return motion
    motion = run(benchmark, until_steady, "steady state in time, DOP853, 4 modes", rounds=1)
    assert np.abs(motion.coefficients(4) - orbit.coefficients[:, :9]).max() < 1e-3 * np.abs(orbit.coefficients).max()


def test_import(benchmark):
    """Beyond NumPy and the parts of SciPy that are used; a fresh interpreter each time."""
    code = ("import time, numpy, scipy.linalg, scipy.optimize, scipy.integrate; t = time.perf_counter(); "
            "import hydrolab; print(time.perf_counter() - t)")
    seconds = [float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
               for _ in range(3)]
    run(benchmark, lambda: None, "import hydrolab beyond NumPy and SciPy", target=0.3)
    benchmark.extra_info["seconds"] = float(min(seconds))
