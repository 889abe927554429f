"""Time integration: the paper's centred finite differences, Newmark, and SciPy's Runge–Kutta.

The verb is `integrate`; the method object says how. Each method's step is a free function over arrays.
Full FE models have frequencies of tens of kilohertz that no orbit shows, so `integrate` works on a modal
basis with the static deflection under the pull (`reduce`) unless told otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from hydrolab.dynamics.condensation import condense
from hydrolab.dynamics.reduction import reduce
from hydrolab.dynamics.results import PeriodicOrbit, Trajectory
from hydrolab.errors import BadInput
from hydrolab.machine.model import Model

Progress = Callable[[int, int], None]
Block = tuple[NDArray, NDArray, NDArray]  # times, positions (2, n) of a piece of motion, state (2, r) at its end


@dataclass(frozen=True)
class Task:
    """What is integrated: a model at a speed, the stator centre, and the field's ramp."""

    model: Model
    speed: float
    centre: NDArray
    ramp: float

    def field(self, time: float) -> float:
        """Share of the full flux density at a time: linear up to 1 at the end of the ramp."""
        return min(1.0, time / self.ramp) if self.ramp > 0 else 1.0

    def pull(self, time: float, u: NDArray) -> NDArray:
        """Force on the generator at position u, N; the pull goes with the square of the field."""
        return self.field(time) ** 2 * self.model.law.force(u - self.centre)

    def unbalance(self, time: float) -> NDArray:
        """Unbalance force on all DOFs, N."""
        phase = self.speed * time
        return self.speed**2 * (self.model.unbalance_sin * math.sin(phase) + self.model.unbalance_cos * math.cos(phase))

    def acceleration(self, time: float, q: NDArray, v: NDArray) -> NDArray:
        """q̈ from the equation of motion, Eq. (9)."""
        m = self.model
        force = self.unbalance(time) + m.selection.T @ self.pull(time, m.selection @ q)
        return np.linalg.solve(m.M, force - m.velocity_matrix(self.speed) @ v - m.K @ q)


@dataclass(frozen=True)
class CentralDifference:
    """Centred finite differences (Géradin and Rixen 1997), explicit in the pull, second order.

    Stable while ω_max Δt ≤ 2; `integrate` checks it and says how many steps are needed.
    """

    steps_per_revolution: int = 512
    order = 2

    def __post_init__(self) -> None:
        _check_steps(self.steps_per_revolution)

    def run(self, task: Task, state: NDArray, start: float, revolutions: int) -> Iterator[Block]:
        """Yield the motion, one revolution at a time."""
        m, n = task.model, self.steps_per_revolution
        dt = 2 * math.pi / task.speed / n
        fastest = math.sqrt(scipy.linalg.eigh(m.K, m.M, eigvals_only=True)[-1])
        if fastest * dt > 2:
            needed = math.ceil(math.pi * fastest / task.speed)
            raise BadInput(f"steps_per_revolution is {n}: the fastest frequency of the model, {fastest:.4g} rad/s, times "
                           f"the step {dt:.3g} s is {fastest * dt:.3g}, and central differences need at most 2. Use at "
                           f"least {needed} steps per revolution, or fewer modes.")
        before, now, push, load = central_difference_matrices(m, task.speed, dt)
        forcing = np.array([load @ task.unbalance(start + i * dt) for i in range(n)])
        q, v = state
        old = q - dt * v + 0.5 * dt**2 * task.acceleration(start, q, v)
        time = start
        pull = _scalar_pull(task)
        for revolution in range(revolutions):
            path = np.empty((n, 2))
            for i in range(n):
                t = start + (revolution * n + i) * dt
                u = m.selection @ q
                new = now @ q + before @ old + push @ pull(t, u) + forcing[i]
                old, q = q, new
                path[i] = m.selection @ q
            time = start + (revolution + 1) * n * dt
            # Velocity at the last point, of second order, from the two last positions and the acceleration.
            v = (q - old) / dt
            v = v + 0.5 * dt * task.acceleration(time, q, v)
            yield start + (revolution * n + 1 + np.arange(n)) * dt, path.T, np.stack([q, v])


