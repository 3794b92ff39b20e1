"""Who may do what: the roles that a robot with keys gives to its clients."""

from __future__ import annotations

from enum import StrEnum
from types import MappingProxyType
from typing import Final

from protocol.wire.messages import REQUESTS, Heartbeat, Hello, Read, Stop


class Role(StrEnum):
    """What a client may do."""

    VIEWER = "viewer"  # look and listen, and stop the robot
    CONTROLLER = "controller"  # everything


MAY: Final = MappingProxyType(
    {
        Role.VIEWER: frozenset(kind.TYPE for kind in (Hello, Heartbeat, Read, Stop)),
        Role.CONTROLLER: frozenset(REQUESTS),
    }
)
"""The types of request that a role allows; ``SPEC.md`` prints the same table."""
