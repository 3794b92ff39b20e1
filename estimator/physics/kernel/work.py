"""The arrays that the kernel works in, for eight bodies abreast.

All of them are of rows of ``LANES`` numbers, one for each body, for p parts and n points:

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

from estimator.body.arrays import ROUND as IS_ROUND
from estimator.body.arrays import Flags, Integers
from estimator.body.morphology import Array
from estimator.physics.kernel.compiling import allocating
from estimator.physics.kernel.lanes import LANES

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
RIM_COSINES: Final = tuple(map(math.cos, _TURNS))
RIM_SINES: Final = tuple(map(math.sin, _TURNS))
RIM: Final = len(_TURNS)
"""Points of a rim: where it bears, and others at these turns from there; not tuned."""


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
    """Work space for ``LANES`` bodies at a time; see the module.

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
