r"""Parametric instability of a two-pole machine: the pull's stiffness turns with twice the
electrical frequency.

Linearised about the centre, the pull of one pole pair is F_z + i F_x = k_m (ζ + ½ e^{2iωt} ζ̄), ω
the electrical frequency. In the frame that turns with ω it is constant, so a Jeffcott rotor has
exact limits of stability there (`two_pole_band`, `two_pole_growth`), the algebra of a shaft that is
stiffer across one axis. The chart of any machine is Floquet's. Yang et al. (2004) study a large
induction motor; their text could not be read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.stability import floquet_all
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.model import Model

KNOWN = 1e-3  # of a multiplier: one that is known less well says nothing


def two_pole_band(mass: float, stiffness: float, pull: float,
                  damping: float = 0.0) -> tuple[float, float] | None:
    """Electrical frequencies between which a Jeffcott rotor is unstable, rad/s; None where damping
    closes the band.

    (k − k_m − m ω²)² + (c ω)² = (k_m/2)²: where an axis of the turning frame has no stiffness left.
    Without damping √((k − 3k_m/2)/m) and √((k − k_m/2)/m). pull: k_m, N/m, at most two thirds of k,
    or the rotor is pulled in at rest. Raises BadInput for a pull above that.
    """
    if pull > 2 / 3 * stiffness:
        raise BadInput(f"pull is {pull:.4g} N/m; above two thirds of the stiffness, "
                       f"{2 / 3 * stiffness:.4g} N/m, the band "
                       "reaches down to standstill.")
    # a quadratic in ω²: m² ω⁴ − (2 m (k − k_m) − c²) ω² + (k − k_m)² − (k_m/2)² = 0
    rest = stiffness - pull
    half = (2 * mass * rest - damping**2) / (2 * mass**2)
    root = half**2 - (rest**2 - pull**2 / 4) / mass**2
    if root < 0 or half < 0:
        return None
    return math.sqrt(max(0.0, half - math.sqrt(root))), math.sqrt(half + math.sqrt(root))


def two_pole_growth(mass: float, stiffness: float, pull: float, damping: float,
                    frequency: float) -> float:
    """Largest real part of the eigenvalues of the Jeffcott rotor in the frame that turns with ω,
    1/s, exact.

    m (r̈ + 2iω ṙ − ω² r) + c (ṙ + iω r) + (k − k_m) r − (k_m/2) r̄ = 0 for z + ix = r e^{iωt}.
    """
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])  # i on (Re r, Im r)
    stiff = ((stiffness - pull - mass * frequency**2) * np.eye(2) + damping * frequency * turn
             - pull / 2 * np.diag([1.0, -1.0]))
    velocity = damping * np.eye(2) + 2 * mass * frequency * turn
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiff / mass, -velocity / mass]])
    return float(np.linalg.eigvals(matrix).real.max())


@dataclass(frozen=True, eq=False)
class StabilityChart:
    """Growth of a small disturbance of the centred rotor over speed and field.

    speeds: rad/s, (s,). fields: factors on the card's flux density, (f,). growth: 1/s, the
    logarithm of the leading multiplier over the period; above zero is unstable, nan where it is not
    known to a thousandth; (f, s).
    """

    speeds: NDArray
    fields: NDArray
    growth: NDArray

    @property
    def unstable(self) -> NDArray:
        """Where a disturbance grows, (f, s)."""
        return self.growth > 0

    def band(self, row: int) -> tuple[float, float] | None:
        """First and last unstable speed of a row, rad/s, or None."""
        found = self.speeds[self.unstable[row]]
        return (float(found[0]), float(found[-1])) if len(found) else None


def stability_chart(model: Model, speeds: ArrayLike, fields: ArrayLike, *, revolutions: int = 1,
                    guard: bool = False) -> StabilityChart:
    """Floquet's growth of a rotor without unbalance in a concentric stator, over speed and field.

    speeds: rad/s, above 0. fields: factors on the flux density. revolutions: after which the forces
    repeat. guard: check each point with more harmonics, modes and steps, which is several times
    slower (`floquet`).
    """
    speeds, fields = np.asarray(speeds, dtype=float), np.asarray(fields, dtype=float)
    still = model.with_unbalance(0)
    balance = HarmonicBalance(max(2, revolutions), revolutions=revolutions)
    growth = np.full((len(fields), len(speeds)), np.nan)
    for i, field in enumerate(fields):
        there = still.with_field(float(field))
        for j, speed in enumerate(speeds):
            growth[i, j] = centred_growth(there, float(speed), balance, guard)
    return StabilityChart(speeds, fields, growth)


def centred_growth(model: Model, speed: float, balance: HarmonicBalance, guard: bool) -> float:
    """Growth of a disturbance of the steady state at one speed, 1/s, or nan."""
    try:
        orbit = balance.solve(model, speed)
    except (NoConvergence, Contact):
        return math.nan
    found = floquet_all([orbit], guard=guard)[0]
    size = abs(found.multipliers[0])
    period = 2 * math.pi * balance.revolutions / speed
    return math.log(size) / period if found.error < KNOWN * size else math.nan
