"""One small machine for each force law, for tests that put every law through everything.

`MACHINES[name]()` is a `Machine`. Each has a steady state at its own speed at 2 % of the gap and a
branch from 0 to 4 %, "no gap" at 0 and along the speed; all are stable but that one, which has no
damping.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from hydrolab import load_machine
from hydrolab.machine.bearings import JournalFilm, PadBearing, RadialBearing, Seal, TableBearing
from hydrolab.machine.crack import Crack
from hydrolab.machine.gap_shape import GapShape
from hydrolab.machine.loads import Bow, Gravity, Load
from hydrolab.machine.parts import Machine
from hydrolab.machine.pole_pairs import Poles


def unit(**parts) -> Machine:
    """The paper's unit, 12 elements, with these parts."""
    return replace(load_machine("kaplan-150rpm"), **parts)


def gap(base: Machine | None = None, **numbers) -> Machine:
    """The paper's unit, or another machine, with these numbers of its air gap."""
    base = base or unit()
    return replace(base, air_gap=replace(base.air_gap, **numbers))


def jeffcott(**parts) -> Machine:
    """The point mass on springs, damped well, with these parts."""
    machine = load_machine("jeffcott")
    spring = machine.bearings[0]
    return replace(machine, **{"bearings": (replace(spring, damping=10 * spring.damping),),
                               **parts})


def guided(**parts) -> Machine:
    """The paper's unit with these parts in place of its upper guide bearing."""
    return unit(bearings=unit().bearings[1:], **parts)


UPPER = load_machine("kaplan-150rpm").bearings[0].node
PADS = PadBearing("pads", UPPER, 8, 1.37e9, 5e-5, rounding=3e-5)
CRACK = Crack("crack", 1, 0.2, phase=0.7, rounding_angle=3e-6)
OVAL = GapShape("oval", "stator", 2, 4e-4)



def loaded() -> Machine:
    """The paper's unit with everything that loads it whatever its motion."""
    collar, (upper, lower) = unit().thrust_bearings[0], unit().bearings
    return unit(gravity=Gravity(0.2), loads=(Load("radial thrust", 12, 5e4, 1.0, 0.2),),
                bows=(Bow("bow", 3, 7, 2e-5, 0.3),), bearings=(upper, replace(lower, x=5e-5)),
                thrust_bearings=(replace(collar, out_of_square=5e-5, phase=0.5),))


MACHINES: dict[str, Callable[[], Machine]] = {
    "round": unit,
    "point mass": jeffcott,
    "no gap": lambda: load_machine("three-disc"),
    "linear": lambda: gap(linear=True),
    "tilted": lambda: gap(tilt=True),
    "tangential": lambda: gap(tangential=0.005),
    "shaped stator": lambda: unit(shapes=(OVAL,)),
    "shaped turning rotor": lambda: unit(shapes=(OVAL, GapShape("lobes", "rotor", 3, 3e-4, 0.4))),
    # in step with the rotor: with slip nothing repeats after a revolution
    "one pole pair": lambda: replace(load_machine("two-pole"),
                                     poles=Poles(1, electrical_ratio=1.0)),
    "two pole pairs": lambda: replace(load_machine("two-pole"), poles=Poles(2)),
    "many pole pairs": lambda: unit(poles=Poles(20)),
    "loaded poles": lambda: replace(load_machine("two-pole"),
                                    poles=Poles(1, stator_mmf=0.4, load_angle=2.0)),
    "pads": lambda: guided(pad_bearings=(PADS,)),
    "film": lambda: guided(films=(JournalFilm("film", UPPER, 0.03, 0.4, 0.25, 1.5e-4),)),
    "crack": lambda: unit(cracks=(CRACK,)),
    "pads, crack and oval stator": lambda: guided(pad_bearings=(PADS,), cracks=(CRACK,),
                                                  shapes=(OVAL,)),
    "loaded": loaded,
    "plant's bearings": lambda: guided(
        tables=(TableBearing("oil", UPPER, [0.0, 10.0, 40.0], [1.5e9, [1.4e9, 1e8, -1e8, 1.3e9],
                                                               1.2e9], [1e6, 1e6, 5e5],
                             bracket_stiffness=8e9, bracket_mass=9e3, z=3e-5),),
        seals=(Seal("labyrinth", 12, -5e7, 1e6, 2e5, 1e4, 2e3),)),
    "bush": lambda: unit(bearings=(
        replace(unit().bearings[0], clearance=2e-5, damping=1e6), unit().bearings[1])),
    "unlike directions": lambda: jeffcott(bearings=(
        RadialBearing("springs", 0, [2.4e8, 3.0e8], 1.3e6),)),
}
