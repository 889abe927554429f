"""Chapter 5: the fold of an ellipse, the field that moves a fold, a branch over the speed, and an
unguarded product.
"""

from __future__ import annotations

from functools import cache
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from hydrolab import Arclength, floquet, follow, load_machine, rpm
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
def branch() -> Branch:
    """The branch at the top of the chapter."""
    return follow(model(), "static_eccentricity", to=0.2, speed=rpm(150),
                  method=Arclength(max_folds=3))


def fold_with_field(ratio: float) -> float:
    """The first fold, as a fraction of the gap, with the field times a factor."""
    return follow(model().with_field(ratio), "static_eccentricity", to=0.5,
                  speed=rpm(150)).folds[0].value


@cache
def field_factor(fold: float) -> float:
    """The factor on the field that brings the first fold to a place."""
    return brentq(lambda ratio: fold_with_field(ratio) - fold, 0.8, 1.1, xtol=1e-5)


@cache
def over_speed(eccentricity: float, start: float = 100.0) -> Branch:
    """The branch over the speed at an eccentricity, from a start up to 400 rpm."""
    return follow(model(), "speed", to=rpm(400), speed=rpm(start), static_eccentricity=eccentricity)


def folds(of: Branch) -> list[float]:
    """The values of a branch's folds."""
    return [fold.value for fold in of.folds]


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
    "5.2": Exercise(lambda: field_factor(0.05), see="The rotor that whirls", rtol=0.002, mistakes=(
        Mistake(lambda right: right**2,
                "This is the factor on the pull, which grows with the square of the field."),
        Mistake(lambda right: 1 / right, "More field brings the fold down, not less."),
        Mistake(lambda right: field_factor(0.10), "This brings the fold to 10 % of the gap."),
    )),
    "5.3": Exercise(lambda: over_speed(0.03), see="Eq. (5.1)", measure=folds, mistakes=(
        Mistake(lambda right: over_speed(0.0),
                "The stator stands in the centre here; give `static_eccentricity`."),
        Mistake(lambda right: over_speed(0.05), "This is the branch at 5 %."),
        Mistake(lambda right: branch(), "This follows the eccentricity; follow the speed."),
    )),
    "5.4": Exercise(lambda: [branch().folds[0].after + 2, 8], see="A trap", reply=trapped),
}
