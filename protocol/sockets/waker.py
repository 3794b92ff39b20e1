"""Wakes a thread that sleeps in a poll, from any other thread or from a signal handler."""

from __future__ import annotations

import socket


class Waker:
    """A pair of sockets; ``poll`` the one that ``fileno`` names for reading."""

    def __init__(self) -> None:
        self._near, self._far = socket.socketpair()
        self._near.setblocking(False)
        self._far.setblocking(False)

    def fileno(self) -> int:
        """What to poll."""
        return self._far.fileno()

    def wake(self) -> None:
        """Ends the present or the next poll; never blocks, harmless after ``close``."""
        try:
            self._near.send(b"\0")
        except OSError:
            return  # full: it will wake anyway; closed: nobody sleeps any more

    def rest(self, events: int = 0) -> None:
        """Discards the calls of ``wake`` so far; the polling thread calls it before it works."""
        del events
        try:
            while self._far.recv(4096):
                pass
        except BlockingIOError:
            return

    def close(self) -> None:
        """Frees the sockets."""
        self._near.close()
        self._far.close()
