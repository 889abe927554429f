"""Rules that every force law keeps, on a small machine for each (`tests.machines`)."""

import numpy as np
import pytest

from hydrolab.machine.pull import ForceLaw
from tests.machines import MACHINES


@pytest.fixture(params=MACHINES)
def machine(request):
    return MACHINES[request.param]()


def test_slopes_are_those_of_the_force(machine):
    model = machine.model()
    law, rng = model.law, np.random.default_rng(2)
    assert isinstance(law, ForceLaw) and law.coordinates == len(model.selection)
    assert np.linalg.matrix_rank(model.selection) == len(model.selection)
    size = np.full(len(model.selection), 2e-5)
    size[:2] = 1e-3
    u, v = size[:, None] * rng.uniform(-1, 1, (2, len(size), 5))
    phase = np.linspace(0, 5, 5)
    force, by_place, by_rate = law.linearise(u, v, phase, machine.speed)
    assert law.force(u, v, phase, machine.speed) == pytest.approx(force, rel=1e-13, abs=1e-6)
    for j, step in enumerate(1e-4 * size[:, None] * np.eye(len(size))):
        ahead, behind = (law.force(u + s * step[:, None], v, phase, machine.speed) for s in (1, -1))
        difference = (ahead - behind) / (2 * step[j])
        assert np.abs(difference - by_place[:, j]).max() <= 1e-5 * np.abs(by_place).max()
        ahead, behind = (law.force(u, v + s * step[:, None], phase, machine.speed) for s in (1, -1))
        difference = (ahead - behind) / (2 * step[j])
        own = 0.0 if by_rate is None else by_rate[:, j]
        largest = 1e-9 if by_rate is None else 1e-5 * np.abs(by_rate).max()
        assert np.abs(difference - own).max() <= largest


def test_any_number_of_axes(machine):
    """One by one is the same as all at once; a law of position alone needs no more than that."""
    model = machine.model()
    law, rng = model.law, np.random.default_rng(3)
    u = 2e-5 * rng.uniform(-1, 1, (len(model.selection), 3, 4))
    phase = np.linspace(0, 5, 4)
    force, by_place, _ = law.linearise(u, 0 * u, phase, machine.speed)
    gap = np.broadcast_to(law.smallest_gap(u, phase), (3, 4))
    for i, j in ((0, 0), (2, 1), (1, 3)):
        there = u[:, i, j]
        one, slope, _ = law.linearise(there, 0 * there, phase[j], machine.speed)
        assert force[:, i, j] == pytest.approx(one, rel=1e-12, abs=1e-7)
        assert by_place[..., i, j] == pytest.approx(slope, rel=1e-12, abs=1e-3)
        assert gap[i, j] == law.smallest_gap(there, phase[j])
    if not law.moving:
        assert np.array_equal(law.force(u), law.force(u, u, phase, 1.0))


def test_only_the_pull_goes_with_the_field(machine):
    model = machine.model()
    u = np.linspace(1e-5, 3e-5, len(model.selection))
    still = np.zeros_like(u)
    own, half, dark = (law.force(u, still, 0.7, machine.speed) for law in (
        model.law, model.law.scaled(0.5), model.law.scaled(0.0)))
    assert own + dark == pytest.approx(2 * half, rel=1e-12, abs=1e-6)
    assert (own - dark)[:2] == pytest.approx(model.pull(u, 0.7, machine.speed), abs=1e-9)
    rest = 4 if machine.air_gap and machine.air_gap.tilt else 2
    assert np.array_equal(own[rest:], dark[rest:])


def test_laws_are_quiet(machine):
    """Whatever a program makes of NumPy's warnings: at rest, near it, and far outside the gap."""
    model = machine.model()
    far = np.full((len(model.selection), 3), 1.0)
    with np.errstate(all="raise"):
        for u in (far, 0 * far, 1e-200 * far, 1e-4 * far):
            model.law.linearise(u, u, 0.3, machine.speed)
            force = model.law.force(u, u, 0.3, machine.speed)
            model.law.smallest_gap(u, 0.3)
            for support in model.supports.values():
                support.force(u[:2], u[:2], 0.3, machine.speed)
        assert np.isfinite(force).all()
