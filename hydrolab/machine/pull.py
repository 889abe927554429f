r"""Magnetic pull as a force law in local coordinates.

A law acts on the rotor centre's position relative to the stator centre, e = (x − x_E, z − z_E),
given coordinates first: e has shape (2, …) and the force the same shape; the derivative ∂F_i/∂e_j
has shape (2, 2, …). Forces act ON the rotor, positive along +x and +z, so the pull points along e,
towards the small gap. Gap angle φ runs from z towards x.

Source: Villa, Carvalho and Salomon, Eqs. (2) to (8), after Lundström and Aidanpää (2007).

Several force laws in one model, each on its own coordinates, and laws of velocity and phase beside
plain ones.

A pull across the eccentricity, which damper circuits and cages add to the pull along it.

F = k_t J e, with J the quarter turn from z to x: k_t > 0 pushes a rotor that whirls with the spin
on its way. It stands beside the law of the pull on the same coordinates (`SeveralLaws`), so that F
= k_r e + k_t J e for a linear pull k_r. A Jeffcott rotor with damping c is stable as long as c ω >
|k_t|, with ω = √((k − k_r)/m): k_t > 0 drives its forward whirl, k_t < 0 its backward whirl.
Karlsson et al. (2007) find such a pull where a generator has a damper winding. Here k_t is
constant, while a circuit's depends on the whirl frequency.

The pull of a rotor that tilts in its stator: each height of the rim has its own eccentricity.

A rim of height h whose centre lies at e and whose axis leans by the slopes t = (∂x/∂y, ∂z/∂y) has,
at the height s below its centre, the eccentricity e + s t. Its pull and the moment that goes with
the slopes are

F = (1/h) ∫ f(e + s t) ds, N = (1/h) ∫ s f(e + s t) ds, s from −h/2 to h/2,

with f the pull of the whole rim if it did not lean. For small motion N = k (h²/12) t: the tilt
pull, which Gustavsson and Aidanpää (2006) give a rim with its hub off the middle, and which a model
without tilt leaves out.

The pull of any magnetomotive force in the true gap, by quadrature: waves of the rotor and the
stator added up.

f(φ, t) = Σ share cos(order · φ − ratio · Ωt − angle), and F = (k g0³/2π) ∮ 2 f² (sin φ, cos φ)/g²
dφ with the gap g = g0 − e_x sin φ − e_z cos φ, no series. A lone wave of share 1 is the field whose
rms is B0, so its mean pull is that of `CircularPull`. Pennacchi and Frosini (2005) take the rotor's
and the stator's wave with the load angle between them; their parameters could not be read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray


class ForceLaw(Protocol):
    """What a solver asks of a force law.

    moving: whether the force also depends on the velocity or on the phase Ωt of the rotation. Such
    a law has `force_at(e, velocity, phase, speed)` and `linearise_at(e, velocity, phase, speed)`,
    which also returns ∂F_i/∂ė_j, N s/m, in place of the first two; phase, rad, is broadcast against
    the axes of e after its first, speed is Ω, rad/s.
    """

    moving: bool

    def force(self, e: NDArray) -> NDArray:
        """Force on the rotor, N; shape of e."""

    def linearise(self, e: NDArray) -> tuple[NDArray, NDArray]:
        """Force, N, and its derivative, N/m, with one more axis in front."""

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap around the circumference, m; e: all of the law's coordinates, or (x, z)
        alone.
        """

    def gap_angle(self, e: NDArray) -> NDArray:
        """Gap angle of the smallest gap, rad, from z towards x."""

    def scaled(self, factor: float) -> Self:
        """The same law, `factor` times as strong."""


