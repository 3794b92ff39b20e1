"""Bodies from the planar pose to their motor programs, and how stable their paths are.

All joints turn at the same speed, each to its own target, in steps of ``pace``. After each step the
body is brought to rest again.

Gravity may be inclined in the body frame (tangents of angles towards x and y): the centre of mass
acts as if it were shifted by that share of its height. Where a body lands under an inclined gravity
tells how stable it is to land there under a plumb one.

``rest`` and ``margins`` do that for many bodies, one after another; the back-end calls them.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

import numpy as np

from estimator.body import geometry
from estimator.body.arrays import ACCELEROMETER, CENTRE, Flags, Integers
from estimator.body.morphology import Array
from estimator.body.mounts import Vector
from estimator.physics.kernel.compiling import compiled, entrance, stamp
from estimator.physics.kernel.links import (
    CORNERS,
    END,
    FIRST,
    FRAME_COLUMNS,
    GROUP,
    MASS,
    STEPS,
    TOGETHER,
    Slew,
    Trees,
    Work,
    assemble,
    list_points,
    move,
    work_space,
)
from estimator.physics.kernel.rest import (
    BALANCED,
    TOUCHING,
    at,
    balanced,
    depth,
    dot,
    follow,
    minus,
    roll,
    touching,
    turning,
    vector,
)
from protocol.wire import readings as definitions

_SOURCES: Final = stamp(
    Path(__file__).parent,
    Path(definitions.__file__),
    Path(geometry.__file__),
)

_up_as_measured: Final = compiled(geometry.up_as_measured)
_tilt_of: Final = compiled(definitions.tilt_of)
_belly_ray: Final = compiled(definitions.belly_ray)
_clearance_of: Final = compiled(definitions.clearance_of)
_touches: Final = compiled(definitions.touches)
_touch_is_doubtful: Final = compiled(definitions.touch_is_doubtful)

_SAME: Final = 1e-3  # rad; poses that differ by less are one: far below what sensors resolve
_LADDER: Final = (
    5  # rungs from the steepest inclination down, each a quarter of the one above; not tuned
)
_FINE: Final = (
    1.2  # ratio of the two inclinations between which a margin is known to lie; not tuned
)
_QUICK: Final = 8.0  # paces by which the body may turn in one and still be followed; not tuned


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
    gravity, ups, stances = work.gravity, work.up, work.stance
    mass, steps = 0.0, 0
    for link in range(links):
        mass += joint[link, MASS]
        steps = max(steps, tree[link, STEPS])
    for column in range(FRAME_COLUMNS):
        frame[0, column] = 1.0 if column in (3, 7, 11) else 0.0
    for axis in range(3):
        frame[0, 12 + axis] = base[3] * base[CENTRE + axis]
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
            centre = _as_if_shifted(
                points, up, stance[0], gravity[each, 0], gravity[each, 1], x, y, z
            )
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
    tilt_x: float,
    tilt_y: float,
    x: float,
    y: float,
    z: float,
) -> Vector:
    """Where the centre of mass acts, which is at x, y, z, of a body that stands on a foot."""
    if tilt_x != 0 or tilt_y != 0:
        height = points[3, foot] + up[0] * (x - points[0, foot])
        height += up[1] * (y - points[1, foot]) + up[2] * (z - points[2, foot])
        x, y = x + tilt_x * height, y + tilt_y * height
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
    """Centre of mass of the body, which lies at rest, in the body frame, m."""
    mass = x = y = z = 0.0
    for link in range(links):
        mass += work.joint[link, MASS]
        x, y = x + work.frame[link, 12], y + work.frame[link, 13]
        z += work.frame[link, 14]
    return x / mass, y / mass, z / mass


@compiled
def right_itself(work: Work, links: int, count: int, each: int) -> None:
    """Brings a body that rests under an inclined gravity to rest under a plumb one."""
    centre, up, stance = _centre_of_mass(work, links), work.up[each], work.stance[each]
    if not roll(work.points, count, centre, up, stance, work.touch, work.flat):
        work.rested[each] = False


@compiled
def undecided(work: Work, links: int, count: int, each: int) -> bool:
    """Whether the body, which lies at rest, is balanced on the rim of its support."""
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
        work: Holds a body that lies at rest.
        most: The largest margin wanted, rad.

    Returns:
        rad.
    """
    up, gravity = work.up, work.gravity
    up_x, up_y, up_z = up[0, 0], up[0, 1], up[0, 2]
    steepest = math.tan(most)
    good, bad, tried = 0.0, steepest, steepest
    trials = 0
    while bad > _FINE * good:
        for way in range(4):
            gravity[way, 0], gravity[way, 1] = 0.0, 0.0
            gravity[way, way % 2] = tried if way < 2 else -tried
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
        work: Holds a body that lies at rest.
        link: Of it.
        up: World up in the body frame.
        deep: Depth of the body at rest, m.
    """
    points = work.points
    least = math.inf
    for point in range(work.tree[link, FIRST], work.tree[link, END]):
        least = min(least, deep + dot(up, at(points, point)) - points[3, point])
    return 0.0 if least < TOUCHING else least


@compiled
def _rows_together(
    work: Work, first: int, end: int, which: Integers, programs: Array, gravity_tilts: Array
) -> int:
    """How many rows from one on are of the same body in the same program: at most ``TOGETHER``.

    Fills in how gravity is inclined for each.
    """
    row = first
    while row < end and row < first + TOGETHER and which[row] == which[first]:
        if len(programs) > 1:
            for motor in range(programs.shape[1]):
                if programs[row, motor] != programs[first, motor]:
                    return row - first
        inclined = gravity_tilts[row if len(gravity_tilts) > 1 else 0]
        work.gravity[row - first, 0], work.gravity[row - first, 1] = inclined[0], inclined[1]
        row += 1
    return row - first


def _make_rest(sources: int) -> Any:
    @entrance
    def rest(
        start: int,
        end: int,
        trees: Trees,
        which: Integers,
        programs: Array,
        gravity_tilts: Array,
        slew: Slew,
        cap: float,
        touch_gap: float,
        doubtful_gap: float,
        joint_tolerance: float,
        touch: Flags,
        doubtful: Flags,
        tilt: Array,
        clearance: Array,
        saturated: Flags,
        miss: Array,
        valid: Flags,
        balances: Flags,
    ) -> int:
        """Fills rows ``start`` to ``end`` of the readings.

        ``which`` has each row's tree. ``programs`` and ``gravity_tilts`` have one row for all or
        one for each.

        Returns:
            How many steps that took.
        """
        work = work_space(trees.parent.shape[1])
        steps = 0 * sources  # named here, so that the cache's key knows it
        row = start
        while row < end:
            body = which[row]
            own = trees.base[body]
            program = programs[row if len(programs) > 1 else 0]
            links = assemble(trees, body, program, slew, work)
            points = list_points(trees, body, links, work)
            several = _rows_together(work, row, end, which, programs, gravity_tilts)
            settle(work, links, points, own, slew, several)
            for each in range(several):
                if work.gravity[each, 0] != 0 or work.gravity[each, 1] != 0:
                    right_itself(work, links, points, each)
                balances[row] = undecided(work, links, points, each)
                up = vector(work.up[each])
                deep = depth(work.points, points, up)
                measured = _up_as_measured(up, own[ACCELEROMETER], own[ACCELEROMETER + 1])
                tilt[row, 0], tilt[row, 1] = _tilt_of(measured)
                ray = _belly_ray(deep - 0.5 * own[2] * up[2], up)
                clearance[row], saturated[row] = _clearance_of(ray, cap)
                largest, longest = 0.0, 0
                for part in range(trees.parts[body]):
                    longest = max(longest, work.tree[work.place[part], STEPS])
                    motor, sensor = trees.motor[body, part], trees.sensor[body, part]
                    if motor >= 0:
                        largest = max(largest, abs(program[motor]) - slew.reach)
                    if sensor >= 0:
                        group = work.tree[work.place[part], GROUP]
                        above = gap(work, group, up, deep)
                        for link in range(group + 1, links):
                            if work.tree[link, GROUP] == group:
                                above = min(above, gap(work, link, up, deep))
                        touch[row, sensor] = _touches(above, touch_gap)
                        doubtful[row, sensor] = _touch_is_doubtful(above, doubtful_gap)
                miss[row] = largest
                valid[row] = work.rested[each] and largest <= joint_tolerance
                steps += longest
                row += 1
        return steps

    return rest


def _make_margins(sources: int) -> Any:
    @entrance
    def margins(
        start: int,
        end: int,
        trees: Trees,
        which: Integers,
        programs: Array,
        slew: Slew,
        most: float,
        path_margins: Array,
    ) -> int:
        """Fills rows ``start`` to ``end`` of the path margins; see ``rest``."""
        work = work_space(trees.parent.shape[1])
        for row in range(start, end):
            body = which[row]
            own = trees.base[body]
            program = programs[row if len(programs) > 1 else 0]
            links = assemble(trees, body, program, slew, work)
            points = list_points(trees, body, links, work)
            work.gravity[0, 0] = work.gravity[0, 1] = 0.0
            settle(work, links, points, own, slew, np.int64(1))  # a plain 1 is a type of its own
            path_margins[row] = margin(work, links, points, own, slew, most)
        return 0 * sources

    return margins


rest: Final = _make_rest(_SOURCES)
margins: Final = _make_margins(_SOURCES)
