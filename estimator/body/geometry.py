"""Formulas of parts and sensors that the statics kernel compiles as well."""

from __future__ import annotations

import math

from protocol.wire.readings import Direction


def up_as_measured(up: Direction, across: float, along: float) -> tuple[float, float, float]:
    """The world's up in the frame of the accelerometer.

    Args:
        up: World up in the body's frame.
        across: How far the accelerometer is turned about the body's x axis, rad.
        along: How far it is then turned about its own y axis, rad.
    """
    left = up[1] * math.cos(across) + up[2] * math.sin(across)
    over = up[2] * math.cos(across) - up[1] * math.sin(across)
    ahead = up[0] * math.cos(along) + over * math.sin(along)
    return ahead, left, over * math.cos(along) - up[0] * math.sin(along)


def ends(length: float, radius: float, box: bool) -> tuple[float, float]:
    """Where a part ends on its x axis, m: a capsule's sphere centres, or a box's faces.

    Args:
        length: Length from the joint's axis to the tip, m.
        radius: Radius, or half the width of a box, m.
        box: Whether the part is a box; else it is a capsule.
    """
    if box:
        return min(0.0, length - 2 * radius), length
    return min(0.0, length - radius), length - radius


def volume(straight: float, radius: float, box: bool) -> float:
    """Volume of a part whose ends are ``straight`` apart, m³; see ``ends``."""
    if box:
        return 4 * radius**2 * straight
    return math.pi * radius**2 * (straight + 4 / 3 * radius)
