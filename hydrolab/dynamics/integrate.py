"""Motions in time: the verb `integrate`, and the methods that say how.

A method object's `run` yields the motion one revolution at a time; the step of each is a free
function over arrays. Full FE models have frequencies of tens of kilohertz that no orbit shows, so
`integrate` works on a modal basis with the static deflection under the pull (`reduce`) unless told
otherwise. The pull of a round gap is taken on plain floats, at a third of the cost of arrays.

Here u, rate: position and velocity of the nonlinear coordinates. state, v: (q, q̇) and q̇. start:
the first phase, rad. revolutions: how many. speed: rad/s. dt: a step, s. beta, gamma: Newmark's.
method: such an object.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from hydrolab.dynamics.harmonic_balance import condense
from hydrolab.dynamics.reduction import deflection, reduce
from hydrolab.dynamics.results import PeriodicOrbit, Trajectory, contact_sentence
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.model import Model
from hydrolab.machine.pull import CircularPull, ForceLaw
from hydrolab.machine.quantities import number, require_model, shown, turning, whole

# times (T,), nonlinear coordinates (c, T) in a piece of motion, state (2, r) at its end
Block = tuple[NDArray, NDArray, NDArray]
Progress = Callable[[int, int], None]


# ------------------------------------------------------------------ what acts

@dataclass(frozen=True)
class Task:
    """What is integrated: a model at a speed, the stator centre, the time the field's ramp takes,
    s, and the phase of the rotation at time 0, rad.
    """

    model: Model
    speed: float
    centre: NDArray
    ramp: float
    lead: float = 0.0

    def phase(self, time: Any) -> Any:
        """Phase of the rotation at a time or at many, s: rad."""
        return self.speed * time + self.lead

    def pace(self, time: float) -> float:
        """Speed at a time, rad/s."""
        return self.speed

    def field(self, time: float) -> float:
        """Share of the full flux density at a time: linear up to 1 at the end of the ramp."""
        return min(1.0, time / self.ramp) if self.ramp > 0 else 1.0

    def law(self, time: float) -> ForceLaw:
        """The forces at a time; the pull goes with the square of the field."""
        strength = self.field(time) ** 2
        return self.model.law if strength == 1 else self.model.law.scaled(strength)

    def force(self, time: float, u: NDArray, rate: NDArray) -> NDArray:
        """Forces on the nonlinear coordinates u with velocities `rate`, N."""
        return self.law(time).force(self.model.relative(u, self.centre), rate, self.phase(time),
                                    self.pace(time))

    def linearise(self, time: float, u: NDArray,
                  rate: NDArray) -> tuple[NDArray, NDArray, NDArray | None]:
        """Forces, N, and their derivatives by position, N/m, and velocity, N s/m, or None."""
        return self.law(time).linearise(self.model.relative(u, self.centre), rate,
                                        self.phase(time), self.pace(time))

    def loads(self, time: float) -> NDArray:
        """What acts on all DOFs whatever the motion, N: the unbalance and its like."""
        still, turning = self.model.loads(self.speed)
        return still + (turning * cmath.exp(1j * self.phase(time))).real

    def acceleration(self, time: float, q: NDArray, v: NDArray) -> NDArray:
        """q̈ from the equation of motion, Eq. (9)."""
        m = self.model
        force = self.loads(time) + m.selection.T @ self.force(time, m.selection @ q,
                                                                  m.selection @ v)
        return np.linalg.solve(m.M, force - m.velocity_matrix(self.speed) @ v - m.K @ q)


def on_floats(law: CircularPull) -> Callable[[float, float], tuple[float, ...]]:
    """The circular law for a loop: (x, z) → (Fx, Fz, ∂Fx/∂x, ∂Fx/∂z, ∂Fz/∂x, ∂Fz/∂z) or nan."""
    stiffness, square = law.stiffness, law.gap**2

    def circular(x: float, z: float) -> tuple[float, ...]:
        room = 1 - (x * x + z * z) / square
        if not room > 0:
            return (math.nan,) * 6
        k = stiffness / (room * math.sqrt(room))
        b = 3 * k / (room * square)
        return k * x, k * z, k + b * x * x, b * x * z, b * x * z, k + b * z * z

    return circular


def explicit_pull(task: Task) -> Callable[[float, NDArray, NDArray], NDArray]:
    """The forces at a time, a known position and velocity (c,), N, for a loop."""
    if not task.model.law.closed_form:
        return task.force
    law, (xe, ze) = on_floats(cast(CircularPull, task.model.law)), task.centre.tolist()

    def pull(t: float, u: NDArray, rate: NDArray) -> NDArray:
        x, z = u.tolist()
        fx, fz, *_ = law(x - xe, z - ze)
        strength = task.field(t) ** 2
        return np.array([strength * fx, strength * fz])

    return pull


def implicit_pull(task: Task, compliance: NDArray) -> Callable[..., NDArray]:
    """The circular pull f at the unknown position u = free + compliance f(u), by Newton on its two
    coordinates.

    Returns a function of time, free (2,), a guess of u (2,) and a velocity it does not need; its f
    is nan outside the gap.
    """
    law, (xe, ze) = on_floats(cast(CircularPull, task.model.law)), task.centre.tolist()
    (cxx, cxz), (czx, czz) = compliance.tolist()
    scale = task.model.length_scale

    def pull(t: float, free: NDArray, guess: NDArray, rate: NDArray) -> NDArray:
        (free_x, free_z), (x, z) = free.tolist(), guess.tolist()
        strength = task.field(t) ** 2
        for _ in range(20):
            fx, fz, kxx, kxz, kzx, kzz = (strength * value for value in law(x - xe, z - ze))
            rx, rz = free_x + cxx * fx + cxz * fz - x, free_z + czx * fx + czz * fz - z
            if not abs(rx) + abs(rz) > 1e-13 * (scale + abs(x) + abs(z)):
                return np.array([fx, fz])
            # (I − compliance slope) step = r, by Cramer's rule
            a, b = 1 - cxx * kxx - cxz * kzx, -cxx * kxz - cxz * kzz
            c, d = -czx * kxx - czz * kzx, 1 - czx * kxz - czz * kzz
            determinant = a * d - b * c
            x, z = x + (d * rx - b * rz) / determinant, z + (a * rz - c * rx) / determinant
        raise _no_position(task, t)

    return pull


def implicit_forces(task: Task, compliance: NDArray, mobility: NDArray) -> Callable[..., NDArray]:
    """Forces f of any laws at the unknown u = free + compliance f and velocity rate + mobility f,
    by Newton on f.

    Returns a function of time, free (c,), a guess of u (c,) and rate (c,); its f is nan outside the
    gap.
    """
    scale, one = task.model.length_scale, np.eye(len(compliance))

    def forces(t: float, free: NDArray, guess: NDArray, rate: NDArray) -> NDArray:
        f = task.force(t, guess, rate)
        for _ in range(20):
            place = free + compliance @ f
            there, slope, damping = task.linearise(t, place, rate + mobility @ f)
            if not np.isfinite(there).all():
                return there
            slope = slope @ compliance + (0 if damping is None else damping @ mobility)
            step = np.linalg.solve(one - slope, there - f)
            f = f + step
            if not np.abs(compliance @ step).max() > 1e-13 * (scale + np.abs(place).max()):
                return f
        raise _no_position(task, t)

    return forces


def _no_position(task: Task, t: float) -> NoConvergence:
    return NoConvergence(f"No position was found after {task.phase(t) / (2 * math.pi):.2f} "
                         "revolutions: the pull changes too much in a step. Use more steps per "
                         "revolution.")


# ------------------------------------------------------------------ methods

@dataclass(frozen=True)
class CentralDifference:
    """Centred finite differences (Géradin and Rixen 1997), explicit in the pull, second order.

    Stable while ω_max Δt ≤ 2; `integrate` checks it and says how many steps are needed.
    """

    steps_per_revolution: int = 512
    order = 2

    def __post_init__(self) -> None:
        whole("steps_per_revolution", self.steps_per_revolution, 8)

    def run(self, task: Task, state: NDArray, start: float, revolutions: int) -> Iterator[Block]:
        """Yield the motion, one revolution at a time."""
        m, n = task.model, self.steps_per_revolution
        dt = 2 * math.pi / task.speed / n
        fastest = math.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(m.M, m.K))).max())
        if fastest * dt > 2:
            needed = math.ceil(math.pi * fastest / task.speed)
            raise BadInput(f"steps_per_revolution is {n}: the fastest frequency of the model, "
                           f"{fastest:.4g} rad/s, times the step {dt:.3g} s is {fastest * dt:.3g}, "
                           "and central differences need at most 2. Use at least "
                           f"{needed} steps per revolution, or fewer modes.")
        before, now, push, load = central_difference_matrices(m, task.speed, dt)
        forcing = np.array([load @ task.loads(start + i * dt) for i in range(n)])
        # the position a step before the start, by Taylor's series
        q, v = state
        old = q - dt * v + 0.5 * dt**2 * task.acceleration(start, q, v)
        older, u, rate = None, m.selection @ q, m.selection @ v
        pull = explicit_pull(task)

        def ahead(step: int) -> NDArray:
            return (now @ q + before @ old + push @ pull(start + step * dt, u, rate)
                    + forcing[step % n])

        for revolution in range(revolutions):
            path = np.empty((n, len(u)))
            for i in range(n):
                older, old, q = old, q, ahead(revolution * n + i)
                path[i] = u = m.selection @ q
                if m.law.moving:  # known to second order from what has been computed
                    rate = m.selection @ (1.5 * q - 2 * old + 0.5 * older) / dt
            last = (revolution + 1) * n
            # what the start formula above turns into `old` again
            v = (ahead(last) - old) / (2 * dt)
            yield start + (last - n + 1 + np.arange(n)) * dt, path.T, np.stack([q, v])


def central_difference_matrices(model: Model, speed: float,
                                dt: float) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Matrices of q_{n+1} = now q_n + before q_{n−1} + push f_n + load F_n, from one factorisation.

    (M/Δt² + 𝒞/2Δt) q_{n+1} = F_n − (K − 2M/Δt²) q_n − (M/Δt² − 𝒞/2Δt) q_{n−1}, 𝒞 = C + ΩG.
    Returns (before, now, push, load); push takes the pull at the generator, load a force on all
    DOFs.
    """
    velocity = model.velocity_matrix(speed) / (2 * dt)
    load = np.linalg.inv(model.M / dt**2 + velocity)
    return (-load @ (model.M / dt**2 - velocity), -load @ (model.K - 2 * model.M / dt**2),
            load @ model.selection.T, load)


