"""Floquet multipliers of steady states: does a small disturbance die out?

The verdict is a count on the whole machine (`winding`), of two truncations and of the orbit with
its harmonics and with twice as many; where they differ, or the leading multiplier is nearer to the
unit circle than it is known, it is looked at more finely, and what stays in doubt is "unknown". The
multipliers start from those of a few modes and are then those of the whole machine, by Newton's
method on the determinant that is counted.

The start, which is also the quick look of a moving slider: a disturbance s of an orbit obeys ṡ =
A(t) s = (A₀ + push (J(t) − J₀) watch) s, constant but for a part of rank c, the number of nonlinear
coordinates. Where the pull is the only force that is not linear, the constant part, which holds the
slope J₀ at the centre, is advanced exactly by its exponential, and the rest kicks the velocities in
the middle of the step (Strang splitting): all orbits at once. A bearing, a film or a crack is too
stiff for kicks and may act on velocities; there each step is the exponential of A in its middle
(the first term of Magnus's series 1954; Iserles and others 2000). Both are symmetric, so the error
has even powers of the step only, and Richardson's extrapolation from n, 2n and 4n steps gives sixth
order. Source: Nayfeh and Balachandran (1995), chapter 3, for the theory.

Here coefficients: of the c nonlinear coordinates, (P, c, 2m + 1), m. centre: of the stator, m.
steps: in a revolution. revolutions: in a period. first, second: multipliers, (P, n).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from hydrolab.dynamics.batch import Outcome, newton_batch, stack
from hydrolab.dynamics.ensemble import Split, flows, split
from hydrolab.dynamics.harmonic_balance import Condensed, condense
from hydrolab.dynamics.harmonics import fourier_rows, rate_rows
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.solvers import newton
from hydrolab.dynamics.winding import (
    Disturbance,
    background,
    count,
    derivatives,
    disturbance,
    newton_step,
    pull_alone,
    real,
    roots,
    twins,
)
from hydrolab.errors import BadInput

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
    """Monodromy matrices, (P, 2r, 2r), of sixth and fourth order, by one, two, four `steps`."""
    # what grows beyond all numbers has no multipliers to speak of
    with np.errstate(over="ignore", invalid="ignore"):
        product = strang_product if pull_alone(system.model) else magnus_product
        coarse, middle, fine = (product(system, coefficients, centre, n, revolutions)
                                for n in (steps, 2 * steps, 4 * steps))
        rough, good = (4 * middle - coarse) / 3, (4 * fine - middle) / 3
        return good + (good - rough) / 15, good


def multipliers(system: Split, coefficients: NDArray, centre: NDArray, steps: int,
                revolutions: int = 1) -> tuple[NDArray, NDArray]:
    """Floquet multipliers, largest first, (P, 2r), and their change from the lower order, (P,)."""
    best, good = (eigenvalues(m) for m in monodromy(system, coefficients, centre, steps,
                                                    revolutions))
    return best, moved(best, good)


def eigenvalues(matrices: NDArray) -> NDArray:
    """Eigenvalues of each matrix, largest first; nan where an orbit leaves all bounds."""
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


TRUST = 1e-3  # relative change of the leading multipliers that two looks may show
MARGIN = 10  # how many times that change the leading multiplier must be away from the unit circle
MODES, STEPS = 4, 24  # of the start
LEADING = 6  # exponents of each kind that are followed to the whole machine
FADED = 1e-12  # what decays faster in a period is not followed
SOLVED = 1e-9  # to which an orbit is solved, and no multiplier is known better
SLOW = 0.5  # least share of the largest multiplier at which a mode outside the basis is followed
SEEN = 1e-2  # a linear mode this near, relatively, to one of the start's basis is in it
# harmonics of the disturbance, and factor on those of the orbit, in each look; the look is compared
# with another of twice both
LOOKS = ((4, 1), (8, 2), (16, 4))
FINE = 16  # harmonics of the disturbance where a crossing is located
# harmonics beyond which a finer orbit takes no more: they cost memory with their third power
ENOUGH = 64


@dataclass(frozen=True, eq=False)
class Floquet:
    """Leading Floquet multipliers of one orbit, largest first, and what is known of its stability.

    multipliers: complex, (m,). error: how far the leading ones are known. verdict: "stable",
    "unstable" or "unknown". kind: where the leading one is nearest to leaving the unit circle:
    "fold" (real, positive), "flip" (real, negative) or "Neimark–Sacker" (a complex pair). outside:
    number of multipliers outside the unit circle. how: "counted" on the whole machine, or "quick",
    from a few modes. growth: only what grows faster than this is counted, 1/s; above 0 where the
    machine has motions without damping, which is then "stable" where nothing does.
    """

    multipliers: NDArray
    error: float
    verdict: str
    kind: str
    outside: int = 0
    how: str = "quick"
    growth: float = 0.0

    @property
    def largest(self) -> float:
        """Largest modulus."""
        return float(abs(self.multipliers[0]))

    def __str__(self) -> str:
        mu = self.multipliers[0]
        # no digit beyond what is known, and none that says nothing
        unknown = max(self.error if math.isfinite(self.error) else 0.1 * self.largest, 1e-5,
                      1e-5 * self.largest)
        digits = max(math.ceil(-math.log10(unknown) - 0.1), 0)
        real, imaginary, size = (f"{x:.{digits}f}" if abs(x) < 1e6 else f"{x:.3g}"
                                 for x in (mu.real, abs(mu.imag), abs(mu)))
        value = real if abs(mu.imag) < 1e-9 * max(1, abs(mu)) else f"{real} ± {imaginary} i"
        glance = " at a quick look on a few modes" if self.how == "quick" else ""
        known = f"known to {self.error:.0e}" if math.isfinite(self.error) else "not known"
        said = f"{self.verdict}{glance}: leading multiplier {value}, modulus {size}, {known}"
        if not glance:
            said += (f"; {self.outside or 'none'} outside the unit circle, counted on the whole "
                     "machine")
        if self.growth:
            said += (f"; motions without damping neither grow nor die out, so only growth faster "
                     f"than {self.growth:.0e} 1/s is counted")
        return said


def floquet(orbit: PeriodicOrbit, modes: int = MODES, steps: int = STEPS, *,
            quick: bool = False) -> Floquet:
    """Floquet multipliers of an orbit, and how many lie outside the unit circle.

    modes, steps: of the start, the modes of its basis and the coarsest of its three step counts in
    a revolution. quick: as in `floquet_all`. Raises BadInput for fewer than 8 steps, or what is no
    orbit.
    """
    return floquet_all([orbit], modes, steps, quick=quick)[0]


def floquet_all(orbits: Sequence[PeriodicOrbit], modes: int = MODES, steps: int = STEPS, *,
                quick: bool = False) -> list[Floquet]:
    """Floquet multipliers of many orbits; those of one model at one speed are computed together.

    quick: only the start, the multipliers of a few modes from two orders in the step, which is what
    a moving slider has time for; an instability that those modes do not know is not seen. Raises
    BadInput for fewer than 8 steps.
    """
    if other := next((o for o in orbits if not isinstance(o, PeriodicOrbit)), None):
        raise BadInput(f"orbit is a {type(other).__name__}; it must be a steady state, such as "
                       "HarmonicBalance().solve(…) or branch[3]. A whole branch has "
                       "branch_stability(branch).")
    if steps < 8:
        raise BadInput(f"steps is {steps}; at least 8 in a revolution are needed.")
    if not orbits:
        return []
    eq = orbits[0].equations
    if any(o.equations is not eq for o in orbits):
        return [floquet_all([o], modes, steps, quick=quick)[0] for o in orbits]
    local, centres = np.stack([o.local for o in orbits]), np.stack([o.centre for o in orbits])
    if quick:
        values, error = multipliers(split(eq.model, eq.speed, modes), local, centres, steps,
                                    eq.revolutions)
        return [_at_a_glance(v, float(e)) for v, e in zip(values, error, strict=True)]
    # other forces are counted from a machine that holds their mean slope, which is each orbit's own
    groups = [slice(None)] if pull_alone(eq.model) else [[i] for i in range(len(local))]
    return [f for own in groups for f in _counted(eq, local[own], centres[own], modes, steps)]


def _at_a_glance(values: NDArray, error: float) -> Floquet:
    return Floquet(values, error, _verdict(values, error), _kind(values[0]), _outside(values))


def _verdict(values: NDArray, error: float) -> str:
    size = abs(values[0])
    if size - 1 > MARGIN * error:
        return "unstable"  # 7000 ± 10 is, however roughly known
    return "stable" if 1 - size > MARGIN * error and error <= TRUST else "unknown"


def _kind(lead: complex) -> str:
    if abs(lead.imag) > 1e-6 * abs(lead):
        return "Neimark–Sacker"
    return "fold" if lead.real > 0 else "flip"


def _outside(values: NDArray) -> int:
    return int(np.sum(np.abs(values) > 1))


def _counted(eq: Condensed, local: NDArray, centres: NDArray, modes: int,
             steps: int) -> list[Floquet]:
    """Look at all orbits, and again, more finely, at those in doubt."""
    out: list[Floquet] = []
    doubt, start = np.arange(len(local)), _start(eq, local, centres, modes, steps)
    for order, factor in LOOKS:
        found, there = _look(eq, local[doubt], centres[doubt], [a[doubt] for a in start], order,
                             factor)
        out = out or found
        for i, f in zip(doubt, found, strict=True):
            out[i] = f
        # an orbit that more harmonics do not have is not sought again
        doubt = doubt[there & [f.verdict == "unknown" for f in found]]
        if not len(doubt):
            break
    return out


def _start(eq: Condensed, local: NDArray, centres: NDArray, modes: int,
           steps: int) -> tuple[NDArray, NDArray]:
    """Where the exponents of the pull alone may lie, from a few modes, on the copy λ + ikν next to
    an eigenvalue of these modes under the mean slope, so that their harmonics lie around 0, (P, m);
    and the eigenvalues of these modes without forces, (P, m). Nothing for other forces.
    """
    if not pull_alone(eq.model):
        return np.empty((len(local), 0), dtype=complex), np.empty((len(local), 0), dtype=complex)
    system, step = split(eq.model, eq.speed, modes), eq.speed / eq.revolutions
    values = eigenvalues(monodromy(system, local, centres, steps, eq.revolutions)[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.where(np.abs(values) > FADED, np.log(values) * step / (2 * np.pi), np.nan)
    mean = derivatives(eq, local, centres, 64)[0].mean(axis=-1).transpose(2, 0, 1)
    alone = system.constant - system.push @ system.slope @ system.watch
    mean[~np.isfinite(mean)] = 0  # outside the gap there is no slope
    apart = np.linalg.eigvals(alone + system.push @ mean @ system.watch)[:, None] - found[..., None]
    copies = np.rint(apart.imag / step)
    nearest = np.abs(apart - 1j * step * copies).argmin(axis=2)
    copies = np.take_along_axis(copies, nearest[..., None], axis=2)[..., 0]
    return found + 1j * step * copies, np.tile(np.linalg.eigvals(alone), (len(local), 1))


def _believed(d: Disturbance, found: NDArray, known: NDArray) -> list[NDArray]:
    """The start's exponents; other poles moved by the mean slope, felt and not, (P, m) each."""
    poles, (slope, damping) = d.linear.poles, d.mean()
    distance = np.abs(poles[:, None] - known[0]) / np.abs(poles)[:, None]
    missing = np.exp(poles.real * 2 * np.pi / d.step) > FADED
    rows, columns = linear_sum_assignment(distance)  # each pole once: it may be there twice
    missing[rows[distance[rows, columns] < SEEN]] = False
    moved = poles + np.einsum("jab,pba->pj", d.linear.residues, slope)
    if damping is not None:
        moved += poles * np.einsum("jab,pba->pj", d.linear.residues, damping)
    felt = d.felt()[0]
    return [found, moved[:, missing & felt], moved[:, missing & ~felt]]


