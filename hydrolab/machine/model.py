"""Machine → Model: matrices, the force laws on their coordinates, the unbalance. No solving.

The equation of motion is Eq. (9) of Villa, Carvalho and Salomon:
M q̈ + (C + Ω G) q̇ + K q = Ω² (F₁ sin Ωt + F₂ cos Ωt) + Sᵀ F_NL(S q − centre),
with the loads of `hydrolab.machine.loads` beside the unbalance.

The first two of the nonlinear coordinates u = S q are the (x, z) of the generator's centre; the
pull may have more (`air_gap_law`), and each nonlinear bearing and crack adds its own two. One plain
law stays as it is, several go side by side.

Here M, G, K: matrices, (size, size). per_node: DOFs of one. phase: Ωt, rad. speed: rad/s.
static_eccentricity: a fraction of the gap. key: of a number of the card.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from hydrolab.errors import BadInput
from hydrolab.machine.bearings import Bearing, Guide, TableBearing, ThrustBearing
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
    from hydrolab.machine.loads import Bow, Load
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

    M, K: mass and stiffness, (n, n), M positive definite; of K the symmetric part counts, since
    what a seal or a film drives across is no spring. ratios: (ζ₁, ζ₂), fractions of critical.

    Raises BadInput if it has fewer than two distinct frequencies above zero.
    """
    squares = scipy.linalg.eigvalsh((K + K.T) / 2, M)
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
    offset: how far its centre is out of line, (x, z), m. table: gives stiffness and damping at a
    speed, rad/s, where they change with it.
    """

    rows: NDArray
    stiffness: NDArray
    damping: NDArray
    law: ForceLaw | None = None
    offset: NDArray = field(default_factory=lambda: np.zeros(2))
    table: Callable[[float], tuple[NDArray, NDArray]] | None = None

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
    there is none). depths: y of each node, m. shaft_map: maps q to the nodes' DOFs and after them
    (x, z) of each bracket, shape (nodes · DOFs per node + 2 · brackets, n). rayleigh: the
    coefficients (α, β) of C = αM + βK, 0 where there is no such damping. supports: each radial
    bearing by its name. origin: None for a model made by hand.
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

    def at_nodes(self, motion: NDArray) -> NDArray:
        """Motion of all DOFs, (n, …), as that of the nodes, (nodes, DOFs per node, …)."""
        count, dofs = len(self.depths), self.shaft_map @ motion
        per_node = min(4, len(dofs) // count)
        return dofs[:per_node * count].reshape(count, per_node, *dofs.shape[1:])

    @property
    def known_speeds(self) -> tuple[float, float]:
        """The speeds from which and up to which the tables of all its bearings go, rad/s."""
        tables = self.origin.machine.tables if self.origin else ()
        return (max((float(t.speeds[0]) for t in tables), default=0.0),
                min((float(t.speeds[-1]) for t in tables), default=math.inf))

    def at(self, speed: float) -> Model:
        """The model with its bearings as they are at a speed (rad/s); itself where none changes.

        Raises BadInput beyond the ends of a bearing's table.
        """
        if not any(support.table for support in self.supports.values()):
            return self
        K, C, static, supports = self.K.copy(), self.C.copy(), self.static.copy(), {}
        for name, s in self.supports.items():
            supports[name] = s
            if s.table:
                k, c = s.table(speed)
                K += s.rows.T @ (k - s.stiffness) @ s.rows
                C += s.rows.T @ (c - s.damping) @ s.rows
                static += (k - s.stiffness) @ s.offset @ s.rows
                supports[name] = replace(s, stiffness=k, damping=c)
        return replace(self, K=K, C=C, static=static, supports=supports)

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
        """The nonlinear coordinates, (c, …), with (x, z) from the stator centre, (2, …), m."""
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
        self = self.at(origin.machine.speed)  # its bearings as they were when it was assembled
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
            origin=replace(origin, machine=machine, assembled=new, law=origin.law if own else law))

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
    """Mass and gyroscopic matrix, 4 × 4, of a body about its centre (Lalanne and Ferraris 1998)."""
    gyroscopic = np.zeros((4, 4))
    gyroscopic[2, 3], gyroscopic[3, 2] = -body.Ip, body.Ip
    return np.diag([body.mass, body.mass, body.Id, body.Id]), gyroscopic


class Sums:
    """The matrices and loads of a model while its parts are added."""

    def __init__(self, size: int) -> None:
        self.M, self.C, self.G, self.K = (np.zeros((size, size)) for _ in range(4))
        self.unbalance, self.static = np.zeros((2, size)), np.zeros(size)
        self.turning = np.zeros((2, size), dtype=complex)

    def add_shaft(self, shaft: Shaft, bows: Sequence[Bow]) -> None:
        """The elements of a shaft, and what holds its bows to their load."""
        for i in range(len(shaft.nodes) - 1):
            both = slice(4 * i, 4 * i + 8)
            m, g, k = shaft.element_matrices(i)
            self.M[both, both] += m
            self.G[both, both] += g
            self.K[both, both] += k
            for bow in bows:
                self.turning[0, both] += k @ bow.shape(shaft.nodes, i)

    def add_body(self, body: RigidBody, at: slice, link: NDArray) -> None:
        """A body at the DOFs of its node, through its link, and its unbalance."""
        m, g = body_matrices(body)
        self.M[at, at] += link.T @ m @ link
        self.G[at, at] += link.T @ g @ link
        c, s = body.unbalance * math.cos(body.phase), body.unbalance * math.sin(body.phase)
        self.unbalance[:, at] += [[c, -s], [s, c]] @ link[:2]

    def add_bearing(self, bearing: Bearing, rows: NDArray, speed: float) -> Support | None:
        """A bearing on what its rows pick, and how it is found again, unless it acts on tilt."""
        stiffness, damping = bearing.matrices(speed)
        bent = bearing.law(speed)
        if bent:  # a linear bearing stands for it, and its law takes it back
            stiffness = bent.reference * np.eye(2)
        self.K += rows.T @ stiffness @ rows
        self.C += rows.T @ damping @ rows
        if isinstance(bearing, ThrustBearing):  # its collar leans as (x, z) = (−θz, θx)
            lean = bearing.out_of_square * turning_with(bearing.phase)[::-1] * [1, -1]
            self.turning += np.stack([stiffness @ lean, damping @ lean]) @ rows
        if not isinstance(bearing, Guide):
            return None
        offset = np.array([bearing.x, bearing.z])
        self.static += stiffness @ offset @ rows
        self.M += bearing.fluid_mass * rows.T @ rows
        table = bearing.matrices if isinstance(bearing, TableBearing) else None
        return Support(rows, stiffness, damping, bent, offset, table)

    def add_bracket(self, bearing: Guide, own: NDArray) -> None:
        """The bracket of a bearing; own: the rows of its (x, z), (2, n)."""
        self.M += bearing.bracket_mass * own.T @ own
        self.C += own.T @ bearing.bracket_damping @ own
        self.K += own.T @ bearing.bracket_stiffness @ own


def add_hung(sums: Sums, machine: Machine, per_node: int) -> NDArray:
    """Add what hangs on nodes: bodies, the weight of all, water and loads. Returns the rows of the
    (x, z) of the body in the gap, or of the first one, (2, n).
    """
    centre = np.eye(2, len(sums.M))
    home = machine.air_gap.body if machine.air_gap else next((b.name for b in machine.bodies), "")

    def at(part: RigidBody | Load) -> tuple[slice, NDArray]:
        """The DOFs of its node, and the way from there to its place, (4, DOFs per node)."""
        link = rigid_link(part.offset) if per_node == 4 else np.eye(4, 2)
        return slice(per_node * part.node, per_node * (part.node + 1)), link

    for body in machine.bodies:
        sums.add_body(body, *at(body))
        if body.name == home:
            there, link = at(body)
            centre = link[:2] @ np.eye(len(sums.M))[there]
    if machine.gravity:  # the mass of a rigid shift across
        shift = np.append(machine.gravity.field(), np.zeros(per_node - 2))
        sums.static += sums.M[:, :per_node * machine.nodes] @ np.tile(shift, machine.nodes)
    for body in machine.bodies:  # water is moved, not carried
        there, link = at(body)
        water = np.diag([body.added_mass, body.added_mass, body.added_Id, body.added_Id])
        sums.M[there, there] += link.T @ water @ link
    for load in machine.loads:
        there, link = at(load)
        sums.static[there] += load.force * towards(load.direction) @ link[:2]
    return centre


def bare(machine: Machine) -> Model:
    """The model of a machine without its Rayleigh damping."""
    per_node = 2 if machine.shaft is None else 4
    brackets = [b for b in machine.all_bearings if isinstance(b, Guide) and b.has_bracket]
    one = np.eye(per_node * machine.nodes + 2 * len(brackets))
    sums, supports = Sums(len(one)), {}
    if machine.shaft:
        sums.add_shaft(machine.shaft, machine.bows)
    centre = add_hung(sums, machine, per_node)
    stands = {b.name: own for b, own in zip(
        brackets, one[per_node * machine.nodes:].reshape(-1, 2, len(one)), strict=True)}
    for bracket in brackets:
        sums.add_bracket(bracket, stands[bracket.name])
    for bearing in machine.all_bearings:
        first = per_node * bearing.node + 2 * bearing.tilts
        rows = one[first:first + 2] - stands.get(bearing.name, 0.0)
        if support := sums.add_bearing(bearing, rows, machine.speed):
            supports[bearing.name] = support
    law, selection = attach(machine, centre, supports)
    return Model(machine.name, sums.M, sums.C, sums.G, sums.K, sums.unbalance[0],
                 sums.unbalance[1], selection, law,
                 machine.air_gap.gap if machine.air_gap else math.inf,
                 machine.shaft.nodes if machine.shaft else np.zeros(1), one,
                 supports=supports, static=sums.static, turning=sums.turning)


def assemble(machine: Machine) -> Model:
    """The model of a machine; four DOFs a node (x, z, θx, θz), or two for a point mass."""
    made = bare(machine)
    C, rayleigh = made.C, (0.0, 0.0)
    if machine.damping:
        # pads count as closed; the spring that stands for a film is none
        films = [s for s in made.supports.values() if s.law and s.law.moving]
        K = made.K - sum((s.rows.T @ s.stiffness @ s.rows for s in films), np.zeros_like(made.K))
        K = (K + K.T) / 2
        rayleigh = rayleigh_coefficients(made.M, K, machine.damping.ratio)
        C = C + rayleigh[0] * made.M + rayleigh[1] * K
    return replace(made, C=C, rayleigh=rayleigh, origin=Origin(machine, made, made.law))
