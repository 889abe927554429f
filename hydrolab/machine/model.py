"""Machine → Model: matrices, the force laws on their coordinates, the unbalance. No solving.

The equation of motion is Eq. (9) of Villa, Carvalho and Salomon:
M q̈ + (C + Ω G) q̇ + K q = Ω² (F₁ sin Ωt + F₂ cos Ωt) + Sᵀ F_NL(S q − centre),
with the loads of `hydrolab.machine.loads` beside the unbalance.

The first two of the nonlinear coordinates u = S q are the (x, z) of the generator's centre; the
pull may have more (`air_gap_law`), and each nonlinear bearing and crack adds its own two. One plain
law stays as it is, several go side by side.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from hydrolab.errors import BadInput
from hydrolab.machine.bearings import ThrustBearing
from hydrolab.machine.elements import shaft_element
from hydrolab.machine.gap_shape import gap_law
from hydrolab.machine.loads import towards, turning_with
from hydrolab.machine.pull import (
    CircularPull,
    ForceLaw,
    LinearPull,
    Placed,
    SeveralLaws,
    TangentialPull,
    TiltedPull,
)
from hydrolab.machine.quantities import number, shown, whole

if TYPE_CHECKING:
    from hydrolab.machine.loads import Bow
    from hydrolab.machine.parts import Machine, RigidBody, Shaft

# relative difference below which two frequencies are the pair of an isotropic rotor
DISTINCT = 1e-6


def rayleigh_coefficients(M: NDArray, K: NDArray,
                          ratios: tuple[float, float]) -> tuple[float, float]:
    """α (1/s) and β (s) of C = αM + βK that give the first and the second distinct mode at rest
    these damping ratios.

    In a mode the ratio is ζ = α/(2ω) + βω/2 (T. K. Caughey and M. E. J. O'Kelly, 1965), so two
    frequencies fix both. The frequencies are those of M and K alone (speed zero). The two equal
    frequencies of an isotropic rotor count once, and rigid-body motions, ω = 0, carry no ratio.

    M, K: mass and stiffness, (n, n), M positive definite, K symmetric. ratios: (ζ₁, ζ₂), fractions
    of critical.

    Raises BadInput if K is not symmetric or has fewer than two distinct frequencies above zero.
    """
    if not np.allclose(K, K.T, rtol=0, atol=1e-9 * np.abs(K).max()):
        raise BadInput("damping.ratio needs a symmetric stiffness matrix, and this one is not: "
                       "a bearing has cross-coupling with xz different from zx. Give the bearings "
                       "a damping instead.")
    squares = scipy.linalg.eigvalsh(K, M)
    rounding = 10 * len(M) * np.finfo(float).eps * np.abs(squares).max()
    omega = np.sqrt(squares[squares > rounding])
    above = omega[omega > omega[0] * (1 + DISTINCT)] if len(omega) else omega
    if not len(above):
        raise BadInput("damping.ratio needs two distinct frequencies above zero; this machine has "
                       f"{len(omega[:1])}. Give the bearings a damping instead.")
    two = np.array([omega[0], above[0]])
    alpha, beta = np.linalg.solve(np.stack([1 / (2 * two), two / 2], axis=1), ratios)
    return float(alpha), float(beta)


def air_gap_law(machine: Machine, centre: NDArray) -> tuple[ForceLaw, NDArray]:
    """The law of the air gap and the rows of its coordinates, (c, n).

    centre: the rows of the (x, z) of the body in the gap, (2, n). Without an air gap the law is
    zero everywhere.
    """
    air, rows = machine.air_gap, centre
    if air is None:
        return CircularPull(0.0, math.inf), rows
    law: ForceLaw = (LinearPull if air.linear else CircularPull)(air.pull_stiffness, air.gap)
    if machine.poles or machine.shapes:
        law = gap_law(air.pull_stiffness, air.gap, machine.poles, machine.shapes)
    if air.tilt:
        law = TiltedPull(law, air.length)
        rows = np.vstack([centre, slopes(machine.body(air.body).node, centre.shape[1])])
    if air.tangential:
        across = TangentialPull(air.tangential * air.pull_stiffness, air.gap)
        law = SeveralLaws((Placed(law, slice(0, len(rows))), Placed(across, slice(0, 2))))
    return law, rows


def slopes(node: int, size: int) -> NDArray:
    """Rows of the slopes (∂x/∂y, ∂z/∂y) = (−θz, θx) at a node of a shaft, (2, size)."""
    rows = np.zeros((2, size))
    rows[0, 4 * node + 3], rows[1, 4 * node + 2] = -1.0, 1.0
    return rows


def place(node: int, per_node: int, size: int, first: int = 0) -> NDArray:
    """Rows of the (x, z) of a node, or from its DOF `first` on, (2, size)."""
    return np.eye(size)[per_node * node + first:per_node * node + first + 2]


def attach(machine: Machine, centre: NDArray,
           supports: Mapping[str, Support]) -> tuple[ForceLaw, NDArray]:
    """The law of a whole machine and its selection S, (c, n). centre: as in `air_gap_law`.

    No coordinate depends on the others: laws at one place share their coordinates and add up.
    Raises BadInput where a law acts at the centre of the rotor in the gap, whose place is counted
    from the stator, and for two cracks in one element, whose losses of stiffness do not add up.
    """
    size = centre.shape[1]
    first, rows = air_gap_law(machine, centre)
    more: list[tuple[str, ForceLaw, NDArray]] = [
        (f"bearings.{name}", s.law, s.rows) for name, s in supports.items() if s.law]
    if machine.shaft:
        more += [(f"cracks.{crack.name}", crack.law(machine.shaft),
                  slopes(crack.element + 1, size) - slopes(crack.element, size))
                 for crack in machine.cracks]
    placed = [Placed(first, slice(0, len(rows)))]
    for key, law, own in more:
        known = np.round(np.linalg.lstsq(rows.T, own.T, rcond=None)[0].T, 12)
        at = len(rows)
        if np.abs(own - known @ rows).max() > DEPENDENT * np.abs(own).max():
            rows = np.vstack([rows, own])
        elif machine.air_gap and known[:, :2].any():
            raise BadInput(f"{key} acts on the centre of {machine.air_gap.body}, the body in the "
                           "air gap, whose place is counted from the stator; put it at another "
                           "node, or leave out air_gap.")
        elif key.startswith("cracks"):
            raise BadInput(f"{key} is in an element that has another crack already; put a node "
                           "between the two, or leave one out.")
        else:  # what is there already
            at = int(known[0].argmax())
        placed.append(Placed(law, slice(at, at + len(own))))
    return (SeveralLaws(tuple(placed)) if more else first), rows


DEPENDENT = 1e-9  # of a row: what is left of it beyond the rows before is rounding
NO_GAP_SCALE = 1e-3  # m; length that scales unknowns where a machine has no air gap


@dataclass(frozen=True, eq=False)
class Support:
    """A radial bearing, as its force is found from a motion.

    rows: pick its (x, z) from q, (2, n). stiffness, damping: its part of K and C, (2, 2), N/m and
    N s/m. law: of its pads or its film, which takes `stiffness` back; None for a linear bearing.
    offset: how far its centre is out of line, (x, z), m.
    """

    rows: NDArray
    stiffness: NDArray
    damping: NDArray
    law: ForceLaw | None = None
    offset: NDArray = field(default_factory=lambda: np.zeros(2))

    def force(self, u: NDArray, velocity: NDArray, phase: NDArray | float = 0.0,
              speed: float = 0.0) -> NDArray:
        """Force on the shaft, N, (2, …), that is at u = rows q, m, with a velocity, m/s, (2, …)."""
        away = (u.T - self.offset).T
        linear = -np.tensordot(self.stiffness, away, 1) - np.tensordot(self.damping, velocity, 1)
        return linear + self.law.force(u, velocity, phase, speed) if self.law else linear


@dataclass(frozen=True, eq=False)
class Origin:
    """Where a model comes from: the machine, what it was assembled to, without Rayleigh damping,
    and the law, field and unbalance (times the machine's own) that the model has of it.
    """

    machine: Machine
    assembled: Model
    law: ForceLaw
    field: float = 1.0
    unbalance: float = 1.0


@dataclass(frozen=True, eq=False)
class Model:
    """A rotor as linear matrices with a force law on a few nonlinear coordinates u = S q.

    M, C, G, K: mass, damping, gyroscopic and stiffness matrices, shape (n, n), SI units.
    unbalance_sin, unbalance_cos: F₁ and F₂, kg m, shape (n,); the force is Ω² (F₁ sin Ωt + F₂ cos
    Ωt). selection: S, shape (c, n): the nonlinear coordinates from the DOFs, none of which depends
    on the others; the first two are the position (x, z) of the generator centre. law: the forces on
    those coordinates, the pull and whatever else is not linear. gap: nominal air gap, m (inf if
    there is none). depths: y of each node, m. shaft_map: maps q to the nodes' DOFs, shape (nodes ·
    DOFs per node, n). rayleigh: the coefficients (α, β) of C = αM + βK, 0 where there is no such
    damping. supports: each radial bearing by its name. origin: None for a model made by hand.
    static: force that stands still, N, shape (n,). turning: complex f₀ and f₁, shape (2, n), of the
    force Re((f₀ + iΩ f₁) e^{iΩt}) of what is bent or out of square. Both are 0 unless given.
    """

    name: str
    M: NDArray
    C: NDArray
    G: NDArray
    K: NDArray
    unbalance_sin: NDArray
    unbalance_cos: NDArray
    selection: NDArray
    law: ForceLaw
    gap: float
    depths: NDArray
    shaft_map: NDArray
    rayleigh: tuple[float, float] = (0.0, 0.0)
    supports: Mapping[str, Support] = field(default_factory=dict)
    origin: Origin | None = None
    static: NDArray = field(default_factory=lambda: np.zeros(0))
    turning: NDArray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        for name, none in (("static", np.zeros(self.size)),
                           ("turning", np.zeros((2, self.size), dtype=complex))):
            if not getattr(self, name).size:
                object.__setattr__(self, name, none)

    @property
    def size(self) -> int:
        """Number of degrees of freedom n."""
        return len(self.M)

    @property
    def length_scale(self) -> float:
        """Length that makes unknowns of order one, m: the gap, or a millimetre where there is none.
        """
        return self.gap if math.isfinite(self.gap) else NO_GAP_SCALE

    def node_at(self, place: int | float | str) -> int:
        """The node at a place along the shaft: its number, a depth in m (a float), or the name of a
        body or a bearing there.

        Raises BadInput where there is none; a depth must be that of a node to 1/1000 of the shaft.
        """
        if isinstance(place, str):
            names = self.origin.machine.places if self.origin else {}
            if place not in names:
                raise BadInput(f"no body or bearing of {self.name} is called {shown(place)}; there "
                               f"are {', '.join(names) or 'none'}.")
            return names[place]
        if isinstance(place, (float, np.floating)):
            depth = number("depth", place, unit="m")
            node = int(np.abs(self.depths - depth).argmin())
            if abs(self.depths[node] - depth) > 1e-3 * self.depths[-1]:
                raise BadInput(f"no node of {self.name} is at {depth:g} m; the nearest is node "
                               f"{node} at {self.depths[node]:.6g} m.")
            return node
        return whole("node", place, 0, len(self.depths) - 1, "or a depth in m, 4.5, or a name")

    def velocity_matrix(self, speed: float) -> NDArray:
        """C + Ω G, N s/m: the one place where damping and gyroscopic terms meet."""
        return self.C + speed * self.G

    def loads(self, speed: float) -> tuple[NDArray, NDArray]:
        """What acts on all DOFs whatever the motion at a speed (rad/s), N: the constant force,
        (n,), and the complex f of the one that turns, Re(f e^{iΩt}), (n,).
        """
        return self.static, (speed**2 * (self.unbalance_cos - 1j * self.unbalance_sin)
                             + self.turning[0] + 1j * speed * self.turning[1])

    def centre(self, static_eccentricity: float, direction: float = math.pi / 2) -> NDArray:
        """Stator centre (x_E, z_E), m, for an eccentricity given as a fraction of the gap.

        direction: gap angle of the offset, rad, from z towards x; π/2 is along x, as in the paper.
        Raises BadInput where there is no gap or the stator would touch the resting rotor.
        """
        if not (math.isfinite(static_eccentricity) and math.isfinite(direction)):
            raise BadInput(f"static_eccentricity is {static_eccentricity}, direction {direction}; "
                           "both must be finite.")
        if static_eccentricity and not math.isfinite(self.gap):
            raise BadInput(f"static_eccentricity is {static_eccentricity:g}, but {self.name} has "
                           "no air gap; use 0.")
        if abs(static_eccentricity) >= 1:
            raise BadInput(f"static_eccentricity is {static_eccentricity:g}; it is a fraction of "
                           "the gap, so it must lie between -1 and 1 (8.8 % is 0.088).")
        if not static_eccentricity:
            return np.zeros(2)
        return static_eccentricity * self.gap * np.array([math.sin(direction), math.cos(direction)])

    def relative(self, coordinates: NDArray, centre: NDArray) -> NDArray:
        """The nonlinear coordinates, (c, …), with the generator's (x, z) counted from the stator
        centre, (2, …), m.
        """
        out = coordinates.copy()
        out[:2] -= centre
        return out

    def pull(self, u: NDArray, phase: NDArray | float = 0.0, speed: float = 0.0) -> NDArray:
        """The magnetic pull alone on the generator's (x, z), N, (2, …): what the field adds.

        u: the nonlinear coordinates as the law takes them, (c, …). phase: Ωt, rad. speed: rad/s.
        """
        still = np.zeros_like(u)
        with_it, without = (law.force(u, still, phase, speed)
                            for law in (self.law, self.law.scaled(0.0)))
        return (with_it - without)[:2]

    def with_field(self, ratio: float) -> Model:
        """The same rotor with the flux density multiplied by `ratio` (0 switches the field off)."""
        law, origin = self.law.scaled(ratio**2), self.origin
        if origin and self.law is origin.law:
            origin = replace(origin, law=law, field=ratio * origin.field)
        return replace(self, law=law, origin=origin)

    def with_unbalance(self, ratio: float) -> Model:
        """The same rotor with all unbalances multiplied by `ratio`."""
        origin = self.origin and replace(self.origin, unbalance=ratio * self.origin.unbalance)
        return replace(self, unbalance_sin=ratio * self.unbalance_sin,
                       unbalance_cos=ratio * self.unbalance_cos, origin=origin)

    def on_basis(self, basis: NDArray) -> Model:
        """The model in the coordinates p of q = basis p; basis: (n, r)."""
        return replace(
            self, **{name: basis.T @ getattr(self, name) @ basis for name in "MCGK"},
            unbalance_sin=basis.T @ self.unbalance_sin, unbalance_cos=basis.T @ self.unbalance_cos,
            static=basis.T @ self.static, turning=self.turning @ basis,
            selection=self.selection @ basis, shaft_map=self.shaft_map @ basis,
            supports={name: replace(support, rows=support.rows @ basis)
                      for name, support in self.supports.items()})

    def number(self, key: str) -> tuple[float, str]:
        """A number of the machine that this model was made from, with its SI unit.

        key: dotted, as on its card: "bodies.generator.mass", "air_gap.gap", "shaft.diameter".
        Raises BadInput for a key that the machine does not have, and for a model made by hand.
        """
        return self._made().machine.number(key)

    def with_number(self, key: str, value: float) -> Model:
        """The model with another value (SI) of one number of its machine.

        What else was changed stays: the field, the unbalance, a basis, matrices, a law of one's
        own. So does the matrix of Rayleigh damping, which is a property of the machine as built.

        Raises BadInput as `number` does, for a value that its part refuses, and for a number of the
        machine's law where the model has another.
        """
        origin = self._made()
        machine = origin.machine.with_numbers({key: value})
        old, new = origin.assembled, bare(machine)
        own = self.law is not origin.law
        if own and new.law != old.law:
            raise BadInput(f"{key} is a number of the law that {self.name} had, but its law was "
                           "replaced; change that law instead.")
        if new.selection.shape != old.selection.shape:
            raise BadInput(f"{key} = {value:g} lets two laws of {self.name} act on the same place, "
                           "or sets them apart; make a new model of the machine with this value.")
        law = self.law if own else new.law.scaled(origin.field**2)
        change = replace(new, **{name: getattr(new, name) - getattr(old, name) for name in ARRAYS})
        if self.size != old.size:
            change = change.on_basis(self.shaft_map)
        size = {name: origin.unbalance if "unbalance" in name else 1.0 for name in ARRAYS}
        return replace(
            self, **{name: getattr(self, name) + size[name] * getattr(change, name)
                     for name in ARRAYS},
            law=law, gap=new.gap, depths=new.depths, supports=change.supports,
            origin=replace(origin, machine=machine, assembled=new,
                           law=origin.law if own else law))

    def _made(self) -> Origin:
        if self.origin is None:
            raise BadInput(f"{self.name} was not made from a card, so it has none of its numbers; "
                           "take a model that load_machine(…).model() returns.")
        return self.origin


ARRAYS = ("M", "C", "G", "K", "unbalance_sin", "unbalance_cos", "static", "turning", "selection")


def rigid_link(offset: float) -> NDArray:
    """Motion of a point `offset` metres below a node from the node's (x, z, θx, θz): 4 × 4, exact,
    massless.

    x_c = x − ℓ θz, z_c = z + ℓ θx, because θx = ∂z/∂y and θz = −∂x/∂y.
    """
    link = np.eye(4)
    link[0, 3], link[1, 2] = -offset, offset
    return link


def body_matrices(body: RigidBody) -> tuple[NDArray, NDArray]:
    """Mass and gyroscopic matrix, 4 × 4, of a rigid body about its own centre (Lalanne and Ferraris
    1998).
    """
    gyroscopic = np.zeros((4, 4))
    gyroscopic[2, 3], gyroscopic[3, 2] = -body.Ip, body.Ip
    return np.diag([body.mass, body.mass, body.Id, body.Id]), gyroscopic


def add_shaft(shaft: Shaft, bows: Sequence[Bow], M: NDArray, G: NDArray, K: NDArray,
              turning: NDArray) -> None:
    """Add the elements of a shaft to the matrices, and what holds its bows to their load."""
    for i, length in enumerate(np.diff(shaft.nodes)):
        both = slice(4 * i, 4 * i + 8)
        m, g, k = shaft_element(shaft.element, length, shaft.young, shaft.density, shaft.area[i],
                                shaft.second_moment[i], shaft.poisson, shaft.shear_coefficient)
        M[both, both] += m
        G[both, both] += g
        K[both, both] += k
        for bow in bows:
            turning[both] += k @ bow.shape(shaft.nodes, i)


def bare(machine: Machine) -> Model:
    """The model of a machine without its Rayleigh damping."""
    per_node = 2 if machine.shaft is None else 4
    n = per_node * machine.nodes
    M, C, G, K = (np.zeros((n, n)) for _ in range(4))
    unbalance, static, turning = np.zeros((2, n)), np.zeros(n), np.zeros((2, n), dtype=complex)
    generator = np.eye(2, n)
    if machine.shaft:
        add_shaft(machine.shaft, machine.bows, M, G, K, turning[0])
    for body in machine.bodies:
        at = slice(per_node * body.node, per_node * (body.node + 1))
        link = rigid_link(body.offset)[:, :per_node] if per_node == 4 else np.eye(4, 2)
        m, g = body_matrices(body)
        M[at, at] += link.T @ m @ link
        G[at, at] += link.T @ g @ link
        c, s = body.unbalance * math.cos(body.phase), body.unbalance * math.sin(body.phase)
        unbalance[:, at] += [[c, -s], [s, c]] @ link[:2]
        if body.name == (machine.air_gap.body if machine.air_gap else machine.bodies[0].name):
            generator = np.zeros((2, n))
            generator[:, at] = link[:2]
    if machine.gravity:  # the mass of a rigid shift across
        static += M @ np.tile(np.append(machine.gravity.field(), np.zeros(per_node - 2)),
                              machine.nodes)
    for load in machine.loads:
        at = place(load.node, per_node, n) if per_node == 2 else (
            rigid_link(load.offset)[:2] @ np.eye(n)[4 * load.node:4 * load.node + 4])
        static += load.force * towards(load.direction) @ at
    supports: dict[str, Support] = {}
    for bearing in machine.all_bearings:
        rows = place(bearing.node, per_node, n, 2 * bearing.tilts)
        stiffness, damping = bearing.matrices()
        bent = bearing.law(machine.speed)
        if bent:  # a linear bearing stands for it, and its law takes it back
            stiffness = bent.reference * np.eye(2)
        K += rows.T @ stiffness @ rows
        C += rows.T @ damping @ rows
        if isinstance(bearing, ThrustBearing):  # its collar leans as (x, z) = (−θz, θx)
            lean = bearing.out_of_square * turning_with(bearing.phase)[::-1] * [1, -1]
            turning += np.stack([stiffness @ lean, damping @ lean]) @ rows
        else:
            offset = np.array([bearing.x, bearing.z])
            static += stiffness @ offset @ rows
            supports[bearing.name] = Support(rows, stiffness, damping, bent, offset)
    law, selection = attach(machine, generator, supports)
    return Model(machine.name, M, C, G, K, unbalance[0], unbalance[1], selection, law,
                 machine.air_gap.gap if machine.air_gap else math.inf,
                 machine.shaft.nodes if machine.shaft else np.zeros(1), np.eye(n),
                 supports=supports, static=static, turning=turning)


def assemble(machine: Machine) -> Model:
    """The model of a machine; four DOFs a node (x, z, θx, θz), or two for a point mass."""
    made = bare(machine)
    C, rayleigh = made.C, (0.0, 0.0)
    if machine.damping:
        # pads count as closed; the spring that stands for a film is none
        films = [s for s in made.supports.values() if s.law and s.law.moving]
        K = made.K - sum((s.rows.T @ s.stiffness @ s.rows for s in films), np.zeros_like(made.K))
        rayleigh = rayleigh_coefficients(made.M, K, machine.damping.ratio)
        C = C + rayleigh[0] * made.M + rayleigh[1] * K
    return replace(made, C=C, rayleigh=rayleigh, origin=Origin(machine, made, made.law))
