"""Monodromy matrices of many orbits at once.

A disturbance s of an orbit obeys ṡ = A(t) s = (A₀ + push (J(t) − J₀) watch) s: constant but for a
part of rank c, the number of nonlinear coordinates. Where the pull is the only force that is not
linear, the constant part, which holds the slope J₀ at the centre, is advanced exactly by its
exponential, and the rest kicks the velocities in the middle of the step (Strang splitting): all
orbits at once. A bearing, a film or a crack is too stiff for kicks and may act on velocities; there
each step is the exponential of A in its middle (the first term of Magnus's series 1954; Iserles and
others 2000). Both are symmetric, so the error has even powers of the step only, and Richardson's
extrapolation from n, 2n (and 4n) steps gives fourth (sixth) order.

Floquet multipliers of steady states: does a small disturbance die out?

A verdict is given only where it survives its guards: the multipliers from two orders in the step,
and those of the orbit with the harmonics doubled on a richer basis. What a guard does not cover is
computed again more finely; what is still in doubt is "unknown", never "stable". Source: Nayfeh and
Balachandran (1995), chapter 3, for the theory; `monodromy` for the method.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.optimize import brentq

from hydrolab.dynamics.batch import Outcome, newton_batch, stack
from hydrolab.dynamics.branches import orbits_at
from hydrolab.dynamics.continuation import correct
from hydrolab.dynamics.ensemble import Split, flows, split
from hydrolab.dynamics.harmonic_balance import condense
from hydrolab.dynamics.harmonics import fourier_rows, rate_rows
from hydrolab.dynamics.results import Branch, PeriodicOrbit, SpecialPoint
from hydrolab.dynamics.solvers import newton
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.pull import CircularPull

NEAR = 0.9


def strang_product(system: Split, coefficients: NDArray, centre: NDArray, steps: int,
                   revolutions: int = 1) -> NDArray:
    """Monodromy matrices (P, 2r, 2r) with `steps` steps in a revolution, of second order; for a law
    that does not move.

    coefficients: [mean, sin 1, cos 1, …] of the nonlinear coordinates, m, (P, c, 2m + 1). centre:
    (P, 2), m. revolutions: in a period.
    """
    points, n, c = len(coefficients), len(system.constant), coefficients.shape[1]
    h = 2 * np.pi / system.speed / steps
    total = steps * revolutions
    rows = fourier_rows(coefficients.shape[2] // 2, 2 * np.pi * (np.arange(total) + 0.5) / total)
    path = system.model.relative((coefficients @ rows).transpose(1, 0, 2), centre.T[:, :, None])
    slope = h * (system.model.law.linearise(path)[1] - system.slope[:, :, None, None])
    flow, half = flows(system, steps)
    pushed = flow @ system.push
    # states × (points · columns): one matrix product moves all
    product = np.tile(half, (1, points))

    def kicks(step: int) -> NDArray:
        seen = (system.watch @ product).reshape(c, points, n)
        return np.einsum("ijp,jpc->ipc", slope[..., step], seen).reshape(c, -1)

    for step in range(total - 1):
        product = flow @ product + pushed @ kicks(step)
    product = half @ (product + system.push @ kicks(total - 1))
    return product.reshape(n, points, n).transpose(1, 0, 2)


def magnus_product(system: Split, coefficients: NDArray, centre: NDArray, steps: int,
                   revolutions: int = 1) -> NDArray:
    """As `strang_product`, for any law: each step is the exponential of the matrix in its middle.
    """
    h, total = 2 * np.pi / system.speed / steps, steps * revolutions
    turn = 2 * np.pi * (np.arange(total) + 0.5) / total
    harmonics = coefficients.shape[2] // 2
    rows, rates = fourier_rows(harmonics, turn), rate_rows(harmonics,
                                                           turn) * system.speed / revolutions
    found = np.empty((len(coefficients), *system.constant.shape))
    for i, (orbit, stator) in enumerate(zip(coefficients, centre, strict=True)):
        path = system.model.relative(orbit @ rows, stator[:, None])
        _, slope, damping = system.model.law.linearise(path, orbit @ rates, revolutions * turn,
                                                       system.speed)
        acts = (slope - system.slope[:, :, None]).transpose(2, 0, 1) @ system.watch
        if damping is not None:
            acts += damping.transpose(2, 0, 1) @ system.watch_rate
        product = np.eye(len(system.constant))
        for step in scipy.linalg.expm(h * (system.constant + system.push @ acts)):
            product = step @ product
        found[i] = product
    return found


def monodromy(system: Split, coefficients: NDArray, centre: NDArray, steps: int,
              revolutions: int = 1) -> tuple[NDArray, NDArray]:
    """Monodromy matrices, (P, 2r, 2r), of sixth and of fourth order, from `steps`, twice and four
    times as many.
    """
    # what grows beyond all numbers has no multipliers to speak of
    with np.errstate(over="ignore", invalid="ignore"):
        alone = len(system.push.T) == 2 and not system.model.law.moving
        product = strang_product if alone else magnus_product
        coarse, middle, fine = (product(system, coefficients, centre, n, revolutions)
                                for n in (steps, 2 * steps, 4 * steps))
        rough, good = (4 * middle - coarse) / 3, (4 * fine - middle) / 3
        return good + (good - rough) / 15, good


def multipliers(system: Split, coefficients: NDArray, centre: NDArray, steps: int,
                revolutions: int = 1) -> tuple[NDArray, NDArray]:
    """Floquet multipliers, largest first, (P, 2r), and how far they are known, (P,): the change
    from the lower order.
    """
    best, good = (eigenvalues(m) for m in monodromy(system, coefficients, centre, steps,
                                                    revolutions))
    return best, moved(best, good)


def eigenvalues(matrices: NDArray) -> NDArray:
    """Eigenvalues of each matrix, largest modulus first; nan where an orbit leaves the gap or its
    motion all bounds.
    """
    values = np.full(matrices.shape[:2], np.nan, dtype=complex)
    inside = np.isfinite(matrices).all(axis=(1, 2))
    values[inside] = np.linalg.eigvals(matrices[inside])
    return np.take_along_axis(values, np.argsort(-np.abs(values), axis=1), axis=1)


def moved(first: NDArray, second: NDArray) -> NDArray:
    """How far apart two sets of multipliers are, (P,): each one that matters against all of the
    other set.

    Those matter that could decide on stability: at least NEAR times the largest of the row, or NEAR
    where that is above 1.
    """
    apart = np.abs(first[:, :, None] - second[:, None, :])
    sizes = np.abs(first), np.abs(second)
    least = NEAR * np.minimum(1, np.maximum(*(size.max(axis=1) for size in sizes)))[:, None]
    return np.maximum(*(np.where(size >= least, apart.min(axis=axis), 0).max(axis=1)
                        for size, axis in zip(sizes, (2, 1), strict=True)))


TRUST = 1e-3  # relative change of the leading multipliers that a guard may show
MARGIN = 10  # how many times that change the leading multiplier must be away from the unit circle
# with the four deflections that `reduce` adds, moduli to 1e-4 on the paper's kind of unit
MODES, STEPS = 4, 32
MORE_MODES = 2  # in the guard
QUICK = 24  # steps where there is no guard
CROSSING = 1e-8  # of the distance between two points: how closely a crossing is located
# modes, steps and factor on the harmonics of the second and third look
FINER = ((6, 64, 2), (10, 512, 4))
# harmonics beyond which a finer look takes no more: they cost memory with their third power
ENOUGH = 32


@dataclass(frozen=True, eq=False)
class Floquet:
    """Floquet multipliers of one orbit, largest first, and what they say.

    multipliers: complex, shape (2r,) for r reduced DOFs. error: how far the leading ones are known,
    from the guards. verdict: "stable", "unstable" or "unknown". kind: where the leading one is
    nearest to leaving the unit circle: "fold" (real, positive), "flip" (real, negative) or
    "Neimark–Sacker" (a complex pair).
    """

    multipliers: NDArray
    error: float
    verdict: str
    kind: str

    @property
    def largest(self) -> float:
        """Largest modulus."""
        return float(abs(self.multipliers[0]))

    def __str__(self) -> str:
        mu = self.multipliers[0]
        value = f"{mu.real:.5f}" if abs(mu.imag) < 1e-9 else f"{mu.real:.5f} ± {abs(mu.imag):.5f} i"
        return f"{self.verdict}: leading multiplier {value}, modulus {abs(mu):.5f}, known to {self.error:.0e}"


def floquet(orbit: PeriodicOrbit, modes: int = MODES, steps: int = STEPS) -> Floquet:
    """Floquet multipliers of an orbit, guarded.

    modes: modes of the reduced basis (the static and gyroscopic deflections under the pull are
    added). steps: the coarsest of the three step counts in a revolution. Doubtful orbits are looked
    at more finely than that. Raises BadInput for fewer than 8 steps.
    """
    return floquet_all([orbit], modes, steps)[0]


def floquet_all(orbits: Sequence[PeriodicOrbit], modes: int = MODES, steps: int | None = None, *,
                guard: bool = True) -> list[Floquet]:
    """Floquet multipliers of many orbits; those of one model at one speed are computed together.

    guard: also compare with the orbits at twice the harmonics and on more modes, and look again
    where in doubt. Without it only two orders in the step are compared, of fewer steps, which is
    what a moving slider has time for. Raises BadInput for fewer than 8 steps.
    """
    steps = (STEPS if guard else QUICK) if steps is None else steps
    if steps < 8:
        raise BadInput(f"steps is {steps}; at least 8 in a revolution are needed.")
    if not orbits:
        return []
    eq = orbits[0].equations
    if any(o.equations is not eq for o in orbits):
        return [floquet_all([o], modes, steps, guard=guard)[0] for o in orbits]
    coefficients = np.stack([o.local for o in orbits])
    centres = np.stack([o.centre for o in orbits])
    system = split(eq.model, eq.speed, modes)
    if not guard:
        values, error = multipliers(system, coefficients, centres, steps, eq.revolutions)
    else:
        first = eigenvalues(monodromy(system, coefficients, centres, steps, eq.revolutions)[0])
        richer, found = _with_harmonics(eq, coefficients, centres, 2)
        values, error = multipliers(split(eq.model, eq.speed, modes + MORE_MODES), richer, centres,
                                    steps, eq.revolutions)
        error = np.maximum(error, moved(first, values))
        error[~found] = np.inf
        for more_modes, more_steps, factor in FINER:
            doubt = np.flatnonzero(~clear(values, error))
            if not len(doubt):
                break
            values_again, error_again = _again(eq, coefficients[doubt], centres[doubt],
                                               max(modes, more_modes),
                                               max(steps, more_steps), factor)
            width = values_again.shape[1]
            if width > values.shape[1]:
                values = np.pad(values, ((0, 0), (0, width - values.shape[1])))
            values[doubt, :width], values[doubt, width:] = values_again, 0
            error[doubt] = error_again
    return [_judged(v, float(e)) for v, e in zip(values, error, strict=True)]


def clear(values: NDArray, error: NDArray) -> NDArray:
    """Whether the guards leave no doubt on which side of the unit circle the leading multiplier is,
    (P,).
    """
    size = np.abs(values[:, 0])
    return np.isfinite(error) & (error <= TRUST * np.maximum(1, size)) & (np.abs(size - 1) > MARGIN
                                                                          * error)


def _with_harmonics(eq, coefficients: NDArray, centres: NDArray,
                    factor: int) -> tuple[NDArray, NDArray]:
    """The orbits solved again with `factor` times the harmonics, and which of them converged."""
    richer = condense(eq.model, eq.speed, factor * eq.harmonics, factor * eq.samples,
                      eq.revolutions)
    start = np.zeros((*coefficients.shape[:2], 2 * richer.harmonics + 1))
    start[:, :, :coefficients.shape[2]] = coefficients / richer.length
    start = start.reshape(len(start), -1)
    if type(eq.model.law) is CircularPull:
        y, outcome = newton_batch(stack([richer]).take(np.zeros(len(start), dtype=int)), start,
                                  centres)
        found = outcome == Outcome.CONVERGED
    else:
        solutions = [newton(lambda y, c=c: richer.linearise(y, c), s)
                     for s, c in zip(start, centres, strict=True)]
        y, found = np.array([s.y for s in solutions]), np.array([s.converged for s in solutions])
    near = np.abs(y - start).max(axis=1) < 0.05  # not another orbit
    return richer.length * y.reshape(coefficients.shape[0], coefficients.shape[1], -1), found & near


def _again(eq, coefficients: NDArray, centres: NDArray, modes: int, steps: int,
           factor: int) -> tuple[NDArray, NDArray]:
    """A finer look; its guard has twice the harmonics and more modes."""
    factor = min(factor, max(1, ENOUGH // eq.harmonics))
    some, found = _with_harmonics(eq, coefficients, centres, factor)
    more, found_more = _with_harmonics(eq, coefficients, centres, 2 * factor)
    values, error = multipliers(split(eq.model, eq.speed, modes + MORE_MODES), more, centres,
                                steps, eq.revolutions)
    first, _ = multipliers(split(eq.model, eq.speed, modes), some, centres, steps, eq.revolutions)
    error = np.maximum(error, moved(first, values))
    error[~(found & found_more)] = np.inf
    return values, error


def _judged(values: NDArray, error: float) -> Floquet:
    lead = values[0]
    verdict = "unknown"
    if abs(lead) - 1 > MARGIN * error:
        verdict = "unstable"  # 7000 ± 10 is, however roughly known
    elif clear(values[None], np.array([error]))[0]:
        verdict = "stable"
    kind = "Neimark–Sacker" if abs(lead.imag) > 1e-6 * abs(lead) else ("fold" if lead.real > 0
                                                                       else "flip")
    return Floquet(values[np.abs(values) > 0] if (values == 0).any() else values, error, verdict,
                   kind)


@dataclass(frozen=True, eq=False)
class BranchStability:
    """The stability of every point of a branch, and where it changes.

    points: one `Floquet` for each row of the branch. crossings: flips and Neimark–Sacker points
    located on the branch (folds are the branch's own), each with the multiplier's angle from the
    positive real axis in `kind`.
    """

    points: tuple[Floquet, ...]
    crossings: tuple[SpecialPoint, ...]

    @property
    def verdicts(self) -> tuple[str, ...]:
        """"stable", "unstable" or "unknown" for each point."""
        return tuple(p.verdict for p in self.points)

    def __str__(self) -> str:
        counts = ", ".join(f"{self.verdicts.count(v)} {v}"
                           for v in ("stable", "unstable", "unknown"))
        where = "; ".join(str(c) for c in self.crossings) or "none"
        return f"{counts} of {len(self.points)} points; stability changes away from folds: {where}"


def branch_stability(branch: Branch, modes: int = MODES, steps: int | None = None, *,
                     guard: bool = True,
                     locate: bool = True) -> BranchStability:
    """Floquet multipliers of every point of a branch in one batch, and where stability changes
    between them.

    guard: as in `floquet_all`. locate: find flips and Neimark–Sacker points where the number of
    multipliers outside the unit circle changes.
    """
    points = floquet_all(list(branch), modes, steps, guard=guard)
    if not locate:
        return BranchStability(tuple(points), ())
    folds = {fold.after for fold in branch.folds}
    crossings = []
    for i, (a, b) in enumerate(pairwise(points)):
        few, many = sorted((outside(a), outside(b)))
        if "unknown" not in (a.verdict, b.verdict) and many - few > (i in folds):
            crossings += _locate(branch, i, range(few, many), max(modes, FINER[0][0]),
                                 max(steps or 0, 2 * FINER[0][1]))
    return BranchStability(tuple(points), tuple(crossings))


def outside(point: Floquet) -> int:
    """Number of multipliers outside the unit circle."""
    return int(np.sum(np.abs(point.multipliers) > 1))


def _locate(branch: Branch, i: int, places: range, modes: int, steps: int) -> list[SpecialPoint]:
    """Where between rows i and i + 1 the multipliers at these places, by size, cross the unit
    circle away from a fold.
    """
    scale, system = branch.path.scale, branch.path.system()
    start, end = (np.append(branch.unknowns[j], branch.values[j] / scale) for j in (i, i + 1))
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length

    @cache
    def at(s: float) -> tuple[NDArray, NDArray]:
        """A point of the branch between the two, and its multipliers."""
        step = correct(system, start + s * along, along)
        if step is None:
            raise NoConvergence(f"The branch was lost between its points {i} and {i + 1}; use a "
                                "smaller `max_step`.")
        problem = branch.path.at(step.parameter * scale)
        eq = problem.equations
        values, _ = multipliers(split(eq.model, eq.speed, modes),
                                step.y.reshape(1, len(eq.linear), -1) * eq.length,
                                problem.centre[None], steps, eq.revolutions)
        return np.append(step.y, step.parameter), values[0]

    def margin(s: float, place: int) -> float:
        return float(abs(at(s)[1][place])) - 1

    found: list[SpecialPoint] = []
    for place in places:
        if not margin(0.0, place) * margin(length, place) < 0:
            continue  # not so when looked at more finely
        point, values = at(brentq(margin, 0.0, length, args=(place,), xtol=CROSSING * length))
        mu = values[place]
        real = abs(mu.imag) < 1e-6
        if (real and mu.real > 0) or any(abs(p.value - point[-1] * scale) < 10 * CROSSING * scale
                                         for p in found):
            continue  # a fold, which the branch has; or the other of a pair
        kind = "flip" if real else f"Neimark–Sacker, {math.degrees(abs(np.angle(mu))):.1f}° a revolution,"
        value = float(point[-1]) * scale
        found.append(SpecialPoint(kind, value, i, point[:-1], branch.path.say(value, 5)))
    return found


def stable_orbits_at(branch: Branch, static_eccentricity: float) -> list[PeriodicOrbit]:
    """The stable steady states of a branch at one eccentricity."""
    orbits = orbits_at(branch, static_eccentricity)
    return [o for o, f in zip(orbits, floquet_all(orbits), strict=True) if f.verdict == "stable"]
