"""What a student said beside what came out."""

import pytest

from hydrolab.course.predictions import answered


@pytest.mark.parametrize(("prediction", "computed", "unit", "said"), [
    (..., -1.5951, "mm", "Computed: −1.6 mm. You have not predicted it"),
    (-1.5, -1.5951, "mm", "You said −1.5 mm: within 10 %."),
    (1.6, -1.5951, "mm", "the other sign"),
    (405, 42.4, "rad/s", "9.6 times as much"),
    (0.5, 1.0, "", "50 % of it"),
    (0, 1.0, "", "You said 0."),
    ("much", 1.0, "mm", "which is not a number of mm"),
    ("-X ", "-x", "", "the same"),
    ("+x", "-x", "", "not the same"),
    (..., "-x", "", "Computed: -x. You have not predicted it"),
])
def test_answered(prediction, computed, unit, said):
    assert said in answered(prediction, computed, unit)
