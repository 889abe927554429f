"""The panel beside the 3D machine: one number and its reading for everyone, controls for those who
may use them, and the steps of a run sheet.

Controls belong to one client (`client.gui`); what they set belongs to the scene, so the panels of
several presenters follow each other. Callbacks are coroutines: viser runs them one after the other
in its event loop, and the last move of a slider is the last that counts. They only set the scene's
settings; the scene's own loop does the work.

counts: votes for A, B, C. place: number of a step, 0 is the first. slowly: as a person would.
before, wanted: settings.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from viser import ClientHandle, GuiEvent, ViserServer

from hydrolab.live import solids
from hydrolab.live.board import BRANCH, HIGH, WIDE
from hydrolab.live.gate import CHOICES, Pin, Poll, address_of
from hydrolab.live.run_sheet import RunSheet, Step
from hydrolab.live.server import is_loopback, stop_with_server
from hydrolab.live.surroundings import ASPECT, PORTRAIT

if TYPE_CHECKING:
    from hydrolab.live.scene import MachineScene

PERIOD = 0.1  # s between looks at what the scene shows
GLIDE = 2.0  # s; in which a step of the run sheet brings the machine to its settings
SLOW = 40.0  # times slower than the machine
MOTIONS = {"slow": 0.0, "one turn": 1.0, "step": 1 / 12}  # and how many revolutions
AGAIN = "jump again"
PHONE = 0.6  # width over height of a picture below which the controls are folded at first
MOVES = ("slow: once more for the pace of before. one turn, or a twelfth of it, and stop. jump "
         "again: with the other ending, where there is one")
STYLE = f"<style>{Path(__file__).with_name('panel.css').read_text(encoding='utf-8')}</style>"
# on a phone what is told is folded away
MORE = '<label class="more"><input type="checkbox" id="more"> more</label>'
ENDS = {-1: ("This is the first step", "next goes on from here."),
        1: ("That was the last step", "back shows the one before; again shows this one.")}


def big_number(smallest_gap: float, happened: str, reading: str) -> str:
    """The smallest gap (m, inf where there is none), large, what happened, and the reading, which a
    screen reader says when it changes.
    """
    number = (f'<div class="number">{1e3 * smallest_gap:.2f}<small> mm</small></div>'
              '<div class="unit">smallest gap</div>' if math.isfinite(smallest_gap) else "")
    return (f'<div class="told">{number}<div role="status" aria-live="polite">'
            f'<div class="happened">{escape(happened)}</div>'
            f'<div class="reading">{escape(reading)}</div></div></div>')


def room_words(step: Step, opened: bool = False, counts: Sequence[int] = ()) -> str:
    """What the room reads of a step: its title, the question, and what A, B and C stand for; once
    it is opened, how the room voted, which is right, and what is to be seen.
    """
    rows = [f"<b>{escape(step.title)}</b>", escape(step.ask)]
    for k, text in enumerate(step.poll):
        row = f"{CHOICES[k]}: {escape(text)}"
        if opened:
            row += f" ({counts[k]})"
        rows.append(f"<b>{row}</b>" if opened and CHOICES[k] == step.answer else row)
    if opened:
        rows.append(escape(step.see))
    return f'<div class="room">{"".join(f"<div>{row}</div>" for row in rows)}</div>'


def presenter_words(sheet: RunSheet, place: int, done: str = "", counts: Sequence[int] = ()) -> str:
    """What the presenter reads of a step beside its question: where it is in the sheet, what `next`
    will do and what it has done, how the room votes.
    """
    step = sheet.steps[place]
    before = sum(earlier.minutes for earlier in sheet.steps[:place])
    ahead = sheet.steps[place + 1].cue if place + 1 < len(sheet.steps) else "This is the last step."
    votes = " · ".join(f"{letter} {count}" for letter, count in zip(CHOICES, counts, strict=False))
    rows = "".join(f"<div><b>{name}</b> {escape(text)}</div>"
                   for name, text in (("Say", step.cue), ("Done", done),
                                      ("Votes", votes if step.poll else ""), ("Next", ahead))
                   if text)
    where = (f"{escape(sheet.title)}: step {place + 1} of {len(sheet.steps)}, "
             f"minute {before:g} to {before + step.minutes:g} of {sheet.minutes:g}")
    return f'<div class="presenter">{where}{rows}</div>'


TOLD = {"static_eccentricity": ("static eccentricity", 100.0, " %"),
        "field": ("field", 100.0, " % of the card's"),
        "unbalance": ("unbalance", 100.0, " % of the card's"),
        "exaggeration": ("displacements ×", 1.0, ""), "bow": ("bow ×", 1.0, ""),
        "slow_motion": ("slow motion ÷", 1.0, ""), "leg": ("orbit", 1.0, "")}


def done_words(before: Any, wanted: Mapping[str, Any]) -> str:
    """What a step changed, in words."""
    said = []
    for name, value in wanted.items():
        old = getattr(before, name)
        if name in TOLD and abs(value - old) > 1e-9:
            label, units, unit = TOLD[name]
            shift = 1 if name == "leg" else 0
            said.append(f"{label} {units * old + shift:.4g} → {units * value + shift:.4g}{unit}")
        elif isinstance(value, bool) and value != old:
            said.append(f"{name} {'on' if value else 'off'}")
    return f"{'; '.join(said)}." if said else "Nothing was changed."


@dataclass(frozen=True)
class Slider:
    """A slider: the setting it moves, its label, how many of its units are one of the scene's, its
    step, its hint.
    """

    name: str
    label: str
    units: float
    step: float
    hint: str


MACHINE = (
    Slider("static_eccentricity", "static eccentricity, %", 100.0, 0.05,
           "how far the stator is off centre, % of the gap"),
    Slider("field", "field, % of the card's", 100.0, 0.5, "the magnetic field in the gap"),
    Slider("unbalance", "unbalance, % of the card's", 100.0, 1.0, "the unbalance of every body"),
)
PICTURE = (
    Slider("exaggeration", "displacements drawn ×", 1.0, 1.0,
           "one factor for displacements and for the gap"),
    Slider("bow", "bow of the shaft drawn ×", 1.0, 1.0,
           "how much larger the shaft is drawn bent than it is"),
    Slider("slow_motion", "slow motion ÷", 1.0, 1.0, "how many times slower than the machine"),
)


def orbit_labels(scene: MachineScene) -> tuple[str, ...]:
    """The orbits to choose from: those the machine can be in, and the one that is shown."""
    return tuple(str(leg + 1) for leg in sorted({*scene.legs, scene.settings.leg}))


def aspect_of(client: ClientHandle) -> float:
    """Width over height of a client's picture; as the views are made for where it has none, hidden
    for instance.
    """
    width, height = client.camera.image_width, client.camera.image_height
    return max(width / height, 0.3) if width > 0 and height > 0 else ASPECT


@dataclass(eq=False)
class Panel:
    """The controls of one client, and what to call so that they show what the scene shows."""

    client: ClientHandle
    follow: list[Callable[[], None]] = field(default_factory=list)


class Controls:
    """The panels of all clients of a server, for one scene.

    pin: without one, every client on this computer has controls; with one, who gave it. sheet: a
    run sheet whose steps a presenter can call up.
    """

    def __init__(self, server: ViserServer, scene: MachineScene, pin: Pin | None = None,
                 sheet: RunSheet | None = None) -> None:
        self.server, self.scene, self.pin, self.sheet = server, scene, pin, sheet
        self.panels: dict[int, Panel] = {}
        self.views: dict[int, str] = {}  # what each client looks at
        self.tall: set[int] = set()  # the clients whose board is above the machine
        self.place = 0  # the step of the run sheet that is shown
        self.opened, self.done = False, ""
        self.poll = Poll()
        self.ballots: dict[int, Any] = {}
        self.pace = 8.0  # slow motion before it was made slower
        self.followed: object = None  # what the panels show
        server.gui.main_panel.dock_right()
        server.gui.add_html(STYLE + MORE, order=-1)
        self.big = server.gui.add_html("", order=0)
        self.asked = server.gui.add_html("", order=1)
        self.go_to(0, slowly=False)
        server.on_client_connect(self.welcome)
        server.on_client_disconnect(self.forget)
        follower = asyncio.run_coroutine_threadsafe(self._follow(), server.get_event_loop())
        stop_with_server(follower.cancel)

    async def welcome(self, client: ClientHandle) -> None:
        """Give a new client its views, and its controls or the field for the PIN."""
        self.look(client, self.scene.settings.view)
        client.camera.on_update(self._turned(client))
        with client.atomic():
            self._add_views(client)
            if self.sheet and any(step.poll for step in self.sheet.steps):
                self._add_ballot(client)
            if self.pin is not None:
                self._add_pin_field(client, self.pin)
            elif is_loopback(address_of(client)):
                self.add_controls(client)

    def _turned(self, client: ClientHandle) -> Callable[[Any], Any]:
        """What to do when a client's camera moves: nothing, unless its window has another shape."""
        shape = [aspect_of(client)]

        async def look_again(camera: Any) -> None:
            if abs(aspect_of(client) / shape[0] - 1) > 0.08:
                shape[0] = aspect_of(client)
                self.look(client, self.views.get(client.client_id, self.scene.settings.view))

        return look_again

    async def forget(self, client: ClientHandle) -> None:
        """Drop the panel of a client that has gone."""
        self.panels.pop(client.client_id, None)
        self.views.pop(client.client_id, None)
        self.tall.discard(client.client_id)
        self.ballots.pop(client.client_id, None)
        self.poll.forget(client.client_id)

    async def _follow(self) -> None:
        """Keep every panel at what the scene shows; runs in the event loop, between callbacks and
        never during one.
        """
        said = ""
        while True:
            now = self.scene.settings, self.scene.legs, self.place, len(self.poll.votes)
            if now != self.followed:
                self.followed = now
                for panel in list(self.panels.values()):
                    for follow in panel.follow:
                        follow()
            happened, whole = self.scene.shown.words, self.scene.reading
            words = big_number(self.scene.smallest_gap, happened, whole.removeprefix(happened))
            if words != said:
                self.big.content = said = words
            await asyncio.sleep(PERIOD)

    def go_to(self, place: int, slowly: bool = True) -> None:
        """Show a step of the run sheet: its settings for all, its question for the room. What the
        room should see stays hidden until it is opened.
        """
        if self.sheet is None:
            return
        step, before = self.sheet.steps[place], self.scene.settings
        wanted = step.settings
        if step.slides and place:  # the machine itself goes on from the step before
            first = self.sheet.steps[place - 1]
            if place != self.place + 1 or not slowly:
                self.scene.change(**first.settings)
                before = self.scene.settings
            wanted = {name: value for name, value in wanted.items() if name != "leg"}
        self.place, self.opened = place, False
        self.done = done_words(before, wanted) if slowly else ""
        if slowly:
            self.scene.bring(GLIDE, **wanted)
        else:
            self.scene.change(**wanted)
        self.poll.open()
        for ballot in self.ballots.values():
            ballot.visible, ballot.disabled = bool(step.poll), False
        self.asked.content = room_words(step)

    def open(self) -> None:
        """Show the room what it should have seen, and how it voted."""
        if self.sheet is not None:
            self.opened = True
            self.asked.content = room_words(self.sheet.steps[self.place], True, self.poll.counts())
            for ballot in self.ballots.values():
                ballot.visible = False

    def look(self, client: ClientHandle, view: str) -> None:
        """Move the camera of one client, and nobody else's, to where its window shows the whole
        view.
        """
        self.views[client.client_id], aspect = view, aspect_of(client)
        position, target = self.scene.views[view].camera(aspect)
        tall = aspect < PORTRAIT and self.scene.views[view].board
        with client.atomic():
            if tall != (client.client_id in self.tall):
                self.scene.board.stand(client.scene, tall)
                self.tall ^= {client.client_id}
            client.camera.up_direction = tuple(self.scene.sizes.up)
            client.camera.position = position
            client.camera.look_at = target

    def _add_views(self, client: ClientHandle) -> None:
        buttons = client.gui.add_button_group("view", tuple(self.scene.views), order=2)

        @buttons.on_click
        async def look(event: GuiEvent) -> None:
            self.look(client, buttons.value)

    def _add_ballot(self, client: ClientHandle) -> None:
        """A, B and C for one client, seen while a question is open and it has not voted."""
        asked = bool(self.sheet.steps[self.place].poll) and not self.opened
        ballot = client.gui.add_button_group("your answer", tuple(CHOICES), order=1.5,
                                             visible=asked)
        self.ballots[client.client_id] = ballot

        @ballot.on_click
        async def vote(event: GuiEvent) -> None:
            if self.poll.take(client.client_id, ballot.value, address_of(client)):
                ballot.visible = False
                client.add_notification("Your answer", f"{ballot.value} is counted.",
                                        auto_close_seconds=3.0)

    def _add_pin_field(self, client: ClientHandle, pin: Pin) -> None:
        folder = client.gui.add_folder("for the presenter", expand_by_default=False, order=9)
        with folder:
            guess = client.gui.add_text(
                "PIN", "", hint="six digits, in the terminal where the server runs")
            button = client.gui.add_button("take the controls")

        @button.on_click
        async def ask(event: GuiEvent) -> None:
            answer = pin.check(guess.value, address_of(client))
            if answer:
                guess.value = ""
                client.add_notification("No controls", answer, auto_close_seconds=6.0,
                                        color="orange")
            elif client.client_id not in self.panels:
                folder.remove()
                self.add_controls(client)

    def add_controls(self, client: ClientHandle) -> None:
        """Give a client the controls, and the run sheet where there is one."""
        panel = self.panels[client.client_id] = Panel(client)
        gui = client.gui
        if self.sheet:
            with gui.add_folder("run sheet", order=3):
                self._add_sheet(panel, self.sheet)
        unfolded = aspect_of(client) >= PHONE
        with gui.add_folder("machine", order=4, expand_by_default=unfolded):
            for slider in MACHINE:
                self._add_slider(panel, slider)
            self._add_orbits(panel)
        with gui.add_folder("picture", order=5, expand_by_default=unfolded):
            for slider in PICTURE:
                self._add_slider(panel, slider)
            self._bind(panel, gui.add_checkbox("play", self.scene.settings.playing), "playing")
            for name in ("names", "dark"):
                self._bind(panel, gui.add_checkbox(name, getattr(self.scene.settings, name)), name)

        again = (AGAIN,) if self.scene.live.legs is not None else ()
        motion = gui.add_button_group("motion", (*MOTIONS, *again), order=2.5, hint=MOVES)

        @motion.on_click
        async def moved(event: GuiEvent) -> None:
            self._move(motion.value)

        if again:
            self._add_branch(client)

    def _move(self, motion: str) -> None:
        """Slow, or as before; the jump again; or by a part of a turn, and stop."""
        if motion == AGAIN:
            self.scene.again()
        elif motion == "slow":
            now = self.scene.settings.slow_motion
            self.pace = now if now != SLOW else self.pace
            self.scene.change(playing=True, slow_motion=self.pace if now == SLOW else SLOW)
        else:
            self.scene.go_on(MOTIONS[motion])

    def _add_branch(self, client: ClientHandle) -> None:
        """Let a client go to where it clicks on the branch; the plate to click on is its own."""
        board = self.scene.board
        plate = solids.box(0.0, WIDE * board.unit, 1.12 * HIGH * board.unit, 0.0, 0.01 * board.unit)
        low = board.flat(BRANCH + [0.0, 0.56 * HIGH])
        target = client.scene.add_mesh_simple("/board/branch to click", *plate, position=low,
                                              opacity=0.0, cast_shadow=False, receive_shadow=False)

        @target.on_click
        async def clicked(event: Any) -> None:
            eccentricity, first = board.picked(np.array(event.ray_origin),
                                               np.array(event.ray_direction),
                                               client.client_id in self.tall)
            if math.isfinite(eccentricity):
                self.scene.go_to(eccentricity / 100, 1e-6 * first)

    def _add_slider(self, panel: Panel, slider: Slider) -> None:
        low, high = (round(slider.units * bound, 6) for bound in self.scene.limits[slider.name])
        value = round(slider.units * getattr(self.scene.settings, slider.name), 6)
        value = min(max(value, low), high)
        handle = panel.client.gui.add_slider(slider.label, low, high, slider.step, value,
                                             hint=slider.hint)
        self._bind(panel, handle, slider.name, slider.units)

    def _bind(self, panel: Panel, handle: Any, name: str, units: float | None = None) -> None:
        """Let a control set a setting, and show the setting when something else has set it."""

        @handle.on_update
        async def moved(event: GuiEvent) -> None:
            if event.client is not None:  # a person moved it, not `follow`
                self.followed = None  # the scene may show something else than what was asked for
                self.scene.change(**{name: handle.value / units if units else handle.value})

        def follow() -> None:
            value = getattr(self.scene.settings, name)
            if not units:
                handle.value = value
            elif abs(handle.value / units - value) > 1e-9:
                handle.value = round(value * units, 6)

        panel.follow.append(follow)

    def _add_orbits(self, panel: Panel) -> None:
        """A choice of orbit, seen where the machine can be in more than one."""
        labels = orbit_labels(self.scene)
        handle = panel.client.gui.add_dropdown(
            "orbit", labels, hint="which it is on depends on the machine's past")

        @handle.on_update
        async def chosen(event: GuiEvent) -> None:
            if event.client is not None:
                self.scene.change(leg=int(handle.value) - 1)

        def follow() -> None:
            labels = orbit_labels(self.scene)
            if tuple(handle.options) != labels:
                handle.options = labels
            handle.value = str(self.scene.settings.leg + 1)
            if handle.visible != (len(labels) > 1):
                handle.visible = len(labels) > 1

        follow()
        panel.follow.append(follow)

    def _add_sheet(self, panel: Panel, sheet: RunSheet) -> None:
        gui = panel.client.gui
        turn = gui.add_button_group("go to", ("back", "again", "next"))
        show = gui.add_button("show the room what to see")
        words = gui.add_html("")

        @turn.on_click
        async def turned(event: GuiEvent) -> None:
            by = {"back": -1, "again": 0, "next": 1}[turn.value]
            if 0 <= self.place + by < len(sheet.steps):
                self.go_to(self.place + by)
                self.look(panel.client, sheet.steps[self.place].camera)
            else:
                title, body = ENDS[by]
                panel.client.add_notification(title, body, auto_close_seconds=6.0)

        @show.on_click
        async def shown(event: GuiEvent) -> None:
            self.open()

        def follow() -> None:
            words.content = presenter_words(sheet, self.place, self.done, self.poll.counts())

        follow()
        panel.follow.append(follow)