@dataclass(frozen=True)
class Newmark:
    """Newmark's method, average acceleration by default: no step limit, no numerical damping,
    second order.

    The pull at the new time is solved for, on its own coordinates; a lagged pull would act as
    damping.
    """

    steps_per_revolution: int = 512
    beta: float = 0.25
    gamma: float = 0.5

    @property
    def order(self) -> int:
        """2 for γ = ½, else 1."""
        return 2 if self.gamma == 0.5 else 1

    def __post_init__(self) -> None:
        whole("steps_per_revolution", self.steps_per_revolution, 8)
        if not (0 < number("beta", self.beta) <= 0.5 <= number("gamma", self.gamma) <= 1):
            raise BadInput(f"beta is {self.beta}, gamma is {self.gamma}; use 0 < beta ≤ 0.5 and "
                           "0.5 ≤ gamma ≤ 1.")

    def run(self, task: Task, state: NDArray, start: float, revolutions: int) -> Iterator[Block]:
        """Yield the motion, one revolution at a time."""
        m, n, r = task.model, self.steps_per_revolution, task.model.size
        dt = 2 * math.pi / task.speed / n
        advance, push, load = newmark_matrices(m, task.speed, dt, self.beta, self.gamma)
        compliance, mobility = m.selection @ push[:r], m.selection @ push[r:2 * r]
        if m.law.closed_form:
            pull = implicit_pull(task, compliance)
        else:
            pull = implicit_forces(task, compliance, mobility)
        forcing = np.array([load @ task.loads(start + (i + 1) * dt) for i in range(n)])
        motion = np.concatenate([*state, task.acceleration(start, *state)])
        u = m.selection @ state[0]
        for revolution in range(revolutions):
            path = np.empty((n, len(u)))
            times = start + (revolution * n + 1 + np.arange(n)) * dt
            for i in range(n):
                free = advance @ motion + forcing[i]
                force = pull(float(times[i]), m.selection @ free[:r], u,
                             m.selection @ free[r:2 * r])
                motion = free + push @ force
                path[i] = u = m.selection @ motion[:r]
            yield times, path.T, motion[:2 * r].reshape(2, r).copy()


