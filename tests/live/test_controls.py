"""The panel: who has controls, what they set, and that nobody without the PIN sets anything."""

import dataclasses
import math
import threading
import time
from typing import ClassVar

import numpy as np
import pytest

from hydrolab.live.gate import FIRST_WAIT, GUESSES, RATE, Pin, Poll, new_digits
from hydrolab.live.panel import SLOW, Controls, big_number, presenter_words, room_words
from hydrolab.live.run_sheet import RunSheet, Step
from hydrolab.live.server import open_server
from hydrolab.live.surroundings import ASPECT


@dataclasses.dataclass(frozen=True)
class Settings:
    static_eccentricity: float = 0.0
    leg: int = 0
    field: float = 1.0
    unbalance: float = 1.0
    exaggeration: float = 100.0
    bow: float = 200.0
    slow_motion: float = 20.0
    playing: bool = True
    names: bool = True
    dark: bool = False
    ending: str = "any"
    view: str = "whole machine"


@dataclasses.dataclass(frozen=True)
class Look:
    """A view that goes back by as much as the picture is narrower than it is made for."""

    position: tuple
    target: tuple
    board: ClassVar = False

    def camera(self, aspect):
        away = max(1.0, ASPECT / aspect) * np.subtract(self.position, self.target)
        return tuple((self.target + away).tolist()), self.target


class Stage:
    """A scene that draws nothing: it keeps its settings as the real one does, and every call."""

    limits: ClassVar = {"static_eccentricity": (0.0, 0.11), "field": (0.8, 1.1),
                        "unbalance": (0.0, 2.0),
                        "exaggeration": (1.0, 300.0), "bow": (1.0, 900.0),
                        "slow_motion": (1.0, 200.0)}
    views: ClassVar = {"whole machine": Look((9.0, 9.0, 3.0), (0.0, 0.0, -4.0)),
                       "generator": Look((5.0, 5.0, 2.0), (0.0, 0.0, 0.0)),
                       "from above": Look((0.1, 0.0, 12.0), (0.0, 0.0, 0.0))}
    sizes: ClassVar = type("Upright", (), {"up": (0.0, 0.0, 1.0)})
    live: ClassVar = type("NoBranch", (), {"legs": None})
    smallest_gap = 7.844e-3
    shown: ClassVar = type("Shown", (), {"words": ""})

    def __init__(self):
        self.settings, self.calls, self.lock = Settings(), [], threading.Lock()

    @property
    def legs(self):
        return (0, 2) if 0.0812 <= self.settings.static_eccentricity <= 0.08925 else (0,)

    @property
    def reading(self):
        return f"At {100 * self.settings.static_eccentricity:.2f} % the smallest gap is < 8 mm."

    def change(self, **settings):
        for name, value in settings.items():
            assert type(value) is type(getattr(self.settings, name)), f"{name} is {value!r}"
            if name in self.limits:
                assert self.limits[name][0] <= value <= self.limits[name][1]
        with self.lock:
            self.calls.append(settings)
            self.settings = dataclasses.replace(self.settings, **settings)

    def bring(self, seconds, **settings):
        self.change(**settings)

    def go_on(self, revolutions):
        self.calls.append(revolutions)


STATE = {"eccentricity": 8.8, "orbit": 1, "field": 1.0, "unbalance": 1.0, "playing": True}
SHEET = RunSheet("A short one", 3, "kaplan-150rpm", (
    Step("First", 1, "generator", STATE | {"eccentricity": 0.0}, "do 1", "see 1", "why 1?", {}),
    Step("Second", 1, "from above", STATE, "do 2", "see 2", "why 2?", {},
         ("more", "less", "<none>"), "B"),
    Step("Third", 1, "generator", STATE | {"orbit": 3}, "do 3", "see <3>", "why 3?", {})))
SLIDERS = {"static eccentricity, %": ("static_eccentricity", 8.8, 0.088),
           "field, % of the card's": ("field", 95.0, 0.95),
           "unbalance, % of the card's": ("unbalance", 50.0, 0.5),
           "bow of the shaft drawn ×": ("bow", 300.0, 300.0),
           "displacements drawn ×": ("exaggeration", 70.0, 70.0),
           "slow motion ÷": ("slow_motion", 40.0, 40.0)}
SWITCHES = {"play": ("playing", False), "names": ("names", False), "dark": ("dark", True)}


@pytest.fixture
def stage():
    """A local server with a panel; `.port`, `.scene`, `.controls`."""
    return staged()


