"""Maps against single solves, and what must not be lost: Ctrl-C, a killed worker, a full disk."""

import copy
import errno
import os
import signal
import subprocess
import sys
import textwrap
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

xr = pytest.importorskip("xarray", reason="maps need the extra `maps` (xarray, Dask)")

from hydrolab import (  # noqa: E402
    HarmonicBalance,
    ellipse,
    follow,
    load_machine,
    orbits_at,
    rpm,
    steady_map,
    vary,
)
from hydrolab.dynamics import maps as maps_module  # noqa: E402
from hydrolab.dynamics.batch import Outcome  # noqa: E402
from hydrolab.dynamics.following import Arclength  # noqa: E402
from hydrolab.dynamics.maps import READINGS, fingerprint, steady_row  # noqa: E402
from hydrolab.errors import BadInput  # noqa: E402
from hydrolab.machine import Crack, JournalFilm, PadBearing  # noqa: E402

E = np.array([0.0, 0.02, 0.05, 0.08, 0.089, 0.1])
FIELDS = np.array([0.4, 0.45, 0.5, 0.52])


@pytest.fixture(scope="module")
def machine():
    return load_machine("kaplan-150rpm")


@pytest.fixture(scope="module")
def whole(machine):
    return steady_map(machine, "static_eccentricity", E, "field", FIELDS)


def made_of(machine):
    """The fingerprint of a machine."""
    return fingerprint(machine.model(), machine.speed)


def same(a, b):
    """Equal in every value, nan where nan."""
    return all(np.array_equal(a[name], b[name], equal_nan=True) for name in (*READINGS, "outcome"))


# ------------------------------------------------------------------ values

def test_every_cell_is_the_orbit_solved_alone(machine, whole):
    compared = 0
    for i, field in enumerate(FIELDS):
        changed = vary(machine, {"air_gap.field": field})
        model = changed.model()
        branch = follow(model, speed=machine.speed, to=0.9, method=Arclength(max_folds=1, tail=0))
        fold = branch.folds[0].value
        assert whole.fold_distance.values[i] == pytest.approx(fold - E, abs=1e-12)
        for j, e in enumerate(E):
            cell = {name: float(whole[name].values[i, j]) for name in READINGS}
            if e >= fold:
                assert whole.outcome.values[i, j] == Outcome.BEYOND_FOLD
                assert np.isnan(cell["smallest_gap"])
                continue
            assert whole.outcome.values[i, j] == Outcome.CONVERGED
            orbit = orbits_at(branch, e)[0] if e else HarmonicBalance().solve(model, machine.speed)
            assert cell["smallest_gap"] == pytest.approx(orbit.smallest_gap, abs=1e-12 * model.gap)
            assert cell["amplitude"] == pytest.approx(orbit.amplitudes[0, 0], abs=1e-12 * model.gap)
            share = ellipse(orbit.coefficients, 2).major / ellipse(orbit.coefficients, 1).major
            assert cell["share_2x"] == pytest.approx(share, abs=1e-9)
            compared += 1
    assert compared > 15
    assert (whole.outcome == Outcome.BEYOND_FOLD).sum() > 1


def test_close_to_the_fold_it_stays_on_the_first_leg(machine):
    """The start is read off the leg in the root of the distance to its fold; two steady states are
    near each other.
    """
    branch = follow(machine.model(), speed=machine.speed, to=0.9,
                    method=Arclength(max_folds=1, tail=3))
    fold = branch.folds[0].value
    values = fold * (1 - np.geomspace(1e-9, 0.3, 25))
    row = steady_row(machine, values)
    assert (row["outcome"] == Outcome.CONVERGED).all()
    first = [orbits_at(branch, e)[0].smallest_gap for e in values[5:]]
    assert row["smallest_gap"][5:] == pytest.approx(first, abs=1e-9 * machine.air_gap.gap)
    # the leg is monotonic: none jumped to the other side
    assert (np.diff(row["smallest_gap"]) > 0).all()