def central_difference_matrices(model: Model, speed: float, dt: float) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Matrices of q_{n+1} = now q_n + before q_{n−1} + push f_n + load F_n, from one factorisation.

    (M/Δt² + 𝒞/2Δt) q_{n+1} = F_n − (K − 2M/Δt²) q_n − (M/Δt² − 𝒞/2Δt) q_{n−1}, 𝒞 = C + ΩG.
    Returns (before, now, push, load); push takes the pull at the generator, load a force on all DOFs.
    """
    velocity = model.velocity_matrix(speed) / (2 * dt)
    load = np.linalg.inv(model.M / dt**2 + velocity)
    return (-load @ (model.M / dt**2 - velocity), -load @ (model.K - 2 * model.M / dt**2),
            load @ model.selection.T, load)


@dataclass(frozen=True)
class Newmark:
    """Newmark's method, average acceleration by default: no step limit, no numerical damping, second order.

    The pull at the new time is solved for, on its own two coordinates; a lagged pull would act as damping.
    """

    steps_per_revolution: int = 512
    beta: float = 0.25
    gamma: float = 0.5
    order = 2

    def __post_init__(self) -> None:
        _check_steps(self.steps_per_revolution)
        if not (0 < self.beta <= 0.5 and 0.5 <= self.gamma <= 1):
            raise BadInput(f"beta is {self.beta}, gamma is {self.gamma}; use 0 < beta ≤ 0.5 and 0.5 ≤ gamma ≤ 1.")

    def run(self, task: Task, state: NDArray, start: float, revolutions: int) -> Iterator[Block]:
        """Yield the motion, one revolution at a time."""
        m, n, beta, gamma = task.model, self.steps_per_revolution, self.beta, self.gamma
        dt = 2 * math.pi / task.speed / n
        velocity = m.velocity_matrix(task.speed)
        flexible = np.linalg.inv(m.M / (beta * dt**2) + velocity * (gamma / (beta * dt)) + m.K)
        compliance = m.selection @ flexible @ m.selection.T
        forcing = np.array([task.unbalance(start + (i + 1) * dt) for i in range(n)])
        q, v = state
        a = task.acceleration(start, q, v)
        for revolution in range(revolutions):
            path = np.empty((n, 2))
            for i in range(n):
                t = start + (revolution * n + i + 1) * dt
                inertia = m.M @ (q / (beta * dt**2) + v / (beta * dt) + (1 / (2 * beta) - 1) * a)
                drag = velocity @ (q * (gamma / (beta * dt)) + (gamma / beta - 1) * v
                                   + dt * (gamma / (2 * beta) - 1) * a)
                free = flexible @ (forcing[i] + inertia + drag)
                force = _implicit_pull(task, t, m.selection @ free, compliance, m.selection @ q)
                new = free + flexible @ (m.selection.T @ force)
                a_new = (new - q - dt * v) / (beta * dt**2) - (1 / (2 * beta) - 1) * a
                v = v + dt * ((1 - gamma) * a + gamma * a_new)
                q, a = new, a_new
                path[i] = m.selection @ q
            yield start + (revolution * n + 1 + np.arange(n)) * dt, path.T, np.stack([q, v])


@dataclass(frozen=True)
class RungeKutta:
    """SciPy's adaptive DOP853 (Hairer, Nørsett and Wanner 1993), eighth order, error-controlled."""

    rtol: float = 1e-9
    atol: float = 1e-13
    steps_per_revolution: int = 128  # output points; the steps themselves are chosen by the method

    def __post_init__(self) -> None:
        _check_steps(self.steps_per_revolution)
        if not (0 < self.rtol < 1 and self.atol > 0):
            raise BadInput(f"rtol is {self.rtol}, atol is {self.atol}; both must be positive and rtol below 1.")

    def run(self, task: Task, state: NDArray, start: float, revolutions: int) -> Iterator[Block]:
        """Yield the motion, one revolution at a time."""
        m, n = task.model, self.steps_per_revolution
        r, period = m.size, 2 * math.pi / task.speed
        inverse = np.linalg.inv(m.M)
        constant = np.block([[np.zeros((r, r)), np.eye(r)],
                             [-inverse @ m.K, -inverse @ m.velocity_matrix(task.speed)]])
        load = np.vstack([np.zeros((r, 2)), inverse @ m.selection.T])
        shaken = np.zeros((2, 2 * r))
        shaken[:, r:] = task.speed**2 * np.stack([inverse @ m.unbalance_sin, inverse @ m.unbalance_cos])
        watch = m.selection
        pull = _scalar_pull(task)

        def rate(t: float, s: NDArray) -> NDArray:
            phase = task.speed * t
            return (constant @ s + load @ pull(t, watch @ s[:r])
                    + math.sin(phase) * shaken[0] + math.cos(phase) * shaken[1])

        def clearance(t: float, s: NDArray) -> float:
            return float(m.law.smallest_gap(watch @ s[:r] - task.centre)) - 1e-9

        clearance.terminal = True
        for revolution in range(revolutions):
            begin = start + revolution * period
            times = begin + period * np.arange(1, n + 1) / n
            found = solve_ivp(rate, (begin, times[-1]), state.ravel(), method="DOP853", t_eval=times, rtol=self.rtol,
                              atol=self.atol, events=clearance if math.isfinite(m.gap) else None)
            state = found.y[:, -1].reshape(2, r) if found.y.size else np.full((2, r), np.nan)
            path = np.full((2, n), np.nan)
            path[:, :found.y.shape[1]] = watch @ found.y[:r]
            yield times, path, state


