"""A tree of parts as rigid links, with the points that may touch the ground.

Parts joined by locked hinges move as one link. Link 0 is the main body; every other has its frame
where its first part has it. Locked parts lie in the link's own plane z = 0; one that rises out of
it begins a link of its own, in the same group. A group is what one touch sensor measures.

A capsule on a plane is its two end spheres, a box its eight corners, of radius 0. A sphere inside
the cone between two others of its link never touches first and is left out: so a straight leg of
two capsules has three.

Arrays, for at most n parts:

* ``tree`` (n + 1, 7), integers, and ``joint`` (n + 1, 17), one row per link; columns below.
* ``frame`` (n + 1, 15): origin, then the x, y and z axes, in the body frame; then mass times
  centre of mass.
* ``points`` (7, 8 + 8 n): x, y, z in the body frame, radius, then x, y, z in the link's frame. The
  first eight are the main body's corners.
* ``place`` (n,), integers: link of each part; ``at`` (n, 4): where in the link's plane it begins,
  then cosine and sine of its direction there.
* one row per inclination of gravity under which the body is followed: ``gravity`` (16, 2), tangents
  towards x and y; ``up`` (16, 3), world up in the body frame, and ``stance`` (16, 3), three
  contacts around the centre of mass: the pose; ``lies`` and ``rested`` (16,), whether it still lies
  flat, and whether it came to rest each time.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from estimator.body import geometry
from estimator.body.arrays import Flags, Integers
from estimator.body.morphology import Array
from estimator.physics.kernel.compiling import allocating, compiled

PARENT: Final = 0  # link it sits on
TURN: Final = 1  # about which axis it turns: one of the four below
FIRST: Final = 2  # its points, from here
END: Final = 3  # to before here
OWN_STEPS: Final = 4  # steps until its own hinge has reached its target
STEPS: Final = 5  # steps until it moves no more
GROUP: Final = 6  # the first link of those that are rigid on each other
TREE_COLUMNS: Final = 7

YAW: Final = 0
PITCH: Final = 1
ROLL: Final = 2
FREE: Final = 3  # about any axis, on any mount

X: Final = 0  # where in its parent's frame it sits, m
Y: Final = 1
Z: Final = 2
EAST: Final = 3  # cosine and sine of its direction there
NORTH: Final = 4
SIGN: Final = 5  # of its turn
ANGLE: Final = 6  # size of its hinge's target, rad
COSINE: Final = 7
SINE: Final = 8
MASS: Final = 9  # kg
MOMENT_X: Final = 10  # mass times centre of mass within the link, kg·m
MOMENT_Y: Final = 11
AXIS: Final = 12  # of its hinge; x, y, z
LEVEL: Final = 15  # cosine and sine of its direction's elevation
RISE: Final = 16
JOINT_COLUMNS: Final = 17

FRAME_COLUMNS: Final = 15
POINT_ROWS: Final = 7
CORNERS: Final = 8
TOGETHER: Final = 16
"""Inclinations of gravity under which one body is followed at once."""


_ends: Final = compiled(geometry.ends)
_volume: Final = compiled(geometry.volume)


class Trees(NamedTuple):
    """The arrays of ``Bodies`` that the kernel reads, under their names but for its ``count``."""

    parts: Integers
    parent: Integers
    mount: Integers
    hinge: Integers
    motor: Integers
    sensor: Integers
    length: Array
    radius: Array
    density: Array
    box: Flags
    base: Array
    base_mounts: Array
    part_mounts: Array
    hinges: Array


class Slew(NamedTuple):
    """How joints turn.

    Attributes:
        pace: In one step, rad.
        reach: In all, at most, rad.
        cosines: Cosine of the angle after each number of steps.
        sines: Sine of it.
    """

    pace: float
    reach: float
    cosines: Array
    sines: Array


class Work(NamedTuple):
    """Work space for one body after another; see above."""

    tree: Integers
    joint: Array
    frame: Array
    points: Array
    place: Integers
    at: Array
    touch: Integers
    flat: Array
    gravity: Array
    up: Array
    stance: Integers
    lies: Flags
    rested: Flags


@allocating
def work_space(parts: int) -> Work:
    """Room for bodies of so many parts."""
    points = CORNERS * (1 + parts)
    return Work(
        np.zeros((parts + 1, TREE_COLUMNS), np.int64),
        np.zeros((parts + 1, JOINT_COLUMNS)),
        np.zeros((parts + 1, FRAME_COLUMNS)),
        np.zeros((POINT_ROWS, points)),
        np.zeros(parts, np.int64),
        np.zeros((parts, 4)),
        np.zeros(points, np.int64),
        np.zeros((2, points)),
        np.zeros((TOGETHER, 2)),
        np.zeros((TOGETHER, 3)),
        np.zeros((TOGETHER, 3), np.int64),
        np.zeros(TOGETHER, np.bool_),
        np.zeros(TOGETHER, np.bool_),
    )


@compiled
def assemble(trees: Trees, row: int, program: Array, slew: Slew, work: Work) -> int:
    """Joins parts to links.

    Args:
        trees: Where the body is.
        row: Its row there.
        program: Angle of each motor, rad.
        slew: How joints turn.
        work: Receives the body.

    Returns:
        Number of links.
    """
    parent, mount, hinge = trees.parent[row], trees.mount[row], trees.hinge[row]
    motor, length, radius = trees.motor[row], trees.length[row], trees.radius[row]
    density, box = trees.density[row], trees.box[row]
    base, base_mounts, part_mounts = trees.base[row], trees.base_mounts, trees.part_mounts
    tree, joint, place, at = work.tree, work.joint, work.place, work.at
    hinges, parts = trees.hinges, trees.parts[row]
    links = 1
    tree[0, STEPS] = 0
    joint[0, MASS] = base[3]
    for part in range(parts):
        on, where = parent[part], mount[part]
        if on < 0:
            carrier, z = 0, base_mounts[where, 2]
            x, y = base_mounts[where, 0], base_mounts[where, 1]
            east, north = base_mounts[where, 3], base_mounts[where, 4]
            level, rise = base_mounts[where, 5], base_mounts[where, 6]
        else:
            carrier, z = place[on], 0.0
            ahead, left = at[on, 2], at[on, 3]
            along = part_mounts[where, 0] * length[on]
            x, y = at[on, 0] + along * ahead, at[on, 1] + along * left
            cosine, sine = part_mounts[where, 1], part_mounts[where, 2]
            level, rise = part_mounts[where, 3], part_mounts[where, 4]
            east, north = ahead * cosine - left * sine, left * cosine + ahead * sine
        link = carrier
        if on < 0 or motor[part] >= 0 or level != 1.0:
            link = links
            rigid = on >= 0 and motor[part] < 0
            tree[link, GROUP] = tree[carrier, GROUP] if rigid else link
            links += 1
            target = program[motor[part]] if motor[part] >= 0 else 0.0
            angle = min(abs(target), slew.reach)
            tree[link, PARENT], tree[link, END] = carrier, 0
            tree[link, OWN_STEPS] = math.ceil(angle / slew.pace - 1e-9)
            tree[link, STEPS] = max(tree[link, OWN_STEPS], tree[carrier, STEPS])
            joint[link, X], joint[link, Y], joint[link, Z] = x, y, z
            joint[link, EAST], joint[link, NORTH] = east, north
            joint[link, LEVEL], joint[link, RISE] = level, rise
            how, planar = hinge[part], z == 0.0 and level == 1.0
            tree[link, TURN], sign = _turn(hinges[how, 0], hinges[how, 1], hinges[how, 2], planar)
            joint[link, AXIS], joint[link, AXIS + 1] = hinges[how, 0], hinges[how, 1]
            joint[link, AXIS + 2] = hinges[how, 2]
            joint[link, SIGN], joint[link, ANGLE] = -sign if target < 0 else sign, angle
            joint[link, COSINE], joint[link, SINE] = math.cos(angle), math.sin(angle)
            joint[link, MASS] = joint[link, MOMENT_X] = joint[link, MOMENT_Y] = 0.0
            x, y, east, north = 0.0, 0.0, 1.0, 0.0
        place[part] = link
        at[part, 0], at[part, 1], at[part, 2], at[part, 3] = x, y, east, north
        near, far = _ends(length[part], radius[part], box[part])
        mass = density[part] * _volume(far - near, radius[part], box[part])
        middle = 0.5 * (near + far)
        joint[link, MASS] += mass
        joint[link, MOMENT_X] += mass * (x + middle * east)
        joint[link, MOMENT_Y] += mass * (y + middle * north)
        tree[link, END] += 1  # for now, how many parts
    return links


@compiled
def list_points(trees: Trees, row: int, links: int, work: Work) -> int:
    """Lists the points of an assembled body, link by link.

    Args:
        trees: Where the body is.
        row: Its row there.
        links: How many ``assemble`` made of it.
        work: Holds the links, and receives the points.

    Returns:
        How many there are.
    """
    parent, mount, motor = trees.parent[row], trees.mount[row], trees.motor[row]
    length, radius, box = trees.length[row], trees.radius[row], trees.box[row]
    base = trees.base[row]
    tree, points, place, at = work.tree, work.points, work.place, work.at
    part_mounts, parts = trees.part_mounts, trees.parts[row]
    ends = CORNERS
    for link in range(1, links):
        tree[link, FIRST] = ends
        ends += CORNERS * tree[link, END]
        tree[link, END] = tree[link, FIRST]
    for corner in range(CORNERS):
        points[0, corner] = base[0] * (0.5 if corner & 1 else -0.5)
        points[1, corner] = base[1] * (0.5 if corner & 2 else -0.5)
        points[2, corner] = base[2] * (0.5 if corner & 4 else -0.5)
        points[3, corner] = 0.0
    for part in range(parts):
        link, where = place[part], mount[part]
        thick, end, on = radius[part], tree[link, END], parent[part]
        near, far = _ends(length[part], thick, box[part])
        if box[part]:
            for corner in range(CORNERS):
                along = far if corner & 1 else near
                aside = thick if corner & 2 else -thick
                points[3, end] = 0.0
                points[4, end] = at[part, 0] + along * at[part, 2] - aside * at[part, 3]
                points[5, end] = at[part, 1] + along * at[part, 3] + aside * at[part, 2]
                points[6, end] = thick if corner & 4 else -thick
                end += 1
            tree[link, END] = end
            continue
        two = far > 0.0  # spheres
        straight = on >= 0 and motor[part] < 0  # and, from the carrier's far end, onward
        straight = straight and part_mounts[where, 0] == 1.0 and part_mounts[where, 1] == 1.0
        if two and straight and length[on] >= radius[on] and not box[on]:
            share = radius[on] / (radius[on] + far)  # of the way from the parent's far end
            two = thick > radius[on] + (thick - radius[on]) * share
        if two:
            points[3, end], points[4, end], points[5, end] = thick, at[part, 0], at[part, 1]
            points[6, end] = 0.0
            end += 1
        points[3, end] = thick
        points[4, end] = at[part, 0] + far * at[part, 2]
        points[5, end] = at[part, 1] + far * at[part, 3]
        points[6, end] = 0.0
        tree[link, END] = end + 1
    count = CORNERS
    for link in range(1, links):
        first, end = tree[link, FIRST], tree[link, END]
        tree[link, FIRST] = count
        for old in range(first, end):
            for number in range(3, POINT_ROWS):
                points[number, count] = points[number, old]
            count += 1
        tree[link, END] = count
    return count


@compiled
def _turn(x: float, y: float, z: float, planar: bool) -> tuple[int, float]:
    """About which axis of its frame a hinge turns, and the sign of the turn there.

    Args:
        x: Of its axis, a unit vector.
        y: Of its axis.
        z: Of its axis.
        planar: Whether its mount lies, and points, in the plane of its carrier.
    """
    if planar:
        if abs(z) == 1.0:
            return YAW, z
        if abs(y) == 1.0:
            return PITCH, -y
        if abs(x) == 1.0:
            return ROLL, -x
    return FREE, 1.0


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
        cosines: Cosine of the angle after each number of steps.
        sines: Sine of it.

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
