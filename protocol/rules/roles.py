"""Roles: what a robot with keys lets its clients do."""

from __future__ import annotations

from enum import StrEnum
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
