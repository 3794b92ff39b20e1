"""Drivers of sensors on a body at rest, in memory."""

from __future__ import annotations

import math


class Leaning:
    """An accelerometer on a resting body that leans to the left by 20°, or as it is told."""

    name = "plumb line"

    def __init__(self, up: tuple[float, float, float] | None = None):
        lean = math.radians(20)
        self._up = up or (0.0, -math.sin(lean), math.cos(lean))

    def start(self) -> None:
        """It is there."""

    def check(self) -> None:
        """It works."""

    def close(self) -> None:
        """There is no link."""

    def acceleration(self) -> tuple[float, float, float]:
        return self._up


class Ruler(Leaning):
    """A distance sensor that always says the same."""

    name = "ruler"

    def __init__(self, metres: float | None):
        self._metres = metres

    def distance(self) -> float | None:
        return self._metres
