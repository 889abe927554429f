"""What a viewer may say to the 3D server, its camera, its own controls within their ranges and
clicks on what is its own, and the PIN that makes a presenter of it.

viser believes its clients. Here everything they send passes one function: another kind of message,
an unknown control, a value of another type or outside the control's range, NaN, all are dropped;
what is too large or too much closes that one connection. Nothing a client sends reaches the
server's shared state, so the request for a public tunnel, which any client may make of viser, has
no hearer.

handle: a control of viser. host, origin: headers of a request.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import logging
import math
import os
import secrets
import threading
import time
import warnings
from collections import Counter, OrderedDict
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from ipaddress import ip_address
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from viser import (
    ClientHandle,
    GuiButtonGroupHandle,
    GuiButtonHandle,
    GuiCheckboxHandle,
    GuiDropdownHandle,
    GuiSliderHandle,
    GuiTextHandle,
    ViserServer,
)
from viser._messages import (
    GuiUpdateMessage,
    NotificationProps,
    NotificationShowMessage,
    SceneNodeClickMessage,
    ThemeConfigurationMessage,
    ViewerCameraMessage,
)
from viser.infra import Message, WebsockClientConnection
from viser.infra._infra import _message_producer
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

GUESSES = 5  # wrong ones before an address has to wait
FIRST_WAIT = 60.0  # s; every further wrong guess doubles it
ADDRESSES = 10_000  # remembered at once; the oldest is forgotten
LARGEST_MESSAGE = 16 * 1024  # bytes; a camera message has about 400
MOST_A_SECOND = 500  # messages of one client; a browser that turns its camera sends about 60
LONGEST_TEXT = 64  # characters in a text field
CHOICES = "ABC"  # of a question to the room
# places kept for pages on the server's own computer, so that nobody can keep the presenter out
OWN = 5


Hearer = Callable[[int, Message], Awaitable[None]]


def new_digits() -> str:
    """Six random digits."""
    return f"{secrets.randbelow(10**6):06d}"


@dataclass(eq=False)
class Pin:
    """A PIN and who has guessed at it. Safe to use from several threads."""

    digits: str = field(default_factory=new_digits, repr=False)
    now: Callable[[], float] = field(default=time.monotonic, repr=False)
    _wrong: OrderedDict[str, tuple[int, float]] = field(default_factory=OrderedDict, repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def check(self, guess: object, address: str) -> str:
        """"" where the guess is right, else a sentence for the one who guessed, from this address.

        While an address has to wait, a right guess does not count either. Comparing takes as long
        for every guess.
        """
        with self._lock:
            wrong, until = self._wrong.get(address, (0, 0.0))
            left = until - self.now()
            if left > 0:
                return f"Too many wrong PINs from here; try again in {left:.0f} s."
            text = guess.strip() if isinstance(guess, str) else ""
            if hmac.compare_digest(text.encode(), self.digits.encode()):
                self._wrong.pop(address, None)
                return ""
            wrong += 1
            wait = FIRST_WAIT * 2.0 ** min(wrong - GUESSES, 20) if wrong >= GUESSES else 0.0
            self._wrong[address] = (wrong, self.now() + wait)
            self._wrong.move_to_end(address)
            if len(self._wrong) > ADDRESSES:
                self._wrong.popitem(last=False)
            if wait:
                return f"Too many wrong PINs from here; try again in {wait:.0f} s."
            left = GUESSES - wrong
            return f"That is not the PIN; {left} more guess{'es' if left > 1 else ''}."


def in_range(handle: Any, value: Any) -> bool:
    """Whether a client may set this control to this value: its type, its range or its choices."""
    if getattr(handle, "disabled", False) or not getattr(handle, "visible", True):
        return False
    match handle:
        case GuiSliderHandle():
            number = isinstance(value, int | float) and not isinstance(value, bool)
            return number and math.isfinite(value) and handle.min <= value <= handle.max
        case GuiCheckboxHandle():
            return isinstance(value, bool)
        case GuiButtonHandle():
            return value is True
        case GuiButtonGroupHandle() | GuiDropdownHandle():
            return isinstance(value, str) and value in handle.options
        case GuiTextHandle():
            return isinstance(value, str) and len(value) <= LONGEST_TEXT
    return False


def is_camera(message: ViewerCameraMessage) -> bool:
    """Whether a camera message holds finite numbers in the right places, and a direction to look
    in.
    """
    shapes = {"wxyz": 4, "position": 3, "look_at": 3, "up_direction": 3}
    try:
        vectors = {name: np.asarray(getattr(message, name), float) for name in shapes}
        scalars = np.asarray([message.fov, message.near, message.far, message.image_height,
                              message.image_width], float)
    except (TypeError, ValueError, OverflowError):
        return False
    return (all(vectors[name].shape == (size,) for name, size in shapes.items())
            and all(np.isfinite(vector).all() and (np.abs(vector) < 1e6).all()
                    for vector in vectors.values())
            and bool(np.isfinite(scalars).all()) and bool(vectors["up_direction"].any())
            and not np.array_equal(vectors["look_at"], vectors["position"]))


def is_click(message: SceneNodeClickMessage) -> bool:
    """Whether a click names something and comes along a ray of finite numbers. Who has been given
    nothing to click on (`client.scene`) is not heard all the same.
    """
    try:
        ray = np.asarray([message.ray_origin, message.ray_direction], float)
    except (TypeError, ValueError, OverflowError):
        return False
    names = message.name, message.owner
    return (all(isinstance(name, str) and len(name) <= LONGEST_TEXT for name in names)
            and message.modifier is None and ray.shape == (2, 3)
            and bool((np.abs(ray) < 1e6).all()) and bool(ray[1].any()))


def is_own_page(host: str | None, origin: str | None, own: str) -> bool:
    """Whether a browser's request comes from this server's own page. own: the name or address it
    listens on.

    Any page in a browser may open a connection to 127.0.0.1; its Origin gives it away. A name other
    than localhost or the server's own in Host is one that someone else's name server may have
    pointed here. Programs that are no browser send no Origin.
    """
    if origin is None:
        return True
    name = urlsplit(f"//{host}").hostname or ""
    try:
        ip_address(name)
    except ValueError:
        if name not in ("localhost", own.lower()):
            return False
    return urlsplit(origin).netloc == host


class Gate:
    """The guard of one server. `viewers` may watch at once; who comes later is told so and let in
    when one leaves.
    """

    def __init__(self, server: ViserServer, viewers: int) -> None:
        self.viewers = viewers
        self.inside: set[int] = set()
        self.behind_proxy = "JUPYTERHUB_SERVICE_PREFIX" in os.environ  # the hub has asked who it is
        self._web = server._websock_server
        wake_in_its_loop(self._web.get_message_buffer())
        # shared controls, uploads, the public tunnel: nobody hears them
        self._web._incoming_handlers.clear()
        self._web.on_client_connect(self._admit)
        self._web.on_client_disconnect(self._leave)
        # who came before this line comes again, through the gate
        self._web.disconnect_all_clients()
        logging.getLogger("websockets.server").addFilter(is_no_clients_mistake)
        # a camera of three numbers for four: dropped below, and no word in the terminal
        warnings.filterwarnings("ignore", r"\[viser\] .* does not match annotation")

    async def _admit(self, client: WebsockClientConnection) -> None:
        """Let a connection in, or keep it waiting; runs before anything it sends is heard."""
        connection = self._web._live_connections[client.client_id]
        wake_in_its_loop(client.get_message_buffer())
        connection.protocol.max_message_size = LARGEST_MESSAGE
        client._handle_incoming_message = self._hearer(client, connection,
                                                       client._handle_incoming_message)
        headers = connection.request.headers
        places = self.viewers + OWN * (connection.remote_address[0] == connection.local_address[0])
        if not self.behind_proxy and not is_own_page(headers.get("Host"), headers.get("Origin"),
                                                     self._web._host):
            await connection.close(1008, "This page may not connect here.")
        elif len(self._web._live_connections) > self.viewers + places:
            await connection.close(1013, "Too many are waiting.")
        elif len(self.inside) >= places:
            await self._wait(client, connection, places)
        else:
            self.inside.add(client.client_id)

    async def _leave(self, client: WebsockClientConnection) -> None:
        self.inside.discard(client.client_id)

    async def _wait(self, client: WebsockClientConnection, connection: ServerConnection,
                    places: int) -> None:
        """Say that all places are taken, and close when one is free: the browser then comes again
        by itself.
        """
        client.queue_message(ThemeConfigurationMessage(None, "floating", "medium", False, False,
                                                       False, None))
        client.queue_message(NotificationShowMessage("full", NotificationProps(
            title=f"All {self.viewers} places are taken",
            body="This page opens by itself when someone leaves.", loading=True,
            with_close_button=False, auto_close_seconds=None, color="orange")))
        sender = asyncio.create_task(_message_producer(connection, client.get_message_buffer(),
                                                       client.client_id))
        listener = asyncio.create_task(heard_by_nobody(connection))
        try:
            while len(self.inside) >= places and not listener.done():
                await asyncio.sleep(0.2)
            await connection.close(1013, "A place is free.")
        finally:
            sender.cancel()
            listener.cancel()
            await asyncio.gather(sender, listener, return_exceptions=True)

    def _hearer(self, client: WebsockClientConnection, connection: ServerConnection,
                passed: Hearer) -> Hearer:
        """The function that hears one connection, in front of viser's own."""
        second, heard = 0.0, 0

        async def hear(client_id: int, message: Message) -> None:
            nonlocal second, heard
            now = time.monotonic()
            second, heard = (now, 1) if now - second > 1 else (second, heard + 1)
            if heard > MOST_A_SECOND:
                await connection.close(1008, "Too many messages.")
                return
            match message:
                case ViewerCameraMessage():
                    allowed = is_camera(message)
                case GuiUpdateMessage():
                    allowed = is_allowed(client, message)
                case SceneNodeClickMessage():
                    allowed = is_click(message)
                case _:
                    allowed = False
            if allowed:
                await passed(client_id, message)

        return hear


