"""What the sensors of a body in a lane read once it has reached its targets and rests."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from estimator.body import geometry
from estimator.body.arrays import ACCELEROMETER, Flags, Integers
from estimator.body.morphology import Array
from estimator.body.mounts import Vector
from estimator.physics.kernel.compiling import compiled, inlined
from estimator.physics.kernel.parts import pick_out, target_of
from estimator.physics.kernel.rest import (
    BALANCED,
    TOUCHING,
    balanced,
    dot,
    minus,
    touching,
    turning,
)
from estimator.physics.kernel.stance import point_of, stance_of
from estimator.physics.kernel.work import (
    DEEP,
    FIRM,
    HALF,
    MOMENTS,
    POINT_ROWS,
    RESTS,
    ROUND,
    STANCE,
    UP,
    WEIGHT,
    Slew,
    Trees,
    Work,
)
from protocol.wire import readings as definitions

_up_as_measured: Final = compiled(geometry.up_as_measured)
_tilt_of: Final = compiled(definitions.tilt_of)
_belly_ray: Final = compiled(definitions.belly_ray)
_clearance_of: Final = compiled(definitions.clearance_of)
_touches: Final = compiled(definitions.touches)
_touch_is_doubtful: Final = compiled(definitions.touch_is_doubtful)

SINKS: Final = 1e-5
"""How far a rim may sink in beside where it last bore before its points are placed anew, m."""


class Limits(NamedTuple):
    """Limits of the sensors and joints; see ``WorldSettings``."""

    cap: float
    touch_gap: float
    doubtful_gap: float
    joint_tolerance: float


class Readings(NamedTuple):
    """Arrays to be filled in, a row for each body: of ``PredictedReadings``, and world up."""

    touch: Flags
    doubtful: Flags
    tilt: Array
    clearance: Array
    saturated: Flags
    miss: Array
    valid: Flags
    balances: Flags
    stance: Integers
    up: Array


@inlined
def centre_of(work: Work, lane: int) -> Vector:
    """Centre of mass of a body, where its mass acts under a plumb gravity, m."""
    bodies, weight = work.bodies, work.bodies[WEIGHT, lane]
    return (
        bodies[MOMENTS, lane] / weight,
        bodies[MOMENTS + 1, lane] / weight,
        bodies[MOMENTS + 2, lane] / weight,
    )


@inlined
def _undecided(work: Work, lane: int, centre: Vector, up: Vector) -> bool:
    """Whether a body, which lies at rest, is balanced on the rim of its support.

    A round main body that bears on its rim never is: it rolls until the rim's curve holds it.
    """
    if work.bodies[ROUND, lane] > 0:
        across = math.sqrt(up[0] * up[0] + up[1] * up[1]) * work.bodies[HALF, lane]
        lowest = across + abs(up[2]) * work.bodies[HALF + 2, lane]
        if across > BALANCED and lowest > work.bodies[DEEP, lane] - SINKS:
            return False
    if work.bodies[FIRM, lane] != 0.0:
        least = math.inf
        for side in range(3):
            start = point_of(work, lane, work.counts[STANCE + side, lane])
            edge = minus(point_of(work, lane, work.counts[STANCE + (side + 1) % 3, lane]), start)
            area = turning(up, minus(start, centre), edge)
            least = min(least, area * area / dot(edge, edge))
        if least > 4 * BALANCED * BALANCED:
            return False
    pick_out(work, lane)
    contacts = touching(work.one, work.one.shape[1], centre, up, work.touch, work.flat)
    return balanced(work.flat, contacts)


@inlined
def read(
    work: Work,
    lane: int,
    trees: Trees,
    body: int,
    program: Array,
    slew: Slew,
    limits: Limits,
    row: int,
    stays: bool,
    plumb: bool,
    readings: Readings,
) -> None:
    """Fills a row of the readings, or, if ``plumb`` is false, ``up`` alone.

    If the body ``stays`` as it was before its last step, ``work.lowest`` is known already.
    """
    bodies, base = work.bodies, trees.base[body]
    rests = work.counts[RESTS, lane] > 0
    for axis in range(3):
        readings.up[row, axis] = bodies[UP + axis, lane] if rests else math.nan
    if not plumb:
        return
    up, deep = (bodies[UP, lane], bodies[UP + 1, lane], bodies[UP + 2, lane]), bodies[DEEP, lane]
    readings.stance[row] = stance_of(work, lane) if rests else -1
    readings.balances[row] = _undecided(work, lane, centre_of(work, lane), up)
    measured = _up_as_measured(up, base[ACCELEROMETER], base[ACCELEROMETER + 1])
    readings.tilt[row, 0], readings.tilt[row, 1] = _tilt_of(measured)
    ray = _belly_ray(deep - 0.5 * base[2] * up[2], up)
    readings.clearance[row], readings.saturated[row] = _clearance_of(ray, limits.cap)
    largest_miss, parts = 0.0, trees.parts[body]
    for part in range(parts):
        work.above[part] = math.inf
    for part in range(parts):
        if not stays:
            work.lowest[part, lane] = _lowest(work, lane, part, up)
        group = work.group[part, lane]
        work.above[group] = min(work.above[group], deep - work.lowest[part, lane])
        target = target_of(trees, body, part, program)
        largest_miss = max(largest_miss, abs(target) - slew.reach)
    for part in range(parts):
        sensor = trees.sensor[body, part]
        if sensor >= 0:
            above = work.above[work.group[part, lane]]
            gap = 0.0 if above < TOUCHING else above
            readings.touch[row, sensor] = _touches(gap, limits.touch_gap)
            readings.doubtful[row, sensor] = _touch_is_doubtful(gap, limits.doubtful_gap)
    readings.miss[row] = largest_miss
    readings.valid[row] = work.counts[RESTS, lane] > 0 and largest_miss <= limits.joint_tolerance


@inlined
def _lowest(work: Work, lane: int, part: int, up: Vector) -> float:
    """How far a part's lowest point lies below the body's origin, m."""
    lowest = -math.inf
    for point in range(work.first[part], work.end[part]):
        below = work.points[POINT_ROWS * point + 3, lane] - dot(up, point_of(work, lane, point))
        lowest = max(lowest, below)
    return lowest
