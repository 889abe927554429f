"""Rayleigh damping from damping ratios: C = αM + βK.

Which force laws a machine's parts bring, and on which coordinates u = S q.

The first two coordinates are the (x, z) of the generator's centre; the pull's law may have more
(`air_gap_law`), and each nonlinear bearing and crack adds its own two. One plain law stays as it
is, several go side by side.

Machine → Model: matrices, the pull on its coordinates, the unbalance. No solving.

The equation of motion is Eq. (9) of Villa, Carvalho and Salomon:
M q̈ + (C + Ω G) q̇ + K q = Ω² (F₁ sin Ωt + F₂ cos Ωt) + Sᵀ F_NL(S q − centre).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from hydrolab.errors import BadInput
from hydrolab.machine.elements import shaft_element
from hydrolab.machine.gap_shape import gap_law
from hydrolab.machine.pull import (
    CircularPull,
    ForceLaw,
    LinearPull,
    Placed,
    SeveralLaws,
    TangentialPull,
    TiltedPull,
)

if TYPE_CHECKING:
    from hydrolab.machine.crack import Crack
    from hydrolab.machine.parts import Machine, RigidBody

# relative difference below which two frequencies are the pair of an isotropic rotor
DISTINCT = 1e-6


def rayleigh_coefficients(M: NDArray, K: NDArray,
                          ratios: tuple[float, float]) -> tuple[float, float]:
    """α (1/s) and β (s) that give the first and the second distinct mode at rest these damping
    ratios.

    In a mode of C = αM + βK the ratio is ζ = α/(2ω) + βω/2 (T. K. Caughey and M. E. J. O'Kelly,
    1965), so two frequencies fix both. The frequencies are those of M and K alone (speed zero). The
    two equal frequencies of an isotropic rotor count once, and rigid-body motions, ω = 0, cannot
    carry a ratio.

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
                       f"{len(omega[:1])}. "
                       "Give the bearings a damping instead.")
    first, second = omega[0], above[0]
    alpha, beta = np.linalg.solve([[1 / (2 * first), first / 2], [1 / (2 * second), second / 2]],
                                  ratios)
    return float(alpha), float(beta)


def air_gap_law(machine: Machine, centre: NDArray) -> tuple[ForceLaw, NDArray]:
    """The law of the air gap and the rows of its coordinates, (c, n).

    centre: the rows of the (x, z) of the body in the gap, (2, n). Without an air gap the law is
    zero everywhere.
    """
    air = machine.air_gap
    if air is None:
        return CircularPull(0.0, math.inf), centre
    law, rows = upright_law(machine), centre
    if air.tilt:
        law = TiltedPull(law, air.length)
        rows = np.vstack([centre, slopes(machine.body(air.body).node, centre.shape[1])])
    if air.tangential:
        across = TangentialPull(air.tangential * air.pull_stiffness, air.gap)
        law = SeveralLaws((Placed(law, slice(0, len(rows))), Placed(across, slice(0, 2))))
    return law, rows


def upright_law(machine: Machine) -> ForceLaw:
    """The pull of the air gap along the eccentricity, of a rotor that does not tilt."""
    air = machine.air_gap
    if machine.poles or machine.shapes:
        return gap_law(air.pull_stiffness, air.gap, machine.poles, machine.shapes)
    return (LinearPull if air.linear else CircularPull)(air.pull_stiffness, air.gap)


def slopes(node: int, size: int) -> NDArray:
    """Rows of the slopes (∂x/∂y, ∂z/∂y) = (−θz, θx) at a node of a shaft, (2, size)."""
    rows = np.zeros((2, size))
    rows[0, 4 * node + 3], rows[1, 4 * node + 2] = -1.0, 1.0
    return rows


def place(node: int, per_node: int, size: int) -> NDArray:
    """Rows of the (x, z) of a node, (2, size)."""
    return np.eye(size)[per_node * node:per_node * node + 2]


