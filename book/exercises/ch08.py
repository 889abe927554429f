"""Chapter 8: the stiffness at the generator, the readings of 200 µm, and another machine that fits.
"""

from __future__ import annotations

from functools import cache

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

EQUAL = 9.04 / 12  # m, length of one of twelve equal elements
LINK = 0.472  # m, generator centre above the shaft top


@cache
def unit() -> Machine:
    """The course's machine."""
    return load_machine("kaplan-150rpm")


@cache
def model() -> Model:
    """Its model."""
    return unit().model()


def kappa(depth: float, *, link: float = LINK, span_from: float | None = None, bending: float = 1.0,
          shear: float = 1.0) -> float:
    """Stiffness at the generator over the pull's, Eq. (8.1), for a guide bearing at a depth, m,
    and a link of the generator to the shaft top, m.

    span_from: depth from which the span to the turbine bearing is counted. bending, shear: factors
    on these parts.
    """
    shaft = unit().shaft
    guide, turbine = (bearing.stiffness[0, 0] for bearing in unit().bearings)
    a = depth + link
    span = shaft.nodes[unit().bearings[1].node] - (depth if span_from is None else span_from)
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

EXERCISES = {
    "8.1": Exercise(lambda: kappa(EQUAL), see="Eq. (8.1)", mistakes=(
        Mistake(lambda right: right * model().law.stiffness / 1e6,
                "This is the stiffness in MN/m; κ is its ratio to the pull's.", see=STIFF),
        Mistake(lambda right: right * model().law.stiffness,
                "This is the stiffness in N/m; κ is its ratio to the pull's.", see=STIFF),
        Mistake(lambda right: 1 / right, "This is the pull over the stiffness, upside down.",
                see=STIFF),
        Mistake(lambda right: kappa(EQUAL, link=0.0),
                "The force acts at the generator centre, which stands above the shaft top.",
                see=STIFF),
        Mistake(lambda right: kappa(2 * EQUAL), "That is the second node below the shaft top.",
                see=STIFF),
        Mistake(lambda right: kappa(EQUAL, bending=1 / 16),
                "In I a diameter was taken for a radius: it makes the shaft 16 times too stiff "
                "in bending."),
    )),
    "8.2": Exercise(lambda: factor(AMPLITUDE / 2), see="Eq. (8.3)", mistakes=(
        Mistake(lambda right: factor(2 * AMPLITUDE),
                "Peak-to-peak is twice the radius, not half of it.", see=READINGS),
        Mistake(lambda right: factor(AMPLITUDE), "This keeps the radius of the card.",
                see=READINGS),
        Mistake(lambda right: factor(AMPLITUDE / 2, False),
                "This is without field; the colleague counts with it.", see=READINGS),
        Mistake(lambda right: right * 2**0.5,
                "This is for an rms value; peak-to-peak is asked for.", see=READINGS),
    )),
    "8.3": Exercise(lambda: fold_percent(factor(AMPLITUDE / 2)), see="One depth for one fold",
                    unit="%", mistakes=(
        Mistake(lambda right: fold_percent(1.0), "This is the fold with the card's unbalances.",
                see=READINGS),
        Mistake(lambda right: fold_percent(factor(2 * AMPLITUDE)),
                "This machine has too much unbalance: peak-to-peak is twice the radius.",
                see=READINGS),
        Mistake(lambda right: fold_percent(0.0),
                "This is the static pull-in, without any unbalance."),
        Mistake(lambda right: fold_percent(factor(AMPLITUDE / 2, False)),
                "This counts the 200 µm without field.", see=READINGS),
    )),
    "8.4": Exercise(lambda: 80.0, see="One depth for one fold", reply=another_machine),
}
