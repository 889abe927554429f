"""Whether this computer can listen on an address, asked before a server starts: servers answer late
or not at all.
"""

from __future__ import annotations

import errno
import os
import socket


def trouble(host: str, port: int) -> int | None:
    """The error number with which this computer refuses to listen at a host and a port, or None."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host or None, port,
                                                                type=socket.SOCK_STREAM,
                                                                flags=socket.AI_PASSIVE)[0]
    except (OSError, UnicodeError):
        return errno.EADDRNOTAVAIL
    with socket.socket(family, kind, protocol) as probe:
        # as a server does; on Windows the option would let two servers share a port
        if os.name == "posix":
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(address)
        except OSError as error:
            return error.errno
    return None


def in_words(number: int, host: str, port: int, host_option: str = "host",
             port_option: str = "port") -> str:
    """An error number of `trouble` as a sentence. host, port: as they were given; host_option,
    port_option: the names by which one gives them.
    """
    if number == errno.EADDRNOTAVAIL:
        return f"{host_option} is {host!r}; it is no address of this computer. Try 127.0.0.1."
    if number in (errno.EACCES, errno.EPERM):
        return f"Port {port} is not allowed for this user; try a port from 1024 to 65535."
    return f"Port {port} is taken; leave {port_option} out or try {min(port + 1, 65535)}."
