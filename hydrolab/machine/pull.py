r"""Force laws in local coordinates, and the magnetic pull in the air gap among them.

Gap angle φ runs from z towards x. Forces act ON the rotor, positive along +x and +z, so the pull
points along the eccentricity e = (x − x_E, z − z_E), towards the small gap.

Source: Villa, Carvalho and Salomon, Eqs. (2) to (8), after Lundström and Aidanpää (2007).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Linear = tuple[NDArray, NDArray, NDArray | None]  # force, ∂F_i/∂u_j, ∂F_i/∂v_j
Rate = NDArray | None  # velocities, where a law asks for them
Phase = NDArray | float
quiet = np.errstate(all="ignore")  # nan is meant outside the gap, and what underflows is nothing


class ForceLaw:
    """Forces on a few coordinates u, given coordinates first: u has the shape (c, …).

    A new law is a frozen dataclass that derives from this class and follows these rules.

    1. It writes `linearise`. It writes `force` too where that is cheaper than the first of the
       three things `linearise` returns.
    2. The force has the shape of u, its derivatives the shape (c, c, …). Forces act on the rotor.
       u is in m or rad, velocity the same per second, phase Ωt in rad, speed Ω in rad/s; phase is
       broadcast against the axes of u after its first. Both methods take any number of such axes.
    3. Where the law has no answer (outside the gap) the force is nan, without a warning (`@quiet`).
    4. A law of the position alone leaves `moving` at False; solvers then give it u only. Any other
       says `moving = True` and is given all four. One that knows no velocity returns None as its
       third derivative.
    5. The force of a magnetic law is proportional to its field `stiffness` (or it writes `scaled`).
       One that the field does not touch says `magnetic = False`.
    6. `coordinates` is c. The first two of a law in the air gap are the eccentricity (x, z), m.
    7. A law in the air gap has a field `gap`, its nominal gap, m; any other says
       `gap = math.inf`. Where the gap is not round, it writes `narrowest`.
    8. `closed_form` says that the force has no number outside the gap, and that one law with an
       array for each of its numbers is as many laws (`dynamics.batch`).
    9. Its table in a card is a `Part` beside the law and a field of `parts.Machine`; `model.attach`
       (or `model.air_gap_law`) makes the law of it and gives the rows of its coordinates.
    """

    moving: bool = False
    magnetic: bool = True
    coordinates: int = 2
    gap: float

    def force(self, u: NDArray, velocity: Rate = None, phase: Phase = 0.0,
              speed: float = 0.0) -> NDArray:
        """Force on the rotor, N or N m; shape of u."""
        return self.linearise(u, velocity, phase, speed)[0]

    def linearise(self, u: NDArray, velocity: Rate = None, phase: Phase = 0.0,
                  speed: float = 0.0) -> Linear:
        """Force with its derivatives by position and by velocity (None if zero), (c, c, …)."""
        raise NotImplementedError

    def narrowest(self, u: NDArray, phase: Phase = 0.0) -> tuple[NDArray, NDArray]:
        """Smallest gap, m, and its gap angle, rad; each has the shape of u without its first axis.
        """
        return self.gap - np.hypot(u[0], u[1]), np.arctan2(u[0], u[1])

    @property
    def closed_form(self) -> bool:
        """Whether it is the pull of a round gap (rule 8)."""
        return False

    def smallest_gap(self, u: NDArray, phase: Phase = 0.0) -> NDArray:
        """Smallest air gap around the circumference, m; zero or less is contact."""
        return self.narrowest(u, phase)[0]

    def gap_angle(self, u: NDArray, phase: Phase = 0.0) -> NDArray:
        """Angle at which the gap is smallest, rad, from z towards x."""
        return self.narrowest(u, phase)[1]

    def scaled(self, factor: float) -> Self:
        """The same law, `factor` times as strong (the pull grows with the square of the field)."""
        if not self.magnetic:
            return self
        own: Any = self
        return replace(own, stiffness=factor * own.stiffness)


@dataclass(frozen=True)
class CircularPull(ForceLaw):
    r"""Pull of a circular rotor in a circular stator, in closed form.

    F = k e / (1 − ε²)^{3/2} with ε = |e|/g0: the integral of Eqs. (7) and (8) with the gap of
    Eq. (6), g = g0 (1 − ε cos(φ − γ)).

    stiffness: k = π B0² u0 l0 / (µ0 g0), N/m. gap: g0, m.
    """

    stiffness: float
    gap: float

    @property
    def closed_form(self) -> bool:
        """True but for a subclass, which has another force."""
        return type(self) is CircularPull

    @quiet
    def force(self, u: NDArray, velocity: Rate = None, phase: Phase = 0.0,
              speed: float = 0.0) -> NDArray:
        """Force on the rotor, N; shape of u. Meaningless (nan) where |e| ≥ g0."""
        ex, ez = u
        return self.stiffness * (1 - (ex * ex + ez * ez) / self.gap**2) ** -1.5 * u

    @quiet
    def linearise(self, u: NDArray, velocity: Rate = None, phase: Phase = 0.0,
                  speed: float = 0.0) -> Linear:
        r"""Force, N, and its derivative, N/m.

        ∂F/∂e = k [(1 − ε²)^{−3/2} I + 3 (1 − ε²)^{−5/2} e eᵀ/g0²].
        """
        ex, ez = u
        s = 1 / (1 - (ex * ex + ez * ez) / self.gap**2)
        radial = self.stiffness * s * np.sqrt(s)
        force = radial * u
        slope = (3 / self.gap**2 * s * force)[:, None] * u
        slope[0, 0] += radial
        slope[1, 1] += radial
        return force, slope, None


@dataclass(frozen=True)
class MatrixPull(ForceLaw):
    """A linear law F = A u in the gap: each subclass says by `unit` what A is over k.

    stiffness: k, N/m. gap: g0, m.
    """

    stiffness: float
    gap: float
    unit = np.eye(2)

    def linearise(self, u: NDArray, velocity: Rate = None, phase: Phase = 0.0,
                  speed: float = 0.0) -> Linear:
        """Force, N, and its derivative k times the unit, N/m."""
        matrix = self.stiffness * self.unit
        slope = np.broadcast_to(matrix.reshape(2, 2, *(1,) * (u.ndim - 1)), (2, *u.shape))
        return (matrix @ u.reshape(2, -1)).reshape(u.shape), slope, None


class LinearPull(MatrixPull):
    """The pull as design tools take it: F = k e, a negative stiffness, at any eccentricity."""


class TangentialPull(MatrixPull):
    """A pull across the eccentricity, which damper circuits and cages add to the pull along it.

    F = k_t J e, with J the quarter turn from z to x: k_t > 0 pushes a rotor that whirls with the
    spin on its way. It stands beside the law of the pull (`SeveralLaws`), so that F = k_r e +
    k_t J e for a linear pull k_r. A Jeffcott rotor with damping c is stable as long as c ω > |k_t|,
    with ω = √((k − k_r)/m): k_t > 0 drives its forward whirl, k_t < 0 its backward whirl. Karlsson
    et al. (2007) find such a pull where a generator has a damper winding. Here k_t is constant,
    while a circuit's depends on the whirl frequency.
    """

    unit = np.array([[0.0, 1.0], [-1.0, 0.0]])


@dataclass(frozen=True)
class Bulge:
    """The radius is larger by size · cos(order (φ − angle)). size: m. angle: of a peak, rad."""

    order: int
    size: float
    angle: float = 0.0


def outline(bulges: tuple[Bulge, ...], angle: NDArray) -> NDArray:
    """By how much the radius is larger at each gap angle (any shape), m."""
    return sum((b.size * np.cos(b.order * (angle - b.angle)) for b in bulges),
               np.zeros(np.shape(angle)))


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


@dataclass(frozen=True, eq=False)
class ShapedPull(ForceLaw):
    r"""Pull of any field in a gap of any shape, by quadrature of Eqs. (7) and (8).

    F = (k g0³ / 2π) ∮ 2 f² (sin φ, cos φ) / g² dφ with the gap and the magnetomotive force

    g(φ, t) = shape(φ) − Σ δ cos n(φ − Ωt − β) − e_x sin φ − e_z cos φ   (the rotor's bulges turn),
    f(φ, t) = Σ share cos(order φ − ratio Ωt − angle),

    and 2 f² = 1 for a constant field. A lone wave of share 1 is the field whose rms is B0, so its
    mean pull is that of `CircularPull`. Pennacchi and Frosini (2005) take the rotor's and the
    stator's wave with the load angle between them; their parameters could not be read. The
    integrand is periodic, so the trapezoidal rule converges exponentially.

    stiffness, gap: k (N/m) and g0 (m) of the nominal circular gap and the reference wave. shape:
    the gap at the N equally spaced angles φ_n = 2πn/N when a round rotor is centred, m; shape (N,).
    rotor: the `Bulge`s of the rotor at phase 0. waves: `Wave`s, none for a constant field.
    """

    stiffness: float
    gap: float
    shape: NDArray
    rotor: tuple[Bulge, ...] = ()
    waves: tuple[Wave, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "moving", bool(self.rotor or self.waves))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ShapedPull) and self._told() == other._told()

    def __hash__(self) -> int:
        return hash(self._told())

    def _told(self) -> tuple:
        return self.stiffness, self.gap, self.shape.tobytes(), self.rotor, self.waves

    @property
    def angles(self) -> NDArray:
        """The gap angles of the quadrature, rad, (N,)."""
        return 2 * np.pi * np.arange(len(self.shape)) / len(self.shape)

    def local_gap(self, u: NDArray, phase: Phase = 0.0) -> NDArray:
        """Gap at the N angles, m, (…, N); below zero the rotor is in the stator."""
        angle = self.angles
        gap = self.shape - np.tensordot(u, [np.sin(angle), np.cos(angle)], axes=(0, 0))
        turned = np.asarray(phase)[..., None]
        return gap - outline(self.rotor, angle - turned) if self.rotor else gap

    def field(self, angle: NDArray, phase: Phase) -> NDArray:
        """f at gap angles (N,) and phases (…), over the reference wave's peak: (…, N)."""
        turned = np.asarray(phase)[..., None]
        return sum((w.share * np.cos(w.order * angle - w.ratio * turned - w.angle)
                    for w in self.waves), np.zeros(1))

    def _stress(self, u: NDArray, phase: Phase) -> tuple[NDArray, NDArray, NDArray]:
        """Directions (2, N), share of each angle in the force, N, and gap, m, both (…, N)."""
        angle, gap = self.angles, self.local_gap(u, phase)
        gap = np.where(gap > 0, gap, np.nan)
        stress = self.stiffness * self.gap**3 / len(angle) / (gap * gap)
        if self.waves:
            stress = 2 * self.field(angle, phase) ** 2 * stress
        return np.stack([np.sin(angle), np.cos(angle)]), stress, gap

    @quiet
    def force(self, u: NDArray, velocity: Rate = None, phase: Phase = 0.0,
              speed: float = 0.0) -> NDArray:
        """Force on the rotor, N; shape of u. Meaningless (nan) where the rotor is in the stator."""
        direction, stress, _ = self._stress(u, phase)
        return np.tensordot(direction, stress, axes=(1, -1))

    @quiet
    def linearise(self, u: NDArray, velocity: Rate = None, phase: Phase = 0.0,
                  speed: float = 0.0) -> Linear:
        """Force, N, and its derivative, N/m: one more power of the gap under the integral."""
        direction, stress, gap = self._stress(u, phase)
        slope = np.tensordot(direction[:, None] * direction, 2 * stress / gap, axes=(2, -1))
        return np.tensordot(direction, stress, axes=(1, -1)), slope, None

    def narrowest(self, u: NDArray, phase: Phase = 0.0) -> tuple[NDArray, NDArray]:
        """Smallest gap over the N angles, m, and its angle, rad."""
        gap = self.local_gap(u, phase)
        return gap.min(axis=-1), 2 * np.pi * gap.argmin(axis=-1) / len(self.shape)


POINTS = {False: 128, True: 256}  # around the gap, by whether it has a shape, before waves' orders


def shaped_law(stiffness: float, gap: float, stator: tuple[Bulge, ...] = (),
               rotor: tuple[Bulge, ...] = (), waves: tuple[Wave, ...] = ()) -> ShapedPull:
    """The pull between two shapes in a field of waves, none for a constant field.

    stiffness, gap: k (N/m) and g0 (m) of the nominal circular gap. The points of the quadrature
    grow with the orders of the waves; at 90 % of a round gap 128 leave an error of 1e-26.
    """
    points = (POINTS[bool(stator or rotor) or not waves]
              + 4 * max((wave.order for wave in waves), default=0))
    around = 2 * np.pi * np.arange(points) / points
    return ShapedPull(stiffness, gap, gap + outline(stator, around), rotor, waves)


# Gauss points over the height: the pull is smooth in s, so the error falls exponentially with them
HEIGHTS = 12
GAUSS = np.polynomial.legendre.leggauss(HEIGHTS)  # each time it would take as long as the force


@dataclass(frozen=True)
class TiltedPull(ForceLaw):
    """The pull of a rotor that tilts: each height of the rim has its own eccentricity.

    A rim of height h whose centre lies at e and whose axis leans by the slopes t = (∂x/∂y, ∂z/∂y)
    has, at the height s below its centre, the eccentricity e + s t. Its pull and the moment that
    goes with the slopes are

    F = (1/h) ∫ f(e + s t) ds, N = (1/h) ∫ s f(e + s t) ds, s from −h/2 to h/2,

    with f the pull of the whole rim if it did not lean. For small motion N = k (h²/12) t: the tilt
    pull, which Gustavsson and Aidanpää (2006) give a rim with its hub off the middle, and which a
    model without tilt leaves out.

    upright: the pull f, on (x, z). height: h, m. Coordinates: eccentricity of the rim's middle, m,
    and slopes, rad; the force has the same four rows, N and N m.
    """

    coordinates = 4
    upright: ForceLaw
    height: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "moving", self.upright.moving)
        object.__setattr__(self, "gap", self.upright.gap)

    def _slices(self, u: NDArray, phase: Phase
                ) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """Heights s (m), weights that sum to 1, the eccentricity there, (2, …, points), phase."""
        s = self.height / 2 * GAUSS[0]
        return (s, GAUSS[1] / 2, u[:2, ..., None] + u[2:, ..., None] * s,
                np.asarray(phase)[..., None])

    def force(self, u: NDArray, velocity: Rate = None, phase: Phase = 0.0,
              speed: float = 0.0) -> NDArray:
        """Force, N, and moment on the slopes, N m; nan where an end is in the stator."""
        s, weight, e, phase = self._slices(u, phase)
        pull = self.upright.force(e, None, phase, speed)
        return np.concatenate([pull @ weight, pull @ (s * weight)])

    def linearise(self, u: NDArray, velocity: Rate = None, phase: Phase = 0.0,
                  speed: float = 0.0) -> Linear:
        """Force and its derivative, (4, 4, …)."""
        s, weight, e, phase = self._slices(u, phase)
        pull, slope, _ = self.upright.linearise(e, None, phase, speed)
        direct, mixed, tilt = slope @ weight, slope @ (s * weight), slope @ (s * s * weight)
        return (np.concatenate([pull @ weight, pull @ (s * weight)]),
                np.concatenate([np.concatenate([direct, mixed], axis=1),
                                np.concatenate([mixed, tilt], axis=1)]), None)

    def narrowest(self, u: NDArray, phase: Phase = 0.0) -> tuple[NDArray, NDArray]:
        """Smallest gap, m, and its angle, rad, at the top or the bottom of the rim: no other height
        comes nearer to the stator. Where u is (x, z) alone the rotor is taken as upright.
        """
        lean = u[2:4, ..., None] if len(u) > 2 else 0 * u[..., None]
        ends = u[:2, ..., None] + lean * (self.height / 2 * np.array([-1.0, 1.0]))
        gap, angle = self.upright.narrowest(ends, np.asarray(phase)[..., None])
        nearest = gap.argmin(axis=-1)[..., None]
        return gap.min(axis=-1), np.take_along_axis(angle, nearest, axis=-1)[..., 0]

    def scaled(self, factor: float) -> TiltedPull:
        """The same law, `factor` times as strong."""
        return replace(self, upright=self.upright.scaled(factor))


