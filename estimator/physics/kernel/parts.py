"""Trees of parts, eight bodies abreast, with the points that may touch the ground.

A part's frame has its origin where the part begins, and x along it. What it sits on is its carrier:
another part, or the main body, whose frame is number 0; that of part j is number j + 1.

A capsule on a plane is its two end spheres, a box its eight corners, of radius 0. A round main body
has points on its rims, close together where it bears and some all around; when it bears elsewhere
they are placed anew. A sphere inside the cone between two others of a straight limb never touches
first and is left out: its radius is ``NOWHERE``, as is that of every point that a body does not
have where bodies in other lanes do.

Parts that are rigid on each other are a group, whose contact one touch sensor measures.
"""

from __future__ import annotations

import math
from typing import Final

from estimator.body import geometry
from estimator.body.arrays import CENTRE
from estimator.body.arrays import ROUND as IS_ROUND
from estimator.body.morphology import Array
from estimator.body.mounts import Vector
from estimator.physics.kernel.compiling import compiled, inlined
from estimator.physics.kernel.lanes import Lanes, choose, every, load, store
from estimator.physics.kernel.work import (
    ASIDE,
    AXIS,
    BASE_MOMENT,
    CARRIER,
    CORNERS,
    COSINE,
    EAST,
    FAR,
    FRAME_ROWS,
    HALF,
    HINGE_ROWS,
    LAST,
    LEVEL,
    MASS,
    MOMENT,
    MOMENTS,
    NEAR,
    NORTH,
    NOWHERE,
    ORIGIN,
    POINT_ROWS,
    RIM,
    RIM_COSINES,
    RIM_SINES,
    RISE,
    ROUND,
    SIGN,
    SINE,
    STEP,
    STEP_COSINE,
    STEP_SINE,
    TURNS,
    WEIGHT,
    Slew,
    Trees,
    Work,
)

_ends: Final = compiled(geometry.ends)
_volume: Final = compiled(geometry.volume)


@inlined
def board(trees: Trees, row: int, program: Array, slew: Slew, work: Work, lane: int) -> None:
    """Puts a body into a lane.

    Args:
        trees: Bodies, of which this is one.
        row: Row of the body there.
        program: Angle that each motor is told, rad.
        slew: How joints turn.
        work: Receives the body.
        lane: Lane of the body.
    """
    base, bodies, points = trees.base[row], work.bodies, work.points
    mass, most_steps = base[3], 0
    for axis in range(3):
        bodies[HALF + axis, lane] = 0.5 * base[axis]
        bodies[BASE_MOMENT + axis, lane] = base[3] * base[CENTRE + axis]
    bodies[ROUND, lane] = base[IS_ROUND]
    _set_corners(work, lane)
    for part in range(trees.parent.shape[1]):
        if part < trees.parts[row]:
            weight, steps = _board_part(trees, row, part, program, slew, work, lane)
            mass += weight
            most_steps = max(most_steps, steps)
        else:
            for number in range(HINGE_ROWS):
                work.hinges[part * HINGE_ROWS + number, lane] = 0.0
            for point in range(work.first[part], work.end[part]):
                points[POINT_ROWS * point + 3, lane] = NOWHERE
    bodies[WEIGHT, lane] = mass
    work.counts[LAST, lane] = most_steps


@inlined
def target_of(trees: Trees, row: int, part: int, program: Array) -> float:
    """Target angle of the hinge of a part, rad."""
    target, motor = 0.0, trees.motor[row, part]
    if motor >= 0:
        told = trees.travel[row, part] * program[motor]
        short = max(min(trees.short[row, part], abs(told)), -abs(told))
        target = (told + short if told < 0 else told - short) + trees.zero[row, part]
    return target


