"""A rigid generator rotor with its hub off the middle of its rim (Gustavsson and Aidanpää 2006).

A rim on a spider is a rigid body with four degrees of freedom. Its hub sits on an elastic shaft
between two bearings, a distance ℓ above the middle of the rim. The pull acts in the rim's middle,
so at the hub it is a force and a moment; where the rim leans, each height of it is pulled by its
own gap, which adds the moment k h²/12 times the lean. The script asks how far off the middle the
stator may be before the rotor is pulled over, for any ℓ and place of the hub, and asks the same of
the Kaplan unit. The parameters are our own, of a 70 MW unit's size.
"""

from dataclasses import replace

import numpy as np

from hydrolab import follow, load_machine, rpm, vary
from hydrolab.dynamics import equilibrium, largest_offset
from hydrolab.figures import house_style, new_figure
from hydrolab.machine import AirGap, Machine, RadialBearing, RayleighDamping, RigidBody, Shaft

SPEED, LENGTH, HEIGHT = rpm(125), 6.0, 1.6


def unit(hub: float, distance: float, tilt: bool = True) -> Machine:
    """A 250 t rotor at the share `hub` of the shaft, its rim's middle `distance` below the hub, m.
    """
    nodes = np.unique(np.round([*np.linspace(0, LENGTH, 7), hub * LENGTH], 9))
    rotor = RigidBody("rotor", int(np.argmin(abs(nodes - hub * LENGTH))), 2.5e5, 1.2e6, 2.0e6,
                      distance)
    bearings = (RadialBearing("upper", 0, 8e8), RadialBearing("lower", len(nodes) - 1, 8e8))
    return Machine("rigid rotor", SPEED, Shaft(nodes, 0.75, 2e11, 7850.0), (rotor,), bearings,
                   damping=RayleighDamping(0.01),
                   air_gap=AirGap("rotor", 0.55, 3.7, HEIGHT, 0.015, tilt))


distances, hubs = np.linspace(-1.5, 1.5, 7), (0.2, 0.35, 0.5)
most = {(hub, tilt): np.array([largest_offset(unit(hub, d, tilt).model()) for d in distances])
        for hub in hubs for tilt in (True, False)}
low, high = most[0.35, True].argmin(), most[0.35, True].argmax()
print("Finding: the distance between hub and rim decides how much offset is borne: with the hub "
      "at 35 % of the shaft the "
      f"rotor stands up to {100 * most[0.35, True][high]:.1f} % of the gap with the rim "
      f"{distances[high]:+.2f} m below the "
      f"hub, and {100 * most[0.35, True][low]:.1f} % at {distances[low]:+.2f} m.")
print()
print("Largest stable static eccentricity, % of the gap (pull that tilts / force in the middle "
      "only)")
print("rim below hub, m " + "".join(f"  hub at {100 * hub:.0f} %  " for hub in hubs))
for i, distance in enumerate(distances):
    cells = (f"   {100 * most[hub, True][i]:4.1f} / {100 * most[hub, False][i]:4.1f}  "
             for hub in hubs)
    print(f"{distance:16.2f} " + "".join(cells))

print()
middle = equilibrium(unit(0.35, 0.5).model(), 0.0)
pushed = equilibrium(unit(0.35, 0.5).model(), 0.8 * most[0.35, True][4])
for name, rest in (("centred", middle), (f"at {100 * pushed.static_eccentricity:.1f} %", pushed)):
    values = rest.eigenvalues(SPEED)
    slow = sorted((v for v in values if v.imag > 0), key=abs)[:4]
    print(f"Hub at 35 %, rim 0.5 m below it, {name}: lean {1e6 * np.hypot(*rest.local[2:]):.0f} "
          "µrad; eigenvalues "
          + ", ".join(f"{v.real:.2f} ± {v.imag:.2f} i" for v in slow) + " 1/s")

kaplan = load_machine("kaplan-150rpm")
print()
print("The Kaplan unit on its 12 elements: generator centre above the shaft top, largest offset at "
      "rest, fold in operation")
for offset in (-0.6, -0.472, -0.3):
    for tilt in (True, False):
        model = replace(vary(kaplan, {"bodies.generator.offset": offset}),
                        air_gap=replace(kaplan.air_gap, tilt=tilt)).model()
        branch = follow(model, to=0.3, speed=rpm(150))
        fold = f"{100 * branch.folds[0].value:.2f} %" if branch.folds else branch.stopped
        print(f"  {-1e3 * offset:4.0f} mm, {'tilting' if tilt else 'upright'} pull: "
              f"{100 * largest_offset(model):.2f} %, {fold}")

with house_style():
    figure = new_figure(8, 5)
    axes = figure.subplots()
    for hub, colour in zip(hubs, ("#0072B2", "#D55E00", "#009E73"), strict=True):
        axes.plot(distances, 100 * most[hub, True], color=colour, label=f"hub at {100 * hub:.0f} % "
                  "of the shaft")
        axes.plot(distances, 100 * most[hub, False], "--", color=colour, linewidth=1.2)
    axes.set(xlabel="middle of the rim below the hub, m", ylabel="largest stable eccentricity, % "
             "of the gap", ylim=(0, None),
             title="Stable below the line; dashed: pull without tilt")
    axes.legend()
    figure.savefig("rigid_rotor.png")
print()
print("Not reproduced: the paper's 70 MW parameters and its stability maps could not be read, so "
      "the numbers are not "
      "theirs; the dependence on the hub's distance and the possibility of instability are.")
