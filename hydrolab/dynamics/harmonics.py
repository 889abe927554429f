"""The shape of an orbit in numbers: the ellipse of a harmonic, loops, the largest vibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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


def ellipse(coefficients: NDArray, harmonic: int = 1) -> Ellipse:
    """The ellipse of a harmonic from [mean, sin 1, cos 1, …] of x and z, shape (2, 2m + 1).

    With w = z + ix = f e^{ikΩt} + b e^{−ikΩt}, the half axes are |f| + |b| and ||f| − |b||.
    """
    sine, cosine = coefficients[:, 2 * harmonic - 1], coefficients[:, 2 * harmonic]
    amplitude = cosine - 1j * sine  # of e^{ikΩt} in x and z
    forward = (amplitude[1] + 1j * amplitude[0]) / 2
    backward = (np.conj(amplitude[1]) + 1j * np.conj(amplitude[0])) / 2
    f, b = abs(forward), abs(backward)
    angle = float(np.angle(forward * backward)) / 2 if b > 1e-12 * f else 0.0
    return Ellipse(float(f + b), float(abs(f - b)), angle, bool(f >= b))


def self_crossings(positions: NDArray) -> int:
    """How often a closed curve crosses itself; positions (2, n) of one period, without the repeated
    end.

    Counts pairs of segments that cut each other; an orbit with an inner loop has one.
    """
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


def largest_vibration(positions: NDArray, mean: NDArray) -> float:
    """Largest distance of the orbit from its mean position, m; positions (2, n), mean (2,)."""
    return float(np.hypot(*(positions - np.asarray(mean)[:, None])).max())


def fourier_rows(harmonics: int, phase: NDArray) -> NDArray:
    """Rows 1, sin φ, cos φ, sin 2φ, cos 2φ … at the given phases; shape (2m + 1, len(phase))."""
    rows = np.ones((2 * harmonics + 1, len(phase)))
    for k in range(1, harmonics + 1):
        rows[2 * k - 1], rows[2 * k] = np.sin(k * phase), np.cos(k * phase)
    return rows


def rate_rows(harmonics: int, phase: NDArray) -> NDArray:
    """Derivatives of `fourier_rows` by the phase."""
    rows = np.zeros((2 * harmonics + 1, len(phase)))
    for k in range(1, harmonics + 1):
        rows[2 * k - 1], rows[2 * k] = k * np.cos(k * phase), -k * np.sin(k * phase)
    return rows


def to_complex(coefficients: NDArray) -> NDArray:
    """[mean, sin, cos, …] on the last axis → complex amplitudes û_k of Re Σ û_k e^{ikΩt}; (…, m +
    1).
    """
    sine, cosine = coefficients[..., 1::2], coefficients[..., 2::2]
    return np.concatenate([coefficients[..., :1] + 0j, cosine - 1j * sine], axis=-1)


def from_complex(amplitudes: NDArray) -> NDArray:
    """Inverse of `to_complex`."""
    out = np.empty((*amplitudes.shape[:-1], 2 * amplitudes.shape[-1] - 1))
    out[..., 0] = amplitudes[..., 0].real
    out[..., 1::2], out[..., 2::2] = -amplitudes[..., 1:].imag, amplitudes[..., 1:].real
    return out
