"""Poses as URDF writes them: a position, and turns about the fixed axes x, y and z."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Frame: TypeAlias = NDArray[np.float64]
"""Shape (4, 4): a pose in another frame."""


def frame_of(xyz: Sequence[float] | Frame, rpy: Sequence[float] = (0.0, 0.0, 0.0)) -> Frame:
    """The pose at a position (m), turned by roll, pitch and yaw (rad)."""
    frame = np.eye(4)
    for axis, angle in enumerate(rpy):
        frame = _about(axis, angle) @ frame
    frame[:3, 3] = xyz
    return frame


def inverse(frame: Frame) -> Frame:
    """The pose of what a frame is given in, in that frame."""
    back = np.eye(4)
    back[:3, :3] = frame[:3, :3].T
    back[:3, 3] = -frame[:3, :3].T @ frame[:3, 3]
    return back


def angles_of(frame: Frame) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a pose, rad."""
    level = math.hypot(frame[0, 0], frame[1, 0])
    pitch = math.atan2(-frame[2, 0], level)
    if level > 1e-9:
        return math.atan2(frame[2, 1], frame[2, 2]), pitch, math.atan2(frame[1, 0], frame[0, 0])
    # The nose is up or down: roll and yaw turn about the same axis.
    return math.atan2(-frame[1, 2], frame[1, 1]), pitch, 0.0


def _about(axis: int, angle: float) -> Frame:
    one, other = (axis + 1) % 3, (axis + 2) % 3
    frame = np.eye(4)
    frame[one, one] = frame[other, other] = math.cos(angle)
    frame[other, one] = math.sin(angle)
    frame[one, other] = -frame[other, one]
    return frame
