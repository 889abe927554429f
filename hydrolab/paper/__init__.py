"""The paper's study: what it claims beside what is computed.

`study` computes its figures' numbers, `claims` judges each claim, `calibration` finds what the
paper does not say and the family of machines that share its data, `report` prints and writes the
result. `assessment` is what is asked of any unit.
"""

from hydrolab.paper.calibration import (
    FREE,
    STEPS,
    calibrate,
    family_prior,
    first_fold,
    load_family,
    member_of,
    sensitivity,
    unbalance_scale,
    with_amplitude,
)
from hydrolab.paper.claims import judge
from hydrolab.paper.study import run_study, steady_study

__all__ = [
    "FREE", "STEPS", "calibrate", "family_prior", "first_fold", "judge", "load_family", "member_of",
    "run_study", "sensitivity", "steady_study", "unbalance_scale", "with_amplitude",
]
