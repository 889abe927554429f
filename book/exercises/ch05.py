"""Chapter 5: the fold of an ellipse, the field that moves a fold, a stable stretch over the speed,
a count that is too coarse, and an unguarded product.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from hydrolab import (
    Arclength,
    branch_stability,
    floquet,
    follow,
    load_machine,
    orbits_at,
    rpm,
)
from hydrolab.course.answers import Exercise, Mistake
from hydrolab.dynamics.branches import Branch
from hydrolab.dynamics.continuation import arclength, locate_fold
from hydrolab.dynamics.ensemble import split
from hydrolab.dynamics.stability import strang_product
from hydrolab.machine.model import Model

MOST_STEPS = 4096


@cache
def model() -> Model:
    """The point mass on springs, in its field."""
    return load_machine("jeffcott").model()


def ellipse(y: NDArray, parameter: float) -> tuple[NDArray, NDArray, NDArray]:
    """y² + (λ/3)² − 1 and its derivatives in y and the parameter λ."""
    return y**2 + (parameter / 3) ** 2 - 1, np.array([[2 * y[0]]]), np.array([2 * parameter / 9])


@cache
def fold_of_ellipse() -> float:
    """The fold at a positive λ."""
    walk = islice(arclength(ellipse, np.array([1.0]), 0.0, step=0.1, max_step=0.1), 120)
    return max(locate_fold(ellipse, a, b).parameter for a, b in pairwise(walk)
               if a.tangent[-1] * b.tangent[-1] < 0)


@cache
def branch(damping: float = 1.0) -> Branch:
    """The chapter's branch over the eccentricity, with a share of its damping."""
    lighter = replace(model(), C=damping * model().C)
    return follow(lighter, "static_eccentricity", to=0.2, speed=rpm(150),
                  method=Arclength(max_folds=3))


def unstable_at(eccentricity: float) -> list[int]:
    """Unstable exponents of each of its steady states with 3 % of its damping."""
    return [floquet(orbit).outside for orbit in orbits_at(branch(0.03), eccentricity)]


def fold_with_field(ratio: float) -> float:
    """The first fold, as a fraction of the gap, with the field times a factor."""
    return follow(model().with_field(ratio), "static_eccentricity", to=0.5,
                  speed=rpm(150)).folds[0].value


@cache
def field_factor(fold: float) -> float:
    """The factor on the field that brings the first fold to a place."""
    return brentq(lambda ratio: fold_with_field(ratio) - fold, 0.8, 1.1, xtol=1e-5)


@cache
def over_speed() -> tuple[list[float], float]:
    """Of the branch over the speed at 3 %: its first three folds and the flip between, rpm."""
    along = follow(model(), "speed", to=rpm(400), speed=rpm(100), static_eccentricity=0.03,
                   method=Arclength(max_folds=3))
    return ([fold.value / rpm(1) for fold in along.folds],
            branch_stability(along).flips[0].value / rpm(1))


def trapped(answer: list[float]) -> str:
    """What the unguarded product and `floquet` say of a point of the branch."""
    row, steps = (int(value) for value in answer)
    if not (0 <= row < len(branch()) and 1 <= steps <= MOST_STEPS):
        return (f"a point from 0 to {len(branch()) - 1} and from 1 to {MOST_STEPS} steps are asked "
                f"for; these are {answer}.")
    orbit, counted = branch()[row], floquet(branch()[row])
    product = strang_product(split(model(), rpm(150), 2), orbit.coefficients[None],
                             orbit.centre[None], steps)[0]
    largest = abs(np.linalg.eigvals(product)).max()
    caught = largest < 1 and counted.verdict == "unstable"
    return (f"noted. At point {row}, {branch().path.say(branch().values[row])}, {steps} steps give "
            f"{largest:.3f} and the "
            f"count says {counted.verdict}: "
            f"{'a trap' if caught else 'no trap; look nearer to a fold'}.")


EXERCISES = {
    "5.1": Exercise(fold_of_ellipse, see="A circle first", rtol=1e-4, mistakes=(
        Mistake(lambda right: 1.0, "This is the circle's fold; the ellipse is stretched along λ."),
        Mistake(lambda right: 1 / right, "The ellipse is stretched along λ, not squeezed."),
        Mistake(lambda right: right**2, "The factor stands inside the square."),
    )),
    "5.2": Exercise(lambda: field_factor(0.05), see="The rotor that whirls",
                    unit="times the card's field", rtol=0.002, mistakes=(
        Mistake(lambda right: right**2,
                "This is the factor on the pull, which grows with the square of the field."),
        Mistake(lambda right: 1 / right, "More field brings the fold down, not less."),
        Mistake(lambda right: field_factor(0.10), "This brings the fold to 10 % of the gap."),
    )),
    "5.3": Exercise(lambda: [over_speed()[1], over_speed()[0][2]], see="What happens at the fold",
                    unit="rpm", rtol=0.002, mistakes=(
        Mistake(lambda right: over_speed()[0][1:],
                "These are the folds. A leg need not be stable from end to end: look where "
                "multipliers pass the circle elsewhere."),
        Mistake(lambda right: right[::-1], "These are the two ends, in the other order."),
        Mistake(lambda right: [100.0, over_speed()[0][0]],
                "This is the stable part of the first leg; the third is asked for."),
        Mistake(lambda right: [over_speed()[0][1], right[0]],
                "This is the part of the third leg that is unstable."),
    )),
    "5.4": Exercise(lambda: unstable_at(0.02), see="Eq. (5.7)", mistakes=(
        Mistake(lambda right: [n - 2 for n in right],
                "No number of exponents is negative. The samples are too far apart: whole turns "
                "of f pass between two of them."),
        Mistake(lambda right: [abs(n - 2) for n in right],
                "A sign does not mend a count: take more samples, until it stays."),
        Mistake(lambda right: [max(n - 2, 0) for n in right],
                "Nothing below zero was counted, but the count is wrong where it looks right, "
                "too: take more samples."),
        Mistake(lambda right: right[::-1], "In the order of `orbits_at`."),
    )),
    "5.5": Exercise(lambda: [branch().folds[0].after + 2, 8], see="A trap", reply=trapped, rubric=(
        (1, "an orbit that is unstable by the count"),
        (1, "a product that says stable, and its number of steps"),
        (1, "why such orbits lie near a fold"),
        (1, "a check that would have caught it, such as twice the steps"))),
}
