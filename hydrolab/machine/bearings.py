r"""What carries the shaft: linear bearings, guide bearings of pads with clearance, and a short
journal film; the laws of the last two, and the parts a card makes them of.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from hydrolab.errors import BadInput
from hydrolab.machine.pull import ForceLaw, Linear, quiet
from hydrolab.machine.quantities import (
    Fault,
    Part,
    Read,
    bearing_matrix,
    frozen,
    number_field,
    shown,
    text_field,
    vector,
    whole_field,
)


class BearingLaw(ForceLaw):
    """The force law of a bearing. A linear bearing of the stiffness `reference`, N/m, stands for it
    in the model's matrix, and the law takes it back.
    """

    magnetic, gap = False, math.inf
    reference: float


@dataclass(frozen=True)
class Pads(BearingLaw):
    """Force of `count` equal pads at equal angles on a journal at u = (x, z): a pad pushes where
    the journal has crossed its clearance.

    F = −k Σ_j p(n_j · u − c) n_j over pads in the directions n_j, with p(d) = d for d > 0 and 0
    otherwise. The corner is rounded over a distance b, p(d) = (d + √(d² + b²))/2, as surfaces that
    meet are rounded, so that Newton's method has a derivative. It has a potential, so it neither
    damps nor drives. The set-up of guide bearings with radial pads is described by Gustavsson and
    Aidanpää (2006) and in ISO 20816-5; this law of dry, frictionless pads is the simplest of it.

    stiffness: of one pad, N/m. clearance: of each, m; negative is a preload. angle: gap angle of
    the first pad, rad. rounding: b, m. reference: stiffness of the linear bearing in the model's
    matrix, N/m, which this law takes back.
    """

    stiffness: float
    clearance: float
    count: int
    angle: float
    rounding: float
    reference: float = 0.0

    @property
    def directions(self) -> NDArray:
        """Unit vectors (x, z) towards the pads, (2, count)."""
        angle = self.angle + 2 * np.pi * np.arange(self.count) / self.count
        return np.stack([np.sin(angle), np.cos(angle)])

    def _pressed(self, u: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Directions (2, count), how far the journal is beyond, and rounded so, (…, count)."""
        n = self.directions
        beyond = np.tensordot(u, n, axes=(0, 0)) - self.clearance
        return n, beyond, np.hypot(beyond, self.rounding)

    @quiet
    def linearise(self, u: NDArray, velocity: NDArray | None = None, phase: NDArray | float = 0.0,
                  speed: float = 0.0) -> Linear:
        """Force, N, and its derivative, N/m."""
        n, d, h = self._pressed(u)
        slope = -self.stiffness / 2 * np.einsum("ik,jk,...k->ij...", n, n, 1 + d / h)
        slope[[0, 1], [0, 1]] += self.reference
        force = self.reference * u - self.stiffness / 2 * np.einsum("ij,...j->i...", n, d + h)
        return force, slope, None


