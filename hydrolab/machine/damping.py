"""Rayleigh damping from damping ratios: C = αM + βK."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from hydrolab.errors import BadInput

DISTINCT = 1e-6  # relative difference below which two frequencies are the pair of an isotropic rotor


def rayleigh_coefficients(M: NDArray, K: NDArray, ratios: tuple[float, float]) -> tuple[float, float]:
    """α (1/s) and β (s) that give the first and the second distinct mode at rest these damping ratios.

    In a mode of C = αM + βK the ratio is ζ = α/(2ω) + βω/2 (T. K. Caughey and M. E. J. O'Kelly, 1965),
    so two frequencies fix both. The frequencies are those of M and K alone (speed zero). The two equal
    frequencies of an isotropic rotor count once, and rigid-body motions, ω = 0, cannot carry a ratio.

    M, K: mass and stiffness, (n, n), M positive definite, K symmetric. ratios: (ζ₁, ζ₂), fractions of critical.

    Raises BadInput if K is not symmetric or has fewer than two distinct frequencies above zero.
    """
    if not np.allclose(K, K.T, rtol=0, atol=1e-9 * np.abs(K).max()):
        raise BadInput("damping.ratio needs a symmetric stiffness matrix, and this one is not: "
                       "a bearing has cross-coupling with xz different from zx. Give the bearings a damping instead.")
    squares = scipy.linalg.eigvalsh(K, M)
    rounding = 10 * len(M) * np.finfo(float).eps * np.abs(squares).max()
    omega = np.sqrt(squares[squares > rounding])
    above = omega[omega > omega[0] * (1 + DISTINCT)] if len(omega) else omega
    if not len(above):
        raise BadInput(f"damping.ratio needs two distinct frequencies above zero; this machine has {len(omega[:1])}. "
                       "Give the bearings a damping instead.")
    first, second = omega[0], above[0]
    alpha, beta = np.linalg.solve([[1 / (2 * first), first / 2], [1 / (2 * second), second / 2]], ratios)
    return float(alpha), float(beta)
