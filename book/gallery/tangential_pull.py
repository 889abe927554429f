"""A pull across the eccentricity from damper circuits, and how much of it a rotor can bear (after
Karlsson et al. 2007).

F = k_r e + k_t J e, J the quarter turn from z to x: k_t > 0 pushes a forward whirl on its way and
k_t < 0 a backward one. A point mass is stable as long as c ω > |k_t| with ω = √((k − k_r)/m). On
the whole unit Floquet's multipliers find the limit, and the eigenvalues of its linearised equations
confirm it where the rotor is centred.
"""

import math
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from hydrolab import HarmonicBalance, ellipse, load_machine, modes
from hydrolab.dynamics.parametric import centred_growth
from hydrolab.dynamics.stability import floquet
from hydrolab.machine.pull import tangential_limit

BALANCE = HarmonicBalance(4)


def with_share(unit, share: float):
    """The machine's model with a tangential pull of this share of the pull along the eccentricity.
    """
    return replace(unit, air_gap=replace(unit.air_gap, tangential=share)).model()


def growth(share: float, unit) -> float:
    """Floquet's growth of the centred rotor, 1/s."""
    return centred_growth(with_share(unit, share).with_unbalance(0), unit.speed, BALANCE, False)


point = load_machine("jeffcott")
m, c, k, pull = (float(v) for v in (point.bodies[0].mass, point.bearings[0].damping[0, 0],
                                    point.bearings[0].stiffness[0, 0],
                                    point.air_gap.pull_stiffness))
exact = tangential_limit(m, c, k, pull) / pull
found = brentq(growth, 0.9 * exact, 1.1 * exact, args=(point,), xtol=1e-9)
unit = load_machine("kaplan-150rpm")
limits = [brentq(growth, 1e-3 * sign, 0.2 * sign, args=(unit,), xtol=1e-7) for sign in (1, -1)]


def largest(share: float) -> float:
    """Largest real part of the eigenvalues of the centred unit, all its coordinates, 1/s."""
    model = with_share(unit, share)
    slope = model.selection.T @ model.law.linearise(np.zeros(2))[1] @ model.selection
    return float(modes(replace(model, K=model.K - slope), unit.speed).eigenvalues.real.max())


check = brentq(largest, 1e-3, 0.2, xtol=1e-7)
print("Finding: a point mass with 1 % of damping is stable up to a tangential pull of "
      f"{100 * exact:.4f} % of the radial "
      f"one by the formula and {100 * found:.4f} % by Floquet; the hydropower unit up to "
      f"{100 * limits[0]:.3f} %.")
print()
print(f"The unit: forward whirl grows above {100 * limits[0]:.3f} % (eigenvalues: "
      f"{100 * check:.3f} %), backward whirl "
      f"below {100 * limits[1]:.3f} %.")
print()
print("tangential, % of radial   mean across, µm   1X, µm   leading multiplier   (static "
      "eccentricity 5 %)")
for share in (-0.02, -0.01, 0.0, 0.01, 0.02, 0.05):
    orbit = BALANCE.solve(with_share(unit, share), unit.speed, 0.05)
    lead = floquet(orbit)
    print(f"{100 * share:14.0f} {1e6 * orbit.mean[1]:20.1f} "
          f"{1e6 * ellipse(orbit.coefficients).major:11.1f} "
          f"{abs(lead.multipliers[0]):14.5f} {lead.verdict}")
print()
ratio = c / (2 * math.sqrt(k * m))
print(f"The limit goes with the damping: {100 * ratio:.0f} % of critical damping bear "
      f"{100 * exact:.2f} % here, and twice "
      f"as much {100 * tangential_limit(m, 2 * c, k, pull) / pull:.2f} %.")
print()
print("Not reproduced: the tangential pull of a real damper winding, which depends on the "
      "frequency of the whirl and on the "
      "circuit; here it is a constant share, varied over what the limits need.")
