"""A touch sensor's load becomes one bit: hysteresis against dithering, debounce against spikes."""

from __future__ import annotations

from dataclasses import dataclass

from robot.drivers.sensors.contracts import SensorSettings


@dataclass(frozen=True, kw_only=True)
class TouchPoint:
    """A part that feels touch.

    Attributes:
        name: The part.
        driver: Its sensor.
        on: Load above which the part touches, N; a switch needs none.
        off: Load below which it no longer does, N.
        debounce: Consecutive samples that must agree before the bit changes.
    """

    name: str
    driver: SensorSettings
    on: float
    off: float
    debounce: int


class TouchDetector:
    """The bit of one part, sample by sample."""

    def __init__(self, point: TouchPoint):
        self._point = point
        self.reset()

    def reset(self) -> None:
        """Forgets: what a foot felt in an earlier pose says nothing about this one."""
        self.touching = False
        self._against = 0

    def feed(self, load: float | bool) -> bool:
        """Takes one sample of a ``TouchSensor`` and returns the bit."""
        if isinstance(load, bool):
            wanted = load
        else:
            wanted = load > (self._point.off if self.touching else self._point.on)
        self._against = self._against + 1 if wanted != self.touching else 0
        if self._against >= self._point.debounce:
            self.touching = wanted
            self._against = 0
        return self.touching
