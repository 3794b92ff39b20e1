"""Mounts, where parts can sit, and hinges, how they can turn.

A mount on the main body is a point and a direction, one on a part a share of its length and a
direction: a yaw from the carrier's own x axis, and an elevation over the carrier's plane.
The tables here are the paper's: four sides and six hinges.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, TypeAlias

from estimator.errors import MorphologyError

Vector: TypeAlias = tuple[float, float, float]

_EXACT: Final = 1e-12  # a cosine or sine that is smaller counts as 0


def heading(angle: float) -> tuple[float, float]:
    """Cosine and sine of a yaw or an elevation, exact for quarter turns."""
    cosine, sine = math.cos(angle), math.sin(angle)
    if abs(cosine) < _EXACT:
        return 0.0, math.copysign(1.0, sine)
    if abs(sine) < _EXACT:
        return math.copysign(1.0, cosine), 0.0
    return cosine, sine


@dataclass(frozen=True, kw_only=True)
class Mount:
    """A place where parts can sit, on the main body or on a part.

    Attributes:
        name: Name for people.
        yaw: Direction of a part there, from the carrier's x axis, rad; π/2 is left.
        elevation: How far that direction rises over the carrier's plane, rad: π/2 is up, −π/2 down.
    """

    name: str
    yaw: float
    elevation: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.yaw) and math.isfinite(self.elevation)):
            raise MorphologyError(f"mount {self.name!r}: its direction must be finite")

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Rotation of a part there in the carrier's frame, its hinge at 0: w, x, y, z."""
        cosine, sine = math.cos(self.yaw / 2), math.sin(self.yaw / 2)
        level, rise = math.cos(self.elevation / 2), math.sin(self.elevation / 2)
        return cosine * level, sine * rise, 0.0 - cosine * rise, sine * level


@dataclass(frozen=True, kw_only=True)
class BaseMount(Mount):
    """A place on the main body.

    Attributes:
        at: Point, from the middle of the main body, m.
    """

    at: Vector

    def __post_init__(self) -> None:
        super().__post_init__()
        if not all(map(math.isfinite, self.at)):
            raise MorphologyError(f"mount {self.name!r}: its point must be finite")


@dataclass(frozen=True, kw_only=True)
class PartMount(Mount):
    """A place on any part.

    Attributes:
        fraction: Fraction of the part's length: 0 on its joint's axis, 1 at its far end.
    """

    fraction: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.fraction <= 1:
            raise MorphologyError(f"mount {self.name!r}: the fraction must lie in 0 to 1")


@dataclass(frozen=True, kw_only=True)
class Hinge:
    """How a positive angle turns a part.

    Attributes:
        name: Name for people.
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
    """Mounts in the middle of each side face of a main body with these extents, m."""
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
"""The paper's mounts on a part: halfway along on either side, far end and near end."""

HINGES: Final = (
    Hinge(name="yaw_left", axis=(0.0, 0.0, 1.0)),
    Hinge(name="yaw_right", axis=(0.0, 0.0, -1.0)),
    Hinge(name="up", axis=(0.0, -1.0, 0.0)),  # a positive angle lifts the far end
    Hinge(name="down", axis=(0.0, 1.0, 0.0)),
    Hinge(name="roll_left", axis=(-1.0, 0.0, 0.0)),
    Hinge(name="roll_right", axis=(1.0, 0.0, 0.0)),
)
