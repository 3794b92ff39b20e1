"""Where a part of either shape ends, and how large it is; the statics kernel compiles these."""

from __future__ import annotations

import math


def ends(length: float, radius: float, box: bool) -> tuple[float, float]:
    """Where a part ends on its x axis, m: a capsule's sphere centres, or a box's faces.

    Args:
        length: From its joint's axis to its tip, m.
        radius: Of a box half its width, m.
        box: Whether it is one; else it is a capsule.
    """
    if box:
        return min(0.0, length - 2 * radius), length
    return min(0.0, length - radius), length - radius


def volume(straight: float, radius: float, box: bool) -> float:
    """Volume of a part whose ends are so far apart, m³; see ``ends``."""
    if box:
        return 4 * radius**2 * straight
    return math.pi * radius**2 * (straight + 4 / 3 * radius)