def newmark_matrices(model: Model, speed: float, dt: float, beta: float,
                     gamma: float) -> tuple[NDArray, NDArray, NDArray]:
    """Matrices of s_{n+1} = advance s_n + push f_{n+1} + load F_{n+1} for the motion s = (q, v, a),
    from one inverse.

    q_{n+1} = q + Δt v + Δt² ((½ − β) a + β a_{n+1}), v_{n+1} = v + Δt ((1 − γ) a + γ a_{n+1}), and
    the equation of motion at the new time. Returns (advance, push, load); push takes the pull at
    the generator, load a force on all DOFs.
    """
    r, velocity = model.size, model.velocity_matrix(speed)
    one, zero = np.eye(r), np.zeros((r, r))
    # what q and v become if the new a is 0
    coast_q = np.hstack([one, dt * one, (0.5 - beta) * dt**2 * one])
    coast_v = np.hstack([zero, one, (1 - gamma) * dt * one])
    answer = np.linalg.inv(model.M + gamma * dt * velocity + beta * dt**2 * model.K)
    a = -answer @ (velocity @ coast_v + model.K @ coast_q)
    advance = np.vstack([coast_q + beta * dt**2 * a, coast_v + gamma * dt * a, a])
    load = np.vstack([beta * dt**2 * answer, gamma * dt * answer, answer])
    return advance, load @ model.selection.T, load


