"""How long things take. No test here fails for being slow: `python -m tests.benchmarks.report`
prints the table.

`per` divides a benchmark's time by what it does, `target` is what issues ask for, s; BLAS runs on
one thread. In an ordinary test run everything runs once, the long ones reduced; the report runs
them whole, with several rounds.
"""

import itertools
import json
import math
import os
import subprocess
import sys
import timeit
import venv
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import root

from hydrolab import (
    Arclength,
    CentralDifference,
    HarmonicBalance,
    Newmark,
    RungeKutta,
    arrivals,
    basins,
    branch_stability,
    floquet,
    follow,
    integrate,
    integrity,
    load_machine,
    orbits_at,
    powell_dog_leg,
    stable_orbits_at,
    steady_map,
    sweep,
    update_branch,
    vary,
)
from hydrolab.dynamics.harmonic_balance import condense
from hydrolab.dynamics.stability import floquet_all
from hydrolab.machine.bearings import PadBearing, Seal, TableBearing
from hydrolab.machine.parts import RayleighDamping, Shaft
from hydrolab.paper.calibration import judge_family, load_family
from tests.benchmarks.report import AS_IT_STANDS
from tests.reference.full_balance import dynamic_matrix, solve_full

ROWS = np.arange(0, 0.089, 0.001)
MATRIX = np.eye(18) * 5 + 0.1 * np.sin(np.arange(324.0)).reshape(18, 18)
PATH = 0.1 * np.sin(np.arange(128.0)).reshape(2, 64)
THREE = Arclength(max_folds=3)
ELEMENTS = (3, 12, 48)


@pytest.fixture
def whole(request):
    """Whether this is the report's run: whole problems and several rounds."""
    return bool(request.config.getoption("benchmark_only"))


def kernel():
    """What a solver step is made of: one small LAPACK solve and short array arithmetic."""
    np.linalg.solve(MATRIX, MATRIX[0])
    return (1 / (1 - (PATH * PATH).sum(axis=0))) ** 1.5 * PATH


def kernel_seconds():
    """The reference kernel now, s: the best of five times 100."""
    return min(timeit.repeat(kernel, number=100, repeat=5)) / 100


@pytest.fixture
def run(benchmark, whole):
    """Time an action and note what the report needs, with the reference kernel measured before and
    after.
    """
    def timed(action, what, *, per=1, target=None, rounds=30):
        rounds = rounds if whole else 1
        before = kernel_seconds()
        result = benchmark.pedantic(action, rounds=rounds, warmup_rounds=min(1, rounds - 1))
        benchmark.extra_info.update(what=what, per=per, target=target,
                                    kernel=max(before, kernel_seconds()))
        return result
    return timed


@pytest.fixture(scope="module")
def shipped():
    return load_machine("kaplan-150rpm")


def unit_of(elements, make_kaplan):
    """The trial unit with that many elements; 3 is the least that has its bearings at nodes."""
    if elements > 3:
        return make_kaplan(elements).model()
    machine = make_kaplan(4)
    shaft = Shaft(np.delete(machine.shaft.nodes, 2), 0.71, 2e11, 7850.0, 0.3, 0.9)
    generator, runner = machine.bodies
    guide, lower = machine.bearings
    return replace(machine, shaft=shaft, bodies=(generator, replace(runner, node=3)),
                   bearings=(guide, replace(lower, node=2)),
                   thrust_bearings=(replace(machine.thrust_bearings[0], node=1),),
                   damping=RayleighDamping((0.01, 0.01))).model()


def test_reference_kernel(run):
    run(lambda: [kernel() for _ in range(1000)], "reference kernel (18 × 18 solve, 64 samples)",
        per=1000)


# ------------------------------------------------------------------ points and branches

