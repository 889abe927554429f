"""Time integration: the verb `integrate`.

Full FE models have frequencies of tens of kilohertz that no orbit shows, so it works on a modal basis with the static
deflection under the pull (`reduce`) unless told otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.condensation import condense
from hydrolab.dynamics.reduction import reduce
from hydrolab.dynamics.results import PeriodicOrbit, Trajectory, contact_sentence
from hydrolab.dynamics.task import Task
from hydrolab.dynamics.time_methods import Block, CentralDifference, Newmark, RungeKutta
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.checks import number, require_model, turning, whole
from hydrolab.machine.model import Model

Progress = Callable[[int, int], None]


def integrate(model: Model, method: CentralDifference | Newmark | RungeKutta, *, speed: float,
              static_eccentricity: float = 0.0, revolutions: int = 1000, ramp: int = 0, modes: int | None = 12,
              direction: float = math.pi / 2, start: PeriodicOrbit | Trajectory | None = None,
              disturbance: tuple[float, float] = (0.0, 0.0), progress: Progress | None = None) -> Trajectory:
    """Integrate the motion, by default from the steady state of the linear problem.

    speed: rad/s. ramp: revolutions over which the field rises from 0 to its full value. modes: size of the modal
    basis beside the static deflection under the pull; None integrates all DOFs. start: an orbit to begin on (at
    phase 0), or a trajectory of the same model and basis to go on from. disturbance: a sideways displacement (x, z)
    of the generator, m, added to the start in the shape of the static deflection. progress: called after each
    revolution with (done, all).
    Ends early at contact, where a step has no solution, or at an interrupt (Ctrl-C); what was computed is kept and
    `stopped` says what happened.
    Raises BadInput for arguments outside what is allowed, among them a step beyond the stability limit.
    """
    require_model(model)
    speed = turning(speed)
    if not isinstance(method, CentralDifference | Newmark | RungeKutta):
        raise BadInput(f"method is {method!r}; it must be a CentralDifference, a Newmark or a RungeKutta.")
    revolutions = whole("revolutions", revolutions, 1)
    period = 2 * math.pi / speed
    begin = float(start.times[-1]) if isinstance(start, Trajectory) else 0.0
    if not 0 <= ramp <= begin / period + revolutions:
        raise BadInput(f"ramp is {ramp!r}; it must lie between 0 and the {revolutions} revolutions.")
    centre = model.centre(number("static_eccentricity", static_eccentricity), direction)
    small = model if modes is None else reduce(model, modes)
    inertia = np.linalg.eigvalsh(small.M)
    if not inertia[0] > len(inertia) * np.finfo(float).eps * inertia[-1]:
        raise BadInput(f"{model.name} has a DOF without mass, which cannot be integrated in time; give the shaft a "
                       "density above 0.")
    task = Task(small, speed, centre, ramp * period)
    state = _first_state(model, small, speed, start)
    if any(disturbance):
        generator = small.selection[:2]
        static = np.linalg.solve(small.K, generator.T)
        state = state + [static @ np.linalg.solve(generator @ static, disturbance), np.zeros(small.size)]

    blocks: list[Block] = [(np.array([begin]), (small.selection[:2] @ state[0])[:, None], state)]
    stopped, interrupted = None, False
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # a motion that grows without bound is said in words below
            for block in method.run(task, state, begin, revolutions):
                block, stopped = _up_to_the_end(task, block, blocks[-1])
                blocks.append(block)
                if stopped:
                    break
                if progress:
                    progress(len(blocks) - 1, revolutions)
    except KeyboardInterrupt:
        interrupted = True
        stopped = f"Interrupted after {len(blocks) - 1} of {revolutions} revolutions; these are kept."
    except NoConvergence as failure:
        stopped = str(failure)
    finished = stopped is None
    times, paths, states = zip(*blocks, strict=True)
    return Trajectory(small, speed, float(static_eccentricity), centre, np.concatenate(times),
                      np.concatenate(paths, axis=1), states[-1],
                      stopped or f"It ran the {revolutions} revolutions asked for.", finished, method, interrupted)


def _first_state(model: Model, small: Model, speed: float, start: PeriodicOrbit | Trajectory | None) -> NDArray:
    """Displacement and velocity, (2, r), on the reduced basis."""
    if isinstance(start, Trajectory):
        if start.state.shape[1] != small.size:
            raise BadInput(f"start has {start.state.shape[1]} DOFs, this basis {small.size}; use the same `modes`.")
        if not np.isfinite(start.state).all():
            raise BadInput(f"start cannot be gone on from. {start.stopped}")
        return start.state
    if start is None:
        linear = condense(small.with_field(0.0), float(speed), 1, 8)
        sine, cosine = -linear.shaft_linear[1].imag, linear.shaft_linear[1].real
        return np.stack([cosine, speed * sine])
    k = np.arange(1, start.harmonics + 1) / start.revolutions
    shaft = start.shaft
    q = shaft[:, 0] + shaft[:, 2::2].sum(axis=1)
    v = shaft[:, 1::2] @ (k * speed)
    if small is model:
        return np.stack([q, v])
    # Coordinates of the reduced basis by mass-weighted projection of the full displacement.
    basis = np.linalg.lstsq(model.shaft_map, small.shaft_map, rcond=None)[0]
    weight = basis.T @ model.M
    return np.stack([np.linalg.solve(small.M, weight @ q), np.linalg.solve(small.M, weight @ v)])


def _up_to_the_end(task: Task, block: Block, before: Block) -> tuple[Block, str | None]:
    """The part of a block before contact, with the sentence that says so; the block and None if there is none."""
    times, path, state = block
    clear = task.model.law.smallest_gap(path - task.centre[:, None]) > 0  # false for nan
    if clear.all():
        return block, None
    first = int(np.argmin(clear))
    if not math.isfinite(task.model.gap):
        revolutions = times[first] * task.speed / (2 * math.pi)
        sentence = f"The motion grew beyond all numbers after {revolutions:.2f} revolutions."
    else:
        near = path[:, :first + 1] if np.isfinite(path[:, first]).all() else np.hstack([before[1], path[:, :first]])
        angle = float(task.model.law.gap_angle(near[:, -1] - task.centre))
        sentence = contact_sentence(times[first], task.speed, angle)
    return (times[:first], path[:, :first], np.full_like(state, np.nan)), sentence
