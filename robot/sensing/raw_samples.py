"""Raw samples of the sensors and what they look like, for calibration and diagnosis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robot.drivers.links.analogue_inputs import AnalogueInputs
from robot.drivers.sensors.contracts import DistanceSensor
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


def sample_channel(
    inputs: AnalogueInputs, channel: int, *, count: int, rate: float, clock: Clock
) -> Spread:
    """Volts at a connected channel, ``count`` scans at ``rate`` per second.

    Raises:
        DeviceError: The board failed, or the channel is stuck or at an end of its range.
    """
    volts = []
    for _ in range(count):
        volts.append(inputs.scan()[channel])
        inputs.check([channel])
        clock.sleep(1.0 / rate)
    return spread(volts)


def sample_distance(sensor: DistanceSensor, *, count: int) -> Spread | None:
    """Metres, ``count`` measurements one after another.

    Returns:
        Those that saw a target, or ``None`` when more than half saw none.

    Raises:
        DeviceError: The sensor failed.
    """
    seen = [value for value in (sensor.distance() for _ in range(count)) if value is not None]
    return spread(seen) if 2 * len(seen) >= count else None
