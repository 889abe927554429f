"""Figures of what happens past a fold: what they draw and what they say."""

import numpy as np
import pytest

from hydrolab import BadInput, basins, drift, follow, integrity, load_machine, orbits_at, rpm
from hydrolab.figures import basins_picture, hysteresis_picture, integrity_picture


@pytest.fixture(scope="module")
def branch():
    return follow(load_machine("kaplan-150rpm").model(), speed=rpm(150))


def test_basins_of_many_orbits(branch):
    """More orbits than the house has bright colours."""
    orbits = orbits_at(branch, 0.088)[:3]
    many = [*orbits, *orbits, orbits[0]]
    found = basins(many, np.linspace(-3e-3, 2e-3, 7), [0.0], revolutions=30)
    picture = basins_picture(found, [f"orbit {i}" for i in range(len(many))])
    assert f"Of 7 starts off orbit 0 (+), at phase 0, {100 * found.share(0):.0f} %" in str(
        picture.reading)
    with pytest.raises(BadInput, match="names has 2 for 7 orbits"):
        basins_picture(found, ["small", "large"])


def test_integrity_under_the_branch(branch):
    found = integrity(branch, [0.0, 0.05, 0.085], displacement=np.linspace(-7e-3, 7e-3, 9),
                      velocity=np.linspace(-0.1, 0.1, 9), revolutions=30)
    picture = integrity_picture(branch, found)
    upper, lower = picture.figure.axes
    assert picture.reading == str(found)
    assert lower.lines[0].get_ydata() == pytest.approx(100 * found.safe)
    assert lower.lines[0].get_xdata() == pytest.approx([0.0, 5.0, 8.5])
    assert lower.get_ylabel() == "safe pushes, %"
    assert "amplitude" not in upper.get_ylabel() and "0-to-peak" in upper.get_ylabel()


def test_a_drift_is_drawn_and_told(branch):
    moved = drift(orbits_at(branch, 0.05)[0], to=0.051, per_revolution=1e-4)
    picture = hysteresis_picture(branch, [], {"up": moved})
    assert ("up: repeats every revolution from 5.01 % to 5.1 %. It went all the way, at 5.1 %."
            in picture.reading)
    with pytest.raises(BadInput, match="runs along speed"):
        along = follow(branch.equations.model, "speed", to=rpm(151), speed=rpm(150))
        hysteresis_picture(along, [], {"up": moved})