def staged(**options):
    scene, server = Stage(), open_server(port=0)
    controls = Controls(server, scene, **options)
    return type("Staged", (), {"port": server.get_port(), "scene": scene, "controls": controls,
                               "server": server})


def value_heard(client, uuid):
    """The last value this client was told for a control."""
    told = [m["updates"]["value"] for m in list(client.heard)
            if m["type"] == "GuiUpdateMessage" and m["uuid"] == uuid and "value" in m["updates"]]
    return told[-1] if told else None


def options_heard(client, uuid):
    """The choices this client was last told of for a control, after those it began with."""
    told = [m["updates"]["options"] for m in list(client.heard)
            if m["type"] == "GuiUpdateMessage" and m["uuid"] == uuid and "options" in m["updates"]]
    return told[-1] if told else ()


def test_every_control_sets_its_setting(stage, raw):
    client = raw(stage.port)
    for label, (name, shown, value) in SLIDERS.items():
        client.set(client.control(label), shown)
        client.wait(lambda _, n=name, v=value: getattr(stage.scene.settings,
                                                       n) == pytest.approx(v, abs=1e-12))
    for label, (name, value) in SWITCHES.items():
        client.set(client.control(label), value)
        client.wait(lambda _, n=name, v=value: getattr(stage.scene.settings, n) is v)
    orbit = client.control("orbit")
    client.wait(lambda me: "3" in options_heard(me, orbit))
    client.set(orbit, "3")
    client.wait(lambda _: stage.scene.settings.leg == 2)
    motion = client.control("motion")
    for name, revolutions in (("one turn", 1.0), ("step", 1 / 12)):
        client.set(motion, name)
        client.wait(lambda _, r=revolutions: stage.scene.calls[-1] == pytest.approx(r))
    stage.scene.change(slow_motion=20.0)
    for pace in (SLOW, 20.0):
        client.set(motion, "slow")
        client.wait(lambda _, p=pace: stage.scene.settings.slow_motion == p)
    assert stage.scene.settings.playing


def test_nothing_out_of_range_reaches_the_scene(stage, raw):
    client = raw(stage.port)
    for label in [*SLIDERS, *SWITCHES, "orbit"]:
        for value in (99999, -5, float("nan"), "7", None, [1], {"x": 1}, 2**63):
            client.set(client.control(label), value)
    client.set(client.control("orbit"), "3")  # no such orbit at 0 %
    client.set(client.control("slow motion ÷"), 30)
    client.wait(lambda _: stage.scene.settings.slow_motion == 30)
    assert stage.scene.settings == Settings(slow_motion=30.0)
    assert client.closed is None


def test_a_fast_drag_ends_on_the_last_value(stage, raw):
    client = raw(stage.port)
    slider = client.control("static eccentricity, %")
    for i in range(1, 301):
        client.set(slider, round(i * 0.03, 2))
    client.wait(lambda _: stage.scene.settings.static_eccentricity == pytest.approx(0.09))
    moved = [call["static_eccentricity"] for call in stage.scene.calls
             if "static_eccentricity" in call]
    assert moved == sorted(moved)
    # the panel has followed the scene, for all to read
    client.wait(lambda me: "At 9.00 %" in html_shown(me))
    client.set(client.control("slow motion ÷"), 30)
    client.wait(lambda _: stage.scene.settings.slow_motion == 30)
    assert stage.scene.settings.static_eccentricity == pytest.approx(0.09)


def test_two_panels_follow_each_other_and_the_scene(stage, raw):
    one, two = raw(stage.port), raw(stage.port)
    label = "static eccentricity, %"
    theirs = two.control(label)
    one.set(one.control(label), 8.8)
    two.wait(lambda me: value_heard(me, theirs) == pytest.approx(8.8))
    orbit = two.control("orbit")
    two.wait(lambda me: list(options_heard(me, orbit)) == ["1", "3"])
    stage.scene.change(static_eccentricity=0.05, names=False)
    one.wait(lambda me: value_heard(me, me.control(label)) == pytest.approx(5.0))
    two.wait(lambda me: value_heard(me, me.control("names")) is False)
    slow = two.control("slow motion ÷")
    one.set(one.control("slow motion ÷"), 40)
    two.wait(lambda me: value_heard(me, slow) == 40)
    # following sets nothing
    assert stage.scene.calls == [{"static_eccentricity": pytest.approx(0.088)},
                                 {"static_eccentricity": 0.05, "names": False}, {"slow_motion": 40}]