def _check_steps(steps: int) -> None:
    if isinstance(steps, bool) or not isinstance(steps, int) or steps < 8:
        raise BadInput(f"steps_per_revolution is {steps!r}; it must be a whole number of at least 8.")


def _scalar_pull(task: Task) -> Callable[[float, NDArray], NDArray]:
    """The pull for the inner loop. The circular law on two floats costs a third of the same on arrays."""
    from hydrolab.machine.forces import CircularPull
    law = task.model.law
    if type(law) is not CircularPull:
        return task.pull
    xe, ze = (float(c) for c in task.centre)
    stiffness, square = law.stiffness, law.gap**2
    ramp = task.ramp

    def pull(t: float, u: NDArray) -> NDArray:
        x, z = u.tolist()
        x, z = x - xe, z - ze
        room = 1 - (x * x + z * z) / square
        if not room > 0:
            return np.array([math.nan, math.nan])
        field = 1.0 if t >= ramp else t / ramp
        k = field * field * stiffness / (room * math.sqrt(room))
        return np.array([k * x, k * z])

    return pull


def _implicit_pull(task: Task, time: float, free: NDArray, compliance: NDArray, guess: NDArray) -> NDArray:
    """The pull f at the new position u = free + compliance f(u), by Newton on the two coordinates."""
    strength, u = task.field(time) ** 2, guess
    for _ in range(20):
        force, slope = task.model.law.linearise(u - task.centre)
        step = np.linalg.solve(np.eye(2) - strength * compliance @ slope, free + strength * compliance @ force - u)
        u = u + step
        if not np.abs(step).max() > 1e-13 * task.model.length_scale:
            break
    return strength * task.model.law.force(u - task.centre)


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
    Ends early at contact or at an interrupt (Ctrl-C); what was computed is kept and `stopped` says what happened.
    Raises BadInput for arguments outside what is allowed, among them a step beyond the stability limit.
    """
    if not (math.isfinite(speed) and speed > 0):
        raise BadInput(f"speed is {speed!r}; it must be a positive number in rad/s (use rpm(150) for 150 rpm).")
    if isinstance(revolutions, bool) or not isinstance(revolutions, int) or revolutions < 1:
        raise BadInput(f"revolutions is {revolutions!r}; it must be a whole number of at least 1.")
    if not 0 <= ramp <= revolutions:
        raise BadInput(f"ramp is {ramp!r}; it must lie between 0 and the {revolutions} revolutions.")
    centre = model.centre(static_eccentricity, direction)
    small = model if modes is None else reduce(model, modes)
    begin = float(start.times[-1]) if isinstance(start, Trajectory) else 0.0
    period = 2 * math.pi / speed
    task = Task(small, float(speed), centre, ramp * period)
    state = _first_state(model, small, speed, start)
    if any(disturbance):
        static = np.linalg.solve(small.K, small.selection.T)
        state = state + [static @ np.linalg.solve(small.selection @ static, disturbance), np.zeros(small.size)]

    times, paths = [np.array([begin])], [(small.selection @ state[0])[:, None]]
    stopped, finished = f"It ran the {revolutions} revolutions asked for.", True
    runs = method.run(task, state, begin, revolutions)
    done = 0
    try:
        for t, path, latest in runs:
            touching = _contact(task, path)
            if touching is not None:
                times.append(t[:touching])
                paths.append(path[:, :touching])
                stopped, finished = _contact_sentence(task, t[touching], path[:, touching], paths), False
                break
            times.append(t)
            paths.append(path)
            state = latest
            done += 1
            if progress:
                progress(done, revolutions)
    except KeyboardInterrupt:
        stopped, finished = f"Interrupted after {done} of {revolutions} revolutions; these are kept.", False
    return Trajectory(small, float(speed), float(static_eccentricity), centre, np.concatenate(times),
                      np.concatenate(paths, axis=1), state, stopped, finished, method)


def _first_state(model: Model, small: Model, speed: float, start: PeriodicOrbit | Trajectory | None) -> NDArray:
    """Displacement and velocity, (2, r), on the reduced basis."""
    if isinstance(start, Trajectory):
        if start.state.shape[1] != small.size:
            raise BadInput(f"start has {start.state.shape[1]} DOFs, this basis {small.size}; use the same `modes`.")
        return start.state
    if start is None:
        linear = condense(small.with_field(0.0), float(speed), 1, 8)
        sine, cosine = -linear.shaft_linear[1].imag, linear.shaft_linear[1].real
        return np.stack([cosine, speed * sine])
    k = np.arange(1, start.harmonics + 1)
    shaft = start.shaft
    q = shaft[:, 0] + shaft[:, 2::2].sum(axis=1)
    v = shaft[:, 1::2] @ (k * speed)
    if small is model:
        return np.stack([q, v])
    # Coordinates of the reduced basis by mass-weighted projection of the full displacement.
    full, mapped = model.shaft_map, small.shaft_map
    weight = mapped.T @ model.M @ full
    return np.stack([np.linalg.solve(small.M, weight @ q), np.linalg.solve(small.M, weight @ v)])


def _contact(task: Task, path: NDArray) -> int | None:
    """Index of the first sample at which the rotor touches the stator or is lost, or None."""
    if not math.isfinite(task.model.gap) and np.isfinite(path).all():
        return None
    with np.errstate(invalid="ignore"):
        clear = task.model.law.smallest_gap(path - task.centre[:, None]) > 0
    return None if clear.all() else int(np.argmin(clear))


def _contact_sentence(task: Task, time: float, position: NDArray, paths: list[NDArray]) -> str:
    where = position if np.isfinite(position).all() else paths[-1][:, -1] if paths[-1].size else paths[-2][:, -1]
    x, z = where - task.centre
    return (f"The rotor touches the stator after {time * task.speed / (2 * math.pi):.2f} revolutions ({time:.4g} s), at "
            f"gap angle {math.degrees(math.atan2(x, z)) % 360:.0f}° (from z towards x).")
