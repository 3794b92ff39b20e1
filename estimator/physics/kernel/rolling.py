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
from estimator.body.mounts import Vector
from estimator.physics.kernel.compiling import compiled
from estimator.physics.kernel.contact import BALANCED, TOUCHING, depth, nearest, touching
from estimator.physics.kernel.vectors import (
    at,
    cross,
    dot,
    minus,
    plus,
    times,
    turning,
    unit,
    vector,
)

_ROLLS: Final = 100  # a body needs 0 to 5; no descent needs more than it has edges
_PIVOTS: Final = 4
_FLAT: Final = 1e-14  # m⁴: three contacts nearly in a line fix no plane


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
        centre: Of mass, in the body frame.
        up: World up in the body frame; changed.
        stance: Receives three contacts around the centre of mass, or −1 for those that are
            lacking where it is balanced on an edge or a vertex.
        touch: Work space, as many as there are points; likewise ``flat``, twice as many.

    Returns:
        Whether it came to rest.
    """
    for _ in range(_ROLLS):
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
    before, foot = vector(up), at(points, pivot)
    # u(t) = share·axis + size·(start cos t + down sin t)
    arm = minus(foot, centre)
    down = minus(arm, times(dot(before, arm), before))
    start, axis, share, size = before, (0.0, 0.0, 0.0), 0.0, 1.0
    if other >= 0:
        axis = unit(minus(at(points, other), foot))
        share = dot(before, axis)
        start = minus(before, times(share, axis))
        size = math.sqrt(dot(start, start))
        start = start[0] / size, start[1] / size, start[2] / size
        side = cross(axis, start)
        down = times(1.0 if dot(side, down) > 0 else -1.0, side)
    else:
        down = unit(down)
    half = math.inf  # tangent of half the angle at which the first point touches
    for point in range(count):
        away = minus(at(points, point), foot)
        constant = points[3, pivot] - points[3, point] + share * dot(axis, away)
        cosine, sine = size * dot(start, away), size * dot(down, away)
        gap, left = constant + cosine, cosine * cosine + sine * sine - constant * constant
        if gap > TOUCHING and left > 0:
            rate = math.sqrt(left) - sine
            if gap < half * rate:
                half = gap / rate
    if half == math.inf:
        return False  # nothing to fall on: cannot be, with the main body's eight corners
    scale = 1 / (1 + half * half)
    cosine, sine = size * (1 - half * half) * scale, size * 2 * half * scale
    up[0], up[1], up[2] = unit(
        plus(plus(times(share, axis), times(cosine, start)), times(sine, down))
    )
    return True


@compiled
def follow(
    points: Array, count: int, centre: Vector, up: Array, stance: Integers, least_cosine: float
) -> bool:
    """Goes on resting on the same three contacts, or nearly.

    Args:
        centre: Of mass, in the body frame.
        up: World up in the body frame before the change of shape; changed if it succeeds.
        stance: The three contacts; changed if it succeeds.
        least_cosine: Of the angle by which u may turn.

    Returns:
        Whether the body rests so; if not, it has to roll.
    """
    a, b, c = stance[0], stance[1], stance[2]
    before = vector(up)
    for _ in range(_PIVOTS):
        fixed, now = _upright(points, a, b, c, before)
        if not fixed or dot(now, before) < least_cosine:
            return False
        to_a = minus(at(points, a), centre)
        to_b = minus(at(points, b), centre)
        to_c = minus(at(points, c), centre)
        a_b, b_c, c_a = turning(now, to_a, to_b), turning(now, to_b, to_c), turning(now, to_c, to_a)
        leftward = a_b > 0 and b_c > 0 and c_a > 0
        if not (leftward or (a_b < 0 and b_c < 0 and c_a < 0)):
            return False
        lowest = depth(points, count, now)
        if lowest <= points[3, a] - dot(now, at(points, a)) + TOUCHING:
            up[0], up[1], up[2] = now
            stance[0], stance[1], stance[2] = a, b, c
            return True
        new = 0
        for point in range(count):
            if points[3, point] - dot(now, at(points, point)) >= lowest:
                new = point
        to_new = minus(at(points, new), centre)
        side = 1.0 if leftward else -1.0
        n_a = side * turning(now, to_new, to_a)
        n_b = side * turning(now, to_new, to_b)
        n_c = side * turning(now, to_new, to_c)
        if n_a > 0 > n_b:
            c = new
        elif n_b > 0 > n_c:
            a = new
        else:
            b = new
    return False


@compiled
def _upright(points: Array, a: int, b: int, c: int, before: Vector) -> tuple[bool, Vector]:
    """Up, across the plane under three spheres: of its two solutions the one nearer ``before``."""
    to_b, b_rise = minus(at(points, b), at(points, a)), points[3, b] - points[3, a]
    to_c, c_rise = minus(at(points, c), at(points, a)), points[3, c] - points[3, a]
    across = cross(to_b, to_c)
    squared = dot(across, across)
    if squared < _FLAT:
        return False, before
    scale = 1 / squared
    tilted = 0.0, 0.0, 0.0
    left = 1.0
    if b_rise != 0 or c_rise != 0:
        tilted = times(
            scale, plus(times(b_rise, cross(to_c, across)), times(c_rise, cross(across, to_b)))
        )
        left = 1 - dot(tilted, tilted)
        if left <= 0:
            return False, before
    length = math.sqrt(left * scale)
    if dot(across, before) < 0:
        length = -length
    return True, plus(tilted, times(length, across))
