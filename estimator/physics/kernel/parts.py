"""Trees of parts, eight bodies abreast, with the points that may touch the ground.

A part's frame has its origin where the part begins, and x along it. What it sits on is its carrier:
another part, or the main body, whose frame is number 0; that of part j is number j + 1.

A capsule on a plane is its two end spheres, a box its eight corners, of radius 0. A round main body
has points on its rims, close together where it bears and some all around; they are placed anew
where that changes. A sphere inside
the cone between two others of a straight limb never touches first and has no weight: its radius is
``NOWHERE``, as is that of every point that a body does not have where its neighbours do.

What of a part is rigid on it is its group: what one touch sensor measures.

Arrays, all of them of rows of ``LANES`` numbers, one for each body, for p parts and n points:

* ``hinges`` (p × ``HINGE_ROWS``), the constants of each part; rows below.
* ``frames`` (12 × (p + 1)): origin, then x, y and z axes, in the main body's frame.
* ``points`` (4 × n): x, y, z in the main body's frame, and radius. First come the main
  body's corners, or rims; then those of the first part, and so on, of whichever body they are.
* ``bodies`` (``BODY_ROWS``): what each body is and where; rows below.
* ``counts`` (``COUNT_ROWS``), integers: likewise.
* ``group`` (p), integers: the first part of those that are rigid on each other.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from estimator.body import geometry
from estimator.body.arrays import CENTRE, Flags, Integers
from estimator.body.arrays import ROUND as IS_ROUND
from estimator.body.morphology import Array
from estimator.body.mounts import Vector
from estimator.physics.kernel.compiling import allocating, compiled, inlined
from estimator.physics.kernel.lanes import LANES, Lanes, choose, every, load, store

ORIGIN: Final = 0  # in the carrier's frame, m; x, y and z
EAST: Final = 3  # cosine and sine of its direction there
NORTH: Final = 4
LEVEL: Final = 5  # cosine and sine of its direction's elevation
RISE: Final = 6
AXIS: Final = 7  # of its hinge; x, y, z
SIGN: Final = 10  # of its turn
TURNS: Final = 11  # steps until the hinge has reached its target
COSINE: Final = 12  # of that target
SINE: Final = 13
MASS: Final = 14  # kg
MOMENT: Final = 15  # mass times how far along its centre of mass is, kg·m
NEAR: Final = 16  # how far along its ends are, or the spheres at them, m
FAR: Final = 17
ASIDE: Final = 18  # how far aside a box's corners are, m; of a capsule 0
CARRIER: Final = 19  # number of its frame
HINGE_ROWS: Final = 20

UP: Final = 0  # world up in the main body's frame: the pose
GRAVITY: Final = 3  # how far it is inclined: tangents towards x and y
WEIGHT: Final = 5  # mass of the body, kg
BASE_MOMENT: Final = 6  # mass of the main body times its centre of mass, kg·m
HALF: Final = 9  # extents of the main body
ROUND: Final = 12  # 1: the main body is an upright cylinder; else 0
MOMENTS: Final = 13  # mass times centre of mass of the body, kg·m
MIDDLE: Final = 16  # where its mass acts
LIES: Final = 19  # 1: it still lies flat on its main body; else 0
FIRM: Final = 20  # 1: it has three contacts around the centre of mass; else 0
DEEP: Final = 21  # how far its lowest point lies below its origin, m
STEP: Final = 22  # how many steps its joints have turned, and cosine and sine of so many
STEP_COSINE: Final = 23
STEP_SINE: Final = 24
BODY_ROWS: Final = 25

STANCE: Final = 0  # three contacts around the centre of mass, points
ROW: Final = 3  # which row of the batch
AT: Final = 4  # after so many steps it is known how it rests
NEXT: Final = 5  # after so many that is looked at
STRIDE: Final = 6  # so many are taken at once
LAST: Final = 7  # so many bring all its joints to their targets
RESTS: Final = 8  # 1: it came to rest each time; else 0
COUNT_ROWS: Final = 9

FRAME_ROWS: Final = 12
POINT_ROWS: Final = 4
CORNERS: Final = 8
NOWHERE: Final = -1e30

_CLOSE: Final = tuple(math.radians(0.35 * 2**step) for step in range(5))
_AROUND: Final = tuple(math.radians(15.0 * step) for step in range(1, 12))
_TURNS: Final = (
    *(0.0, math.pi),
    *(side * turn for turn in (*_CLOSE, *_AROUND) for side in (1.0, -1.0)),
)
_COSINES: Final = tuple(map(math.cos, _TURNS))
_SINES: Final = tuple(map(math.sin, _TURNS))
RIM: Final = len(_TURNS)
"""Points of a rim: where it bears, and others at these turns from there; not tuned."""

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
    zero: Array
    travel: Array
    base: Array
    base_mounts: Array
    part_mounts: Array
    hinges: Array


class Slew(NamedTuple):
    """How joints turn.

    Attributes:
        pace: In one step, rad.
        stride: Steps that are taken at once while nothing happens.
        reach: In all, at most, rad.
        cosines: Cosine of the angle after each number of steps.
        sines: Sine of it.
    """

    pace: float
    stride: int
    reach: float
    cosines: Array
    sines: Array


class Work(NamedTuple):
    """Work space for ``LANES`` bodies at a time; see above.

    Attributes:
        main: Points of the main body, at most; more than ``CORNERS``: some are round.
        first: Of each part, its first point.
        end: To before here.
        boxed: Whether it may be a box.
        carries: Whether a part may sit on it.
        carriers: Frames that it may sit on, of which there are ``several``.
        lowest: How far each part's lowest point lies below the body's origin, m.
        one: Points of one body, which is picked out to roll: x, y, z, radius. The following belong
            to it: ``touch`` and ``flat`` to ``touching``, ``above`` with each group's gap to the
            ground, and its pose.
    """

    hinges: Array
    frames: Array
    points: Array
    bodies: Array
    counts: Integers
    group: Integers
    main: int
    first: Integers
    end: Integers
    boxed: Flags
    carries: Flags
    carriers: Integers
    several: Integers
    lowest: Array
    one: Array
    touch: Integers
    flat: Array
    above: Array
    pose: Array
    stance: Integers


@allocating
def work_space(trees: Trees, which: Integers, start: int, end: int) -> Work:
    """Room for some of the bodies."""
    parts = trees.parent.shape[1]
    boxed = np.zeros(parts, np.bool_)
    main = CORNERS
    for row in range(start, end):
        if trees.base[which[row], IS_ROUND] > 0:
            main = 2 * RIM
        for part in range(parts):
            boxed[part] |= trees.box[which[row], part]
    firsts, ends, points = np.zeros(parts, np.int64), np.zeros(parts, np.int64), main
    for part in range(parts):
        firsts[part] = points
        points += CORNERS if boxed[part] else 2
        ends[part] = points
    work = Work(
        np.zeros((parts * HINGE_ROWS, LANES)),
        np.zeros(((parts + 1) * FRAME_ROWS, LANES)),
        np.zeros((points * POINT_ROWS, LANES)),
        np.zeros((BODY_ROWS, LANES)),
        np.zeros((COUNT_ROWS, LANES), np.int64),
        np.zeros((parts, LANES), np.int64),
        main,
        firsts,
        ends,
        boxed,
        np.zeros(parts, np.bool_),
        np.zeros((parts, parts + 1), np.int64),
        np.zeros(parts, np.int64),
        np.zeros((parts, LANES)),
        np.zeros((POINT_ROWS, points)),
        np.zeros(points, np.int64),
        np.zeros((2, points)),
        np.zeros(parts),
        np.zeros(3),
        np.zeros(3, np.int64),
    )
    for axis in range(3):
        work.frames[3 + 4 * axis] = 1.0
    return work


@inlined
def board(trees: Trees, row: int, program: Array, slew: Slew, work: Work, lane: int) -> None:
    """Puts a body into a lane.

    Args:
        trees: Where the body is.
        row: Its row there.
        program: Angle that each motor is told, rad.
        slew: How joints turn.
        work: Receives the body.
        lane: Of it.
    """
    base, bodies, points = trees.base[row], work.bodies, work.points
    mass, last = base[3], 0
    for axis in range(3):
        bodies[HALF + axis, lane] = 0.5 * base[axis]
        bodies[BASE_MOMENT + axis, lane] = base[3] * base[CENTRE + axis]
    bodies[ROUND, lane] = base[IS_ROUND]
    _set_corners(work, lane)
    for part in range(trees.parent.shape[1]):
        if part < trees.parts[row]:
            weight, steps = _board_part(trees, row, part, program, slew, work, lane)
            mass += weight
            last = max(last, steps)
        else:
            for number in range(HINGE_ROWS):
                work.hinges[part * HINGE_ROWS + number, lane] = 0.0
            for point in range(work.first[part], work.end[part]):
                points[POINT_ROWS * point + 3, lane] = NOWHERE
    bodies[WEIGHT, lane] = mass
    work.counts[LAST, lane] = last


@inlined
def target_of(trees: Trees, row: int, part: int, program: Array) -> float:
    """Where the hinge of a part goes, rad."""
    target, motor = 0.0, trees.motor[row, part]
    if motor >= 0:
        target = trees.travel[row, part] * program[motor] + trees.zero[row, part]
    return target


@inlined
def _board_part(
    trees: Trees, row: int, part: int, program: Array, slew: Slew, work: Work, lane: int
) -> tuple[float, int]:
    """Puts one part of a body into a lane; returns its mass, kg, and the steps of its hinge."""
    on, where, motor = trees.parent[row, part], trees.mount[row, part], trees.motor[row, part]
    length, radius, box = trees.length[row, part], trees.radius[row, part], trees.box[row, part]
    hinges, first = work.hinges, part * HINGE_ROWS
    if on < 0:
        mount = trees.base_mounts[where]
        x, y, z = mount[0], mount[1], mount[2]
        east, north, level, rise = mount[3], mount[4], mount[5], mount[6]
    else:
        mount = trees.part_mounts[where]
        x, y, z = mount[0] * trees.length[row, on], 0.0, 0.0
        east, north, level, rise = mount[1], mount[2], mount[3], mount[4]
        work.carries[on] = True
    _note_carrier(work, part, on + 1)
    rigid = on >= 0 and motor < 0
    work.group[part, lane] = work.group[on, lane] if rigid else part
    target = target_of(trees, row, part, program)
    angle = min(abs(target), slew.reach)
    steps = math.ceil(angle / slew.pace - 1e-9)
    sign = -1.0 if target < 0 else 1.0
    axis = trees.hinges[trees.hinge[row, part]]
    axis_x, axis_y, axis_z = axis[0], axis[1], axis[2]
    hinges[first + ORIGIN, lane], hinges[first + ORIGIN + 1, lane] = x, y
    hinges[first + ORIGIN + 2, lane] = z
    hinges[first + EAST, lane], hinges[first + NORTH, lane] = east, north
    hinges[first + LEVEL, lane], hinges[first + RISE, lane] = level, rise
    hinges[first + AXIS, lane], hinges[first + AXIS + 1, lane] = axis_x, axis_y
    hinges[first + AXIS + 2, lane], hinges[first + SIGN, lane] = axis_z, sign
    near, far = _ends(length, radius, box)
    mass = trees.density[row, part] * _volume(far - near, radius, box)
    hinges[first + MASS, lane], hinges[first + MOMENT, lane] = mass, mass * 0.5 * (near + far)
    hinges[first + NEAR, lane], hinges[first + FAR, lane] = near if box else 0.0, far
    hinges[first + ASIDE, lane], hinges[first + CARRIER, lane] = radius if box else 0.0, on + 1
    hinges[first + TURNS, lane] = steps
    hinges[first + COSINE, lane], hinges[first + SINE, lane] = (
        math.cos(angle),
        sign * math.sin(angle),
    )
    start = work.first[part]
    if box:
        for point in range(start, start + CORNERS):
            work.points[POINT_ROWS * point + 3, lane] = 0.0
        return mass, steps
    two = far > 0.0  # spheres
    # and, from the carrier's far end, onward
    straight = rigid and mount[0] == 1.0 and east == 1.0 and level == 1.0
    if two and straight and not trees.box[row, on]:
        thick = trees.radius[row, on]
        if trees.length[row, on] >= thick:
            share = thick / (thick + far)  # of the way from the parent's far end
            two = radius > thick + (radius - thick) * share
    work.points[POINT_ROWS * start + 3, lane] = radius if two else NOWHERE
    work.points[POINT_ROWS * start + 7, lane] = radius
    for point in range(start + 2, work.end[part]):
        work.points[POINT_ROWS * point + 3, lane] = NOWHERE
    return mass, steps


@inlined
def board_again(work: Work, lane: int, other: int) -> None:
    """Puts the body of another lane into a lane, and its motor program."""
    for row in range(len(work.hinges)):
        work.hinges[row, lane] = work.hinges[row, other]
    for part in range(len(work.group)):
        work.group[part, lane] = work.group[part, other]
    for point in range(work.one.shape[1]):
        work.points[POINT_ROWS * point + 3, lane] = work.points[POINT_ROWS * point + 3, other]
    for row in range(WEIGHT, ROUND + 1):
        work.bodies[row, lane] = work.bodies[row, other]
    _set_corners(work, lane)
    work.counts[LAST, lane] = work.counts[LAST, other]


@inlined
def _set_corners(work: Work, lane: int) -> None:
    """Puts the main body's corners where they are, or its rims anywhere."""
    points, several = work.points, work.main > CORNERS
    if several:
        is_round = work.bodies[ROUND, lane] > 0
        for point in range(work.main):
            points[POINT_ROWS * point + 3, lane] = 0.0 if is_round or point < CORNERS else NOWHERE
        if is_round:
            place_rims(work, lane, 1.0, 0.0)
            return
    for axis in range(3):
        half = work.bodies[HALF + axis, lane]
        if several or points[axis, lane] != -half:  # else the body before was as large
            for corner in range(CORNERS):
                points[POINT_ROWS * corner + axis, lane] = half if corner >> axis & 1 else -half


