"""The 3D server: where it listens, one a process, and what it makes of clients that are no browser.
"""

import math
import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
import warnings

import msgspec
import pytest
from viser import _messages

from hydrolab.errors import BadInput
from hydrolab.live.gate import OWN, is_own_page
from hydrolab.live.server import (
    close_server,
    current_gate,
    current_server,
    open_server,
    page_address,
    room_address,
    stop_with_server,
)


@pytest.fixture
def slider_server():
    """A server that gives each client one private slider and one button; `heard` is what their
    callbacks heard.
    """
    server = open_server(port=0)
    server.heard, server.sliders, server.clients = [], {}, []

    @server.on_client_connect
    async def greet(client):
        slider = client.gui.add_slider("size", 0.0, 10.0, 0.1, 5.0)
        slider.on_update(lambda event: server.heard.append(event.target.value))
        client.gui.add_button("go").on_click(lambda event: server.heard.append("go"))
        server.sliders[client.client_id] = slider
        server.clients.append(client)

    return server


KINDS = _messages.Message._subclass_from_type_string()
CAMERA = {"type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0],
          "position": [3.0, 3.0, 3.0], "fov": 1.0, "near": 0.1, "far": 100.0, "image_height": 400,
          "image_width": 640, "look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 0.0, 1.0]}


def works(server, raw):
    """A new client is served, and its slider moves."""
    client = raw(server.get_port())
    before = len(server.heard)
    client.set(client.control("size"), 7.5)
    client.wait(lambda _: server.heard[before:] == [7.5])
    client.close()
    return True


# --- where it listens

def test_it_listens_on_this_computer_alone():
    server = open_server()
    assert server.get_host() == "127.0.0.1"
    assert current_server() is server
    with urllib.request.urlopen(page_address(server), timeout=60) as page:
        assert b"<html" in page.read(2000)
    try:
        address = room_address()
    except BadInput:
        pytest.skip("this computer is on no network, so nobody else could reach it")
    with pytest.raises(OSError), socket.create_connection((address, server.get_port()), timeout=2):
        pass


def test_a_second_server_takes_the_place_and_the_port_of_the_first():
    stopped = []
    first = open_server(port=0)
    port = first.get_port()
    stop_with_server(lambda: stopped.append("scene"))
    second = open_server()
    assert second.get_port() == port
    assert stopped == ["scene"]
    assert current_server() is second
    close_server()
    close_server()
    assert current_server() is None
    with pytest.raises(BadInput, match="No 3D server is open"):
        stop_with_server(print)


def test_a_taken_port_is_named_or_passed_over(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as other:
        taken = other.getsockname()[1]
        with pytest.raises(BadInput, match=f"Port {taken} is taken; leave port out or try"):
            open_server(port=taken)
        monkeypatch.setattr("hydrolab.live.server.FIRST_PORT", taken)
        assert open_server().get_port() != taken


@pytest.mark.parametrize(("options", "words"), [
    ({"host": "0.0.0.0"}, "other computers may reach.*--room"),
    ({"host": ""}, "other computers may reach"),
    ({"host": "203.0.113.7", "room": True}, "no address of this computer"),
    ({"host": "no-such-host.invalid", "room": True}, "no address of this computer"),
    ({"port": 70000}, "port is 70000"),
    ({"port": "8080"}, "port is '8080'"),
    ({"viewers": 0}, "viewers is 0"),
    ({"viewers": True}, "viewers is True"),
])
def test_what_cannot_be_opened_gets_a_sentence(options, words):
    with pytest.raises(BadInput, match=words):
        open_server(**options)


def test_nothing_is_printed(capfd):
    open_server(port=0)
    open_server(port=0)
    close_server()
    assert capfd.readouterr() == ("", "")


def test_ctrl_c_ends_a_program_that_waits(tmp_path):
    program = ("from hydrolab.live.server import open_server\nimport time\n"
               "server = open_server(port=0)\n"
               "try:\n    print(server.get_port(), flush=True)\n    time.sleep(600)\n"
               "except KeyboardInterrupt:\n    print('stopped')\n")
    process = subprocess.Popen([sys.executable, "-W", "error", "-c", program],
                               stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True, cwd=tmp_path, env=os.environ | {
                                   "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)})
    port = int(process.stdout.readline())
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (0, "stopped\n", "")
    open_server(port=port)  # free again at once, as after a kernel restart


# --- what clients may say

NONSENSE = [99999, -1, 10.000001, "7", "", None, True, math.nan, math.inf, -math.inf, [7.0],
            {"a": 1}, b"7", 2**63]


def test_a_control_takes_only_its_own_kind_of_value(slider_server, raw):
    client = raw(slider_server.get_port())
    slider, button = client.control("size"), client.control("go")
    for value in NONSENSE:
        assert client.set(slider, value)
    told = client.wait(lambda me: [m["updates"]["value"] for m in me.heard
                                   if m["type"] == "GuiUpdateMessage"])
    assert set(told) == {5.0}  # the browser is told what the slider is
    for value in (False, 1, "go", None):
        client.set(button, value)
    client.set(slider, 2.5)
    client.set(button, True)
    client.wait(lambda _: len(slider_server.heard) >= 2)
    assert sorted(map(str, slider_server.heard)) == ["2.5", "go"]
    assert client.closed is None


def test_ids_that_are_not_its_own_are_dropped(slider_server, raw):
    one, other = raw(slider_server.get_port()), raw(slider_server.get_port())
    shared = slider_server.gui.add_slider("everybody's", 0, 10, 1, 5)
    for uuid in (other.control("size"), shared._impl.uuid, "no such id", "", "x" * 5000, 7, None,
                 ["a"], {}):
        one.set(uuid, 3.0)
    one.say({"type": "GuiUpdateMessage", "uuid": one.control("size"), "updates": {"update_cb": []}})
    one.say({"type": "GuiUpdateMessage", "uuid": one.control("size"),
             "updates": {"value": 3.0, "removed": True}})
    one.say({"type": "GuiUpdateMessage", "uuid": one.control("size"), "updates": [["value", 3.0]]})
    one.set(one.control("size"), 4.0)
    one.wait(lambda _: slider_server.heard)
    assert slider_server.heard == [4.0]
    assert shared.value == 5
    assert sorted(slider.value for slider in slider_server.sliders.values()) == [4.0, 5.0]


def test_a_share_request_reaches_nobody(slider_server, raw, monkeypatch):
    asked = []
    monkeypatch.setattr("viser._viser.ViserTunnel", lambda *a: asked.append(a))
    client = raw(slider_server.get_port())
    for kind in ("ShareUrlRequest", "ShareUrlDisconnect"):
        assert client.say({"type": kind})
    assert works(slider_server, raw)
    assert not asked
    assert not slider_server._websock_server._incoming_handlers
    theme = client.wait(lambda me: [m for m in me.heard
                                    if m["type"] == "ThemeConfigurationMessage"])[-1]
    assert theme["show_share_button"] is False


def test_the_unguarded_server_would_have_asked_for_a_tunnel(raw, monkeypatch):
    """What the test above guards against is real."""
    from viser import ViserServer

    asked = threading.Event()
    monkeypatch.setattr(ViserServer, "request_share_url", lambda self: asked.set())
    server = ViserServer("127.0.0.1", 0, verbose=False)
    try:
        raw(server.get_port()).say({"type": "ShareUrlRequest"})
        assert asked.wait(60)
    finally:
        server.stop()


def every_other_message():
    """One message of each type that a client could name, with plausible fields."""
    fill = {"str": "x", "int": 1, "float": 1.0, "bool": True}
    for name, kind in sorted(_messages.Message._subclass_from_type_string().items()):
        if name not in ("ViewerCameraMessage", "GuiUpdateMessage"):
            hints = getattr(kind, "__annotations__", {})
            yield {"type": name} | {field: fill.get(str(hint), None)
                                    for field, hint in hints.items()
                                    if "ClassVar" not in str(hint)}


def test_no_other_message_changes_or_stops_anything(slider_server, raw):
    watcher = raw(slider_server.get_port())
    watcher.control("go")
    last = slider_server.scene.add_frame("/last")
    # so it has heard all there is
    watcher.wait(lambda me: any(m.get("name") == "/last" for m in me.heard))
    kept = len(slider_server._websock_server._broadcast_buffer.message_from_id)
    before = len(watcher.heard)
    for message in every_other_message():
        client = raw(slider_server.get_port())
        client.say(message)
        client.close()
    assert works(slider_server, raw)
    assert len(slider_server._websock_server._broadcast_buffer.message_from_id) == kept
    last.visible = False
    assert watcher.wait(lambda me: [m["type"]
                                    for m
                                    in me.heard[before:]]) == ["SetSceneNodeVisibilityMessage"]


RUBBISH = [b"", b"\x00", b"\xc1", b"\x91" * 15000, b"\xde\xff\xff", os.urandom(2000),
           "text, not bytes",
           msgspec.msgpack.encode([1, 2]), msgspec.msgpack.encode({"type": "NoSuchMessage"}),
           msgspec.msgpack.encode({"type": ["a"]}), msgspec.msgpack.encode({"no type": 1}),
           msgspec.msgpack.encode({"type": "ViewerCameraMessage"}),
           msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "a"}),
           msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "a", "updates": {},
                                   "more": 1})]