@pytest.mark.parametrize("elements", ELEMENTS)
def test_natural_point(run, make_kaplan, speed, elements):
    model = unit_of(elements, make_kaplan)
    branch = run(lambda: sweep(model, HarmonicBalance(), ROWS, speed=speed),
                 f"natural point, {elements} elements",
                 per=len(ROWS), target=120e-6)
    assert len(branch) == len(ROWS)


def test_natural_point_of_a_unit_as_it_stands(run, make_kaplan, speed):
    """Its guide bearing by a table over the speed and in a bracket, and a seal at the runner."""
    machine = make_kaplan(12)
    guide, lower = machine.bearings
    fours = [[k, 0.0, 0.0, k] for k in (1.6e9, 1.7e9)], [[c, 0.0, 0.0, c] for c in (1e6, 2e6)]
    table = TableBearing("guide", guide.node, [0.5 * speed, 2.0 * speed], *fours,
                         bracket_stiffness=2e10, bracket_mass=12e3)
    seal = Seal("seal", machine.nodes - 1, -8e7, 6e7)
    model = replace(machine, bearings=(lower,), tables=(table,), seals=(seal,)).model()
    branch = run(lambda: sweep(model, HarmonicBalance(), ROWS, speed=speed), AS_IT_STANDS,
                 per=len(ROWS))
    assert len(branch) == len(ROWS)


@pytest.mark.parametrize("elements", [12, 48])
@pytest.mark.parametrize("bearings", [0, 1, 2, 3])
def test_natural_point_with_further_laws(run, make_kaplan, speed, bearings, elements):
    """Pads at further nodes: 2(1 + bearings)(2m + 1) unknowns with m = 4, whatever the number of
    elements.
    """
    machine = make_kaplan(elements)
    pads = tuple(PadBearing(f"pads {i}", 2 + i, 8, 1e7, 1e-4, rounding=5e-5)
                 for i in range(bearings))
    model = replace(machine, pad_bearings=pads).model()
    method, rows = HarmonicBalance(), ROWS[:60:6]
    eq = method.equations(model, speed)
    branch = run(lambda: sweep(model, method, rows, speed=speed),
                 f"natural point, {2 + 2 * bearings} coordinates, {eq.linear.size} unknowns, "
                 f"{elements} elements",
                 per=len(rows))
    assert len(branch) == len(rows) and eq.linear.size == 2 * (1 + bearings) * 9


@pytest.mark.parametrize("bearings", [0, 1, 2, 3])
def test_what_its_unknowns_cost(run, bearings):
    size = 2 * (1 + bearings) * 9
    matrix = np.eye(size) * 5 + 0.1 * np.sin(np.arange(float(size * size))).reshape(size, size)
    run(lambda: [np.linalg.solve(matrix, matrix[0]) for _ in range(100)],
        f"one LAPACK solve of {size} unknowns", per=100)


def test_natural_point_by_dog_leg(run, unit, speed):
    method = HarmonicBalance(solver=powell_dog_leg)
    branch = run(lambda: sweep(unit, method, ROWS, speed=speed), "natural point, 12 elements, "
                 "dog-leg", per=len(ROWS))
    assert len(branch) == len(ROWS)


@pytest.mark.parametrize("elements", ELEMENTS)
def test_arclength_point(run, make_kaplan, speed, elements):
    model = unit_of(elements, make_kaplan)
    points = len(follow(model, to=0.2, speed=speed))
    branch = run(lambda: follow(model, to=0.2, speed=speed),
                 f"arclength point, {elements} elements", per=points,
                 target=180e-6)
    assert len(branch) == points


def test_whole_branch(run, shipped):
    model = shipped.model()
    branch = run(lambda: follow(model, speed=shipped.speed, method=THREE),
                 "branch to the third fold, 86 points", target=40e-3)
    assert len(branch) >= 80
    assert len(branch.folds) == 3


def test_branch_with_stability(run, shipped):
    """Every point counted on the whole machine, at two truncations and on two orbits."""
    model = shipped.model()
    found = run(lambda: branch_stability(follow(model, speed=shipped.speed, method=THREE),
                                         locate=False),
                "branch with counted stability of each point", target=400e-3)
    assert "unknown" not in found.verdicts


