"""Monodromy matrices of many orbits at once.

A disturbance s of an orbit obeys ṡ = A s + push (J(t) − J₀) watch s: constant but for a part of rank two. Over a step the
constant part, which holds the slope J₀ of the centred pull, is advanced exactly by its exponential; the rest kicks the
velocities in the middle of the step (Strang splitting). The error has even powers of the step only, so Richardson's
extrapolation from n, 2n (and 4n) steps gives fourth (sixth) order.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.condensation import fourier_rows
from hydrolab.dynamics.splitting import Split, flows


def strang_product(system: Split, coefficients: NDArray, centre: NDArray, steps: int) -> NDArray:
    """Monodromy matrices (P, 2r, 2r) with `steps` steps in the period, of second order.

    coefficients: [mean, sin 1, cos 1, …] of the generator's x and z, m, (P, 2, 2m + 1). centre: (P, 2), m.
    """
    points, n = len(coefficients), len(system.constant)
    h = 2 * np.pi / system.speed / steps
    rows = fourier_rows(coefficients.shape[2] // 2, 2 * np.pi * (np.arange(steps) + 0.5) / steps)
    path = (coefficients @ rows - centre[:, :, None]).transpose(1, 0, 2)
    slope = h * (system.model.law.linearise(path)[1] - system.slope[:, :, None, None])
    flow, half = flows(system, steps)
    pushed = flow @ system.push
    product = np.tile(half, (1, points))  # states × (points · columns): one matrix product moves all

    def kicks(step: int) -> NDArray:
        seen = (system.watch @ product).reshape(2, points, n)
        return np.einsum("ijp,jpc->ipc", slope[..., step], seen).reshape(2, -1)

    for step in range(steps - 1):
        product = flow @ product + pushed @ kicks(step)
    product = half @ (product + system.push @ kicks(steps - 1))
    return product.reshape(n, points, n).transpose(1, 0, 2)


def multipliers(system: Split, coefficients: NDArray, centre: NDArray, steps: int) -> tuple[NDArray, NDArray]:
    """Floquet multipliers, largest first, (P, 2r), of fourth order; and how far they move when the step is halved, (P,).

    The products at n, 2n and 4n steps give two extrapolations; the finer one is returned, their difference is the error.
    The error counts the multipliers that matter: the five largest of each point.
    """
    coarse, middle, fine = (strang_product(system, coefficients, centre, n) for n in (steps, 2 * steps, 4 * steps))
    rough, good = (4 * middle - coarse) / 3, (4 * fine - middle) / 3
    best = sorted_by_size(np.linalg.eigvals(good + (good - rough) / 15))
    check = np.linalg.eigvals(good)
    error = np.abs(best[:, :5, None] - check[:, None, :]).min(axis=2).max(axis=1)
    return best, error


def sorted_by_size(values: NDArray) -> NDArray:
    """Values of each row, largest modulus first."""
    return np.take_along_axis(values, np.argsort(-np.abs(values), axis=1), axis=1)