def some_message(rng, ids):
    """A message of any kind viser knows, with sense and nonsense in it; or rubbish."""
    odd = [None, True, -1, 0.5, math.nan, 2**63, "A", "", "x" * 500, [1.0, 2.0], {"value": 1}, *ids]
    kind = rng.randrange(4)
    if kind == 0:
        return rng.choice(RUBBISH)
    if kind == 1:
        return {"type": "GuiUpdateMessage", "uuid": rng.choice(ids),
                "updates": {"value": rng.choice(odd)}}
    if kind == 2:
        wrong = rng.choice(list(CAMERA)[1:])
        return CAMERA | {wrong: rng.choice(odd)}
    names = [*CAMERA, "uuid", "updates", "name", "owner"]
    return {"type": rng.choice(sorted(KINDS))} | {
        name: rng.choice(odd) for name in rng.sample(names, 3)}


def test_a_thread_may_send_while_clients_come_and_go(slider_server, raw):
    """viser's waiting clients are woken by its loop alone: a thread that woke them failed when one
    came or went at that moment.
    """
    event = slider_server._websock_server.get_message_buffer().message_event
    waiting, loop = [], slider_server.get_event_loop()

    class Waiters(list):
        def __iter__(self):
            waiting.append(threading.get_ident())
            return super().__iter__()

    ours, event._waiters = event._waiters, Waiters()
    event.clear()
    node = slider_server.scene.add_frame("/moved")
    node.position = (1.0, 2.0, 3.0)
    done = threading.Event()
    loop.call_soon_threadsafe(done.set)
    assert done.wait(60)
    event._waiters = ours
    assert threading.get_ident() not in waiting


