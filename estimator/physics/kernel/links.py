"""A tree of parts as rigid links, and where their points are at each step of the slew.

Parts joined by locked hinges move as one link, so a link is what one touch sensor feels. Link 0 is
the main body; every other has its frame where its first part has it. Locked parts point along one
of the link's four directions in its own plane z = 0, so each of its points is two numbers.

A capsule on a plane is its two end spheres. A sphere inside the cone between two others of its
link never touches first and is left out: so a straight leg of two parts has three.

Arrays, for at most n parts:

* ``tree`` (n + 1, 7), integers, and ``joint`` (n + 1, 9), one row per link; columns below.
* ``frame`` (n + 1, 15): origin, then the x, y and z axes, in the body frame; then mass times
  centre of mass.
* ``points`` (6, 8 + 2 n): x, y, z in the body frame, radius, then the two numbers within the link.
  The first eight are the main body's corners.
* ``place`` (n, 2), integers: link of each part and its quarter turns in it; ``at`` (n, 2): where
  in the link's plane it begins.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from estimator.body.arrays import Integers
from estimator.body.morphology import Array
from estimator.physics.kernel.compiling import compiled

PARENT: Final = 0  # link it sits on
TURNS: Final = 1  # quarter turns to the left, seen from its parent
HINGE: Final = 2
FIRST: Final = 3  # its points, from here
END: Final = 4  # to before here
OWN_STEPS: Final = 5  # steps until its own hinge has reached its target
STEPS: Final = 6  # steps until it moves no more
TREE_COLUMNS: Final = 7

X: Final = 0  # where in its parent's plane it sits, m
Y: Final = 1
SIGN: Final = 2  # of its hinge's target
ANGLE: Final = 3  # size of its hinge's target, rad
COSINE: Final = 4
SINE: Final = 5
MASS: Final = 6  # kg
MOMENT_X: Final = 7  # mass times centre of mass within the link, kg·m
MOMENT_Y: Final = 8
JOINT_COLUMNS: Final = 9

FRAME_COLUMNS: Final = 15
POINT_ROWS: Final = 6
CORNERS: Final = 8

_TURNS = np.array([1, 0, 3, 2])  # by side: left, front, right, back
_ALONG = np.array([0.5, 1.0, 0.5, 0.0])  # of the parent's length, by side
_EAST = np.array([1.0, 0.0, -1.0, 0.0])  # x of the direction after so many quarter turns
_NORTH = np.array([0.0, 1.0, 0.0, -1.0])


@compiled
def assemble(
    parent: Integers,
    side: Integers,
    hinge: Integers,
    motor: Integers,
    length: Array,
    radius: Array,
    base: Array,
    program: Array,
    reach: float,
    pace: float,
    tree: Integers,
    joint: Array,
    points: Array,
    place: Integers,
    at: Array,
) -> tuple[int, int]:
    """Joins parts to links.

    Args:
        parent: Of each part, and so on; see ``Bodies``.
        base: Extent along x, y, z, mass, density of the parts.
        program: Angle of each motor, rad.
        reach: How far a joint can turn, rad.
        pace: How far it turns in one step, rad.

    Returns:
        Number of links and of points.
    """
    links, ends = 1, CORNERS
    tree[0, STEPS] = 0
    joint[0, MASS] = base[3]
    for part in range(len(parent)):
        on, facing = parent[part], side[part]
        if on < 0:
            carrier, turns = 0, _TURNS[facing]
            x, y = 0.5 * base[0] * _EAST[turns], 0.5 * base[1] * _NORTH[turns]
        else:
            carrier, heading = place[on, 0], place[on, 1]
            along = _ALONG[facing] * length[on]
            x, y = at[on, 0] + along * _EAST[heading], at[on, 1] + along * _NORTH[heading]
            turns = (heading + _TURNS[facing]) & 3
        link = carrier
        if on < 0 or motor[part] >= 0:
            link = links
            links += 1
            target = program[motor[part]] if motor[part] >= 0 else 0.0
            angle = min(abs(target), reach)
            tree[link, PARENT], tree[link, TURNS], tree[link, HINGE] = carrier, turns, hinge[part]
            tree[link, END] = 0
            tree[link, OWN_STEPS] = math.ceil(angle / pace - 1e-9)
            tree[link, STEPS] = max(tree[link, OWN_STEPS], tree[carrier, STEPS])
            joint[link, X], joint[link, Y] = x, y
            joint[link, SIGN], joint[link, ANGLE] = -1.0 if target < 0 else 1.0, angle
            joint[link, COSINE], joint[link, SINE] = math.cos(angle), math.sin(angle)
            joint[link, MASS] = joint[link, MOMENT_X] = joint[link, MOMENT_Y] = 0.0
            x, y, turns = 0.0, 0.0, 0
        place[part, 0], place[part, 1] = link, turns
        at[part, 0], at[part, 1] = x, y
        far = length[part] - radius[part]
        near = min(0.0, far)
        size = math.pi * radius[part] ** 2 * (far - near + 4 / 3 * radius[part])
        mass, middle = base[4] * size, 0.5 * (near + far)
        joint[link, MASS] += mass
        joint[link, MOMENT_X] += mass * (x + middle * _EAST[turns])
        joint[link, MOMENT_Y] += mass * (y + middle * _NORTH[turns])
        tree[link, END] += 1  # for now, how many parts
    for link in range(1, links):
        tree[link, FIRST] = ends
        ends += 2 * tree[link, END]
        tree[link, END] = tree[link, FIRST]
    for corner in range(CORNERS):
        points[0, corner] = base[0] * (0.5 if corner & 1 else -0.5)
        points[1, corner] = base[1] * (0.5 if corner & 2 else -0.5)
        points[2, corner] = base[2] * (0.5 if corner & 4 else -0.5)
        points[3, corner] = 0.0
    for part in range(len(parent)):
        link, turns = place[part, 0], place[part, 1]
        thick, far = radius[part], length[part] - radius[part]
        end, on = tree[link, END], parent[part]
        near = far > 0.0
        if near and on >= 0 and motor[part] < 0 and side[part] == 1 and length[on] >= radius[on]:
            share = radius[on] / (radius[on] + far)  # of the way from the parent's far end
            near = thick > radius[on] + (thick - radius[on]) * share
        if near:
            points[3, end], points[4, end], points[5, end] = thick, at[part, 0], at[part, 1]
            end += 1
        points[3, end] = thick
        points[4, end] = at[part, 0] + far * _EAST[turns]
        points[5, end] = at[part, 1] + far * _NORTH[turns]
        tree[link, END] = end + 1
    count = CORNERS
    for link in range(1, links):
        first, end = tree[link, FIRST], tree[link, END]
        tree[link, FIRST] = count
        for old in range(first, end):
            for row in range(3, POINT_ROWS):
                points[row, count] = points[row, old]
            count += 1
        tree[link, END] = count
    return links, count


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
    total_x = total_y = total_z = 0.0
    for link in range(1, links):
        if step <= tree[link, STEPS]:
            on, turns, hinge = tree[link, PARENT], tree[link, TURNS], tree[link, HINGE]
            x, y, mass = joint[link, X], joint[link, Y], joint[link, MASS]
            moment_x, moment_y = joint[link, MOMENT_X], joint[link, MOMENT_Y]
            east, north = _EAST[turns], _NORTH[turns]
            if step < tree[link, OWN_STEPS]:
                cosine, sine = cosines[step], sines[step] * joint[link, SIGN]
            else:
                cosine, sine = joint[link, COSINE], joint[link, SINE] * joint[link, SIGN]
            if hinge & 1:  # the second of each pair turns the other way
                sine = -sine
            for row in range(3):
                origin = frame[on, row] + x * frame[on, 3 + row] + y * frame[on, 6 + row]
                ahead = east * frame[on, 3 + row] + north * frame[on, 6 + row]
                left = east * frame[on, 6 + row] - north * frame[on, 3 + row]
                over = frame[on, 9 + row]
                if hinge < 2:  # yaw
                    ahead, left = cosine * ahead + sine * left, cosine * left - sine * ahead
                elif hinge < 4:  # pitch
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
                    points[row, point] = origin + across
        total_x += frame[link, 12]
        total_y += frame[link, 13]
        total_z += frame[link, 14]
    return total_x, total_y, total_z
