"""The 3D scene on a server without a browser: what it builds, what it accepts, how it moves, what a
recording holds.
"""

import math
import re
import time

import numpy as np
import pytest

from hydrolab import BadInput, HarmonicBalance, load_machine, vary
from hydrolab.live.poses import drawn_rotor_radius, positions, stations
from hydrolab.live.recording import record_scene
from hydrolab.live.scene import MachineScene

viser = pytest.importorskip("viser", reason="viser is in the project's own dependencies")


@pytest.fixture(scope="module")
def kaplan():
    return load_machine("kaplan-150rpm")


@pytest.fixture
def server():
    opened = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield opened
    opened.stop()


@pytest.fixture(scope="module")
def shared(kaplan):
    """One scene for the tests that set what they need themselves."""
    opened = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield MachineScene(opened, kaplan, playing=False)
    opened.stop()


def bones(scene):
    return np.array([bone.position for bone in scene.parts.moving["shaft"].bones])


@pytest.mark.parametrize("card", ["jeffcott", "three-disc"])
def test_every_card_has_a_scene(server, card):
    scene = MachineScene(server, load_machine(card), playing=False)
    assert {body.name for body in scene.machine.bodies} <= set(scene.parts.moving)
    assert scene.board.branch == (card != "three-disc")
    scene.change(dark=True, unbalance=1.5, field=0.9, names=False)
    scene.go_on(0.3)
    assert scene.phase == pytest.approx(0.6 * math.pi)
    assert re.search(r"(Gap|Motion) × \d+", scene.reading)


def test_what_falls_in_a_lying_machine_falls_in_the_picture(server):
    """Without field, stator, loads and lifted bearings: only the weight is left."""
    machine = load_machine("pelton-horizontal")
    level = {f"bearings.{bearing.name}.z": 0.0 for bearing in machine.bearings}
    scene = MachineScene(server, vary(machine, level | {"loads.jet.force": 0.0}), playing=False)
    sunk = positions(scene.where.depths, scene.where.coefficients[:, :2, 0])[scene.where.nodes]
    sunk = sunk - np.array([0.0, 0.0, -scene.where.depths[scene.where.nodes]])
    assert np.dot(sunk, server.initial_camera.up) < -0.9 * np.linalg.norm(sunk) < -1e-4
    # the view looks down on the floor, and across the shaft
    assert scene.sizes.near @ scene.sizes.up == 0 and abs(scene.sizes.near[2]) < 0.5
    names = [label.place for label in scene.names.names]
    assert all(place @ scene.sizes.up > scene.sizes.stator for place in names)


def test_a_straight_shaft_is_said_to_be_one(server):
    scene = MachineScene(server, load_machine("three-disc"), playing=False)
    assert "neither air gap nor unbalance" in scene.reading and math.isinf(scene.smallest_gap)


def test_bones_bodies_and_stator_are_where_the_orbit_says(shared, kaplan):
    shared.change(static_eccentricity=0.088, leg=0, exaggeration=40.0, bow=40.0)
    orbit = HarmonicBalance(4).solve(kaplan.model(), kaplan.speed, 0.088)
    where = stations(kaplan, orbit)
    for phase in (0.0, 1.0, 4.0):
        shared.draw(phase)
        place = positions(where.depths, 40.0 * where.motion(phase))
        assert bones(shared) == pytest.approx(place[:where.nodes], abs=2e-5)
        assert shared.parts.moving["generator"].position == pytest.approx(place[where.nodes],
                                                                          abs=2e-5)
    assert shared.parts.moving["stator"].position[:2] == pytest.approx(40 * orbit.centre, abs=1e-9)
    assert shared.smallest_gap == pytest.approx(orbit.smallest_gap, rel=1e-6)


def test_the_drawn_gap_is_the_gap_times_the_scale(shared, kaplan):
    """Between the drawn pole faces and the drawn bore, at the closest moment of a turn, measured on
    the handles.
    """
    shared.change(static_eccentricity=0.088, leg=2, exaggeration=50.0)
    faces = np.asarray(shared.parts.gap["/rotor/painted pole"].vertices)[:, 0].max()
    assert faces == pytest.approx(drawn_rotor_radius(shared.sizes.stator, kaplan.air_gap.gap,
                                                     50.0), abs=1e-6)
    gaps = []
    for phase in 2 * np.pi * np.arange(360) / 360:
        shared.draw(phase)
        off = np.subtract(shared.parts.moving["generator"].position,
                          shared.parts.moving["stator"].position)[:2]
        gaps.append((shared.sizes.stator - faces - np.hypot(*off)) / 50.0)
    assert min(gaps) == pytest.approx(shared.smallest_gap, abs=1e-6)