def crack_law(machine: Machine, crack: Crack) -> ForceLaw:
    """The law of a crack in its element."""
    shaft, i = machine.shaft, crack.element
    return crack.law(shaft.young, shaft.poisson, float(shaft.diameter[i]),
                     float(shaft.young * shaft.second_moment[i]),
                     float(np.diff(shaft.nodes)[i]))


def attach(machine: Machine, per_node: int, centre: NDArray) -> tuple[ForceLaw, NDArray]:
    """The law of a whole machine and its selection S, (c, n). centre: as in `air_gap_law`."""
    size = centre.shape[1]
    pull, rows = air_gap_law(machine, centre)
    more = [(pads.law(), place(pads.node, per_node, size)) for pads in machine.pad_bearings]
    more += [(film.law(machine.speed), place(film.node, per_node, size)) for film in machine.films]
    more += [(crack_law(machine, crack), slopes(crack.element + 1, size) - slopes(crack.element,
                                                                                  size))
             for crack in machine.cracks]
    if not more:
        return pull, rows
    placed = [Placed(pull, slice(0, len(rows)))]
    for law, own in more:
        placed.append(Placed(law, slice(len(rows), len(rows) + 2)))
        rows = np.vstack([rows, own])
    return SeveralLaws(tuple(placed)), rows


NO_GAP_SCALE = 1e-3  # m; length that scales unknowns where a machine has no air gap


@dataclass(frozen=True, eq=False)
class Model:
    """A rotor as linear matrices with a force law on a few nonlinear coordinates u = S q.

    M, C, G, K: mass, damping, gyroscopic and stiffness matrices, shape (n, n), SI units.
    unbalance_sin, unbalance_cos: F₁ and F₂, kg m, shape (n,); the force is Ω² (F₁ sin Ωt + F₂ cos
    Ωt). selection: S, shape (c, n): the nonlinear coordinates from the DOFs; the first two are the
    position (x, z) of the generator centre. law: the forces on those coordinates, the pull and
    whatever else is not linear. gap: nominal air gap, m (inf if there is none). depths: y of each
    node, m. shaft_map: maps q to the nodes' DOFs, shape (nodes · DOFs per node, n). rayleigh: the
    coefficients (α, β) of C = αM + βK, 0 where there is no such damping. supports: for each
    isotropic radial bearing, the rows that pick its (x, z) from q, shape (2, n); support_stiffness:
    its stiffness, N/m.
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
    supports: Mapping[str, NDArray] = field(default_factory=dict)
    support_stiffness: Mapping[str, float] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of degrees of freedom n."""
        return len(self.M)

    @property
    def length_scale(self) -> float:
        """Length that makes unknowns of order one, m: the gap, or a millimetre where there is none.
        """
        return self.gap if math.isfinite(self.gap) else NO_GAP_SCALE

    def velocity_matrix(self, speed: float) -> NDArray:
        """C + Ω G, N s/m: the one place where damping and gyroscopic terms meet."""
        return self.C + speed * self.G

    def centre(self, static_eccentricity: float, direction: float = math.pi / 2) -> NDArray:
        """Stator centre (x_E, z_E), m, for an eccentricity given as a fraction of the gap.

        direction: gap angle of the offset, rad, from z towards x; π/2 is along x, as in the paper.
        Raises BadInput where there is no gap or the stator would touch the resting rotor.
        """
        if not (np.isfinite(static_eccentricity) and np.isfinite(direction)):
            raise BadInput(f"static_eccentricity is {static_eccentricity}, direction {direction}; "
                           "both must be finite.")
        if static_eccentricity and not math.isfinite(self.gap):
            raise BadInput(f"static_eccentricity is {static_eccentricity:g}, but {self.name} has "
                           "no air gap; use 0.")
        if abs(static_eccentricity) >= 1:
            raise BadInput(f"static_eccentricity is {static_eccentricity:g}; it is a fraction of "
                           "the gap, so it must "
                           "lie between -1 and 1 (8.8 % is 0.088).")
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
        return replace(self, law=self.law.scaled(ratio**2))

    def with_unbalance(self, ratio: float) -> Model:
        """The same rotor with all unbalances multiplied by `ratio`."""
        return replace(self, unbalance_sin=ratio * self.unbalance_sin,
                       unbalance_cos=ratio * self.unbalance_cos)


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


