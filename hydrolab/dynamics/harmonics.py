"""Sums of harmonics: sampled, differentiated, fitted, and what their shape says.

A motion of one period is stored as [mean, sin 1, cos 1, sin 2, cos 2, …] on the last axis, 2m + 1
columns for m harmonics; the axes before it are points, coordinates, degrees of freedom. The phase
is that of the period: where it is q revolutions long, the phase is Ωt/q.

coefficients: such an array. phase: in rad.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrolab.errors import BadInput

# phases at which a motion is looked at around its period: for its smallest gap, its largest swing
PERIOD = 2 * np.pi * np.arange(360) / 360


def fourier_rows(harmonics: int, phase: ArrayLike) -> NDArray:
    """Rows 1, sin φ, cos φ, sin 2φ, cos 2φ … at the given phases (rad, (N,)); (2m + 1, N)."""
    turns = np.arange(1, harmonics + 1)[:, None] * np.asarray(phase, dtype=float)
    rows = np.ones((2 * harmonics + 1, turns.shape[1]))
    rows[1::2], rows[2::2] = np.sin(turns), np.cos(turns)
    return rows


@lru_cache(maxsize=64)
def period_rows(harmonics: int) -> NDArray:
    """`fourier_rows` at the phases `PERIOD`, kept, since every orbit asks for them."""
    return fourier_rows(harmonics, PERIOD)


def rate_rows(harmonics: int, phase: ArrayLike) -> NDArray:
    """Derivatives of `fourier_rows` by the phase, (2m + 1, N)."""
    return rates(np.eye(2 * harmonics + 1)) @ fourier_rows(harmonics, phase)


def synthesise(coefficients: NDArray, phase: ArrayLike) -> NDArray:
    """The motion at the given phases (rad, (N,)): (…, N) from (…, 2m + 1)."""
    return coefficients @ fourier_rows(coefficients.shape[-1] // 2, phase)


def rates(coefficients: NDArray) -> NDArray:
    """Coefficients of the derivative by the phase, (…, 2m + 1); times Ω/q they are velocities."""
    k = np.arange(1, coefficients.shape[-1] // 2 + 1)
    out = np.zeros_like(coefficients)
    out[..., 1::2], out[..., 2::2] = -k * coefficients[..., 2::2], k * coefficients[..., 1::2]
    return out


def fit(samples: NDArray, phase: ArrayLike, harmonics: int) -> NDArray:
    """Coefficients (…, 2m + 1) of samples (…, N) at phases (rad, (N,)), by least squares, so that
    the phases need not be evenly spaced.
    """
    rows = fourier_rows(harmonics, phase)
    flat = samples.reshape(-1, samples.shape[-1])
    found = np.linalg.lstsq(rows.T, flat.T, rcond=None)[0].T
    return found.reshape(*samples.shape[:-1], len(rows))


def to_complex(coefficients: NDArray) -> NDArray:
    """Complex amplitudes û_k of Re Σ û_k e^{ikφ}, (…, m + 1), from (…, 2m + 1)."""
    sine, cosine = coefficients[..., 1::2], coefficients[..., 2::2]
    return np.concatenate([coefficients[..., :1] + 0j, cosine - 1j * sine], axis=-1)


def from_complex(amplitudes: NDArray) -> NDArray:
    """Inverse of `to_complex`."""
    out = np.empty((*amplitudes.shape[:-1], 2 * amplitudes.shape[-1] - 1))
    out[..., 0] = amplitudes[..., 0].real
    out[..., 1::2], out[..., 2::2] = -amplitudes[..., 1:].imag, amplitudes[..., 1:].real
    return out


def amplitudes(coefficients: NDArray) -> NDArray:
    """√(A_k² + B_k²) for k = 1 … m, 0-to-peak, (…, m)."""
    return np.hypot(coefficients[..., 1::2], coefficients[..., 2::2])


@dataclass(frozen=True)
class Ellipse:
    """The ellipse that one harmonic draws in the (x, z) plane.

    major, minor: half axes, m. ratio: minor/major. forward: turns with the spin, from z to x.
    angle: gap angle of the major axis, rad, from z towards x, in (−π/2, π/2].
    """

    major: float
    minor: float
    angle: float
    forward: bool

    @property
    def ratio(self) -> float:
        """minor/major; 1 is a circle, 0 a line."""
        return self.minor / self.major if self.major else 1.0


def whirl(coefficients: NDArray, harmonic: int = 1) -> tuple[NDArray, NDArray]:
    """f and b of w = z + ix = f e^{ikφ} + b e^{−ikφ} for a harmonic k of x and z: complex, (…).

    coefficients: (…, 2, 2m + 1). f is the part that turns with the spin, b the one against it.
    """
    sine, cosine = coefficients[..., 2 * harmonic - 1], coefficients[..., 2 * harmonic]
    amplitude = cosine - 1j * sine
    x, z = amplitude[..., 0], amplitude[..., 1]
    return (z + 1j * x) / 2, (np.conj(z) + 1j * np.conj(x)) / 2


def ellipse(coefficients: NDArray, harmonic: int = 1) -> Ellipse:
    """The ellipse of a harmonic from [mean, sin 1, cos 1, …] of x and z, shape (2, 2m + 1).

    The half axes are |f| + |b| and ||f| − |b|| of `whirl`.
    """
    forward, backward = whirl(coefficients, harmonic)
    f, b = abs(forward), abs(backward)
    angle = float(np.angle(forward * backward)) / 2 if b > 1e-12 * f else 0.0
    return Ellipse(float(f + b), float(abs(f - b)), angle, bool(f >= b))


def long_axis(coefficients: NDArray, harmonic: int = 1) -> NDArray:
    """Long half axis of a harmonic's ellipse, m, for many motions at once: (…) from (…, 2, 2m + 1).
    """
    forward, backward = whirl(coefficients, harmonic)
    return np.abs(forward) + np.abs(backward)


def self_crossings(positions: NDArray) -> int:
    """How often a closed curve crosses itself: the pairs of its segments that cut each other.

    positions: (2, n) over one period, without the repeated end. An orbit with an inner loop has
    one crossing. Raises BadInput for what is not such a curve.
    """
    if not isinstance(positions, np.ndarray) or positions.ndim != 2 or len(positions) != 2:
        raise BadInput(f"positions is a {type(positions).__name__}; give (x, z) over one period, "
                       "an array of shape (2, n), such as orbit.positions(phases).")
    p = positions.T
    d = np.roll(p, -1, axis=0) - p
    n = len(p)
    i, j = np.triu_indices(n, 2)
    keep = ~((i == 0) & (j == n - 1))  # first and last segment are neighbours
    i, j = i[keep], j[keep]
    offset = p[j] - p[i]
    cross = d[i, 0] * d[j, 1] - d[i, 1] * d[j, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (offset[:, 0] * d[j, 1] - offset[:, 1] * d[j, 0]) / cross
        t = (offset[:, 0] * d[i, 1] - offset[:, 1] * d[i, 0]) / cross
    return int(np.sum((s >= 0) & (s < 1) & (t >= 0) & (t < 1)))
