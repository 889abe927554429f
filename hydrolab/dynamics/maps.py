"""Maps over two parameters: smallest gap, amplitude, 2X share and distance to the fold at every
point.

A map is an xarray Dataset, saved as NetCDF after every row, so that it can be interrupted and taken
up again. Rows are independent, so any `concurrent.futures.Executor` can compute them: processes
here, Dask's on a cluster. Needs the extra `maps` (xarray, Dask).
"""

from __future__ import annotations

import hashlib
import math
import pickle
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, as_completed
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.batch import Outcome, newton_batch, stack
from hydrolab.dynamics.following import Arclength, follow
from hydrolab.dynamics.harmonics import amplitudes, long_axis
from hydrolab.dynamics.results import clearances
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.model import ARRAYS, Model
from hydrolab.machine.quantities import number, shown

if TYPE_CHECKING:
    import xarray

    from hydrolab.machine.parts import Machine

ECCENTRICITY = "static_eccentricity"
READINGS = {
    "smallest_gap": ("m", "smallest air gap over a revolution"),
    "amplitude": ("m", "1X along the eccentricity, 0-to-peak"),
    "share_2x": ("1", "2X over 1X, long half axes of their ellipses"),
    "fold_distance": ("1", "first fold less the present static eccentricity, fraction of the gap"),
}
Progress = Callable[[int, int], None]
Row = dict[str, NDArray]


