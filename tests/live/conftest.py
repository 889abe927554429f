"""A client of the 3D server that is no browser: it says what it likes, and keeps what it hears."""

from __future__ import annotations

import socket
import threading
import time

import msgspec
import pytest
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from hydrolab.live.server import close_server

CAMERA = {"type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [3.0, 3.0, 3.0],
          "fov": 1.0,
          "near": 0.1, "far": 100.0, "image_height": 400, "image_width": 640,
          "look_at": [0.0, 0.0, 0.0],
          "up_direction": [0.0, 0.0, 1.0]}


class RawClient:
    """Speaks msgpack over a websocket as viser's page does, or says anything else."""

    def __init__(self, port, *, hello=True, listen=True, host="127.0.0.1", source=None, **options):
        self.heard: list[dict] = []
        self.closed: str | None = None
        options = {"subprotocols": [f"viser-v{viser.__version__}"], "max_size": None,
                   "compression": None,
                   "proxy": None, "open_timeout": 60} | options
        if source:  # as if from another computer
            options["sock"] = socket.create_connection((host, port), source_address=(source, 0))
        self.socket = connect(f"ws://{host}:{port}/", **options)
        self.thread = threading.Thread(target=self._listen, daemon=True)
        if listen:
            self.thread.start()
        if hello:
            self.say(CAMERA)

    def _listen(self):
        unpack = zstandard.ZstdDecompressor()
        try:
            for frame in self.socket:
                size = int.from_bytes(frame[8:16], "little")
                self.heard += msgspec.msgpack.decode(unpack.decompress(frame[16:16
                                                                             + size]))["messages"]
        except ConnectionClosed:
            pass
        self.closed = f"{self.socket.protocol.close_code} {self.socket.protocol.close_reason}"

    def say(self, message):
        """Send a message (a dict) or raw bytes or text; False where the connection is gone."""
        try:
            self.socket.send(msgspec.msgpack.encode(message) if isinstance(message, dict)
                             else message)
        except ConnectionClosed:
            return False
        return True

    def set(self, uuid, value):
        return self.say({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}})

    def wait(self, test, seconds=60.0):
        """Wait until test(self) is true, and return it."""
        end = time.monotonic() + seconds
        while not (found := test(self)):
            if time.monotonic() > end:
                raise AssertionError(f"not within {seconds} s; closed: {self.closed}; heard "
                                     f"{[m['type'] for m in self.heard][-20:]}")
            time.sleep(0.01)
        return found

    def labels(self):
        """The controls this client was given and still has, {label: uuid}."""
        found = {}
        for message in list(self.heard):
            if message["type"] == "GuiRemoveMessage":
                found = {label: uuid for label, uuid in found.items() if uuid != message["uuid"]}
            elif message["type"].startswith("Gui") and "label" in (message.get("props") or {}):
                found[message["props"]["label"]] = message["uuid"]
        return found

    def control(self, label):
        """The id of the control with this label, once it is there."""
        return self.wait(lambda me: me.labels().get(label))

    def close(self):
        if self.thread.ident is None:  # it never read, so it does not wait for an answer
            self.socket.close_socket()
        else:
            self.socket.close()
        if self.thread.is_alive():
            self.thread.join(5)


@pytest.fixture
def raw():
    """Make raw clients, and close them after the test."""
    made = []

    def make(port, **options):
        made.append(RawClient(port, **options))
        return made[-1]

    make.camera = CAMERA
    yield make
    for client in made:
        client.close()


@pytest.fixture(autouse=True)
def no_server_left():
    yield
    close_server()