def test_the_arrow_is_along_the_pull(shared):
    shared.change(static_eccentricity=0.088, leg=2)
    orbit, gap = shared.shown.orbit, shared.machine.air_gap
    lengths, forces = [], []
    for phase in (0.2, 1.9, 3.7):
        shared.draw(phase)
        tail, head = (np.array(bone.position) for bone in shared.parts.moving["pull"].bones[:2])
        e = orbit.positions([phase])[:, 0] - orbit.centre
        pull = e * (1 - e @ e / gap.gap**2) ** -1.5  # the closed form, but for its stiffness
        arrow = (head - tail)[:2]
        assert arrow / np.hypot(*arrow) == pytest.approx(pull / np.hypot(*pull), abs=1e-4)
        lengths.append(np.hypot(*arrow))
        forces.append(np.hypot(*pull))
    assert np.array(lengths) / lengths[0] == pytest.approx(np.array(forces) / forces[0], rel=1e-4)


def test_two_stable_orbits_at_one_eccentricity(shared):
    found = {}
    for leg in (0, 2):
        shared.change(static_eccentricity=0.088, leg=leg)
        assert f"Leg {leg + 1}, stable" in shared.reading
        found[leg] = shared.smallest_gap
    assert found[2] < found[0] - 0.5e-3
    assert shared.legs == (0, 2)


def test_past_the_fold_it_leaves_and_the_room_sees_both_ends(shared):
    """The motion over the edge ends on the large orbit or at the stator; the board's ball and dot
    are where it is, and `again` shows the other end.
    """
    shared.change(static_eccentricity=0.088, leg=0)
    shared.change(static_eccentricity=0.09, ending="orbit")
    assert "leg 1 has ended" in shared.reading and "settles on leg 3" in shared.reading
    assert shared.settings.leg == 2 and shared.flight is None
    own = shared.live.legs.orbit(0.09, 2)
    assert shared.smallest_gap == pytest.approx(own.smallest_gap)
    shared.change(static_eccentricity=0.088)  # and it does not come back by itself
    assert "Leg 3" in shared.reading
    shared.change(static_eccentricity=0.088, leg=0)
    shared.change(static_eccentricity=0.09, ending="stator")
    flight, touched = shared.flight, shared.phase - shared._begun
    assert shared.held and "touches the stator" in shared.reading and shared.smallest_gap == 0.0
    gap = shared.machine.air_gap.gap
    away = flight.rotor(np.array([touched]))[0] - [0.09 * gap, 0.0]
    assert np.hypot(*away) == pytest.approx(gap, rel=0.03)
    shared.again()
    shared._update(math.inf)
    assert shared.flight is None and shared.settings.leg == 2
    shared.change(static_eccentricity=0.088, leg=0, ending="any")


def test_the_motion_over_the_edge_is_that_of_another_integrator(shared, kaplan):
    """From the orbit at the fold, moved on at phase 0: the same motion by central differences on
    all degrees of freedom.
    """
    from hydrolab import CentralDifference, integrate
    from hydrolab.paper.study import stable_steps

    start = shared.live.own.branch.at_fold(0)
    shared.change(static_eccentricity=0.088, leg=0)
    shared.change(static_eccentricity=0.092)
    jump = shared.jump
    shared.change(static_eccentricity=0.088, leg=0)
    flight = jump.flight(0)
    model = kaplan.model()
    true = integrate(model, CentralDifference(2 * stable_steps(model, kaplan.speed)),
                     speed=kaplan.speed, static_eccentricity=0.092, start=start, revolutions=8)
    times, path = true.last(8.0)
    turns = (times - times[0]) * kaplan.speed / (2 * np.pi)
    mine = np.array([np.interp(turns, flight.times, column) for column in flight.path.T])
    inside = (turns > 0.5) & (turns < 7.5)
    moved = np.abs(path - start.positions(2 * np.pi * turns))[:, inside].max()
    assert np.abs(mine - path)[:, inside].max() < 0.1 * moved


def test_below_the_flip_the_motion_repeats_every_two_revolutions(shared):
    shared.change(static_eccentricity=0.082, leg=2)
    shared.change(static_eccentricity=0.078)
    assert "repeats every two revolutions" in shared.reading
    assert shared.shown.orbit.revolutions == 2 and shared.shown.verdict == "stable"
    orbit = shared.shown.orbit
    for phase in (0.4, 0.4 + 2 * np.pi):
        shared.draw(phase)
        dot = np.asarray(shared.board.moving["dot"].position)[:2] / shared.board.unit
        assert dot == pytest.approx(shared.board.in_square(orbit.positions([phase])[:, 0]),
                                    abs=1e-4)
    assert "two revolutions" in " ".join(label.text for label in shared.board.labels.values())
    shared.change(static_eccentricity=0.068)  # past its fold, and back on the small orbit
    assert shared.settings.leg == 0 and "settles on leg 1" in shared.reading


