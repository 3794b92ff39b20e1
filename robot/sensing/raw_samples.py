"""Raw samples of the sensors and what they look like, for calibration and diagnosis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robot.drivers.analogue_inputs import AnalogueBoard
from robot.drivers.sensor_drivers import DistanceSensor
from robot.host.clock import Clock


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Statistics of some samples, all in their unit."""

    mean: float
    deviation: float
    least: float
    most: float
    count: int


def spread(values: Sequence[float]) -> Spread:
    """Mean, standard deviation and extremes of at least one sample."""
    mean = sum(values) / len(values)
    square = sum((value - mean) ** 2 for value in values) / max(1, len(values) - 1)
    return Spread(
        mean=mean,
        deviation=math.sqrt(square),
        least=min(values),
        most=max(values),
        count=len(values),
    )


def sample_channels(
    board: AnalogueBoard, channels: Sequence[int], *, count: int, rate: float, clock: Clock
) -> list[Spread]:
    """Volts at some channels, ``count`` scans at ``rate`` per second.

    Raises:
        DeviceError: The board failed.
    """
    low, high = min(channels), max(channels)
    scans = []
    for _ in range(count):
        scans.append(board.scan(low, high))
        clock.sleep(1.0 / rate)
    return [spread([scan[channel - low] for scan in scans]) for channel in channels]


def sample_distance(sensor: DistanceSensor, *, count: int) -> Spread | None:
    """Metres, ``count`` measurements one after another.

    Returns:
        Those that saw a target, or ``None`` when more than half saw none.

    Raises:
        DeviceError: The sensor failed.
    """
    seen = [value for value in (sensor.distance() for _ in range(count)) if value is not None]
    return spread(seen) if 2 * len(seen) >= count else None
