"""How a body comes to rest.

Let u be world up in the body frame. The body's origin is ``depth`` above its lowest point, the
largest of r − u·p over all points p with radius r. Moments are taken in the plane across u, with
the centre of mass at 0.

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
from estimator.body.mounts import Vector
from estimator.physics.kernel.compiling import compiled, compiled_for_vectors
from estimator.physics.kernel.lanes import choose, root


@compiled
def vector(array: Array) -> Vector:
    """The three numbers of an array."""
    return array[0], array[1], array[2]


@compiled
def at(points: Array, point: int) -> Vector:
    """Where a point is."""
    return points[0, point], points[1, point], points[2, point]


@compiled
def plus(a: Vector, b: Vector) -> Vector:
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def minus(a: Vector, b: Vector) -> Vector:
    """Difference of two vectors: the way from b to a."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def times(scale: float, a: Vector) -> Vector:
    """Product of a number and a vector."""
    return scale * a[0], scale * a[1], scale * a[2]


@compiled
def dot(a: Vector, b: Vector) -> float:
    """Inner product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a: Vector, b: Vector) -> Vector:
    """Cross product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def unit(a: Vector) -> Vector:
    """The vector of length 1 in a vector's direction."""
    direction: Vector = times(1 / math.sqrt(dot(a, a)), a)
    return direction


@compiled
def turning(up: Vector, a: Vector, b: Vector) -> float:
    """Twice the area from 0 to a to b as seen along ``up``; above 0 for a turn to the left."""
    area: float = dot(up, cross(a, b))
    return area


TOUCHING: Final = 1e-7
"""Points this close to the ground touch it, m: far above rounding, far below what tilts a body."""

BALANCED: Final = 1e-6
"""A centre of mass this close to the rim of its support is balanced on it, m."""

_NEARER_BY = 1e-9  # relative; how much nearer a point must be to be called nearer


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
        centre: Centre of mass, in the body frame.
        up: World up in the body frame.
        touch: Receives the points' numbers, in order.
        flat: Receives where they are in the plane across u, from the centre of mass; shape (2, …).

    Returns:
        Number of points that touch.
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
        flat: Where the points are, in the first ``count`` columns.
        from_x: The given point's x; the centre of mass is at 0.
        from_y: The given point's y.

    Returns:
        What the nearest point lies on: three corners (the given point lies inside), two (an edge)
        and −1, or one and twice −1; then the way to it, m.
    """
    first, second, third = 0, -1, -1
    x, y = flat[0, 0] - from_x, flat[1, 0] - from_y
    for point in range(1, count):
        point_x, point_y = flat[0, point] - from_x, flat[1, point] - from_y
        if point_x * point_x + point_y * point_y < x * x + y * y:
            first, x, y = point, point_x, point_y
    for _ in range(2 * count + 8):  # each turn comes nearer, so no set of corners comes twice
        squared = x * x + y * y
        if squared < BALANCED * BALANCED:
            if second >= 0:  # on a line between two points, which may be a diagonal
                third = _farthest_left(flat, count, first, second)
            return first, second, third, x, y
        third, least = -1, squared * (1 - _NEARER_BY)
        for point in range(count):
            along = (flat[0, point] - from_x) * x + (flat[1, point] - from_y) * y
            if along < least:
                third, least = point, along
        if third < 0:
            break
        if second >= 0:
            a_x, a_y = flat[0, first] - from_x, flat[1, first] - from_y
            b_x, b_y = flat[0, second] - from_x, flat[1, second] - from_y
            c_x, c_y = flat[0, third] - from_x, flat[1, third] - from_y
            a_b = a_x * b_y - a_y * b_x
            b_c = b_x * c_y - b_y * c_x
            c_a = c_x * a_y - c_y * a_x
            if (a_b >= 0 and b_c >= 0 and c_a >= 0) or (a_b <= 0 and b_c <= 0 and c_a <= 0):
                return first, second, third, 0.0, 0.0
        first_end, second_end, shortest = first, second, math.inf
        for turn in range(2 if second >= 0 else 1):
            end = first_end if turn == 0 else second_end
            start_x, start_y = flat[0, end] - from_x, flat[1, end] - from_y
            edge_x, edge_y = flat[0, third] - flat[0, end], flat[1, third] - flat[1, end]
            share = -(start_x * edge_x + start_y * edge_y) / (edge_x * edge_x + edge_y * edge_y)
            share = min(1.0, max(0.0, share))
            near_x, near_y = start_x + share * edge_x, start_y + share * edge_y
            if near_x * near_x + near_y * near_y < shortest:
                shortest, x, y = near_x * near_x + near_y * near_y, near_x, near_y
                first, second = (third, -1) if share >= 1 else (end, third if share > 0 else -1)
    return first, second, -1, x, y


@compiled
def _farthest_left(flat: Array, count: int, first: int, second: int) -> int:
    """The point farthest left of a line through two; −1: there are not points on both sides."""
    x, y = flat[0, second] - flat[0, first], flat[1, second] - flat[1, first]
    rim = BALANCED * math.sqrt(x * x + y * y)
    farthest, leftmost, rightmost = -1, rim, 0.0
    for point in range(count):
        left = x * (flat[1, point] - flat[1, first]) - y * (flat[0, point] - flat[0, first])
        rightmost = min(rightmost, left)
        if left > leftmost:
            farthest, leftmost = point, left
    return farthest if rightmost < -rim else -1


@compiled
def balanced(flat: Array, count: int) -> bool:
    """Whether the centre of mass lies on the rim of the touching points' hull, or beyond it."""
    for quarter in range(4):
        way = BALANCED if quarter < 2 else -BALANCED
        x, y = (way, 0.0) if quarter % 2 == 0 else (0.0, way)
        if nearest(flat, count, x, y)[2] < 0:
            return True
    return False


