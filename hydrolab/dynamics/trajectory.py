"""A motion in time: a frozen result that prints as a story."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.condensation import fourier_rows
from hydrolab.errors import BadInput
from hydrolab.machine.model import Model


def contact_sentence(time: float, speed: float, angle: float) -> str:
    """When and where the rotor touches: time, s; speed, rad/s; gap angle, rad."""
    return (f"The rotor touches the stator after {time * speed / (2 * math.pi):.2f} revolutions ({time:.4g} s), at "
            f"gap angle {math.degrees(angle) % 360:.0f}° (from z towards x).")


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A motion in time.

    times: s, shape (T,). positions: (x, z) of the generator centre, m, shape (2, T).
    state: displacement and velocity of all DOFs of the integrated model at the end, (2, n), to go on from (nan
    after contact).
    stopped: why it ends, in words. finished: whether all that was asked for was integrated; interrupted: whether it was
    an interrupt that kept it from that.
    """

    model: Model
    speed: float
    static_eccentricity: float
    centre: NDArray
    times: NDArray
    positions: NDArray
    state: NDArray
    stopped: str
    finished: bool
    method: object
    interrupted: bool = False

    @property
    def revolutions(self) -> float:
        """Revolutions integrated."""
        return float((self.times[-1] - self.times[0]) * self.speed / (2 * math.pi))

    def last(self, revolutions: float) -> tuple[NDArray, NDArray]:
        """Times and positions of the last revolutions."""
        keep = self.times >= self.times[-1] - revolutions * 2 * math.pi / self.speed * (1 + 1e-12)
        return self.times[keep], self.positions[:, keep]

    def coefficients(self, harmonics: int, revolutions: int = 1) -> NDArray:
        """[mean, sin 1, cos 1, …] of the last whole revolutions, m, (2, 2m + 1), by least squares in Ωt.

        Least squares, so that any number of steps in a revolution will do.
        Raises BadInput for a motion that ended before so many revolutions.
        """
        if self.revolutions < revolutions * (1 - 1e-9):
            raise BadInput(f"revolutions is {revolutions}, and the motion has {self.revolutions:.3g}. {self.stopped}")
        times, positions = self.last(revolutions)
        rows = fourier_rows(harmonics, self.speed * times[1:])
        return np.linalg.lstsq(rows.T, positions[:, 1:].T, rcond=None)[0].T

    def recurrence(self, revolutions: int = 1) -> float:
        """How far the last revolutions are from as many before, over the size of the motion: 0 repeats, nan is too short."""
        n = revolutions * self.method.steps_per_revolution
        if self.positions.shape[1] <= 2 * n:
            return math.nan
        last, before = self.positions[:, -n:], self.positions[:, -2 * n:-n]
        size = np.hypot(*(last - last.mean(axis=1)[:, None])).max()
        return float(np.hypot(*(last - before)).max() / size)

    def __str__(self) -> str:
        return (f"Motion of {self.model.name} over {self.revolutions:.4g} revolutions at "
                f"{self.speed * 30 / math.pi:.4g} rpm, static eccentricity {100 * self.static_eccentricity:.4g} %. "
                f"{self.stopped}")
