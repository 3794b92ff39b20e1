"""Where the links of a body are at each step of the slew, and with them its points."""

from __future__ import annotations

from estimator.body.arrays import Integers
from estimator.body.morphology import Array
from estimator.physics.kernel.compiling import compiled
from estimator.physics.kernel.links import (
    AXIS,
    COSINE,
    EAST,
    END,
    FIRST,
    FREE,
    LEVEL,
    MASS,
    MOMENT_X,
    MOMENT_Y,
    NORTH,
    OWN_STEPS,
    PARENT,
    PITCH,
    RISE,
    SIGN,
    SINE,
    STEPS,
    TURN,
    YAW,
    X,
    Y,
    Z,
)


@compiled
def _move_freely(
    link: int,
    cosine: float,
    sine: float,
    tree: Integers,
    joint: Array,
    frame: Array,
    points: Array,
) -> None:
    """Turns one link about any axis, on any mount (Rodrigues); see ``move``."""
    on = tree[link, PARENT]
    level, rise = joint[link, LEVEL], joint[link, RISE]
    east, north = joint[link, EAST], joint[link, NORTH]
    axis_x, axis_y, axis_z = joint[link, AXIS], joint[link, AXIS + 1], joint[link, AXIS + 2]
    for row in range(3):
        origin = frame[on, row] + joint[link, X] * frame[on, 3 + row]
        origin += joint[link, Y] * frame[on, 6 + row] + joint[link, Z] * frame[on, 9 + row]
        flat = east * frame[on, 3 + row] + north * frame[on, 6 + row]
        x = level * flat + rise * frame[on, 9 + row]
        y = east * frame[on, 6 + row] - north * frame[on, 3 + row]
        z = level * frame[on, 9 + row] - rise * flat
        along = (1 - cosine) * (axis_x * x + axis_y * y + axis_z * z)
        ahead = cosine * x + sine * (axis_z * y - axis_y * z) + along * axis_x
        left = cosine * y + sine * (axis_x * z - axis_z * x) + along * axis_y
        frame[link, row] = origin
        frame[link, 3 + row] = ahead
        frame[link, 6 + row] = left
        over = cosine * z + sine * (axis_y * x - axis_x * y) + along * axis_z
        frame[link, 9 + row] = over
        frame[link, 12 + row] = joint[link, MASS] * origin
        frame[link, 12 + row] += joint[link, MOMENT_X] * ahead + joint[link, MOMENT_Y] * left
        for point in range(tree[link, FIRST], tree[link, END]):
            across = points[5, point] * left + points[6, point] * over
            points[row, point] = origin + points[4, point] * ahead + across


@compiled
def move(
    step: int,
    links: int,
    tree: Integers,
    joint: Array,
    frame: Array,
    points: Array,
    cosines: Array,
    sines: Array,
) -> tuple[float, float, float]:
    """Turns the joints to where they are after so many steps. What stands still is left alone.

    Args:
        cosines: Of the angle after each number of steps; likewise ``sines``.

    Returns:
        Mass times centre of mass, in the body frame, kg·m.
    """
    total_x, total_y, total_z = frame[0, 12], frame[0, 13], frame[0, 14]
    for link in range(1, links):
        if step <= tree[link, STEPS]:
            on, turn, turned = tree[link, PARENT], tree[link, TURN], 0
            x, y = joint[link, X], joint[link, Y]
            mass = joint[link, MASS]
            moment_x, moment_y = joint[link, MOMENT_X], joint[link, MOMENT_Y]
            east, north = joint[link, EAST], joint[link, NORTH]
            if step < tree[link, OWN_STEPS]:
                cosine, sine = cosines[step], sines[step] * joint[link, SIGN]
            else:
                cosine, sine = joint[link, COSINE], joint[link, SINE] * joint[link, SIGN]
            if turn == FREE:
                _move_freely(link, cosine, sine, tree, joint, frame, points)
                turned = 3
            for row in range(turned, 3):
                origin = frame[on, row] + x * frame[on, 3 + row] + y * frame[on, 6 + row]
                ahead = east * frame[on, 3 + row] + north * frame[on, 6 + row]
                left = east * frame[on, 6 + row] - north * frame[on, 3 + row]
                over = frame[on, 9 + row]
                if turn == YAW:
                    ahead, left = cosine * ahead + sine * left, cosine * left - sine * ahead
                elif turn == PITCH:
                    ahead, over = cosine * ahead + sine * over, cosine * over - sine * ahead
                else:  # roll
                    left, over = cosine * left - sine * over, cosine * over + sine * left
                frame[link, row] = origin
                frame[link, 3 + row] = ahead
                frame[link, 6 + row] = left
                frame[link, 9 + row] = over
                frame[link, 12 + row] = mass * origin + moment_x * ahead + moment_y * left
                for point in range(tree[link, FIRST], tree[link, END]):
                    across = points[4, point] * ahead + points[5, point] * left
                    points[row, point] = origin + (across + points[6, point] * over)
        total_x += frame[link, 12]
        total_y += frame[link, 13]
        total_z += frame[link, 14]
    return total_x, total_y, total_z
