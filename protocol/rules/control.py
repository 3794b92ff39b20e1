"""Who may do what: the roles of clients; and which client controls the robot: the lease."""

from __future__ import annotations

from enum import Enum, StrEnum
from types import MappingProxyType
from typing import Final

from protocol.wire.messages import REQUESTS


class Role(StrEnum):
    """The role of a client."""

    VIEWER = "viewer"  # look and listen, and stop the robot
    CONTROLLER = "controller"  # everything


MAY: Final = MappingProxyType(
    {
        Role.VIEWER: frozenset(name for name, kind in REQUESTS.items() if kind.FOR_VIEWERS),
        Role.CONTROLLER: frozenset(REQUESTS),
    }
)
"""The types of request that a role allows; ``SPEC.md`` prints the same table."""


HEARTBEAT: Final = 1.0
"""Seconds between a client's signs of life."""

SILENCE: Final = 5.0
"""Seconds of silence from the controller after which the robot holds."""

EXPIRY: Final = 30.0
"""Seconds of silence from the controller after which it loses control."""


class Lapse(Enum):
    """A change of the lease that the controller's silence causes."""

    SILENT = "silent"  # the controller fell silent
    FREED = "freed"  # the controller lost the robot


class Lease:
    """Control of the robot by one client at most; the transport clock decides when it lapses."""

    def __init__(self) -> None:
        self.holder: str | None = None
        self._heard = 0.0
        self._silent = False

    @property
    def deadline(self) -> float | None:
        """When ``lapse`` next returns a change; ``None`` without a controller."""
        if self.holder is None:
            return None
        return self._heard + (EXPIRY if self._silent else SILENCE)

    def take(self, client: str, now: float) -> None:
        """Gives control to a client; the robot must be free or the client's own."""
        self.holder = client
        self.hear(client, now)

    def free(self) -> None:
        """Ends the lease."""
        self.holder = None
        self._silent = False

    def hear(self, client: str, now: float) -> None:
        """Notes a sign of life."""
        if client == self.holder:
            self._heard = now
            self._silent = False

    def lapse(self, now: float) -> list[Lapse]:
        """Returns the changes since the last call, each once."""
        lapses: list[Lapse] = []
        if self.holder is None:
            return lapses
        if not self._silent and now >= self._heard + SILENCE:
            self._silent = True
            lapses.append(Lapse.SILENT)
        if now >= self._heard + EXPIRY:
            self.free()
            lapses.append(Lapse.FREED)
        return lapses
