"""Free motion of a model: modes at one speed, at rest, critical speeds and Campbell diagrams.

A mode is q = Re(φ e^{λt}) with (λ² M + λ (C + Ω G) + K) φ = 0 (M. I. Friswell et al., Dynamics of
Rotating Machines, 2010, section 5.5). A force law such as the magnetic pull is not in K: a bearing
of pads counts as closed, and a film as the spring that stands for it. Where `pull` is an argument,
the mean slope of all laws can be taken into K and C, and what is printed says whether it is.

tilt_x, tilt_z: θx and θz.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.winding import mass_scaled, mean_slopes, with_slopes
from hydrolab.errors import BadInput
from hydrolab.machine.model import Model
from hydrolab.machine.quantities import require_model, whole

# |Im λ| below this fraction of the largest |λ| is zero to rounding: a double zero splits by √eps
REAL = 3e-8
EQUAL = 1e-9  # eigenvalues closer than this fraction of |λ| are double: their shapes are not unique
PLANAR = 1e-6  # whirl below this is motion along a line
PEAK = 1 / math.sqrt(2)  # a damping ratio above which a resonance has no peak
LOST = 0.99  # a damping ratio above which a mode is not recognised any more
MEETINGS = 40  # steps in which a critical speed of bearings that change with it is found
SHOWN = 6  # critical speeds of one direction that are printed
# of the rated speed: overspeed after load rejection, and runaway of a Kaplan turbine, the highest
OVERSPEED, RUNAWAY = 1.4, 2.5


def senses(whirl: NDArray) -> tuple[str, ...]:
    """"forward", "backward" or "planar" for each number from −1 to 1."""
    return tuple("planar" if abs(w) < PLANAR else "forward" if w > 0 else "backward" for w in whirl)


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
        return senses(self.whirl if self.speed >= 0 else -self.whirl)

    def __str__(self) -> str:
        rows = [f"{f:10.3f} Hz  {d:8s}  damping ratio {100 * r:6.2f} %"
                for f, d, r in zip(self.hertz, self.direction, self.damping_ratios, strict=True)
                if r < PEAK]
        rest = len(self) - len(rows)
        if rest:
            rows.append(f"{rest} more hardly oscillate, damping ratio above {100 * PEAK:.0f} %")
        return "\n".join([f"{len(self)} modes at {self.speed * 30 / np.pi:g} rpm", *rows])


def modes(model: Model, speed: float = 0.0) -> Modes:
    """All modes of the model at a speed (rad/s), by a first-order form in mass-scaled coordinates.

    Raises BadInput if the speed is not finite or M is not positive definite.
    """
    require_model(model)
    if not math.isfinite(speed):
        raise BadInput(f"speed is {speed}; it must be a finite number of rad/s.")
    model = model.at(abs(speed))
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
    whirl = _whirl(model, shapes)
    whirl[_double(eigenvalues).sum(axis=1) > 1] = 0.0
    return Modes(speed, eigenvalues, shapes, whirl, np.sort(values[~oscillating].real))


def _whirl(model: Model, shapes: NDArray) -> NDArray:
    count, moved = len(model.depths), model.shaft_map @ shapes
    per_node = min(4, len(moved) // count)  # brackets come after the nodes
    return whirl_of(*(moved[dof:count * per_node:per_node] for dof in range(per_node)))


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


def undamped_frequencies(model: Model) -> NDArray:
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
                       "(rad/s)²: the rotor is unstable at rest; use `modes`.")
    return np.sqrt(np.where(squares > rounding, squares, 0.0))


def _under(model: Any, pull: bool | PeriodicOrbit) -> tuple[Any, str]:
    """The model with the mean slope of its force laws in K and C, and words for what was done.

    Raises BadInput for a force that depends on velocity, phase or speed where there is no orbit.
    """
    if pull is False:
        return model, "without the magnetic pull"
    if isinstance(pull, PeriodicOrbit):
        return (with_slopes(model, *mean_slopes(pull)),
                "with the mean slope of the forces on an orbit")
    if model.law.moving:
        raise BadInput("pull is True, but a force depends on velocity, phase or speed; give the "
                       "steady state whose mean slope is meant, pull=orbit.")
    return (with_slopes(model, model.law.linearise(np.zeros(len(model.selection)))[1]),
            "with the slope of the forces at rest in the middle")


@dataclass(frozen=True, eq=False)
class CriticalSpeeds:
    """Speeds at which the rotor moves freely in step with its rotation, ascending.

    speeds: rad/s, (m,). damping_ratios: there, (m,). whirl: as in `Modes`, (m,). shapes: over the
    model's DOFs, complex, (n, m). order: the free motion has `order` times the frequency of the
    rotation. forces: in words, whether the magnetic pull is in it. marks: speeds to keep away from,
    by their names, rad/s.
    """

    speeds: NDArray
    damping_ratios: NDArray
    whirl: NDArray
    shapes: NDArray
    order: float
    forces: str
    marks: Mapping[str, float]

    def __len__(self) -> int:
        return len(self.speeds)

    @property
    def direction(self) -> tuple[str, ...]:
        """"forward", "backward" or "planar" for each."""
        return senses(self.whirl)

    def of(self, direction: str) -> NDArray:
        """The speeds of one direction, rad/s."""
        return self.speeds[np.array(self.direction, dtype=object) == direction]

    def _such(self, direction: str) -> NDArray:
        return np.sort(np.concatenate([self.of(direction), self.of("planar")]))

    def margin(self, speed: float, direction: str = "") -> float:
        """How far the nearest critical speed, of one direction or planar where one is given, is
        from a speed (rad/s), as a fraction of it: below zero where it lies below, inf for none.
        """
        away = (self._such(direction) if direction else self.speeds) / speed - 1
        return float(away[np.abs(away).argmin()]) if len(away) else math.inf

    def __str__(self) -> str:
        rows = [f"Critical speeds of {self.order:g}X, {self.forces}:"]
        for way in ("forward", "backward", "planar"):
            own = [f"{s * 30 / np.pi:.1f} rpm (damping ratio {round(100 * r, 1) + 0.0} %)"
                   for s, r, d in zip(self.speeds, self.damping_ratios, self.direction, strict=True)
                   if d == way]
            if own or way != "planar":
                rows.append(f"{way}: {', '.join(own[:SHOWN]) or 'none'}"
                            + f" and {len(own) - SHOWN} more" * (len(own) > SHOWN))
        for name, speed in self.marks.items():
            if len(self):
                margin = self.margin(speed)
                rows.append(f"{name} {speed * 30 / np.pi:.1f} rpm: the nearest is "
                            f"{100 * abs(margin):.0f} % {'above' if margin > 0 else 'below'}")
        return "\n".join(rows)


@threadpool_limits.wrap(limits=1)
def critical_speeds(model: Model, *, pull: bool | PeriodicOrbit = False, order: float = 1.0,
                    rated: float | None = None, overspeed: float | None = None,
                    runaway: float | None = None) -> CriticalSpeeds:
    """Critical speeds, directly: (K + inΩ C + Ω² (inG − n² M)) φ = 0 for complex Ω, n the order.

    Without damping Ω is real: K φ = Ω² (n² M − inG) φ. With damping the speed is |Ω|, which is
    that of the undamped machine to first order and lies next to the peak of the response, and the
    damping ratio is Im Ω/|Ω|. What has no peak, a damping ratio above 1/√2, is left out.

    pull: False leaves the force laws out; True takes their slope at rest in the middle of the gap;
    a steady state takes their mean slope along it. Asymmetric bearings, seals and slopes are
    exact; bearings of tables are as they are at each speed found. rated, overspeed, runaway: speeds
    (rad/s) whose margins are printed; where only the rated one is given, 1.4 and 2.5 times that.

    Raises BadInput where the machine can move freely, or for what is no model.
    """
    require_model(model)
    there, forces = _under(model, pull)
    n = float(order)
    speeds, ratios, shapes = _free(there, n)
    low, high = model.known_speeds
    if math.isfinite(high):
        speeds, ratios, shapes = _met(lambda w: _free(_under(model.at(w), pull)[0], n),
                                      there.M, low, high)
        forces += (f", between {low * 30 / np.pi:.4g} and {high * 30 / np.pi:.4g} rpm, where the "
                   "tables of its bearings go")
    marks = {"rated speed": rated, "overspeed": overspeed or (rated and OVERSPEED * rated),
             "runaway speed": runaway or (rated and RUNAWAY * rated)}
    return CriticalSpeeds(speeds, ratios, _whirl(model, shapes), shapes, n, forces,
                          {name: float(s) for name, s in marks.items() if s})


@dataclass(frozen=True, eq=False)
class SpeedMargins:
    """Critical speeds with the field off and on; prints as a table with the margins of each."""

    off: CriticalSpeeds
    on: CriticalSpeeds

    def __str__(self) -> str:
        ways, both = ("forward", "backward"), (self.off, self.on)
        rows = [("critical speeds of 1X, rpm", *(f"{w}, {field}" for field in (
            "field off", "field on") for w in ways))]
        columns = [c._such(way) * 30 / np.pi for c in both for way in ways]
        for i in range(min(SHOWN, max(map(len, columns)))):
            rows.append((f"{i + 1}", *(f"{c[i]:.1f}" if i < len(c) else "" for c in columns)))
        for name, speed in self.on.marks.items():
            margins = [100 * c.margin(speed, way) for c in both for way in ways]
            rows.append((f"nearest to {name}, {speed * 30 / np.pi:.1f}", *(
                f"{m:+.0f} %" if math.isfinite(m) else "none" for m in margins)))
        return "\n".join(f"{row[0]:36}" + "".join(f"{cell:>21}" for cell in row[1:])
                         for row in rows)


def speed_margins(model: Any, *, rated: float | None = None, overspeed: float | None = None,
                  runaway: float | None = None) -> SpeedMargins:
    """Critical speeds of a model without and with the field, beside speeds to keep from, rad/s.

    rated: by default that of its machine; overspeed, runaway: as for `critical_speeds`. Of forces
    other than the pull of a round gap the mean slope along the steady state at the rated speed
    counts. Raises BadInput where no rated speed is known, and what `HarmonicBalance.solve` raises.
    """
    require_model(model)
    rated = rated or (model.origin and model.origin.machine.speed)
    if not rated:
        raise BadInput(f"rated is {rated}, and {model.name} was not made from a card that states a "
                       "speed; give one in rad/s.")
    pulls: list[bool | PeriodicOrbit] = [False, True]
    if not model.law.closed_form:
        pulls = [HarmonicBalance(4).solve(model.with_field(f), rated) for f in (0.0, 1.0)]
    return SpeedMargins(*(critical_speeds(model, pull=pull, rated=rated, overspeed=overspeed,
                                          runaway=runaway) for pull in pulls))


def _free(there: Any, n: float) -> tuple[NDArray, NDArray, NDArray]:
    """Critical speeds of order n of constant matrices, ascending; damping ratios and shapes."""
    size = len(there.K)
    if not np.linalg.cond(there.K, 1) < 1 / np.finfo(float).eps:
        raise BadInput("the machine can move freely, so it has no critical speeds; give it "
                       "bearings.")
    flexible = np.linalg.inv(there.K)
    C, G = there.velocity_matrix(0.0), there.velocity_matrix(1.0) - there.velocity_matrix(0.0)
    values, vectors = np.linalg.eig(np.block([
        [-1j * n * flexible @ C, flexible @ (n * n * there.M - 1j * n * G)],
        [np.eye(size), np.zeros((size, size))]]))
    with np.errstate(divide="ignore", invalid="ignore"):
        speeds = 1 / values
    ratios = speeds.imag / np.abs(speeds)
    keep = np.flatnonzero((speeds.real > 0) & (np.abs(ratios) < PEAK))
    keep = keep[np.argsort(np.abs(speeds[keep]))]
    shapes = vectors[size:, keep]
    return np.abs(speeds[keep]), ratios[keep], shapes / np.sqrt(
        np.einsum("im,ij,jm->m", shapes.conj(), there.M, shapes).real)


def _met(free: Callable[[float], tuple[NDArray, NDArray, NDArray]], M: NDArray, low: float,
         high: float) -> tuple[NDArray, NDArray, NDArray]:
    """As `free`: speeds w from low to high that are critical for the machine as it is at w."""
    found: list[tuple[float, float, NDArray]] = []
    for start in np.linspace(low, high, 3):
        speeds, ratios, shapes = free(float(start))
        for j in np.flatnonzero(speeds <= 2 * high):
            speed, ratio, shape = float(np.clip(speeds[j], low, high)), ratios[j], shapes[:, j]
            for _ in range(MEETINGS):
                speeds_there, ratios_there, shapes_there = free(speed)
                i = int(np.abs(shapes_there.conj().T @ M @ shape).argmax())
                last, speed = speed, float(speeds_there[i])
                ratio, shape = ratios_there[i], shapes_there[:, i]
                if not low <= speed <= high or abs(speed - last) <= EQUAL * speed:
                    break
            else:
                continue
            known = any(abs(speed - s) < 1e-6 * s and abs(shape.conj() @ M @ other) > 0.5
                        for s, _, other in found)
            if low <= speed <= high and not known:
                found.append((speed, float(ratio), shape))
    found.sort(key=lambda one: one[0])
    return (np.array([one[0] for one in found]), np.array([one[1] for one in found]),
            np.array([one[2] for one in found]).reshape(len(found), len(M)).T)


@dataclass(frozen=True, eq=False)
class Campbell(Spectrum):
    """Modes followed over the speed.

    speeds: rad/s, shape (s,). eigenvalues: λ of each branch, rad/s, shape (s, b), NaN where a mode
    stops oscillating. whirl: as in `Modes`, shape (s, b). critical: the critical speeds, of which
    those on the diagram are `critical_speeds`, rad/s, ascending, shape (c,), where the line |Im λ|
    = order · |Ω| meets the branches `critical_branches`, (c,), −1 for one that is not followed.
    """

    speeds: NDArray
    eigenvalues: NDArray
    whirl: NDArray
    critical: CriticalSpeeds
    critical_speeds: NDArray
    critical_branches: NDArray

    @property
    def order(self) -> float:
        """Of the excitation line."""
        return self.critical.order

    def __str__(self) -> str:
        first, last = (f"{w * 30 / np.pi:.4g}" for w in self.speeds[[0, -1]])
        said = []
        for way in ("forward", "backward", "planar"):
            own = [f"{s * 30 / np.pi:.4g}" for s in self.critical.of(way)
                   if s in np.abs(self.critical_speeds)]
            if own:
                said.append(f"{way} {', '.join(own)} rpm")
        return (f"{self.eigenvalues.shape[1]} modes from {first} to {last} rpm, "
                f"{self.critical.forces}; critical speeds of {self.order:g}X: "
                f"{'; '.join(said) or 'none'}.")


@threadpool_limits.wrap(limits=1)  # small matrices: two threads are many times slower
def campbell(model: Model, speeds: Sequence[float] | ArrayLike, branches: int = 8,
             order: float = 1.0, *, pull: bool | PeriodicOrbit = False) -> Campbell:
    """Follow the lowest `branches` modes over ascending speeds (rad/s) and find the critical
    speeds.

    A mode is recognised by its shape (MAC: R. J. Allemang and D. L. Brown, 1982, with the mass
    matrix) and by the continuity of λ; where the shape is in doubt the step is halved. Modes with a
    damping ratio above 1/√2 are left out. order: 1 is the 1X line. pull: as in `critical_speeds`.

    Raises BadInput if there are fewer than two speeds or they do not ascend, for fewer than one
    branch, or for what is no model.
    """
    require_model(model)
    whole("branches", branches, 1)
    speeds = np.asarray(speeds, dtype=float)
    if speeds.ndim != 1 or len(speeds) < 2 or not np.isfinite(speeds).all() or (np.diff(speeds)
                                                                                <= 0).any():
        raise BadInput("speeds must be two or more ascending numbers in rad/s, for example "
                       "np.linspace(0, 50, 26).")
    critical, model = critical_speeds(model, pull=pull, order=order), _under(model, pull)[0]
    # Start just beside the first speed, because the pairs of an isotropic rotor are double at rest.
    start = modes(model, speeds[0] + 1e-3 * (speeds[1] - speeds[0]))
    low = np.flatnonzero(start.damping_ratios < PEAK)[:branches]
    path = [_Followed(start.speed, start.eigenvalues[low], start.eigenvalues[low],
                      start.shapes[:, low], start.whirl[low])]
    for speed in speeds:
        path.append(_follow(model, path[-1], speed))
    del path[0]
    eigenvalues, whirl = (np.array([getattr(p, name) for p in path])
                          for name in ("eigenvalues", "whirl"))
    found = np.sort(np.concatenate([critical.speeds, -critical.speeds]))
    found = found[(found >= speeds[0]) & (found <= speeds[-1])]
    return Campbell(speeds, eigenvalues, whirl, critical, found,
                    _branches(speeds, eigenvalues, whirl, critical, found))


def _branches(speeds: NDArray, eigenvalues: NDArray, whirl: NDArray, critical: CriticalSpeeds,
              found: NDArray) -> NDArray:
    """The branch that meets the line at each critical speed found, −1 where none comes near."""
    out = np.full(len(found), -1)
    for i, speed in enumerate(found):
        here = [[np.interp(speed, speeds, column) for column in part.T]
                for part in (eigenvalues.imag, whirl)]
        own = critical.whirl[np.abs(critical.speeds - abs(speed)).argmin()] * np.sign(speed)
        away = np.abs(np.array(here[0]) / (critical.order * abs(speed)) - 1)
        sense = 0.01 * np.abs(np.array(here[1]) - own)
        away = np.where(np.isfinite(away) & (away < 0.1), away + sense, np.inf)
        if np.isfinite(away).any():
            out[i] = away.argmin()
    return out


class _Followed(NamedTuple):
    """Branches at one speed: λ (NaN where lost), the last known λ and shape of each, and the whirl.
    """

    speed: float
    eigenvalues: NDArray
    last: NDArray
    shapes: NDArray
    whirl: NDArray


def _follow(model: Model, known: _Followed, speed: float, halvings: int = 6) -> _Followed:
    """The same branches at another speed."""
    every = modes(model, speed)
    keep = every.damping_ratios < LOST
    found = replace(every, eigenvalues=every.eigenvalues[keep], shapes=every.shapes[:, keep],
                    whirl=every.whirl[keep])
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
