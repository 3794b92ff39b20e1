"""How a body comes to rest.

The centre of mass is as high above the ground as the lowest point is below it, so a pose is at
rest where that depth, as a function of u, has a local minimum. ``roll`` descends to one: while the
centre of mass is not over its support, the body turns about the vertex or edge of the support that
is nearest, which is the direction of steepest descent, until another point touches. Turning about
an axis, a point's gap is C + A cos t + B sin t, so where it closes is known in closed form.

``follow`` finds the same minimum again after a small change of shape, from its three contacts: they
fix u. Where another point would sink in, it takes the place of that contact which leaves the
centre of mass inside: the pivot of linear programming.
"""

from __future__ import annotations

import math
from typing import Final

from estimator.body.arrays import Integers
from estimator.body.morphology import Array
from estimator.physics.kernel.compiling import compiled
from estimator.physics.kernel.contact import BALANCED, TOUCHING, depth, nearest, touching

_ROLLS: Final = 100  # a body needs 0 to 5; no descent needs more than it has edges
_PIVOTS: Final = 4
_FLAT: Final = 1e-14  # m⁴: three contacts nearly in a line fix no plane


@compiled
def roll(
    points: Array,
    count: int,
    centre_x: float,
    centre_y: float,
    centre_z: float,
    up: Array,
    stance: Integers,
    touch: Integers,
    flat: Array,
) -> bool:
    """Rolls the body to rest.

    Args:
        centre_x: Of mass, in the body frame; likewise y and z.
        up: World up in the body frame; changed.
        stance: Receives three contacts around the centre of mass, or −1 for those that are
            lacking where it is balanced on an edge or a vertex.
        touch: Work space, as many as there are points; likewise ``flat``, twice as many.

    Returns:
        Whether it came to rest.
    """
    for _ in range(_ROLLS):
        contacts = touching(points, count, centre_x, centre_y, centre_z, up, touch, flat)
        first, second, third, x, y = nearest(flat, contacts, 0.0, 0.0)
        stance[0] = touch[first]
        stance[1] = touch[second] if second >= 0 else -1
        stance[2] = touch[third] if third >= 0 else -1
        if third >= 0 or x * x + y * y < BALANCED * BALANCED:
            return True
        if not _turn(points, count, centre_x, centre_y, centre_z, up, stance[0], stance[1]):
            return False
    return False


@compiled
def _turn(
    points: Array,
    count: int,
    centre_x: float,
    centre_y: float,
    centre_z: float,
    up: Array,
    pivot: int,
    other: int,
) -> bool:
    """Turns the body about one contact, or two, until another point touches."""
    up_x, up_y, up_z = up[0], up[1], up[2]
    pivot_x, pivot_y, pivot_z = points[0, pivot], points[1, pivot], points[2, pivot]
    # u(t) = share·axis + size·(start cos t + down sin t)
    x, y, z = pivot_x - centre_x, pivot_y - centre_y, pivot_z - centre_z
    along = up_x * x + up_y * y + up_z * z
    down_x, down_y, down_z = x - along * up_x, y - along * up_y, z - along * up_z
    start_x, start_y, start_z = up_x, up_y, up_z
    axis_x = axis_y = axis_z = share = 0.0
    size = 1.0
    if other >= 0:
        axis_x, axis_y = points[0, other] - pivot_x, points[1, other] - pivot_y
        axis_z = points[2, other] - pivot_z
        scale = 1 / math.sqrt(axis_x * axis_x + axis_y * axis_y + axis_z * axis_z)
        axis_x, axis_y, axis_z = axis_x * scale, axis_y * scale, axis_z * scale
        share = up_x * axis_x + up_y * axis_y + up_z * axis_z
        start_x, start_y = up_x - share * axis_x, up_y - share * axis_y
        start_z = up_z - share * axis_z
        size = math.sqrt(start_x * start_x + start_y * start_y + start_z * start_z)
        start_x, start_y, start_z = start_x / size, start_y / size, start_z / size
        x, y = axis_y * start_z - axis_z * start_y, axis_z * start_x - axis_x * start_z
        z = axis_x * start_y - axis_y * start_x
        sign = 1.0 if x * down_x + y * down_y + z * down_z > 0 else -1.0
        down_x, down_y, down_z = sign * x, sign * y, sign * z
    else:
        scale = 1 / math.sqrt(down_x * down_x + down_y * down_y + down_z * down_z)
        down_x, down_y, down_z = down_x * scale, down_y * scale, down_z * scale
    half = math.inf  # tangent of half the angle at which the first point touches
    for point in range(count):
        x, y, z = points[0, point] - pivot_x, points[1, point] - pivot_y, points[2, point] - pivot_z
        constant = points[3, pivot] - points[3, point]
        constant += share * (axis_x * x + axis_y * y + axis_z * z)
        cosine = size * (start_x * x + start_y * y + start_z * z)
        sine = size * (down_x * x + down_y * y + down_z * z)
        gap, left = constant + cosine, cosine * cosine + sine * sine - constant * constant
        if gap > TOUCHING and left > 0:
            rate = math.sqrt(left) - sine
            if gap < half * rate:
                half = gap / rate
    if half == math.inf:
        return False  # nothing to fall on: cannot be, with the main body's eight corners
    scale = 1 / (1 + half * half)
    cosine, sine = size * (1 - half * half) * scale, size * 2 * half * scale
    up_x = share * axis_x + cosine * start_x + sine * down_x
    up_y = share * axis_y + cosine * start_y + sine * down_y
    up_z = share * axis_z + cosine * start_z + sine * down_z
    scale = 1 / math.sqrt(up_x * up_x + up_y * up_y + up_z * up_z)
    up[0], up[1], up[2] = up_x * scale, up_y * scale, up_z * scale
    return True


