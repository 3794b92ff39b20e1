"""Which points touch the ground, and whether the centre of mass is over them.

Let u be world up in the body frame. The body's frame is ``depth`` above its lowest point, the
largest of r − u·p over all points p with radius r. Moments are taken in the plane across u, with
the centre of mass at 0.
"""

from __future__ import annotations

import math
from typing import Final

from estimator.body.arrays import Integers
from estimator.body.morphology import Array
from estimator.body.mounts import Vector
from estimator.physics.kernel.compiling import compiled, compiled_for_vectors
from estimator.physics.kernel.vectors import at, dot, minus

TOUCHING: Final = 1e-7
"""Points this close to the ground touch it, m: far above rounding, far below what tilts a body."""

BALANCED: Final = 1e-6
"""A centre of mass this close to the rim of its support is balanced on it, m."""

_SAME = 1e-9  # relative; how much nearer a point must be to be called nearer


@compiled_for_vectors
def depth(points: Array, count: int, up: Vector) -> float:
    """How far the lowest point lies below the body's origin, m."""
    up_x, up_y, up_z = up
    deepest = -math.inf
    for point in range(count):
        below = points[3, point] - (
            up_x * points[0, point] + up_y * points[1, point] + up_z * points[2, point]
        )
        if below > deepest:  # noqa: PLR1730  max() is not turned into vector instructions
            deepest = below
    return deepest


@compiled
def touching(
    points: Array, count: int, centre: Vector, up: Vector, touch: Integers, flat: Array
) -> int:
    """Lists the points that touch the ground.

    Args:
        centre: Of mass, in the body frame.
        up: World up in the body frame.
        touch: Receives their numbers, in order.
        flat: Shape (2, …); receives where they are across u, from the centre of mass.

    Returns:
        How many there are.
    """
    up_x, up_y, up_z = up
    least = depth(points, count, up) - TOUCHING
    # two axes across u, without a singularity (Duff et al. 2017)
    sign = 1.0 if up_z >= 0 else -1.0
    a = -1.0 / (sign + up_z)
    b = up_x * up_y * a
    contacts = 0
    for point in range(count):
        if points[3, point] - dot(up, at(points, point)) >= least:
            touch[contacts] = point
            x, y, z = minus(at(points, point), centre)
            flat[0, contacts] = (1 + sign * up_x * up_x * a) * x + sign * b * y - sign * up_x * z
            flat[1, contacts] = b * x + (sign + up_y * up_y * a) * y - up_y * z
            contacts += 1
    return contacts


@compiled
def nearest(
    flat: Array, count: int, from_x: float, from_y: float
) -> tuple[int, int, int, float, float]:
    """The point of the touching points' hull that lies nearest to a given one.

    Args:
        flat: Where the points are; the first ``count`` columns.
        from_x: The given point, usually the centre of mass, 0.
        from_y: Likewise.

    Returns:
        What it lies on: three corners (the given point lies inside), two (an edge) and −1, or one
        and twice −1; then the way to it, m.
    """
    first, second, third = 0, -1, -1
    x, y = flat[0, 0] - from_x, flat[1, 0] - from_y
    for point in range(1, count):
        other_x, other_y = flat[0, point] - from_x, flat[1, point] - from_y
        if other_x * other_x + other_y * other_y < x * x + y * y:
            first, x, y = point, other_x, other_y
    for _ in range(2 * count + 8):  # each turn comes nearer, so no set of corners comes twice
        squared = x * x + y * y
        if squared < BALANCED * BALANCED:
            if second >= 0:  # on a line between two points, which may be a diagonal
                third = _beyond(flat, count, first, second)
            return first, second, third, x, y
        third, least = -1, squared * (1 - _SAME)
        for point in range(count):
            along = (flat[0, point] - from_x) * x + (flat[1, point] - from_y) * y
            if along < least:
                third, least = point, along
        if third < 0:
            break
        if second >= 0:
            one_x, one_y = flat[0, first] - from_x, flat[1, first] - from_y
            two_x, two_y = flat[0, second] - from_x, flat[1, second] - from_y
            three_x, three_y = flat[0, third] - from_x, flat[1, third] - from_y
            one = one_x * two_y - one_y * two_x
            two = two_x * three_y - two_y * three_x
            three = three_x * one_y - three_y * one_x
            if (one >= 0 and two >= 0 and three >= 0) or (one <= 0 and two <= 0 and three <= 0):
                return first, second, third, 0.0, 0.0
        one_end, other_end, best = first, second, math.inf
        for turn in range(2 if second >= 0 else 1):
            end = one_end if turn == 0 else other_end
            start_x, start_y = flat[0, end] - from_x, flat[1, end] - from_y
            edge_x, edge_y = flat[0, third] - flat[0, end], flat[1, third] - flat[1, end]
            share = -(start_x * edge_x + start_y * edge_y) / (edge_x * edge_x + edge_y * edge_y)
            share = min(1.0, max(0.0, share))
            near_x, near_y = start_x + share * edge_x, start_y + share * edge_y
            if near_x * near_x + near_y * near_y < best:
                best, x, y = near_x * near_x + near_y * near_y, near_x, near_y
                first, second = (third, -1) if share >= 1 else (end, third if share > 0 else -1)
    return first, second, -1, x, y


@compiled
def _beyond(flat: Array, count: int, first: int, second: int) -> int:
    """A point to the left of the line through two points if others lie to its right; or −1."""
    x, y = flat[0, second] - flat[0, first], flat[1, second] - flat[1, first]
    rim = BALANCED * math.sqrt(x * x + y * y)
    farthest, most, least = -1, rim, 0.0
    for point in range(count):
        left = x * (flat[1, point] - flat[1, first]) - y * (flat[0, point] - flat[0, first])
        least = min(least, left)
        if left > most:
            farthest, most = point, left
    return farthest if least < -rim else -1


@compiled
def balanced(flat: Array, count: int) -> bool:
    """Whether the centre of mass lies on the rim of the touching points' hull, or beyond it."""
    for quarter in range(4):
        way = BALANCED if quarter < 2 else -BALANCED
        x, y = (way, 0.0) if quarter % 2 == 0 else (0.0, way)
        if nearest(flat, count, x, y)[2] < 0:
            return True
    return False