@inlined
def _board_part(
    trees: Trees, row: int, part: int, program: Array, slew: Slew, work: Work, lane: int
) -> tuple[float, int]:
    """Puts one part of a body into a lane; returns its mass, kg, and its hinge's steps."""
    parent, place, motor = trees.parent[row, part], trees.mount[row, part], trees.motor[row, part]
    length, radius, box = trees.length[row, part], trees.radius[row, part], trees.box[row, part]
    hinges, first = work.hinges, part * HINGE_ROWS
    if parent < 0:
        mount = trees.base_mounts[place]
        x, y, z = mount[0], mount[1], mount[2]
        east, north, level, rise = mount[3], mount[4], mount[5], mount[6]
    else:
        mount = trees.part_mounts[place]
        x, y, z = mount[0] * trees.length[row, parent], 0.0, 0.0
        east, north, level, rise = mount[1], mount[2], mount[3], mount[4]
        work.carries[parent] = True
    _note_carrier(work, part, parent + 1)
    rigid = parent >= 0 and motor < 0
    work.group[part, lane] = work.group[parent, lane] if rigid else part
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
    hinges[first + ASIDE, lane], hinges[first + CARRIER, lane] = radius if box else 0.0, parent + 1
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
    two_spheres = far > 0.0
    # rigid, and straight on from the carrier's far end
    straight = rigid and mount[0] == 1.0 and east == 1.0 and level == 1.0
    if two_spheres and straight and not trees.box[row, parent]:
        thick = trees.radius[row, parent]
        if trees.length[row, parent] >= thick:
            share = thick / (thick + far)  # of the way from the carrier's far sphere to the part's
            two_spheres = radius > thick + (radius - thick) * share
    work.points[POINT_ROWS * start + 3, lane] = radius if two_spheres else NOWHERE
    work.points[POINT_ROWS * start + 7, lane] = radius
    for point in range(start + 2, work.end[part]):
        work.points[POINT_ROWS * point + 3, lane] = NOWHERE
    return mass, steps


@inlined
def board_again(work: Work, lane: int, other: int) -> None:
    """Copies the body of another lane into a lane, with its motor program."""
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
    """Places the main body's corners, or the points of its rims, in any direction."""
    points, has_rims = work.points, work.main > CORNERS
    if has_rims:
        is_round = work.bodies[ROUND, lane] > 0
        for point in range(RIM):
            points[POINT_ROWS * point + 3, lane] = 0.0 if is_round or point < CORNERS else NOWHERE
            upper = POINT_ROWS * (work.one.shape[1] - RIM + point)
            points[upper + 3, lane] = 0.0 if is_round else NOWHERE
        if is_round:
            place_rims(work, lane, 1.0, 0.0)
            return
    for axis in range(3):
        half = work.bodies[HALF + axis, lane]
        if has_rims or points[axis, lane] != -half:  # else the body before was as large
            for corner in range(CORNERS):
                points[POINT_ROWS * corner + axis, lane] = half if corner >> axis & 1 else -half


@inlined
def place_rims(work: Work, lane: int, x: float, y: float) -> None:
    """Gives a round main body the points of its rims, closest together in one direction.

    Args:
        work: Holds the body.
        lane: Lane of the body.
        x: The direction's x in the main body's frame; a unit vector.
        y: The direction's y.
    """
    radius, half = work.bodies[HALF, lane], work.bodies[HALF + 2, lane]
    for point in range(RIM):
        east = radius * (x * RIM_COSINES[point] - y * RIM_SINES[point])
        north = radius * (y * RIM_COSINES[point] + x * RIM_SINES[point])
        for upper in range(2):
            row = POINT_ROWS * (work.one.shape[1] - RIM + point if upper else point)
            work.points[row, lane] = east
            work.points[row + 1, lane] = north
            work.points[row + 2, lane] = half if upper else -half


@inlined
def _note_carrier(work: Work, part: int, carrier: int) -> None:
    """Notes that a part may sit on a carrier, by the number of its frame."""
    for number in range(work.several[part]):
        if work.carriers[part, number] == carrier:
            return
    work.carriers[part, work.several[part]] = carrier
    work.several[part] += 1


