"""Chapter 8: the stiffness at the generator, a circle of 3 mm, a reading of 200 µm, where the pull
wins, and another machine that fits.
"""

from __future__ import annotations

from functools import cache

from scipy.optimize import brentq

from hydrolab import load_machine, rpm
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.machine.model import Model
from hydrolab.machine.parts import Machine
from hydrolab.paper.calibration import (
    AMPLITUDE,
    Member,
    calibrate,
    first_fold,
    member_of,
    unbalance_scale,
)

LINK = 0.472  # m, generator centre above the shaft top


@cache
def unit() -> Machine:
    """The course's machine."""
    return load_machine("kaplan-150rpm")


@cache
def model() -> Model:
    """Its model."""
    return unit().model()


def kappa(depth: float = 0.0, *, link: float = LINK, bending: float = 1.0,
          shear: float = 1.0) -> float:
    """Stiffness at the generator over the pull's, Eq. (8.1), for a guide bearing at a depth, m, the
    card's where it is 0, and a link of the generator to the shaft top, m.

    bending, shear: factors on these parts.
    """
    shaft = unit().shaft
    guide, turbine = (bearing.stiffness[0, 0] for bearing in unit().bearings)
    depth = depth or shaft.nodes[unit().bearings[0].node]
    a = depth + link
    span = shaft.nodes[unit().bearings[1].node] - depth
    carried = shaft.shear_coefficient * shaft.young / (2 * (1 + shaft.poisson)) * shaft.area[0]
    parts = ((1 + a / span) ** 2 / guide + (a / span) ** 2 / turbine
             + bending * (a**3 - link**3 + a**2 * span) / (3 * shaft.young * shaft.second_moment[0])
             + shear * (a - link + a**2 / span) / carried)
    return float(1 / parts / model().law.stiffness)


@cache
def factor(amplitude: float, with_field: bool = True) -> float:
    """Factor on the card's unbalances for a centred circle of this amplitude, m, with_field or
    without.
    """
    return unbalance_scale(model(), rpm(150), amplitude, with_field=with_field)


@cache
def fold_percent(times: float) -> float:
    """First fold, % of the gap, with the card's unbalances times a factor."""
    return 100 * first_fold(model().with_unbalance(times))


def another_machine(mass: float) -> str:
    """What a machine with another generator mass, t, has to be to fit what is stated."""
    if not 60 <= mass <= 150:
        return f"noted, but {mass:g} t is outside 60 to 150 t."
    ours = member_of(unit(), "with field")
    found = calibrate({**ours.free, "generator_mass": 1e3 * mass}, "with field")
    if not isinstance(found, Member):
        return f"noted. Such a machine cannot be calibrated: {found}."
    return (f"noted. It fits what is stated with its guide bearing at {found.bearing_depth:.3f} m "
            "and unbalances of "
            f"{found.unbalance:.1f} kg m together; ours has {ours.bearing_depth:.3f} m and "
            f"{ours.unbalance:.1f} kg m.")


STIFF = "How stiff is the shaft at the generator"
READINGS = "Two readings of 200 µm"
AREA, INERTIA = (0.71 / 0.8) ** 2, (0.71 / 0.8) ** 4  # of flexibilities, for a shaft of 800 mm
RMS = 2**0.5 * AMPLITUDE


def thicker(bending: float = INERTIA, shear: float = AREA, link: float = LINK) -> float:
    """κ with the shaft of 800 mm, or with other factors on its parts."""
    return kappa(bending=bending, shear=shear, link=link)


def hopeless(link: float = LINK, times: float = 1.0) -> float:
    """Depth at which κ falls to `times`, m."""
    return brentq(lambda depth: kappa(depth, link=link) - times, 0.3, 4.0)


EXERCISES = {
    "8.1": Exercise(thicker, see="Eq. (8.1)", rtol=0.002, mistakes=(
        Mistake(lambda right: right * model().law.stiffness / 1e6,
                "This is the stiffness in MN/m; κ is its ratio to the pull's.", see=STIFF),
        Mistake(lambda right: right * model().law.stiffness,
                "This is the stiffness in N/m; κ is its ratio to the pull's.", see=STIFF),
        Mistake(lambda right: thicker(shear=1.0), "The area grows too, and with it the stiffness "
                "in shear."),
        Mistake(lambda right: thicker(bending=AREA), "I goes with the fourth power of the "
                "diameter."),
        Mistake(lambda right: kappa(), "This is the card's shaft."),
        Mistake(lambda right: kappa() / INERTIA, "Only the shaft becomes stiffer, not the "
                "bearings."),
        Mistake(lambda right: thicker(link=0.0),
                "The force acts at the generator centre, which stands above the shaft top.",
                see=STIFF),
        Mistake(lambda right: thicker(bending=INERTIA / 16),
                "In I a diameter was taken for a radius: it makes the shaft 16 times too stiff "
                "in bending."),
    )),
    "8.2": Exercise(lambda: factor(3e-3), see="Eq. (8.3)", mistakes=(
        Mistake(lambda right: 15.0, "The circle does not grow in proportion: the pull is stiffer "
                "at 3 mm.", see=READINGS),
        Mistake(lambda right: factor(3e-3, False), "This is without field.", see=READINGS),
        Mistake(lambda right: factor(1.5e-3), "This circle has a diameter of 3 mm.", see=READINGS),
        Mistake(lambda right: factor(6e-3), "This circle has a radius of 6 mm.", see=READINGS),
        Mistake(lambda right: factor(3e-4), "This is for 0.3 mm.", see=READINGS),
    )),
    "8.3": Exercise(lambda: fold_percent(factor(RMS)), see="One depth for one fold",
                    unit="% of the gap", rtol=0.003, mistakes=(
        Mistake(lambda right: fold_percent(1.0), "This is the fold with the card's unbalances.",
                see=READINGS),
        Mistake(lambda right: fold_percent(factor(AMPLITUDE / 2**0.5)),
                "An amplitude is √2 times the rms value, not the reverse.", see=READINGS),
        Mistake(lambda right: fold_percent(factor(2 * AMPLITUDE)),
                "This is for a radius of 400 µm.", see=READINGS),
        Mistake(lambda right: fold_percent(factor(AMPLITUDE / 2)),
                "This is for 200 µm peak-to-peak.", see=READINGS),
        Mistake(lambda right: fold_percent(0.0),
                "This is the static pull-in, without any unbalance."),
        Mistake(lambda right: fold_percent(factor(RMS, False)),
                "This counts the 200 µm without field.", see=READINGS),
    )),
    "8.4": Exercise(hopeless, see=STIFF, unit="m", rtol=0.003, mistakes=(
        Mistake(lambda right: hopeless(link=0.0), "The generator stands above the shaft top."),
        Mistake(lambda right: right + LINK, "This is the distance from the generator; the depth is "
                "counted from the shaft top."),
        Mistake(lambda right: hopeless(times=1.628), "There the static pull-in is at 8.9 %; "
                "some eccentricity is held."),
        Mistake(lambda right: 2 * 9.04 / 12, "This is the second node of equal elements; there the "
                "springs still win."),
    )),
    "8.5": Exercise(lambda: 80.0, see="One depth for one fold", reply=another_machine, rubric=(
        (1, "a machine that keeps the fold and the 200 µm"),
        (1, "in which results it differs from ours, and in which not"),
        (1, "which measurement would decide between the two"),
    )),
}
