"""Ports that nobody listens on, for servers which a test starts."""

from __future__ import annotations

import random
import socket

_RANDOM = random.SystemRandom()


def two_free_ports() -> int:
    """The first of two neighbouring ports that are free: telemetry is on the second.

    Below the ports that the system gives to connections: one of those can be taken between being
    looked up and being listened on.
    """
    while True:
        port = _RANDOM.randrange(20000, 32000)
        with socket.socket() as first, socket.socket() as second:
            try:
                first.bind(("127.0.0.1", port))
                second.bind(("127.0.0.1", port + 1))
            except OSError:
                continue
            return port


def free_address() -> str:
    """A URI on this machine whose port and the next one are free."""
    return f"tcp://127.0.0.1:{two_free_ports()}"
