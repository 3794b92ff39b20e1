"""Series of samples: their spread, and whether the robot rests, judged by its tilt.

Every change of pose disturbs the tilt. Rest means: within the window the tilt neither swings (peak
to peak) nor drifts (mean of the first half against the second). A body that tips over slowly drifts
long before it swings.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from robot.drivers.links.analogue_inputs import AnalogueInputs
from robot.host.clock import Clock

LEAST_SAMPLES: Final = 4
"""Samples in a window below which it is not judged."""


@dataclass(frozen=True, kw_only=True)
class RestCriterion:
    """What counts as rest.

    The usual look back is a second because a body that stands on an edge begins to tip over
    imperceptibly: of 1,200 random poses of six simulated bodies four passed for rest after 0.3 s,
    3° to 28° from where they came to rest; after 1 s none did.

    Attributes:
        window: Length of the look back, s.
        swing: Largest peak-to-peak change within the window, rad.
        drift: Largest change of the mean between the halves of the window, rad.
        timeout: Time after which sampling begins all the same, s.
        rate: Samples per second while waiting.
    """

    window: float = 1.0
    swing: float = math.radians(0.5)
    drift: float = math.radians(0.1)
    timeout: float = 5.0
    rate: float = 50.0


class RestDetector:
    """Decides from tilt samples whether the robot rests."""

    def __init__(self, criterion: RestCriterion):
        self._criterion = criterion
        self._samples: deque[tuple[float, tuple[float, ...]]] = deque()

    def feed(self, now: float, values: tuple[float, ...]) -> bool:
        """Adds one sample (rad) taken at ``now`` (s); true when the window is full and calm."""
        self._samples.append((now, values))
        while self._samples[0][0] < now - self._criterion.window - 1e-9:
            self._samples.popleft()
        expected = int(self._criterion.window * self._criterion.rate)
        if len(self._samples) < max(LEAST_SAMPLES, expected // 2):
            return False  # a sample takes time of its own, so there are fewer than the rate says
        oldest, (previous, _) = self._samples[0][0], self._samples[-2]
        if now - oldest + (now - previous) < self._criterion.window - 1e-9:
            return False  # the window is not full: one more sample would still fit
        half = len(self._samples) // 2
        for axis in zip(*(values for _, values in self._samples), strict=True):
            if max(axis) - min(axis) > self._criterion.swing:
                return False
            early, late = axis[:half], axis[half:]
            if abs(sum(early) / len(early) - sum(late) / len(late)) > self._criterion.drift:
                return False
        return True

    def mean(self) -> tuple[float, ...]:
        """Mean of the samples in the window, rad."""
        values = (values for _, values in self._samples)
        return tuple(sum(axis) / len(axis) for axis in zip(*values, strict=True))


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Statistics of some samples, in the unit of the samples."""

    mean: float
    deviation: float
    least: float
    most: float
    count: int


def spread(values: Sequence[float]) -> Spread:
    """Returns mean, standard deviation and extremes of at least one sample."""
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
    """Statistics of the volts at a connected channel: ``count`` scans at ``rate`` per second.

    Raises:
        DeviceError: The board failed, or the channel is stuck or at an end of its range.
    """
    volts = []
    for _ in range(count):
        volts.append(inputs.scan()[channel])
        inputs.check([channel])
        clock.sleep(1.0 / rate)
    return spread(volts)
