r"""The slow twin: harmonic balance over ALL degrees of freedom, as the paper writes it.

Equations (14) to (19) of Villa, Carvalho and Salomon without any elimination: the real matrices Λ_i
with K − (iΩ)² M on the diagonal and ∓iΩ (C + ΩG) beside it, H(Y) = ΛY − Z(Y), and Z by alternating
frequency and time. Nothing here is shared with `condensation`, so each can be tested against the
other.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from hydrolab.errors import NoConvergence
from hydrolab.machine.model import Model


def dynamic_matrix(model: Model, speed: float, harmonics: int, revolutions: int = 1) -> NDArray:
    """Λ = diag(K, Λ_1, …, Λ_m) of Eqs. (15) and (18), for Y = [B_0, A_1, B_1, …, A_m, B_m]; N/m."""
    blocks = [model.K]
    for i in range(1, harmonics + 1):
        w = i * speed / revolutions
        inertia = model.K - model.M * w**2
        velocity = (model.C + speed * model.G) * w
        blocks.append(np.block([[inertia, -velocity], [velocity, inertia]]))
    return scipy.linalg.block_diag(*blocks)


def solve_full(model: Model, speed: float, static_eccentricity: float = 0.0, harmonics: int = 4,
               samples: int = 64, steps: int = 10, revolutions: int = 1) -> NDArray:
    """[mean, sin 1, cos 1, …] of every DOF in the steady state; shape (n, 2m + 1), m or rad.

    The stator offset is along x. The pull and the offset are raised to their full size in `steps`
    steps, each solved by Newton. revolutions: in a period; harmonic i has the frequency
    iΩ/revolutions. Raises NoConvergence where Newton stops before the last step.
    """
    n, columns = model.size, 2 * harmonics + 1
    turn = 2 * np.pi * np.arange(samples) / samples
    into_time = np.array([np.ones(samples)] + [wave(i * turn) for i in range(1, harmonics + 1)
                                               # Eq. (10), (2m + 1, N)
                                               for wave in (np.sin, np.cos)])
    into_rate = np.array([np.zeros(samples)]
                         + [i * speed / revolutions * wave for i in range(1, harmonics + 1)
                                                # Eq. (11)
                                                for wave in (np.cos(i * turn), -np.sin(i * turn))])
    into_coefficients = 2 / samples * into_time.T
    into_coefficients[:, 0] /= 2  # Eq. (13), (N, 2m + 1)
    phase = revolutions * turn
    unbalance = speed**2 * (np.outer(model.unbalance_sin,
                                     np.sin(phase)) + np.outer(model.unbalance_cos, np.cos(phase)))
    constant = dynamic_matrix(model, speed, harmonics, revolutions)
    offset = static_eccentricity * model.gap if static_eccentricity else 0.0
    S = model.selection

    Y = np.linalg.solve(constant, (unbalance @ into_coefficients).T.ravel())
    for ratio in np.linspace(0, 1, steps + 1)[1:]:
        law, centre = model.law.scaled(ratio), np.zeros((len(S), 1))
        centre[0] = ratio * offset
        for _ in range(30):
            X = Y.reshape(columns, n).T
            place, rate = S @ X @ into_time - centre, S @ X @ into_rate
            pull, slope, damping = law.linearise(place, rate, phase, speed)
            H = constant @ Y - ((unbalance + S.T @ pull) @ into_coefficients).T.ravel()
            # ∂Z_k/∂Y_l = Sᵀ [Σ_t into_coefficients(t, k) ∂F/∂u(t) into_time(l, t)] S
            between = np.einsum("tk,ijt,lt->kilj", into_coefficients, slope, into_time)
            if damping is not None:
                between += np.einsum("tk,ijt,lt->kilj", into_coefficients, damping, into_rate)
            J = constant - np.einsum("ia,kilj,jb->kalb", S, between, S).reshape(n * columns,
                                                                                n * columns)
            if not np.isfinite(H).all():
                raise NoConvergence(f"The full harmonic balance left the gap at {100 * ratio:.0f} "
                                    "% of the pull.")
            step = np.linalg.solve(J, H)
            Y = Y - step
            if np.abs(step).max() < 1e-13 * np.abs(Y).max():
                break
        else:
            raise NoConvergence(f"The full harmonic balance stopped at {100 * ratio:.0f} % of the "
                                "pull and offset, "
                                f"last step {np.abs(step).max():.1e} m; raise `steps`, or a fold "
                                "is near.")
    return Y.reshape(columns, n).T