def _look(eq: Condensed, local: NDArray, centres: NDArray, start: Sequence[NDArray], order: int,
          factor: int) -> tuple[list[Floquet], NDArray]:
    """Count with `order` harmonics on orbits of `factor` times their own, and with twice both; the
    leading multipliers are those of the second, their error the change from the first. Also whether
    both orbits are there.
    """
    (rough, path, found), (fine, better, more) = (
        _with_harmonics(eq, local, centres, f) for f in (factor, 2 * factor))
    linear = background(eq, local, centres)
    coarse = disturbance(rough, path, centres, order, *linear)
    sharp = disturbance(fine, better, centres, 2 * order, *linear)
    groups = _believed(sharp, *start)
    believed = np.hstack(groups)
    (few, sure, growth), (many, also, _) = count(coarse, believed), count(sharp, believed)
    period, begin = 2 * np.pi / sharp.step, _leading(groups, sharp.step)
    near = roots(coarse, begin)[:, :begin.shape[1]]  # most of the way, on small matrices
    same = np.isfinite(near) & (real(near, sharp.step) == real(begin, sharp.step))
    exponents = roots(sharp, np.where(same, near, begin))
    values, moves = np.exp(period * exponents), np.full(exponents.shape, np.nan)
    first = twins(exponents, sharp.step)
    alone = np.where(first == np.arange(first.shape[1]), exponents, np.nan)
    known = np.isfinite(alone)
    step = newton_step(coarse, alone, known)[0]
    with np.errstate(over="ignore", invalid="ignore"):  # a step as wild as that says nothing
        moves[known] = np.abs(values[known] * np.expm1(period * step))
    moves = np.take_along_axis(moves, first, axis=1)
    there = found & more
    certain = sure & also & there & (few == many)
    return [_judged(v, e, int(n), bool(c), growth)
            for v, e, n, c in zip(values, moves, many, certain, strict=True)], there


