"""What a camera shows of the 3D machine: for every card and view, on a projector, a large screen
and a phone, no label lies over another, over the orbit's square or under the panel, or is cut.
"""

import itertools
import math

import numpy as np
import pytest

from hydrolab import load_machine
from hydrolab.live.board import HALF, ORBIT
from hydrolab.live.bodies import sizes_of
from hydrolab.live.poses import at_stations
from hydrolab.live.run_sheet import VIEWS
from hydrolab.live.scene import MachineScene
from hydrolab.live.surroundings import LENS, add_board, add_names, views_of

viser = pytest.importorskip("viser", reason="viser is in the project's own dependencies")

PANEL, FOLDED = 324, 205  # px: the panel beside the picture, and folded under it on a phone
# width and height of the picture, and the lowest row that nothing covers
SCREENS = {"1366 × 768": (1366 - PANEL, 768, 768), "1920 × 1080": (1920 - PANEL, 1080, 1080),
           "390 × 844": (390, 844, 844 - FOLDED)}
CARDS = ["kaplan-150rpm", "two-pole", "francis-three-guides", "jeffcott", "pump-turbine",
         "pelton-horizontal"]


@pytest.fixture(scope="module")
def server():
    opened = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield opened
    opened.stop()


class Picture:
    """What a camera sees in a window, in pixels from its upper left corner."""

    def __init__(self, view, width, height, up):
        self.width, self.height = width, height
        position, target = map(np.array, view.camera(width / height))
        back = (position - target) / np.linalg.norm(position - target)
        right = np.cross(up, back)
        right /= np.linalg.norm(right)
        self.position, self.axes = position, np.stack([right, np.cross(back, right), back])
        self.scale = height / 2 / math.tan(LENS / 2)

    def box(self, points):
        """Left, top, right, bottom of points (N, 3)."""
        right, up, back = self.axes @ (np.asarray(points) - self.position).T
        x, y = self.width / 2 - self.scale * right / back, self.height / 2 + self.scale * up / back
        return np.array([x.min(), y.min(), x.max(), y.max()])

    def label(self, label, place=None, turn=None):
        """The box of a label, in the frame of a board where there is one, and its letters."""
        turn = np.eye(3) if turn is None else turn
        corners = label.corners(self.axes[0] @ turn, self.axes[1] @ turn) @ turn.T
        corners = corners + (0 if place is None else place)
        away = -(self.axes @ (corners[0] - self.position))[2]
        return self.box(corners), self.scale * label.em / away

    def cuts(self, box, lowest):
        """Whether a box is in the picture, and whether it is there in part only."""
        left, top, right, bottom = box
        inside = left < self.width and right > 0 and top < lowest and bottom > 0
        return inside, not (left >= 0 and right <= self.width and top >= 0 and bottom <= lowest)


def over(one, other):
    return bool((np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2]) > 0.5).all())


def check(view, names, board, size, up=(0.0, 0.0, 1.0)):
    """No label of this view on this screen lies over what it should not."""
    width, height, lowest = size
    seen = Picture(view, width, height, up)
    tall = width < 0.9 * height
    place = board.above if tall and view.board else board.place
    own = (names.gap, *board.labels.values()) if names.gap else tuple(board.labels.values())
    boxes = {}
    for label in (*names.names, names.scale):
        boxes[label.text] = seen.label(label)
    if view.board:
        for label in own:
            boxes[label.text] = seen.label(label, place, board.turn)
    shown = {}
    for text, (box, letters) in boxes.items():
        inside, cut = seen.cuts(box, lowest)
        if not inside:
            continue
        written = any(label.text == text for label in own)
        if not (cut and written and view.wide.labels == ()):
            assert not cut, f"{text!r} is cut: {box}"
            shown[text] = box
            assert tall or letters >= 18, f"{text!r} has letters of {letters:.1f} px"
    assert shown
    for (text, one), (other, two) in itertools.combinations(shown.items(), 2):
        assert not over(one, two), f"{text!r} lies over {other!r}"
    if view.board:
        square = ORBIT + HALF * np.array([[-1, -1], [1, 1]])
        dial = seen.box(board.flat(square) @ board.turn.T + place)
        for label in (*names.names, names.scale):
            assert label.text not in shown or not over(shown[label.text], dial), label.text


@pytest.mark.parametrize("screen", SCREENS)
@pytest.mark.parametrize("card", CARDS)
def test_no_name_is_hidden_cut_or_small(server, card, screen):
    machine = load_machine(card)
    sizes = sizes_of(machine)
    board = add_board(server, sizes, machine.air_gap is not None)
    nodes, depths, _ = at_stations(machine, np.zeros((machine.nodes, 4 if machine.shaft else 2, 1)))
    names = add_names(server, machine, sizes, depths[nodes:], board)
    names.say("gap 7.84 of 11 mm", "Gap × 76, bow × 304, 8 times slower", True)
    for name, view in views_of(sizes, names, board).items():
        assert name in VIEWS
        check(view, names, board, SCREENS[screen], sizes.up)
    for label in names.names:
        label.handle.remove()


@pytest.mark.parametrize("screen", SCREENS)
def test_nothing_on_the_board_lies_over_another(server, screen):
    scene = MachineScene(server, load_machine("kaplan-150rpm"), playing=False)
    for settings in ({"static_eccentricity": 0.088, "leg": 0}, {"leg": 2},
                     {"static_eccentricity": 0.078}):
        scene.change(**settings)
        for name in ("machine", "along the axis"):
            check(scene.views[name], scene.names, scene.board, SCREENS[screen])
