"""Maps over two parameters: smallest gap, amplitude, 2X share and distance to the fold at every
point.

A map is an xarray Dataset, saved as NetCDF after every row, so that it can be interrupted and taken
up again. Rows are independent, so any `concurrent.futures.Executor` can compute them: processes
here, Dask's on a cluster. Needs the extra `maps` (xarray, Dask).
"""

from __future__ import annotations

import hashlib
import math
import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, as_completed
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.batch import Outcome, newton_batch, stack
from hydrolab.dynamics.branches import Arclength, follow
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.harmonics import PERIOD, long_axis, synthesise
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.pull import CircularPull
from hydrolab.machine.quantities import number

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


def steady_row(machine: Machine, eccentricities: NDArray, harmonics: int = 4) -> dict[str, NDArray]:
    """Readings of the first leg's steady states of one machine at many static eccentricities, and
    their `Outcome`.

    The branch is followed to its first fold; the points in between are solved together as one
    batch.
    """
    count = len(eccentricities)
    row = {name: np.full(count, np.nan) for name in READINGS}
    row["outcome"] = np.full(count, Outcome.NO_START, dtype=np.int8)
    balance = HarmonicBalance(harmonics)
    with threadpool_limits(1):
        model = machine.model()
        try:
            branch = follow(model, speed=machine.speed, to=0.9,
                            method=Arclength(balance, max_folds=1, tail=0))
        except (NoConvergence, Contact):
            return row
        leg, eq = branch.first_leg, branch.equations
        fold = branch.folds[0].value if branch.folds else math.nan
        reach = fold if branch.folds else float(branch.static_eccentricity[-1])
        inside = np.abs(eccentricities) < reach
        row["outcome"][~inside] = Outcome.BEYOND_FOLD
        row["fold_distance"][:] = fold - np.abs(eccentricities)
        if not inside.any():
            return row
        values = eccentricities[inside]
        known = np.append(branch.static_eccentricity[leg], fold if branch.folds else [])
        unknowns = np.vstack([branch.unknowns[leg],
                              *([branch.folds[0].unknowns] if branch.folds else [])])
        # near its fold the leg is a straight line in the root of the distance to it
        if branch.folds:
            known, at = -np.sqrt(np.abs(fold - known)), -np.sqrt(fold - np.abs(values))
        else:
            at = np.abs(values)
        start = np.stack([np.interp(at, known, column) for column in unknowns.T], axis=1)
        centre = values[:, None] * model.gap * branch.direction
        batch = stack([eq]).take(np.zeros(len(values), dtype=int))
        y, outcome = newton_batch(batch, start, centre)
    row["outcome"][inside] = outcome
    found = np.flatnonzero(inside)[outcome == Outcome.CONVERGED]
    coefficients = eq.length * y[outcome == Outcome.CONVERGED].reshape(len(found), 2, -1)
    place = synthesise(coefficients, PERIOD).transpose(1, 0, 2)
    place = model.relative(place, centre[outcome == Outcome.CONVERGED].T[:, :, None])
    row["smallest_gap"][found] = model.law.smallest_gap(place).min(axis=-1)
    row["amplitude"][found] = np.hypot(coefficients[:, 0, 1], coefficients[:, 0, 2])
    row["share_2x"][found] = long_axis(coefficients, 2) / long_axis(coefficients, 1)
    return row


def _row_of_machines(machine: Machine, changes: Mapping[str, Any], x: str, values: NDArray,
                     eccentricity: float) -> dict[str, NDArray]:
    """One row of a map: the machine with `changes`, along the x axis."""
    machine = machine.with_numbers(changes)
    if x == ECCENTRICITY:
        return steady_row(machine, values)
    machines = [machine.with_numbers({x: value}) for value in values]
    cells = [steady_row(each, np.array([eccentricity])) for each in machines]
    return {name: np.concatenate([cell[name] for cell in cells]) for name in cells[0]}


