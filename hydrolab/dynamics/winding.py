"""How many disturbances of an orbit grow: counted on the whole machine, with no basis to choose.

The forces that are not linear act on c coordinates only. With D(s) = M s² + (C + ΩG) s + K of all
degrees of freedom and T(s) = S D(s)⁻¹ Sᵀ, a disturbance e^{λt} Σ u_k e^{ikνt}, ν = Ω/q, obeys
u_k = T(λ + ikν) Σ_l (J_{k−l} + (λ + ilν) B_{k−l}) u_l, where J and B are the Fourier coefficients
of ∂F/∂u and ∂F/∂u̇ around the orbit. So f(λ) = det(I − T̂Ĵ), of size c(2N + 1), is zero at the
Floquet exponents, has its poles at the eigenvalues of the linear machine, and repeats with iν:

    unstable exponents = unstable eigenvalues − (change of arg f along one period of the axis)/2π.

What lies beyond the harmonics ±N sees the mean slope only and is counted by det(I − T J₀) along
the rest of the axis. Sources: the argument principle (Nyquist 1932); Hill's determinant in Nayfeh
and Balachandran (1995).

Here which: rows of the orbits asked about. local: (P, c, 2m + 1), m. centres: of the stator, (P,
2), m. order: N. part: the linear part of the forces. samples: of Im s. exponents: λ. step: the last
of Newton.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.harmonic_balance import Condensed
from hydrolab.dynamics.harmonics import fourier_rows, rates
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput
from hydrolab.machine.model import Model

TURN = math.pi / 3  # largest change of log f between two samples
INTERVALS = 16  # on half a period, before any are halved
HALVINGS = 40
MOVED = 0.05  # of its distance from the axis: a pole that the forces move less cannot cross it
FAR = 1e12  # in half periods: where every force has ended
TWIN = 1e-7  # relative: multipliers nearer to each other are one, twice
STEPS = 12  # of Newton's method
AWAY, TERMS = 8, 18  # of |s|: poles farther than this are taken by so many terms of a series
AROUND = 0.75  # mean harmonic below which a motion lies around 0
CHUNK = 256  # determinants at once
EPS = float(np.finfo(float).eps)
ON_AXIS = 1e-6  # revolutions⁻¹: the line to the right of poles that lie on the axis


def mass_scaled(M: NDArray, *matrices: NDArray) -> tuple[NDArray, ...]:
    """R of M = RᵀR, and each matrix in the coordinates Rq; (n, n) each.

    Raises BadInput if M is not positive definite.
    """
    try:
        R = scipy.linalg.cholesky(M)
    except np.linalg.LinAlgError as error:
        raise BadInput("the mass matrix is not positive definite; every DOF needs mass. "
                       "Give the shaft a density above 0.") from error

    def scaled(matrix: NDArray) -> NDArray:
        half = scipy.linalg.solve_triangular(R, matrix, trans="T")
        return scipy.linalg.solve_triangular(R, half.T, trans="T").T

    return R, *(scaled(matrix) for matrix in matrices)


class Same:
    """Arrays as a key: two are equal where they hold the very same arrays."""

    def __init__(self, *arrays: NDArray) -> None:
        self.arrays = arrays

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and all(a is b for a, b in zip(self.arrays, other.arrays,
                                                                      strict=True))

    def __hash__(self) -> int:
        return hash(tuple(id(a) for a in self.arrays))


@dataclass(frozen=True, eq=False)
class Compliance:
    """T(s) = S D(s)⁻¹ Sᵀ of the linear machine at one speed, from one eigendecomposition.

    poles: its eigenvalues, rad/s, (m,). residues: T(s) = Σ residues/(s − poles), (m, c, c).
    blur: how far each pole is known, rad/s, (m,). schur: (left, U, right), T = left (sU − I)⁻¹
    right with U triangular, where the eigenvectors are too nearly parallel for the sum.
    """

    poles: NDArray
    residues: NDArray
    blur: NDArray
    schur: tuple[NDArray, NDArray, NDArray] | None = None

    def __call__(self, s: NDArray, order: int = 0) -> NDArray:
        """T(s), or its derivative where order is 1, for complex s of any shape: (…, c, c)."""
        c = self.residues.shape[1]
        if self.schur is not None:
            left, U, right = self.schur
            answer = _back(U, s.ravel(), right[:, None])
            if order:
                answer = -_back(U, s.ravel(), np.tensordot(U, answer, axes=1))
            return np.einsum("cm,msd->scd", left, answer).reshape(*s.shape, c, c)
        far = np.abs(self.poles) > AWAY * np.abs(s).max(initial=0.0)
        poles, residues = self.poles, self.residues.reshape(len(self.poles), -1)
        share, flat = 1 / (s.reshape(-1, 1) - poles[~far]), s.reshape(-1, 1)
        out = (-share * share if order else share) @ residues[~far]
        if far.any():  # all of them together, by the series of 1/(s − p) in s/p
            k = np.arange(order, TERMS)
            inverse = np.broadcast_to(1 / poles[far], (TERMS, far.sum()))
            terms = np.cumprod(inverse, axis=0)[order:] @ residues[far]
            out -= (k * flat ** (k - 1) if order else flat ** k) @ terms
        return out.reshape(*s.shape, c, c)


def _back(U: NDArray, s: NDArray, right: NDArray) -> NDArray:
    """(sU − I)⁻¹ right for many s, by back-substitution; (m, S, c) from (m, S or 1, c)."""
    out = np.empty((len(U), len(s), right.shape[2]), dtype=complex)
    for i in range(len(U) - 1, -1, -1):
        known = s[:, None] * np.tensordot(U[i, i + 1:], out[i + 1:], axes=1)
        out[i] = (right[i] - known) / (s * U[i, i] - 1)[:, None]
    return out


@lru_cache(maxsize=32)
@threadpool_limits.wrap(limits=1)
def compliance(matrices: Same, speed: float) -> Compliance:
    """T of the machine with these M, C, G, K and S at a speed (rad/s), by the eigenvalues 1/λ of
    the inverse: so the slow motions, which matter, are the sharp ones however fine the mesh.

    Raises BadInput for a machine that can move freely or has DOFs without mass.
    """
    M, C, G, stiffness, S = matrices.arrays
    velocity = C + speed * G
    R, K, D = mass_scaled(M, stiffness, velocity)
    n = len(K)
    if not np.linalg.cond(stiffness, 1) < 1e15:
        raise BadInput("the machine can move freely, so it has no static deflection; give it "
                       "bearings.")
    flexible = np.linalg.inv(K)
    slow = 1 / math.sqrt(np.linalg.norm(flexible, 2))  # puts both halves on one scale
    inverse = np.block([[-flexible @ D, -slow * flexible], [np.eye(n) / slow, np.zeros((n, n))]])
    scaled = scipy.linalg.solve_triangular(R, S.T, trans="T")
    left = np.hstack([scaled.T / slow, 0 * scaled.T])
    right = np.vstack([0 * scaled, scaled])
    values, X = np.linalg.eig(inverse)
    poles = 1 / values
    with np.errstate(all="ignore"):
        back = scipy.linalg.pinv(X) if np.linalg.cond(X) > 1e15 else np.linalg.inv(X)
    residues = np.einsum("cj,jd->jcd", left @ X, back @ right)
    blur = EPS * np.linalg.norm(inverse, 2) * np.linalg.norm(back, axis=1) * np.abs(poles) ** 2
    step, known = _rayleigh(K, D, poles, X[:n], back[:, n:])
    found = Compliance(np.where(known < blur, poles + step, poles), residues,
                       np.minimum(blur, known))
    s = 1j * slow * np.array([0.0, 0.5, 1.5, 5.0, 20.0])
    exact = np.array([S @ np.linalg.solve(stiffness + t * velocity + t * t * M,
                                          S.T.astype(complex)) for t in s])
    if np.abs(found(s) - exact).max() < 1e-8 * np.abs(exact).max():
        return found
    U, Q = scipy.linalg.schur(inverse.astype(complex), output="complex")
    return Compliance(poles, residues, blur, (left @ Q @ U, U, Q.conj().T @ right))


def _rayleigh(K: NDArray, D: NDArray, s: NDArray, right: NDArray,
              left: NDArray) -> tuple[NDArray, NDArray]:
    """Newton's step of s in left (s² + sD + K) right = 0 for each eigenvalue, and its rounding; it
    sharpens the fast motions. right: (n, m). left: (m, n).
    """
    def forms(of: Callable[[NDArray], NDArray]) -> list[NDArray]:
        x, y = of(right), of(left)
        return [np.einsum("mi,im->m", y, of(matrix) @ x) for matrix in (np.eye(len(K)), D, K)]

    (m, d, k), (rough_m, rough_d, rough_k) = forms(np.asarray), forms(np.abs)
    slope, size = 2 * s * m + d, np.abs(s)
    return (-(s * (s * m + d) + k) / slope,
            EPS * (size * (size * rough_m + rough_d) + rough_k) / np.abs(slope))


@dataclass(frozen=True, eq=False)
class Disturbance:
    """The linearised forces around P orbits of one machine, as Hill's determinant takes them.

    step: ν, rad/s. order: N. slopes, dampings: Ĵ and B̂, (P, 2N + 1, c, (2N + 1) c), N/m and N s/m;
    dampings is None where no force depends on velocity. lost: where an orbit leaves the gap and so
    has no slopes; they are 0, (P,).
    """

    linear: Compliance
    step: float
    order: int
    slopes: NDArray
    dampings: NDArray | None
    lost: NDArray

    @property
    def harmonics(self) -> NDArray:
        """−N … N."""
        return np.arange(-self.order, self.order + 1)

    def matrices(self, which: NDArray, s: NDArray, order: int = 0) -> NDArray:
        """I − T̂Ĵ, or its derivative by λ, at λ = s (S,) for the orbits `which` (S,)."""
        once, again = np.unique(s, return_inverse=True)
        at = once[:, None] + 1j * self.step * self.harmonics
        K, c = self.slopes.shape[1:3]
        force = self._force(which, at[again])
        out = -(self.linear(at, order)[again] @ force).reshape(-1, K * c, K * c)
        if order and self.dampings is not None:
            out -= (self.linear(at)[again] @ self.dampings[which]).reshape(out.shape)
        if not order:
            out[:, np.arange(K * c), np.arange(K * c)] += 1
        return out

    def _force(self, which: NDArray, at: NDArray) -> NDArray:
        if self.dampings is None:
            return self.slopes[which]
        c = self.slopes.shape[2]
        return self.slopes[which] + self.dampings[which] * np.repeat(at, c, axis=1)[:, None, None]

    def mean(self) -> tuple[NDArray, NDArray | None]:
        """J₀ and B₀, (P, c, c), real."""
        own = slice(self.order * self.slopes.shape[2], (self.order + 1) * self.slopes.shape[2])
        slope = self.slopes[:, self.order, :, own].real
        return slope, None if self.dampings is None else self.dampings[:, self.order, :, own].real

    def reach(self) -> NDArray:
        """How far the forces may move each pole, to first order, rad/s, (m,)."""
        force = np.linalg.norm(self.slopes, axis=(2, 3)).max()
        if self.dampings is not None:
            force = force + (np.abs(self.linear.poles)
                             * np.linalg.norm(self.dampings, axis=(2, 3)).max())
        return np.linalg.norm(self.linear.residues, axis=(1, 2)) * force

    def log(self, which: NDArray, s: NDArray) -> NDArray:
        """log f at s, (S,) complex; its imaginary part up to multiples of 2π."""
        out = np.empty(len(s), dtype=complex)
        for i in range(0, len(s), CHUNK):
            sign, size = np.linalg.slogdet(self.matrices(which[i:i + CHUNK], s[i:i + CHUNK]))
            out[i:i + CHUNK] = size + 1j * np.angle(sign)
        return out

    @cached_property
    def swayed(self) -> NDArray:
        """How far the forces beside their mean may move each pole, to second order, rad/s, (m,)."""
        middle, (K, c) = self.order, self.slopes.shape[1:3]
        at = self.linear.poles[:, None] + 1j * self.step * self.harmonics
        swing = [0.0 if hat is None else np.linalg.norm(
            hat[:, middle].reshape(-1, c, K, c), axis=(1, 3)).max(axis=0)
            for hat in (self.slopes, self.dampings)]
        force = swing[0] + np.abs(at) * swing[1]
        force[:, middle] = 0
        live = (force > 1e-6 * force.max(axis=1, keepdims=True)).any(axis=0)
        at, force = at[:, live], force[:, live]
        answer = np.linalg.norm(self.linear(at + 1e-9j * self.step), axis=(2, 3))
        return np.linalg.norm(self.linear.residues, axis=(1, 2)) * (answer * force**2).sum(axis=1)

    def felt(self, line: float = 0.0) -> tuple[NDArray, NDArray]:
        """Which poles the forces may move across Re λ = line, and which by more than their mean
        does, (m,) each.
        """
        away = MOVED * np.maximum(np.abs(self.linear.poles.real - line), 1e-9 * self.step)
        swayed = self.swayed > away
        return (self.reach() > away) | swayed, swayed

    def alone(self, which: NDArray, s: NDArray) -> NDArray:
        """log det(I − T(s)(J₀ + s B₀)): a harmonic s where the forces keep their mean."""
        slope, damping = self.mean()
        force = slope[which]
        if damping is not None:
            force = force + s[:, None, None] * damping[which]
        sign, size = np.linalg.slogdet(np.eye(force.shape[-1]) - self.linear(s) @ force)
        return size + 1j * np.angle(sign)

    def added(self, which: NDArray, s: NDArray) -> NDArray:
        """log of what a harmonic of frequency s multiplies f by, with the 2N below it."""
        out, c = np.empty(len(s), dtype=complex), self.slopes.shape[2]
        for i in range(0, len(s), CHUNK):
            part = slice(i, i + CHUNK)
            matrices = self.matrices(which[part], s[part] - 1j * self.order * self.step)
            last = np.linalg.solve(matrices, np.eye(matrices.shape[1], c, -matrices.shape[1] + c))
            sign, size = np.linalg.slogdet(last[:, -c:])
            out[part] = -size - 1j * np.angle(sign)
        return out


def derivatives(eq: Condensed, local: NDArray, centres: NDArray,
                samples: int) -> tuple[NDArray, NDArray | None]:
    """∂F/∂u and ∂F/∂u̇ around orbits of the equations `eq`, (c, c, P, samples).

    local: (P, c, 2m + 1), m. centres: (P, 2), m.
    """
    phase = 2 * np.pi * np.arange(samples) / samples
    rows = fourier_rows(local.shape[2] // 2, phase)
    path = eq.model.relative((local @ rows).transpose(1, 0, 2), centres.T[:, :, None])
    rate = (eq.speed / eq.revolutions * rates(local) @ rows).transpose(1, 0, 2)
    return eq.model.law.linearise(path, rate, eq.revolutions * phase, eq.speed)[1:]


def pull_alone(model: Model) -> bool:
    """Whether a pull that depends on (x, z) only is the one force that is not linear."""
    return len(model.selection) == 2 and not model.law.moving


def background(eq: Condensed, local: NDArray, centres: NDArray) -> tuple[Compliance, list]:
    """The linear machine from which the forces around these orbits are counted, and their part in
    it, ∂F/∂u and ∂F/∂u̇, (c, c) each.

    The pull alone is counted from the machine without it, so that all fields share one
    decomposition. Bearings, films and cracks are counted from the mean slope of the first orbit,
    because they may be stiffer than all else.
    """
    model = eq.model
    if pull_alone(model):
        part = [0.0, 0.0]
    else:
        part = [0.0 if d is None else d.mean(axis=-1)[..., 0]
                for d in derivatives(eq, local[:1], centres[:1], 64)]
        model = with_slopes(model, *part)
    own = Same(model.M, model.C, model.G, model.K, model.selection)
    return compliance(own, eq.speed), part


def mean_slopes(orbit: PeriodicOrbit) -> list:
    """∂F/∂u and ∂F/∂u̇, mean along an orbit, (c, c) each; 0 where there is none."""
    found = derivatives(orbit.equations, orbit.local[None], orbit.centre[None], 256)
    return [0.0 if d is None else d.mean(axis=-1)[..., 0] for d in found]


def with_slopes(model: Model, slope: NDArray | float, damping: NDArray | float = 0.0) -> Model:
    """The model with a slope and a damping of its forces, (c, c), taken into K and C."""
    S = model.selection
    K, C = (A - S.T @ (part + np.zeros((len(S), len(S)))) @ S
            for A, part in ((model.K, slope), (model.C, damping)))
    return replace(model, K=K, C=C)


def disturbance(eq: Condensed, local: NDArray, centres: NDArray, order: int,
                linear: Compliance, part: list) -> Disturbance:
    """Around orbits of the equations `eq`, on their `background`; local: (P, c, 2m + 1), m.
    centres: (P, 2), m.
    """
    samples = max(64, 8 * order, 8 * eq.harmonics)
    slope, damping = derivatives(eq, local, centres, samples)
    lost = ~np.isfinite(slope).all(axis=(0, 1, 3))

    def hat(derivative: NDArray, already: NDArray | float) -> NDArray:
        derivative = np.where(lost[:, None], 0, derivative)
        waves = np.fft.fft(derivative, axis=-1) / samples
        waves[..., 0] -= np.reshape(already, np.shape(already) + (1,) * (np.ndim(already) // 2))
        k = np.arange(-order, order + 1)
        toeplitz = waves[..., k[:, None] - k].transpose(2, 3, 0, 4, 1)
        return toeplitz.reshape(len(local), len(k), len(waves), -1)

    return Disturbance(linear, eq.speed / eq.revolutions, order, hat(slope, part[0]),
                       None if damping is None else hat(damping, part[1]), lost)


def mesh(samples: NDArray, seeds: NDArray, line: float) -> NDArray:
    """Samples along Re s = line, with more of them where zeros or poles (seeds) lie near: no
    interval is longer than its distance from any of them.
    """
    away = np.abs(seeds.real - line)
    while True:
        middle, length = (samples[1:] + samples[:-1]) / 2, np.diff(samples)
        apart = np.maximum(np.abs(middle[:, None] - seeds.imag) - length[:, None] / 2, away)
        long = length > np.maximum(apart, 1e-9 * samples[-1]).min(axis=1, initial=np.inf)
        if not long.any():
            return samples
        samples = np.insert(samples, np.flatnonzero(long) + 1, middle[long])


def change(log: Callable[[NDArray, NDArray], NDArray],
           samples: Sequence[NDArray]) -> tuple[NDArray, NDArray]:
    """Change of arg f from the first sample to the last for each of P functions, and whether it is
    resolved; (P,), (P,).

    log: (which, w) → log f. samples: of each function, ascending. Intervals are halved where log f
    turns or grows too much in one, or a neighbour is less than half as long: two zeros that turn it
    by 2π show in their neighbours.
    """
    points = len(samples)
    which = np.repeat(np.arange(points), [len(own) for own in samples])
    w = np.concatenate(samples)
    value = log(which, w)
    for round_ in range(HALVINGS):
        same = which[1:] == which[:-1]
        step = np.diff(value)
        step = step.real + 1j * ((step.imag + np.pi) % (2 * np.pi) - np.pi)
        length = np.where(same, np.diff(w), np.inf)
        coarse = ~(np.abs(step) < TURN)
        longer = np.zeros(len(length), dtype=bool)
        longer[1:] |= length[1:] > 2.5 * length[:-1]
        longer[:-1] |= length[:-1] > 2.5 * length[1:]
        lost = ~np.isfinite(np.bincount(which, value.real, points))
        halve = np.flatnonzero(same & (coarse | longer) & ~lost[which[:-1]])
        if not len(halve) or round_ == HALVINGS - 1:
            break
        new = (w[halve] + w[halve + 1]) / 2
        value = np.insert(value, halve + 1, log(which[halve], new))
        which, w = np.insert(which, halve + 1, which[halve]), np.insert(w, halve + 1, new)
    total = np.bincount(which[:-1][same], step.imag[same], points)
    bad = same & ~(np.abs(step) < TURN)
    return total, np.bincount(which[:-1][bad], minlength=points) == 0


def logs(d: Disturbance, exponents: NDArray, s: NDArray) -> NDArray:
    """Σ log(1 − e^{(λ − s)t}) over the exponents λ of each row, (S, m), nan left out, with t the
    period: what zeros there alone would make of log f at s, (S,).
    """
    away = (exponents - s[:, None]) * (2 * np.pi / d.step)
    grown = np.exp(np.minimum(away.real, 600) + 1j * away.imag)
    return np.nansum(np.log(1 - grown), axis=1)


def count(d: Disturbance, believed: NDArray) -> tuple[NDArray, NDArray, float]:
    """Exponents to the right of the line Re λ = σ for each orbit, whether that is resolved, and σ.

    believed: exponents from elsewhere, (P, m), closed under conjugation, nan where there are none.
    f is divided by them and multiplied by as many poles, so that what is left to be wound is what
    they miss; right or wrong, they do not change the count. σ is 0, or a little more where poles
    lie on the axis itself.
    """
    points, poles, nu, half = len(d.slopes), d.linear.poles, d.step, (d.order + 0.5) * d.step
    on_axis = np.abs(poles.real) < 10 * d.linear.blur
    sigma = max(ON_AXIS * nu, 20 * d.linear.blur[on_axis].max()) if on_axis.any() else 0.0
    away = np.maximum(np.abs(poles.real - sigma), 1e-9 * nu)
    taken = (np.abs(poles.imag) < half) & (away < nu)
    useless = (np.abs(believed.real - sigma) < 1e-9 * nu) | (np.abs(believed.imag) > half)
    believed = np.where(useless, np.nan, believed)
    felt, swayed = d.felt(sigma)
    lone = d.added if (swayed & (np.abs(poles.imag) > half)).any() else d.alone

    def fold(s: NDArray) -> NDArray:
        """Copies in the half period from 0 to ν/2."""
        return s.real + 1j * np.abs((s.imag + nu / 2) % nu - nu / 2)

    def smooth(which: NDArray, w: NDArray) -> NDArray:
        s = sigma + 1j * w
        poles_there = np.broadcast_to(poles[taken], (len(s), taken.sum()))
        return d.log(which, s) + logs(d, poles_there, s) - logs(d, believed[which], s)

    def beyond(which: NDArray, w: NDArray) -> NDArray:
        return lone(which, sigma + 1j * w)

    seeds = fold(poles[felt & ~taken & (np.abs(poles.imag) < half + nu)])
    base = mesh(np.linspace(0.0, nu / 2, INTERVALS + 1), seeds, sigma)
    close = np.abs(believed.real - sigma) < nu / 2 / INTERVALS
    turned, sure = change(smooth, [mesh(base, fold(own[near]), sigma) if near.any() else base
                                   for own, near in zip(believed, close, strict=True)])
    far = poles[felt & (poles.imag > half - nu)]
    all_, end = np.arange(points), 4 * max(half, far.imag.max(initial=0.0))
    while (np.abs(beyond(all_, np.full(points, end))) > 0.3).any() and end < FAR * half:
        end *= 4
    rest = half * (end / half) ** np.linspace(0, 1, 1 + math.ceil(4 * math.log2(end / half)))
    more, also = change(beyond, [mesh(rest, far, sigma)] * points)
    left = beyond(all_, np.full(points, end)).imag
    number = (np.sum(believed.real > sigma, axis=1) + np.sum(poles.real[~taken] > sigma)
              - (turned + more - left) / np.pi)
    whole = np.rint(number)
    sure &= ~d.lost & also & (np.abs(number - whole) < 0.25) & (np.abs(left) < 0.5)
    return np.where(sure, whole, 0).astype(int), sure, sigma


def newton_step(d: Disturbance, exponents: NDArray, going: NDArray,
                times: NDArray | float = 1.0) -> tuple[NDArray, NDArray]:
    """The step from each exponent to a zero of f that no other column is at (Aberth 1973), and the
    mean harmonic of its motion; both for those `going`, in their order.

    exponents: λ, 1/s, (P, m), nan where there is none. going: (P, m).
    times: how often each zero is one. f is Π (1 − µ/z)/Π (1 − p/z)
    with z = e^{λt} over a period and p of the linear machine, so its poles can be multiplied away.
    """
    period, poles = 2 * np.pi / d.step, d.linear.poles
    (which, column), m = np.nonzero(going), going.shape[1]
    s = exponents[going]

    def drawn(zeros: NDArray) -> NDArray:
        """d log(1 − e^{(zero − s)t})/ds; zeros far to the left, and those of motions of which no
        harmonic is among the 2N + 1, have none.
        """
        away = period * (s[:, None] - zeros)
        near = np.abs(away.imag) <= (2 * d.order + 1) * np.pi
        with np.errstate(divide="ignore", invalid="ignore"):
            pull = period / np.expm1(np.minimum(away.real, 50) + 1j * away.imag)
        return np.where(near, pull, 0)

    # those whose copies are all far away, or long gone, have no part in it
    poles = poles[(np.abs(poles.imag) < np.abs(s.imag).max(initial=0) + (d.order + 1) * d.step)
                  & (period * (s.real.min(initial=np.inf) - poles.real) < 50)]
    # a mode that the forces do not touch has its zero on its pole, where f has no value
    on_pole = (np.abs(drawn(poles)) > 1e9 / d.step).any(axis=1)
    aside = np.where(on_pole, 1e-7 * d.step, 0)
    s = s + aside
    tangent, mean = np.empty(len(s), dtype=complex), np.empty(len(s))
    for i in range(0, len(s), CHUNK):
        part = which[i:i + CHUNK], s[i:i + CHUNK]
        inverse = np.linalg.inv(d.matrices(*part))
        tangent[i:i + CHUNK] = np.einsum("sij,sji->s", inverse, d.matrices(*part, order=1))
        weight = (np.abs(inverse) ** 2).sum(axis=2).reshape(len(inverse), len(d.harmonics), -1)
        share = weight / weight.sum(axis=1, keepdims=True)
        mean[i:i + CHUNK] = d.harmonics @ share[:, :, 0].T
    with np.errstate(divide="ignore", invalid="ignore"):
        mirrored = np.where(real(exponents, d.step), np.nan, exponents.conj())
        others = drawn(np.hstack([exponents, mirrored])[which])
        # but itself, and its own conjugate, which it may be
        others[np.arange(len(s)), column] = others[np.arange(len(s)), column - m] = 0
        pulled = drawn(poles).sum(axis=1) - np.nansum(others, axis=1)
        return aside - times / (tangent + pulled), mean


def real(exponents: NDArray, step: float) -> NDArray:
    """Whether the multipliers are real, to rounding; false for nan."""
    return np.abs(np.sin(2 * np.pi / step * exponents.imag)) < 1e-6


def twins(exponents: NDArray, step: float) -> NDArray:
    """Of each column the first that has the same multiplier to rounding, itself if there is none.

    exponents: λ, 1/s, (P, m). step: ν, rad/s. Such a multiplier is sought once, with its
    multiplicity: an isotropic machine has each of its twice.
    """
    values = np.exp(2 * np.pi / step * exponents)
    same = np.abs(values[:, :, None] - values[:, None]) <= TWIN * np.abs(values)[:, :, None]
    return (same | np.eye(exponents.shape[1], dtype=bool)).argmax(axis=2)


def roots(d: Disturbance, starts: NDArray) -> NDArray:
    """Floquet exponents near `starts`, (P, m), by Newton's method on f; nan where it does not
    settle. Where one of a pair ends on the real axis there is another column, for its twin.

    Of the copies λ + ikν that one is taken whose harmonics lie around 0, so that N carry most.
    """
    found = _settled(d, starts, np.isfinite(starts))
    twin = real(found, d.step) & ~real(starts, d.step)
    if not twin.any():
        return found
    both = np.hstack([found, np.where(twin, starts.conj(), np.nan)])
    return _settled(d, both, np.hstack([np.zeros_like(twin), twin]))


def _settled(d: Disturbance, starts: NDArray, going: NDArray) -> NDArray:
    """`starts` with those `going` moved to zeros of f, nan where they find none."""
    first = twins(starts, d.step)
    alone = first == np.arange(starts.shape[1])
    times = (first[:, :, None] == np.arange(starts.shape[1])).sum(axis=1)
    found, going = np.where(alone, starts, np.nan), going & alone
    for _ in range(STEPS):
        if not going.any():
            break
        step, mean = newton_step(d, found, going, times[going])
        step *= np.minimum(1, 0.3 * d.step / np.abs(step))
        # a multiplier below 0 has two copies with harmonics around 0: it stays on its own
        shift = np.where(np.abs(mean) < AROUND, 0, np.rint(mean))
        found[going] += step + 1j * d.step * shift
        going[going] = (np.abs(step) > 1e-5 * d.step) | (shift != 0)
    found[going] = np.nan
    return np.take_along_axis(found, first, axis=1)
