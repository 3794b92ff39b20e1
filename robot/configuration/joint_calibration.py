"""Counts of the servo board ↔ joint angles.

The board has 8 bits, so a joint can only take the angles of its 255 counts: what is commanded is
always one of those, and it is what gets reported.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

MIN_COUNT = 1  # count 0 means "no pulses"
MAX_COUNT = 255
SLOPES = (0.25, 2.0)  # degrees a count of any servo; 0.7 is usual


@dataclass(frozen=True)
class JointScale:
    """A monotone table of (count, angle in rad), linear between and beyond its points.

    Raises:
        ValueError: Fewer than two points, counts out of 1 to 255, or a table that is not strictly
            monotone in both columns.
    """

    points: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        ordered = tuple(sorted(self.points))
        counts = [count for count, _ in ordered]
        steps = [b - a for (_, a), (_, b) in pairwise(ordered)]
        if len(ordered) < 2:
            raise ValueError("needs at least two points [count, degrees]")
        if any(not MIN_COUNT <= count <= MAX_COUNT for count in counts):
            raise ValueError(f"counts must lie in {MIN_COUNT} to {MAX_COUNT}")
        if len(set(counts)) < len(counts):
            raise ValueError("gives one count twice")
        if not (all(step > 0 for step in steps) or all(step < 0 for step in steps)):
            raise ValueError("angles must rise or fall all along the counts")
        object.__setattr__(self, "points", ordered)

    def angle(self, count: float) -> float:
        """The angle of a count, rad."""
        return _interpolate(self.points, count)

    def count(self, angle: float) -> int:
        """The nearest count to an angle, within 1 to 255."""
        swapped = sorted((value, count) for count, value in self.points)
        exact = _interpolate(swapped, angle)
        return min(MAX_COUNT, max(MIN_COUNT, math.floor(exact + 0.5)))

    @property
    def resolution(self) -> float:
        """The coarsest angle between two neighbouring counts, rad."""
        pairs = pairwise(self.points)
        return max(abs((d - b) / (c - a)) for (a, b), (c, d) in pairs)


def _interpolate(table: Sequence[tuple[float, float]], x: float) -> float:
    at = min(max(bisect_left(table, (x, -math.inf)), 1), len(table) - 1)
    (x0, y0), (x1, y1) = table[at - 1], table[at]
    return y0 + (x - x0) * (y1 - y0) / (x1 - x0)


@dataclass(frozen=True, kw_only=True)
class DrivenJoint:
    """A joint, the output that drives it, its mechanical limits (rad) and its calibration."""

    name: str
    output: int
    lower_limit: float
    upper_limit: float
    part_radius: float
    scale: JointScale

    @cached_property
    def reachable(self) -> tuple[float, float]:
        """The angles that are both within the limits and within the counts, rad."""
        angles = [self.scale.angle(count) for count in range(MIN_COUNT, MAX_COUNT + 1)]
        within = [a for a in angles if self.lower_limit - 1e-9 <= a <= self.upper_limit + 1e-9]
        if not within:
            raise ValueError("the calibration reaches no angle within the limits")
        return min(within), max(within)

    def check_zero(self) -> None:
        """Every interaction begins with all joints at zero.

        Raises:
            ValueError: Zero is not within the limits and the counts.
        """
        if not self.reachable[0] < 0 < self.reachable[1]:
            raise ValueError("must reach the zero pose: 0° lies outside what it spans")

    def quantise(self, angle: float) -> int:
        """The reachable count that comes nearest to an angle."""
        lower, upper = self.reachable
        return self.scale.count(min(upper, max(lower, angle)))

    def at_end(self, count: int) -> bool:
        """Whether a count is the last one in either direction, or beyond."""
        lower, upper = self.reachable
        return not lower < self.scale.angle(count) < upper