_MOST_ROLLS: Final = 100  # a body needs 0 to 5; no descent needs more than it has edges
_MOST_PIVOTS: Final = 4  # after so many exchanged contacts a body rolls instead; not tuned
_IN_LINE: Final = 1e-14  # m⁴: three contacts nearly in a line fix no plane


@compiled
def roll(
    points: Array,
    count: int,
    centre: Vector,
    up: Array,
    stance: Integers,
    touch: Integers,
    flat: Array,
) -> bool:
    """Rolls the body to rest.

    Args:
        centre: Centre of mass, in the body frame.
        up: World up in the body frame; changed.
        stance: Receives three contacts around the centre of mass, or −1 for those that are
            lacking where it is balanced on an edge or a vertex.
        touch: Work space, one number per point.
        flat: Work space, two numbers per point.

    Returns:
        Whether it came to rest.
    """
    for _ in range(_MOST_ROLLS):
        contacts = touching(points, count, centre, vector(up), touch, flat)
        first, second, third, x, y = nearest(flat, contacts, 0.0, 0.0)
        stance[0] = touch[first]
        stance[1] = touch[second] if second >= 0 else -1
        stance[2] = touch[third] if third >= 0 else -1
        if third >= 0 or x * x + y * y < BALANCED * BALANCED:
            return True
        if not _turn(points, count, centre, up, stance[0], stance[1]):
            return False
    return False


@compiled
def _turn(points: Array, count: int, centre: Vector, up: Array, pivot: int, other: int) -> bool:
    """Turns the body about one contact, or two, until another point touches."""
    old_up, foot = vector(up), at(points, pivot)
    # u(t) = share·axis + size·(start cos t + down sin t)
    arm = minus(foot, centre)
    down = minus(arm, times(dot(old_up, arm), old_up))
    start, axis, share, size = old_up, (0.0, 0.0, 0.0), 0.0, 1.0
    if other >= 0:
        axis = unit(minus(at(points, other), foot))
        share = dot(old_up, axis)
        start = minus(old_up, times(share, axis))
        size = math.sqrt(dot(start, start))
        start = start[0] / size, start[1] / size, start[2] / size
        side = cross(axis, start)
        down = times(1.0 if dot(side, down) > 0 else -1.0, side)
    else:
        down = unit(down)
    tangent = math.inf  # tangent of half the angle at which the first point touches
    for point in range(count):
        from_foot = minus(at(points, point), foot)
        constant = points[3, pivot] - points[3, point] + share * dot(axis, from_foot)
        cosine, sine = size * dot(start, from_foot), size * dot(down, from_foot)
        gap, discriminant = constant + cosine, cosine * cosine + sine * sine - constant * constant
        if gap > TOUCHING and discriminant > 0:
            rate = math.sqrt(discriminant) - sine
            if gap < tangent * rate:
                tangent = gap / rate
    if tangent == math.inf:
        return False  # nothing to fall on: cannot be, with the main body's eight corners
    scale = 1 / (1 + tangent * tangent)
    cosine, sine = size * (1 - tangent * tangent) * scale, size * 2 * tangent * scale
    up[0], up[1], up[2] = unit(
        plus(plus(times(share, axis), times(cosine, start)), times(sine, down))
    )
    return True


