"""From parts to matrices: energies, links, handedness of the unbalance, the stator's centre."""

import math

import numpy as np
import pytest

from hydrolab.errors import BadInput
from hydrolab.machine.model import body_matrices, rigid_link
from hydrolab.machine.parts import Machine, RadialBearing, RigidBody, Shaft
from hydrolab.machine.pull import CircularPull


def rigid_motion(depths, shift, tilt):
    """All nodes' (x, z, θx, θz) when the whole machine moves and tilts about the shaft top."""
    x, z = shift[0] - tilt[1] * depths, shift[1] + tilt[0] * depths
    return np.stack([x, z, np.full_like(depths, tilt[0]), np.full_like(depths, tilt[1])],
                    axis=1).ravel()


def test_mass_and_inertia_of_the_whole_machine(make_kaplan):
    machine = make_kaplan()
    model, shaft = machine.model(), machine.shaft
    shaft_mass = shaft.density * np.pi / 4 * 0.71**2 * 9.04
    bodies = [(b.mass, b.Id, shaft.nodes[b.node] + b.offset) for b in machine.bodies]
    moved = rigid_motion(shaft.nodes, (0.6, 0.8), (0, 0))
    assert moved @ model.M @ moved == pytest.approx(shaft_mass + sum(m for m, _, _ in bodies),
                                                    rel=1e-12)
    tilted = rigid_motion(shaft.nodes, (0, 0), (0.6, 0.8))
    rod = shaft_mass * (9.04**2 / 3 + 0.71**2 / 16)
    assert tilted @ model.M @ tilted == pytest.approx(rod
                                                      + sum(i + m * y**2 for m, i, y in bodies),
                                                      rel=1e-12)
    # the generator is above the top
    assert model.selection @ tilted == pytest.approx([0.472 * 0.8, -0.472 * 0.6])


def test_only_supports_resist_rigid_motion(make_kaplan):
    machine = make_kaplan()
    model, depths = machine.model(), machine.shaft.nodes
    moved, tilted = rigid_motion(depths, (1, 0), (0, 0)), rigid_motion(depths, (0, 0), (0, 1))
    assert moved @ model.K @ moved == pytest.approx(1.37e9 + 1.64e9, rel=1e-9)
    expected = 5e7 + 1.37e9 * depths[1] ** 2 + 1.64e9 * depths[-2] ** 2
    assert tilted @ model.K @ tilted == pytest.approx(expected, rel=1e-9)


def test_symmetries(unit):
    assert np.array_equal(unit.G, -unit.G.T)
    for matrix in (unit.M, unit.K, unit.C):
        assert np.abs(matrix - matrix.T).max() < 1e-12 * np.abs(matrix).max()
    assert np.linalg.eigvalsh(unit.M)[0] > 0
    assert unit.velocity_matrix(3.0) == pytest.approx(unit.C + 3 * unit.G)


def test_gyroscopic_torque_has_the_sign_of_a_top():
    """Angular momentum Ip Ω along y: tilting at θ̇x needs the torque that turns it, Ip Ω θ̇x about
    θz.
    """
    _, g = body_matrices(RigidBody("disc", 0, 1.0, 2.0, 3.0))
    assert (g @ [0, 0, 1, 0])[3] == 3.0
    assert (g @ [0, 0, 0, 1])[2] == -3.0


def test_link_is_a_rigid_rotation():
    offset, tilt = -0.472, 1e-3
    # θz = −∂x/∂y
    assert rigid_link(offset) @ [0, 0, 0, tilt] == pytest.approx([-offset * tilt, 0, 0, tilt])
    # θx = ∂z/∂y
    assert rigid_link(offset) @ [0, 0, tilt, 0] == pytest.approx([0, offset * tilt, tilt, 0])
    assert rigid_link(0.3) @ rigid_link(-0.5) == pytest.approx(rigid_link(-0.2))


@pytest.mark.parametrize("phase", [0.0, 0.7, -2.0])
def test_unbalance_turns_with_the_spin(phase):
    body = RigidBody("disc", 0, 100.0, 0.0, 0.0, unbalance=2.5, phase=phase)
    model = Machine("m", 10.0, None, (body,), (RadialBearing("b", 0, 1e6),)).model()
    for angle in (0.0, 1.0, 4.0):
        force = model.unbalance_sin * math.sin(angle) + model.unbalance_cos * math.cos(angle)
        assert force == pytest.approx([2.5 * math.sin(angle + phase),
                                       2.5 * math.cos(angle + phase)])


def test_unbalance_on_a_link_also_tilts(make_kaplan):
    machine = make_kaplan()
    model = machine.model()
    top = model.unbalance_sin[:4]  # at the shaft top: force along x at 0.472 m above it
    assert top == pytest.approx([95.477, 0, 0, 95.477 * 0.472])


def test_centre(unit):
    assert unit.centre(0.088) == pytest.approx([0.088 * 0.011, 0.0], abs=1e-18)
    assert unit.centre(0.1, direction=0.0) == pytest.approx([0.0, 0.1 * 0.011])
    assert np.array_equal(unit.centre(0.0), [0.0, 0.0])


@pytest.mark.parametrize(("value", "direction", "words"), [
    (1.2, 0.0, "fraction of the gap"), (-1.0, 0.0, "between -1 and 1"), (math.nan, 0.0, "finite"),
    (0.1, math.inf, "finite")])
def test_centre_refuses(unit, value, direction, words):
    with pytest.raises(BadInput, match=words):
        unit.centre(value, direction)


def test_a_machine_without_a_gap_has_no_pull_and_no_eccentricity():
    machine = Machine("m", 10.0, None, (RigidBody("disc", 0, 1.0, 0.0, 0.0),),
                      (RadialBearing("b", 0, 1e6),))
    model = machine.model()
    assert model.gap == math.inf
    assert np.array_equal(model.law.force(np.array([1.0, 2.0])), [0.0, 0.0])
    with pytest.raises(BadInput, match="no air gap"):
        model.centre(0.1)


def test_field_and_unbalance_can_be_scaled(unit):
    e = np.array([1e-3, 2e-3])
    assert unit.with_field(1.5).law.force(e) == pytest.approx(2.25 * unit.law.force(e))
    assert unit.with_field(0.0).law == CircularPull(0.0, unit.gap)
    assert unit.with_unbalance(2.0).unbalance_sin == pytest.approx(2 * unit.unbalance_sin)
    assert unit.with_unbalance(2.0).unbalance_cos == pytest.approx(2 * unit.unbalance_cos)


def test_the_gap_acts_on_its_own_body():
    shaft = Shaft(np.array([0.0, 1.0, 2.0]), 0.2, 2e11, 7850.0)
    bodies = (RigidBody("a", 0, 10.0, 1.0, 1.0), RigidBody("b", 2, 10.0, 1.0, 1.0, offset=0.4))
    model = Machine("m", 10.0, shaft, bodies,
                    (RadialBearing("p", 0, 1e6), RadialBearing("q", 2, 1e6))).model()
    assert np.array_equal(np.flatnonzero(model.selection[0]), [0])  # without a gap: the first body
    from hydrolab.machine.parts import AirGap
    gap = AirGap("b", 0.5, 1.0, 1.0, 0.01)
    model = Machine("m", 10.0, shaft, bodies,
                    (RadialBearing("p", 0, 1e6), RadialBearing("q", 2, 1e6)),
                    air_gap=gap).model()
    assert model.selection[0, 8:] == pytest.approx([1, 0, 0, -0.4])
