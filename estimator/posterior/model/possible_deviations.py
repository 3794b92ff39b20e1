"""All deviations of a robot from its problem that are fitted to the readings.

How far they go is what a builder gets wrong unnoticed: less hardly matters, more is seen. Of each
amount all of ``SIZES`` times as much are fitted.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import Final, TypedDict

from estimator.body.arrays import ACCELEROMETER, TOO_HIGH
from estimator.posterior.model.deviations import (
    Askew,
    Density,
    Deviation,
    Limp,
    OffCentre,
    OffZero,
    Thickness,
    TiltGain,
    TooHigh,
    Travel,
    TurnedHinge,
    TurnedMount,
)
from estimator.problem.problem import Problem
from estimator.problem.sections import NuisanceSection

_THICKNESSES: Final = (0.35, 0.5, 0.7, 1.4, 2.0, 2.8)  # of all parts
_ONE_THICKNESS: Final = (0.5, 1.5, 2.5)
_TURNS: Final = (-30, -15, 15, 30)  # degrees
_OFFSETS: Final = (-12, -6, -3, 3, 6, 12)  # degrees
_HEAVIER: Final = (0.5, 2.0, 4.0)
_OFF_CENTRE: Final = (-0.25, -0.1, 0.1, 0.25)  # of the main body's extent
_ASKEW: Final = (-6, -2, 2, 6)  # degrees
_TRAVELS: Final = (0.8, 0.9, 1.1, 1.25)  # of all servos
_ONE_TRAVEL: Final = (0.6, 0.8, 1.25, 1.6)
_GAINS: Final = (0.8, 0.9, 1.1, 1.25)  # of the accelerometer
_TOO_MUCH: Final = (-10, -5, 5, 10)  # mm
_TOWARDS: Final = (("backward", "forward"), ("to the right", "to the left"))
_TILTS: Final = ("left/right", "forward/back")
_DIRECTIONS: Final = ("its own length", "the leftward direction", "the vertical")


class _Angle(TypedDict):
    amount: float
    unit: float


def possible_deviations(problem: Problem) -> tuple[Deviation, ...]:
    """Everything that is looked at.

    Parts of another thickness or mass, a main body that is heavier at one end, sensors that were
    put on askew or calibrated wrongly, servos that are dead, off their zero or turn by other angles
    than they are told, hinges and mounts turned by up to 30°. What the problem leaves open is no
    deviation.
    """
    left_open = problem.nuisance
    of_parts = (
        deviation
        for index, part in enumerate(problem.parts)
        for deviation in (
            *_of_a_part(part.name, index),
            *(() if part.motor is None else _of_a_servo(part.name, index, left_open)),
        )
    )
    return (*_of_all_parts(left_open), *_of_the_main_body(left_open), *of_parts)


def _of_all_parts(left_open: NuisanceSection) -> Iterator[Deviation]:
    for factor in _THICKNESSES:
        yield Thickness(text="parts {} times as thick", amount=factor)
    for factor in _HEAVIER if left_open.density is None else ():
        text = "parts {} times as heavy for their size"
        yield Density(text=text, amount=factor)
    for factor in _TRAVELS:
        yield Travel(text="all servos turning {} times as far as told", amount=factor)


def _of_the_main_body(left_open: NuisanceSection) -> Iterator[Deviation]:
    off_centre = _OFF_CENTRE if left_open.centre_of_mass_mm is None else ()
    askew = _ASKEW if left_open.accelerometer_deg is None else ()
    for axis, share in product((0, 1), off_centre):
        text = f"the main body's centre of mass {{}} % of its extent {_TOWARDS[axis][share > 0]}"
        yield OffCentre(text=text, axis=axis, amount=share, unit=100)
    for about, degrees in product((0, 1), askew):
        text = f"the accelerometer turned by {_minus(degrees)}{{}}° {_TILTS[about]}"
        yield Askew(text=text, column=ACCELEROMETER + about, **_angle(degrees))
    for factor in _GAINS:
        text = "an accelerometer that feels {} times the tilt"
        yield TiltGain(text=text, amount=factor)
    for offset in _TOO_MUCH:
        text = f"a distance sensor that reads {{}} mm too {'much' if offset > 0 else 'little'}"
        yield TooHigh(text=text, column=TOO_HIGH, amount=offset / 1000, unit=1000)


def _of_a_part(part: str, index: int) -> Iterator[Deviation]:
    for factor in _ONE_THICKNESS:
        yield Thickness(text=f"{part} {{}} times as thick", amount=factor, part=index)
    for degrees in _TURNS:
        side = "left" if degrees > 0 else "right"
        text = f"{part} pointing {{}}° {side} of its mount's direction"
        yield TurnedMount(text=text, part=index, **_angle(degrees))


def _of_a_servo(part: str, index: int, left_open: NuisanceSection) -> Iterator[Deviation]:
    yield Limp(text=f"the servo of {part} dead", part=index)
    for factor in _ONE_TRAVEL:
        text = f"the servo of {part} turning {{}} times as far as told"
        yield Travel(text=text, amount=factor, part=index)
    for degrees in _OFFSETS if left_open.joint_zero_deg is None else ():
        text = f"the zero of {part}'s servo off by {_minus(degrees)}{{}}°"
        yield OffZero(text=text, part=index, **_angle(degrees))
    for degrees, about in product(_TURNS, range(len(_DIRECTIONS))):
        sign, direction = _minus(degrees), _DIRECTIONS[about]
        text = f"the hinge of {part} turned by {sign}{{}}° about {direction}"
        yield TurnedHinge(text=text, part=index, about=about, **_angle(degrees))


def _minus(amount: float) -> str:
    return "-" if amount < 0 else ""


def _angle(degrees: float) -> _Angle:
    return {"amount": math.radians(degrees), "unit": math.degrees(1)}