def test_a_view_moves_only_the_camera_of_the_one_who_clicked(stage, raw):
    one, two = raw(stage.port), raw(stage.port)
    names = two.control("names")
    one.set(one.control("view"), "generator")
    one.wait(lambda me: any(list(m["position"]) == [5.0, 5.0, 2.0] for m in me.heard
                            if m["type"] == "SetCameraPositionMessage"))
    one.wait(lambda me: [m for m in me.heard if m["type"] == "SetCameraLookAtMessage"
                         and not any(m["look_at"])])
    stage.scene.change(names=False)
    two.wait(lambda me: value_heard(me, names) is False)  # so it has heard all that came before
    assert [list(m["position"]) for m in two.heard  # the first view, and no other
            if m["type"] == "SetCameraPositionMessage"] == [[9.0, 9.0, 3.0]]
    assert stage.scene.calls == [{"names": False}]


@pytest.mark.parametrize(("width", "height", "away"),
                         [(640, 400, None), (1600, 400, None), (400, 800, 2 * ASPECT),
                          (800, 800, ASPECT), (0, 0, None), (800, 0, None), (-4, 3, None),
                          (1, 10**9, ASPECT / 0.3)])
def test_a_narrow_window_sees_the_whole_view_from_further_away(stage, raw, width, height, away):
    camera = raw.camera | {"image_width": width, "image_height": height}
    client = raw(stage.port, hello=False)
    client.say(camera)
    client.control("view")
    view = stage.scene.views["whole machine"]
    position, target = np.array(view.position), np.array(view.target)
    moved = [m["position"] for m in client.heard if m["type"] == "SetCameraPositionMessage"]
    assert moved == [pytest.approx(target + (away or 1.0) * (position - target))]
    client.set(client.control("view"), "generator")
    client.wait(lambda me: len([m for m in me.heard if m["type"] == "SetCameraPositionMessage"])
                > len(moved))
    again = [m["position"] for m in client.heard if m["type"] == "SetCameraPositionMessage"][-1]
    view = stage.scene.views["generator"]
    position, target = np.array(view.position), np.array(view.target)
    assert again == pytest.approx(target + (away or 1.0) * (position - target))


def html_shown(client):
    """What the shared texts say now, {id: html}."""
    shown = {}
    for message in list(client.heard):
        if message["type"] == "GuiHtmlMessage":
            shown[message["uuid"]] = message["props"]["content"]
        elif message["type"] == "GuiUpdateMessage" and "content" in message["updates"]:
            shown[message["uuid"]] = message["updates"]["content"]
    return "".join(shown.values())


def test_everyone_reads_the_big_number(stage, raw):
    client = raw(stage.port)
    client.wait(lambda me: "7.84" in html_shown(me) and "At 0.00 %" in html_shown(me))
    stage.scene.change(static_eccentricity=0.05)
    client.wait(lambda me: "At 5.00 %" in html_shown(me))
    assert "is &lt; 8 mm" in html_shown(client) and 'role="status"' in html_shown(client)


# --- before a room

@pytest.fixture
def room():
    return staged(pin=Pin("314159"), sheet=SHEET)


def give(client, digits):
    client.set(client.control("PIN"), digits)
    client.set(client.control("take the controls"), True)


def notices(client):
    return [m["props"]["body"] for m in list(client.heard)
            if m["type"] == "NotificationShowMessage"]


def test_only_the_pin_gives_controls(room, raw):
    watcher, presenter = raw(room.port), raw(room.port)
    watcher.control("take the controls")
    assert set(watcher.labels()) == {"view", "your answer", "PIN", "take the controls",
                                     "for the presenter"}
    give(presenter, "314159")
    presenter.set(presenter.control("field, % of the card's"), 95.0)
    presenter.wait(lambda _: room.scene.settings.field == 0.95)
    assert "PIN" not in presenter.labels()
    before = room.scene.settings
    for uuid in presenter.labels().values():  # a watcher who knows the presenter's ids
        for value in (90.0, True, "next", "3"):
            watcher.set(uuid, value)
    give(watcher, "000000")
    watcher.wait(notices)
    assert "static eccentricity, %" not in watcher.labels()
    assert room.scene.settings == before
    assert list(room.controls.panels) == [1]


def test_the_pin_is_told_to_nobody(room, raw):
    watcher, presenter = raw(room.port), raw(room.port)
    give(presenter, "314159")
    presenter.control("motion")
    give(watcher, "271828")
    watcher.wait(notices)
    for client in (watcher, presenter):
        assert not any("314159" in str(message) for message in client.heard)
    assert "314159" not in repr(room.controls.pin)


