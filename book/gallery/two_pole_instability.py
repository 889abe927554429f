"""Two poles and a flexible rotor (Yang et al. 2004): the pull's stiffness turns with 2f, and a band
of speeds is unstable.

In the frame that turns with the field the pull of one pole pair is a constant, different along and
across the field. There a point mass has an exact band of instability, between the frequencies at
which one of the two axes has no stiffness left. Floquet's multipliers know nothing of that frame.
Phases out of balance add a wave that turns backward.
"""

import math
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from hydrolab import HarmonicBalance, load_machine
from hydrolab.dynamics.parametric import centred_growth, stability_chart, two_pole_band
from hydrolab.figures.practice_figure import stability_map
from hydrolab.machine.pole_pairs import Poles
from hydrolab.machine.parts import AirGap, Machine, RadialBearing, RigidBody

RPM = 30 / math.pi
air = AirGap("rotor", 0.5, 0.25, 1.0, 0.005)
mass, stiffness = 1800.0, 1.3e8
damping = 0.02 * math.sqrt(stiffness * mass)
pull = air.pull_stiffness


def point_mass(poles: Poles):
    """A balanced point mass on a spring in this field."""
    return Machine("two poles", 200.0, None, (RigidBody("rotor", 0, mass, 0.0, 0.0),),
                   (RadialBearing("spring", 0, stiffness, damping),), air_gap=air,
                   poles=poles).model()


def growth(speed: float, poles: Poles) -> float:
    """Floquet's growth at a speed (rad/s), 1/s."""
    return centred_growth(point_mass(poles), speed, HarmonicBalance(2), False)


exact = two_pole_band(mass, stiffness, pull, damping)
found = [brentq(growth, 0.98 * edge, 1.02 * edge, args=(Poles(1),), xtol=1e-7) for edge in exact]
unit = load_machine("two-pole")
whole = stability_chart(replace(unit, poles=Poles(1)).model(), np.arange(1900, 2601, 50) / RPM,
                        [1.0])
low, high = (edge * RPM for edge in whole.band(0))
print(f"Finding: the centred rotor is unstable from {exact[0] * RPM:.3f} to {exact[1] * RPM:.3f} "
      "rpm by the frame that "
      f"turns with the field, and from {found[0] * RPM:.3f} to {found[1] * RPM:.3f} rpm by Floquet.")
print()
print(f"The two-pole machine with its shaft, in steps of 50 rpm: unstable from {low:.0f} to "
      f"{high:.0f} rpm; its rated "
      f"{unit.speed * RPM:.0f} rpm lie above.")
print()
print("flux density   pull over spring   unstable band, rpm (point mass, exact)")
for field in (0.3, 0.5, 0.7, 0.9, 1.0):
    band = two_pole_band(mass, stiffness, pull * field**2, damping)
    words = "none" if band is None else f"{band[0] * RPM:.1f} to {band[1] * RPM:.1f}"
    print(f"{field:8.1f}  {pull * field**2 / stiffness:17.3f}      {words}")
print()
print("backward wave, % of the forward one   growth at 226 rad/s, 1/s   at 262 rad/s, 1/s")
for backward in (0.0, 0.1, 0.2, 0.4):
    rates = [growth(speed, Poles(1, backward=backward)) for speed in (226.0, 262.0)]
    print(f"{100 * backward:20.0f} {rates[0]:32.2f} {rates[1]:20.2f}")
print()
chart = stability_chart(point_mass(Poles(1)), np.linspace(1900, 2700, 33) / RPM,
                        np.linspace(0.2, 1.0, 9))
bands = [(f, *b) for f in np.linspace(0.2, 1.0, 60)
         if (b := two_pole_band(mass, stiffness, pull * f**2, damping))]
picture = stability_map(chart, tuple(map(list, zip(*bands, strict=True))))
print(picture.reading, "Picture:", picture.save("two_pole_instability.png").name)
print()
print("Not reproduced: the paper's machine, its chart and its response to unbalance, because the "
      "text could not be read; "
      "the model here is the linear pull of one pole pair, of which only the band's exact edges "
      "are certain.")
