"""Notifies the service manager: ready, alive, stopping, in the protocol of sd_notify(3).

A service that systemd starts with ``Type=notify`` finds a socket's address in ``$NOTIFY_SOCKET``,
and with ``WatchdogSec=`` in ``$WATCHDOG_USEC`` the longest silence, in µs, that it will bear before
it kills. Started otherwise, all of this does nothing.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Final

from protocol.text import brief

_PATIENCE: Final = 1.0  # s that a full queue of the manager may cost a message that must arrive
_GLANCE: Final = 0.05  # s for one that should; a sign of life is repeated and may cost nothing


class ServiceManager:
    """A connection to the service manager.

    Only the control loop may call ``alive``: a daemon whose server still answers while its
    control loop hangs must be killed.

    Args:
        environment: Environment variables, in which the manager left its address and its patience.

    Attributes:
        period: Seconds between signs of life, a quarter of what the manager bears, so that a loop
            that turns at least this often is never silent for more than half of it; ``None``: the
            manager wants none.
        heard: When ``alive`` was last called, monotonic, s.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ):
        self._address = environment.get("NOTIFY_SOCKET", "")
        self.period = _watchdog_period(environment) if self._address else None
        self.heard = 0.0
        self._told_at = -float("inf")

    def ready(self, status: str) -> None:
        """Notifies that the daemon serves; ``systemctl status`` shows ``status``."""
        self._tell("READY=1", f"STATUS={status}", patience=_PATIENCE)

    def status(self, status: str) -> None:
        """Sends a line on what the daemon is doing."""
        self._tell(f"STATUS={brief(status)}", patience=_GLANCE)

    def stopping(self, status: str) -> None:
        """Notifies that the daemon has begun to shut down."""
        self._tell("STOPPING=1", f"STATUS={status}", patience=_PATIENCE)

    def alive(self) -> None:
        """Notifies the watchdog; cheap enough to be called at every turn of the control loop."""
        self.heard = time.monotonic()
        if self.period is not None and self.heard - self._told_at >= self.period:
            self._told_at = self.heard
            self._tell("WATCHDOG=1")

    def _tell(self, *assignments: str, patience: float = 0.0) -> None:
        if self._address[:1] not in ("/", "@"):
            return
        # "@" stands for the NUL byte with which an abstract address begins.
        address = self._address.replace("@", "\0", 1) if self._address[0] == "@" else self._address
        lines = (assignment.replace("\n", " ") for assignment in assignments)
        data = "\n".join(lines).encode(errors="replace")
        with (
            suppress(OSError),  # a manager that is gone or does not listen is no fault of ours
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as wire,
        ):
            wire.settimeout(patience)
            wire.connect(address)
            wire.send(data)


def _watchdog_period(environment: Mapping[str, str]) -> float | None:
    watched_pid = environment.get("WATCHDOG_PID", str(os.getpid()))
    microseconds = environment.get("WATCHDOG_USEC", "")
    if watched_pid != str(os.getpid()) or not microseconds.isdecimal() or int(microseconds) == 0:
        return None
    return int(microseconds) / 4e6
