"""Three units that are not the paper's: Francis with three guide bearings, fast pump-turbine,
horizontal Pelton unit with an overhung runner.

Their cards ship with hydrolab and show what a card can hold: brackets, seals, water, a table over
the speed, radial thrust, weight across a lying shaft. Every number is marked; most are assumed,
since no unit of these kinds is published with all that a model needs. The first question to a unit
is how far its critical speeds are from the speeds at which it may turn, with the field and without.
"""

import math

from hydrolab import HarmonicBalance, critical_speeds, follow, load_machine, rpm
from hydrolab.figures import line_picture
from hydrolab.paper.assessment import nearest

UNITS = ("francis-three-guides", "pump-turbine", "pelton-horizontal")
OVER = 1.4  # of the rated speed, after a load rejection
SPEEDS = (("rated", 1.0), ("overspeed", OVER))


def margins(model, speed: float, pull: bool) -> list[float]:
    """How far the nearest critical speed that an unbalance meets is above the rated speed and the
    overspeed, %: where bearings differ between x and z that may be a backward one.
    """
    found = critical_speeds(model, pull=pull)
    return [100 * (nearest(found, share * speed) / (share * speed) - 1) for _, share in SPEEDS]


models = {name: load_machine(name).model() for name in UNITS}
pump, rated = models["pump-turbine"], rpm(500)
without, with_it = (margins(pump, rated, pull)[1] for pull in (False, True))
print(f"Finding: the first critical speed of the pump-turbine is {without:.1f} % above its "
      f"overspeed of {OVER * 500:.0f} rpm without the magnetic pull, and {with_it:.1f} % with it.")
print()
print("unit                    critical speed above rated / overspeed, %       1X, µm   smallest "
      "gap, mm   fold, %")
print("                        field off            field on")
for name, model in models.items():
    speed = load_machine(name).speed
    off, on = ("{:7.0f} /{:6.1f}".format(*margins(model, speed, pull)) for pull in (False, True))
    orbit = HarmonicBalance(4).solve(model, speed)
    branch = follow(model, to=0.7, speed=speed)
    fold = branch.folds[0].value if branch.folds else math.nan
    print(f"{name:22}{off:>16}     {on:>16}{1e6 * orbit.amplitudes[:, 0].max():18.1f}"
          f"{1e3 * orbit.smallest_gap:14.2f}{100 * fold:15.1f}")
print()
for name, model in models.items():
    orbit = HarmonicBalance(4).solve(model, load_machine(name).speed)
    print(f"{name}: {line_picture(orbit).reading}")
    print("  " + "; ".join(map(str, orbit.bearing_forces.values())) + ".")
print()
print("Not reproduced: no measured critical speed or vibration of such a unit was at hand with the "
      "numbers of its parts; a table of eight coefficients comes from a bearing program or maker.")