@inlined
def place_rims(work: Work, lane: int, x: float, y: float) -> None:
    """Gives a round main body the points of its rims, closest together in one direction.

    Args:
        work: Holds the body.
        lane: Of it.
        x: Of the direction, in the main body's frame; a unit vector.
        y: Of it.
    """
    radius, half = work.bodies[HALF, lane], work.bodies[HALF + 2, lane]
    for point in range(2 * RIM):
        cosine, sine = _COSINES[point % RIM], _SINES[point % RIM]
        first = POINT_ROWS * point
        work.points[first, lane] = radius * (x * cosine - y * sine)
        work.points[first + 1, lane] = radius * (y * cosine + x * sine)
        work.points[first + 2, lane] = -half if point < RIM else half


@inlined
def _note_carrier(work: Work, part: int, carrier: int) -> None:
    """Notes that a part may sit on a frame."""
    for number in range(work.several[part]):
        if work.carriers[part, number] == carrier:
            return
    work.carriers[part, work.several[part]] = carrier
    work.several[part] += 1


@inlined
def move(work: Work) -> None:
    """Turns all joints to where they are after the bodies' steps."""
    hinges, frames, points, bodies = work.hinges, work.frames, work.points, work.bodies
    step, step_cosine = load(bodies, STEP), load(bodies, STEP_COSINE)
    step_sine = load(bodies, STEP_SINE)
    for axis in range(3):
        store(bodies, MOMENTS + axis, load(bodies, BASE_MOMENT + axis))
    for part in range(len(work.first)):
        at = part * HINGE_ROWS
        turning = step < load(hinges, at + TURNS)
        cosine = choose(turning, step_cosine, load(hinges, at + COSINE))
        sine = choose(turning, step_sine * load(hinges, at + SIGN), load(hinges, at + SINE))
        x, y, z = load(hinges, at), load(hinges, at + 1), load(hinges, at + 2)
        east, north = load(hinges, at + EAST), load(hinges, at + NORTH)
        level, rise = load(hinges, at + LEVEL), load(hinges, at + RISE)
        about = load(hinges, at + AXIS), load(hinges, at + AXIS + 1), load(hinges, at + AXIS + 2)
        ahead_x, left_x, over_x = _turned(
            level * east, -1.0 * north, -1.0 * rise * east, about, cosine, sine
        )
        ahead_y, left_y, over_y = _turned(
            level * north, east, -1.0 * rise * north, about, cosine, sine
        )
        ahead_z, left_z, over_z = _turned(rise, every(0.0), level, about, cosine, sine)
        mass, moment = load(hinges, at + MASS), load(hinges, at + MOMENT)
        near, far = load(hinges, at + NEAR), load(hinges, at + FAR)
        aside, carrier = load(hinges, at + ASIDE), load(hinges, at + CARRIER)
        boxed, whole = work.boxed[part], work.boxed[part] or work.carries[part]
        own, start = (part + 1) * FRAME_ROWS, work.first[part]
        for way in range(3):
            other = work.carriers[part, 0]
            frame = other * FRAME_ROWS + way
            origin, east = load(frames, frame), load(frames, frame + 3)
            north, rise = load(frames, frame + 6), load(frames, frame + 9)
            for number in range(1, work.several[part]):
                other = work.carriers[part, number]
                frame = other * FRAME_ROWS + way
                here = carrier == float(other)
                origin = choose(here, load(frames, frame), origin)
                east = choose(here, load(frames, frame + 3), east)
                north = choose(here, load(frames, frame + 6), north)
                rise = choose(here, load(frames, frame + 9), rise)
            origin = origin + x * east + y * north + z * rise
            ahead = ahead_x * east + ahead_y * north + ahead_z * rise
            total = load(bodies, MOMENTS + way)
            store(bodies, MOMENTS + way, total + (mass * origin + moment * ahead))
            if whole:
                left = left_x * east + left_y * north + left_z * rise
                over = over_x * east + over_y * north + over_z * rise
                store(frames, own + way, origin)
                store(frames, own + 3 + way, ahead)
                store(frames, own + 6 + way, left)
                store(frames, own + 9 + way, over)
                if boxed:
                    beside, above = aside * left, aside * over
                    one, two = origin + near * ahead, origin + far * ahead
                    for quarter in range(4):
                        across = beside if quarter & 1 else -1.0 * beside
                        corner = across + (above if quarter & 2 else -1.0 * above)
                        point = POINT_ROWS * (start + 2 * quarter) + way
                        store(points, point, one + corner)
                        store(points, point + POINT_ROWS, two + corner)
            if not boxed:
                store(points, POINT_ROWS * start + way, origin)
                store(points, POINT_ROWS * start + POINT_ROWS + way, origin + far * ahead)


@compiled
def _turned(
    x: Lanes, y: Lanes, z: Lanes, about: Vector, cosine: Lanes, sine: Lanes
) -> tuple[Lanes, Lanes, Lanes]:
    """One coordinate of three axes after a turn about an axis given by them (Rodrigues)."""
    along = (1.0 - cosine) * (about[0] * x + about[1] * y + about[2] * z)
    return (
        cosine * x + sine * (about[2] * y - about[1] * z) + along * about[0],
        cosine * y + sine * (about[0] * z - about[2] * x) + along * about[1],
        cosine * z + sine * (about[1] * x - about[0] * y) + along * about[2],
    )


@inlined
def pick_out(work: Work, lane: int) -> None:
    """Copies the points of one lane's body to ``one``, where a loop over them is quick."""
    one, points = work.one, work.points
    for point in range(one.shape[1]):
        for number in range(POINT_ROWS):
            one[number, point] = points[POINT_ROWS * point + number, lane]
