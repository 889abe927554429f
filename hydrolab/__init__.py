"""hydrolab: the dynamics of a hydropower generator under unbalanced magnetic pull."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.balancing import TrialRun, balance
from hydrolab.dynamics.branches import branch_stability, orbits_at, stable_orbits_at
from hydrolab.dynamics.ensemble import basins
from hydrolab.dynamics.escape import arrivals, integrity
from hydrolab.dynamics.following import Arclength, follow, sweep, update_branch
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.harmonics import ellipse, self_crossings
from hydrolab.dynamics.identify import identify
from hydrolab.dynamics.integrate import CentralDifference, Newmark, RungeKutta, integrate
from hydrolab.dynamics.maps import steady_map
from hydrolab.dynamics.modes import campbell, critical_speeds, modes, speed_margins
from hydrolab.dynamics.probes import made_up_record, read_record
from hydrolab.dynamics.reduction import reduce, truncation_error
from hydrolab.dynamics.run import Schedule, coast_down, load_rejection, run, runaway, start_up
from hydrolab.dynamics.slow_change import drift, poincare, sweep_in_time
from hydrolab.dynamics.solvers import newton, powell_dog_leg
from hydrolab.dynamics.stability import floquet
from hydrolab.dynamics.steady_states import branch_off, steady_states
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.cards import card_names, card_text, load_machine, vary
from hydrolab.machine.pull import CircularPull, LinearPull, ShapedPull
from hydrolab.machine.quantities import number

__version__ = "0.1.0"
__all__ = [
    "Arclength", "BadInput", "CentralDifference", "CircularPull", "Contact", "HarmonicBalance",
    "LinearPull", "Newmark", "NoConvergence", "RungeKutta", "Schedule", "ShapedPull", "TrialRun",
    "arrivals", "balance", "basins", "branch_off", "branch_stability", "campbell", "card_names",
    "card_text", "coast_down", "critical_speeds", "drift", "ellipse", "floquet", "follow",
    "identify", "integrate", "integrity", "load_machine", "load_rejection", "made_up_record",
    "modes", "newton", "orbits_at", "poincare", "powell_dog_leg", "read_record", "reduce", "rpm",
    "run", "runaway", "self_crossings", "speed_margins", "stable_orbits_at", "start_up",
    "steady_map", "steady_states", "sweep", "sweep_in_time", "truncation_error", "update_branch",
    "vary",
]

Speed = TypeVar("Speed", float, NDArray)


def rpm(speed: Speed) -> Speed:
    """Revolutions per minute, one or an array of them, → rad/s; BadInput for what is no number."""
    own = speed if isinstance(speed, np.ndarray) else number("speed", speed, unit="rpm")
    return own * math.pi / 30
