"""hydrolab: the dynamics of a hydropower generator under unbalanced magnetic pull."""

from __future__ import annotations

import math

from hydrolab.dynamics.continuation import Arclength, follow
from hydrolab.dynamics.harmonic_balance import HarmonicBalance, sweep
from hydrolab.dynamics.integrators import CentralDifference, Newmark, RungeKutta, integrate
from hydrolab.dynamics.reduction import reduce, truncation_error
from hydrolab.dynamics.solvers import newton, powell_dog_leg
from hydrolab.dynamics.stability import floquet
from hydrolab.errors import BadInput, Contact, NoConvergence

__version__ = "0.1.0"


def rpm(speed: float) -> float:
    """Revolutions per minute → rad/s."""
    return speed * math.pi / 30
