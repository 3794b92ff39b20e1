"""What a body rests on, as one number, from which nearly the same bodies can start."""

from __future__ import annotations

from typing import Final

from estimator.body.mounts import Vector
from estimator.physics.kernel.compiling import inlined
from estimator.physics.kernel.rest import cross, dot, minus
from estimator.physics.kernel.work import (
    AT,
    FIRM,
    GRAVITY,
    LIES,
    POINT_ROWS,
    ROUND,
    STANCE,
    STRIDE,
    UP,
    Work,
)

GUESSED: Final = -2
"""Value in the row ``AT``: it is not known yet whether the body rests on its stance."""

_FLAT: Final = 0  # stance of a body that lies on its main body
_CONTACT_BITS: Final = 16  # bits of each contact
_POINTS_OF_A_PART: Final = 8  # points of a part, at most


@inlined
def stance_of(work: Work, lane: int) -> int:
    """Stance of a body at rest; −1 where no three points tell, or a rim's, which are placed anew.

    It is made of its three contacts, in order of a turn to the left as seen from above.
    """
    bodies, counts = work.bodies, work.counts
    if bodies[LIES, lane] > 0.0:
        return _FLAT
    if bodies[FIRM, lane] == 0.0 or bodies[ROUND, lane] > 0.0:
        return -1
    a, b, c = counts[STANCE, lane], counts[STANCE + 1, lane], counts[STANCE + 2, lane]
    foot = point_of(work, lane, a)
    across = cross(minus(point_of(work, lane, b), foot), minus(point_of(work, lane, c), foot))
    if dot(across, (bodies[UP, lane], bodies[UP + 1, lane], bodies[UP + 2, lane])) < 0.0:
        b, c = c, b
    stance: int = 1 + _contact_number(work, a)
    stance += (_contact_number(work, b) << _CONTACT_BITS) + (
        _contact_number(work, c) << 2 * _CONTACT_BITS
    )
    return stance


@inlined
def take_stance(work: Work, lane: int, stance: int) -> bool:
    """Puts a body that was laid flat on a stance under plumb gravity; its pose is not known yet.

    Returns whether the body has such points.
    """
    bodies, counts = work.bodies, work.counts
    if stance > _FLAT:
        a, b, c = (
            _contact(work, stance - 1),
            _contact(work, (stance - 1) >> _CONTACT_BITS),
            _contact(work, (stance - 1) >> 2 * _CONTACT_BITS),
        )
        if min(a, b, c) < 0:
            return False
        counts[STANCE, lane], counts[STANCE + 1, lane], counts[STANCE + 2, lane] = a, b, c
        bodies[LIES, lane], bodies[UP + 2, lane] = 0.0, 0.0
    bodies[GRAVITY, lane] = bodies[GRAVITY + 1, lane] = 0.0
    counts[AT, lane], counts[STRIDE, lane] = GUESSED, 1
    return True


@inlined
def _contact(work: Work, numbers: int) -> int:
    """The point that the lowest ``_CONTACT_BITS`` bits stand for; −1: there is none."""
    number = numbers & (1 << _CONTACT_BITS) - 1
    part, point = number // _POINTS_OF_A_PART - 1, number % _POINTS_OF_A_PART
    if part < 0:
        return point
    if part >= len(work.first) or work.first[part] + point >= work.end[part]:
        return -1
    contact: int = work.first[part] + point
    return contact


@inlined
def _contact_number(work: Work, point: int) -> int:
    """A point by its part and its place there, as other bodies' parts may have other points."""
    number = point
    for part in range(len(work.first)):
        if work.first[part] <= point < work.end[part]:
            number = (part + 1) * _POINTS_OF_A_PART + point - work.first[part]
    return number


@inlined
def point_of(work: Work, lane: int, point: int) -> Vector:
    """Where a point of a body is, in the main body's frame, m."""
    row = POINT_ROWS * point
    return work.points[row, lane], work.points[row + 1, lane], work.points[row + 2, lane]