def test_guesses_are_limited(room, raw):
    client = raw(room.port)
    for i in range(GUESSES):
        give(client, f"{i:06d}")
        client.wait(lambda me, n=i: len(notices(me)) > n)
    assert notices(client)[0] == "That is not the PIN; 4 more guesses."
    assert "try again in 60 s" in notices(client)[-1]
    again = raw(room.port)  # a new connection from there is no new start
    give(again, "314159")
    assert "try again in" in again.wait(notices)[0]
    assert not room.controls.panels


def test_whoever_leaves_takes_the_controls_along(room, raw):
    presenter = raw(room.port)
    give(presenter, "314159")
    presenter.control("motion")
    presenter.close()
    back = raw(room.port)
    back.wait(lambda _: not room.controls.panels)
    assert "static eccentricity, %" not in (back.control("view") and back.labels())
    give(back, " 314159 ")
    assert back.control("static eccentricity, %")


def test_a_presenter_goes_through_the_run_sheet(room, raw):
    presenter, watcher = raw(room.port), raw(room.port)
    give(presenter, "314159")
    turn = presenter.control("go to")
    assert room.scene.settings.static_eccentricity == 0.0
    presenter.set(turn, "next")
    presenter.wait(lambda _: room.scene.settings.static_eccentricity == pytest.approx(0.088))
    presenter.wait(lambda me: "A short one: step 2 of 3" in html_shown(me)
                   and "do 2" in html_shown(me))
    presenter.wait(lambda me: "static eccentricity 0 → 8.8 %." in html_shown(me))  # what was done
    watcher.wait(lambda me: "why 2?" in html_shown(me))
    assert "do 2" not in html_shown(watcher) and "see 2" not in html_shown(watcher)
    presenter.wait(lambda me: any(list(m["position"]) == [0.1, 0.0, 12.0] for m in me.heard
                                  if m["type"] == "SetCameraPositionMessage"))
    assert len([m for m in watcher.heard if m["type"] == "SetCameraPositionMessage"]) == 1
    presenter.set(presenter.control("show the room what to see"), True)
    watcher.wait(lambda me: "see 2" in html_shown(me))
    for press in ("next", "next"):
        presenter.set(turn, press)
    presenter.wait(lambda _: room.scene.settings.leg == 2)
    told = presenter.wait(lambda me: [m["props"]["title"] for m in me.heard
                                      if m["type"] == "NotificationShowMessage"])
    assert told == ["That was the last step"]  # the end is not silent, and nothing moves
    presenter.wait(lambda me: "step 3 of 3" in html_shown(me) and "do 3" in html_shown(me))
    presenter.set(presenter.control("static eccentricity, %"), 1.0)
    presenter.wait(lambda _: room.scene.settings.static_eccentricity == pytest.approx(0.01))
    presenter.set(turn, "again")
    presenter.wait(lambda _: room.scene.settings.static_eccentricity == pytest.approx(0.088))
    for press in ("back", "back", "back"):
        presenter.set(turn, press)
    presenter.wait(lambda _: room.controls.place == 0
                   and room.scene.settings.static_eccentricity == 0)
    assert room.scene.settings.leg == 0


# --- the poll

def test_the_room_votes_once_each_and_the_presenter_sees_the_counts(room, raw):
    presenter, *phones = (raw(room.port) for _ in range(4))
    give(presenter, "314159")
    presenter.set(presenter.control("go to"), "next")
    for phone, letter in zip(phones, "BBC", strict=True):
        ballot = phone.control("your answer")
        phone.wait(lambda me, b=ballot: visible_heard(me, b) is True)
        before = len(room.controls.poll.votes)
        for nonsense in ("D", "", "AB", 1, None, ["A"], {"A": 1}, math.nan, "A" * 5000):
            phone.set(ballot, nonsense)
        while len(room.controls.poll.votes) == before:  # one after another, not all at once
            phone.set(ballot, letter)
            time.sleep(2 / RATE)
        phone.wait(lambda me, b=ballot: visible_heard(me, b) is False)
        phone.set(ballot, "A")  # a second vote
    presenter.wait(lambda me: "A 0 · B 2 · C 1" in html_shown(me))
    assert "B: less (2)" not in html_shown(phones[0])
    presenter.set(presenter.control("show the room what to see"), True)
    phones[0].wait(lambda me: "<b>B: less (2)</b>" in html_shown(me)
                   and "C: &lt;none&gt; (1)" in html_shown(me))
    assert room.scene.settings.static_eccentricity == pytest.approx(0.088)
    assert all(phone.closed is None for phone in phones)
    phones[0].close()
    presenter.wait(lambda me: "A 0 · B 1 · C 1" in html_shown(me))  # a vote goes with its phone
    presenter.set(presenter.control("go to"), "next")
    presenter.wait(lambda _: not room.controls.poll.votes)


