"""Free motion of a model: modes at one speed, frequencies at rest, and the Campbell diagram.

A mode is q = Re(φ e^{λt}) with (λ² M + λ (C + Ω G) + K) φ = 0 (M. I. Friswell et al., Dynamics of
Rotating Machines, 2010, section 5.5). A force law such as the magnetic pull is not in K and not in
here; a bearing of pads counts as closed, and a film as the spring that stands for it in K.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq, linear_sum_assignment

from hydrolab.errors import BadInput

# |Im λ| below this fraction of the largest |λ| is zero to rounding: a double zero splits by √eps
REAL = 3e-8
EQUAL = 1e-9  # eigenvalues closer than this fraction of |λ| are double: their shapes are not unique
PLANAR = 1e-6  # whirl below this is motion along a line


class LinearModel(Protocol):
    """What this module sees of a model: M (positive definite), K and C + Ω G, each (n, n), and

    shaft_map: from the DOFs to the (x, z, θx, θz), or (x, z), of the nodes at `depths`; (nodes · 4
    or 2, n).
    """

    M: NDArray
    K: NDArray
    depths: NDArray
    shaft_map: NDArray

    def velocity_matrix(self, speed: float) -> NDArray:
        """C + Ω G."""


class Spectrum:
    """What eigenvalues λ (rad/s) of any shape say; each property has that shape."""

    eigenvalues: NDArray

    @property
    def frequencies(self) -> NDArray:
        """|Im λ|, rad/s."""
        return self.eigenvalues.imag

    @property
    def hertz(self) -> NDArray:
        """|Im λ| / 2π, Hz."""
        return self.frequencies / (2 * np.pi)

    @property
    def damping_ratios(self) -> NDArray:
        """ζ = −Re λ / |λ|; below zero the mode grows."""
        return -self.eigenvalues.real / np.abs(self.eigenvalues)


@dataclass(frozen=True, eq=False)
class Modes(Spectrum):
    """The modes of a model at one speed (rad/s), by rising frequency |Im λ|.

    eigenvalues: λ with Im λ > 0, one of each conjugate pair, rad/s, shape (m,).
    shapes: φ over the model's DOFs, complex, φᴴMφ = 1, largest entry real, shape (n, m).
    whirl: from −1 to 1, shape (m,): 1 is a circle from z to x (with a positive spin), e^{+iΩt} in z
    + ix; −1 a circle the other way; 0 a line. 0 also for a double eigenvalue, whose shapes are not
    unique. real_eigenvalues: λ without oscillation, ascending: overdamped and rigid-body motions (0
    to rounding); one above zero is a rotor that leaves its place without oscillating.
    """

    speed: float
    eigenvalues: NDArray
    shapes: NDArray
    whirl: NDArray
    real_eigenvalues: NDArray

    def __len__(self) -> int:
        return len(self.eigenvalues)

    @property
    def direction(self) -> tuple[str, ...]:
        """Per mode "forward" (with the spin; at rest, from z to x), "backward" or "planar"."""
        sense = self.whirl if self.speed >= 0 else -self.whirl
        return tuple("planar" if abs(w) < PLANAR else "forward" if w > 0 else "backward"
                     for w in sense)

    def __str__(self) -> str:
        rows = [f"{f:10.3f} Hz  {d:8s}  damping ratio {100 * r:6.2f} %"
                for f, d, r in zip(self.hertz, self.direction, self.damping_ratios, strict=True)]
        return "\n".join([f"{len(self)} modes at {self.speed * 30 / np.pi:g} rpm", *rows])


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


def modes(model: LinearModel, speed: float = 0.0) -> Modes:
    """All modes of the model at a speed (rad/s), by a first-order form in mass-scaled coordinates.

    Raises BadInput if the speed is not finite or M is not positive definite.
    """
    if not math.isfinite(speed):
        raise BadInput(f"speed is {speed}; it must be a finite number of rad/s.")
    R, K, D = mass_scaled(model.M, model.K, model.velocity_matrix(speed))
    n = len(K)
    fastest = math.sqrt(np.linalg.norm(K, 2)) or 1.0  # puts positions and velocities on one scale
    values, vectors = np.linalg.eig(np.block([[np.zeros((n, n)), fastest * np.eye(n)],
                                              [-K / fastest, -D]]))

    oscillating = np.abs(values.imag) > REAL * np.abs(values).max()
    order = np.flatnonzero(oscillating & (values.imag > 0))
    order = order[np.argsort(values[order].imag, kind="stable")]
    eigenvalues = values[order]
    scaled = vectors[:n, order]
    shapes = scipy.linalg.solve_triangular(R, scaled / np.linalg.norm(scaled, axis=0))
    largest = shapes[np.abs(shapes).argmax(axis=0), np.arange(len(order))]
    shapes = shapes * (np.abs(largest) / largest)
    per_node = len(model.shaft_map) // len(model.depths)
    whirl = whirl_of(*((model.shaft_map @ shapes)[dof::per_node] for dof in range(per_node)))
    whirl[_double(eigenvalues).sum(axis=1) > 1] = 0.0
    return Modes(speed, eigenvalues, shapes, whirl, np.sort(values[~oscillating].real))


def whirl_of(x: NDArray, z: NDArray, tilt_x: ArrayLike = 0.0, tilt_z: ArrayLike = 0.0) -> NDArray:
    """Sense of rotation, from −1 to 1, of complex amplitudes x, z, θx, θz, each (nodes, m); shape
    (m,).

    z + ix = ½(Z + iX) e^{iωt} + ½(Z̄ + iX̄) e^{−iωt}; the number is the first square less the
    second, over their sum, each added up over the nodes. Where the nodes only tilt, the axis turns
    as (−θz, θx) in (x, z).
    """
    still = (np.abs(x) + np.abs(z)).max(axis=0) < 1e-9 * np.max(np.abs(tilt_x) + np.abs(tilt_z),
                                                                axis=0, initial=0)
    x, z = np.where(still, -np.asarray(tilt_z), x), np.where(still, tilt_x, z)
    forward, backward = (np.abs(z + 1j * x) ** 2).sum(axis=0), (np.abs(z - 1j * x) ** 2).sum(axis=0)
    return (forward - backward) / (forward + backward)


def _double(eigenvalues: NDArray) -> NDArray:
    """Which eigenvalues are equal to which, to rounding; shape (m, m), true on the diagonal."""
    return np.abs(eigenvalues[:, None] - eigenvalues) <= EQUAL * np.abs(eigenvalues)[:, None]


def undamped_frequencies(model: LinearModel) -> NDArray:
    """Frequencies at rest without damping, ω of K φ = ω² M φ, rad/s, ascending, (n,); 0 for rigid
    motions.

    Raises BadInput if K is not symmetric or has a negative eigenvalue.
    """
    K = model.K
    if not np.allclose(K, K.T, rtol=0, atol=1e-9 * np.abs(K).max()):
        raise BadInput("the stiffness matrix is not symmetric (a bearing with cross-coupling); use "
                       "`modes`.")
    squares = scipy.linalg.eigh(K, model.M, eigvals_only=True)
    rounding = 10 * len(K) * np.finfo(float).eps * np.abs(squares).max()
    if squares[0] < -rounding:
        raise BadInput(f"the stiffness matrix has a negative eigenvalue, ω² = {squares[0]:g} "
                       "(rad/s)²: "
                       "the rotor is unstable at rest; use `modes`.")
    return np.sqrt(np.where(squares > rounding, squares, 0.0))


@dataclass(frozen=True, eq=False)
class Campbell(Spectrum):
    """Modes followed over the speed.

    speeds: rad/s, shape (s,). eigenvalues: λ of each branch, rad/s, shape (s, b), NaN where a mode
    stops oscillating. whirl: as in `Modes`, shape (s, b). order: the excitation line is |Im λ| =
    order · |Ω|. critical_speeds: where branches cross that line, rad/s, ascending, shape (c,).
    critical_branches: the branch that crosses there, shape (c,).
    """

    speeds: NDArray
    eigenvalues: NDArray
    whirl: NDArray
    order: float
    critical_speeds: NDArray
    critical_branches: NDArray

    def __str__(self) -> str:
        first, last, *critical = (f"{w * 30 / np.pi:.4g}"
                                  for w in (self.speeds[0], self.speeds[-1], *self.critical_speeds))
        return (f"{self.eigenvalues.shape[1]} modes from {first} to {last} rpm; critical speeds of "
                f"{self.order:g}X: "
                f"{', '.join(critical) or 'none'}{' rpm' if critical else ''}.")


def campbell(model: LinearModel, speeds: Sequence[float] | ArrayLike, branches: int = 8,
             order: float = 1.0) -> Campbell:
    """Follow the lowest `branches` modes over ascending speeds (rad/s) and find the critical
    speeds.

    A mode is recognised by its shape (MAC: R. J. Allemang and D. L. Brown, 1982, with the mass
    matrix) and by the continuity of λ; where the shape is in doubt the step is halved. order: 1 is
    the 1X line.

    Raises BadInput if there are fewer than two speeds or they do not ascend.
    """
    speeds = np.asarray(speeds, dtype=float)
    if speeds.ndim != 1 or len(speeds) < 2 or not np.isfinite(speeds).all() or (np.diff(speeds)
                                                                                <= 0).any():
        raise BadInput("speeds must be two or more ascending numbers in rad/s, for example "
                       "np.linspace(0, 50, 26).")
    # Start just beside the first speed, because the pairs of an isotropic rotor are double at rest.
    start = modes(model, speeds[0] + 1e-3 * (speeds[1] - speeds[0]))
    lowest = start.eigenvalues[:branches]
    path = [_Followed(start.speed, lowest, lowest, start.shapes[:, :branches],
                      start.whirl[:branches])]
    for speed in speeds:
        path.append(_follow(model, path[-1], speed))
    del path[0]
    eigenvalues = np.array([p.eigenvalues for p in path])

    def above_line(speed: float, before: _Followed, branch: int) -> float:
        return _follow(model, before, speed).eigenvalues[branch].imag - order * abs(speed)

    gap = eigenvalues.imag - order * np.abs(speeds)[:, None]
    crossings = [(brentq(above_line, speeds[i], speeds[i + 1], args=(path[i], b),
                         xtol=1e-10 * np.ptp(speeds)), b)
                 for i, b in np.argwhere((gap[:-1] * gap[1:] < 0) | (gap[:-1] == 0))]
    crossings.sort()
    return Campbell(speeds, eigenvalues, np.array([p.whirl for p in path]), order,
                    np.array([c for c, _ in crossings]),
                    np.array([b for _, b in crossings], dtype=int))


class _Followed(NamedTuple):
    """Branches at one speed: λ (NaN where lost), the last known λ and shape of each, and the whirl.
    """

    speed: float
    eigenvalues: NDArray
    last: NDArray
    shapes: NDArray
    whirl: NDArray


def _follow(model: LinearModel, known: _Followed, speed: float, halvings: int = 6) -> _Followed:
    """The same branches at another speed."""
    found = modes(model, speed)
    count = len(known.last)
    mac = np.abs(known.shapes.conj().T @ model.M @ found.shapes) ** 2
    double = _double(found.eigenvalues)
    mac = np.minimum(mac @ double, 1.0)  # a double eigenvalue has a plane of shapes, not a shape
    jump = np.abs(found.eigenvalues - known.last[:, None]) / np.abs(known.last)[:, None]
    row, column = linear_sum_assignment(1 - mac + jump)
    sure = mac[row, column] if len(row) == count else np.zeros(count)
    if sure.min(initial=1.0) < 0.6 and halvings:
        middle = _follow(model, known, (known.speed + speed) / 2, halvings - 1)
        return _follow(model, middle, speed, halvings - 1)

    eigenvalues, whirl = np.full(count, complex(np.nan, np.nan)), np.zeros(count)
    last, shapes = known.last.copy(), known.shapes.copy()
    for b, j in zip(row, column, strict=True):
        if mac[b, j] < 0.2:
            continue  # the mode has stopped oscillating
        eigenvalues[b] = last[b] = found.eigenvalues[j]
        whirl[b] = found.whirl[j]
        if double[j].sum() == 1:
            shapes[:, b] = found.shapes[:, j]
    return _Followed(speed, eigenvalues, last, shapes, whirl)