@dataclass(frozen=True)
class RungeKutta:
    """SciPy's adaptive DOP853 (Hairer, Nørsett and Wanner 1993), eighth order, error-controlled.

    steps_per_revolution: output points; the steps themselves are chosen by the method.
    """

    rtol: float = 1e-9
    atol: float = 1e-13
    steps_per_revolution: int = 128

    def __post_init__(self) -> None:
        whole("steps_per_revolution", self.steps_per_revolution, 8)
        if not (0 < number("rtol", self.rtol) < 1 and number("atol", self.atol) > 0):
            raise BadInput(f"rtol is {self.rtol}, atol is {self.atol}; both must be positive and "
                           "rtol below 1.")

    def run(self, task: Task, state: NDArray, start: float, revolutions: int) -> Iterator[Block]:
        """Yield the motion, one revolution at a time."""
        m, n, watch = task.model, self.steps_per_revolution, task.model.selection
        r, period = m.size, 2 * math.pi / task.speed
        inverse = np.linalg.inv(m.M)
        constant = np.block([[np.zeros((r, r)), np.eye(r)],
                             [-inverse @ m.K, -inverse @ m.velocity_matrix(task.speed)]])
        load = np.vstack([np.zeros_like(watch.T), inverse @ watch.T])
        still, turning = (np.concatenate([np.zeros(r), inverse @ load])
                          for load in m.loads(task.speed))
        pull = explicit_pull(task)

        def rate(t: float, s: NDArray) -> NDArray:
            return (constant @ s + load @ pull(t, watch @ s[:r], watch @ s[r:]) + still
                    + (turning * cmath.exp(1j * task.phase(t))).real)

        def clearance(t: float, s: NDArray) -> float:
            u = m.relative(watch @ s[:r], task.centre)
            return float(m.law.smallest_gap(u, task.phase(t))) - 1e-6 * m.gap

        events = None
        if math.isfinite(m.gap):
            clearance.terminal, events = True, clearance  # type: ignore[attr-defined]
        for revolution in range(revolutions):
            begin = start + revolution * period
            times = begin + period * np.arange(1, n + 1) / n
            path = np.full((len(watch), n), np.nan)  # nan from contact on
            if events and clearance(begin, state.ravel()) <= 0:
                yield times, path, state
                return
            # The first step is given, because the guess that SciPy makes never ends where it meets
            # the stator's nan.
            found = solve_ivp(rate, (begin, times[-1]), state.ravel(), method="DOP853",
                              t_eval=times, rtol=self.rtol, atol=self.atol, events=events,
                              first_step=period / 1024)
            if found.status < 0:
                raise NoConvergence(f"DOP853 stopped after {begin / period:.2f} revolutions: "
                                    f"{found.message} Raise rtol, or look at the motion before it.")
            if len(found.t):
                path[:, :len(found.t)] = watch @ found.y[:r]
                state = found.y[:, -1].reshape(2, r)
            yield times, path, state


