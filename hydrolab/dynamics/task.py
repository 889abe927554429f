"""What acts on a motion in time: the field's ramp, the unbalance, and the forces as a loop wants them.

The pull of a circular gap is taken on plain floats, which costs a third of the same on arrays.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydrolab.errors import NoConvergence
from hydrolab.machine.forces import CircularPull, ForceLaw
from hydrolab.machine.model import Model
from hydrolab.machine.several import force_at, linearise_at


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

    def law(self, time: float) -> ForceLaw:
        """The forces at a time; the pull goes with the square of the field."""
        strength = self.field(time) ** 2
        return self.model.law if strength == 1 else self.model.law.scaled(strength)

    def force(self, time: float, u: NDArray, rate: NDArray) -> NDArray:
        """Forces on the nonlinear coordinates u with velocities `rate`, N."""
        return force_at(self.law(time), self.model.relative(u, self.centre), rate, self.speed * time, self.speed)

    def linearise(self, time: float, u: NDArray, rate: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Forces, N, and their derivatives by position, N/m, and velocity, N s/m."""
        return linearise_at(self.law(time), self.model.relative(u, self.centre), rate, self.speed * time, self.speed)

    def unbalance(self, time: float) -> NDArray:
        """Unbalance force on all DOFs, N."""
        phase = self.speed * time
        return self.speed**2 * (self.model.unbalance_sin * math.sin(phase) + self.model.unbalance_cos * math.cos(phase))

    def acceleration(self, time: float, q: NDArray, v: NDArray) -> NDArray:
        """q̈ from the equation of motion, Eq. (9)."""
        m = self.model
        force = self.unbalance(time) + m.selection.T @ self.force(time, m.selection @ q, m.selection @ v)
        return np.linalg.solve(m.M, force - m.velocity_matrix(self.speed) @ v - m.K @ q)


def on_floats(law: CircularPull) -> Callable[[float, float], tuple[float, ...]]:
    """The circular law for a loop: (x, z) → (Fx, Fz, ∂Fx/∂x, ∂Fx/∂z, ∂Fz/∂x, ∂Fz/∂z); nan outside the gap.

    On two floats it costs a tenth of the same on arrays of length one.
    """
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
    if type(task.model.law) is not CircularPull:
        return task.force
    law, (xe, ze) = on_floats(task.model.law), task.centre.tolist()

    def pull(t: float, u: NDArray, rate: NDArray) -> NDArray:
        x, z = u.tolist()
        fx, fz, *_ = law(x - xe, z - ze)
        strength = task.field(t) ** 2
        return np.array([strength * fx, strength * fz])

    return pull


def implicit_pull(task: Task, compliance: NDArray) -> Callable[[float, NDArray, NDArray, NDArray], NDArray]:
    """The circular pull f at the unknown position u = free + compliance f(u), by Newton on its two coordinates.

    Returns a function of time, free (2,), a guess of u (2,) and a velocity it does not need; its f is nan outside the gap.
    """
    law, (xe, ze) = on_floats(task.model.law), task.centre.tolist()
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
    """Forces f of any laws at the unknown u = free + compliance f and velocity rate + mobility f, by Newton on f.

    Returns a function of time, free (c,), a guess of u (c,) and rate (c,); its f is nan outside the gap.
    """
    scale, one = task.model.length_scale, np.eye(len(compliance))

    def forces(t: float, free: NDArray, guess: NDArray, rate: NDArray) -> NDArray:
        f = task.force(t, guess, rate)
        for _ in range(20):
            place = free + compliance @ f
            there, slope, damping = task.linearise(t, place, rate + mobility @ f)
            if not np.isfinite(there).all():
                return there
            step = np.linalg.solve(one - slope @ compliance - damping @ mobility, there - f)
            f = f + step
            if not np.abs(compliance @ step).max() > 1e-13 * (scale + np.abs(place).max()):
                return f
        raise _no_position(task, t)

    return forces


def _no_position(task: Task, t: float) -> NoConvergence:
    return NoConvergence(f"Newmark found no position after {t * task.speed / (2 * math.pi):.2f} revolutions: the "
                         "pull changes too much in a step. Use more steps per revolution.")
