"""What a branch and an orbit say of each other, for every force law there is."""

import numpy as np
import pytest

from hydrolab import HarmonicBalance, follow
from hydrolab.dynamics.harmonics import PERIOD
from tests.machines import MACHINES


@pytest.fixture(scope="module", params=MACHINES)
def branch(request):
    """A branch of each machine: along the eccentricity, or along the speed where there is no gap.
    """
    machine = MACHINES[request.param]()
    model, speed = machine.model(), machine.speed
    if np.isfinite(model.gap):
        return follow(model, to=0.04, speed=speed)
    return follow(model, "speed", to=1.05 * speed, speed=speed)


def test_a_branch_has_the_gaps_and_the_motions_of_its_orbits(branch):
    assert branch.local.shape == (len(branch), len(branch.equations.linear), 9)
    for k in range(len(branch)):
        orbit = branch[k]
        assert branch.smallest_gaps[k] == orbit.smallest_gap
        assert np.array_equal(branch.local[k], orbit.local)
        if not np.isfinite(orbit.model.gap):
            continue
        # no law reports more room than an upright round rotor has in the narrowest place
        away = orbit.positions(PERIOD) - orbit.centre[:, None]
        assert orbit.smallest_gap <= orbit.model.gap - np.hypot(*away).max() + 4.1e-4


def test_the_last_point_is_the_steady_state_there(branch):
    last = branch[-1]
    alone = HarmonicBalance().solve(last.model, last.speed, last.static_eccentricity, start=last)
    assert np.abs(alone.local - last.local).max() < 1e-9 * last.model.length_scale
