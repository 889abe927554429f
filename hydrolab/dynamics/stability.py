"""Floquet multipliers of a steady state: does a small disturbance die out?

The disturbance obeys M q̈ + (C + ΩG) q̇ + K q = Sᵀ J(t) S q, where J is the slope of the pull along the
orbit. As x = (q, q̇) that is ẋ = (A + B J(t) W) x with B = (0, M⁻¹Sᵀ) and W = (S, 0), and everything but J is
constant. The mean of J goes into A, whose flow over a step is exact; the rest of J acts as kicks on the
velocities between. Chin's splitting 4A (1997) needs two kicks a step and only positive times, and is of
fourth order, because two kicks do not commute with the flow in just one way, (J W A B J), which is a kick again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from hydrolab.dynamics.condensation import condense
from hydrolab.dynamics.harmonic_balance import first_guess, orbit_from
from hydrolab.dynamics.reduction import reduce
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.solvers import newton
from hydrolab.errors import BadInput

TRUST = 1e-3  # multipliers may differ by this much between two resolutions; beyond, no orbit is called stable
BASIS = 1e-4  # share of a multiplier that the modal basis may miss; within it of the unit circle: "unknown"


@dataclass(frozen=True, eq=False)
class Floquet:
    """Floquet multipliers of one orbit, largest first, and what they say.

    multipliers: complex, shape (2r,) for r reduced DOFs. error: largest change of the four leading ones when the
    steps are halved and the orbit's harmonics doubled, inf where there is no such orbit nearby.
    verdict: "stable", "unstable" or "unknown". kind: how the leading one leaves the unit circle: "fold" (at +1),
    "flip" (at −1) or "Neimark–Sacker" (a complex pair).
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
        return f"{self.verdict}: leading multiplier {value}, modulus {abs(mu):.5f}"


def monodromy(orbit: PeriodicOrbit, modes: int = 12, steps: int = 128) -> NDArray:
    """Monodromy matrix of the orbit on the reduced basis, shape (2r, 2r), over `steps` steps of fourth order."""
    model = reduce(orbit.model, modes)
    r = model.size
    inverse_mass = np.linalg.inv(model.M)
    watch = np.hstack([model.selection, np.zeros_like(model.selection)])
    push = np.vstack([np.zeros((r, 2)), inverse_mass @ model.selection.T])

    h = 2 * np.pi / orbit.speed / steps
    half_steps = np.pi * np.arange(2 * steps) / steps
    _, slope = model.law.linearise(orbit.positions(half_steps) - orbit.centre[:, None])
    slope = slope.transpose(2, 0, 1)
    mean = slope.mean(axis=0)
    constant = np.block([[np.zeros((r, r)), np.eye(r)],
                         [-inverse_mass @ model.K, -inverse_mass @ model.velocity_matrix(orbit.speed)]])
    constant += push @ mean @ watch
    flow = scipy.linalg.expm(constant * h / 2)

    rest = slope - mean
    kicks = h / 3 * rest  # at the ends of a step: h/6 of this step and h/6 of the next
    middle = rest[1::2]
    kicks[1::2] = 2 * h / 3 * (middle + h**2 / 24 * middle @ (watch @ constant @ push) @ middle)
    product = np.eye(2 * r)
    product += push @ (kicks[0] / 2 @ watch)
    for kick in kicks[1:]:
        product = flow @ product
        product += push @ (kick @ (watch @ product))
    product = flow @ product
    return product + push @ (kicks[0] / 2 @ (watch @ product))


def with_twice_the_harmonics(orbit: PeriodicOrbit) -> PeriodicOrbit | None:
    """The same steady state with 2m harmonics and twice the samples; None if Newton does not find it from here."""
    eq = condense(orbit.model, orbit.speed, 2 * orbit.harmonics, 2 * orbit.equations.samples)
    solution = newton(lambda y: eq.linearise(y, orbit.centre), first_guess(eq, orbit))
    return orbit_from(eq, orbit.static_eccentricity, orbit.centre, solution) if solution.converged else None


def floquet(orbit: PeriodicOrbit, modes: int = 12, steps: int = 128) -> Floquet:
    """Floquet multipliers of an orbit, checked against half as many steps on the orbit of twice the harmonics.

    modes: modes of the reduced basis (the static deflection under the pull is added). steps: in a revolution.
    Raises BadInput unless steps is an even number of at least 16.
    """
    if isinstance(steps, bool) or not isinstance(steps, int) or steps < 16 or steps % 2:
        raise BadInput(f"steps is {steps!r}; it must be an even number of at least 16 in a revolution.")
    multipliers = np.linalg.eigvals(monodromy(orbit, modes, steps))
    multipliers = multipliers[np.argsort(-np.abs(multipliers))]
    error, lead = np.inf, multipliers[0]
    if (finer := with_twice_the_harmonics(orbit)) is not None:
        check = np.linalg.eigvals(monodromy(finer, modes, steps // 2))
        error = float(max(np.abs(check - mu).min() for mu in multipliers[:4]))
    if abs(lead) + max(error, BASIS) < 1 and error < TRUST:
        verdict = "stable"
    else:
        verdict = "unstable" if abs(lead) - max(error, BASIS) > 1 else "unknown"
    kind = "Neimark–Sacker" if abs(lead.imag) > 1e-6 * abs(lead) else ("fold" if lead.real > 0 else "flip")
    return Floquet(multipliers, error, verdict, kind)
