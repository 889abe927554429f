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

from hydrolab import HarmonicBalance, ellipse, floquet, load_machine, modes
from hydrolab.dynamics import floquet_all
from hydrolab.machine import Machine, Model

BALANCE = HarmonicBalance(4)


def tangential_limit(mass: float, damping: float, stiffness: float, pull: float) -> float:
    """Largest |k_t|, N/m, of a stable Jeffcott rotor: c √((k − k_r)/m).

    mass: kg. damping: c, N s/m. stiffness: k of the spring, N/m. pull: k_r, N/m, less than k, or
    nan comes back.
    """
    return damping * math.sqrt((stiffness - pull) / mass) if pull < stiffness else math.nan


def with_share(machine: Machine, share: float) -> Model:
    """The machine's model with a tangential pull of this share of the pull along the eccentricity.
    """
    return replace(machine, air_gap=replace(machine.air_gap, tangential=share)).model()


def growth(share: float, machine: Machine) -> float:
    """Floquet's growth of the centred rotor, 1/s."""
    orbit = BALANCE.solve(with_share(machine, share).with_unbalance(0), machine.speed)
    found = floquet_all([orbit], quick=True)[0]
    return math.log(abs(found.multipliers[0])) * machine.speed / (2 * math.pi)


def largest(share: float, machine: Machine) -> float:
    """Largest real part of the eigenvalues of the centred machine, all its coordinates, 1/s."""
    model = with_share(machine, share)
    slope = model.selection.T @ model.law.linearise(np.zeros(2))[1] @ model.selection
    return float(modes(replace(model, K=model.K - slope), machine.speed).eigenvalues.real.max())


def main() -> None:
    """Print the limits by formula, by Floquet and by eigenvalues, and orbits around them."""
    point = load_machine("jeffcott")
    m, c, k, pull = (float(v) for v in (point.bodies[0].mass, point.bearings[0].damping[0, 0],
                                        point.bearings[0].stiffness[0, 0],
                                        point.air_gap.pull_stiffness))
    exact = tangential_limit(m, c, k, pull) / pull
    found = brentq(growth, 0.9 * exact, 1.1 * exact, args=(point,), xtol=1e-9)
    unit = load_machine("kaplan-150rpm")
    forward, backward = (brentq(growth, 1e-3 * sign, 0.2 * sign, args=(unit,), xtol=1e-7)
                         for sign in (1, -1))
    check = brentq(largest, 1e-3, 0.2, args=(unit,), xtol=1e-7)
    print("Finding: a point mass with 1 % of damping is stable up to a tangential pull of "
          f"{100 * exact:.4f} % of the radial one by the formula and {100 * found:.4f} % by "
          f"Floquet; the hydropower unit up to {100 * forward:.3f} %.\n")
    print(f"The unit: forward whirl grows above {100 * forward:.3f} % (eigenvalues: "
          f"{100 * check:.3f} %), backward whirl below {100 * backward:.3f} %.\n")
    print("tangential, % of radial   mean across, µm   1X, µm   leading multiplier   (static "
          "eccentricity 5 %)")
    for share in (-0.02, -0.01, 0.0, 0.01, 0.02, 0.05):
        orbit = BALANCE.solve(with_share(unit, share), unit.speed, 0.05)
        lead = floquet(orbit)
        print(f"{100 * share:14.0f} {1e6 * orbit.mean[1]:20.1f} "
              f"{1e6 * ellipse(orbit.coefficients).major:11.1f} "
              f"{abs(lead.multipliers[0]):14.5f} {lead.verdict}")
    ratio = c / (2 * math.sqrt(k * m))
    print(f"\nThe limit goes with the damping: {100 * ratio:.0f} % of critical damping bear "
          f"{100 * exact:.2f} % here, and twice as much "
          f"{100 * tangential_limit(m, 2 * c, k, pull) / pull:.2f} %.\n\n"
          "Not reproduced: the tangential pull of a real damper winding, which depends on the "
          "frequency of the whirl and on the circuit; here it is a constant share, varied over "
          "what the limits need.")


if __name__ == "__main__":
    main()