def _judged(values: NDArray, moves: NDArray, outside: int, certain: bool, growth: float) -> Floquet:
    """The verdict from multipliers in the upper half plane, how far each moved, and the count."""
    values, moves = _largest_first(values, moves)
    if not len(values):  # all has died out within a period
        values, moves = np.zeros(1, dtype=complex), np.zeros(1)
    leading = np.abs(values) >= NEAR * min(1, abs(values[0]))
    moved_by = float(np.nan_to_num(moves[leading], nan=np.inf).max())
    error = max(moved_by, SOLVED * abs(values[0])) if certain else math.inf
    verdict = _verdict(values, error)
    if growth and certain and not outside and verdict != "unstable" and error <= TRUST:
        verdict = "stable"  # what has no damping lies on the circle itself, and nothing beyond it
    elif (verdict == "stable") != (outside == 0) or (growth and verdict == "stable"):
        verdict = "unknown"
    return Floquet(values, error, verdict, _kind(values[0]), outside, "counted", growth)


def _leading(groups: Sequence[NDArray], step: float) -> NDArray:
    """Of each group of exponents the LEADING that decay least, with Im λ ≥ 0 up to rounding."""
    parts = []
    for group in groups:
        folded = group.imag / step - np.ceil(group.imag / step - 0.5 - 1e-9)
        upper = np.where(folded >= -1e-9, group, np.nan)
        order = np.argsort(-np.nan_to_num(upper.real, nan=-np.inf), axis=1)[:, :LEADING]
        parts.append(np.take_along_axis(upper, order, axis=1))
    out = np.hstack(parts)
    slowest = np.nanmax(out.real, axis=1, initial=-np.inf, keepdims=True)
    out[:, parts[0].shape[1]:][
        ~(out[:, parts[0].shape[1]:].real > slowest + math.log(SLOW) * step / (2 * np.pi))] = np.nan
    return out


