"""Every law's machine in 3D: built, measured on the drawn vertices, shown from an orbit or a
branch, and recorded.
"""

import functools
import math
import re

import numpy as np
import pytest
import viser
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from hydrolab import BadInput, HarmonicBalance, follow, load_machine, sweep
from hydrolab.dynamics import Arclength
from hydrolab.figures.readings import reading
from hydrolab.live.cell import show
from hydrolab.live.recording import record_scene
from hydrolab.live.scene import MachineScene
from hydrolab.live.server import open_server
from tests.machines import MACHINES

FOLDED = "pads, crack and oval stator"
IN_A_GAP = [name for name in MACHINES if name != "no gap"]


@functools.cache
def machine(name):
    return MACHINES[name]()


@functools.cache
def branch(name):
    """Steady states from 0 to 4 %, in few points; one machine has folds on the way."""
    unit, model = machine(name), machine(name).model()
    if name == FOLDED:
        steps = Arclength(HarmonicBalance(4), step=0.05, max_step=0.5, max_turn=1.0)
        return follow(model, to=0.04, speed=unit.speed, method=steps)
    return sweep(model, HarmonicBalance(4), [0.0, 0.02, 0.04], speed=unit.speed)


@pytest.fixture(scope="module")
def scene_of():
    """The scene of a machine, at 2 % of its gap where it has one; made once."""
    made = {}

    def scene(name):
        if name not in made:
            server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
            along = branch(name) if machine(name).air_gap else None
            made[name] = MachineScene(server, machine(name), along, playing=False)
        made[name].change(static_eccentricity=0.02, leg=0, field=1.0, unbalance=1.0,
                          exaggeration=70.0)
        return made[name]

    yield scene
    for scene in made.values():
        scene.server.stop()


def drawn(scene, path, phase, leans):
    """Vertices of a mesh of the rotor as they stand beside the stator's middle; without `leans` as
    if it stood upright.
    """
    frame = scene.parts.moving[scene.machine.air_gap.body]
    turn = (Rotation.from_quat(np.roll(frame.wxyz, -1)) if leans
            else Rotation.from_euler("z", -phase))
    place = turn.apply(np.asarray(scene.parts.gap[path].vertices)) + frame.position
    return place - scene.parts.moving["stator"].position


def polar(place):
    """Angle about Z from 0 to 2π and radius of points (P, 3)."""
    return np.arctan2(place[:, 1], place[:, 0]) % (2 * np.pi), np.hypot(*place[:, :2].T)


def bodies_of(handle):
    """How many separate solids a mesh holds."""
    faces = np.asarray(handle.faces)
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    count = len(np.asarray(handle.vertices))
    graph = coo_array((np.ones(len(ends)), ends.T), shape=(count, count))
    return connected_components(graph)[0]


@pytest.mark.parametrize("name", MACHINES)
def test_every_part_is_there_and_named(scene_of, name):
    scene = scene_of(name)
    unit = scene.machine
    named = ", ".join(label.text for label in scene.names.names)
    for part in (*unit.bodies, *(unit.all_bearings if unit.shaft else ()), *unit.cracks):
        assert part.name in named
    riding = {name for name, _, _ in scene.parts.riding}
    assert {body.name for body in unit.bodies} <= riding <= set(scene.parts.moving)
    assert len(riding) == len(unit.bodies) + len(unit.thrust_bearings) + len(unit.cracks)
    if unit.air_gap and name != FOLDED:
        scene.change(field=0.97, static_eccentricity=0.03)
        assert scene.shown.orbit.static_eccentricity == 0.03
        assert 0 < scene.smallest_gap < unit.air_gap.gap
    scene.change(unbalance=0.9, exaggeration=20.0)
    assert not re.search("the last orbit|begins at the centre", scene.reading)


@pytest.mark.parametrize("name", IN_A_GAP)
def test_the_drawn_gap_is_the_gap_times_the_scale(scene_of, name):
    """At the closest of many phases, from the drawn pole faces to the drawn bore along the radius:
    the shapes of both are in it and, where the law knows it, the lean of the rotor.
    """
    scene = scene_of(name)
    leans, nominal = scene.machine.air_gap.tilt, scene.machine.air_gap.gap
    around, bore = polar(np.asarray(scene.parts.gap["/stator/wall"].vertices))
    inside = bore < 1.08 * scene.sizes.stator  # the wall's back is at 1.16
    order = np.argsort(around[inside])
    around, bore = around[inside][order], bore[inside][order]
    least = math.inf
    for phase in 2 * np.pi * np.arange(72) / 72:
        scene.draw(phase)
        angle, radius = polar(np.concatenate([
            drawn(scene, path, phase, leans) for path in scene.parts.gap if "pole" in path]))
        low, high = scene.sizes.uncut
        cut = (angle > high) & (angle < low + 2 * np.pi)  # no stator is drawn there
        left = np.interp(angle, around, bore, period=2 * np.pi) - radius
        least = min(least, float(left[~cut].min()) / scene.settings.exaggeration)
    # 72 phases; the faces of 32 poles have five points each and leave a third uncovered
    assert least == pytest.approx(scene.smallest_gap, abs=2e-3 * nominal)


