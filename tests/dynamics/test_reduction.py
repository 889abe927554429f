"""A basis at a known speed is right to its tolerance, against the direct solution of all DOFs."""

from dataclasses import replace

import numpy as np
import pytest

from hydrolab import BadInput, HarmonicBalance, Newmark, integrate, load_machine, reduce, rpm
from hydrolab.machine.bearings import RadialBearing
from hydrolab.machine.parts import Machine, RigidBody, Shaft


def two_discs(damping, cross=0.0):
    """Two discs between bearings of 1e6 N/m with dashpots (N s/m), and a seal in the middle."""
    shaft = Shaft(np.linspace(0, 2, 9), 0.06, 2e11, 7850.0, 0.3, 0.9)
    discs = (RigidBody("a", 2, 60.0, 1.0, 2.0, unbalance=60 * 5e-5),
             RigidBody("b", 6, 40.0, 0.6, 1.2, unbalance=40 * 3e-5))
    bearings = [RadialBearing(name, node, 1e6, damping) for name, node in (("l", 0), ("r", 8))]
    if cross:
        bearings.append(RadialBearing("seal", 4, [[abs(cross), cross], [-cross, abs(cross)]]))
    return Machine("two discs", rpm(1500), shaft, discs, tuple(bearings)).model()


def answer(model, speed):
    """1X of the first disc by one direct solution, m, complex (2,)."""
    dynamic = model.K - speed**2 * model.M + 1j * speed * (model.C + speed * model.G)
    load = speed**2 * (model.unbalance_cos - 1j * model.unbalance_sin)
    return model.selection @ np.linalg.solve(dynamic, load)


@pytest.mark.parametrize("damping", [1e2, 1e4, 1e5, 1e6])
@pytest.mark.parametrize("modes", [4, 12])
def test_dashpots(damping, modes):
    model, speed = two_discs(damping), rpm(1500)
    exact, small = answer(model, speed), reduce(model, modes, speed=speed)
    assert np.abs(answer(small, speed) - exact).max() < 1e-3 * np.abs(exact).max()
    if damping == 1e5:
        rough = answer(reduce(model, modes), speed)
        assert np.abs(rough - exact).max() > 5e-3 * np.abs(exact).max()


def test_integration_with_dashpots_is_the_direct_solution():
    model, speed = two_discs(1e5), rpm(1500)
    motion = integrate(model, Newmark(256), speed=speed, revolutions=60, modes=4,
                       start=HarmonicBalance(1).solve(model, speed))
    found = np.hypot(*motion.coefficients(1)[0, 1:])
    assert found == pytest.approx(abs(answer(model, speed)[0]), rel=2e-3)


def growth(model, speed):
    """Largest real part of the eigenvalues, 1/s."""
    inverse, n = np.linalg.inv(model.M), model.size
    return np.linalg.eigvals(np.block([
        [np.zeros((n, n)), np.eye(n)],
        [-inverse @ model.K, -inverse @ (model.C + speed * model.G)]])).real.max()


@pytest.mark.parametrize("cross", [1e5, -1e5])
def test_a_seal_drives_the_basis_as_it_drives_the_rotor(cross):
    """The eigenvalue that grows is in the basis of an unsymmetric K, whichever sign."""
    model, speed = two_discs(1e2, cross), rpm(1500)
    assert growth(model, speed) > 1
    assert growth(reduce(model, 4, speed=speed), speed) == pytest.approx(growth(model, speed),
                                                                         rel=1e-6)


def test_the_labyrinth_of_the_unit():
    """Its unstable motion at 34.5 Hz is in no small basis of modes at rest."""
    model = load_machine("kaplan-150rpm").model()
    K = model.K.copy()
    K[40, 41] += 6.81e7
    K[41, 40] -= 6.81e7
    model, speed = replace(model, K=K), rpm(150)
    small = reduce(model, 4, True, speed=speed)
    assert growth(small, speed) == pytest.approx(growth(model, speed), rel=1e-6)
    assert growth(reduce(model, 4, True), speed) > 1.5 * growth(model, speed) > 0  # at rest


def test_the_unit_needs_nothing_more():
    model = load_machine("kaplan-150rpm").model()
    for modes, gyroscopic in ((12, False), (12, True), (6, True)):
        assert reduce(model, modes, gyroscopic, speed=rpm(150)).size == reduce(model, modes,
                                                                               gyroscopic).size


def test_what_is_no_model_is_refused():
    with pytest.raises(BadInput, match="must be a Model"):
        reduce(load_machine("kaplan-150rpm"))