@dataclass(frozen=True)
class CircularPull:
    r"""Pull of a circular rotor in a circular stator, in closed form.

    F = k e / (1 − ε²)^{3/2} with ε = |e|/g0: the integral of Eqs. (7) and (8) with the gap of
    Eq. (6), g = g0 (1 − ε cos(φ − γ)).

    stiffness: k = π B0² u0 l0 / (µ0 g0), N/m. gap: g0, m.
    """

    stiffness: float
    gap: float
    moving = False

    def force(self, e: NDArray) -> NDArray:
        """Force on the rotor, N; shape of e. Meaningless (nan) where |e| ≥ g0."""
        ex, ez = e
        with np.errstate(invalid="ignore", divide="ignore"):
            return self.stiffness * (1 - (ex * ex + ez * ez) / self.gap**2) ** -1.5 * e

    def linearise(self, e: NDArray) -> tuple[NDArray, NDArray]:
        r"""Force, N, and its derivative, N/m.

        ∂F/∂e = k [(1 − ε²)^{−3/2} I + 3 (1 − ε²)^{−5/2} e eᵀ/g0²].
        """
        ex, ez = e
        with np.errstate(invalid="ignore", divide="ignore"):
            s = 1 / (1 - (ex * ex + ez * ez) / self.gap**2)
            radial = self.stiffness * s * np.sqrt(s)
        force = radial * e
        jacobian = (3 / self.gap**2 * s * force)[:, None] * e
        jacobian[0, 0] += radial
        jacobian[1, 1] += radial
        return force, jacobian

    def potential(self, e: NDArray) -> NDArray:
        """V = −k g0² (1 − ε²)^{−1/2}, J, with F = −∂V/∂e; shape of e without its first axis, nan
        outside the gap.
        """
        ex, ez = e
        with np.errstate(invalid="ignore", divide="ignore"):
            return -self.stiffness * self.gap**2 / np.sqrt(1 - (ex * ex + ez * ez) / self.gap**2)

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap around the circumference, m; zero or less is contact."""
        return self.gap - np.hypot(*e)

    def gap_angle(self, e: NDArray) -> NDArray:
        """Angle at which the gap is smallest, rad, from z towards x."""
        return np.arctan2(e[0], e[1])

    def scaled(self, factor: float) -> CircularPull:
        """The same law, `factor` times as strong (the pull grows with the square of the field)."""
        return replace(self, stiffness=factor * self.stiffness)


@dataclass(frozen=True)
class LinearPull(CircularPull):
    """The pull as design tools take it: F = k e, a negative stiffness, at any eccentricity."""

    def force(self, e: NDArray) -> NDArray:
        """Force on the rotor, N; shape of e."""
        return self.stiffness * e

    def linearise(self, e: NDArray) -> tuple[NDArray, NDArray]:
        """Force, N, and its derivative k I, N/m."""
        identity = np.eye(2).reshape(2, 2, *(1,) * (e.ndim - 1))
        return self.stiffness * e, self.stiffness * np.broadcast_to(identity, (2, *e.shape))

    def potential(self, e: NDArray) -> NDArray:
        """V = −k |e|²/2, J."""
        return -0.5 * self.stiffness * (e * e).sum(axis=0)


@dataclass(frozen=True, eq=False)
class ShapedPull:
    r"""Pull in a gap of any shape, by quadrature of Eqs. (7) and (8).

    F = (k g0³ / 2π) ∮ (sin φ, cos φ) / g² dφ with g(φ) = shape(φ) − e_x sin φ − e_z cos φ.
    The integrand is periodic, so the trapezoidal rule converges exponentially.

    stiffness, gap: k (N/m) and g0 (m) of the nominal circular gap. shape: gap at the N equally
    spaced angles φ_n = 2πn/N when the rotor is centred, m; shape (N,).
    """

    stiffness: float
    gap: float
    shape: NDArray
    moving = False

    def _local_gap(self, e: NDArray) -> tuple[NDArray, NDArray]:
        """Directions (2, N) and the gap along them, m, (…, N); below zero the rotor is in the
        stator.
        """
        angle = 2 * np.pi * np.arange(len(self.shape)) / len(self.shape)
        direction = np.stack([np.sin(angle), np.cos(angle)])
        return direction, self.shape - np.tensordot(e, direction, axes=(0, 0))

    def _quadrature(self, e: NDArray) -> tuple[NDArray, NDArray, float]:
        """Directions, gap (nan where the rotor is in the stator) and the weight k g0³/N of each
        angle.
        """
        direction, gap = self._local_gap(e)
        return direction, np.where(gap > 0, gap,
                                   np.nan), self.stiffness * self.gap**3 / len(self.shape)

    def force(self, e: NDArray) -> NDArray:
        """Force on the rotor, N; shape of e. Meaningless (nan) where the rotor is in the stator."""
        direction, gap, weight = self._quadrature(e)
        return weight * np.einsum("in,...n->i...", direction, gap**-2.0)

    def linearise(self, e: NDArray) -> tuple[NDArray, NDArray]:
        """Force, N, and its derivative, N/m: one more power of the gap under the integral."""
        direction, gap, weight = self._quadrature(e)
        derivative = 2 * weight * np.einsum("in,jn,...n->ij...", direction, direction, gap**-3.0)
        return weight * np.einsum("in,...n->i...", direction, gap**-2.0), derivative

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap over the N angles, m."""
        return self._local_gap(e)[1].min(axis=-1)

    def gap_angle(self, e: NDArray) -> NDArray:
        """Angle at which the gap is smallest, rad, from z towards x."""
        return 2 * np.pi * self._local_gap(e)[1].argmin(axis=-1) / len(self.shape)

    def scaled(self, factor: float) -> ShapedPull:
        """The same law, `factor` times as strong."""
        return replace(self, stiffness=factor * self.stiffness)


