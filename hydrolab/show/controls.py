"""The panel beside the 3D machine: one number and its reading for everyone, controls for those who may use them.

Controls belong to one client (`client.gui`); what they set belongs to the scene, so the panels of several presenters
follow each other. Callbacks are coroutines: viser runs them one after the other in its event loop, and the last move of
a slider is the last that counts. They only set the scene's settings; the scene's own loop does the work.
"""

from __future__ import annotations

import asyncio
import html
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from viser import ClientHandle, GuiEvent, ViserServer

from hydrolab.show.pin import Pin
from hydrolab.show.run_sheet import RunSheet, Step
from hydrolab.show.scene import MachineScene
from hydrolab.show.server import is_loopback, stop_with_server

PERIOD = 0.1  # s between looks at what the scene shows


@dataclass(frozen=True)
class Slider:
    """A slider of the panel: the setting it moves, how many of its units are one of the scene's, and its step."""

    name: str
    label: str
    units: float
    step: float
    hint: str


SLIDERS = (
    Slider("static_eccentricity", "static eccentricity, %", 100.0, 0.05, "how far the stator is off centre, per cent of the gap"),
    Slider("field", "field, % of the card's", 100.0, 0.5, "magnetic field in the gap"),
    Slider("unbalance", "unbalance, % of the card's", 100.0, 1.0, "unbalance of every body"),
    Slider("exaggeration", "displacements drawn ×", 1.0, 1.0, "one factor for displacements and for the gap"),
    Slider("slow_motion", "slow motion ÷", 1.0, 1.0, "how many times slower than the machine"),
)


@dataclass(eq=False)
class Panel:
    """The controls of one client: `handles` by the setting they show, and what to call when a setting changes."""

    client: ClientHandle
    handles: dict[str, Any] = field(default_factory=dict)
    follow: list[Callable[[], None]] = field(default_factory=list)


class Controls:
    """The panels of all clients of a server, for one scene.

    pin: without one, every client on this computer has controls; with one, who gave it. sheet: a run sheet whose steps
    the presenter can call up.
    """

    def __init__(self, server: ViserServer, scene: MachineScene, pin: Pin | None = None,
                 sheet: RunSheet | None = None) -> None:
        self.server, self.scene, self.pin, self.sheet = server, scene, pin, sheet
        self.panels: dict[int, Panel] = {}
        self.place = 0  # the step of the run sheet that is shown
        self.big = server.gui.add_html(big_number(scene), order=0)
        server.on_client_connect(self.welcome)
        server.on_client_disconnect(self.forget)
        if sheet:
            self.show_step(0)
        follower = asyncio.run_coroutine_threadsafe(self._follow(), server.get_event_loop())
        stop_with_server(follower.cancel)

    async def welcome(self, client: ClientHandle) -> None:
        """Give a new client its views, and its controls or the field for the PIN."""
        with client.atomic():
            self._add_views(client)
            if self.pin is None and is_loopback(address_of(client)):
                self.add_controls(client)
            elif self.pin is not None:
                self._add_pin_field(client, self.pin)

    async def forget(self, client: ClientHandle) -> None:
        """A client has gone."""
        self.panels.pop(client.client_id, None)

    def _add_views(self, client: ClientHandle) -> None:
        buttons = client.gui.add_button_group("view", tuple(self.scene.views), order=1)

        @buttons.on_click
        async def look(event: GuiEvent) -> None:
            move_camera(client, self.scene, event.target.value)

    def _add_pin_field(self, client: ClientHandle, pin: Pin) -> None:
        folder = client.gui.add_folder("for the presenter", expand_by_default=False, order=9)
        with folder:
            guess = client.gui.add_text("PIN", "", hint="six digits, in the terminal where the server runs")
            button = client.gui.add_button("take the controls")

        @button.on_click
        async def ask(event: GuiEvent) -> None:
            answer = pin.check(guess.value, address_of(client))
            if answer:
                guess.value = ""
                client.add_notification("No controls", answer, auto_close_seconds=6.0, color="orange")
            elif client.client_id not in self.panels:
                folder.remove()
                self.add_controls(client)

    def add_controls(self, client: ClientHandle) -> None:
        """Give a client the controls, and the run sheet where there is one."""
        panel = self.panels[client.client_id] = Panel(client)
        if self.sheet:
            with client.gui.add_folder(self.sheet.title, order=2):
                self._add_sheet(panel, self.sheet)
        with client.gui.add_folder("machine", order=3):
            for slider in SLIDERS[:3]:
                self._add_slider(panel, slider)
            self._add_orbits(panel)
        with client.gui.add_folder("picture", order=4):
            for slider in SLIDERS[3:]:
                self._add_slider(panel, slider)
            self._add_player(panel)
            for name, label in (("names", "names"), ("dark", "dark")):
                self._add_switch(panel, name, label)

    def _add_slider(self, panel: Panel, slider: Slider) -> None:
        low, high = (slider.units * bound for bound in self.scene.limits[slider.name])
        value = slider.units * getattr(self.scene.settings, slider.name)
        handle = panel.client.gui.add_slider(slider.label, low, high, slider.step, value, hint=slider.hint)
        panel.handles[slider.name] = handle

        @handle.on_update
        async def moved(event: GuiEvent) -> None:
            if event.client is not None:
                self.scene.change(**{slider.name: handle.value / slider.units})

        panel.follow.append(lambda: setattr(handle, "value", slider.units * getattr(self.scene.settings, slider.name)))

    def _add_switch(self, panel: Panel, name: str, label: str) -> None:
        handle = panel.client.gui.add_checkbox(label, getattr(self.scene.settings, name))
        panel.handles[name] = handle

        @handle.on_update
        async def switched(event: GuiEvent) -> None:
            if event.client is not None:
                self.scene.change(**{name: handle.value})

        panel.follow.append(lambda: setattr(handle, "value", getattr(self.scene.settings, name)))
