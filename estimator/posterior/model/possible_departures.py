"""All ways that are looked at in which a robot may be built otherwise than its problem says.

How far they go is what a builder gets wrong unnoticed: less hardly matters, more is seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import Final

from estimator.body.arrays import ACCELEROMETER, DENSITY, TILT_GAIN, TOO_HIGH
from estimator.posterior.model.departures import (
    Departure,
    Limp,
    OffCentre,
    OffZero,
    OtherFigure,
    Thickness,
    Travel,
    TurnedHinge,
    TurnedMount,
)
from estimator.problem.problem import Problem

_THICKNESSES: Final = (0.35, 0.5, 0.7, 1.4, 2.0, 2.8)  # of all parts
_ONE_THICKNESS: Final = (0.5, 1.5, 2.5)
_TURNS: Final = (-30, -15, 15, 30)  # degrees
_OFFSETS: Final = (-12, -6, -3, 3, 6, 12)  # degrees
_HEAVIER: Final = (0.5, 2.0, 4.0)
_OFF_CENTRE: Final = (-0.25, -0.1, 0.1, 0.25)  # of the main body's extent
_ASKEW: Final = (-6, -2, 2, 6)  # degrees
_TRAVELS: Final = (0.8, 0.9, 1.1, 1.25)  # of all servos
_ONE_TRAVEL: Final = (0.8, 1.25)
_GAINS: Final = (0.8, 0.9, 1.1, 1.25)  # of the accelerometer
_TOO_MUCH: Final = (-10, -5, 5, 10)  # mm
_TOWARDS: Final = (("backward", "forward"), ("to the right", "to the left"))
_TILTS: Final = ("left/right", "forward/back")
_DIRECTIONS: Final = ("its own length", "the leftward direction", "the vertical")


def possible_departures(problem: Problem) -> tuple[Departure, ...]:
    """Everything that is looked at.

    Parts of another thickness or mass, a main body that is heavier at one end, sensors that were
    put on askew or calibrated wrongly, servos that are dead, off their zero or turn by other angles
    than they are told, hinges and mounts turned by up to 30°.
    """
    of_parts = (
        departure
        for index, part in enumerate(problem.parts)
        for departure in (*_of_a_part(part.name, index), *_of_a_servo(part.name, index, part.motor))
    )
    return (*_of_all_parts(), *_of_the_main_body(), *of_parts)


def _of_all_parts() -> Iterator[Departure]:
    for factor in _THICKNESSES:
        yield Thickness(name=f"parts {factor:g} times as thick", factor=factor)
    for factor in _HEAVIER:
        name = f"parts {factor:g} times as heavy for their size"
        yield OtherFigure(name=name, column=DENSITY, factor=factor)
    for factor in _TRAVELS:
        yield Travel(name=f"all servos turning {factor:g} times as far as told", factor=factor)


def _of_the_main_body() -> Iterator[Departure]:
    for axis, share in product((0, 1), _OFF_CENTRE):
        where = f"{100 * abs(share):g} % of its extent {_TOWARDS[axis][share > 0]}"
        name = f"the main body's centre of mass {where}"
        yield OffCentre(name=name, axis=axis, share=share)
    for about, degrees in product((0, 1), _ASKEW):
        name = f"the accelerometer turned by {degrees}° {_TILTS[about]}"
        yield OtherFigure(name=name, column=ACCELEROMETER + about, offset=math.radians(degrees))
    for factor in _GAINS:
        name = f"an accelerometer that feels {factor:g} times the tilt"
        yield OtherFigure(name=name, column=TILT_GAIN, factor=factor)
    for offset in _TOO_MUCH:
        which = "much" if offset > 0 else "little"
        name = f"a distance sensor that reads {abs(offset)} mm too {which}"
        yield OtherFigure(name=name, column=TOO_HIGH, offset=offset / 1000)


def _of_a_part(part: str, index: int) -> Iterator[Departure]:
    for factor in _ONE_THICKNESS:
        name = f"{part} {factor:g} times as thick"
        yield Thickness(name=name, factor=factor, part=index)
    for degrees in _TURNS:
        side = "left" if degrees > 0 else "right"
        name = f"{part} pointing {abs(degrees)}° {side} of its mount's direction"
        yield TurnedMount(name=name, part=index, angle=math.radians(degrees))


def _of_a_servo(part: str, index: int, motor: int | None) -> Iterator[Departure]:
    if motor is None:
        return
    yield Limp(name=f"the servo of {part} dead", part=index)
    for factor in _ONE_TRAVEL:
        name = f"the servo of {part} turning {factor:g} times as far as told"
        yield Travel(name=name, factor=factor, part=index)
    for degrees in _OFFSETS:
        name = f"the zero of {part}'s servo off by {degrees}°"
        yield OffZero(name=name, part=index, angle=math.radians(degrees))
    for degrees, about in product(_TURNS, range(len(_DIRECTIONS))):
        name = f"the hinge of {part} turned by {degrees}° about {_DIRECTIONS[about]}"
        yield TurnedHinge(name=name, part=index, about=about, angle=math.radians(degrees))