Integrator = CentralDifference | Newmark | RungeKutta


# ------------------------------------------------------------------ the verb

def integrate(model: Model, method: Integrator, *, speed: float, static_eccentricity: float = 0.0,
              revolutions: int = 1000, ramp: int = 0, modes: int | None = 12,
              direction: float = math.pi / 2, start: PeriodicOrbit | Trajectory | None = None,
              disturbance: tuple[float, float] = (0.0, 0.0),
              progress: Progress | None = None) -> Trajectory:
    """Integrate the motion, by default from the steady state of the linear problem.

    speed: rad/s. static_eccentricity: fraction of the gap. ramp: revolutions over which the field
    rises from 0 to its full value. modes: size of the modal basis beside the static deflection
    under the pull and what `reduce` adds for a thousandth at this speed; None integrates all DOFs.
    direction: gap angle of the stator offset, rad. start: an orbit to begin on (at phase 0), or a
    trajectory of the same model and basis to go on from, at the phase where it ended, whatever the
    speed. disturbance: a sideways displacement (x, z) of the generator, m, added to the start in
    the shape of the static deflection. progress: called after each revolution with (done, all), as
    `hydrolab.progress` takes it. Contact, a step without a solution or an interrupt (Ctrl-C) ends
    it early; what was computed is kept and `stopped` says what happened. Raises BadInput for what
    is not allowed, such as a step beyond the stability limit and a start from another machine.
    """
    require_model(model)
    speed = turning(speed)
    model = model.at(speed)
    if not isinstance(method, Integrator):
        raise BadInput(f"method is {shown(method)}; it must be a CentralDifference, a Newmark or a "
                       "RungeKutta.")
    revolutions = whole("revolutions", revolutions, 1)
    going_on = start if isinstance(start, Trajectory) else None
    # the rotation goes on from the phase that the motion before has reached
    begin = float(going_on.times[-1]) if going_on else 0.0
    lead = float(going_on.phases[-1]) - speed * begin if going_on else 0.0
    period = 2 * math.pi / speed
    if not 0 <= ramp <= begin / period + revolutions:
        raise BadInput(f"ramp is {ramp!r}; it must lie between 0 and the {revolutions} "
                       "revolutions.")
    centre = model.centre(number("static_eccentricity", static_eccentricity), direction)
    small = on_basis(model, modes, speed)
    task = Task(small, speed, centre, ramp * period, lead)
    state = _first_state(model, small, speed, start)
    if any(disturbance):
        # in the shape of the static deflection under a push
        state = state + [deflection(small, disturbance), np.zeros(small.size)]
    first = (np.array([begin]), (small.selection @ state[0])[:, None], state)
    blocks, stopped, interrupted = _moved(task, method, first, revolutions, progress)
    times, paths, states = zip(*blocks, strict=True)
    return Trajectory(small, speed, float(static_eccentricity), centre, np.concatenate(times),
                      np.concatenate(paths, axis=1)[:2], states[-1],
                      stopped or f"It ran the {revolutions} revolutions asked for.", not stopped,
                      method, interrupted, lead)


def on_basis(model: Model, modes: int | None, speed: float) -> Model:
    """The model on so many modes and what they lack at a speed; with all its DOFs for None.

    Raises BadInput for a DOF without mass.
    """
    small = model.at(speed) if modes is None else reduce(model, modes, speed=speed)
    inertia = np.linalg.eigvalsh(small.M)
    if not inertia[0] > len(inertia) * np.finfo(float).eps * inertia[-1]:
        raise BadInput(f"{model.name} has a DOF without mass, which cannot be integrated in time; "
                       "give the shaft a density above 0.")
    return small


