"""What touch, tilt and clearance mean: one formula each, the same for robot, simulator and models.

Frames are right-handed: x forward, y left, z up. *Up* is the world's upward unit vector as the
main body sees it, in its own frame. ``SPEC.md`` draws the picture; ``vectors.json`` has numbers.

These are what a perfect sensor reads. The robot, the simulated world and the models' engines call
them; the statics kernel compiles them. So they are arithmetic on numbers, and none calls another.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Protocol

TOUCH_GAP: Final = 1e-3
"""A part touches the ground when it comes nearer than this, m."""

DOUBTFUL_GAP: Final = 2e-3
"""A touch sensor that feels load may disagree about a part above the ground by less, m."""


class Direction(Protocol):
    """A unit vector x, y, z: a sequence or an array."""

    def __getitem__(self, index: int, /) -> float:
        """One component."""


def up_in_body(orientation: Sequence[float]) -> tuple[float, float, float]:
    """The world's up in the body's frame.

    Args:
        orientation: The body's attitude in the world as a unit quaternion x, y, z, w.
    """
    x, y, z, w = orientation
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


def tilt_of(up: Direction) -> tuple[float, float]:
    """Left/right and forward/back tilt, rad: what two levels on the main body show.

    Positive: left side up, nose up. Each lies in ±π/2; a body on its back may read as level.

    Args:
        up: The world's up in the body's frame.
    """
    return math.asin(max(-1.0, min(1.0, up[1]))), math.asin(max(-1.0, min(1.0, up[0])))


def up_of(tilt: Sequence[float]) -> tuple[float, float, float]:
    """The world's up in the frame of a body that is not on its back; ``tilt_of`` inverted.

    Two tilts that no body can have at the same time give a vector longer than 1.

    Args:
        tilt: Left/right and forward/back tilt, rad.
    """
    x, y = math.sin(tilt[1]), math.sin(tilt[0])
    return x, y, math.sqrt(max(0.0, 1.0 - x * x - y * y))


def belly_ray(height: float, up: Direction) -> float:
    """Length of the ray from the middle of the belly along the belly's normal to the ground, m.

    Args:
        height: Height of the belly's middle above the ground, m. In a simulation, a body on the
            ground may be a little below it; the length is then negative.
        up: The world's up in the body's frame.

    Returns:
        The length; infinite where the ray misses the ground.
    """
    return height / up[2] if up[2] > 0.0 else math.inf


def clearance_of(ray: float, cap: float) -> tuple[float, bool]:
    """Distance from the middle of the belly to the ground, as far as it can be read.

    It is never negative: a belly that a simulation lets sink into the ground lies on it. (The
    noise of a real sensor is another matter; see ``SPEC.md``.)

    Args:
        ray: As ``belly_ray`` gives it, m.
        cap: The longest distance that can be read, m.

    Returns:
        The distance, m, and whether it is saturated: then it equals the cap.
    """
    return (max(0.0, ray), False) if ray < cap else (cap, True)


def touches(gap: float, limit: float = TOUCH_GAP) -> bool:
    """Whether a part at this distance from the ground, m, touches it."""
    return gap < limit


def touch_is_doubtful(gap: float, limit: float = DOUBTFUL_GAP) -> bool:
    """Whether a real sensor that feels load might disagree with ``touches``."""
    return 0.0 < gap < limit
