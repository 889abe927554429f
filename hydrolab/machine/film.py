r"""A short journal film with cavitation (the π-film), in closed form.

In a bearing much shorter than its diameter oil flows along the axis only (Dubois and Ocvirk 1953). The Reynolds
equation then integrates to F = −C ∫ (w·n) n / (1 − x·n)³ dφ with C = µ R L³/c³, x = u/c, n = (sin φ, cos φ) and
w = u̇ + (Ω/2)(−z, x): the velocity of the journal seen from axes that turn at half the speed. Oil bears no tension, so
only the half of the circumference with w·n > 0 counts. Everything follows from one integral over that half,

G(p, q) = ∫ dθ / (1 − p cos θ − q sin θ) = (2/r) A,  A = π/2 + arctan(p/r),  r² = 1 − p² − q²,  |θ| < π/2,

with p and q the parts of x along w and a quarter turn on: F = −(C/2) ∂²G/∂x² w. The same force is given in other
letters by Capone (1991); Adiletta, Guido and Rossi (1996) print it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class ShortFilm:
    """Force of a cavitated short film on a journal at u = (x, z) that moves with u̇, at a speed Ω.

    damping: C = µ R L³/c³, N s/m. clearance: radial, c, m; outside it the force is nan.
    reference: stiffness of the linear bearing in the model's matrix, N/m, which this law takes back.
    """

    moving: ClassVar[bool] = True
    damping: float
    clearance: float
    reference: float = 0.0

    def _squeeze(self, u: NDArray, velocity: NDArray, speed: float) -> tuple[NDArray, ...]:
        """|w|, its direction m and the quarter turn of it, and the parts p, q of u/c along them."""
        wx, wz = velocity[0] - speed / 2 * u[1], velocity[1] + speed / 2 * u[0]
        size = np.hypot(wx, wz)
        safe = np.where(size > 0, size, 1.0)
        m = np.stack([np.where(size > 0, wx / safe, 0.0), np.where(size > 0, wz / safe, 1.0)])
        turned = np.stack([m[1], -m[0]])
        return size, m, turned, (u * m).sum(axis=0) / self.clearance, (u * turned).sum(axis=0) / self.clearance

    def force_at(self, u: NDArray, velocity: NDArray, phase: NDArray | float, speed: float) -> NDArray:
        """Force on the journal, N; shape of u. velocity: m/s. speed: rad/s. The phase does not matter."""
        size, m, turned, p, q = self._squeeze(u, velocity, speed)
        pp, pq, _ = second_derivatives(p, q)
        return self.reference * u - self.damping / 2 * size * (pp * m + pq * turned)

    def linearise_at(self, u: NDArray, velocity: NDArray, phase: NDArray | float,
                     speed: float) -> tuple[NDArray, NDArray, NDArray]:
        """Force, N, and its derivatives with respect to u, N/m, and to the velocity, N s/m."""
        size, m, turned, p, q = self._squeeze(u, velocity, speed)
        pp, pq, qq = second_derivatives(p, q)
        force = self.reference * u - self.damping / 2 * size * (pp * m + pq * turned)

        def turned_back(a: NDArray, b: NDArray, c: NDArray) -> NDArray:
            """The symmetric tensor a mm + b (mt + tm) + c tt in (x, z)."""
            return (a * m[:, None] * m + b * (m[:, None] * turned + turned[:, None] * m)
                    + c * turned[:, None] * turned)

        by_velocity = -self.damping / 2 * turned_back(pp, pq, qq)
        by_place = -self.damping / (2 * self.clearance) * size * turned_back(*third_derivatives(p, q))
        # w = u̇ + (Ω/2)(−z, x), so u also acts through w
        by_place[:, 0] += speed / 2 * by_velocity[:, 1]
        by_place[:, 1] -= speed / 2 * by_velocity[:, 0]
        by_place[[0, 1], [0, 1]] += self.reference
        return force, by_place, by_velocity

    def scaled(self, factor: float) -> ShortFilm:
        """The same law: a film does not change with the field."""
        return self


def _parts(p: NDArray, q: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """1/r, A and B = 1/(1 − q²); nan outside the clearance."""
    with np.errstate(invalid="ignore", divide="ignore"):
        s = 1 / np.sqrt(1 - p * p - q * q)
        return s, np.pi / 2 + np.arctan(p * s), 1 / (1 - q * q)


def second_derivatives(p: NDArray, q: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """G_pp, G_pq, G_qq: twice the integrals of (cos², cos sin, sin²)/(1 − p cos θ − q sin θ)³ over the half."""
    s, A, B = _parts(p, q)
    pp = 2 * (3 * p * s**4 + A * (s**3 + 3 * p * p * s**5))
    pq = 2 * (q * (p * p * B + 2) * s**4 + 3 * A * p * q * s**5)
    qq = 2 * (A * (s**3 + 3 * q * q * s**5) + 3 * p * q * q * B * s**4 + p * B * (1 + 2 * q * q * B) * s**2)
    return pp, pq, qq


def third_derivatives(p: NDArray, q: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """G_ppp, G_ppq, G_pqq: six times the integrals of (cos³, cos² sin, cos sin²)/(1 − p cos θ − q sin θ)⁴."""
    s, A, B = _parts(p, q)
    ppp = 2 * (4 * s**4 + 15 * p * p * s**6 + A * (9 * p * s**5 + 15 * p**3 * s**7))
    ppq = 2 * (12 * p * q * s**6 + p * q * B * (s**4 + 3 * p * p * s**6) + A * (3 * q * s**5 + 15 * p * p * q * s**7))
    pqq = 2 * ((p * p * B + 2) * s**4 + 2 * (p * q * B) ** 2 * s**4 + 4 * q * q * (p * p * B + 2) * s**6
               + 3 * B * (p * q) ** 2 * s**6 + A * (3 * p * s**5 + 15 * p * q * q * s**7))
    return ppp, ppq, pqq
