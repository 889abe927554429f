"""What a branch and an orbit say of each other, for every force law there is."""

import numpy as np
import pytest

from hydrolab import HarmonicBalance, follow
from hydrolab.dynamics.harmonics import PERIOD
from tests.machines import MACHINES


def branch_of(name):
    """A branch of a machine: along the eccentricity, or along the speed where there is no gap."""
    machine = MACHINES[name]()
    model, speed = machine.model(), machine.speed
    if np.isfinite(model.gap):
        return follow(model, to=0.04, speed=speed)
    return follow(model, "speed", to=1.05 * speed, speed=speed)


@pytest.fixture(scope="module", params=MACHINES)
def branch(request):
    return branch_of(request.param)


def test_a_branch_has_the_gaps_and_the_motions_of_its_orbits(branch, request):
    shaped = "shape" in request.node.callspec.id or "oval" in request.node.callspec.id
    assert branch.local.shape == (len(branch), len(branch.equations.linear), 9)
    for k in range(len(branch)):
        orbit = branch[k]
        assert branch.smallest_gaps[k] == pytest.approx(orbit.smallest_gap, rel=1e-13)
        assert np.array_equal(branch.local[k], orbit.local)
        if not np.isfinite(orbit.model.gap):
            continue
        away = orbit.positions(PERIOD) - orbit.centre[:, None]
        upright = orbit.model.gap - np.hypot(*away).max()
        assert orbit.smallest_gap <= upright + (4e-4 if shaped else 0) + 1e-7


def test_a_leaning_rotor_comes_nearest_with_an_end():
    """Looked for height by height; the branch once looked at an upright rotor, 9.414 for 9.139 mm.
    """
    branch = branch_of("tilted")
    u = branch[-1].coordinates(PERIOD)
    heights = np.linspace(-0.5, 0.5, 41) * MACHINES["tilted"]().air_gap.length
    away = u[:2, None] - branch[-1].centre[:, None, None] + u[2:, None] * heights[:, None]
    nearest = branch[-1].model.gap - np.hypot(*away).max()
    assert branch.smallest_gaps[-1] == pytest.approx(nearest, rel=1e-12)
    assert nearest < branch[-1].model.gap - np.hypot(*away[:, 20]).max() - 5e-5


def test_the_last_point_is_the_steady_state_there(branch):
    last = branch[-1]
    alone = HarmonicBalance().solve(last.model, last.speed, last.static_eccentricity, start=last)
    assert np.abs(alone.local - last.local).max() < 1e-9 * last.model.length_scale