def _moved(task: Task, method: Integrator, first: Block, revolutions: int,
           progress: Progress | None) -> tuple[list[Block], str, bool]:
    """The pieces of a motion from the first on, why it ended early or "", if by an interrupt."""
    blocks = [first]
    times, _, state = first
    try:
        # a motion that grows without bound is said in words; an underflow is harmless
        with np.errstate(all="ignore"):
            for block in method.run(task, state, float(times[0]), revolutions):
                block, stopped = up_to_the_end(task, block, blocks[-1])
                blocks.append(block)
                if stopped:
                    return blocks, stopped, False
                if progress:
                    progress(len(blocks) - 1, revolutions)
    except KeyboardInterrupt:
        return blocks, (f"Interrupted after {len(blocks) - 1} of {revolutions} revolutions; these "
                        "are kept."), True
    except NoConvergence as failure:
        return blocks, str(failure), False
    return blocks, "", False


def _first_state(model: Model, small: Model, speed: float,
                 start: PeriodicOrbit | Trajectory | None) -> NDArray:
    """Displacement and velocity, (2, r), on the reduced basis."""
    if start is None:
        mean, linear = condense(small.with_field(0.0), float(speed), 1, 8).shaft_linear
        return np.stack([mean.real + linear.real, -speed * linear.imag])
    if isinstance(start, Trajectory):
        if not np.isfinite(start.state).all():
            raise BadInput(f"start cannot be gone on from. {start.stopped}")
        if start.speed != speed:  # the basis is that of a speed
            basis = _basis(model, start.model)
            _require_same(model.on_basis(basis), start.model)
            return _projected(model, small, start.state @ basis.T)
        if start.state.shape[1] != small.size:
            raise BadInput(f"start has {start.state.shape[1]} DOFs, this basis {small.size}; use "
                           "the same `modes`.")
        _require_same(small, start.model)
        return start.state
    if not isinstance(start, PeriodicOrbit):
        raise BadInput(f"start is {shown(start)}; it must be a steady state or a Trajectory.")
    _require_same(model, start.model)
    return start.state() if small is model else _projected(model, small, start.state())


def _basis(model: Model, small: Model) -> NDArray:
    """Columns of the coordinates of a reduced model, (n, r)."""
    return np.linalg.lstsq(model.shaft_map, small.shaft_map, rcond=None)[0]


def _projected(model: Model, small: Model, state: NDArray) -> NDArray:
    """A state of all DOFs, (2, n), in those of a reduced model, weighted by the masses."""
    return np.linalg.solve(small.M, _basis(model, small).T @ model.M @ state.T).T


def _require_same(model: Model, other: Model) -> None:
    """Raise BadInput where the DOFs of two models are not those of the same masses on one basis."""
    for name in ("M", "shaft_map", "selection"):
        own, its = getattr(model, name), getattr(other, name)
        if own.shape != its.shape or not np.allclose(own, its, rtol=1e-9,
                                                     atol=1e-9 * np.abs(own).max()):
            raise BadInput(f"start is a motion of another machine than {model.name}: other masses, "
                           "elements or places, or another stiffness on a basis of modes. Start "
                           "from a motion of this one; a change of stiffness needs modes=None.")


def up_to_the_end(task: Task, block: Block, before: Block) -> tuple[Block, str]:
    """The part of a block before contact, with the sentence that says so; "" if there is none."""
    times, path, state = block
    law, m = task.model.law, task.model
    gaps = law.smallest_gap(m.relative(path, task.centre[:, None]), task.phase(times))
    clear = np.broadcast_to(gaps > 0, times.shape)  # false for nan
    if not math.isfinite(m.gap):
        clear = np.isfinite(path).all(axis=0)
    if clear.all():
        return block, ""
    first = int(np.argmin(clear))
    phase = task.phase(float(times[first]))
    if not math.isfinite(m.gap):
        sentence = (f"The motion grew beyond all numbers after {phase / (2 * math.pi):.2f} "
                    "revolutions.")
    else:
        # the last place that is a number
        near = np.hstack([before[1], path[:, :first + 1]])
        near = near[:, np.isfinite(near).all(axis=0)][:, -1]
        angle = float(law.gap_angle(m.relative(near, task.centre), phase))
        sentence = contact_sentence(phase, float(times[first]), angle)
    return (times[:first], path[:, :first], np.full_like(state, np.nan)), sentence
