"""What an accelerometer feels that does not sit straight on the main body."""

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