def test_a_fuzz_takes_nothing_from_a_good_client(slider_server, raw, capfd, messages=300):
    """It hears what moves in its order, to the last, while others say anything, and the terminal
    stays empty.
    """
    good, rng, port = raw(slider_server.get_port()), random.Random(5), slider_server.get_port()
    node = slider_server.scene.add_frame("/moved")
    ids, bad = list(good.labels().values()) or ["a"], raw(port)
    for i in range(messages):
        if i % 10 == 0:
            node.position = (1.0 + i, 0.0, 0.0)
            slider_server.flush()
        if bad.closed or not bad.say(some_message(rng, ids)):
            bad.close()
            bad = raw(port)
    last = 1.0 + messages - 10
    good.wait(lambda me: any(m.get("name") == "/moved" and m.get("position", (0,))[0] == last
                             for m in me.heard[-50:]))
    frames = [m["position"][0] for m in good.heard if m["type"] == "SetPositionMessage"
              and m["name"] == "/moved"]
    assert frames == sorted(frames)
    assert good.closed is None and works(slider_server, raw)
    assert capfd.readouterr() == ("", "")


def test_rubbish_costs_its_sender_the_connection_and_nobody_else(slider_server, raw, capfd):
    watcher = raw(slider_server.get_port())
    watcher.control("size")
    for rubbish in RUBBISH:
        client = raw(slider_server.get_port())
        client.say(rubbish)
        client.wait(lambda me: me.closed)
    client = raw(slider_server.get_port())
    client.say(b"x" * 200_000)  # too large: 1009
    assert client.wait(lambda me: me.closed).startswith("1009")
    assert works(slider_server, raw)
    assert watcher.closed is None
    assert capfd.readouterr() == ("", "")


