"""A process that somebody forks gets none of our sockets.

A driver, or a library of its, may fork a child that outlives the daemon. Sockets are closed when it
executes another program; a child that does not would keep the address in use, and connections open
that nobody serves. What C code forks behind Python's back keeps them all the same.
"""

from __future__ import annotations

import os
import socket
from typing import Final
from weakref import WeakSet

_ours: Final[WeakSet[socket.socket]] = WeakSet()


def kept_from_children(ours: socket.socket) -> socket.socket:
    """The socket, which is closed in every process that this one forks from now on."""
    _ours.add(ours)
    return ours


def _close() -> None:
    for each in tuple(_ours):
        each.close()


os.register_at_fork(after_in_child=_close)