def add_spring(K: NDArray, first: int, stiffness: float) -> None:
    """Add an isotropic spring, N/m, to a stiffness matrix, on the (x, z) that begin at DOF `first`.
    """
    K[[first, first + 1], [first, first + 1]] += stiffness


def assemble(machine: Machine) -> Model:
    """Assemble the model of a machine; four DOFs a node (x, z, θx, θz), or two for a point mass."""
    per_node = 2 if machine.shaft is None else 4
    n = per_node * machine.nodes
    M, C, G, K = (np.zeros((n, n)) for _ in range(4))
    unbalance_sin, unbalance_cos = np.zeros(n), np.zeros(n)
    selection = np.eye(2, n)
    supports: dict[str, NDArray] = {}
    support_stiffness: dict[str, float] = {}

    def dofs(node: int) -> slice:
        return slice(per_node * node, per_node * (node + 1))

    if shaft := machine.shaft:
        for i, length in enumerate(np.diff(shaft.nodes)):
            both = slice(4 * i, 4 * i + 8)
            m, g, k = shaft_element(shaft.element, length, shaft.young, shaft.density,
                                    shaft.area[i],
                                    shaft.second_moment[i], shaft.poisson, shaft.shear_coefficient)
            M[both, both] += m
            G[both, both] += g
            K[both, both] += k
    for body in machine.bodies:
        at = dofs(body.node)
        link = rigid_link(body.offset)[:, :per_node] if per_node == 4 else np.eye(4, 2)
        m, g = body_matrices(body)
        M[at, at] += link.T @ m @ link
        G[at, at] += link.T @ g @ link
        centre = link[:2]
        c, s = math.cos(body.phase), math.sin(body.phase)
        unbalance_sin[at] += body.unbalance * centre.T @ [c, -s]
        unbalance_cos[at] += body.unbalance * centre.T @ [s, c]
        if body.name == (machine.air_gap.body if machine.air_gap else machine.bodies[0].name):
            selection = np.zeros((2, n))
            selection[:, at] = centre
    for bearing in machine.bearings:
        xz = slice(per_node * bearing.node, per_node * bearing.node + 2)
        K[xz, xz] += bearing.stiffness
        C[xz, xz] += bearing.damping
        if np.array_equal(bearing.stiffness, bearing.stiffness[0, 0] * np.eye(2)):
            supports[bearing.name] = np.eye(n)[xz]
            support_stiffness[bearing.name] = float(bearing.stiffness[0, 0])
    for bearing in machine.thrust_bearings:
        tilt = slice(4 * bearing.node + 2, 4 * bearing.node + 4)
        K[tilt, tilt] += bearing.tilt_stiffness * np.eye(2)
    law, selection = attach(machine, per_node, selection)
    # A linear bearing stands for each nonlinear one, and its law takes it back; Rayleigh damping
    # counts pads as closed.
    for pads in machine.pad_bearings:
        add_spring(K, per_node * pads.node, pads.law().reference)
    rayleigh = rayleigh_coefficients(M, K, machine.damping.ratio) if machine.damping else (0.0, 0.0)
    C += rayleigh[0] * M + rayleigh[1] * K
    for film in machine.films:
        add_spring(K, per_node * film.node, film.law(machine.speed).reference)

    gap = machine.air_gap.gap if machine.air_gap else math.inf
    depths = machine.shaft.nodes if machine.shaft else np.zeros(1)
    return Model(machine.name, M, C, G, K, unbalance_sin, unbalance_cos, selection, law, gap,
                 depths, np.eye(n), rayleigh, supports, support_stiffness)
