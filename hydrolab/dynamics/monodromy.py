"""Monodromy matrices of many orbits at once.

A disturbance s of an orbit obeys ṡ = A(t) s = (A₀ + push (J(t) − J₀) watch) s: constant but for a part of rank c, the
number of nonlinear coordinates. Where the pull is the only force that is not linear, the constant part, which holds the
slope J₀ at the centre, is advanced exactly by its exponential, and the rest kicks the velocities in the middle of the step
(Strang splitting): all orbits at once. A bearing, a film or a crack is too stiff for kicks and may act on velocities;
there each step is the exponential of A in its middle (the first term of Magnus's series 1954; Iserles and others 2000).
Both are symmetric, so the error has even powers of the step only, and Richardson's extrapolation from n, 2n (and 4n) steps
gives fourth (sixth) order.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from hydrolab.dynamics.condensation import fourier_rows, rate_rows
from hydrolab.dynamics.splitting import Split, flows
from hydrolab.machine.several import linearise_at

NEAR = 0.9


def strang_product(system: Split, coefficients: NDArray, centre: NDArray, steps: int, revolutions: int = 1) -> NDArray:
    """Monodromy matrices (P, 2r, 2r) with `steps` steps in a revolution, of second order; for a law that does not move.

    coefficients: [mean, sin 1, cos 1, …] of the nonlinear coordinates, m, (P, c, 2m + 1). centre: (P, 2), m.
    revolutions: in a period.
    """
    points, n, c = len(coefficients), len(system.constant), coefficients.shape[1]
    h = 2 * np.pi / system.speed / steps
    total = steps * revolutions
    rows = fourier_rows(coefficients.shape[2] // 2, 2 * np.pi * (np.arange(total) + 0.5) / total)
    path = system.model.relative((coefficients @ rows).transpose(1, 0, 2), centre.T[:, :, None])
    slope = h * (system.model.law.linearise(path)[1] - system.slope[:, :, None, None])
    flow, half = flows(system, steps)
    pushed = flow @ system.push
    product = np.tile(half, (1, points))  # states × (points · columns): one matrix product moves all

    def kicks(step: int) -> NDArray:
        seen = (system.watch @ product).reshape(c, points, n)
        return np.einsum("ijp,jpc->ipc", slope[..., step], seen).reshape(c, -1)

    for step in range(total - 1):
        product = flow @ product + pushed @ kicks(step)
    product = half @ (product + system.push @ kicks(total - 1))
    return product.reshape(n, points, n).transpose(1, 0, 2)


def magnus_product(system: Split, coefficients: NDArray, centre: NDArray, steps: int, revolutions: int = 1) -> NDArray:
    """As `strang_product`, for any law: each step is the exponential of the matrix in its middle."""
    h, total = 2 * np.pi / system.speed / steps, steps * revolutions
    turn = 2 * np.pi * (np.arange(total) + 0.5) / total
    harmonics = coefficients.shape[2] // 2
    rows, rates = fourier_rows(harmonics, turn), rate_rows(harmonics, turn) * system.speed / revolutions
    found = np.empty((len(coefficients), *system.constant.shape))
    for i, (orbit, stator) in enumerate(zip(coefficients, centre, strict=True)):
        path = system.model.relative(orbit @ rows, stator[:, None])
        _, slope, damping = linearise_at(system.model.law, path, orbit @ rates, revolutions * turn, system.speed)
        acts = ((slope - system.slope[:, :, None]).transpose(2, 0, 1) @ system.watch
                + damping.transpose(2, 0, 1) @ system.watch_rate)
        product = np.eye(len(system.constant))
        for step in scipy.linalg.expm(h * (system.constant + system.push @ acts)):
            product = step @ product
        found[i] = product
    return found


def monodromy(system: Split, coefficients: NDArray, centre: NDArray, steps: int,
              revolutions: int = 1) -> tuple[NDArray, NDArray]:
    """Monodromy matrices, (P, 2r, 2r), of sixth and of fourth order, from `steps`, twice and four times as many."""
    with np.errstate(over="ignore", invalid="ignore"):  # what grows beyond all numbers has no multipliers to speak of
        alone = len(system.push.T) == 2 and not system.model.law.moving
        product = strang_product if alone else magnus_product
        coarse, middle, fine = (product(system, coefficients, centre, n, revolutions) for n in (steps, 2 * steps, 4 * steps))
        rough, good = (4 * middle - coarse) / 3, (4 * fine - middle) / 3
        return good + (good - rough) / 15, good


def multipliers(system: Split, coefficients: NDArray, centre: NDArray, steps: int,
                revolutions: int = 1) -> tuple[NDArray, NDArray]:
    """Floquet multipliers, largest first, (P, 2r), and how far they are known, (P,): the change from the lower order."""
    best, good = (eigenvalues(m) for m in monodromy(system, coefficients, centre, steps, revolutions))
    return best, moved(best, good)


def eigenvalues(matrices: NDArray) -> NDArray:
    """Eigenvalues of each matrix, largest modulus first; nan where an orbit leaves the gap or its motion all bounds."""
    values = np.full(matrices.shape[:2], np.nan, dtype=complex)
    inside = np.isfinite(matrices).all(axis=(1, 2))
    values[inside] = np.linalg.eigvals(matrices[inside])
    return np.take_along_axis(values, np.argsort(-np.abs(values), axis=1), axis=1)


def moved(first: NDArray, second: NDArray) -> NDArray:
    """How far apart two sets of multipliers are, (P,): each one that matters against all of the other set.

    Those matter that could decide on stability: at least NEAR times the largest of the row, or NEAR where that is above 1.
    """
    apart = np.abs(first[:, :, None] - second[:, None, :])
    sizes = np.abs(first), np.abs(second)
    least = NEAR * np.minimum(1, np.maximum(*(size.max(axis=1) for size in sizes)))[:, None]
    return np.maximum(*(np.where(size >= least, apart.min(axis=axis), 0).max(axis=1)
                        for size, axis in zip(sizes, (2, 1), strict=True)))
