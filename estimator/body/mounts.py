"""Mounts, where parts can sit, and hinges, how they can turn.

A mount on the main body is a point and a direction, one on a part a share of its length and a
direction. Directions lie in the plane of the planar pose: a yaw from the carrier's own x axis.
The tables here are the paper's: four sides and six hinges.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, TypeAlias

from estimator.errors import MorphologyError

Vector: TypeAlias = tuple[float, float, float]

_EXACT: Final = 1e-12  # what is this near to a quarter turn is one


def heading(yaw: float) -> tuple[float, float]:
    """Cosine and sine of a yaw, exact for quarter turns."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    if abs(cosine) < _EXACT:
        return 0.0, math.copysign(1.0, sine)
    if abs(sine) < _EXACT:
        return math.copysign(1.0, cosine), 0.0
    return cosine, sine


@dataclass(frozen=True, kw_only=True)
class BaseMount:
    """A place on the main body.

    Attributes:
        name: For people.
        at: From the middle of the main body, m.
        yaw: Where a part there points, rad: 0 is forward, π/2 left.
    """

    name: str
    at: Vector
    yaw: float

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (*self.at, self.yaw))):
            raise MorphologyError(f"mount {self.name!r}: point and yaw must be finite")


@dataclass(frozen=True, kw_only=True)
class PartMount:
    """A place on any part.

    Attributes:
        name: For people.
        fraction: Of the part's length: 0 on its joint's axis, 1 at its far end.
        yaw: From the part's direction to that of the part that sits there, rad.
    """

    name: str
    fraction: float
    yaw: float

    def __post_init__(self) -> None:
        if not (0 <= self.fraction <= 1 and math.isfinite(self.yaw)):
            raise MorphologyError(
                f"mount {self.name!r}: the fraction must lie in 0 to 1 and the yaw be finite"
            )


@dataclass(frozen=True, kw_only=True)
class Hinge:
    """How a positive angle turns a part.

    Attributes:
        name: For people.
        axis: Unit vector in the part's frame.
    """

    name: str
    axis: Vector

    def __post_init__(self) -> None:
        if not abs(math.hypot(*self.axis) - 1) < 1e-9:
            raise MorphologyError(f"hinge {self.name!r}: its axis must have length 1")


SIDES: Final = ("left", "front", "right", "back")
_YAWS: Final = (math.pi / 2, 0.0, -math.pi / 2, math.pi)


def four_sides(size: Vector) -> tuple[BaseMount, ...]:
    """The middle of each side face of a main body with these extents, m."""
    x, y = size[0] / 2, size[1] / 2
    places = ((0.0, y, 0.0), (x, 0.0, 0.0), (0.0, -y, 0.0), (-x, 0.0, 0.0))
    return tuple(
        BaseMount(name=name, at=place, yaw=yaw)
        for name, place, yaw in zip(SIDES, places, _YAWS, strict=True)
    )


PART_SIDES: Final = tuple(
    PartMount(name=name, fraction=fraction, yaw=yaw)
    for name, fraction, yaw in zip(SIDES, (0.5, 1.0, 0.5, 0.0), _YAWS, strict=True)
)
"""Far end, near end, and halfway to either side."""

HINGES: Final = (
    Hinge(name="yaw_left", axis=(0.0, 0.0, 1.0)),
    Hinge(name="yaw_right", axis=(0.0, 0.0, -1.0)),
    Hinge(name="up", axis=(0.0, -1.0, 0.0)),  # a positive angle lifts the far end
    Hinge(name="down", axis=(0.0, 1.0, 0.0)),
    Hinge(name="roll_left", axis=(-1.0, 0.0, 0.0)),
    Hinge(name="roll_right", axis=(1.0, 0.0, 0.0)),
)
