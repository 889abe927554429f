"""What the machine does: steady states, branches, stability and motions in time.

`harmonic_balance` finds a periodic orbit, `branches` follows it through folds with `continuation`,
`stability` says which orbits last, `batch` solves many at once and `maps` over two parameters.
`steady_states` gathers all that can be found. `integrate` moves in time, `ensemble` many motions
side by side, `slow_change` a parameter while they move; `escape` is how they leave. `modes`,
`reduction` and `equilibrium` are the linear machine; `harmonics` holds sums of harmonics, `results`
what comes out. A function that bears its module's name (`modes`, `integrate`, `steady_states`) is
imported from `hydrolab`.
"""

from hydrolab.dynamics.branches import Arclength, arclength, follow, locate_fold, orbits_at, sweep
from hydrolab.dynamics.ensemble import basins, split
from hydrolab.dynamics.equilibrium import equilibrium, largest_offset
from hydrolab.dynamics.escape import arrivals, integrity
from hydrolab.dynamics.harmonic_balance import HarmonicBalance, first_guess
from hydrolab.dynamics.harmonics import ellipse, fit, fourier_rows, rates, synthesise
from hydrolab.dynamics.maps import processes, steady_map, steady_row
from hydrolab.dynamics.modes import undamped_frequencies
from hydrolab.dynamics.results import Branch, PeriodicOrbit
from hydrolab.dynamics.slow_change import drift, poincare, sweep_in_time
from hydrolab.dynamics.stability import (
    branch_stability,
    floquet,
    floquet_all,
    stable_orbits_at,
    strang_product,
)
from hydrolab.dynamics.steady_states import SteadyStates, branch_off

__all__ = [
    "Arclength", "Branch", "HarmonicBalance", "PeriodicOrbit", "SteadyStates", "arclength",
    "arrivals", "basins", "branch_off", "branch_stability", "drift", "ellipse", "equilibrium",
    "first_guess", "fit", "floquet", "floquet_all", "follow", "fourier_rows", "integrity",
    "largest_offset", "locate_fold", "orbits_at", "poincare", "processes", "rates", "split",
    "stable_orbits_at", "steady_map", "steady_row", "strang_product", "sweep", "sweep_in_time",
    "synthesise", "undamped_frequencies",
]