@pytest.mark.parametrize("elements", ELEMENTS)
def test_counted_verdict(run, make_kaplan, speed, elements):
    """Once the eigenvalues of the linear machine are there, whose number alone grows."""
    orbits = list(follow(unit_of(elements, make_kaplan), to=0.2, speed=speed, method=THREE))
    found = run(lambda: floquet_all(orbits), f"counted verdict of a point, {elements} elements",
                per=len(orbits), rounds=3)
    assert sum(f.verdict == "unknown" for f in found) <= 1  # beside a fold, with four harmonics


@pytest.mark.parametrize(("key", "reach"), [("speed", 1.5), ("field", 1.2),
                                            ("bearings.turbine guide bearing.stiffness", 2.0)])
def test_along_other_numbers(run, shipped, key, reach):
    """A model of its own each time, so that no elimination is kept."""
    model = shipped.model()
    first = {"speed": shipped.speed, "field": 1.0}.get(key) or model.number(key)[0]
    branch = run(lambda: follow(replace(model), key, to=reach * first, speed=shipped.speed,
                                static_eccentricity=0.03),
                 f"following the {key.split('.')[-1]} to {reach:g} times its own", rounds=3)
    assert len(branch) > 5


def test_branch_with_crossings(run, shipped):
    model = shipped.model()
    branch = follow(model, speed=shipped.speed, method=THREE)
    found = run(lambda: branch_stability(branch), "counted stability, five crossings located",
                rounds=5)
    assert len(found.crossings) == 5


@pytest.mark.parametrize("key", ["field", "bodies.generator.mass"])
def test_slider(run, shipped, key):
    """A new value each time, so that nothing is kept: machine, matrices, elimination, branch, folds
    and stability.
    """
    branch = follow(shipped.model(), speed=shipped.speed, method=THREE)
    own = shipped.air_gap.field if key == "field" else shipped.bodies[0].mass
    values = own * (1 + 0.004 * np.sin(np.arange(1000)))
    one = itertools.count()

    def moved():
        model = vary(shipped, {key: float(values[next(one)])}).model()
        new = update_branch(branch, model)
        return new, branch_stability(new, quick=True, locate=False)
    new, found = run(moved, f"following a slider, {key.split('.')[-1]}, with stability",
                     target=33e-3)
    assert len(new.folds) == 3
    assert len(found.points) == len(new) == len(branch)


def test_floquet_of_an_orbit(run, unit, speed):
    orbit = HarmonicBalance().solve(unit, speed, 0.08)
    assert run(lambda: floquet(orbit), "Floquet multipliers of one orbit").verdict == "stable"


@pytest.mark.parametrize("elements", [12, 48])
def test_condensation(run, make_kaplan, speed, elements):
    model = make_kaplan(elements).model()
    run(lambda: condense.__wrapped__(model, speed, 4, 64), f"elimination of {elements} elements, "
                                                           "once a speed")


@pytest.mark.parametrize("elements", [4, 12])
def test_full_twin(run, make_kaplan, speed, elements):
    model = make_kaplan(elements).model()
    run(lambda: solve_full(model, speed, 0.05, steps=1), f"steady state, all DOFs, {elements} "
                                                         "elements",
        rounds=3)


def test_cold_steady_state(run, unit, speed):
    run(lambda: HarmonicBalance().solve(unit, speed, 0.05), "steady state, condensed, from the "
        "linear one")


def test_a_thousand_revolutions(run, unit, speed, whole):
    motion = run(lambda: integrate(unit, CentralDifference(512), speed=speed,
                                   static_eccentricity=0.088,
                                              revolutions=1000 if whole else 30,
                                   ramp=400 if whole else 5),
                 "1000 revolutions, central difference, 512 steps, 12 modes", target=10.0, rounds=1)
    orbit = HarmonicBalance().solve(unit, speed, 0.088)
    if not whole:
        return
    assert np.abs(motion.coefficients(4)
                  - orbit.coefficients).max() < 1e-3 * np.abs(orbit.coefficients).max()


