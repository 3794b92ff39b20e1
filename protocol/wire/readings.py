"""What touch, tilt and clearance mean: one formula each, the same for robot, simulator and models.

Frames are right-handed: x forward, y left, z up. *Up* is the world's upward unit vector as the
main body sees it, in its own frame. ``SPEC.md`` draws the picture; ``vectors.json`` has numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

TOUCH_GAP: Final = 1e-3
"""A part touches the ground when it comes nearer than this, m."""


def up_in_body(orientation: Sequence[float]) -> tuple[float, float, float]:
    """The world's up in the body's frame.

    Args:
        orientation: The body's attitude in the world as a unit quaternion x, y, z, w.
    """
    x, y, z, w = orientation
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


def tilt_of(up: Sequence[float]) -> tuple[float, float]:
    """Left/right and forward/back tilt, rad: what two levels on the main body show.

    Positive: left side up, nose up. Each lies in ±π/2; a body on its back may read as level.

    Args:
        up: The world's up in the body's frame.
    """
    return math.asin(_unit(up[1])), math.asin(_unit(up[0]))


def clearance_of(belly_height: float, up: Sequence[float], cap: float) -> tuple[float, bool]:
    """Distance from the middle of the belly to the ground along the belly's normal.

    Args:
        belly_height: Height of the belly's middle above the ground, m.
        up: The world's up in the body's frame.
        cap: The longest distance that can be read, m.

    Returns:
        The distance, m, and whether it is saturated: then it equals the cap, as it does when the
        ray misses the ground.
    """
    if up[2] <= 0.0:
        return cap, True
    distance = belly_height / up[2]
    return (distance, False) if distance < cap else (cap, True)


def touches(gap: float) -> bool:
    """Whether a part at this distance from the ground, m, touches it."""
    return gap < TOUCH_GAP


def _unit(value: float) -> float:
    return min(1.0, max(-1.0, value))
