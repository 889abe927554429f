"""Where the negative stiffness of design tools is safe: the pull as F = k e against the nonlinear
pull.

A tool that knows linear bearings takes the pull as a bearing of negative stiffness. That is right
for small eccentricity and leaves out that the pull grows faster than the eccentricity. What a
designer reads off both is compared on the hydropower unit: critical speed, 1X amplitude, largest
bearing force and static bend.
"""

import numpy as np

from hydrolab import load_machine
from hydrolab.dynamics.practice import DesignNumbers, compare, practice_errors
from hydrolab.figures.practice_figure import practice_map

unit = load_machine("kaplan-150rpm")
model, speed = unit.model(), unit.speed
errors = practice_errors(model, speed, np.linspace(0, 0.15, 31), np.linspace(0.3, 1.1, 33))
row = int(np.argmin(np.abs(errors.fields - 1)))
print(f"Finding: at the card's field the practice keeps all four numbers within 5 % only up to "
      f"{100 * errors.safe_to(0.05)[row]:.1f} % static eccentricity, and at 8.5 % it sees "
      f"{100 + 100 * errors.amplitude[row, 17]:.0f} % of the 1X amplitude. The fold at "
      f"{100 * errors.folds[row]:.2f} % has "
      "no counterpart in it.")
print()
print("static         critical speed, rpm    1X, µm             bearing force, kN    static bend, "
      "µm")
print("eccentricity   practice  nonlinear    practice  nonlin.  practice  nonlin.    practice  "
      "nonlin.")
units = dict(zip(DesignNumbers._fields, (30 / np.pi, 1e6, 1e-3, 1e6), strict=True))
for eccentricity in (0.0, 0.02, 0.04, 0.06, 0.08):
    simple, exact = compare(model, speed, eccentricity)
    print(f"{100 * eccentricity:6.0f} %    " + "  ".join(
        f"{getattr(simple, name) * scale:9.1f} {getattr(exact, name) * scale:9.1f}"
        for name, scale in units.items()))
print()
print("flux density over the card's   within 5 % up to   within 10 % up to   fold, % of the gap")
for i in range(0, len(errors.fields), 4):
    five, ten = (100 * errors.safe_to(tolerance)[i] for tolerance in (0.05, 0.1))
    fold = f"{100 * errors.folds[i]:.2f}" if np.isfinite(errors.folds[i]) else "beyond 15.75"
    print(f"{errors.fields[i]:18.2f} {five:22.1f} % {ten:18.1f} %          {fold}")
print()
picture = practice_map(errors)
print(picture.reading, "Picture:", picture.save("design_practice.png").name)
print()
print("Not reproduced: nothing was published to compare with; how far a design tool is off depends "
      "on the unit, so run this "
      "with your own machine card.")
