"""The states that a robot can be in."""

from __future__ import annotations

from enum import StrEnum


class State(StrEnum):
    """What the robot is doing."""

    IDLE = "idle"  # servos hold; nothing was asked yet
    MOVING = "moving"  # joints slew
    SETTLING = "settling"  # targets reached; waiting for rest, then sampling
    HOLDING = "holding"  # holds the pose of the last request
    RELAXED = "relaxed"  # servos limp
    STOPPED = "stopped"  # stop latched; frozen at the last commanded counts
    FAULT = "fault"  # a device failed; frozen until cleared