def closed_form():
    r"""The integral behind `CircularPull`, done by SymPy: (∫ cos φ/(1 − ε cos φ)² dφ, 2πε/(1 −
    ε²)^{3/2}).

    SymPy's own `integrate` does not finish on the circle. Both sides are therefore compared as what
    they are, analytic functions of ε on (0, 1): the residue at the pole inside the unit circle.
    Returns the pair (residue result, closed form) as SymPy expressions in ε; their difference
    simplifies to 0.
    """
    import sympy as sp

    eps = sp.symbols("epsilon", positive=True)
    w = sp.sqrt(1 - eps**2)
    z = sp.symbols("z")
    inside, outside = (1 - w) / eps, (1 + w) / eps
    # cos φ = (z + 1/z)/2 and dφ = dz/(iz) turn the integrand into a rational function of z = e^{iφ}
    # with a double pole at `inside`; its residue is the derivative of what is left after (z −
    # inside)².
    rest = 2 * (z**2 + 1) / (eps**2 * (z - outside) ** 2)
    residue = sp.diff(rest, z).subs(z, inside)
    return sp.simplify(2 * sp.pi * residue), 2 * sp.pi * eps / (1 - eps**2) ** sp.Rational(3, 2)


def force_at(law: ForceLaw, e: NDArray, velocity: NDArray, phase: NDArray | float,
             speed: float) -> NDArray:
    """Force of any law, N, shape of e: one that does not move is not asked about velocity and
    phase.
    """
    return law.force_at(e, velocity, phase, speed) if law.moving else law.force(e)


def linearise_at(law: ForceLaw, e: NDArray, velocity: NDArray, phase: NDArray | float,
                 speed: float) -> tuple[NDArray, NDArray, NDArray]:
    """Force of any law, N, with ∂F_i/∂e_j, N/m, and ∂F_i/∂ė_j, N s/m, (c, c, …)."""
    if law.moving:
        return law.linearise_at(e, velocity, phase, speed)
    force, slope = law.linearise(e)
    return force, slope, np.zeros_like(slope)


@dataclass(frozen=True)
class Placed:
    """A law on some of a model's nonlinear coordinates. magnetic: whether its force grows with the
    square of the field.
    """

    law: ForceLaw
    rows: slice
    magnetic: bool = False