@dataclass(frozen=True)
class ShortFilm(BearingLaw):
    r"""Force of a short film with cavitation (the π-film) on a journal at u = (x, z) that moves
    with u̇, at a speed Ω, in closed form.

    In a bearing much shorter than its diameter oil flows along the axis only (Dubois and Ocvirk
    1953). The Reynolds equation then integrates to F = −C ∫ (w·n) n / (1 − x·n)³ dφ with C = µ R
    L³/c³, x = u/c, n = (sin φ, cos φ) and w = u̇ + (Ω/2)(−z, x): the velocity of the journal seen
    from axes that turn at half the speed. Oil bears no tension, so only the half of the
    circumference with w·n > 0 counts. Everything follows from one integral over that half,

    G(p, q) = ∫ dθ / (1 − p cos θ − q sin θ) = (2/r) A,  A = π/2 + arctan(p/r),
    r² = 1 − p² − q²,  |θ| < π/2,

    with p and q the parts of x along w and a quarter turn on: F = −(C/2) ∂²G/∂x² w. The same force
    is given in other letters by Capone (1991); Adiletta, Guido and Rossi (1996) print it.

    damping: C = µ R L³/c³, N s/m. clearance: radial, c, m; outside it the force is nan.
    reference: stiffness of the linear bearing in the model's matrix, N/m, which this law takes
    back.
    """

    moving = True
    damping: float
    clearance: float
    reference: float = 0.0

    def _squeeze(self, u: NDArray, velocity: NDArray | None, speed: float) -> tuple[NDArray, ...]:
        """|w|, its direction m and the quarter turn of it, and the parts p, q of u/c along them."""
        vx, vz = np.zeros_like(u) if velocity is None else velocity
        wx, wz = vx - speed / 2 * u[1], vz + speed / 2 * u[0]
        size = np.hypot(wx, wz)
        safe = np.where(size > 0, size, 1.0)
        m = np.stack([np.where(size > 0, wx / safe, 0.0), np.where(size > 0, wz / safe, 1.0)])
        turned = np.stack([m[1], -m[0]])
        x = u / self.clearance
        return size, m, turned, (x * m).sum(axis=0), (x * turned).sum(axis=0)

    @quiet
    def linearise(self, u: NDArray, velocity: NDArray | None = None, phase: NDArray | float = 0.0,
                  speed: float = 0.0) -> Linear:
        """Force, N, and its derivatives with respect to u, N/m, and to the velocity, N s/m."""
        size, m, turned, p, q = self._squeeze(u, velocity, speed)
        pp, pq, qq = second_derivatives(p, q)
        force = self.reference * u - self.damping / 2 * size * (pp * m + pq * turned)

        def turned_back(a: NDArray, b: NDArray, c: NDArray) -> NDArray:
            """The symmetric tensor a mm + b (mt + tm) + c tt in (x, z)."""
            return (a * m[:, None] * m + b * (m[:, None] * turned + turned[:, None] * m)
                    + c * turned[:, None] * turned)

        by_velocity = -self.damping / 2 * turned_back(pp, pq, qq)
        by_place = turned_back(*third_derivatives(p, q))
        by_place *= -self.damping / (2 * self.clearance) * size
        # w = u̇ + (Ω/2)(−z, x), so u also acts through w
        by_place[:, 0] += speed / 2 * by_velocity[:, 1]
        by_place[:, 1] -= speed / 2 * by_velocity[:, 0]
        by_place[[0, 1], [0, 1]] += self.reference
        return force, by_place, by_velocity


