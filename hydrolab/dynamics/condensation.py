"""Harmonic balance on the nonlinear coordinates alone: every linear DOF eliminated exactly.

For each harmonic k the linear machine answers a force f̂_k on the nonlinear coordinates u = S q by
u_k = u_lin,k + S Z_k⁻¹ Sᵀ f̂_k with Z_k = K − (kΩ)² M + ikΩ (C + ΩG), Eq. (16) in complex form. The
inverse of that small compliance, D_k, is the dynamic stiffness of the whole machine as the generator
feels it, so H(Y) = Λ (Y − Y_lin) − Z(Y), Eq. (19), has c(2m + 1) unknowns at any number of elements, where c is
the number of nonlinear coordinates: 2 where the pull is the only force that is not linear.

Coefficients are stored per coordinate as [mean, sin 1, cos 1, sin 2, cos 2, …], shape (c, 2m + 1). Where the period
is that of q revolutions, harmonic k turns with kΩ/q and the unbalance is in harmonic q.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import zgecon, zgesv

from hydrolab.errors import BadInput
from hydrolab.machine.model import Model

SINGULAR = 1e-15  # reciprocal condition number below which a dynamic stiffness has no inverse to speak of


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
    """[mean, sin, cos, …] on the last axis → complex amplitudes û_k of Re Σ û_k e^{ikΩt}; (…, m + 1)."""
    sine, cosine = coefficients[..., 1::2], coefficients[..., 2::2]
    return np.concatenate([coefficients[..., :1] + 0j, cosine - 1j * sine], axis=-1)


def from_complex(amplitudes: NDArray) -> NDArray:
    """Inverse of `to_complex`."""
    out = np.empty((*amplitudes.shape[:-1], 2 * amplitudes.shape[-1] - 1))
    out[..., 0] = amplitudes[..., 0].real
    out[..., 1::2], out[..., 2::2] = -amplitudes[..., 1:].imag, amplitudes[..., 1:].real
    return out


@dataclass(frozen=True, eq=False)
class Condensed:
    """A model at one speed, seen from its c nonlinear coordinates; unknowns y = Y / length, flattened.

    stiffness: Λ scaled by `length`/`force`, (cK, cK) with K = 2m + 1. linear: Y_lin / length, (c, K).
    synthesis: samples of the position from y, (K, N), m. analysis: coefficients from N forces, (N, K), 1/N.
    products: analysis and synthesis in one, (N, K²), so that the AFT Jacobian is one matrix product.
    phase: Ωt of the samples, rad, (N,). rate, rate_products: as synthesis and products, for the velocity, m/s.
    recovery, shaft_linear: q_k = shaft_linear_k + recovery_k (u_k − u_lin,k), all DOFs, complex.
    revolutions: in a period.
    """

    model: Model
    speed: float
    harmonics: int
    samples: int
    length: float
    force: float
    stiffness: NDArray
    linear: NDArray
    synthesis: NDArray
    analysis: NDArray
    products: NDArray
    phase: NDArray
    rate: NDArray
    rate_products: NDArray
    recovery: NDArray
    shaft_linear: NDArray
    revolutions: int = 1

    def position(self, y: NDArray, centre: NDArray) -> NDArray:
        """Samples of the nonlinear coordinates, m, (c, N), the generator's counted from the stator centre (2,), m."""
        position = y.reshape(len(self.linear), -1) @ self.synthesis
        position[:2] -= centre[:, None]
        return position

    def velocity(self, y: NDArray) -> NDArray:
        """Samples of their velocity, m/s, (c, N)."""
        return y.reshape(len(self.linear), -1) @ self.rate

    def residual(self, y: NDArray, centre: NDArray) -> NDArray:
        """H(Y) of Eq. (19), scaled; centre: stator centre, m."""
        position, law = self.position(y, centre), self.model.law
        force = law.force_at(position, self.velocity(y), self.phase, self.speed) if law.moving else law.force(position)
        return self.stiffness @ (y - self.linear.ravel()) - (force @ self.analysis).ravel()

    def linearise(self, y: NDArray, centre: NDArray) -> tuple[NDArray, NDArray]:
        """H(Y) and its exact Jacobian by alternating frequency and time (Cameron and Griffin 1989)."""
        position, law = self.position(y, centre), self.model.law
        c, columns, samples = len(position), *self.synthesis.shape
        if law.moving:
            force, slope, damping = law.linearise_at(position, self.velocity(y), self.phase, self.speed)
            pull = (slope.reshape(c * c, samples) @ self.products
                    + damping.reshape(c * c, samples) @ self.rate_products)
        else:
            force, slope = law.linearise(position)
            pull = slope.reshape(c * c, samples) @ self.products
        residual = self.stiffness @ (y - self.linear.ravel()) - (force @ self.analysis).ravel()
        pull = pull.reshape(c, c, columns, columns).transpose(0, 2, 1, 3)
        return residual, self.stiffness - pull.reshape(c * columns, c * columns)


