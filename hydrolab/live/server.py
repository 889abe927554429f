"""One 3D server per process, on this computer alone unless told otherwise, behind its `gate`."""

from __future__ import annotations

import atexit
import contextlib
import errno
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from ipaddress import ip_address

import rich
from viser import ViserServer

from hydrolab.addresses import in_words, trouble
from hydrolab.errors import BadInput
from hydrolab.live.gate import Gate

FIRST_PORT = 8080
VIEWERS = 100  # at once, unless told otherwise


@dataclass(eq=False)
class _Open:
    """The process's server, its gate, and what to stop with it."""

    server: ViserServer
    gate: Gate
    stops: list[Callable[[], None]] = field(default_factory=list)


_lock = threading.RLock()
_open: _Open | None = None


def open_server(host: str = "127.0.0.1", port: int | None = None, *, room: bool = False,
                viewers: int = VIEWERS, label: str = "hydrolab") -> ViserServer:
    """Open the process's 3D server; one that is open already is closed first, and its port is used
    again.

    host: an address of this computer. One that others can reach needs room=True. port: without one
    the last port, 8080 or the next free one; 0 for any. viewers: how many may watch at once. label:
    of the page. Raises BadInput for a host or a port on which this computer cannot listen.
    """
    global _open
    if isinstance(viewers, bool) or not isinstance(viewers, int) or not 1 <= viewers <= 1000:
        raise BadInput(f"viewers is {viewers!r}; give a whole number from 1 to 1000.")
    if not room and not is_loopback(host):
        raise BadInput(f"host is {host!r}, which other computers may reach; open it to them with "
                       "room=True (on the command line: --room), or use 127.0.0.1.")
    with _lock:
        last = _open.server.get_port() if _open else FIRST_PORT
        close_server()
        wanted = _bindable(host, port, last)
        with quiet_rich():
            server = ViserServer(host, wanted, label=label, verbose=False)
        if port and server.get_port() != port:  # taken in between, and viser went on to the next
            with quiet_rich():
                server.stop()
            raise BadInput(in_words(errno.EADDRINUSE, host, port))
        atexit.unregister(close_server)
        atexit.register(close_server)  # after viser's own, so that it runs before it
        gate = Gate(server, viewers)
        server.gui.configure_theme(show_share_button=False, show_logo=False)
        _open = _Open(server, gate)
        return server


def current_server() -> ViserServer | None:
    """The process's open server, if there is one."""
    return _open.server if _open else None


def current_gate() -> Gate | None:
    """The gate of the process's open server, if there is one."""
    return _open.gate if _open else None


def stop_with_server(stop: Callable[[], None]) -> None:
    """Have something stopped, once, when the process's server closes: a scene's loop, for instance.
    """
    with _lock:
        if _open is None:
            raise BadInput("No 3D server is open; open one with `open_server`.")
        _open.stops.append(stop)


def close_server() -> None:
    """Close the process's 3D server and what runs with it; do nothing where none is open."""
    global _open
    with _lock:
        old, _open = _open, None
        if old is None:
            return
        for stop in reversed(old.stops):
            stop()
        with quiet_rich():
            old.server.stop()


@contextlib.contextmanager
def quiet_rich() -> Iterator[None]:
    """viser prints its address and its end, port and all; in a notebook that text would change from
    run to run.
    """
    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before


def is_loopback(host: str) -> bool:
    """Whether only this computer can reach an address."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def room_address() -> str:
    """This computer's address on the network it would use, without sending anything.

    Raises BadInput where it is on none.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, contextlib.suppress(OSError):
        # an address kept for documentation: a route is chosen, no packet leaves
        probe.connect(("192.0.2.1", 9))
        if not ip_address(address := probe.getsockname()[0]).is_loopback:
            return address
    raise BadInput("This computer is on no network that others could use; connect it to the room's "
                   "network, or give its address with --host.")


def page_address(server: ViserServer, host: str | None = None) -> str:
    """The address of the server's page, for a browser; `host` where the one it listens on is a
    wildcard.
    """
    host = host or server.get_host()
    return f"http://{f'[{host}]' if ':' in host else host}:{server.get_port()}/"


def _bindable(host: str, port: int | None, first: int) -> int:
    """A port that can be listened on: the one asked for, or the first free one.

    Raises BadInput with the reason: viser would take another port without a word, and hang for a
    foreign address.
    """
    if port is not None and (isinstance(port, bool) or not isinstance(port, int)
                             or not 0 <= port <= 65535):
        raise BadInput(f"port is {port!r}; a port is a whole number from 1 to 65535, or 0 for any "
                       "free one.")
    some = [first, *range(FIRST_PORT, FIRST_PORT + 100), 0]
    for candidate in some if port is None else [port]:
        problem = trouble(host, candidate)
        if problem is None:
            return candidate
        if port is not None or problem == errno.EADDRNOTAVAIL:
            raise BadInput(in_words(problem, host, candidate))
    raise BadInput(in_words(problem, host, first))
