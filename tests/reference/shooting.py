"""Periodic orbits, their folds and their flips by shooting, with nothing of the harmonic balance.

A motion is integrated over its period together with its variational equations, by classical
Runge–Kutta on what is not linear and exponentials for the rest (Lawson 1967); Newton's method makes
it meet its own start. Folds and flips are where an eigenvalue of the monodromy matrix passes +1 or
−1 along the branch (Seydel 2010).
"""

import math

import numpy as np
import scipy.linalg
from scipy.optimize import brentq

from hydrolab.dynamics.reduction import reduce


class Shooting:
    """Shooting on a basis of `modes` modes, for a stator that is moved along x."""

    def __init__(self, model, speed, revolutions, modes=12, steps=256):
        small = reduce(model, modes, gyroscopic=True)
        r, inverse = small.size, np.linalg.inv(small.M)
        self.law, self.gap, self.speed, self.size = small.law, small.gap, speed, 2 * r
        self.basis, self.full = small, model
        self.h, self.steps = 2 * math.pi / speed / steps, steps * revolutions
        self.whole, self.half = (scipy.linalg.expm(t * np.block(
            [[np.zeros((r, r)), np.eye(r)], [-inverse @ small.K,
                                             -inverse @ small.velocity_matrix(speed)]]))
            for t in (self.h, self.h / 2))
        self.watch = np.hstack([small.selection, np.zeros_like(small.selection)])
        self.load = np.vstack([np.zeros_like(small.selection.T), inverse @ small.selection.T])
        self.cos, self.sin = (np.concatenate([np.zeros(r), speed**2 * inverse @ part])
                              for part in (small.unbalance_cos, small.unbalance_sin))

    def state(self, orbit):
        """[q, q̇] of an orbit at phase 0."""
        shaft, small = orbit.shaft, self.basis
        k = np.arange(1, orbit.harmonics + 1) / orbit.revolutions
        project = np.linalg.solve(small.M, small.shaft_map.T @ self.full.M @ self.full.shaft_map)
        return np.concatenate([project @ (shaft[:, 0] + shaft[:, 2::2].sum(axis=1)),
                               project @ (shaft[:, 1::2] @ (self.speed * k))])

    def rate(self, t, columns, eccentricity):
        """What is not linear in the rates of [x, ∂x/∂x₀, ∂x/∂e], (2r, 2r + 2)."""
        place = self.watch @ columns
        place[0, 0] -= eccentricity * self.gap
        force, slope, _ = self.law.linearise(place[:, 0])
        place[0, -1] -= self.gap
        out = self.load @ np.column_stack([force, slope @ place[:, 1:]])
        out[:, 0] += self.cos * math.cos(self.speed * t) + self.sin * math.sin(self.speed * t)
        return out

    def period(self, x, eccentricity):
        """The end of a period, the monodromy matrix, and the end's derivative by eccentricity."""
        z, h = np.column_stack([x, np.eye(self.size), np.zeros(self.size)]), self.h
        for n in range(self.steps):
            t = n * h
            a = self.rate(t, z, eccentricity)
            begun = self.half @ z
            b = self.rate(t + h / 2, begun + h / 2 * (self.half @ a), eccentricity)
            c = self.rate(t + h / 2, begun + h / 2 * b, eccentricity)
            d = self.rate(t + h, self.whole @ z + h * (self.half @ c), eccentricity)
            z = self.whole @ (z + h / 6 * a) + h / 3 * (self.half @ (b + c)) + h / 6 * d
        return z[:, 0], z[:, 1:-1], z[:, -1]

    def orbit(self, x, eccentricity, fixed, value):
        """The orbit at which coordinate `fixed` of the start has a value: start, eccentricity and
        monodromy matrix.
        """
        scale = np.abs(x).max()
        for _ in range(12):
            end, monodromy, by_e = self.period(x, eccentricity)
            bordered = np.zeros((self.size + 1,) * 2)
            bordered[:-1, :-1], bordered[:-1, -1] = monodromy - np.eye(self.size), by_e
            bordered[-1, fixed] = 1.0
            step = np.linalg.solve(bordered, np.append(end - x, x[fixed] - value))
            x, eccentricity = x - step[:-1], eccentricity - step[-1]
            if np.abs(step[:-1]).max() < 1e-9 * scale:
                return x, eccentricity, monodromy
        raise AssertionError("shooting did not settle")

    def crossing(self, first, second, multiplier):
        """Eccentricity between two near orbits at which a real multiplier passes ±1."""
        a, b = self.state(first), self.state(second)
        fixed = int(np.argmax(np.abs(b - a)[:self.size // 2]))  # the displacement that moves most
        last = {}

        def away(share):
            _, e, monodromy = self.orbit(
                a + share * (b - a), first.static_eccentricity
                + share * (second.static_eccentricity - first.static_eccentricity),
                fixed, (1 - share) * a[fixed] + share * b[fixed])
            last[share] = e
            real = [m.real for m in np.linalg.eigvals(monodromy) if abs(m.imag) < 1e-9]
            return min(real, key=lambda m: abs(m - multiplier)) - multiplier

        root = brentq(away, 0.0, 1.0, xtol=1e-7)
        away(root)
        return last[root]