@pytest.mark.parametrize("method", [CentralDifference(512), Newmark(512)],
                         ids=["central", "newmark"])
def test_time_step(run, unit, speed, method):
    run(lambda: integrate(unit, method, speed=speed, static_eccentricity=0.05, revolutions=20),
        f"time step, {type(method).__name__}, 12 modes", per=20 * 512, rounds=3)


# ------------------------------------------------------------------ against what one could pick
# instead

def full_system(model, speed, harmonics=4, samples=64):
    """Residual of all DOFs, scaled by the gap and the stiffness at the generator, as a user would
    write it.
    """
    n, columns, S = model.size, 2 * harmonics + 1, model.selection
    turn = 2 * np.pi * np.arange(samples) / samples
    waves = np.array([np.ones(samples)] + [wave(k * turn) for k in range(1, harmonics + 1)
                                           for wave in (np.sin, np.cos)])
    weights = 2 / samples * waves.T
    weights[:, 0] /= 2
    constant = dynamic_matrix(model, speed, harmonics)
    load = np.zeros((columns, n))
    load[1], load[2] = speed**2 * model.unbalance_sin, speed**2 * model.unbalance_cos
    scale = np.abs(constant).max(axis=1)

    def residual(y, centre):
        X = model.gap * y.reshape(columns, n).T @ waves
        pull = S.T @ model.law.force(S @ X - centre[:, None])
        left = model.gap * constant @ y - load.ravel() - (pull @ weights).T.ravel()
        return left / (scale * model.gap)
    return residual


def test_scipy_root_on_all_dofs(run, unit, make_kaplan, speed, whole):
    """`scipy.optimize.root` from the neighbouring steady state 0.1 % away, to the same solution."""
    model = unit if whole else make_kaplan(4).model()
    residual = full_system(model, speed)
    before = solve_full(model, speed, 0.05, steps=1)
    centre = model.centre(0.051)
    found = run(lambda: root(residual, before.T.ravel() / model.gap, args=(centre,), method="hybr",
                             tol=1e-12),
                "one point, scipy.optimize.root on all DOFs", rounds=2)
    there = HarmonicBalance().solve(model, speed, 0.051)
    answer = model.gap * (model.selection @ found.x.reshape(9, -1).T)
    assert np.abs(answer - there.coefficients).max() < 1e-6 * model.gap


def test_steady_state_in_time(run, unit, speed, whole):
    """DOP853 from the steady state 0.1 % away until it is as near to the true one as four harmonics
    are.
    """
    eccentricity = 0.05 if whole else 0.02
    true, before = (HarmonicBalance(16).solve(unit, speed, e)
                    for e in (eccentricity, eccentricity - 0.001))
    few = HarmonicBalance().solve(unit, speed, eccentricity)
    wanted = np.abs(few.coefficients - true.coefficients[:, :9]).max() if whole else 1e-3 * unit.gap

    def until_steady():
        motion = before
        for _ in range(60):
            motion = integrate(unit, RungeKutta(1e-9, 1e-14, 64), speed=speed,
                               static_eccentricity=eccentricity,
                               revolutions=5, start=motion, modes=6)
            if np.abs(motion.coefficients(4) - true.coefficients[:, :9]).max() <= max(wanted, 2e-9):
                return motion
        return motion
    motion = run(until_steady, "one point, DOP853 in time, as accurate", rounds=1)
    assert np.abs(motion.coefficients(4) - true.coefficients[:, :9]).max() <= 1e-3 * unit.gap


def last_line(text):
    """The last line of what a program said."""
    return (text.strip().splitlines() or ["nothing said"])[-1]