@dataclass(frozen=True)
class SeveralLaws:
    """Laws side by side. The first is the pull in the air gap; its coordinates begin with (x, z) of
    the generator.
    """

    parts: tuple[Placed, ...]

    @property
    def moving(self) -> bool:
        """Whether one of them depends on velocity or phase."""
        return any(part.law.moving for part in self.parts)

    def force(self, e: NDArray) -> NDArray:
        """Forces on all coordinates, N, shape of e, where no law moves."""
        out = np.zeros_like(e)
        for part in self.parts:
            out[part.rows] += part.law.force(e[part.rows])
        return out

    def linearise(self, e: NDArray) -> tuple[NDArray, NDArray]:
        """Forces, N, and their derivative, N/m, (c, c, …), where no law moves."""
        out, slope = np.zeros_like(e), np.zeros((len(e), *e.shape))
        for part in self.parts:
            force, own = part.law.linearise(e[part.rows])
            out[part.rows] += force
            slope[part.rows, part.rows] += own
        return out, slope

    def force_at(self, e: NDArray, velocity: NDArray, phase: NDArray | float,
                 speed: float) -> NDArray:
        """Forces on all coordinates, N, shape of e."""
        out = np.zeros_like(e)
        for part in self.parts:
            out[part.rows] += force_at(part.law, e[part.rows], velocity[part.rows], phase, speed)
        return out

    def linearise_at(self, e: NDArray, velocity: NDArray, phase: NDArray | float,
                     speed: float) -> tuple[NDArray, NDArray, NDArray]:
        """Forces, N, with their derivatives by position, N/m, and by velocity, N s/m, (c, c, …)."""
        out, slope, damping = np.zeros_like(e), np.zeros((len(e), *e.shape)), np.zeros((len(e),
                                                                                        *e.shape))
        for part in self.parts:
            force, *own = linearise_at(part.law, e[part.rows], velocity[part.rows], phase, speed)
            out[part.rows] += force
            slope[part.rows, part.rows] += own[0]
            damping[part.rows, part.rows] += own[1]
        return out, slope, damping

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap, m, by the first law; e: all coordinates, or (x, z) of the rotor centre
        alone.
        """
        return self.parts[0].law.smallest_gap(e[self.parts[0].rows])

    def gap_angle(self, e: NDArray) -> NDArray:
        """Gap angle of the smallest gap, rad, by the first law."""
        return self.parts[0].law.gap_angle(e[self.parts[0].rows])

    def scaled(self, factor: float) -> SeveralLaws:
        """The same laws, the magnetic ones `factor` times as strong."""
        return replace(self, parts=tuple(replace(p, law=p.law.scaled(factor)) if p.magnetic else p
                                         for p in self.parts))


@dataclass(frozen=True)
class TangentialPull:
    """F = k_t J e on the eccentricity (x, z). stiffness: k_t, N/m. gap: g0, m."""

    moving: ClassVar[bool] = False
    stiffness: float
    gap: float

    def force(self, e: NDArray) -> NDArray:
        """Force on the rotor, N; shape of e."""
        return self.stiffness * np.stack([e[1], -e[0]])

    def linearise(self, e: NDArray) -> tuple[NDArray, NDArray]:
        """Force, N, and its derivative k_t J, N/m."""
        turn = np.array([[0.0, 1.0], [-1.0, 0.0]]).reshape(2, 2, *(1,) * (e.ndim - 1))
        return self.force(e), self.stiffness * np.broadcast_to(turn, (2, *e.shape))

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap around the circumference, m."""
        return self.gap - np.hypot(e[0], e[1])

    def gap_angle(self, e: NDArray) -> NDArray:
        """Angle at which the gap is smallest, rad, from z towards x."""
        return np.arctan2(e[0], e[1])

    def scaled(self, factor: float) -> TangentialPull:
        """The same law, `factor` times as strong."""
        return replace(self, stiffness=factor * self.stiffness)