def test_other_axes(machine):
    stiffness, mass = np.array([1.2e9, 1.37e9]), np.array([1.1e5, 1.2e5])
    bearing, body = "bearings.generator guide bearing.stiffness", "bodies.generator.mass"
    found = steady_map(machine, body, mass, bearing, stiffness, eccentricity=0.03)
    for i, k in enumerate(stiffness):
        for j, m in enumerate(mass):
            changed = vary(machine, {body: m, bearing: k})
            orbit = HarmonicBalance().solve(changed.model(), changed.speed, 0.03)
            assert float(found.smallest_gap[i, j]) == pytest.approx(orbit.smallest_gap,
                                                                    abs=1e-12 * 0.011)
    by_speed = steady_map(machine, "static_eccentricity", [0.03], "speed", [rpm(120), rpm(150)])
    slow = HarmonicBalance().solve(machine.model(), rpm(120), 0.03)
    assert float(by_speed.amplitude[0, 0]) == pytest.approx(slow.amplitudes[0, 0],
                                                            abs=1e-12 * 0.011)


def test_machines_that_have_no_steady_state_are_marked(machine, whole):
    """Fifteen times the unbalance: the rotor would touch. The other row is what it was."""
    found = steady_map(machine, "static_eccentricity", E, "unbalance", [1.0, 15.0])
    assert (found.outcome.values[1] == Outcome.NO_START).all()
    assert np.isnan(found.smallest_gap.values[1]).all()
    row = steady_row(machine, E)
    for name in READINGS:
        assert np.array_equal(found[name].values[0], row[name], equal_nan=True)


def test_it_says_what_it_holds(whole, machine):
    assert whole.smallest_gap.attrs["units"] == "m"
    assert whole.attrs["x_parameter"] == "static_eccentricity"
    assert whole.attrs["made_of"] == made_of(machine)
    assert whole.outcome.attrs["flag_meanings"].split()[Outcome.BEYOND_FOLD] == "BEYOND_FOLD"
    assert made_of(machine) == made_of(load_machine("kaplan-150rpm"))
    for key, value in (("bodies.generator.mass", 1e5), ("field", 0.4), ("speed", 15.0),
                       ("shaft.young", 2.05e11),
                       ("bearings.generator guide bearing.stiffness", 1e9)):
        assert made_of(vary(machine, {key: value})) != made_of(machine), key


def test_a_faulty_machine_has_another_fingerprint_and_no_map(machine):
    first, *others = machine.bearings
    faults = [replace(machine, bearings=others,
                      pad_bearings=(PadBearing("pads", 1, 8, 3e8, 1e-4),)),
              replace(machine, bearings=others,
                      films=(JournalFilm("film", first.node, 0.03, 0.4, 0.24, 1.6e-4),)),
              replace(machine, cracks=(Crack("crack", 1, 0.2),)),
              replace(machine, cracks=(Crack("crack", 1, 0.2, breathing="open"),))]
    assert len({made_of(machine), *map(made_of, faults)}) == 1 + len(faults)
    for fault in faults:
        with pytest.raises(BadInput, match=r"kaplan-150rpm has the law \w+; .* Use `follow`"):
            steady_map(fault, "static_eccentricity", E, "field", FIELDS[:1])


# ------------------------------------------------------------------ stop and go on

def test_stopped_and_taken_up_again(machine, whole, tmp_path):
    path, seen = tmp_path / "map.nc", []

    def stop(done, rows):
        seen.append((done, rows))
        if done == 2:
            raise KeyboardInterrupt
    with pytest.warns(UserWarning, match="interrupted after 2 of 4 rows"):
        half = steady_map(machine, "static_eccentricity", E, "field", FIELDS, path=path,
                          progress=stop)
    assert seen == [(1, 4), (2, 4)]
    assert (half.outcome.values[2:] == Outcome.NOT_DONE).all()
    assert (half.outcome.values[:2] != Outcome.NOT_DONE).all()
    done = []
    again = steady_map(machine, "static_eccentricity", E, "field", FIELDS, path=path,
                       progress=lambda count, rows: done.append(count))
    assert done == [3, 4]  # two rows came from disk
    assert same(again, whole)
    with xr.open_dataset(path, engine="scipy") as on_disk:
        assert same(on_disk.load(), whole)
    third = steady_map(machine, "static_eccentricity", E, "field", FIELDS, path=path,
                       progress=done.append)
    assert done == [3, 4]  # nothing left to do
    assert same(third, whole)