def pyharm():
    """The interpreter of an environment that has pyHarm: HYDROLAB_PYHARM, or one made beside the
    temporary files.
    """
    if given := os.environ.get("HYDROLAB_PYHARM"):
        return given
    home = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "hydrolab-pyharm"
    python = home / "bin" / "python"
    if not (home / "done").exists():
        venv.create(home, with_pip=True, clear=True)
        install = [python, "-m", "pip", "install", "-q", "pyHarm-os"]
        done = subprocess.run(install, capture_output=True, text=True, timeout=900)
        if done.returncode:
            pytest.skip(f"pyHarm-os cannot be installed here: {last_line(done.stderr)}")
        (home / "done").touch()
    return str(python)


@pytest.fixture(scope="module")
def by_pyharm(peer, speed, tmp_path_factory):
    """The 2-DOF benchmark's branch by pyHarm, 60 points past its first fold."""
    task = {"m": peer.M[0, 0], "c": peer.C[0, 0], "k": peer.K[0, 0], "pull": peer.law.stiffness,
            "gap": peer.gap,
            "speed": speed, "unbalance": math.hypot(*peer.unbalance_cos), "harmonics": 4,
            "samples": 64, "to": 0.2,
            "points": 60}
    done = subprocess.run([pyharm(), str(Path(__file__).with_name("pyharm_branch.py")),
                           json.dumps(task)],
                          capture_output=True, text=True, timeout=600,
                          cwd=tmp_path_factory.mktemp("pyharm"), env=os.environ | {
                              name: "1" for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS",
                                                     "OMP_NUM_THREADS")})
    if done.returncode:
        pytest.skip(f"pyHarm ran into: {last_line(done.stderr)}")
    return json.loads(done.stdout.splitlines()[-1])


def test_arclength_point_of_the_benchmark_of_peers(run, peer, speed):
    branch = follow(peer, to=0.2, speed=speed)
    run(lambda: follow(peer, to=0.2, speed=speed), "arclength point, 2 DOFs", per=len(branch))


def test_pyharm(request, run, benchmark, peer, speed, whole):
    """The same curve by pyHarm: its points lie on ours, and its clock is its own."""
    if not whole and "HYDROLAB_PYHARM" not in os.environ:
        pytest.skip("pyHarm has an environment of its own; `python -m tests.benchmarks.report` "
                    "makes it")
    theirs = request.getfixturevalue("by_pyharm")
    ours = follow(peer, to=0.2, speed=speed)
    fold = ours.folds[0].value
    for e, mean in zip(theirs["eccentricity"][2:], theirs["mean"][2:], strict=True):
        if abs(e - fold) > 1e-4 and e > 0.0103:
            assert min(abs(orbit.mean[0] / peer.gap - mean) for orbit in orbits_at(ours, e)) < 1e-6
    assert max(theirs["eccentricity"]) <= fold + 1e-9
    run(lambda: None, "arclength point, 2 DOFs, pyHarm", rounds=1)
    benchmark.extra_info["seconds"] = theirs["seconds"] / theirs["points"]


# ------------------------------------------------------------------ maps and basins

def test_map(run, shipped, whole):
    n = 100 if whole else 10
    with ProcessPoolExecutor(2) as pool:
        list(pool.map(abs, range(8)))  # workers are up
        found = run(lambda: steady_map(shipped, "static_eccentricity", np.linspace(0, 0.12, n),
                                       "field",
                                       np.linspace(0.3, 0.6, n), executor=pool),
                    "map 100 × 100 with fold distance, two cores", target=10.0, rounds=1)
    assert set(np.unique(found.outcome)) <= {0, 3}


def test_basins(run, shipped, whole):
    n, revolutions = (64, 200) if whole else (12, 10)
    orbits = stable_orbits_at(follow(shipped.model(), speed=shipped.speed), 0.088)
    found = run(lambda: basins(orbits, np.linspace(-3e-3, 2e-3, n), np.linspace(-0.05, 0.05, n),
                               revolutions=revolutions),
                "basins of 64 × 64 starts, 200 revolutions", target=20.0, rounds=1)
    assert found.share(-1) > 0