def test_a_camera_of_the_wrong_shape_prints_nothing(raw, capfd):
    """viser warns of it before anything of ours is asked; with the warning an error, as here, the
    connection would end.
    """
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        server = open_server(port=0)
        client = raw(server.get_port())
        for shape in ([1.0, 2.0, 3.0], [], [[1.0]], b"12", {"a": 1}):
            client.say(raw.camera | {"wxyz": shape})
            client.say(raw.camera | {"position": [*shape, 1.0]})
        last = server.scene.add_frame("/last")
        client.wait(lambda me: any(m.get("name") == last.name for m in me.heard))
        client.close()
    assert not seen and capfd.readouterr() == ("", "")


@pytest.mark.parametrize("field", ["wxyz", "position", "fov", "look_at", "up_direction", "near"])
def test_a_camera_without_sense_is_dropped(slider_server, raw, field):
    from hydrolab.live.gate import is_camera

    client = raw(slider_server.get_port())
    client.control("size")
    camera = dict(raw.camera)
    handle = slider_server.clients[-1].camera
    before = handle.position.copy(), handle.fov
    several = isinstance(camera[field], list)
    for value in ([math.nan] * len(camera[field]),
                  [1e300] * len(camera[field])) if several else (math.nan, math.inf):
        client.say(camera | {field: value})
    client.set(client.control("size"), 6.0)
    client.wait(lambda _: slider_server.heard == [6.0])
    assert (handle.position == before[0]).all() and handle.fov == before[1]
    message = _messages.ViewerCameraMessage(**{k: v for k, v in camera.items() if k != "type"})
    assert is_camera(message)
    for value in (None, "up", [1.0], [["a"]]):
        setattr(message, field, value)
        assert not is_camera(message)


def test_a_flood_closes_the_flooding_connection(slider_server, raw):
    watcher = raw(slider_server.get_port())
    watcher.control("size")
    flood = raw(slider_server.get_port())
    sent = 0
    while sent < 20_000 and flood.say({"type": "ShareUrlRequest"}):
        sent += 1
    assert flood.wait(lambda me: me.closed).startswith("1008")
    assert watcher.closed is None
    assert works(slider_server, raw)


@pytest.mark.parametrize(("origin", "host", "welcome"), [
    (None, None, True), ("http://127.0.0.1:{port}", None, True),
    ("http://localhost:{port}", "localhost:{port}", True),
    ("https://elsewhere.example", None, False), ("http://127.0.0.1:1", None, False),
    ("null", None, False),
    ("http://rebound.example:{port}", "rebound.example:{port}", False),
])
def test_pages_of_others_may_not_connect(slider_server, raw, origin, host, welcome):
    port = slider_server.get_port()
    headers = {"Host": host.format(port=port)} if host else {}
    options = {"origin": origin.format(port=port)} if origin else {}
    from websockets.sync import client as sync

    real = sync.ClientProtocol.connect

    def with_host(self):
        request = real(self)
        if headers:
            del request.headers["Host"]
            request.headers.update(headers)
        return request

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sync.ClientProtocol, "connect", with_host)
        client = raw(port, **options)
    if welcome:
        assert client.control("size")
    else:
        assert client.wait(lambda me: me.closed).startswith("1008")
        assert not client.labels()