@inlined
def move(work: Work) -> None:
    """Turns all joints to where they are after each body's number of steps."""
    hinges, frames, points, bodies = work.hinges, work.frames, work.points, work.bodies
    step, step_cosine = load(bodies, STEP), load(bodies, STEP_COSINE)
    step_sine = load(bodies, STEP_SINE)
    for axis in range(3):
        store(bodies, MOMENTS + axis, load(bodies, BASE_MOMENT + axis))
    for part in range(len(work.first)):
        row = part * HINGE_ROWS
        turning = step < load(hinges, row + TURNS)
        cosine = choose(turning, step_cosine, load(hinges, row + COSINE))
        sine = choose(turning, step_sine * load(hinges, row + SIGN), load(hinges, row + SINE))
        x, y, z = load(hinges, row), load(hinges, row + 1), load(hinges, row + 2)
        east, north = load(hinges, row + EAST), load(hinges, row + NORTH)
        level, rise = load(hinges, row + LEVEL), load(hinges, row + RISE)
        about = load(hinges, row + AXIS), load(hinges, row + AXIS + 1), load(hinges, row + AXIS + 2)
        ahead_x, left_x, over_x = _turned(
            level * east, -1.0 * north, -1.0 * rise * east, about, cosine, sine
        )
        ahead_y, left_y, over_y = _turned(
            level * north, east, -1.0 * rise * north, about, cosine, sine
        )
        ahead_z, left_z, over_z = _turned(rise, every(0.0), level, about, cosine, sine)
        mass, moment = load(hinges, row + MASS), load(hinges, row + MOMENT)
        near, far = load(hinges, row + NEAR), load(hinges, row + FAR)
        aside, carrier = load(hinges, row + ASIDE), load(hinges, row + CARRIER)
        boxed, needs_frame = work.boxed[part], work.boxed[part] or work.carries[part]
        own_frame, start = (part + 1) * FRAME_ROWS, work.first[part]
        for way in range(3):
            candidate = work.carriers[part, 0]
            frame = candidate * FRAME_ROWS + way
            origin, east = load(frames, frame), load(frames, frame + 3)
            north, rise = load(frames, frame + 6), load(frames, frame + 9)
            for number in range(1, work.several[part]):
                candidate = work.carriers[part, number]
                frame = candidate * FRAME_ROWS + way
                is_carrier = carrier == float(candidate)
                origin = choose(is_carrier, load(frames, frame), origin)
                east = choose(is_carrier, load(frames, frame + 3), east)
                north = choose(is_carrier, load(frames, frame + 6), north)
                rise = choose(is_carrier, load(frames, frame + 9), rise)
            origin = origin + x * east + y * north + z * rise
            ahead = ahead_x * east + ahead_y * north + ahead_z * rise
            total = load(bodies, MOMENTS + way)
            store(bodies, MOMENTS + way, total + (mass * origin + moment * ahead))
            if needs_frame:
                left = left_x * east + left_y * north + left_z * rise
                over = over_x * east + over_y * north + over_z * rise
                store(frames, own_frame + way, origin)
                store(frames, own_frame + 3 + way, ahead)
                store(frames, own_frame + 6 + way, left)
                store(frames, own_frame + 9 + way, over)
                if boxed:
                    beside, above = aside * left, aside * over
                    near_end, far_end = origin + near * ahead, origin + far * ahead
                    for quarter in range(4):
                        across = beside if quarter & 1 else -1.0 * beside
                        corner = across + (above if quarter & 2 else -1.0 * above)
                        point = POINT_ROWS * (start + 2 * quarter) + way
                        store(points, point, near_end + corner)
                        store(points, point + POINT_ROWS, far_end + corner)
            if not boxed:
                store(points, POINT_ROWS * start + way, origin)
                store(points, POINT_ROWS * start + POINT_ROWS + way, origin + far * ahead)


@compiled
def _turned(
    x: Lanes, y: Lanes, z: Lanes, about: Vector, cosine: Lanes, sine: Lanes
) -> tuple[Lanes, Lanes, Lanes]:
    """One coordinate of three axes after a turn about an axis given in them (Rodrigues)."""
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