def leading(orbit: PeriodicOrbit, modes: int = MODES) -> NDArray:
    """The leading multipliers of the whole machine around an orbit as it is, largest first, (m,).

    modes: of the start.
    """
    eq, local, centre = orbit.equations, orbit.local[None], orbit.centre[None]
    d = disturbance(eq, local, centre, FINE, *background(eq, local, centre))
    start = _believed(d, *_start(eq, local, centre, modes, STEPS))
    values = np.exp(2 * np.pi / d.step * roots(d, _leading(start, d.step))[0])
    return _largest_first(values, values)[0]


def _largest_first(values: NDArray, more: NDArray) -> tuple[NDArray, NDArray]:
    """Multipliers, each with its conjugate, largest first, and what belongs to each."""
    known = np.isfinite(values)
    values, more = values[known], more[known]
    paired = np.abs(values.imag) > 1e-9 * np.abs(values)
    values = np.concatenate([values, values[paired].conj()])
    order = np.argsort(-np.abs(values), kind="stable")
    return values[order], np.concatenate([more, more[paired]])[order]


def _with_harmonics(eq: Condensed, local: NDArray, centres: NDArray,
                    factor: int) -> tuple[Condensed, NDArray, NDArray]:
    """Equations of `factor` times the harmonics, orbits (P, c, 2m + 1), m, and which converged."""
    factor = min(factor, max(1, ENOUGH // eq.harmonics))
    if factor == 1:
        return eq, local, np.ones(len(local), dtype=bool)
    richer = condense(eq.model, eq.speed, factor * eq.harmonics, factor * eq.samples,
                      eq.revolutions)
    start = np.zeros((*local.shape[:2], 2 * richer.harmonics + 1))
    start[:, :, :local.shape[2]] = local / richer.length
    start = start.reshape(len(start), -1)
    if eq.model.law.closed_form:
        y, outcome = newton_batch(stack([richer]).take(np.zeros(len(start), dtype=int)), start,
                                  centres, max_steps=8)
        found = outcome == Outcome.CONVERGED
    else:
        # the same orbit is a few steps away; what is not there is not worth many
        solutions = [newton(partial(richer.linearise, centre=c), s, max_steps=14)
                     for s, c in zip(start, centres, strict=True)]
        y, found = np.array([s.y for s in solutions]), np.array([s.converged for s in solutions])
    near = np.abs(y - start).max(axis=1) < 0.05  # not another orbit
    return richer, richer.length * y.reshape(*local.shape[:2], -1), found & near