def tangential_limit(mass: float, damping: float, stiffness: float, pull: float) -> float:
    """Largest |k_t|, N/m, of a stable Jeffcott rotor: c √((k − k_r)/m).

    mass: kg. damping: c, N s/m. stiffness: k of the spring, N/m. pull: k_r, N/m, less than k, or
    nan comes back.
    """
    return damping * math.sqrt((stiffness - pull) / mass) if pull < stiffness else math.nan


# Gauss points over the height: the pull is smooth in s, so the error falls exponentially with them
POINTS = 12


@dataclass(frozen=True)
class TiltedPull:
    """The pull on four coordinates: eccentricity (x, z) of the rim's middle, m, and slopes (∂x/∂y,
    ∂z/∂y), rad.

    upright: the pull without tilt, a positional law on (x, z). height: h, m. The force has the same
    four rows: N, N m.
    """

    moving: ClassVar[bool] = False
    upright: ForceLaw
    height: float

    def _slices(self, u: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Heights s (m) with weights that sum to 1, and the eccentricity there, (2, …, points)."""
        s, weight = np.polynomial.legendre.leggauss(POINTS)
        s = self.height / 2 * s
        return s, weight / 2, u[:2, ..., None] + u[2:, ..., None] * s

    def force(self, u: NDArray) -> NDArray:
        """Force, N, and the moment that works on the slopes, N m; shape of u. nan where an end is
        in the stator.
        """
        s, weight, e = self._slices(u)
        pull = self.upright.force(e)
        return np.concatenate([pull @ weight, pull @ (s * weight)])

    def linearise(self, u: NDArray) -> tuple[NDArray, NDArray]:
        """Force and its derivative, (4, 4, …)."""
        s, weight, e = self._slices(u)
        pull, slope = self.upright.linearise(e)
        direct, mixed, tilt = slope @ weight, slope @ (s * weight), slope @ (s * s * weight)
        return (np.concatenate([pull @ weight, pull @ (s * weight)]),
                np.concatenate([np.concatenate([direct, mixed], axis=1),
                                np.concatenate([mixed, tilt], axis=1)]))

    def potential(self, u: NDArray) -> NDArray:
        """V, J, with force = −∂V/∂u, where the upright pull has one; shape of u without its first
        axis.
        """
        _, weight, e = self._slices(u)
        return self.upright.potential(e) @ weight

    def _ends(self, u: NDArray) -> NDArray:
        """Eccentricity of the top and the bottom of the rim, (2, …, 2); no other height comes
        nearer to the stator.

        Where u is (x, z) alone the rotor is taken as upright.
        """
        lean = u[2:, ..., None] if len(u) > 2 else 0 * u[..., None]
        return u[:2, ..., None] + lean * (self.height / 2 * np.array([-1.0, 1.0]))

    def smallest_gap(self, u: NDArray) -> NDArray:
        """Smallest air gap around the circumference and over the height, m."""
        return self.upright.smallest_gap(self._ends(u)).min(axis=-1)

    def gap_angle(self, u: NDArray) -> NDArray:
        """Angle at which the gap is smallest, rad, from z towards x."""
        ends = self._ends(u)
        nearest = self.upright.smallest_gap(ends).argmin(axis=-1)[..., None]
        return np.take_along_axis(self.upright.gap_angle(ends), nearest, axis=-1)[..., 0]

    def scaled(self, factor: float) -> TiltedPull:
        """The same law, `factor` times as strong."""
        return replace(self, upright=self.upright.scaled(factor))


LEAST = 128  # points around the gap: at 90 % of the gap ρ¹²⁸ is 1e-26


@dataclass(frozen=True)
class Wave:
    """One wave of magnetomotive force: share · cos(order · φ − ratio · Ωt − angle).

    order: number of its pole pairs around the gap. share: of the reference wave, whose field is B0
    (rms). ratio: electrical over mechanical angle; a wave fixed to the rotor has ratio = order, one
    that stands still 0, and one that turns backward a negative ratio. angle: rad.
    """

    order: int
    share: float = 1.0
    ratio: float = 1.0
    angle: float = 0.0


def loaded(pole_pairs: int, stator_share: float, load_angle: float, ratio: float,
           start: float = 0.0) -> tuple[Wave, Wave]:
    """The rotor's wave and the stator's, which is `load_angle` (electrical, rad) behind it."""
    return (Wave(pole_pairs, 1.0, ratio, start),
            Wave(pole_pairs, stator_share, ratio, start - load_angle))


@dataclass(frozen=True)
class FieldWave:
    """The pull of a sum of waves in a circular gap, by the trapezoidal rule, which converges
    exponentially.

    stiffness: k = π B0² u0 l0/(µ0 g0), N/m, of the reference wave. gap: g0, m. waves: `Wave`, at
    least one.
    """

    moving: ClassVar[bool] = True
    stiffness: float
    gap: float
    waves: tuple[Wave, ...]

    @property
    def points(self) -> int:
        """Points of the quadrature: more for waves of a high order."""
        return LEAST + 4 * max(wave.order for wave in self.waves)

    def field(self, angle: NDArray, phase: NDArray | float) -> NDArray:
        """f at gap angles (N,) and phases (…): (…, N)."""
        phase = np.asarray(phase)[..., None]
        return sum(w.share * np.cos(w.order * angle - w.ratio * phase - w.angle)
                   for w in self.waves)

    def force_at(self, e: NDArray, velocity: NDArray, phase: NDArray | float,
                 speed: float) -> NDArray:
        """Force on the rotor, N, shape of e; velocity and speed do not matter. nan where the rotor
        is in the stator.
        """
        direction, weight, gap = self._around(e, phase)
        return np.einsum("in,...n->i...", direction, weight / gap**2)

    def linearise_at(self, e: NDArray, velocity: NDArray, phase: NDArray | float,
                     speed: float) -> tuple[NDArray, NDArray, NDArray]:
        """Force, N, with its derivatives by position, N/m, and by velocity, which are zero."""
        direction, weight, gap = self._around(e, phase)
        stress = weight / gap**2
        slope = np.einsum("in,jn,...n->ij...", direction, direction, 2 * stress / gap)
        return np.einsum("in,...n->i...", direction, stress), slope, np.zeros_like(slope)

    def potential(self, e: NDArray, phase: NDArray | float) -> NDArray:
        """V, J, with F = −∂V/∂e at a fixed phase."""
        _, weight, gap = self._around(e, phase)
        return -(weight / gap).sum(axis=-1)

    def _around(self, e: NDArray, phase: NDArray | float) -> tuple[NDArray, NDArray, NDArray]:
        """Directions (2, N), weights 2 f² k g0³/N (…, N), and the gap (…, N), nan below zero."""
        angle = 2 * np.pi * np.arange(self.points) / self.points
        direction = np.stack([np.sin(angle), np.cos(angle)])
        gap = self.gap - np.tensordot(e, direction, axes=(0, 0))
        weight = 2 * self.stiffness * self.gap**3 / self.points * self.field(angle, phase) ** 2
        return direction, weight, np.where(gap > 0, gap, np.nan)

    def smallest_gap(self, e: NDArray) -> NDArray:
        """Smallest air gap around the circumference, m."""
        return self.gap - np.hypot(e[0], e[1])

    def gap_angle(self, e: NDArray) -> NDArray:
        """Angle at which the gap is smallest, rad, from z towards x."""
        return np.arctan2(e[0], e[1])

    def scaled(self, factor: float) -> FieldWave:
        """The same law, `factor` times as strong."""
        return replace(self, stiffness=factor * self.stiffness)