@dataclass(frozen=True)
class Placed:
    """A law on some of a model's nonlinear coordinates."""

    law: ForceLaw
    rows: slice


@dataclass(frozen=True)
class SeveralLaws(ForceLaw):
    """Laws side by side. The first is the pull in the air gap; its coordinates begin with (x, z) of
    the generator. Laws on the same coordinates add up.
    """

    parts: tuple[Placed, ...]

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "moving", any(part.law.moving for part in self.parts))
        put(self, "coordinates", max(part.rows.stop for part in self.parts))
        put(self, "gap", self.parts[0].law.gap)

    def force(self, u: NDArray, velocity: Rate = None, phase: Phase = 0.0,
              speed: float = 0.0) -> NDArray:
        """Forces on all coordinates, N; shape of u."""
        out = np.zeros_like(u)
        for part in self.parts:
            rate = None if velocity is None else velocity[part.rows]
            out[part.rows] += part.law.force(u[part.rows], rate, phase, speed)
        return out

    def linearise(self, u: NDArray, velocity: Rate = None, phase: Phase = 0.0,
                  speed: float = 0.0) -> Linear:
        """Forces, N, with their derivatives by position, N/m, and by velocity, N s/m, (c, c, …)."""
        out, slope, damping = np.zeros_like(u), np.zeros((len(u), *u.shape)), None
        for part in self.parts:
            rate = None if velocity is None else velocity[part.rows]
            force, by_place, by_rate = part.law.linearise(u[part.rows], rate, phase, speed)
            out[part.rows] += force
            slope[part.rows, part.rows] += by_place
            if by_rate is not None:
                damping = np.zeros_like(slope) if damping is None else damping
                damping[part.rows, part.rows] += by_rate
        return out, slope, damping

    def narrowest(self, u: NDArray, phase: Phase = 0.0) -> tuple[NDArray, NDArray]:
        """Smallest gap, m, and its angle, rad, by the first law; u: all coordinates, or (x, z)."""
        return self.parts[0].law.narrowest(u[self.parts[0].rows], phase)

    def scaled(self, factor: float) -> SeveralLaws:
        """The same laws, the magnetic ones `factor` times as strong."""
        return SeveralLaws(tuple(replace(p, law=p.law.scaled(factor)) for p in self.parts))


def closed_form() -> tuple[Any, Any]:
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