def _parts(p: NDArray, q: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """1/r, A and B = 1/(1 − q²); nan outside the clearance."""
    s = 1 / np.sqrt(1 - p * p - q * q)
    return s, np.pi / 2 + np.arctan(p * s), 1 / (1 - q * q)


def second_derivatives(p: NDArray, q: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """G_pp, G_pq, G_qq: twice the integrals of (cos², cos sin, sin²)/(1 − p cos θ − q sin θ)³ over
    the half.
    """
    s, A, B = _parts(p, q)
    pp = 2 * (3 * p * s**4 + A * (s**3 + 3 * p * p * s**5))
    pq = 2 * (q * (p * p * B + 2) * s**4 + 3 * A * p * q * s**5)
    qq = 2 * (A * (s**3 + 3 * q * q * s**5) + 3 * p * q * q * B * s**4 + p * B
              * (1 + 2 * q * q * B) * s**2)
    return pp, pq, qq


def third_derivatives(p: NDArray, q: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """G_ppp, G_ppq, G_pqq: six times the integrals of (cos³, cos² sin, cos sin²)/(1 − p cos θ − q
    sin θ)⁴.
    """
    s, A, B = _parts(p, q)
    ppp = 2 * (4 * s**4 + 15 * p * p * s**6 + A * (9 * p * s**5 + 15 * p**3 * s**7))
    ppq = 2 * (12 * p * q * s**6 + p * q * B * (s**4 + 3 * p * p * s**6) + A
               * (3 * q * s**5 + 15 * p * p * q * s**7))
    pqq = 2 * ((p * p * B + 2) * s**4 + 2 * (p * q * B) ** 2 * s**4 + 4 * q * q * (p * p * B + 2)
               * s**6
               + 3 * B * (p * q) ** 2 * s**6 + A * (3 * p * s**5 + 15 * p * q * q * s**7))
    return ppp, ppq, pqq


@dataclass(frozen=True)
class Bearing(Part):
    """A bearing at a node of the shaft.

    A new kind is a dataclass over this one, in `BEARINGS`. told_by: the number by which a card
    tells the kind. group: the field of a machine that holds bearings of this kind. tilts: whether
    it acts on the tilt (θx, θz) of its node; else it acts on (x, z).
    """

    table = "bearings"
    noun = "a bearing"
    told_by: ClassVar[str]
    group: ClassVar[str]
    tilts: ClassVar[bool] = False
    name: str = text_field("what the bearing is called", "guide bearing")
    node: int = whole_field("the node it is at, from 0 at the shaft top", 1)

    def law(self, speed: float) -> BearingLaw | None:
        """What is not linear in it at a speed (rad/s) of the machine; None for a linear bearing."""
        return None

    def matrices(self, speed: float = 0.0) -> tuple[NDArray, NDArray]:
        """Stiffness, N/m, and damping, N s/m, of a linear bearing at a speed, rad/s, both (2, 2).
        """
        return np.zeros((2, 2)), np.zeros((2, 2))


@dataclass(frozen=True)
class Bush(BearingLaw):
    """A linear bearing that holds the journal beyond a clearance only, all around.

    F = −K u (p(r − c) − p(−c))/r with r = |u| and p(d) = (d + √(d² + b²))/2, rounded over b.

    stiffness: K by its rows, N/m. clearance: c, m. rounding: b, m. reference: as in `Pads`.
    """

    stiffness: tuple[float, float, float, float]
    clearance: float
    rounding: float
    reference: float

    @quiet
    def linearise(self, u: NDArray, velocity: NDArray | None = None, phase: NDArray | float = 0.0,
                  speed: float = 0.0) -> Linear:
        """Force, N, and its derivative, N/m."""
        b, c = self.rounding, self.clearance
        r = np.maximum(np.hypot(u[0], u[1]), 1e-6 * b)
        beyond = np.hypot(r - c, b)
        share = (r + beyond - math.hypot(c, b)) / (2 * r)
        steeper = ((1 + (r - c) / beyond) / 2 - share) / (r * r)
        K = np.reshape(self.stiffness, (2, 2))
        whole = np.tensordot(K, u, 1)
        slope = -whole[:, None] * u * steeper
        slope -= K.reshape(2, 2, *(1,) * (u.ndim - 1)) * share
        slope[[0, 1], [0, 1]] += self.reference
        return self.reference * u - whole * share, slope, None


@dataclass(frozen=True)
class OutOfLine(BearingLaw):
    """The law of a bearing whose centre is at (x, z), m."""

    own: BearingLaw
    x: float
    z: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "moving", self.own.moving)
        object.__setattr__(self, "reference", self.own.reference)

    def linearise(self, u: NDArray, velocity: NDArray | None = None, phase: NDArray | float = 0.0,
                  speed: float = 0.0) -> Linear:
        """What the bearing's own law says of the place counted from its centre."""
        return self.own.linearise((u.T - [self.x, self.z]).T, velocity, phase, speed)


@dataclass(frozen=True, kw_only=True, eq=False)
class Guide(Bearing):
    """A bearing that holds the shaft sideways. Its centre may be out of line, and it may stand in a
    bracket that gives: a mass between two springs.
    """

    x: float = number_field("m", "how far its centre is out of line along x", default=0.0,
                            example=(0.1, "mm"), mirrored=True)
    z: float = number_field("m", "likewise along z", default=0.0, example=(-0.1, "mm"))
    bracket_stiffness: NDArray | Any = number_field(
        "N/m", "stiffness of the bracket it stands in, as of a bearing; 0 stands for no bracket",
        form=bearing_matrix, default=0.0, example=(800, "kN/mm"), mirrored=True)
    bracket_mass: float = number_field("kg", "mass of the bracket that moves", least=0, default=0.0,
                                       example=(12, "t"))
    bracket_damping: NDArray | Any = number_field("N s/m", "damping of the bracket", default=0.0,
                                                  form=bearing_matrix, example=(100, "kN s/m"),
                                                  mirrored=True)

    @property
    def fluid_mass(self) -> float:
        """Mass of fluid that moves with the shaft in it, kg."""
        return 0.0

    @property
    def has_bracket(self) -> bool:
        """Whether it stands in a bracket."""
        return bool(np.any(self.bracket_stiffness))

    def disagreements(self) -> Iterator[Fault]:
        """A bracket has stiffness and mass."""
        if self.has_bracket != (self.bracket_mass > 0):
            yield "bracket_mass", (f"is {self.bracket_mass:g} kg and {self.key}.bracket_stiffness "
                                   "is" + " not" * self.has_bracket + " 0; a bracket has both.")

    def law(self, speed: float) -> BearingLaw | None:
        """What is not linear in it at a speed (rad/s), about its centre, or None."""
        own = self.law_in_line(speed)
        return OutOfLine(own, self.x, self.z) if own and (self.x or self.z) else own

    def law_in_line(self, speed: float) -> BearingLaw | None:
        """The same of a bearing in line."""
        return None


@dataclass(frozen=True, eq=False)
class RadialBearing(Guide):
    """A linear radial bearing: force on the rotor −stiffness·u − damping·u̇ with u = (x, z)."""

    noun = "a radial bearing"
    told_by = "stiffness"
    group = "bearings"
    stiffness: NDArray | Any = number_field(
        "N/m", "stiffness: one number (isotropic), [x, z] or [[xx, xz], [zx, zz]]; direct entries "
        "at least 0", form=bearing_matrix, example=1.37e9, mirrored=True)
    damping: NDArray | Any = number_field("N s/m", "damping, likewise", form=bearing_matrix,
                                          default=0.0, example=1e6, mirrored=True)
    clearance: float = number_field("m", "how far the journal moves before it is held", least=0,
                                    default=0.0, example=(50, "µm"))

    def matrices(self, speed: float = 0.0) -> tuple[NDArray, NDArray]:
        """Stiffness, N/m, and damping, N s/m."""
        return self.stiffness, self.damping

    def law_in_line(self, speed: float) -> Bush | None:
        """The bush of a bearing with clearance."""
        if not self.clearance:
            return None
        (xx, xz), (zx, zz) = self.stiffness.tolist()
        return Bush((xx, xz, zx, zz), self.clearance, 0.1 * self.clearance, max(xx, zz))


@dataclass(frozen=True, eq=False)
class Seal(Guide):
    """A seal, or a runner in its clearance: force −k u + κ J u − c u̇ + χ J u̇ on the rotor, and the
    mass of the fluid that moves with it, where J is the quarter turn with the spin, from z to x. So
    the sign of the direct stiffness is free, and a positive cross stiffness drives forward whirl,
    whichever way the axes of a textbook run.
    """

    noun = "a seal"
    told_by = "seal_stiffness"
    group = "seals"
    seal_stiffness: float = number_field("N/m", "direct stiffness k; below 0 it pushes away from "
                                         "the middle", example=(-80, "MN/m"))
    cross_stiffness: float = number_field("N/m", "cross stiffness κ; above 0 it drives forward "
                                          "whirl", default=0.0, example=(60, "MN/m"))
    damping: float = number_field("N s/m", "direct damping c", least=0, default=0.0,
                                  example=(400, "kN s/m"))
    cross_damping: float = number_field("N s/m", "cross damping χ", default=0.0,
                                        example=(50, "kN s/m"))
    added_mass: float = number_field("kg", "mass of the fluid that moves with it", least=0,
                                     default=0.0, example=(1.5, "t"))

    @property
    def fluid_mass(self) -> float:
        """Mass of fluid that moves with the shaft in it, kg."""
        return self.added_mass

    def matrices(self, speed: float = 0.0) -> tuple[NDArray, NDArray]:
        """Stiffness, N/m, and damping, N s/m."""
        one, turn = np.eye(2), np.array([[0.0, 1.0], [-1.0, 0.0]])
        return (self.seal_stiffness * one - self.cross_stiffness * turn,
                self.damping * one - self.cross_damping * turn)


@dataclass(frozen=True, eq=False)
class ThrustBearing(Bearing):
    """A thrust bearing seen by the lateral motion: angular springs and dampers at one node."""

    noun = "a thrust bearing"
    told_by = "tilt_stiffness"
    group = "thrust_bearings"
    tilts = True
    tilt_stiffness: NDArray | Any = number_field(
        "N m/rad", "stiffness against tilt: one number, or [about x, about z]", form=bearing_matrix,
        example=5e7, mirrored=True)
    tilt_damping: NDArray | Any = number_field("N m s/rad", "damping of tilt, likewise",
                                               form=bearing_matrix, default=0.0, example=1e6,
                                               mirrored=True)
    out_of_square: float = number_field("rad", "lean of the collar's face against the shaft, which "
                                        "turns with it", default=0.0, example=1e-4)
    phase: float = number_field("rad", "angle that the face leans to, from an unbalance of phase "
                                "0, with the spin", default=0.0, example=(90, "deg"), mirrored=True)

    def matrices(self, speed: float = 0.0) -> tuple[NDArray, NDArray]:
        """Stiffness, N m/rad, and damping, N m s/rad."""
        return self.tilt_stiffness, self.tilt_damping


STIFF = 5  # so that the linear answer, from which a solver starts, lies within the clearance


@dataclass(frozen=True)
class PadBearing(Guide):
    """A guide bearing of separate pads with clearance (`Pads`): dry contact, no friction."""

    noun = "pads with clearance"
    told_by = "pad_stiffness"
    group = "pad_bearings"
    pads: int = whole_field("how many pads, at equal angles", 8, least=3, most=64,
                            why="with fewer than 3 the journal can slip out between")
    pad_stiffness: float = number_field("N/m", "stiffness of each pad", above=0, example=3.4e8)
    clearance: float = number_field("m", "between each pad and the resting journal; negative is a "
                                    "preload", example=(150, "µm"))
    angle: float = number_field("rad", "gap angle of the first pad, from z towards x", default=0.0,
                                example=(22.5, "deg"), mirrored=True)
    rounding: float = number_field(
        "m", "distance over which contact begins softly; 0 stands for a tenth of the clearance, or "
        "of a millimetre where there is none", least=0, default=0.0, example=(15, "µm"))

    def law_in_line(self, speed: float = 0.0) -> Pads:
        """The law of its pads, which takes back the linear bearing of their closed stiffness."""
        rounding = self.rounding or 0.1 * (abs(self.clearance) or 1e-3)
        closed = self.pads * self.pad_stiffness / 2
        return Pads(self.pad_stiffness, self.clearance, self.pads, self.angle, rounding, closed)


@dataclass(frozen=True)
class JournalFilm(Guide):
    """A short journal bearing with a cavitated oil film (`ShortFilm`)."""

    noun = "a journal film"
    told_by = "viscosity"
    group = "films"
    viscosity: float = number_field("Pa s", "viscosity µ of the oil", above=0, example=0.03)
    journal_radius: float = number_field("m", "radius R of the journal", above=0,
                                         example=(400, "mm"))
    film_length: float = number_field("m", "length L of the film along the axis", above=0,
                                      example=(250, "mm"))
    clearance: float = number_field("m", "radial clearance c", above=0, example=(200, "µm"))

    def disagreements(self) -> Iterator[Fault]:
        """A film is thin and short."""
        yield from super().disagreements()
        if self.clearance > 0.1 * self.journal_radius:
            yield "clearance", (f"is {self.clearance:g} m; a film is thin, so it must be at most a "
                                f"tenth of {self.key}.journal_radius, {self.journal_radius:g} m.")
        if self.film_length > 2 * self.journal_radius:
            yield "film_length", (f"is {self.film_length:g} m; the short film holds for bearings "
                                  f"no longer than their diameter, {2 * self.journal_radius:g} m.")

    def law_in_line(self, speed: float) -> ShortFilm:
        """The film's law; its reference is STIFF times its cross stiffness at rest at a speed."""
        damping = self.viscosity * self.journal_radius * (self.film_length / self.clearance) ** 3
        return ShortFilm(damping, self.clearance, STIFF * math.pi / 4 * damping * speed)


ENTRIES = ("xx", "xz", "zx", "zz")


def fours(one: Read, key: str, value: Any) -> NDArray:
    """Return the value of a key as rows of four numbers, xx, xz, zx and zz, (rows, 4); one number
    in a row stands for an isotropic bearing.
    """
    if isinstance(value, (str, Mapping)) or not np.iterable(value):
        raise BadInput(f"{key} is {shown(value)}; it must be a list of rows [xx, xz, zx, zz].")
    rows = [[v, 0.0, 0.0, v] if not np.iterable(v) else list(v) for v in value]
    if any(len(row) != len(ENTRIES) for row in rows):
        raise BadInput(f"{key} is {shown(value)}; each row must be one number or four, "
                       "[xx, xz, zx, zz].")
    return frozen(np.array([[one(f"{key}[{i}]", v) for v in row] for i, row in enumerate(rows)]))


@dataclass(frozen=True, eq=False)
class TableBearing(Guide):
    """A linear radial bearing whose coefficients change with the speed, by straight lines between
    the rows of a table. Beyond its ends it is not known, and refused.
    """

    noun = "a table over the speed"
    told_by = "speeds"
    group = "tables"
    speeds: NDArray | Any = number_field(
        "rad/s", "speeds of the rows, ascending; table = \"guide.csv\" takes all three keys from a "
        "file beside the card", form=vector, least=0, example=([0, 150, 400], "rpm"))
    stiffness_rows: NDArray | Any = number_field(
        "N/m", "stiffness at each speed: rows [xx, xz, zx, zz], or one number where isotropic",
        form=fours, mirrored=True, example=([1.4, 1.3, 1.2], "GN/m"))
    damping_rows: NDArray | Any = number_field(
        "N s/m", "damping at each speed, likewise", form=fours, mirrored=True,
        example=([2, 2, 1], "MN s/m"))

    def disagreements(self) -> Iterator[Fault]:
        """Two speeds at least, ascending, and a row for each."""
        yield from super().disagreements()
        if len(self.speeds) < 2 or (np.diff(self.speeds) <= 0).any():
            yield "speeds", f"is {shown(self.speeds)}; it must be two speeds or more, ascending."
        for name in ("stiffness_rows", "damping_rows"):
            if (rows := len(getattr(self, name))) != len(self.speeds):
                yield name, f"has {rows} rows; {self.key}.speeds has {len(self.speeds)}."

    def matrices(self, speed: float = 0.0) -> tuple[NDArray, NDArray]:
        """Stiffness, N/m, and damping, N s/m, at a speed, rad/s.

        Raises BadInput beyond the ends of the table.
        """
        low, high = self.speeds[[0, -1]]
        if not low <= speed <= high:
            ends, rpm = np.array([low, high, speed]) * 30 / np.pi, "rpm"
            raise BadInput(f"{self.key} is a table from {ends[0]:.6g} to {ends[1]:.6g} {rpm}; it "
                           f"says nothing at {ends[2]:.6g} {rpm}. Add a row, or stay within.")
        k, c = (np.array([np.interp(speed, self.speeds, column) for column in rows.T])
                for rows in (self.stiffness_rows, self.damping_rows))
        return k.reshape(2, 2), c.reshape(2, 2)


BEARINGS: tuple[type[Bearing], ...] = (RadialBearing, ThrustBearing, PadBearing, JournalFilm, Seal,
                                       TableBearing)