@compiled
def follow(
    points: Array,
    count: int,
    centre_x: float,
    centre_y: float,
    centre_z: float,
    up: Array,
    stance: Integers,
    least_cosine: float,
) -> bool:
    """Goes on resting on the same three contacts, or nearly.

    Args:
        centre_x: Of mass, in the body frame; likewise y and z.
        up: World up in the body frame before the change of shape; changed if it succeeds.
        stance: The three contacts; changed if it succeeds.
        least_cosine: Of the angle by which u may turn.

    Returns:
        Whether the body rests so; if not, it has to roll.
    """
    a, b, c = stance[0], stance[1], stance[2]
    old_x, old_y, old_z = up[0], up[1], up[2]
    for _ in range(_PIVOTS):
        fixed, x, y, z = _upright(points, a, b, c, old_x, old_y, old_z)
        if not fixed or x * old_x + y * old_y + z * old_z < least_cosine:
            return False
        a_x, a_y, a_z = points[0, a] - centre_x, points[1, a] - centre_y, points[2, a] - centre_z
        b_x, b_y, b_z = points[0, b] - centre_x, points[1, b] - centre_y, points[2, b] - centre_z
        c_x, c_y, c_z = points[0, c] - centre_x, points[1, c] - centre_y, points[2, c] - centre_z
        a_b = _turning(x, y, z, a_x, a_y, a_z, b_x, b_y, b_z)
        b_c = _turning(x, y, z, b_x, b_y, b_z, c_x, c_y, c_z)
        c_a = _turning(x, y, z, c_x, c_y, c_z, a_x, a_y, a_z)
        leftward = a_b > 0 and b_c > 0 and c_a > 0
        if not (leftward or (a_b < 0 and b_c < 0 and c_a < 0)):
            return False
        lowest = depth(points, count, x, y, z)
        below = points[3, a] - (x * points[0, a] + y * points[1, a] + z * points[2, a])
        if lowest <= below + TOUCHING:
            up[0], up[1], up[2] = x, y, z
            stance[0], stance[1], stance[2] = a, b, c
            return True
        new = 0
        for point in range(count):
            height = x * points[0, point] + y * points[1, point] + z * points[2, point]
            if points[3, point] - height >= lowest:
                new = point
        n_x, n_y = points[0, new] - centre_x, points[1, new] - centre_y
        n_z = points[2, new] - centre_z
        n_a = _turning(x, y, z, n_x, n_y, n_z, a_x, a_y, a_z)
        n_b = _turning(x, y, z, n_x, n_y, n_z, b_x, b_y, b_z)
        n_c = _turning(x, y, z, n_x, n_y, n_z, c_x, c_y, c_z)
        if not leftward:
            n_a, n_b, n_c = -n_a, -n_b, -n_c
        if n_a > 0 > n_b:
            c = new
        elif n_b > 0 > n_c:
            a = new
        else:
            b = new
    return False


@compiled
def _turning(
    x: float,
    y: float,
    z: float,
    a_x: float,
    a_y: float,
    a_z: float,
    b_x: float,
    b_y: float,
    b_z: float,
) -> float:
    """Twice the area from 0 to a to b as seen along (x, y, z); above 0 for a turn to the left."""
    return x * (a_y * b_z - a_z * b_y) + y * (a_z * b_x - a_x * b_z) + z * (a_x * b_y - a_y * b_x)


@compiled
def _upright(
    points: Array, a: int, b: int, c: int, old_x: float, old_y: float, old_z: float
) -> tuple[bool, float, float, float]:
    """Up, across the plane under three spheres: of its two solutions the one nearer the old one."""
    b_x, b_y = points[0, b] - points[0, a], points[1, b] - points[1, a]
    b_z, b_rise = points[2, b] - points[2, a], points[3, b] - points[3, a]
    c_x, c_y = points[0, c] - points[0, a], points[1, c] - points[1, a]
    c_z, c_rise = points[2, c] - points[2, a], points[3, c] - points[3, a]
    n_x, n_y, n_z = b_y * c_z - b_z * c_y, b_z * c_x - b_x * c_z, b_x * c_y - b_y * c_x
    squared = n_x * n_x + n_y * n_y + n_z * n_z
    if squared < _FLAT:
        return False, old_x, old_y, old_z
    scale = 1 / squared
    x = y = z = 0.0
    left = 1.0
    if b_rise != 0 or c_rise != 0:
        x = scale * (b_rise * (c_y * n_z - c_z * n_y) + c_rise * (n_y * b_z - n_z * b_y))
        y = scale * (b_rise * (c_z * n_x - c_x * n_z) + c_rise * (n_z * b_x - n_x * b_z))
        z = scale * (b_rise * (c_x * n_y - c_y * n_x) + c_rise * (n_x * b_y - n_y * b_x))
        left = 1 - (x * x + y * y + z * z)
        if left <= 0:
            return False, old_x, old_y, old_z
    length = math.sqrt(left * scale)
    if n_x * old_x + n_y * old_y + n_z * old_z < 0:
        length = -length
    return True, x + length * n_x, y + length * n_y, z + length * n_z
