"""Conversion between counts of the servo driver and joint angles.

A joint can only take the angles of its driver's counts (255 of them on a board with 8 bits): what
is commanded is always one of those, and it is what gets reported.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

from robot.uncertainty import Uncertainty

_SPANS: Final = (63.5, 508.0)
"""Degrees from a driver's first count to its last that any servo could turn."""

USUAL_SPAN: Final = 178.0
"""Degrees from a driver's first count to its last that most servos turn."""


def slopes(counts: range) -> tuple[float, float]:
    """The least and the most degrees a count, for any servo on a driver with these counts."""
    steps = len(counts) - 1
    return _SPANS[0] / steps, _SPANS[1] / steps


def middle(counts: range) -> int:
    """The count at which a servo is in the middle of its range, as when it was switched on."""
    return counts[len(counts) // 2]


@dataclass(frozen=True)
class JointScale:
    """A monotone table of (count, angle in rad), linear between and beyond its points.

    Attributes:
        points: Counts and their angles, rad, at least two; sorted by count.

    Raises:
        ValueError: Fewer than two points, or a table that is not strictly monotone in both columns.
    """

    points: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        ordered = tuple(sorted(self.points))
        counts = [count for count, _ in ordered]
        steps = [b - a for (_, a), (_, b) in pairwise(ordered)]
        if len(ordered) < 2:
            raise ValueError("needs at least two points [count, degrees]")
        if len(set(counts)) < len(counts):
            raise ValueError("gives one count twice")
        if not (all(step > 0 for step in steps) or all(step < 0 for step in steps)):
            raise ValueError("angles must rise or fall all along the counts")
        object.__setattr__(self, "points", ordered)

    def angle(self, count: float) -> float:
        """The angle of a count, rad."""
        return _interpolate(self.points, count)

    def count(self, angle: float) -> int:
        """The nearest whole count to an angle, whether or not it can be commanded."""
        return math.floor(self.exact(angle) + 0.5)

    def exact(self, angle: float) -> float:
        """The fractional count of an angle."""
        return _interpolate(sorted((value, count) for count, value in self.points), angle)

    @property
    def rises(self) -> bool:
        """Whether higher counts are larger angles."""
        return self.points[0][1] < self.points[-1][1]

    @property
    def resolution(self) -> float:
        """Largest angle between two neighbouring counts, rad."""
        pairs = pairwise(self.points)
        return max(abs((d - b) / (c - a)) for (a, b), (c, d) in pairs)


def _interpolate(table: Sequence[tuple[float, float]], x: float) -> float:
    index = min(max(bisect_left(table, (x, -math.inf)), 1), len(table) - 1)
    (x0, y0), (x1, y1) = table[index - 1], table[index]
    return y0 + (x - x0) * (y1 - y0) / (x1 - x0)


@dataclass(frozen=True, kw_only=True)
class DrivenJoint:
    """A joint, the output that drives it, its mechanical limits (rad) and its calibration.

    ``counts`` are those that can be commanded; a point of ``scale`` may have another.
    ``part_radius`` is the radius of the part that it moves, m, ``None`` where nobody knows it;
    ``uncertainty`` is that of its zero and of how far it turns.
    """

    name: str
    output: int
    lower_limit: float
    upper_limit: float
    part_radius: float | None
    counts: range
    scale: JointScale
    uncertainty: Uncertainty = Uncertainty()

    @cached_property
    def reachable(self) -> tuple[float, float]:
        """The angles that are both within the limits and within the counts, rad."""
        angles = [self.scale.angle(count) for count in self.counts]
        reachable = [a for a in angles if self.lower_limit - 1e-9 <= a <= self.upper_limit + 1e-9]
        if not reachable:
            raise ValueError("the calibration reaches no angle within the limits")
        return min(reachable), max(reachable)

    def check_zero(self) -> None:
        """Checks that the joint reaches zero, where every interaction begins.

        Raises:
            ValueError: Zero is not within the limits and the counts.
        """
        if not self.reachable[0] < 0 < self.reachable[1]:
            raise ValueError("must reach the zero pose: 0° lies outside what it spans")

    def quantise(self, angle: float) -> int:
        """The reachable count that comes nearest to an angle."""
        lower, upper = self.reachable
        return self.scale.count(min(upper, max(lower, angle)))

    def nearest(self, position: float) -> int:
        """The count that can be commanded and comes nearest to a position in counts."""
        return min(max(round(position), self.counts[0]), self.counts[-1])

    def at_end(self, count: int) -> bool:
        """Whether a count is the last reachable one in either direction, or beyond."""
        lower, upper = self.reachable
        return not lower < self.scale.angle(count) < upper
