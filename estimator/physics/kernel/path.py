"""One body from the planar pose to its motor program, and how sure its path is.

All joints turn at the same speed, each to its own target, in steps of ``pace``. After each step the
body is brought to rest again.

``lean_x`` and ``lean_y`` incline gravity in the body frame (tangents of angles towards x and y):
the centre of mass acts as if it were shifted by that share of its height. Where a body lands under
an inclined gravity tells how sure it is to land there under a plumb one.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from estimator.body.arrays import Integers
from estimator.body.morphology import Array
from estimator.physics.kernel.compiling import allocating, compiled
from estimator.physics.kernel.contact import BALANCED, TOUCHING, balanced, touching
from estimator.physics.kernel.links import (
    CORNERS,
    END,
    FIRST,
    FRAME_COLUMNS,
    JOINT_COLUMNS,
    MASS,
    POINT_ROWS,
    STEPS,
    TREE_COLUMNS,
    move,
)
from estimator.physics.kernel.rolling import follow, roll

_SAME: Final = 1e-3  # rad; poses that differ by less are one place
_STEEPEST: Final = 0.5  # tangent; the largest path margin told
_LADDER: Final = 5  # rungs from the steepest down, each a quarter of the one above
_FINE: Final = 1.2  # ratio of the two inclinations between which a margin is known to lie
_QUICK: Final = 8.0  # paces by which the body may turn in one and still be followed


class Work(NamedTuple):
    """Work space for one body after another; see ``links``."""

    tree: Integers
    joint: Array
    frame: Array
    points: Array
    place: Integers
    at: Array
    touch: Integers
    flat: Array
    up: Array
    stance: Integers


@allocating
def work_space(parts: int) -> Work:
    """Room for bodies of so many parts."""
    points = CORNERS + 2 * parts
    return Work(
        np.zeros((parts + 1, TREE_COLUMNS), np.int64),
        np.zeros((parts + 1, JOINT_COLUMNS)),
        np.zeros((parts + 1, FRAME_COLUMNS)),
        np.zeros((POINT_ROWS, points)),
        np.zeros(parts, np.int64),
        np.zeros((parts, 4)),
        np.zeros(points, np.int64),
        np.zeros((2, points)),
        np.zeros(3),
        np.zeros(3, np.int64),
    )


@compiled
def settle(
    work: Work,
    links: int,
    count: int,
    base: Array,
    cosines: Array,
    sines: Array,
    pace: float,
    lean_x: float,
    lean_y: float,
) -> bool:
    """Takes an assembled body from the planar pose to its targets, at rest after each step.

    Args:
        work: Holds the body; its ``up`` and ``stance`` receive the pose.
        links: How many it has.
        count: How many points it has.

    Returns:
        Whether it came to rest each time.
    """
    tree, joint, frame, points = work.tree, work.joint, work.frame, work.points
    touch, flat, up, stance = work.touch, work.flat, work.up, work.stance
    mass, steps = 0.0, 0
    for link in range(links):
        mass += joint[link, MASS]
        steps = max(steps, tree[link, STEPS])
    for column in range(FRAME_COLUMNS):
        frame[0, column] = 1.0 if column in (3, 7, 11) else 0.0
    for axis in range(3):
        frame[0, 12 + axis] = base[3] * base[5 + axis]
    up[0] = up[1] = 0.0
    up[2] = 1.0
    stance[0], stance[1], stance[2] = 0, 1, 2
    least_cosine = math.cos(_QUICK * pace)
    on_belly: bool = True
    rested: bool = True
    for step in range(steps + 1):
        x, y, z = move(step, links, tree, joint, frame, points, cosines, sines)
        x, y, z = x / mass, y / mass, z / mass
        if lean_x != 0 or lean_y != 0:
            foot = stance[0]
            height = points[3, foot] + up[0] * (x - points[0, foot])
            height += up[1] * (y - points[1, foot]) + up[2] * (z - points[2, foot])
            x, y = x + lean_x * height, y + lean_y * height
        if on_belly:
            on_belly = _lies(points, count, base, x, y)
        if on_belly or (
            stance[2] >= 0 and follow(points, count, x, y, z, up, stance, least_cosine)
        ):
            continue
        if not roll(points, count, x, y, z, up, stance, touch, flat):
            rested = False
    return rested


@compiled
def _lies(points: Array, count: int, base: Array, x: float, y: float) -> bool:
    """Whether a body that lay flat on its main body still does."""
    belly = -0.5 * base[2] - TOUCHING
    lies: bool = abs(x) < 0.5 * base[0] and abs(y) < 0.5 * base[1]
    for point in range(CORNERS, count):
        if points[2, point] - points[3, point] < belly:
            lies = False
    return lies


@compiled
def _centre_of_mass(work: Work, links: int) -> tuple[float, float, float]:
    """Of the body that was just settled, in the body frame, m."""
    mass = x = y = z = 0.0
    for link in range(links):
        mass += work.joint[link, MASS]
        x, y = x + work.frame[link, 12], y + work.frame[link, 13]
        z += work.frame[link, 14]
    return x / mass, y / mass, z / mass


@compiled
def right_itself(work: Work, links: int, count: int) -> bool:
    """Brings a body that was settled under an inclined gravity to rest under a plumb one.

    Returns:
        Whether it came to rest.
    """
    x, y, z = _centre_of_mass(work, links)
    rested: bool = roll(work.points, count, x, y, z, work.up, work.stance, work.touch, work.flat)
    return rested


@compiled
def undecided(work: Work, links: int, count: int) -> bool:
    """Whether the body that was just settled is balanced on the rim of its support."""
    points, up, stance = work.points, work.up, work.stance
    x, y, z = _centre_of_mass(work, links)
    if stance[2] >= 0:
        least = math.inf
        for side in range(3):
            a, b = stance[side], stance[(side + 1) % 3]
            a_x, a_y, a_z = points[0, a] - x, points[1, a] - y, points[2, a] - z
            d_x, d_y = points[0, b] - points[0, a], points[1, b] - points[1, a]
            d_z = points[2, b] - points[2, a]
            area = up[0] * (a_y * d_z - a_z * d_y) + up[1] * (a_z * d_x - a_x * d_z)
            area += up[2] * (a_x * d_y - a_y * d_x)
            least = min(least, area * area / (d_x * d_x + d_y * d_y + d_z * d_z))
        if least > 4 * BALANCED * BALANCED:
            return False
    contacts = touching(points, count, x, y, z, up, work.touch, work.flat)
    return balanced(work.flat, contacts)


@compiled
def margin(
    work: Work,
    links: int,
    count: int,
    base: Array,
    cosines: Array,
    sines: Array,
    pace: float,
) -> float:
    """How far gravity may be inclined, in each of four directions, with the body landing alike.

    Args:
        work: Holds a body that was just settled.

    Returns:
        rad; no more than the arc tangent of 0.5.
    """
    up = work.up
    up_x, up_y, up_z = up[0], up[1], up[2]
    good, bad, tried = 0.0, _STEEPEST, _STEEPEST
    trials = 0
    while bad > _FINE * good:
        alike = True
        for quarter in range(4):
            lean = tried if quarter < 2 else -tried
            x, y = (lean, 0.0) if quarter % 2 == 0 else (0.0, lean)
            alike = settle(work, links, count, base, cosines, sines, pace, x, y)
            away = max(abs(up[0] - up_x), abs(up[1] - up_y), abs(up[2] - up_z))
            if not alike or away > _SAME:
                alike = False
                break
        if alike:
            good = tried
        else:
            bad = tried
        trials += 1
        if good == 0 and trials == _LADDER:
            break
        tried = math.sqrt(good * bad) if good > 0 else 0.25 * tried
    return math.atan(good)


@compiled
def gap(work: Work, link: int, deep: float) -> float:
    """Distance of a link's lowest point from the ground, m; 0 where it touches.

    Args:
        deep: Of the settled body.
    """
    points, up = work.points, work.up
    least = math.inf
    for point in range(work.tree[link, FIRST], work.tree[link, END]):
        height = up[0] * points[0, point] + up[1] * points[1, point] + up[2] * points[2, point]
        least = min(least, deep + height - points[3, point])
    return 0.0 if least < TOUCHING else least