def dynamic_stiffness(model: Model, w: float, speed: float) -> NDArray:
    """Z = K − w² M + iw (C + ΩG), complex, (n, n), at an angular frequency w and a speed Ω, rad/s."""
    return model.K - w**2 * model.M + 1j * w * model.velocity_matrix(speed)


def in_sines(stiffness: NDArray) -> NDArray:
    """Complex c × c stiffnesses of the harmonics 0 … m as the real matrix on [mean, sin 1, cos 1, …] of x, then z, …"""
    columns, count = 2 * len(stiffness) - 1, stiffness.shape[1]
    real = np.zeros((count, columns, count, columns))
    real[:, 0, :, 0] = stiffness[0].real
    for k in range(1, len(stiffness)):
        s, c = 2 * k - 1, 2 * k
        real[:, s, :, s] = real[:, c, :, c] = stiffness[k].real
        real[:, c, :, s], real[:, s, :, c] = stiffness[k].imag, -stiffness[k].imag
    return real.reshape(count * columns, count * columns)


@lru_cache(maxsize=64)
def condense(model: Model, speed: float, harmonics: int, samples: int, revolutions: int = 1) -> Condensed:
    """Eliminate the linear DOFs of a model at one speed; cached, since a branch asks again and again.

    revolutions: in the period that the harmonics share.

    Raises BadInput where the machine can move freely (no static stiffness) or the speed is a resonance
    without damping.
    """
    n, c, length = model.size, len(model.selection), model.length_scale
    amplitudes = np.zeros((harmonics + 1, n), dtype=complex)
    recovery = np.empty((harmonics + 1, n, c), dtype=complex)
    stiffness = np.empty((harmonics + 1, c, c), dtype=complex)
    for k in range(harmonics + 1):
        dynamic = dynamic_stiffness(model, k * speed / revolutions, speed)
        loads = np.zeros((n, c + 1), dtype=complex)
        loads[:, :c] = model.selection.T
        if k == revolutions:
            loads[:, c] = speed**2 * (model.unbalance_cos - 1j * model.unbalance_sin)
        factors, _, answer, singular = zgesv(dynamic, loads)
        if singular or not zgecon(factors, np.abs(dynamic).sum(axis=0).max())[0] > SINGULAR:
            raise BadInput(f"{model.name} at {speed:g} rad/s has no finite response in harmonic {k / revolutions:g}: "
                           + ("it can move freely, so give it bearings." if k == 0 else
                              "an undamped resonance; add damping or change the speed."))
        stiffness[k] = np.linalg.inv(model.selection @ answer[:, :c])
        recovery[k] = answer[:, :c] @ stiffness[k]
        amplitudes[k] = answer[:, c]

    columns = 2 * harmonics + 1
    turn = 2 * np.pi * np.arange(samples) / samples
    rows = fourier_rows(harmonics, turn)
    weights = np.full(columns, 2 / samples)
    weights[0] = 1 / samples
    force = length * float(np.abs(stiffness[0]).max())
    analysis = (weights[:, None] * rows).T / force
    synthesis = length * rows
    rate = length * speed / revolutions * rate_rows(harmonics, turn)
    return Condensed(
        model, speed, harmonics, samples, length, force,
        stiffness=in_sines(stiffness) * (length / force),
        linear=from_complex((amplitudes @ model.selection.T).T) / length,
        synthesis=synthesis, analysis=analysis,
        products=np.einsum("nk,ln->nkl", analysis, synthesis).reshape(samples, -1),
        phase=revolutions * turn, rate=rate,
        rate_products=np.einsum("nk,ln->nkl", analysis, rate if model.law.moving else rate[:0]).reshape(samples, -1),
        recovery=recovery, shaft_linear=amplitudes, revolutions=revolutions,
    )


def condensed_slope(eq: Condensed, dynamic: Sequence[NDArray], load: NDArray) -> tuple[NDArray, NDArray]:
    """Derivatives of `stiffness` and `linear` when each Z_k changes by `dynamic[k]` and the 1X load by `load`.

    From D = (S Z⁻¹ Sᵀ)⁻¹ follows D' = (D S Z⁻¹) Z' (Z⁻¹ Sᵀ D), and from Z q = F, q' = Z⁻¹ (F' − Z' q).
    dynamic: one complex (n, n) matrix for each harmonic 0 … m. load: complex, (n,).
    """
    model, speed, c = eq.model, eq.speed, len(eq.linear)
    stiffness = np.empty((eq.harmonics + 1, c, c), dtype=complex)
    linear = np.zeros((eq.harmonics + 1, c), dtype=complex)
    for k in range(eq.harmonics + 1):
        dynamic_k = dynamic_stiffness(model, k * speed / eq.revolutions, speed)
        answer = np.linalg.solve(dynamic_k.T, model.selection.T.astype(complex)).T
        stiffness[k] = np.linalg.inv(answer @ model.selection.T) @ answer @ dynamic[k] @ eq.recovery[k]
        if k == eq.revolutions:
            linear[k] = answer @ (load - dynamic[k] @ eq.shaft_linear[k])
    return in_sines(stiffness) * (eq.length / eq.force), from_complex(linear.T) / eq.length
