"""The tangential pull: Floquet against the exact limit of a point mass, and against the eigenvalues
of the whole unit.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from hydrolab import floquet, load_machine, modes

POINT, UNIT = load_machine("jeffcott"), load_machine("kaplan-150rpm")
MASS, DAMPING, STIFFNESS = (POINT.bodies[0].mass, POINT.bearings[0].damping[0, 0],
                            POINT.bearings[0].stiffness[0, 0])
PULL = POINT.air_gap.pull_stiffness


@pytest.mark.parametrize("sign", [1, -1])
def test_limit_of_a_point_mass(script, sign):
    """c ω = |k_t|, exact; above it the whirl that grows turns with the spin for k_t > 0 and against
    it for k_t < 0.
    """
    exact = DAMPING * np.sqrt((STIFFNESS - PULL) / MASS) / PULL
    limit = script.tangential_limit(MASS, DAMPING, STIFFNESS, PULL)
    assert limit / PULL == pytest.approx(exact, rel=1e-12)
    found = brentq(lambda share: script.growth(sign * share, POINT), 0.9 * exact, 1.1 * exact,
                   xtol=1e-9)
    assert found == pytest.approx(exact, rel=1e-6)
    model = script.with_share(POINT, 1.05 * sign * exact)
    free = modes(replace(model, K=model.K - model.law.linearise(np.zeros(2))[1]), POINT.speed)
    growing = free.eigenvalues.real > 0
    assert growing.sum() == 1
    assert free.direction[int(np.argmax(growing))] == ("forward" if sign > 0 else "backward")
    assert np.isnan(script.tangential_limit(MASS, DAMPING, PULL, PULL))


def test_limit_of_the_whole_unit(script):
    """Floquet's crossing on the full machine against the eigenvalues of its linearised equations,
    all DOFs.
    """
    limit = brentq(script.largest, 1e-4, 0.2, args=(UNIT,), xtol=1e-7)
    for share, verdict in ((0.97 * limit, "stable"), (1.03 * limit, "unstable")):
        model = script.with_share(UNIT, share).with_unbalance(0)
        assert floquet(script.BALANCE.solve(model, UNIT.speed)).verdict == verdict
    found = brentq(script.growth, 0.9 * limit, 1.1 * limit, args=(UNIT,), xtol=1e-6)
    assert found == pytest.approx(limit, rel=1e-3)
