"""What the machine does: steady states, branches, stability and motions in time.

`harmonic_balance` finds a periodic orbit, `paths` are the parameters it can be followed along,
`following` goes through folds with `continuation`, `branches` is what comes of it; `stability` says
which orbits last, by `winding`. `batch` solves many at once and `maps` over two parameters.
`steady_states` gathers all that can be found. `integrate` moves in time, `ensemble` many motions
side by side, `slow_change` a parameter while they move, `run` the speed and the field, from a start
to a runaway; `escape` is how they leave. `modes`, `reduction` and `equilibrium` are the linear
machine; `harmonics` holds sums of harmonics, `results` what comes out. `probes` are
records, `identify` the numbers and `balancing` the masses they ask for. A function that bears its
module's name (`modes`, `identify`, `run`, `steady_states`) is imported from `hydrolab`.
"""

from hydrolab.dynamics.balancing import first_order, influence
from hydrolab.dynamics.branches import Branch, branch_stability, orbits_at, stable_orbits_at
from hydrolab.dynamics.continuation import arclength, locate_fold
from hydrolab.dynamics.ensemble import basins, split
from hydrolab.dynamics.equilibrium import equilibrium, largest_offset
from hydrolab.dynamics.escape import arrivals, integrity
from hydrolab.dynamics.following import Arclength, follow, sweep
from hydrolab.dynamics.harmonic_balance import HarmonicBalance, first_guess
from hydrolab.dynamics.harmonics import ellipse, fit, fourier_rows, rates, synthesise
from hydrolab.dynamics.maps import processes, steady_map, steady_row
from hydrolab.dynamics.modes import undamped_frequencies
from hydrolab.dynamics.probes import whole_orders
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.dynamics.slow_change import drift, poincare, sweep_in_time
from hydrolab.dynamics.stability import floquet, floquet_all, strang_product
from hydrolab.dynamics.steady_states import SteadyStates, branch_off

__all__ = [
    "Arclength", "Branch", "HarmonicBalance", "PeriodicOrbit", "SteadyStates", "arclength",
    "arrivals", "basins", "branch_off", "branch_stability", "drift", "ellipse", "equilibrium",
    "first_guess", "first_order", "fit", "floquet", "floquet_all", "follow", "fourier_rows",
    "influence", "integrity", "largest_offset", "locate_fold", "orbits_at", "poincare", "processes",
    "rates", "split", "stable_orbits_at", "steady_map", "steady_row", "strang_product", "sweep",
    "sweep_in_time", "synthesise", "undamped_frequencies", "whole_orders",
]