def steady_map(machine: Machine, x: str, x_values: ArrayLike, y: str, y_values: ArrayLike, *,
               eccentricity: float = 0.0, path: Path | str | None = None,
               executor: Executor | None = None,
               progress: Progress | None = None) -> xarray.Dataset:
    """Map the steady states of the first leg over two parameters.

    x, y: "static_eccentricity" (x only) or a key of `vary`, such as "field" (T), "speed" (rad/s),
    "bodies.generator.mass"; SI units. eccentricity: the fixed one where x is another parameter.
    path: NetCDF file that is written after every row and taken up again if it is there. executor:
    where rows are computed; here if None. progress: called after each row with (done, all), such as
    a bar of `hydrolab.progress`. Interrupted (Ctrl-C), it returns what it has, the rest marked
    NOT_DONE. A worker that dies costs time, not points. Raises BadInput for a law other than the
    circular pull, keys or values that do not fit, or a file that holds another map.
    """
    import xarray as xr

    if machine.air_gap and type(law := machine.model().law) is not CircularPull:
        raise BadInput(f"{machine.name} has the law {type(law).__name__}; a map is solved in "
                       "batches, which know the pull "
                       "of a round gap alone. Use `follow` for one branch at a time.")
    x_values, y_values = np.asarray(x_values, dtype=float), np.asarray(y_values, dtype=float)
    if x == y or y == ECCENTRICITY:
        raise BadInput(f"x is {x!r} and y is {y!r}; they must differ, and static_eccentricity goes "
                       "on the x axis.")
    for name, values in (("x_values", x_values), ("y_values", y_values)):
        if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
            raise BadInput(f"{name} must be a list of finite numbers, at least one.")
    for key, values in ((x, x_values), (y, y_values)):
        for value in values if key != ECCENTRICITY else ():
            machine.with_numbers({key: float(value)})  # refuse now what a row would refuse later
    offsets = x_values if x == ECCENTRICITY else np.array([number("eccentricity", eccentricity)])
    if (largest := float(np.abs(offsets).max())) >= 1:
        raise BadInput(f"{'x_values has' if x == ECCENTRICITY else 'eccentricity is'} {largest:g}; "
                       "a static "
                       "eccentricity is a fraction of the gap, between -1 and 1 (8.8 % is 0.088).")
    path = None if path is None else Path(path)
    shape = (len(y_values), len(x_values))
    data: dict[str, Any] = {name: (("y", "x"), np.full(shape, np.nan),
                                   {"units": unit, "long_name": text})
                            for name, (unit, text) in READINGS.items()}
    data["outcome"] = (("y", "x"), np.full(shape, Outcome.NOT_DONE, dtype=np.int8),
                       {"flag_values": [int(o) for o in Outcome],
                        "flag_meanings": " ".join(o.name for o in Outcome)})
    dataset = xr.Dataset(data, {"x": x_values, "y": y_values},
                         {"x_parameter": x, "y_parameter": y, "eccentricity": eccentricity,
                          "machine": machine.name,
                          "made_of": fingerprint(machine)})
    if path is not None and path.exists():
        dataset = _taken_up(path, dataset)
    todo = [i for i in range(shape[0]) if (dataset.outcome.values[i] == Outcome.NOT_DONE).any()]
    tasks = {i: (machine, {y: float(y_values[i])}, x, x_values, eccentricity) for i in todo}
    done = shape[0] - len(todo)
    try:
        for i, row in _rows(tasks, executor):
            for name, values in row.items():
                dataset[name].values[i] = values
            done += 1
            if path is not None:
                save(dataset, path)
            if progress:
                progress(done, shape[0])
    except KeyboardInterrupt:
        warnings.warn(f"interrupted after {done} of {shape[0]} rows; these are kept.", stacklevel=2)
    return dataset


def _rows(tasks: dict[int, tuple], executor: Executor
          | None) -> Iterator[tuple[int, dict[str, NDArray]]]:
    """Compute rows, in any order; a row whose worker died is computed here."""
    if executor is None:
        for i, task in tasks.items():
            yield i, _row_of_machines(*task)
        return
    futures: dict[Future, int] = {}
    lost = []
    for i, task in tasks.items():
        try:
            futures[executor.submit(_row_of_machines, *task)] = i
        except RuntimeError:  # the pool broke while it was being filled
            lost.append(i)
    try:
        for future in as_completed(futures):
            try:
                row = future.result()
            except (BadInput, KeyboardInterrupt):
                raise
            except Exception:  # a dead worker shows itself in a way of each executor's own
                lost.append(futures[future])
                continue
            yield futures[future], row
    finally:
        for future in futures:
            future.cancel()
    for i in lost:
        yield i, _row_of_machines(*tasks[i])


def fingerprint(machine: Machine) -> str:
    """A short text that changes with any number of the machine."""
    parts = repr((machine.speed, machine.shaft
                  and [np.asarray(v).tolist() if not isinstance(v, str) else v
                                                    for v in vars(machine.shaft).values()],
                  machine.bodies,
                  [(b.name, b.node, b.stiffness.tolist(), b.damping.tolist())
                   for b in machine.bearings],
                  machine.thrust_bearings, machine.damping, machine.air_gap, machine.poles,
                  machine.shapes,
                  machine.pad_bearings, machine.films, machine.cracks))
    return hashlib.sha256(parts.encode()).hexdigest()[:16]


def save(dataset: xarray.Dataset, path: Path) -> None:
    """Write a map whole or not at all; a disk that refuses is a warning, since the map is still in
    memory.
    """
    part = path.with_suffix(".part")
    try:
        dataset.to_netcdf(part, engine="scipy")
        part.replace(path)
    except OSError as error:
        warnings.warn(f"{path} could not be written ({error.strerror or error}); the map goes on "
                      "in memory.",
                      stacklevel=3)
        part.unlink(missing_ok=True)


def _taken_up(path: Path, fresh: xarray.Dataset) -> xarray.Dataset:
    """The map on disk, if it is the same one."""
    import xarray as xr

    try:
        with xr.open_dataset(path, engine="scipy") as found:
            old = found.load()
    except Exception as error:  # a file that was cut off makes its reader raise nearly anything
        raise BadInput(f"{path} is there but is not a map that can be read ({error}); move it away "
                       "or give another "
                       "path.") from None
    same = all(old.attrs.get(k) == v for k, v in fresh.attrs.items()) and all(
        k in old.coords and np.array_equal(old[k].values, fresh[k].values) for k in ("x", "y"))
    if not same:
        raise BadInput(f"{path} holds another map (other axes, values or machine); give another "
                       "path.")
    return old