def wake_in_its_loop(buffer: Any) -> None:
    """Have the event loop alone wake the clients that wait for a message: viser does so from any
    thread, and a thread that sends while a client comes or goes then fails.
    """

    def wake() -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed: nobody waits
            buffer.event_loop.call_soon_threadsafe(asyncio.Event.set, buffer.message_event)

    buffer.message_event.set = wake


async def heard_by_nobody(connection: ServerConnection) -> None:
    """Read what a connection sends until it is closed, so that its end is noticed and its buffers
    stay empty.
    """
    with contextlib.suppress(ConnectionClosed):
        while True:
            await connection.recv()


def is_allowed(client: WebsockClientConnection, message: GuiUpdateMessage) -> bool:
    """Whether a message sets a control of this very client within its range; if not, the client
    hears what it is.
    """
    handles = client._incoming_handlers[GuiUpdateMessage][0].__self__._gui_input_handle_from_uuid
    handle = handles.get(message.uuid) if isinstance(message.uuid, str) else None
    if (handle is None or not isinstance(message.updates, dict)
            or set(message.updates) != {"value"}):
        return False
    if in_range(handle, message.updates["value"]):
        return True
    if not isinstance(handle, GuiButtonHandle):
        client.queue_message(GuiUpdateMessage(message.uuid, {"value": handle.value}))
    return False


