"""One body from the planar pose to its motor program, and how sure its path is.

All joints turn at the same speed, each to its own target, in steps of ``pace``. After each step the
body is brought to rest again.

A lean inclines gravity in the body frame (tangents of angles towards x and y): the centre of mass
acts as if it were shifted by that share of its height. Where a body lands under an inclined gravity
tells how sure it is to land there under a plumb one.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.body.mounts import Vector
from estimator.physics.kernel.compiling import compiled
from estimator.physics.kernel.contact import BALANCED, TOUCHING, balanced, touching
from estimator.physics.kernel.kinematics import move
from estimator.physics.kernel.links import (
    CORNERS,
    END,
    FIRST,
    FRAME_COLUMNS,
    MASS,
    STEPS,
    Slew,
    Work,
)
from estimator.physics.kernel.rolling import follow, roll
from estimator.physics.kernel.vectors import at, dot, minus, turning, vector

_SAME: Final = 1e-3  # rad; poses that differ by less are one place
_LADDER: Final = 5  # rungs from the steepest inclination down, each a quarter of the one above
_FINE: Final = 1.2  # ratio of the two inclinations between which a margin is known to lie
_QUICK: Final = 8.0  # paces by which the body may turn in one and still be followed


@compiled
def settle(
    work: Work, links: int, count: int, base: Array, slew: Slew, several: int | np.int64
) -> None:
    """Takes an assembled body from the planar pose to its targets, at rest after each step.

    Under several inclinations of gravity at once: most of the time goes into turning the joints.

    Args:
        work: Holds the body and the inclinations, and receives the poses.
        links: How many it has.
        count: How many points it has.
        base: Its main body.
        slew: How joints turn.
        several: How many inclinations there are.
    """
    tree, joint, frame, points = work.tree, work.joint, work.frame, work.points
    touch, flat, lies, rested = work.touch, work.flat, work.lies, work.rested
    lean, ups, stances = work.lean, work.up, work.stance
    mass, steps = 0.0, 0
    for link in range(links):
        mass += joint[link, MASS]
        steps = max(steps, tree[link, STEPS])
    for column in range(FRAME_COLUMNS):
        frame[0, column] = 1.0 if column in (3, 7, 11) else 0.0
    for axis in range(3):
        frame[0, 12 + axis] = base[3] * base[5 + axis]
    for each in range(several):
        for axis in range(3):
            ups[each, axis] = 1.0 if axis == 2 else 0.0
            stances[each, axis] = axis
        lies[each] = rested[each] = True
    least_cosine = math.cos(_QUICK * slew.pace)
    for step in range(steps + 1):
        x, y, z = move(step, links, tree, joint, frame, points, slew.cosines, slew.sines)
        x, y, z = x / mass, y / mass, z / mass
        for each in range(several):
            up, stance = ups[each], stances[each]
            centre = _as_if_shifted(points, up, stance[0], lean[each, 0], lean[each, 1], x, y, z)
            if lies[each]:
                lies[each] = _lies(points, count, base, centre[0], centre[1])
            if lies[each]:
                continue
            if stance[2] >= 0 and follow(points, count, centre, up, stance, least_cosine):
                continue
            if not roll(points, count, centre, up, stance, touch, flat):
                rested[each] = False


@compiled
def _as_if_shifted(
    points: Array,
    up: Array,
    foot: int,
    lean_x: float,
    lean_y: float,
    x: float,
    y: float,
    z: float,
) -> Vector:
    """Where the centre of mass acts, which is at x, y, z, of a body that stands on a foot."""
    if lean_x != 0 or lean_y != 0:
        height = points[3, foot] + up[0] * (x - points[0, foot])
        height += up[1] * (y - points[1, foot]) + up[2] * (z - points[2, foot])
        x, y = x + lean_x * height, y + lean_y * height
    return x, y, z


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
def _centre_of_mass(work: Work, links: int) -> Vector:
    """Of the body that was just settled, in the body frame, m."""
    mass = x = y = z = 0.0
    for link in range(links):
        mass += work.joint[link, MASS]
        x, y = x + work.frame[link, 12], y + work.frame[link, 13]
        z += work.frame[link, 14]
    return x / mass, y / mass, z / mass


@compiled
def right_itself(work: Work, links: int, count: int, each: int) -> None:
    """Brings a body that was settled under an inclined gravity to rest under a plumb one."""
    centre, up, stance = _centre_of_mass(work, links), work.up[each], work.stance[each]
    if not roll(work.points, count, centre, up, stance, work.touch, work.flat):
        work.rested[each] = False


@compiled
def undecided(work: Work, links: int, count: int, each: int) -> bool:
    """Whether the body that was just settled is balanced on the rim of its support."""
    points, up, stance = work.points, vector(work.up[each]), work.stance[each]
    centre = _centre_of_mass(work, links)
    if stance[2] >= 0:
        least = math.inf
        for side in range(3):
            one, two = at(points, stance[side]), at(points, stance[(side + 1) % 3])
            edge = minus(two, one)
            area = turning(up, minus(one, centre), edge)
            least = min(least, area * area / dot(edge, edge))
        if least > 4 * BALANCED * BALANCED:
            return False
    contacts = touching(points, count, centre, up, work.touch, work.flat)
    return balanced(work.flat, contacts)


@compiled
def margin(work: Work, links: int, count: int, base: Array, slew: Slew, most: float) -> float:
    """How far gravity may be inclined, in each of four directions, with the body landing alike.

    Args:
        work: Holds a body that was just settled.
        most: The largest margin told, rad.

    Returns:
        rad.
    """
    up, lean = work.up, work.lean
    up_x, up_y, up_z = up[0, 0], up[0, 1], up[0, 2]
    steepest = math.tan(most)
    good, bad, tried = 0.0, steepest, steepest
    trials = 0
    while bad > _FINE * good:
        for way in range(4):
            lean[way, 0], lean[way, 1] = 0.0, 0.0
            lean[way, way % 2] = tried if way < 2 else -tried
        settle(work, links, count, base, slew, np.int64(4))  # a plain 4 is a type of its own
        alike = True
        for way in range(4):
            away = max(abs(up[way, 0] - up_x), abs(up[way, 1] - up_y), abs(up[way, 2] - up_z))
            alike = alike and work.rested[way] and away <= _SAME
        if alike:
            good = tried
        else:
            bad = tried
        trials += 1
        if good == 0 and trials == _LADDER:
            break
        tried = math.sqrt(good * bad) if good > 0 else 0.25 * tried
    return most if good == steepest else math.atan(good)


@compiled
def gap(work: Work, link: int, up: Vector, deep: float) -> float:
    """Distance of a link's lowest point from the ground, m; 0 where it touches.

    Args:
        work: Holds a body that was just settled.
        link: Of it.
        up: World up in the body frame.
        deep: Of the settled body.
    """
    points = work.points
    least = math.inf
    for point in range(work.tree[link, FIRST], work.tree[link, END]):
        least = min(least, deep + dot(up, at(points, point)) - points[3, point])
    return 0.0 if least < TOUCHING else least