class InTurn(Executor):
    """Does each piece of work when it is given: an executor for a browser's Python."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future:
        """The work, done; what it raises is raised here."""
        done: Future = Future()
        done.set_result(fn(*args, **kwargs))
        return done


def processes(count: int) -> Executor:
    """An executor of so many processes, or in turn where there are none."""
    if sys.platform == "emscripten":
        return InTurn()
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context
    return ProcessPoolExecutor(count, mp_context=get_context("spawn"))


def steady_row(machine: Machine, eccentricities: NDArray) -> Row:
    """Readings of the first leg's steady states of one machine at many static eccentricities
    (fractions of the gap), and their `Outcome`.

    The branch is followed to its first fold; the points in between are solved as one batch.
    """
    row = {name: np.full(len(eccentricities), np.nan) for name in READINGS}
    row["outcome"] = np.full(len(eccentricities), Outcome.NO_START, dtype=np.int8)
    with threadpool_limits(1):
        model = machine.model()
        try:
            branch = follow(model, speed=machine.speed, to=0.9,
                            method=Arclength(max_folds=1, tail=0))
        except (NoConvergence, Contact):
            return row
        # the leg, with its fold, as curves to start from
        known = branch.static_eccentricity[branch.first_leg]
        unknowns = branch.unknowns[branch.first_leg]
        fold = branch.folds[0].value if branch.folds else math.nan
        if branch.folds:
            known = np.append(known, fold)
            unknowns = np.vstack([unknowns, branch.folds[0].unknowns])
        inside = np.abs(eccentricities) < known[-1]
        row["outcome"][~inside] = Outcome.BEYOND_FOLD
        row["fold_distance"][:] = fold - np.abs(eccentricities)
        values = eccentricities[inside]
        if not len(values):
            return row
        at = np.abs(values)
        if branch.folds:  # near its fold the leg is straight in the root of the distance to it
            known, at = -np.sqrt(np.abs(fold - known)), -np.sqrt(fold - at)
        start = np.stack([np.interp(at, known, column) for column in unknowns.T], axis=1)
        centres = values[:, None] * model.gap * branch.direction
        batch = stack([branch.equations]).take(np.zeros(len(values), dtype=int))
        y, outcome = newton_batch(batch, start, centres)
    row["outcome"][inside] = outcome
    good = outcome == Outcome.CONVERGED
    found = np.flatnonzero(inside)[good]
    if len(found):
        local = branch.equations.length * y[good].reshape(len(found), 2, -1)
        row["smallest_gap"][found] = clearances(branch.equations, local, centres[good]).min(axis=1)
        row["amplitude"][found] = amplitudes(local)[:, 0, 0]
        row["share_2x"][found] = long_axis(local, 2) / long_axis(local, 1)
    return row


def _row_of_machines(machine: Machine, changes: Mapping[str, Any], x: str, values: NDArray,
                     eccentricity: float) -> Row:
    """One row of a map: the machine with `changes`, along the x axis."""
    machine = machine.with_numbers(changes)
    if x == ECCENTRICITY:
        return steady_row(machine, values)
    each = [machine.with_numbers({x: float(value)}) for value in values]
    cells = [steady_row(one, np.array([eccentricity])) for one in each]
    return {name: np.concatenate([cell[name] for cell in cells]) for name in cells[0]}


def steady_map(machine: Machine, x: str, x_values: ArrayLike, y: str, y_values: ArrayLike, *,
               eccentricity: float = 0.0, path: Path | str | None = None,
               executor: Executor | None = None,
               progress: Progress | None = None) -> xarray.Dataset:
    """Map the steady states of the first leg over two parameters.

    machine: a Machine with a round gap. x, y: "static_eccentricity" (x only) or a key of `vary`,
    such as "field" (T), "speed" (rad/s), "bodies.generator.mass"; x_values, y_values: in SI units.
    eccentricity: the fixed one where x is another parameter. path: NetCDF file that is written
    after every row and taken up again if it is there. executor: where rows are computed; here if
    None. progress: called after each row with (done, all), such as a bar of `hydrolab.progress`.
    Interrupted (Ctrl-C), it returns what it has, the rest marked NOT_DONE. A worker that dies costs
    time, not points. Raises BadInput for a law other than the circular pull, keys or values that do
    not fit, a machine that cannot be sent to a worker, or a file that holds another map.
    """
    columns, lines = _axes(machine, x, x_values, y, y_values, eccentricity)
    dataset = _empty(machine, x, columns, y, lines, eccentricity)
    path = None if path is None else Path(path)
    if path is not None and path.exists():
        dataset = _taken_up(path, dataset)
    todo = np.flatnonzero((dataset.outcome.values == Outcome.NOT_DONE).any(axis=1))
    tasks = {int(i): (machine, {y: float(lines[i])}, x, columns, eccentricity) for i in todo}
    done = len(lines) - len(todo)
    try:
        for i, row in _rows(tasks, executor):
            for name, values in row.items():
                dataset[name].values[i] = values
            done += 1
            if path is not None:
                save(dataset, path)
            if progress:
                progress(done, len(lines))
    except KeyboardInterrupt:
        warnings.warn(f"interrupted after {done} of {len(lines)} rows; these are kept.",
                      stacklevel=2)
    return dataset


def _axes(machine: Machine, x: str, x_values: ArrayLike, y: str, y_values: ArrayLike,
          eccentricity: float) -> tuple[NDArray, NDArray]:
    """The values along x and y, or a sentence about what a row would refuse later."""
    if not hasattr(machine, "with_numbers"):
        raise BadInput(f"machine is {shown(machine)}; it must be a Machine, such as load_machine "
                       "gives.")
    law = machine.model().law
    if not law.closed_form:
        raise BadInput(f"{machine.name} has the law {type(law).__name__}; a map is solved in "
                       "batches, which know the pull of a round gap alone. Use `follow` for one "
                       "branch at a time.")
    if x == y or y == ECCENTRICITY:
        raise BadInput(f"x is {x!r} and y is {y!r}; they must differ, and static_eccentricity goes "
                       "on the x axis.")
    axes = np.asarray(x_values, dtype=float), np.asarray(y_values, dtype=float)
    for name, key, values in zip("xy", (x, y), axes, strict=True):
        if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
            raise BadInput(f"{name}_values must be a list of finite numbers, at least one.")
        for value in values if key != ECCENTRICITY else ():
            machine.with_numbers({key: float(value)})
    offsets = axes[0] if x == ECCENTRICITY else np.array([number("eccentricity", eccentricity)])
    if (largest := float(np.abs(offsets).max())) >= 1:
        raise BadInput(f"{'x_values has' if x == ECCENTRICITY else 'eccentricity is'} {largest:g}; "
                       "a static eccentricity is a fraction of the gap, between -1 and 1 (8.8 % is "
                       "0.088).")
    return axes


def _empty(machine: Machine, x: str, columns: NDArray, y: str, lines: NDArray,
           eccentricity: float) -> xarray.Dataset:
    """A map in which nothing is done yet."""
    import xarray as xr

    shape = (len(lines), len(columns))
    data: dict[str, Any] = {name: (("y", "x"), np.full(shape, np.nan),
                                   {"units": unit, "long_name": text})
                            for name, (unit, text) in READINGS.items()}
    data["outcome"] = (("y", "x"), np.full(shape, Outcome.NOT_DONE, dtype=np.int8),
                       {"flag_values": [int(o) for o in Outcome],
                        "flag_meanings": " ".join(o.name for o in Outcome)})
    return xr.Dataset(data, {"x": columns, "y": lines},
                      {"x_parameter": x, "y_parameter": y, "eccentricity": eccentricity,
                       "machine": machine.name,
                       "made_of": fingerprint(machine.model(), machine.speed)})


def _rows(tasks: dict[int, tuple], executor: Executor | None) -> Iterator[tuple[int, Row]]:
    """Compute rows, in any order; a row whose worker died is computed here."""
    futures: dict[Future, int] = {}
    lost = [*tasks] if executor is None else []
    for i, task in tasks.items() if executor else ():
        try:
            futures[executor.submit(_row_of_machines, *task)] = i  # type: ignore[union-attr]
        except RuntimeError:  # the pool broke while it was being filled
            lost.append(i)
    try:
        for future in as_completed(futures):
            try:
                row = future.result()
            except (BadInput, KeyboardInterrupt):
                raise
            except Exception:  # a dead worker shows itself in a way of each executor's own
                _require_sendable(tasks[futures[future]])
                lost.append(futures[future])
                continue
            yield futures[future], row
    finally:
        for future in futures:
            future.cancel()
    for i in lost:
        yield i, _row_of_machines(*tasks[i])


def _require_sendable(task: tuple) -> None:
    """Raise BadInput where it was not the worker that failed, but the way to it."""
    try:
        pickle.dumps(task)
    except Exception as error:  # pickle raises TypeError, AttributeError and errors of its own
        raise BadInput(f"{task[0].name} cannot be sent to a worker process ({error}). Compute the "
                       "map without an executor, or in threads.") from error


def fingerprint(model: Model, speed: float) -> str:
    """A short text that changes with any number of a model and with the speed."""
    parts = [np.ascontiguousarray(getattr(model, name)).tobytes() for name in ARRAYS]
    return hashlib.sha256(b"".join(parts) + repr((model.law, speed)).encode()).hexdigest()[:16]


def save(dataset: xarray.Dataset, path: Path) -> None:
    """Write a map whole or not at all; a disk that refuses is a warning: the map is in memory."""
    part = path.with_suffix(".part")
    try:
        dataset.to_netcdf(part, engine="scipy")
        part.replace(path)
    except OSError as error:
        warnings.warn(f"{path} could not be written ({error.strerror or error}); the map goes on "
                      "in memory.", stacklevel=3)
        part.unlink(missing_ok=True)


def _taken_up(path: Path, fresh: xarray.Dataset) -> xarray.Dataset:
    """The map on disk, if it is the same one."""
    import xarray as xr

    try:
        with xr.open_dataset(path, engine="scipy") as found:
            old = found.load()
    except Exception as error:  # a file that was cut off makes its reader raise nearly anything
        raise BadInput(f"{path} is there but is not a map that can be read ({error}); move it away "
                       "or give another path.") from None
    same = all(old.attrs.get(k) == v for k, v in fresh.attrs.items()) and all(
        k in old.coords and np.array_equal(old[k].values, fresh[k].values) for k in ("x", "y"))
    if not same:
        raise BadInput(f"{path} holds another map (other axes, values or machine); give another "
                       "path.")
    return old
