"""Methods of time integration: centred finite differences, Newmark, and SciPy's Runge–Kutta.

A method object says how; its `run` yields the motion one revolution at a time. The step of each is a free function
over arrays.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from hydrolab.dynamics.task import Task, explicit_pull, implicit_forces, implicit_pull
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.checks import whole
from hydrolab.machine.forces import CircularPull
from hydrolab.machine.model import Model

Block = tuple[NDArray, NDArray, NDArray]  # times, positions (2, n) of a piece of motion, state (2, r) at its end


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
        fastest = math.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(m.M, m.K))).max())
        if fastest * dt > 2:
            needed = math.ceil(math.pi * fastest / task.speed)
            raise BadInput(f"steps_per_revolution is {n}: the fastest frequency of the model, {fastest:.4g} rad/s, "
                           f"times the step {dt:.3g} s is {fastest * dt:.3g}, and central differences need at most 2. "
                           f"Use at least {needed} steps per revolution, or fewer modes.")
        before, now, push, load = central_difference_matrices(m, task.speed, dt)
        forcing = np.array([load @ task.unbalance(start + i * dt) for i in range(n)])
        q, v = state
        old = q - dt * v + 0.5 * dt**2 * task.acceleration(start, q, v)
        older, u, rate = None, m.selection @ q, m.selection @ v
        pull = explicit_pull(task)

        def ahead(step: int) -> NDArray:
            return now @ q + before @ old + push @ pull(start + step * dt, u, rate) + forcing[step % n]

        for revolution in range(revolutions):
            path = np.empty((n, 2))
            for i in range(n):
                older, old, q = old, q, ahead(revolution * n + i)
                u = m.selection @ q
                path[i] = u[:2]
                if m.law.moving:  # known to second order from what has been computed
                    rate = m.selection @ (1.5 * q - 2 * old + 0.5 * older) / dt
            last = (revolution + 1) * n
            v = (ahead(last) - old) / (2 * dt)  # what the start formula above turns into `old` again
            yield start + (last - n + 1 + np.arange(n)) * dt, path.T, np.stack([q, v])


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

    The pull at the new time is solved for, on its own coordinates; a lagged pull would act as damping.
    """

    steps_per_revolution: int = 512
    beta: float = 0.25
    gamma: float = 0.5

    @property
    def order(self) -> int:
        """2 for γ = ½, else 1."""
        return 2 if self.gamma == 0.5 else 1

    def __post_init__(self) -> None:
        _check_steps(self.steps_per_revolution)
        if not (0 < self.beta <= 0.5 and 0.5 <= self.gamma <= 1):
            raise BadInput(f"beta is {self.beta}, gamma is {self.gamma}; use 0 < beta ≤ 0.5 and 0.5 ≤ gamma ≤ 1.")

    def run(self, task: Task, state: NDArray, start: float, revolutions: int) -> Iterator[Block]:
        """Yield the motion, one revolution at a time."""
        m, n, r = task.model, self.steps_per_revolution, task.model.size
        dt = 2 * math.pi / task.speed / n
        advance, push, load = newmark_matrices(m, task.speed, dt, self.beta, self.gamma)
        if type(m.law) is CircularPull:
            pull = implicit_pull(task, m.selection @ push[:r])
        else:
            pull = implicit_forces(task, m.selection @ push[:r], m.selection @ push[r:2 * r])
        forcing = np.array([load @ task.unbalance(start + (i + 1) * dt) for i in range(n)])
        motion = np.concatenate([*state, task.acceleration(start, *state)])
        u = m.selection @ state[0]
        for revolution in range(revolutions):
            path = np.empty((n, 2))
            for i in range(n):
                free = advance @ motion + forcing[i]
                force = pull(start + (revolution * n + i + 1) * dt, m.selection @ free[:r], u, m.selection @ free[r:2 * r])
                motion = free + push @ force
                u = m.selection @ motion[:r]
                path[i] = u[:2]
            yield start + (revolution * n + 1 + np.arange(n)) * dt, path.T, motion[:2 * r].reshape(2, r).copy()


def newmark_matrices(model: Model, speed: float, dt: float, beta: float, gamma: float) -> tuple[NDArray, ...]:
    """Matrices of s_{n+1} = advance s_n + push f_{n+1} + load F_{n+1} for the motion s = (q, v, a), from one inverse.

    q_{n+1} = q + Δt v + Δt² ((½ − β) a + β a_{n+1}), v_{n+1} = v + Δt ((1 − γ) a + γ a_{n+1}), and the equation of
    motion at the new time. Returns (advance, push, load); push takes the pull at the generator, load a force on all
    DOFs.
    """
    r, velocity = model.size, model.velocity_matrix(speed)
    one, zero = np.eye(r), np.zeros((r, r))
    coast_q = np.hstack([one, dt * one, (0.5 - beta) * dt**2 * one])  # what q and v become if the new a is 0
    coast_v = np.hstack([zero, one, (1 - gamma) * dt * one])
    answer = np.linalg.inv(model.M + gamma * dt * velocity + beta * dt**2 * model.K)
    a = -answer @ (velocity @ coast_v + model.K @ coast_q)
    advance = np.vstack([coast_q + beta * dt**2 * a, coast_v + gamma * dt * a, a])
    load = np.vstack([beta * dt**2 * answer, gamma * dt * answer, answer])
    return advance, load @ model.selection.T, load


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
        load = np.vstack([np.zeros_like(m.selection.T), inverse @ m.selection.T])
        shaken = np.zeros((2, 2 * r))
        shaken[:, r:] = task.speed**2 * np.stack([inverse @ m.unbalance_sin, inverse @ m.unbalance_cos])
        watch = m.selection
        pull = explicit_pull(task)

        def rate(t: float, s: NDArray) -> NDArray:
            phase = task.speed * t
            return (constant @ s + load @ pull(t, watch @ s[:r], watch @ s[r:])
                    + math.sin(phase) * shaken[0] + math.cos(phase) * shaken[1])

        def clearance(t: float, s: NDArray) -> float:
            return float(m.law.smallest_gap(watch[:2] @ s[:r] - task.centre)) - 1e-6 * m.gap

        clearance.terminal = True
        for revolution in range(revolutions):
            begin = start + revolution * period
            times = begin + period * np.arange(1, n + 1) / n
            if math.isfinite(m.gap) and clearance(begin, state.ravel()) <= 0:
                yield times, np.full((2, n), np.nan), state
                return
            # The first step is given, because the guess that SciPy makes never ends where it meets the stator's nan.
            found = solve_ivp(rate, (begin, times[-1]), state.ravel(), method="DOP853", t_eval=times, rtol=self.rtol,
                              atol=self.atol, events=clearance if math.isfinite(m.gap) else None,
                              first_step=period / 1024)
            if found.status < 0:
                raise NoConvergence(f"DOP853 stopped after {begin / period:.2f} revolutions: {found.message} "
                                    "Raise rtol, or look at the motion before it.")
            path = np.full((2, n), np.nan)  # nan from contact on
            if len(found.t):
                path[:, :len(found.t)] = watch[:2] @ found.y[:r]
                state = found.y[:, -1].reshape(2, r)
            yield times, path, state


def _check_steps(steps: int) -> None:
    whole("steps_per_revolution", steps, 8)