def test_arrivals(run, shipped, whole):
    branch = follow(shipped.model(), speed=shipped.speed, method=THREE)
    phases, revolutions = (25, 180) if whole else (1, 40)
    found = run(lambda: arrivals(branch, phases=phases, revolutions=revolutions),
                "1,000 arrivals past the fold", target=20.0, rounds=1)
    assert not whole or abs(found.share(-1) - 0.18) < 0.03


def test_integrity(run, shipped, whole):
    branch = follow(shipped.model(), speed=shipped.speed, method=THREE)
    values, window = (None, None) if whole else ([0.0, 0.08], np.linspace(-7e-3, 7e-3, 8))
    curve = run(lambda: integrity(branch, values, displacement=window,
                                  revolutions=100 if whole else 20),
                "integrity at 30 eccentricities, 48 × 48 starts", target=60.0, rounds=1)
    assert curve.safe[-1] < 0.5


MEMORY = """
import resource, sys
from pathlib import Path
import numpy as np
from hydrolab import *
unit, n = load_machine("kaplan-150rpm"), {n}
branch = follow(unit.model(), speed=unit.speed)
branch_stability(branch)
basins(stable_orbits_at(branch, 0.088), np.linspace(-3e-3, 2e-3, n), np.linspace(-0.05, 0.05, n),
       revolutions={revolutions})
steady_map(unit, "static_eccentricity", np.linspace(0, 0.12, n), "field", np.linspace(0.3, 0.6, n))
# of this process alone; where it is missing the other may hold the parent's too
status = Path("/proc/self/status")
print(1024 * (int(status.read_text().split("VmHWM:")[1].split()[0]) if status.exists()
              else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss))
"""


def test_memory(run, benchmark, whole):
    """Branch, stability, basins and a map in one fresh process: the most it held."""
    code = MEMORY.format(n=100 if whole else 8, revolutions=5)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    run(lambda: None, "peak memory, branch, stability, basins and map of 100 × 100", rounds=1)
    benchmark.extra_info["bytes"] = float(done.stdout)
    assert float(done.stdout) < 2**30


# ------------------------------------------------------------------ the paper's study

def test_study(run, tmp_path, whole):
    """The command with its figures, in a process of its own, as a user runs it."""
    if not whole:
        pytest.skip("tests/test_study.py runs the study")
    command = [sys.executable, "-m", "hydrolab.cli", "study", "--out", str(tmp_path)]
    run(lambda: subprocess.run(command, capture_output=True, check=True), "hydrolab study",
        target=60.0, rounds=1)
    assert (tmp_path / "report.json").exists()


def test_family(run, whole):
    """What `--family` adds: every tenth member on two processes, counted ten times, for all take
    about as long.
    """
    if not whole:
        pytest.skip("eight studies take a minute")
    members = load_family().members
    some = members[::10]
    verdicts = run(lambda: judge_family(some, workers=2), f"study of the family, {len(members)} "
                                                          "members on two cores",
                   per=len(some) / len(members), target=540.0, rounds=1)
    assert len(verdicts) == len(some) and all(v.holds for v in verdicts)


# ------------------------------------------------------------------ import

def test_import(run, benchmark, whole):
    """Beyond NumPy and the parts of SciPy that are used; a fresh interpreter each time."""
    code = ("import time, numpy, scipy.linalg, scipy.optimize, scipy.integrate; t = "
            "time.perf_counter(); "
            "import hydrolab; print(time.perf_counter() - t)")
    seconds = [float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                                    check=True).stdout)
               for _ in range(3 if whole else 1)]
    run(lambda: None, "import hydrolab beyond NumPy and SciPy", target=0.3)
    benchmark.extra_info["seconds"] = float(min(seconds))
