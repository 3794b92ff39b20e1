"""The arrays that the kernel works in, for eight bodies abreast.

All of them have rows of ``LANES`` numbers, one for each body, for p parts and n points:

* ``hinges`` (p × ``HINGE_ROWS``), the constants of each part; rows below.
* ``frames`` (12 × (p + 1)): origin, then x, y and z axes, in the main body's frame.
* ``points`` (4 × n): x, y, z in the main body's frame, and radius. First come the main
  body's corners, or rims; then those of the first part, and so on, in the same rows for all bodies.
* ``bodies`` (``BODY_ROWS``): what each body is and where; rows below.
* ``counts`` (``COUNT_ROWS``), integers: where each body is on its way; rows below.
* ``group`` (p), integers: the first part of each part's group of parts rigid on each other.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from estimator.body.arrays import ROUND as IS_ROUND
from estimator.body.arrays import Flags, Integers
from estimator.body.morphology import Array
from estimator.physics.kernel.compiling import allocating
from estimator.physics.kernel.lanes import LANES

ORIGIN: Final = 0  # origin of the part's frame in the carrier's, m; x, y and z
EAST: Final = 3  # cosine and sine of its direction's yaw there
NORTH: Final = 4
LEVEL: Final = 5  # cosine and sine of its direction's elevation
RISE: Final = 6
AXIS: Final = 7  # axis of its hinge; x, y, z
SIGN: Final = 10  # sign of its hinge's turn
TURNS: Final = 11  # steps until the hinge has reached its target
COSINE: Final = 12  # cosine and sine of the angle reached then
SINE: Final = 13
MASS: Final = 14  # mass of the part, kg
MOMENT: Final = 15  # mass times position of the centre of mass along the part, kg·m
NEAR: Final = 16  # positions of its ends along the part, or of the spheres there, m
FAR: Final = 17
ASIDE: Final = 18  # half the width of a box, m; 0 for a capsule
CARRIER: Final = 19  # number of the carrier's frame
HINGE_ROWS: Final = 20

UP: Final = 0  # world up in the main body's frame: the pose
GRAVITY: Final = 3  # how far gravity is inclined: tangents towards x and y
WEIGHT: Final = 5  # mass of the body, kg
BASE_MOMENT: Final = 6  # mass of the main body times its centre of mass, kg·m
HALF: Final = 9  # half the extents of the main body, m; x, y and z
ROUND: Final = 12  # 1: the main body is an upright cylinder; else 0
MOMENTS: Final = 13  # mass times centre of mass of the body, kg·m
MIDDLE: Final = 16  # where the body's mass acts, m
LIES: Final = 19  # 1: the body still lies flat on its main body; else 0
FIRM: Final = 20  # 1: the body has three contacts around the centre of mass; else 0
DEEP: Final = 21  # how far the body's lowest point lies below its origin, m
STEP: Final = 22  # steps that its joints have turned, and cosine and sine of the angle then
STEP_COSINE: Final = 23
STEP_SINE: Final = 24
BODY_ROWS: Final = 25

STANCE: Final = 0  # numbers of three points in contact around the centre of mass
ROW: Final = 3  # row of the batch; −1: the lane is free
AT: Final = 4  # last step after which it is known how the body rests
NEXT: Final = 5  # step after which that is looked at next
STRIDE: Final = 6  # number of steps that are taken at once
LAST: Final = 7  # number of steps that bring all joints to their targets
RESTS: Final = 8  # 1: the body came to rest each time; else 0
COUNT_ROWS: Final = 9

FRAME_ROWS: Final = 12
POINT_ROWS: Final = 4
CORNERS: Final = 8
NOWHERE: Final = -1e30  # radius of a point that is left out

_CLOSE_TURNS: Final = tuple(math.radians(0.35 * 2.5**step) for step in range(6))
_TURNS_AROUND: Final = tuple(math.radians(30.0 * step) for step in range(2, 6))
_RIM_TURNS: Final = (
    *(0.0, math.pi),
    *(side * turn for turn in (*_CLOSE_TURNS, *_TURNS_AROUND) for side in (1.0, -1.0)),
)
RIM_COSINES: Final = tuple(map(math.cos, _RIM_TURNS))
RIM_SINES: Final = tuple(map(math.sin, _RIM_TURNS))
RIM: Final = len(_RIM_TURNS)
"""Number of points of a rim: where it bears, and others at turns from there; not tuned."""


class Trees(NamedTuple):
    """The arrays of ``Bodies`` that the kernel reads, by name; ``parts`` is ``count`` there."""

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
    short: Array
    base: Array
    base_mounts: Array
    part_mounts: Array
    hinges: Array


class Slew(NamedTuple):
    """How joints turn.

    Attributes:
        pace: Turn in one step, rad.
        stride: Number of steps that are taken at once while bodies go on resting as before.
        reach: Largest turn in all, rad.
        cosines: Cosine of the angle after each number of steps.
        sines: Sine of the angle after each number of steps.
    """

    pace: float
    stride: int
    reach: float
    cosines: Array
    sines: Array


class Work(NamedTuple):
    """Work space for ``LANES`` bodies at a time; see the module.

    Attributes:
        main: Largest number of points of a main body; above ``CORNERS`` where some are round.
        first: First point of each part.
        end: One past the last point of each part.
        boxed: Whether each part may be a box.
        carries: Whether another part may sit on each part.
        carriers: Numbers of the frames that each part may sit on.
        several: How many such frames there are for each part.
        lowest: How far each part's lowest point lies below the body's origin, m.
        one: Points of one body that is picked out to roll: x, y, z, radius. All below belongs to
            it, too: ``touch`` and ``flat``, work space of ``touching``; ``above``, each group's gap
            to the ground, m; and its ``pose`` and ``stance``.
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
    """Makes work space for some of the bodies."""
    parts = trees.parent.shape[1]
    boxed = np.zeros(parts, np.bool_)
    main = CORNERS
    for row in range(start, end):
        if trees.base[which[row], IS_ROUND] > 0:
            main = RIM
        for part in range(parts):
            boxed[part] |= trees.box[which[row], part]
    firsts, ends, points = np.zeros(parts, np.int64), np.zeros(parts, np.int64), main
    for part in range(parts):
        firsts[part] = points
        points += CORNERS if boxed[part] else 2
        ends[part] = points
    if main == RIM:
        points += RIM  # the upper rim's
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