def address_of(client: ClientHandle) -> str:
    """The address a client comes from; "" where it has gone."""
    connection = client._viser_server._websock_server._live_connections.get(client.client_id)
    return connection.remote_address[0] if connection else ""


def is_no_clients_mistake(record: logging.LogRecord) -> bool:
    """A log filter: a client that sends rubbish loses its connection, and the terminal keeps quiet
    about it.
    """
    return record.getMessage() not in ("connection handler failed", "opening handshake failed")


RATE = 10.0  # votes a second from one address, where a whole room may sit behind one


@dataclass(eq=False)
class Poll:
    """The votes on the question that is open, by connection; a vote goes with its connection, so
    that coming back adds none. Only the event loop touches it.
    """

    now: Callable[[], float] = field(default=time.monotonic, repr=False)
    votes: dict[int, str] = field(default_factory=dict)
    _last: OrderedDict[str, float] = field(default_factory=OrderedDict, repr=False)

    def open(self) -> None:
        """Begin with a new question."""
        self.votes.clear()

    def take(self, connection: int, choice: object, address: str) -> bool:
        """Count a vote, or not: a second one, one too soon after another from the address, or one
        that is no choice.
        """
        soon = self.now() - self._last.get(address, -1e9) < 1 / RATE
        if choice not in tuple(CHOICES) or connection in self.votes or soon:
            return False
        self._last[address] = self.now()
        self._last.move_to_end(address)
        if len(self._last) > ADDRESSES:
            self._last.popitem(last=False)
        self.votes[connection] = str(choice)
        return True

    def forget(self, connection: int) -> None:
        """A connection has gone, and its vote with it."""
        self.votes.pop(connection, None)

    def counts(self) -> list[int]:
        """Votes for each of the choices."""
        found = Counter(self.votes.values())
        return [found[letter] for letter in CHOICES]
