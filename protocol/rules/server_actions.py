"""What the server core asks its caller to do, in order: send, submit, tell the robot."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

from protocol.wire.messages import RobotRequest


@dataclass(frozen=True, slots=True)
class Send:
    """Send this frame to this peer."""

    peer: bytes
    frame: bytes


@dataclass(frozen=True, slots=True)
class Submit:
    """Give this request to the robot; then call ``accept``, or ``finish`` if it refuses."""

    ticket: int
    request: RobotRequest


@dataclass(frozen=True, slots=True)
class Silence:
    """Tell the robot that it has no active controller; ``reason`` says why, in a sentence."""

    reason: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class ControllerChanged:
    """Tell the robot who controls it now; ``reason``, for the log, says how that came about."""

    client: str | None
    reason: str = field(default="", compare=False)


Action: TypeAlias = Send | Submit | Silence | ControllerChanged