def test_a_place_on_the_branch_is_found_by_a_ray(shared):
    board = shared.board
    for eccentricity, first in ((4.0, 220.0), (8.5, 1600.0)):
        at = board.flat(board.on_branch(np.array(eccentricity), np.array(first)), 0.0)
        ray = board.turn @ np.array([0.1, -0.2, -1.0])
        origin = board.turn @ at + board.place - 7.0 * ray
        assert board.picked(origin, ray, False) == pytest.approx((eccentricity, first), rel=1e-6)
        shared.go_to(eccentricity / 100, first * 1e-6)
        assert shared.settings.static_eccentricity == pytest.approx(eccentricity / 100)
    assert shared.settings.leg == 2
    assert math.isnan(board.picked(origin, -board.turn[:, 0], False)[0])


@pytest.mark.parametrize(("wanted", "words"), [
    ({"static_eccentricity": math.nan}, "finite"), ({"static_eccentricity": "0.05"}, "finite"),
    ({"leg": 0.5}, "whole"),
    ({"leg": True}, "finite"), ({"playing": 1}, "true or false"), ({"view": "moon"}, "there are"),
    ({"speed": 3.0}, "no setting"), ({"field": None}, "finite"),
    ({"slow_motion": math.inf}, "finite"),
])
def test_what_is_no_setting_is_refused_and_changes_nothing(shared, wanted, words):
    before = shared.settings
    with pytest.raises(BadInput, match=words):
        shared.change(**wanted)
    assert shared.settings == before


def test_numbers_are_clamped(shared):
    shared.change(static_eccentricity=99999, field=-3, exaggeration=1e9, slow_motion=0)
    s, limits = shared.settings, shared.limits
    assert (s.static_eccentricity, s.field, s.exaggeration, s.slow_motion) == (
        limits["static_eccentricity"][1], limits["field"][0], limits["exaggeration"][1],
        limits["slow_motion"][0])
    shared.change(static_eccentricity=0.088, field=1.0, exaggeration=50.0, leg=0, slow_motion=8.0)
    shared.change(leg=77)
    assert shared.settings.leg == len(shared.live.ways) - 1
    assert "has no steady state" in shared.reading
    shared.change(leg=0)


def test_the_slider_says_what_is_drawn(shared):
    """A tilt that would look wrong lowers the factor, and the setting with it; the wish comes back
    where there is room for it.
    """
    shared.change(static_eccentricity=0.0, leg=0, exaggeration=150.0)
    small = shared.settings.exaggeration
    shared.change(static_eccentricity=0.088, leg=2)
    large = shared.settings.exaggeration
    assert large < small <= 150.0
    steepest = np.hypot(*shared.where.motion(np.linspace(0, 2 * np.pi, 500))[:, 2:]
                        .transpose(1, 0, 2)).max()
    assert large * steepest == pytest.approx(0.15, rel=1e-3)
    assert f"× {large:.0f}" in shared.reading
    assert f"× {large:.0f}" in shared.names.scale.text
    shared.draw(0.0)
    at = shared.where.nodes
    assert shared.parts.moving["generator"].position[0] == pytest.approx(
        large * shared.where.motion(0.0)[at, 0], rel=1e-5)
    shared.change(static_eccentricity=0.0, leg=0)
    assert shared.settings.exaggeration == pytest.approx(small)


def test_the_loop_eases_to_a_new_orbit_and_stops(shared):
    shared.change(static_eccentricity=0.0, leg=0)
    shared.run()
    loop = shared._thread
    try:
        shared.change(static_eccentricity=0.08)
        deadline = time.monotonic() + 60
        while (not (orbit := shared.shown.orbit).centre[0]
               or np.abs(shared.drawn.coefficients - stations(shared.machine,
                                                              orbit).coefficients).max() > 1e-7):
            assert time.monotonic() < deadline
            time.sleep(0.01)
        assert shared.shown.orbit.static_eccentricity == pytest.approx(0.08)
    finally:
        shared.stop()
    loop.join(60)
    assert not loop.is_alive()


def test_a_recording_is_one_file_that_asks_for_nothing(shared, tmp_path):
    shared.change(static_eccentricity=0.088, leg=0, slow_motion=1.0)
    path = record_scene(shared, tmp_path / "machine.html", turns=2)
    text = path.read_text()
    assert 0.7e6 < len(text) < 2e6
    addresses = set(re.findall(r"""(?:src|href)=["']?((?:https?:)?//[^"' >]+)""", text))
    assert not addresses
    for name, turns in (("machine.txt", 2), ("machine.html", 0), ("machine.html", 1.5)):
        with pytest.raises(BadInput):
            record_scene(shared, tmp_path / name, turns=turns)