# --- how many

def test_thirty_clients_and_one_that_never_reads(slider_server, raw):
    port = slider_server.get_port()
    deaf = [raw(port, listen=False) for _ in range(3)]
    clients = [raw(port) for _ in range(30)]
    node = slider_server.scene.add_frame("/turning")
    for client in clients:
        client.control("size")
    for step in range(1, 101):
        node.position = (float(step), 0.0, 0.0)
        slider_server.flush()
        time.sleep(0.005)
    for client in clients:
        client.wait(lambda me: any(m["type"] == "SetPositionMessage" and m["position"][0] == 100.0
                                   for m in me.heard))
    clients[0].set(clients[0].control("size"), 3.0)
    clients[0].wait(lambda _: slider_server.heard == [3.0])
    assert len(current_gate().inside) == 33
    for client in [*deaf, *clients]:
        client.close()
    clients[0].wait(lambda _: not current_gate().inside
                    and not slider_server._websock_server._client_state_from_id)


def can_bind(address):
    """Whether this computer lets a socket have an address (all of 127.0.0.0/8 on Linux, not
    elsewhere).
    """
    with socket.socket() as probe:
        try:
            probe.bind((address, 0))
        except OSError:
            return False
    return True


@pytest.mark.skipif(not can_bind("127.0.0.9"), reason="this system has no second loopback address "
                                                      "to come from")
def test_a_full_server_says_so_and_opens_when_someone_leaves(raw):
    server = open_server(port=0, viewers=2)
    port, away = server.get_port(), {"source": "127.0.0.9"}
    first, second = raw(port, **away), raw(port, **away)
    first.wait(lambda me: len(server.get_clients()) == 2)
    third = raw(port, **away)
    notice = third.wait(lambda me: [m for m in me.heard
                                    if m["type"] == "NotificationShowMessage"])[0]
    assert notice["props"]["title"] == "All 2 places are taken"
    assert {m["type"] for m in third.heard} == {"NotificationShowMessage",
                                                "ThemeConfigurationMessage"}  # nothing else
    for _ in range(200):
        third.say({"type": "ShareUrlRequest"})
    waiting = [raw(port, **away) for _ in range(2)]
    assert waiting[1].wait(lambda me: me.closed) == "1013 Too many are waiting."
    presenter = raw(port)  # from this computer: there are places kept
    presenter.wait(lambda me: len(server.get_clients()) == 3)
    presenter.close()
    second.close()
    assert third.wait(lambda me: me.closed) == "1013 A place is free."
    third.wait(lambda _: len(server.get_clients()) == 1)
    again = raw(port, **away)
    again.wait(lambda me: len(server.get_clients()) == 2)
    assert first.closed is None


def test_the_places_kept_for_this_computer_are_few(raw):
    server = open_server(port=0, viewers=1)
    pages = [raw(server.get_port()) for _ in range(1 + OWN)]
    pages[0].wait(lambda me: len(server.get_clients()) == 1 + OWN)
    late = raw(server.get_port())
    late.wait(lambda me: any(m["type"] == "NotificationShowMessage" for m in me.heard))


@pytest.mark.parametrize(("host", "origin", "own", "right"), [
    ("laptop.example:8080", "http://laptop.example:8080", "Laptop.example", True),
    ("laptop.example:8080", "http://laptop.example:8080", "127.0.0.1", False),
    ("[::1]:8080", "http://[::1]:8080", "::1", True),
    ("192.0.2.7:8080", "http://192.0.2.7:8080", "0.0.0.0", True),
    ("192.0.2.7:8080", "http://192.0.2.8:8080", "0.0.0.0", False),
    (None, "http://192.0.2.8:8080", "0.0.0.0", False),
])
def test_a_page_is_known_by_its_address(host, origin, own, right):
    assert is_own_page(host, origin, own) is right
