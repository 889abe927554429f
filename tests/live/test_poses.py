"""From orbits to poses: against plain numbers, SciPy's rotations and the machine's own conventions.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hydrolab import HarmonicBalance, load_machine
from hydrolab.live import solids
from hydrolab.live.poses import (
    STEEPEST,
    drawn_rotor_radius,
    largest_bow,
    largest_exaggeration,
    magnified,
    orbit_rings,
    positions,
    quaternions,
    stations,
)

PHASES = 2 * np.pi * np.arange(24) / 24


@pytest.fixture(scope="module")
def machine():
    return load_machine("kaplan-150rpm")


@pytest.fixture(scope="module")
def orbit(machine):
    return HarmonicBalance().solve(machine.model(), machine.speed, 0.088)


@pytest.fixture(scope="module")
def where(machine, orbit):
    return stations(machine, orbit)


def test_the_generator_is_where_the_orbit_says(machine, orbit, where):
    at = where.nodes + [b.name for b in machine.bodies].index("generator")
    for phase in PHASES:
        place = positions(where.depths, 50.0 * where.motion(phase))[at]
        assert place[:2] == pytest.approx(50 * orbit.positions([phase])[:, 0], abs=1e-12)
        assert place[2] == pytest.approx(0.472)


def test_nodes_are_where_the_shaft_is(machine, orbit, where):
    for node in range(where.nodes):
        x, z = orbit.node_coefficients(node)
        path = where.motion(PHASES)[node, :2]
        k = np.arange(1, 5)[:, None]
        for own, coefficients in zip(path, (x, z), strict=True):
            assert own == pytest.approx(coefficients[0] + coefficients[1::2] @ np.sin(k * PHASES)
                                        + coefficients[2::2] @ np.cos(k * PHASES), abs=1e-15)


def test_seen_from_above_it_turns_clockwise(machine):
    """Spin, forward whirl and the painted pole turn the same way: clockwise seen from +Z."""
    centred = HarmonicBalance().solve(machine.model(), machine.speed)
    where = stations(machine, centred)
    first, later = (positions(where.depths, where.motion(p))[where.nodes] for p in (0.0, 0.1))
    assert np.cross(first, later)[2] < 0
    pole = np.array([1.0, 0, 0])
    still = np.zeros((1, 4))
    turned = Rotation.from_quat(np.roll(quaternions(still, 0.1)[0], -1)).apply(pole)
    assert np.cross(pole, turned)[2] < 0
    assert turned == pytest.approx([math.cos(0.1), -math.sin(0.1), 0])


def test_tilts_against_scipy(where):
    """θx and θz of the machine are rotations about X and Y of the scene; the spin comes first,
    about −Z.
    """
    for phase in (0.3, 2.0, 5.0):
        motion = where.motion(phase)
        for (_, _, tx, tz), wxyz in zip(motion, quaternions(70.0 * motion, phase), strict=True):
            true = Rotation.from_rotvec([70 * tx, 70 * tz, 0]) * Rotation.from_rotvec([0, 0,
                                                                                       -phase])
            assert abs(np.dot(np.roll(true.as_quat(), 1), wxyz)) == pytest.approx(1, abs=1e-12)


def test_a_body_follows_its_link(machine, where):
    """The generator's centre drawn is the shaft top drawn, moved along the drawn axis, to first
    order in the tilt.
    """
    at = where.nodes
    motion = where.motion(1.0)
    places, turns = positions(where.depths, 20.0 * motion), quaternions(20.0 * motion)
    axis = Rotation.from_quat(np.roll(turns[0], -1)).apply([0, 0, 1])
    assert places[at] == pytest.approx(places[0] + 0.472 * axis,
                                       abs=0.472 * 3 * (20 * np.hypot(*motion[0, 2:])) ** 2)


@pytest.mark.parametrize("factor", [1.0, 40.0, 90.0])
def test_contact_on_screen_is_contact_in_the_machine(machine, factor):
    """A rotor displaced by the whole gap touches the drawn stator, by less leaves the exaggerated
    rest.
    """
    gap = machine.air_gap
    stator = gap.mean_radius + gap.gap / 2
    rotor = drawn_rotor_radius(stator, gap.gap, factor)
    for displacement in (0.0, 0.3 * gap.gap, gap.gap):
        assert stator - (rotor + factor * displacement) == pytest.approx(factor
                                                                         * (gap.gap
                                                                            - displacement),
                                                                         abs=1e-12)


def test_the_tilt_is_kept_small(where):
    factor = largest_exaggeration(where)
    tilts = where.motion(2 * np.pi * np.arange(1000) / 1000)[:, 2:]
    assert factor * np.hypot(tilts[:, 0], tilts[:, 1]).max() == pytest.approx(STEEPEST, rel=1e-4)
    assert largest_exaggeration(replace(where, coefficients=0 * where.coefficients)) == math.inf


def test_rings_are_what_the_shaft_sweeps(where):
    """In every direction a ring lies the drawn radius beyond the farthest point of the orbit, found
    here by brute force.
    """
    depths, drawn = where.depths[:where.nodes], 30 * where.whole()[:where.nodes, :2]
    rings, away = orbit_rings(depths, drawn, 0.2, points=48)
    assert rings.shape == (where.nodes, 48, 3) and away.shape == rings.shape[:2]
    node = 5
    ring = rings[node]
    assert set(ring[..., 2].ravel()) == {-where.depths[node]}
    path = 30 * where.motion(2 * np.pi * np.arange(3600) / 3600)[node, :2]
    for k in range(48):
        u = np.array([math.cos(2 * np.pi * k / 48), math.sin(2 * np.pi * k / 48)])
        assert ring[k, :2] @ u == pytest.approx((path.T @ u).max() + 0.2, abs=1e-4)
    assert away[node].max() == pytest.approx(np.hypot(*path).max(),
                                                                  rel=1e-3)


def test_the_shaft_stays_in_its_rings(where):
    depths, drawn = where.depths[:where.nodes], 30 * where.whole()[:where.nodes, :2]
    rings, _ = orbit_rings(depths, drawn, 0.2, points=96)
    for phase in PHASES:
        place = positions(where.depths, 30 * where.motion(phase))
        for node in range(where.nodes):
            edge = rings[node, :, :2]
            angle = 2 * np.pi * np.arange(96) / 96
            out = np.einsum("kc,kc->k", edge - place[node, :2],
                            np.column_stack([np.cos(angle), np.sin(angle)]))
            assert out.min() >= 0.2 - 1e-6


def test_the_bow_alone_is_drawn_larger(machine, where):
    """Generator and runner stand where one factor puts them; in between the shaft leaves the
    straight line through them `bow` times as far as it does.
    """
    lens = magnified(machine, where, 50.0, 400.0)
    for phase in (0.2, 3.0):
        motion = where.motion(phase)
        drawn = lens(motion)
        ends = [where.nodes + [b.name for b in machine.bodies].index("generator"), where.nodes - 1]
        assert drawn[ends, :2] == pytest.approx(50 * motion[ends, :2], rel=1e-12)
        y = where.depths
        for axis in (0, 1):
            line = np.interp(y, y[ends], motion[ends, axis])
            own = np.s_[1:where.nodes - 1]
            assert drawn[own, axis] == pytest.approx(
                50 * line[own] + 400 * (motion[own, axis] - line[own]), rel=1e-9)
    flat = magnified(machine, where, 50.0, 50.0)
    assert flat(motion) == pytest.approx(50 * motion, rel=1e-12)
    assert 50 < largest_bow(flat, where) < math.inf


def test_motions_of_one_and_two_revolutions_mix(where):
    """A motion written over two revolutions is the same motion."""
    two = replace(where, coefficients=where._over(2, 8), revolutions=2)
    for phase in (0.3, 5.0, 9.0):
        assert two.motion(phase) == pytest.approx(where.motion(phase), abs=1e-15)
    assert where.towards(two, 0.5).motion(1.0) == pytest.approx(where.motion(1.0), abs=1e-15)


def test_half_way_between_orbits(where):
    rest = replace(where, coefficients=0 * where.coefficients)
    assert rest.towards(where, 0.25).motion(1.0) == pytest.approx(0.25 * where.motion(1.0))


def test_a_point_mass_bends_a_shaft_held_at_both_ends():
    machine = load_machine("jeffcott")
    where = stations(machine, HarmonicBalance().solve(machine.model(), machine.speed))
    motion = where.motion(0.4)
    assert not motion[[0, 2]].any() and motion[1, :2].any()
    assert motion[3] == pytest.approx(motion[1])


BLOCK = solids.box(1, 2, 0.5, 0, 1)


@pytest.mark.parametrize("solid", [solids.ring(1, 2, 0, 1), solids.ring(1, 2, 0, 1, 0.5, 4.0),
                                   BLOCK,
                                   solids.blade(0.4, 1.3), solids.tube(0.3, -2, 1, 9),
                                   solids.joined(BLOCK,
                                                 solids.turned(solids.raised(BLOCK, 3), 1))],
                         ids=["ring", "sector", "box", "blade", "tube", "joined"])
def test_solids_are_closed_and_face_outwards(solid):
    vertices, faces = solid
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward = {tuple(e) for e in edges.tolist()}
    assert len(forward) == len(edges) and all((b, a) in forward for a, b in forward)
    a, b, c = vertices[faces].transpose(1, 0, 2)
    assert np.einsum("fi,fi->", a, np.cross(b, c)) > 0  # six times the volume


def test_volume_of_a_ring():
    vertices, faces = solids.ring(1, 2, 0, 1, steps=2000)
    a, b, c = vertices[faces].transpose(1, 0, 2)
    assert np.einsum("fi,fi->", a, np.cross(b, c)) / 6 == pytest.approx(3 * np.pi, rel=1e-5)


def test_bones_share_the_shaft():
    weights = solids.hat_weights(np.array([0.0, 0.25, 2.0, 3.0]), np.array([0.0, 1.0, 3.0]))
    assert weights == pytest.approx(np.array([[1, 0, 0], [0.75, 0.25, 0], [0, 0.5, 0.5],
                                              [0, 0, 1]]))