def test_ctrl_c_in_a_real_process(tmp_path):
    """SIGINT in the middle of a run: what was computed is on disk, whole, and the run ends by
    itself.
    """
    path = tmp_path / "map.nc"
    code = textwrap.dedent(f"""
        import numpy as np, warnings
        from pathlib import Path
        from hydrolab import load_machine, steady_map
        warnings.simplefilter("ignore")
        found = steady_map(load_machine("kaplan-150rpm"), "static_eccentricity",
                           np.linspace(0, 0.1, 40), "field", np.linspace(0.3, 0.52, 4000),
                           path=Path({str(path)!r}),
                           progress=lambda done, rows: print(done, flush=True))
        print("kept", int((found.outcome.values[:, 0] != 5).sum()), flush=True)
    """)
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        for line in process.stdout:
            if int(line) >= 3:
                process.send_signal(signal.SIGINT)
                break
        rest = process.communicate(timeout=60)[0].split()
    finally:
        process.kill()
    kept = int(rest[rest.index("kept") + 1])
    assert kept >= 3
    with xr.open_dataset(path, engine="scipy") as on_disk:
        assert kept - 1 <= int((on_disk.outcome.values[:, 0] != Outcome.NOT_DONE).sum()) <= kept


def test_wrong_files_are_refused(machine, whole, tmp_path):
    path = tmp_path / "map.nc"
    steady_map(machine, "static_eccentricity", E, "field", FIELDS[:1], path=path)
    before = path.read_bytes()
    with pytest.raises(BadInput, match="holds another map"):
        steady_map(machine, "static_eccentricity", E, "field", FIELDS[1:2], path=path)
    heavier = vary(machine, {"bodies.generator.mass": 1e5})
    with pytest.raises(BadInput, match="holds another map"):
        steady_map(heavier, "static_eccentricity", E, "field", FIELDS[:1], path=path)
    assert path.read_bytes() == before
    for junk in (b"not a map", b"", before[:100], before[:len(before) // 2], before[:-40]):
        path.write_bytes(junk)
        with pytest.raises(BadInput, match=r"not a map that can be read|holds another map"):
            steady_map(machine, "static_eccentricity", E, "field", FIELDS[:1], path=path)
    other = tmp_path / "other.nc"
    xr.Dataset({"t": ("x", [1.0, 2.0])}).to_netcdf(other, engine="scipy")
    with pytest.raises(BadInput, match="holds another map"):
        steady_map(machine, "static_eccentricity", E, "field", FIELDS[:1], path=other)


# ------------------------------------------------------------------ disks

def test_a_disk_that_refuses(machine, whole, tmp_path, monkeypatch):
    """No space: a warning a row, the map goes on and is whole in memory."""
    def full(self, path, **options):
        path.write_bytes(b"CDF")  # part of it is written before the disk is full
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    monkeypatch.setattr(xr.Dataset, "to_netcdf", full)
    path = tmp_path / "map.nc"
    with pytest.warns(UserWarning, match="could not be written .No space left on device.; the map "
                                         "goes on in memory"):
        found = steady_map(machine, "static_eccentricity", E, "field", FIELDS, path=path)
    assert same(found, whole)
    assert list(tmp_path.iterdir()) == []  # and nothing half-written is left


def test_a_file_that_may_not_grow(tmp_path):
    """The same for real: the operating system lets no file grow beyond 4 kB."""
    pytest.importorskip("resource", reason="limits on file size are POSIX")
    path = tmp_path / "map.nc"
    code = textwrap.dedent(f"""
        import resource, warnings
        import numpy as np
        from pathlib import Path
        from hydrolab import load_machine, steady_map
        machine = load_machine("kaplan-150rpm")
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            found = steady_map(machine, "static_eccentricity", np.linspace(0, 0.1, 400), "field",
                               [0.4, 0.5], path=Path({str(path)!r}))
        print(sum("could not be written" in str(w.message) for w in said),
              int((found.outcome.values == 5).sum()))
    """)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["2", "0"]
    assert not path.exists()


def test_the_map_before_survives_a_full_disk(machine, tmp_path, monkeypatch):
    path = tmp_path / "map.nc"
    steady_map(machine, "static_eccentricity", E, "field", FIELDS[:2], path=path,)
    before = path.read_bytes()
    monkeypatch.setattr(xr.Dataset, "to_netcdf", lambda self, path,
                        **options: (_ for _ in ()).throw(
        OSError(errno.ENOSPC, "full")))
    with pytest.warns(UserWarning, match="could not be written"):
        maps_module.save(xr.Dataset({"a": 1.0}), path)
    assert path.read_bytes() == before


# ------------------------------------------------------------------ workers

class Dying(Executor):
    """Runs tasks at once, but every second worker dies in a way of its own."""

    def __init__(self):
        self.count = 0

    def submit(self, function, /, *args, **kwargs):
        self.count += 1
        future = Future()
        if self.count % 2:
            future.set_result(function(*args, **kwargs))
        else:
            future.set_exception(ConnectionResetError("the worker is gone"))
        return future


class Closed(Executor):
    """Takes one task and then no more, as a broken pool does."""

    def __init__(self):
        self.taken = 0

    def submit(self, function, /, *args, **kwargs):
        self.taken += 1
        if self.taken > 1:
            raise RuntimeError("cannot schedule new futures after shutdown")
        future = Future()
        future.set_result(function(*args, **kwargs))
        return future


@pytest.mark.parametrize("executor", [Dying, Closed])
def test_rows_of_dead_workers_are_computed_here(machine, whole, executor):
    assert same(steady_map(machine, "static_eccentricity", E, "field", FIELDS,
                           executor=executor()), whole)


def test_processes_one_of_which_is_killed(machine, tmp_path):
    """SIGKILL to a worker breaks the whole pool; the map is whole all the same."""
    e, fields = np.linspace(0, 0.1, 30), np.linspace(0.3, 0.52, 40)
    path = tmp_path / "map.nc"
    with ProcessPoolExecutor(2) as pool:
        assert pool.submit(os.getpid).result() > 0
        killed = []

        def kill(done, rows):
            if not killed:
                victim = next(iter(pool._processes))
                os.kill(victim, signal.SIGKILL)
                killed.append(victim)
        found = steady_map(machine, "static_eccentricity", e, "field", fields, executor=pool,
                           path=path, progress=kill)
    assert killed
    assert (found.outcome.values != Outcome.NOT_DONE).all()
    for i in (0, 17, 39):
        row = steady_row(vary(machine, {"field": fields[i]}), e)
        assert np.array_equal(found.smallest_gap.values[i], row["smallest_gap"], equal_nan=True)
    with xr.open_dataset(path, engine="scipy") as on_disk:
        assert same(on_disk.load(), found)


def test_what_cannot_be_sent_to_a_worker_is_not_a_dead_worker(machine):
    """Once each row failed to pickle and was computed here, without a word."""
    class Local(type(machine)):
        """A class that no other process knows."""

    local = copy.copy(machine)
    object.__setattr__(local, "__class__", Local)
    with ProcessPoolExecutor(1) as pool, pytest.raises(BadInput, match="cannot be sent to a wor"):
        steady_map(local, "static_eccentricity", E, "field", FIELDS[:1], executor=pool)
    assert same(steady_map(local, "static_eccentricity", E, "field", FIELDS[:1]),
                steady_map(machine, "static_eccentricity", E, "field", FIELDS[:1]))


def test_a_loaded_card_is_computed_by_the_workers(machine, whole):
    here = []
    with ProcessPoolExecutor(2) as pool, pytest.MonkeyPatch.context() as patch:
        pool.submit(os.getpid).result()
        patch.setattr(maps_module, "steady_row", lambda *task: here.append(task))
        assert same(steady_map(machine, "static_eccentricity", E, "field", FIELDS, executor=pool),
                    whole)
    assert not here


def test_errors_in_the_input_are_not_taken_for_dead_workers(machine):
    """A value that a row would refuse is refused before anything is computed."""
    done = []
    with pytest.raises(BadInput, match="mass"):
        steady_map(machine, "static_eccentricity", E, "bodies.generator.mass", [1e5, -1.0],
                   progress=lambda *count: done.append(count))
    assert not done


# what Dask says of its own workers' deaths is not our subject
@pytest.mark.filterwarnings("ignore")
def test_a_dask_cluster_with_a_killed_worker(machine):
    distributed = pytest.importorskip("distributed", reason="maps on a cluster need the extra "
                                      "`maps`")
    e, fields = np.linspace(0, 0.1, 20), np.linspace(0.3, 0.52, 60)
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True,
               "dashboard_address": None, "silence_logs": 50}
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        workers = client.run(os.getpid)
        assert len(set(workers.values())) == 2
        killed = []

        def kill(done, rows):
            if done == rows // 4 and not killed:
                killed.append(next(iter(workers.values())))
                os.kill(killed[0], signal.SIGKILL)
        found = steady_map(machine, "static_eccentricity", e, "field", fields,
                           executor=client.get_executor(),
                           progress=kill)
        assert killed
    assert (found.outcome.values != Outcome.NOT_DONE).all()
    alone = steady_row(vary(machine, {"field": fields[-1]}), e)
    assert found.smallest_gap.values[-1] == pytest.approx(alone["smallest_gap"], abs=1e-15,
                                                          nan_ok=True)


# ------------------------------------------------------------------ refusals

@pytest.mark.parametrize(("x", "y", "words"), [
    ("field", "field", "must differ"), ("field", "static_eccentricity", "goes on the x axis"),
    ("static_eccentricity", "colour", "not a number of"),
    ("bodies.nobody.mass", "field", "not a number of")])
def test_axes_are_checked(machine, x, y, words):
    with pytest.raises(BadInput, match=words):
        steady_map(machine, x, [0.1], y, [0.5])


def test_eccentricities_are_fractions_of_the_gap(machine):
    """8.8 for 8.8 % would come out as a map in which every point is beyond the fold."""
    with pytest.raises(BadInput, match=r"x_values has 8\.8"):
        steady_map(machine, "static_eccentricity", [0.0, 8.8], "field", [0.5])
    for wrong in (8.8, np.nan, "0.05"):
        with pytest.raises(BadInput, match="eccentricity is"):
            steady_map(machine, "speed", [15.0], "field", [0.5], eccentricity=wrong)


def test_a_path_may_be_text(machine, tmp_path):
    path = tmp_path / "map.nc"
    found = steady_map(machine, "static_eccentricity", E[:2], "field", FIELDS[:1], path=str(path))
    with xr.open_dataset(path, engine="scipy") as on_disk:
        assert same(on_disk.load(), found)


@pytest.mark.parametrize("values", [[], [np.nan], [[0.1]], [np.inf]])
def test_values_are_checked(machine, values):
    with pytest.raises(BadInput, match="x_values must be a list of finite"):
        steady_map(machine, "static_eccentricity", values, "field", [0.5])
    with pytest.raises(BadInput, match="y_values must be a list of finite"):
        steady_map(machine, "static_eccentricity", [0.1], "field", values)


class Watched(ProcessPoolExecutor):
    """A pool that keeps what it was asked to do."""

    def __init__(self, workers):
        super().__init__(workers)
        self.futures = []

    def submit(self, *task, **named):
        self.futures.append(super().submit(*task, **named))
        return self.futures[-1]


def test_a_loaded_card_is_computed_in_the_workers(machine):
    """Every row comes back from a worker, equal to the same row computed here."""
    axes = ("static_eccentricity", [0.0, 0.02], "field", [0.4, 0.5])
    here = steady_map(machine, *axes)
    with Watched(2) as pool:
        there = steady_map(machine, *axes, executor=pool)
        assert len(pool.futures) == 2 and not any(f.exception() for f in pool.futures)
    assert same(here, there)
