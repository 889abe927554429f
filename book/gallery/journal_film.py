"""A short journal film with cavitation (Dubois and Ocvirk 1953), alone and under the pull.

Oil that leaves a bearing at its ends and bears no tension has a closed form for any motion of the
journal; it needs the velocity, the place and the speed. Two things are known of such films: beyond
a certain eccentricity a rigid rotor on them is stable at any speed, and near the middle of the
clearance the journal whirls at half the speed. The first is computed here from the law alone; the
second on the Kaplan unit with a film in place of its upper guide bearing.
"""

import math
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from hydrolab import HarmonicBalance, floquet, load_machine, rpm
from hydrolab.machine import JournalFilm, ShortFilm

film = ShortFilm(damping=1.0, clearance=1.0)  # in its own units: only shapes matter here


def whirl_ratio_squared(eccentricity: float) -> float:
    """Square of whirl speed over speed at the stability threshold of a rigid rotor; below 0 there
    is no threshold.
    """
    _, place, velocity = film.linearise(np.array([0.0, eccentricity]), np.zeros(2), 0.0, 1.0)
    k, c = -place, -velocity
    mean = (k[0, 0] * c[1, 1] + c[0, 0] * k[1, 1] - k[0, 1] * c[1, 0] - k[1, 0]
            * c[0, 1]) / np.trace(c)
    return ((mean - k[0, 0]) * (mean - k[1, 1]) - k[0, 1] * k[1, 0]) / np.linalg.det(c)


always = brentq(whirl_ratio_squared, 0.5, 0.9)
unit = load_machine("kaplan-150rpm")
guide = unit.bearings[0]
part = JournalFilm("film", guide.node, viscosity=0.03, journal_radius=0.39, film_length=0.234,
                   clearance=1.6e-4)
model = replace(unit, bearings=unit.bearings[1:], films=(part,)).model()
method = HarmonicBalance(8)


def growth(speed: float) -> float:
    """Leading multiplier of the centred orbit, less 1."""
    return floquet(method.solve(model, speed)).largest - 1


threshold = brentq(growth, rpm(110), rpm(150), xtol=1e-4)
below = floquet(method.solve(model, 0.97 * threshold))
ratio = abs(math.atan2(below.multipliers[0].imag, below.multipliers[0].real)) / (2 * math.pi)
print("Finding: a rigid rotor on a short cavitated film is stable at any speed beyond an "
      f"eccentricity of {always:.3f}, and "
      f"near the middle it whirls at {math.sqrt(whirl_ratio_squared(1e-3)):.3f} of the speed; the "
      "centred Kaplan unit on a "
      f"film whirls at {ratio:.3f} of its speed below {threshold * 30 / math.pi:.1f} rpm.")
print()
print("speed      stator offset 0 %, field on       2 %, field on                     0 %, field "
      "off")
for turns in (100, 125, 150, 175, 200):
    cells = []
    for field, offset in ((1.0, 0.0), (1.0, 0.02), (0.0, 0.0)):
        orbit = method.solve(model.with_field(field), rpm(turns), offset)
        stability = floquet(orbit)
        journal = orbit.coordinates(np.linspace(0, 2 * np.pi, 361))[2:]
        most = np.hypot(*journal).max() / part.clearance
        cells.append(f"|µ| {stability.largest:5.2f} {stability.verdict:<8} ε {most:.2f}")
    print(f"{turns} rpm    " + "        ".join(cells))
print()
print("The field is a negative stiffness: it turns the film's half-speed whirl loose at low speed, "
      "where the film is soft. "
      "A side load, here the pull of a stator 2 % off, presses the journal out of the middle and "
      "calms it.")
print()
print("Not reproduced: no paper gives a film for this unit; viscosity, length and clearance are "
      "our own, of a guide "
      "bearing's usual size, and the film is isothermal.")