@compiled
def stands(
    foot: Vector,
    second: Vector,
    third: Vector,
    second_rise: float,
    third_rise: float,
    centre: Vector,
    before: Vector,
    least_cosine: float,
) -> tuple[bool, Vector, float]:
    """How a body stands on three spheres; of one body, or of ``LANES`` at once.

    Args:
        foot: Centre of the first sphere.
        second: Centre of the second sphere.
        third: Centre of the third sphere.
        second_rise: By how much the second radius is larger than the first.
        third_rise: By how much the third radius is larger than the first.
        centre: Centre of mass.
        before: Up before the change of shape; 0: not known, the three lie in a turn to the left.
        least_cosine: Cosine of the largest angle by which up may turn.

    Returns:
        Whether the centre of mass is between the three and up turns by no more; up, across the
        plane under the spheres: of the two solutions the one nearer ``before``; and twice the area
        from the centre to the first two, above 0 if they lie in a turn to the left.
    """
    to_b, to_c = minus(second, foot), minus(third, foot)
    across = cross(to_b, to_c)
    squared = dot(across, across)
    scale = 1.0 / squared
    tilted = times(
        scale, plus(times(second_rise, cross(to_c, across)), times(third_rise, cross(across, to_b)))
    )
    remaining = 1.0 - dot(tilted, tilted)
    length = root(remaining * scale)
    length = choose(dot(across, before) < 0.0, -1.0 * length, length)
    up = plus(tilted, times(length, across))
    to_a, to_b, to_c = minus(foot, centre), minus(second, centre), minus(third, centre)
    a_b, b_c, c_a = turning(up, to_a, to_b), turning(up, to_b, to_c), turning(up, to_c, to_a)
    leftward = (a_b > 0.0) & (b_c > 0.0) & (c_a > 0.0)
    rightward = (a_b < 0.0) & (b_c < 0.0) & (c_a < 0.0)
    fixed = (squared >= _IN_LINE) & (remaining > 0.0)
    is_near = (dot(up, before) >= least_cosine) | (dot(before, before) == 0.0)
    return fixed & is_near & (leftward | rightward), up, a_b


@compiled
def follow(
    points: Array, count: int, centre: Vector, up: Array, stance: Integers, least_cosine: float
) -> bool:
    """Follows a body that goes on resting on the same three contacts, or nearly the same.

    Args:
        centre: Centre of mass, in the body frame.
        up: World up in the body frame before the change of shape; changed if it succeeds.
        stance: The three contacts; changed if it succeeds.
        least_cosine: Cosine of the largest angle by which u may turn.

    Returns:
        Whether the body rests so; if not, it has to roll.
    """
    a, b, c = stance[0], stance[1], stance[2]
    before = vector(up)
    for _ in range(_MOST_PIVOTS):
        is_standing, new_up, area = stands(
            at(points, a),
            at(points, b),
            at(points, c),
            points[3, b] - points[3, a],
            points[3, c] - points[3, a],
            centre,
            before,
            least_cosine,
        )
        if not is_standing:
            return False
        lowest = depth(points, count, new_up)
        if lowest <= points[3, a] - dot(new_up, at(points, a)) + TOUCHING:
            up[0], up[1], up[2] = new_up
            stance[0], stance[1], stance[2] = a, b, c
            return True
        new_contact = 0
        for point in range(count):
            if points[3, point] - dot(new_up, at(points, point)) >= lowest:
                new_contact = point
        to_new = minus(at(points, new_contact), centre)
        side = 1.0 if area > 0 else -1.0
        n_a = side * turning(new_up, to_new, minus(at(points, a), centre))
        n_b = side * turning(new_up, to_new, minus(at(points, b), centre))
        n_c = side * turning(new_up, to_new, minus(at(points, c), centre))
        if n_a > 0 > n_b:
            c = new_contact
        elif n_b > 0 > n_c:
            a = new_contact
        else:
            b = new_contact
    return False
