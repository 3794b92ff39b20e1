"""Bodies from the planar pose to their motor programs, ``LANES`` of them at a time.

All joints turn at the same speed, each to its own target, in steps of ``pace``. After each step the
body is brought to rest again.

Most steps change nothing but angles: the body goes on lying flat, or standing on the same three
contacts. Whether it does is tested for all lanes at once; a body that does not is picked out and
rolls alone. Until that first happens ``stride`` steps are taken at once; then the last of them are
repeated one by one. A lane whose body is at its targets takes the next of the batch.

Gravity may be inclined in the body frame (tangents of angles towards x and y): the centre of mass
acts as if it were shifted by that share of its height. Where a body lands under an inclined gravity
tells how stable it is to land there under a plumb one.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

from estimator.body import geometry
from estimator.body.arrays import Integers
from estimator.body.morphology import Array
from estimator.body.mounts import Vector
from estimator.physics.kernel.compiling import entrance, inlined, stamp
from estimator.physics.kernel.lanes import (
    LANES,
    bits,
    choose,
    every,
    gather,
    load,
    root,
    size,
    store,
)
from estimator.physics.kernel.parts import board, board_again, move, pick_out, place_rims
from estimator.physics.kernel.rest import (
    BALANCED,
    TOUCHING,
    depth,
    dot,
    follow,
    minus,
    roll,
    stands,
    vector,
)
from estimator.physics.kernel.sensing import SINKS, Limits, Readings, centre_of, read
from estimator.physics.kernel.stance import GUESSED, take_stance
from estimator.physics.kernel.work import (
    AT,
    CORNERS,
    DEEP,
    FIRM,
    GRAVITY,
    HALF,
    LAST,
    LIES,
    MIDDLE,
    MOMENTS,
    NEXT,
    POINT_ROWS,
    RESTS,
    RIM,
    ROUND,
    ROW,
    STANCE,
    STEP,
    STEP_COSINE,
    STEP_SINE,
    STRIDE,
    UP,
    WEIGHT,
    Slew,
    Trees,
    Work,
    work_space,
)
from protocol.wire import readings as definitions

_SOURCES: Final = stamp(
    Path(__file__).parent,
    Path(definitions.__file__),
    Path(geometry.__file__),
)

_MOST_REFINEMENTS: Final = 4  # times at most that rims are placed for the last pose; not tuned
_UPRIGHT: Final = 0.2  # of up's z: above it the lower rim keeps the upper one off the ground
_LEAST_MOVE: Final = 1e-4  # rad; where a rim bears has hardly moved by less
_FOLLOWED_PACES: Final = (
    8.0  # paces by which a body may turn in one step and be followed; not tuned
)


@inlined
def _rest_alike(work: Work, least_cosine: float) -> int:
    """Which bodies rest as they did before their last step: bits, one for each lane.

    Updates their poses, and of all bodies ``MIDDLE``, ``DEEP`` and ``work.lowest``.
    """
    bodies, points, counts = work.bodies, work.points, work.counts
    old_up = load(bodies, UP), load(bodies, UP + 1), load(bodies, UP + 2)
    lies = load(bodies, LIES) > 0.0
    half_x, half_y, half_z = load(bodies, HALF), load(bodies, HALF + 1), load(bodies, HALF + 2)
    foot = _contact(points, counts, STANCE)
    second, third = _contact(points, counts, STANCE + 1), _contact(points, counts, STANCE + 2)
    radius = gather(points, counts, STANCE, POINT_ROWS, 3)
    second_rise = gather(points, counts, STANCE + 1, POINT_ROWS, 3) - radius
    third_rise = gather(points, counts, STANCE + 2, POINT_ROWS, 3) - radius
    weight = load(bodies, WEIGHT)
    x, y = load(bodies, MOMENTS) / weight, load(bodies, MOMENTS + 1) / weight
    z = load(bodies, MOMENTS + 2) / weight
    height = radius + dot(old_up, minus((x, y, z), foot))
    x, y = x + load(bodies, GRAVITY) * height, y + load(bodies, GRAVITY + 1) * height
    store(bodies, MIDDLE, x)
    store(bodies, MIDDLE + 1, y)
    store(bodies, MIDDLE + 2, z)
    is_standing, up, _ = stands(
        foot, second, third, second_rise, third_rise, (x, y, z), old_up, least_cosine
    )
    up_x, up_y = choose(lies, old_up[0], up[0]), choose(lies, old_up[1], up[1])
    up_z = choose(lies, old_up[2], up[2])
    deepest = every(-math.inf)
    for part in range(len(work.first)):
        lowest = every(-math.inf)
        for point in range(work.first[part], work.end[part]):
            row = POINT_ROWS * point
            across = up_x * load(points, row) + up_y * load(points, row + 1)
            below = load(points, row + 3) - (across + up_z * load(points, row + 2))
            lowest = choose(below > lowest, below, lowest)
        store(work.lowest, part, lowest)
        deepest = choose(lowest > deepest, lowest, deepest)
    corner = size(up_x) * half_x + size(up_y) * half_y + size(up_z) * half_z
    within = (size(x) < half_x) & (size(y) < half_y)
    if work.main > CORNERS:
        boxes = load(bodies, ROUND) <= 0.0
        rim = root(up_x * up_x + up_y * up_y) * half_x + size(up_z) * half_z - SINKS
        corner = choose(boxes, corner, rim)
        within = within & (boxes | (x * x + y * y < half_x * half_x))
    lowest = radius - dot((up_x, up_y, up_z), foot) + TOUCHING
    flat = within & (deepest <= half_z + TOUCHING)
    firm = (load(bodies, FIRM) > 0.0) & (deepest <= lowest) & (corner <= lowest)
    stays = (lies & flat) | ((load(bodies, LIES) <= 0.0) & firm & is_standing)
    store(bodies, DEEP, choose(corner > deepest, corner, deepest))
    store(bodies, UP, choose(stays, up_x, old_up[0]))
    store(bodies, UP + 1, choose(stays, up_y, old_up[1]))
    store(bodies, UP + 2, choose(stays, up_z, old_up[2]))
    staying: int = bits(stays)
    return staying


@inlined
def _contact(points: Array, counts: Integers, which: int) -> Vector:
    return (
        gather(points, counts, which, POINT_ROWS, 0),
        gather(points, counts, which, POINT_ROWS, 1),
        gather(points, counts, which, POINT_ROWS, 2),
    )


@inlined
def _turn_to(work: Work, lane: int, step: int, slew: Slew) -> None:
    """Sets the number of steps after which a lane is looked at next."""
    work.counts[NEXT, lane] = step
    work.bodies[STEP, lane] = step
    work.bodies[STEP_COSINE, lane], work.bodies[STEP_SINE, lane] = (
        slew.cosines[step],
        slew.sines[step],
    )


@inlined
def _start(work: Work, lane: int, row: int, gravity_tilts: Array, slew: Slew) -> None:
    """Lays a body that is in a lane flat, with its joints where they start."""
    bodies, counts = work.bodies, work.counts
    tilt = gravity_tilts[row if len(gravity_tilts) > 1 else 0]
    bodies[UP, lane], bodies[UP + 1, lane], bodies[UP + 2, lane] = 0.0, 0.0, 1.0
    bodies[GRAVITY, lane], bodies[GRAVITY + 1, lane] = tilt[0], tilt[1]
    bodies[LIES, lane] = bodies[FIRM, lane] = 1.0
    for contact in range(3):
        counts[STANCE + contact, lane] = contact
    counts[ROW, lane], counts[AT, lane], counts[RESTS, lane] = row, -1, 1
    counts[STRIDE, lane] = slew.stride
    _turn_to(work, lane, 0, slew)


@inlined
def _come_to_rest(work: Work, lane: int, least_cosine: float, refinements: int) -> None:
    """Brings a body to rest that does not rest as before.

    A rim's points are placed up to ``refinements`` times, until where it bears hardly moves: once
    on the way, where each pose but begins the next.
    """
    bodies = work.bodies
    bodies[LIES, lane] = 0.0
    centre = bodies[MIDDLE, lane], bodies[MIDDLE + 1, lane], bodies[MIDDLE + 2, lane]
    is_round, every_point = bodies[ROUND, lane] > 0, work.one.shape[1]
    for _ in range(refinements if is_round else 1):
        x, y = _bearing(work, lane, centre)
        count = every_point
        if is_round:
            place_rims(work, lane, x, y)
            if bodies[UP + 2, lane] > _UPRIGHT:
                count -= RIM
        pick_out(work, lane)
        _take_pose(work, lane)
        if bodies[FIRM, lane] == 0.0 or not follow(
            work.one, count, centre, work.pose, work.stance, least_cosine
        ):
            _roll(work, lane, centre, count)
        if count < every_point and work.pose[2] <= _UPRIGHT:
            _take_pose(work, lane)
            _roll(work, lane, centre, every_point)
        _keep_pose(work, lane)
        new_x, new_y = _bearing(work, lane, centre)
        if x * new_x + y * new_y > 0 and abs(x * new_y - y * new_x) < _LEAST_MOVE:
            return


@inlined
def _bearing(work: Work, lane: int, centre: Vector) -> tuple[float, float]:
    """Unit vector to where a main body is lowest, or, if it is level, to where the mass acts."""
    x, y = -work.bodies[UP, lane], -work.bodies[UP + 1, lane]
    if x * x + y * y < BALANCED * BALANCED:
        x, y = centre[0], centre[1]
    length = math.sqrt(x * x + y * y)
    if length == 0.0:
        return 1.0, 0.0
    return x / length, y / length


@inlined
def _roll(work: Work, lane: int, centre: Vector, count: int) -> None:
    """Rolls the body that was picked out, of which the first ``count`` points may touch."""
    if not roll(work.one, count, centre, work.pose, work.stance, work.touch, work.flat):
        work.counts[RESTS, lane] = 0
    work.bodies[FIRM, lane] = 1.0 if work.stance[2] >= 0 else 0.0


@inlined
def _take_pose(work: Work, lane: int) -> None:
    for axis in range(3):
        work.pose[axis] = work.bodies[UP + axis, lane]
        work.stance[axis] = work.counts[STANCE + axis, lane]


@inlined
def _keep_pose(work: Work, lane: int) -> None:
    for axis in range(3):
        work.bodies[UP + axis, lane] = work.pose[axis]
        work.counts[STANCE + axis, lane] = max(work.stance[axis], 0)
    work.bodies[DEEP, lane] = depth(work.one, work.one.shape[1], vector(work.pose))


@inlined
def _upright(work: Work, lane: int, plumb: bool) -> bool:
    """Moves a body at its targets once more as gravity is plumb again; returns whether it did."""
    bodies, centre = work.bodies, centre_of(work, lane)
    inclined = bodies[GRAVITY, lane] != 0 or bodies[GRAVITY + 1, lane] != 0
    if bodies[ROUND, lane] > 0 and bodies[LIES, lane] == 0:
        # Under inclined gravity a rim rolls on, which is no other place to land: so it rolls back.
        # Here its points are placed until they stand where it bears.
        for axis in range(3):
            bodies[MIDDLE + axis, lane] = centre[axis]
        _come_to_rest(work, lane, 0.0, _MOST_REFINEMENTS)
        return True
    if plumb and inclined:
        pick_out(work, lane)
        _take_pose(work, lane)
        _roll(work, lane, centre, work.one.shape[1])
        _keep_pose(work, lane)
        return True
    return False


def _make_rest(sources: int) -> Any:
    @entrance
    def rest(
        start: int,
        end: int,
        trees: Trees,
        which: Integers,
        programs: Array,
        gravity_tilts: Array,
        stances: Integers,
        slew: Slew,
        limits: Limits,
        plumb: bool,
        readings: Readings,
    ) -> int:
        """Fills rows ``start`` to ``end`` of the readings.

        In the end gravity is plumb again, and the sensors are read; unless ``plumb`` is false: then
        only ``up`` is filled in.

        ``which`` has the row of each body in ``trees``. ``programs``, ``gravity_tilts`` and
        ``stances`` have one row for all or one for each. A body with a stance is put to its targets
        at once, and starts from flat only if it does not rest so there.

        Returns:
            Number of steps that this took.
        """
        work = work_space(trees, which, start, end)
        counts = work.counts
        least_cosine = math.cos(_FOLLOWED_PACES * slew.pace)
        steps = 0 * sources  # named here to be a part of the cache's key
        row, occupied, latest = start, 0, -1
        for lane in range(LANES):
            counts[ROW, lane] = -1
        while row < end or occupied:
            for lane in range(LANES):
                if counts[ROW, lane] < 0 and row < end:
                    _board_row(work, lane, latest, row, trees, which, programs, slew)
                    _start(work, lane, row, gravity_tilts, slew)
                    stance = stances[row if len(stances) > 1 else 0]
                    if stance >= 0 and take_stance(work, lane, stance):
                        _turn_to(work, lane, counts[LAST, lane], slew)
                    latest = lane
                    row += 1
                    occupied += 1
            move(work)
            stay = _rest_alike(work, least_cosine)
            for lane in range(LANES):
                if counts[ROW, lane] < 0:
                    continue
                steps += 1
                step, known, last = counts[NEXT, lane], counts[AT, lane], counts[LAST, lane]
                stays = bool(stay >> lane & 1)
                if known == GUESSED and not stays:
                    _start(work, lane, counts[ROW, lane], gravity_tilts, slew)
                    continue
                if not stays:
                    counts[STRIDE, lane] = 1
                    if step > known + 1:
                        _turn_to(work, lane, known + 1, slew)
                        continue
                    _come_to_rest(work, lane, least_cosine, 1)
                if step < last:
                    counts[AT, lane] = step
                    _turn_to(work, lane, min(step + counts[STRIDE, lane], last), slew)
                    continue
                done_row = counts[ROW, lane]
                program = programs[done_row if len(programs) > 1 else 0]
                if _upright(work, lane, plumb):
                    stays = False
                read(
                    work,
                    lane,
                    trees,
                    which[done_row],
                    program,
                    slew,
                    limits,
                    done_row,
                    stays,
                    plumb,
                    readings,
                )
                counts[ROW, lane] = -1
                occupied -= 1
        return steps

    return rest


@inlined
def _board_row(
    work: Work,
    lane: int,
    latest: int,
    row: int,
    trees: Trees,
    which: Integers,
    programs: Array,
    slew: Slew,
) -> None:
    """Puts a row of the batch into a lane."""
    program = programs[row if len(programs) > 1 else 0]
    if latest >= 0 and which[row] == which[row - 1] and _same_program(programs, row):
        board_again(work, lane, latest)
    else:
        board(trees, which[row], program, slew, work, lane)


@inlined
def _same_program(programs: Array, row: int) -> bool:
    """Whether a row has the program of the one before it."""
    if len(programs) > 1:
        for motor in range(programs.shape[1]):
            if programs[row, motor] != programs[row - 1, motor]:
                return False
    return True


rest: Final = _make_rest(_SOURCES)
