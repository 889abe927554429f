"""Harmonic balance on the nonlinear coordinates alone: every linear DOF eliminated exactly.

For each harmonic k the linear machine answers a force f̂_k on the nonlinear coordinates u = S q by
u_k = u_lin,k + S Z_k⁻¹ Sᵀ f̂_k with Z_k = K − (kΩ)² M + ikΩ (C + ΩG), Eq. (16) in complex form. The
inverse of that small compliance, D_k, is the dynamic stiffness of the whole machine as the
generator feels it; the D_k of all harmonics are the matrix Λ of Eq. (17). What is left,

    H(Y) = Λ (Y − Y_lin) − Z(Y),                                                       Eq. (19)

has c(2m + 1) unknowns at any number of elements, where c is the number of nonlinear coordinates: 2
where the pull is the only force that is not linear. Z(Y) are the harmonics, Eq. (18), of the forces
along the motion, by alternating frequency and time (Cameron and Griffin 1989).

Coefficients are those of `hydrolab.dynamics.harmonics`, shape (c, 2m + 1). Where the period is that
of q revolutions, harmonic k turns with kΩ/q and the unbalance is in harmonic q.

centre: of the stator, m. eccentricity: a fraction of the gap.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import zgecon, zgesv

from hydrolab.dynamics.harmonics import fourier_rows, from_complex, rate_rows
from hydrolab.dynamics.results import PeriodicOrbit, require
from hydrolab.dynamics.solvers import Solution, newton
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.model import Model
from hydrolab.machine.quantities import number, require_model, turning, whole

# reciprocal condition number below which a dynamic stiffness has no inverse to speak of
SINGULAR = 1e-15
BALANCED = 1e-6  # of the forces on an orbit: the largest residual that is called a balance


@dataclass(frozen=True, eq=False)
class Condensed:
    """A model at one speed, seen from its c nonlinear coordinates; unknowns y = Y / length,
    flattened.

    stiffness: Λ scaled by `length`/`force`, (cK, cK) with K = 2m + 1. linear: Y_lin / length, (c,
    K). synthesis: samples of the position from y, (K, N), m. analysis: coefficients from N forces,
    (N, K), 1/N. products: analysis and synthesis in one, (N, K²), so that the AFT Jacobian is one
    matrix product. phase: Ωt of the samples, rad, (N,). rate, rate_products: as synthesis and
    products, for the velocity, m/s. recovery, shaft_linear: q_k = shaft_linear_k + recovery_k (u_k
    − u_lin,k), all DOFs, complex. revolutions: in a period.
    """

    model: Model
    speed: float
    harmonics: int
    samples: int
    length: float
    force: float
    stiffness: NDArray
    linear: NDArray
    synthesis: NDArray
    analysis: NDArray
    products: NDArray
    phase: NDArray
    rate: NDArray
    rate_products: NDArray
    recovery: NDArray
    shaft_linear: NDArray
    revolutions: int = 1

    def position(self, y: NDArray, centre: NDArray) -> NDArray:
        """Samples of the nonlinear coordinates, m, (c, N), the generator's counted from the stator
        centre (2,), m.
        """
        position = y.reshape(len(self.linear), -1) @ self.synthesis
        position[:2] -= centre[:, None]
        return position

    def velocity(self, y: NDArray) -> NDArray | None:
        """Samples of their velocity, m/s, (c, N); None where no law asks for it."""
        if not self.model.law.moving:
            return None
        return y.reshape(len(self.linear), -1) @ self.rate

    def forces(self, y: NDArray, centre: NDArray) -> NDArray:
        """Samples of the forces on the nonlinear coordinates, N, (c, N)."""
        return self.model.law.force(self.position(y, centre), self.velocity(y), self.phase,
                                    self.speed)

    def balance(self, y: NDArray, forces: NDArray) -> NDArray:
        """Λ (Y − Y_lin) − Z of given samples of the forces, scaled, (cK,)."""
        return self.stiffness @ (y - self.linear.ravel()) - (forces @ self.analysis).ravel()

    def residual(self, y: NDArray, centre: NDArray) -> NDArray:
        """H(Y) of Eq. (19), scaled; centre: stator centre, m."""
        return self.balance(y, self.forces(y, centre))

    def linearise(self, y: NDArray, centre: NDArray) -> tuple[NDArray, NDArray]:
        """H(Y) and its exact Jacobian Λ − ∂Z/∂Y, both scaled."""
        position = self.position(y, centre)
        forces, slope, damping = self.model.law.linearise(position, self.velocity(y), self.phase,
                                                          self.speed)
        # ∂Z/∂Y: the slopes along the motion, weighted with every pair of harmonics at once
        c, columns, samples = len(position), *self.synthesis.shape
        pull = slope.reshape(c * c, samples) @ self.products
        if damping is not None:
            pull += damping.reshape(c * c, samples) @ self.rate_products
        pull = pull.reshape(c, c, columns, columns).transpose(0, 2, 1, 3)
        return (self.balance(y, forces),
                self.stiffness - pull.reshape(c * columns, c * columns))

    def felt(self, k: int) -> NDArray:
        """Dynamic stiffness of harmonic k as the nonlinear coordinates feel it, complex, (c, c)."""
        c, columns = self.linear.shape
        blocks = self.stiffness.reshape(c, columns, c, columns)[:, :, :, 2 * k - 1]
        return self.force / self.length * (blocks[:, 2 * k - 1] + 1j * blocks[:, 2 * k])

    def newtons(self, residual: NDArray) -> float:
        """The largest force in a scaled residual, N."""
        return self.force * float(np.abs(residual).max())

    def small(self, y: NDArray, centre: NDArray) -> float:
        """A residual, N, that is small against the forces on a motion."""
        laws = self.force * np.abs(self.forces(y, centre) @ self.analysis).max()
        loads = max(np.abs(load).max() for load in self.model.loads(self.speed))
        return BALANCED * float(max(laws, loads))

    def require_balance(self, y: NDArray, centre: NDArray, residual: float) -> None:
        """Raise NoConvergence where what is left over is not small against the forces on a motion,
        and BadInput where these forces do not repeat with it.

        residual: N, an upper bound; where it is not small, the residual is computed.
        """
        self.require_repeat(y, centre)
        small = self.small(y, centre)
        if residual > small:
            residual = self.newtons(self.residual(y, centre))
        if not residual <= small:
            raise NoConvergence(
                f"The forces of {self.model.name} do not balance: {residual:.1e} N are left over, "
                f"and the largest of them is {small / BALANCED:.1e} N. Its stiffnesses are too far "
                "apart for a computer's numbers; look for a part that is nearly rigid, or for two "
                "parts on one place.")


    def require_repeat(self, y: NDArray, centre: NDArray) -> None:
        """Raise BadInput where forces or slopes at places of a motion differ a period later."""
        law, q, few = self.model.law, self.revolutions, slice(None, None, 8)
        if not law.moving:
            return
        place = self.position(y, centre)[:, few]
        rate = (y.reshape(len(self.linear), -1) @ self.rate)[:, few]

        def felt(turns: int) -> NDArray:
            force, slope, _ = law.linearise(place, rate, self.phase[few] + 2 * math.pi * turns,
                                            self.speed)
            return np.append(force, self.length * slope)

        now = felt(0)
        largest = max(float(np.abs(now).max()), np.finfo(float).tiny)
        away = float(np.abs(felt(q) - now).max()) / largest
        if not away > BALANCED:
            return
        more = [n for n in range(2, 17) if not np.abs(felt(n) - now).max() > BALANCED * largest]
        raise BadInput(
            f"The forces of {self.model.name} do not repeat after {q} revolution{'s' * (q > 1)}: "
            f"at the same places they then differ by {100 * away:.2g} %, and harmonic balance "
            "finds motions that repeat. "
            + (f"Ask for one with HarmonicBalance({4 * more[0]}, revolutions={more[0]})." if more
               else "Use `integrate`, or a field (poles.electrical_ratio) that repeats in q "
               "revolutions with revolutions=q; a synchronous one repeats in 1."))


def dynamic_stiffness(model: Model, w: float, speed: float) -> NDArray:
    """Z = K − w² M + iw (C + ΩG), complex, (n, n), at an angular frequency w and a speed Ω, rad/s.
    """
    return model.K - w**2 * model.M + 1j * w * model.velocity_matrix(speed)


def in_sines(stiffness: NDArray) -> NDArray:
    """Complex stiffness by harmonic as the real one on [mean, sin 1, cos 1, …] of x, then z …"""
    columns, count = 2 * len(stiffness) - 1, stiffness.shape[1]
    real = np.zeros((count, columns, count, columns))
    real[:, 0, :, 0] = stiffness[0].real
    for k in range(1, len(stiffness)):
        s, c = 2 * k - 1, 2 * k
        real[:, s, :, s] = real[:, c, :, c] = stiffness[k].real
        real[:, c, :, s], real[:, s, :, c] = stiffness[k].imag, -stiffness[k].imag
    return real.reshape(count * columns, count * columns)


def respond(model: Model, speed: float, order: float, loads: NDArray) -> NDArray:
    """Z⁻¹ times complex loads, (n, …), at `order` times the speed.

    Raises BadInput where the machine can move freely or the speed is an undamped resonance.
    """
    dynamic = dynamic_stiffness(model, order * speed, speed)
    factors, _, answer, singular = zgesv(dynamic, loads)
    if singular or not zgecon(factors, np.abs(dynamic).sum(axis=0).max())[0] > SINGULAR:
        raise BadInput(f"{model.name} at {speed:g} rad/s has no finite response in harmonic "
                       f"{order:g}: "
                       + ("an undamped resonance; add damping or change the speed." if order else
                          "it can move freely, so give it bearings."))
    return answer


@lru_cache(maxsize=64)
def _waves(harmonics: int, samples: int) -> tuple[NDArray, NDArray, NDArray]:
    """Phases of the samples, harmonics there and their rates, kept for the next speed."""
    turn = 2 * np.pi * np.arange(samples) / samples
    return turn, fourier_rows(harmonics, turn), rate_rows(harmonics, turn)


@lru_cache(maxsize=64)
def condense(model: Model, speed: float, harmonics: int, samples: int, revolutions: int = 1,
             length: float | None = None) -> Condensed:
    """Eliminate the linear DOFs of a model at one speed; cached, since a branch asks again and
    again.

    speed: rad/s. harmonics: m. samples: in a period. revolutions: in the period that the harmonics
    share. length: that scales the unknowns, m; the model's own unless given.
    Raises BadInput where the machine can move freely (no static stiffness), the speed is a
    resonance without damping, or one nonlinear coordinate depends on others.
    """
    model = model.at(speed)
    n, c, length = model.size, len(model.selection), length or model.length_scale
    amplitudes = np.zeros((harmonics + 1, n), dtype=complex)
    recovery = np.empty((harmonics + 1, n, c), dtype=complex)
    stiffness = np.empty((harmonics + 1, c, c), dtype=complex)
    for k in range(harmonics + 1):
        # unit forces on the nonlinear coordinates, and beside them what acts whatever the motion
        loads = np.zeros((n, c + 1), dtype=complex)
        loads[:, :c] = model.selection.T
        if k in (0, revolutions):
            loads[:, c] = model.loads(speed)[k > 0]
        answer = respond(model, speed, k / revolutions, loads)
        try:
            stiffness[k] = np.linalg.inv(model.selection @ answer[:, :c])
        except np.linalg.LinAlgError:
            raise BadInput(f"{model.name} has nonlinear coordinates that depend on one another; "
                           "laws at one place act on the same coordinates.") from None
        recovery[k] = answer[:, :c] @ stiffness[k]
        amplitudes[k] = answer[:, c]

    # between harmonics and samples in time; unknowns and residuals are scaled to be of order one
    turn, rows, turning_rows = _waves(harmonics, samples)
    force = length * float(np.abs(stiffness[0]).max())
    weights = np.full((2 * harmonics + 1, 1), 2 / samples)
    weights[0] = 1 / samples
    analysis = (weights * rows).T / force
    synthesis, rate = length * rows, length * speed / revolutions * turning_rows

    def products(rows: NDArray) -> NDArray:
        return np.einsum("nk,ln->nkl", analysis, rows).reshape(samples, -1)

    return Condensed(
        model, speed, harmonics, samples, length, force,
        stiffness=in_sines(stiffness) * (length / force),
        linear=from_complex((amplitudes @ model.selection.T).T) / length,
        synthesis=synthesis, analysis=analysis, products=products(synthesis),
        phase=revolutions * turn, rate=rate,
        rate_products=products(rate if model.law.moving else rate[:0]),
        recovery=recovery, shaft_linear=amplitudes, revolutions=revolutions)


@dataclass(frozen=True)
class HarmonicBalance:
    """Harmonic balance with m harmonics and alternating frequency and time, Eqs. (10) to (19).

    harmonics: m. samples: time samples in a period for the AFT step; by default 16 a harmonic, at
    least 64. solver: `newton` or `powell_dog_leg` of hydrolab.dynamics.solvers. revolutions: q in a
    period; harmonic k then has the frequency kΩ/q, for motions that repeat every q revolutions
    only.
    """

    harmonics: int = 4
    samples: int | None = None
    solver: Callable[..., Solution] = newton
    revolutions: int = 1

    def __post_init__(self) -> None:
        whole("harmonics", self.harmonics, 1, 64)
        if not isinstance(self.aft_samples, int) or self.aft_samples < 2 * self.harmonics + 2:
            raise BadInput(f"samples is {self.samples!r}; {self.harmonics} harmonics need at least "
                           f"{2 * self.harmonics + 2}, and several times that for a pull without "
                           "aliasing.")
        whole("revolutions", self.revolutions, 1, self.harmonics, "the harmonics, so that the "
              "unbalance is among them")
        if not callable(self.solver):
            raise BadInput(f"solver is {self.solver!r}; it must be a function, newton or "
                           "powell_dog_leg of hydrolab.")

    @property
    def aft_samples(self) -> int:
        """Time samples in a period: as given, or 16 a harmonic and at least 64."""
        return max(64, 16 * int(self.harmonics)) if self.samples is None else self.samples

    def equations(self, model: Model, speed: float, length: float | None = None) -> Condensed:
        """The condensed equations of a model at a speed (rad/s), unknowns scaled by `length` (m),
        by default the model's own.
        """
        require_model(model)
        return condense(model, turning(speed), self.harmonics, self.aft_samples, self.revolutions,
                        length)

    def solve(self, model: Model, speed: float, static_eccentricity: float = 0.0, *,
              direction: float = math.pi / 2, start: PeriodicOrbit | None = None) -> PeriodicOrbit:
        """The steady state at a speed (rad/s) and a static eccentricity (fraction of the gap).

        direction: gap angle of the stator offset, rad. start: a steady state to begin from; without
        one the linear response is tried, then a walk from zero eccentricity. Raises NoConvergence
        with what to try next, Contact where the steady state found would touch the stator, BadInput
        for arguments outside what is allowed, a start with other coordinates, and forces that do
        not repeat with the motion (a field that slips).
        """
        eq = self.equations(model, speed)
        number("static_eccentricity", static_eccentricity)
        centre = model.centre(static_eccentricity, number("direction", direction))
        if start is not None:
            solution = self.from_guess(eq, centre, first_guess(eq, start))
        else:
            solution = self.from_guess(eq, centre, eq.linear.ravel())
            if not solution.converged:
                solution = self._walk(eq, centre)
        if not solution.converged:
            raise NoConvergence(self._advice(eq, solution, static_eccentricity))
        orbit = orbit_from(eq, static_eccentricity, centre, solution)
        orbit.require_clear()
        return orbit

    def from_guess(self, eq: Condensed, centre: NDArray, y: NDArray) -> Solution:
        """Run the solver on condensed equations from unknowns y; the stator is at `centre` (m)."""
        return self.solver(lambda y: eq.linearise(y, centre), y)

    def _walk(self, eq: Condensed, centre: NDArray) -> Solution:
        """Reach a steady state by raising the pull to its full strength, then the offset."""
        shares = np.linspace(0, 1, 21)[1:]
        # the linear machine does not change with the field
        stages = [(replace(eq, model=eq.model.with_field(s)), 0 * centre) for s in shares]
        stages += [(eq, s * centre) for s in shares]
        y = eq.linear.ravel()
        for stage, place in stages:
            solution = self.from_guess(stage, place, y)
            if not solution.converged:
                break
            y = solution.y
        return solution

    def _advice(self, eq: Condensed, solution: Solution, eccentricity: float) -> str:
        smallest = solution.smallest_singular_value
        where = (f"{100 * eccentricity:.4g} %" if math.isfinite(eq.model.gap) else
                 f"{eq.speed:.4g} rad/s")
        left = eq.newtons(solution.residual)
        inside = math.isfinite(left)
        size = f"residual {left:.1e} N" if inside else "the rotor outside the gap"
        fold = f"a fold is near (smallest singular value {smallest:.0e}). "
        return (f"{self.solver.__name__} stopped at {where} after {solution.steps} steps, {size}: "
                + (fold if smallest < 0.05 else "")
                + ("" if inside else "Lower the eccentricity, the unbalance or the field. ")
                + "Start from a neighbouring steady state, or follow the branch with `follow`; "
                  "a solver that stops does not show that there is no steady state.")


def first_guess(eq: Condensed, start: PeriodicOrbit) -> NDArray:
    """Unknowns of `eq` from an orbit that may have other harmonics or another number of revolutions
    in its period.

    Raises BadInput for an orbit of a model with other nonlinear coordinates.
    """
    require("start", start, PeriodicOrbit)
    y = np.zeros_like(eq.linear)
    if len(start.local) != len(y):
        raise BadInput(f"start is a steady state of {start.model.name} with {len(start.local)} "
                       f"nonlinear coordinates; this model, {eq.model.name}, has {len(y)}. Start "
                       "from a steady state of a model with the same bearings, cracks and tilt.")
    for k in range(start.harmonics + 1):
        order = k * eq.revolutions / start.revolutions
        if order == int(order) <= eq.harmonics:
            own, new = max(2 * k - 1, 0), max(2 * int(order) - 1, 0)
            width = 2 if k else 1
            y[:, new:new + width] = start.local[:, own:own + width] / eq.length
    return y.ravel()


def orbit_from(eq: Condensed, eccentricity: float, centre: NDArray,
               solution: Solution) -> PeriodicOrbit:
    """The orbit of a solution.

    Raises NoConvergence where its residual is not small against the forces on it.
    """
    residual = eq.newtons(solution.residual)
    eq.require_balance(solution.y, centre, residual)
    return PeriodicOrbit(eq, float(eccentricity), centre,
                         eq.length * solution.y.reshape(len(eq.linear), -1), residual)