def visible_heard(client, uuid):
    """Whether a client was last told that a control is to be seen."""
    told = [m["updates"]["visible"] for m in list(client.heard)
            if m["type"] == "GuiUpdateMessage" and m["uuid"] == uuid and "visible" in m["updates"]]
    return told[-1] if told else None


def test_votes_come_no_faster_than_people_tap_from_one_address():
    clock = [0.0]
    poll = Poll(now=lambda: clock[0])
    assert poll.take(1, "A", "a") and not poll.take(2, "A", "a") and poll.take(2, "B", "b")
    clock[0] += 1.01 / RATE
    assert poll.take(3, "C", "a") and not poll.take(3, "C", "c") and not poll.take(4, "D", "c")
    assert poll.counts() == [1, 1, 1]
    poll.forget(3)
    assert poll.counts() == [1, 1, 0]
    poll.open()
    assert poll.counts() == [0, 0, 0]


# --- a click on the branch

def test_only_a_presenter_can_click_on_the_branch_and_only_with_sense(raw):
    from hydrolab import load_machine
    from hydrolab.live.scene import MachineScene

    server = open_server(port=0)
    scene = MachineScene(server, load_machine("kaplan-150rpm"))
    Controls(server, scene, Pin("314159"))
    presenter, watcher = raw(server.get_port()), raw(server.get_port())
    give(presenter, "314159")
    presenter.control("motion")
    plate = presenter.wait(lambda me: [m for m in me.heard if m["type"] == "MeshMessage"
                                       and m["name"] == "/board/branch to click"])[0]
    ray = scene.board.turn @ np.array([0.0, 0.0, -1.0])
    at = scene.board.flat(scene.board.on_branch(np.array(5.0), np.array(235.0)), 0.0)
    origin = scene.board.turn @ at + scene.board.place - 5 * ray
    click = {"type": "SceneNodeClickMessage", "name": "/board/branch to click",
             "instance_index": None, "ray_origin": origin.tolist(), "ray_direction": ray.tolist(),
             "screen_pos": [0.5, 0.5], "modifier": None, "owner": plate["owner"]}
    for wrong in ({"ray_origin": [math.nan] * 3}, {"ray_direction": [0.0] * 3},
                  {"ray_origin": [1e9] * 3}, {"name": "/board/dot"}, {"modifier": "shift"}):
        presenter.say(click | wrong)
    watcher.say(click)
    watcher.set(watcher.control("view"), "air gap")
    watcher.wait(lambda me: len([m for m in me.heard
                                 if m["type"] == "SetCameraPositionMessage"]) > 1)
    assert scene.settings.static_eccentricity == 0.0
    presenter.say(click)
    presenter.wait(lambda _: scene.settings.static_eccentricity == pytest.approx(0.05, abs=1e-6))
    assert presenter.closed is None


# --- the parts

def test_the_wait_after_wrong_guesses_doubles_for_each_address_alone():
    clock = [0.0]
    pin = Pin("314159", now=lambda: clock[0])
    for _ in range(GUESSES):
        assert pin.check("0", "a")
    assert "60 s" in pin.check("314159", "a")
    assert pin.check("314159", "b") == ""
    clock[0] = FIRST_WAIT + 1
    assert "120 s" in pin.check("0", "a")
    clock[0] += 2 * FIRST_WAIT + 1
    assert pin.check("314159", "a") == ""
    assert "4 more" in pin.check("0", "a")  # a right one clears the account


@pytest.mark.parametrize("guess", [None, 314159, "", "31415", "3141590", b"314159", ["314159"],
                                   "٣١٤١٥٩", "é" * 6])
def test_only_the_six_digits_are_right(guess):
    assert Pin("314159").check(guess, "a") != ""


def test_pins_are_six_digits_and_not_the_same():
    made = {new_digits() for _ in range(50)}
    assert len(made) > 45 and all(len(digits) == 6 and digits.isdigit() for digits in made)


def test_words_are_escaped_and_complete():
    asked = dataclasses.replace(SHEET.steps[0], ask="<script>")
    assert "<script>" not in big_number(0.001, "<script>", "<script>") + room_words(asked)
    assert "minute 1 to 2 of 3" in presenter_words(SHEET, 1)
    assert "smallest gap" not in big_number(math.inf, "no gap here", "")