@pytest.mark.parametrize("name", ["pads", FOLDED])
def test_pads_can_be_counted_and_stand_where_the_card_says(scene_of, name):
    scene = scene_of(name)
    added = {}
    real = scene.server.scene.add_mesh_simple
    scene.server.scene.add_mesh_simple = lambda path, *solid, **look: added.setdefault(
        path, real(path, *solid, **look))
    scene.parts.add_guides()
    pads = added["/bearings/pads/pads"]
    assert bodies_of(pads) == scene.machine.pad_bearings[0].pads
    place = np.asarray(pads.vertices).reshape(scene.machine.pad_bearings[0].pads, -1, 3)
    first = place.mean(axis=1)[0]
    angle = scene.machine.pad_bearings[0].angle  # from z, which is Y, towards x, which is X
    assert first[:2] / np.hypot(*first[:2]) == pytest.approx([math.sin(angle), math.cos(angle)],
                                                             abs=1e-9)


def test_the_mouth_of_a_crack_turns_with_the_shaft(scene_of):
    """Its direction is (sin(Ωt + ψ), cos(Ωt + ψ)) in (x, z), in the middle of its element."""
    scene = scene_of("crack")
    crack, nodes = scene.machine.cracks[0], scene.machine.shaft.nodes
    frame = scene.parts.moving[f"crack {crack.name}"]
    rest = [math.sin(crack.phase), math.cos(crack.phase), 0.0]
    for phase in (0.0, 1.0, 4.0):
        scene.draw(phase)
        found = Rotation.from_quat(np.roll(frame.wxyz, -1)).apply(rest)
        turned = [math.sin(phase + crack.phase), math.cos(phase + crack.phase)]
        assert found[:2] == pytest.approx(turned, abs=0.01)  # it leans with the shaft
        assert frame.position[2] == pytest.approx(-nodes[crack.element:crack.element + 2].mean())


@pytest.mark.parametrize("name", IN_A_GAP)
def test_a_branch_is_shown(name):
    view = show(branch(name), machine(name))
    assert view.reading == reading(branch(name))


def test_a_branch_without_steps_along_it_is_shown_and_moves():
    """A sweep knows no arclength; its end is where the slider ends."""
    unit = load_machine("kaplan-150rpm")
    natural = sweep(unit.model(), HarmonicBalance(4), np.linspace(0, 0.08, 9), speed=unit.speed)
    assert show(natural).reading == reading(natural)
    scene = MachineScene(open_server(port=0), unit, natural, playing=False)
    assert scene.limits["static_eccentricity"][1] == pytest.approx(0.08)
    assert len(scene.live.legs.all) == 1
    scene.change(field=0.95, static_eccentricity=0.05)
    own = HarmonicBalance(4).solve(unit.model().with_field(0.95), unit.speed, 0.05)
    assert scene.smallest_gap == pytest.approx(own.smallest_gap, rel=1e-8)


def test_an_orbit_of_another_law_is_shown_on_its_own_leg():
    name = "shaped stator"
    orbit = HarmonicBalance(4).solve(machine(name).model(), machine(name).speed, 0.02)
    assert show(orbit, machine(name)).reading == reading(orbit)


def test_a_motion_of_two_revolutions_is_refused_in_words():
    unit = load_machine("kaplan-150rpm")
    orbit = HarmonicBalance(8, revolutions=2).solve(unit.model(), unit.speed, 0.02)
    with pytest.raises(BadInput, match="repeats every 2 revolutions"):
        show(orbit)


@pytest.mark.parametrize("name", MACHINES)
def test_every_machine_is_recorded(scene_of, name, tmp_path):
    scene = scene_of(name)
    scene.change(slow_motion=1.0)
    path = record_scene(scene, tmp_path / "machine.html", turns=1)
    assert 0.7e6 < path.stat().st_size < 2e6
