"""Volts and millimetres become tilt, touch and clearance.

A resting accelerometer measures the world's up direction in the body frame times 1 g, so a reading
whose length is far from 1 g is no rest, or no accelerometer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from protocol.wire.readings import tilt_of
from robot.errors import DeviceDataError
from robot.host.clock import Clock
from robot.sensing.plausibility import ChannelWatch, Underside
from robot.sensing.touch import TouchDetector, TouchGauge

OnProgress: TypeAlias = Callable[[float], None]
PLAUSIBLE_G = (0.9, 1.1)

_AXES = tuple(f"the accelerometer's {axis} axis" for axis in "xyz")


class AnalogueInput(Protocol):
    """Reads a block of analogue channels."""

    def scan(self, low: int, high: int) -> list[float]:
        """Volts of the channels ``low`` to ``high``."""


class AnalogueBoard(AnalogueInput, Protocol):
    """A data acquisition board, found."""

    def probe(self) -> None:
        """Makes sure that it is there, and as it should be."""

    def close(self) -> None:
        """Gives it back."""


class RangeFinder(Protocol):
    """Measures a distance once."""

    def range_mm(self) -> int | None:
        """Millimetres, or ``None`` where there is no target in range."""


@dataclass(frozen=True, kw_only=True)
class Accelerometer:
    """Three analogue axes, x forward, y left, z up: volts at 0 g and volts per g."""

    channels: tuple[int, ...]
    zero: tuple[float, ...]
    volts_per_g: tuple[float, ...]

    def acceleration(self, volts: Sequence[float]) -> tuple[float, ...]:
        """Acceleration along x, y, z in g."""
        triples = zip(volts, self.zero, self.volts_per_g, strict=True)
        return tuple((value - zero) / gain for value, zero, gain in triples)


@dataclass(frozen=True, kw_only=True)
class BellySensor:
    """The distance sensor.

    Attributes:
        zero: What it reads with the belly on the ground, m.
        reach: The largest clearance that it tells, m.
        scale: Metres of clearance per metre that it reads; 1 for a sensor that reads true.
    """

    zero: float
    reach: float
    scale: float = 1.0

    def clearance(self, millimetres: float) -> float:
        """The clearance that a reading stands for, m."""
        return (millimetres / 1000.0 - self.zero) * self.scale


@dataclass(frozen=True, kw_only=True)
class Reading:
    """One average over a resting robot; angles in rad, clearance in m; ``None``: not measured."""

    tilt: tuple[float, float] | None
    touch: tuple[bool, ...] | None
    clearance: float | None
    clearance_saturated: bool
    samples: int
    time: float


def ignore(fraction: float) -> None:
    """What becomes of progress that nobody wants to hear of."""


def tilt_at_rest(acceleration: Sequence[float]) -> tuple[float, float]:
    """Both tilt angles, rad, of a robot whose accelerometer feels nothing but gravity."""
    length = math.hypot(*acceleration) or 1.0
    return tilt_of([value / length for value in acceleration])


class Senses(Protocol):
    """What an interaction needs of the sensors."""

    def tilt(self) -> tuple[float, float]:
        """One sample of both tilt angles, rad, while the robot may still move."""

    def average(self, samples: int, report: OnProgress = ignore) -> Reading:
        """Averages ``samples`` samples of everything.

        ``report`` is told the share that is done, before each sample and at the end; it may raise
        to end it.
        """


class Sensing:
    """All sensors of the robot behind one door.

    Args:
        adc: The data acquisition board.
        belly: The distance sensor with its calibration, or ``None``.
        accelerometer: Channels and calibration.
        gauges: One per touch sensor, may be empty.
        clock: The robot clock.
        rate: Samples per second.
        rails: The volts at the ends of the input range, or ``None`` not to look for railed inputs.
        underside: The belly, or ``None`` not to hold the distance against the tilt.
    """

    def __init__(
        self,
        adc: AnalogueInput,
        *,
        belly: tuple[RangeFinder, BellySensor] | None,
        accelerometer: Accelerometer,
        gauges: Sequence[TouchGauge],
        clock: Clock,
        rate: float,
        rails: tuple[float, float] | None = None,
        underside: Underside | None = None,
    ):
        self._adc = adc
        self._belly = belly
        self._accelerometer = accelerometer
        self._touch = [TouchDetector(gauge) for gauge in gauges]
        self._clock = clock
        self._period = 1.0 / rate
        self._underside = underside
        names = dict(zip(accelerometer.channels, _AXES, strict=True))
        names |= {gauge.channel: f"the gauge of {gauge.name}" for gauge in gauges}
        self._low, self._high = min(names), max(names)
        self._watch = ChannelWatch(names, first=self._low, rails=rails)

    def tilt(self) -> tuple[float, float]:
        """One sample of both tilt angles, rad, while the robot may still move."""
        return tilt_at_rest(self._acceleration(self._volts()))

    def average(self, samples: int, report: OnProgress = ignore) -> Reading:
        """Averages ``samples`` samples of everything.

        Args:
            samples: How many.
            report: Told the share that is done, before each sample and at the end; what it raises
                ends the average.

        Raises:
            DeviceDataError: The readings cannot be: what the accelerometer feels is not gravity, a
                channel is stuck or at an end of its range, the distance contradicts the tilt.
            DeviceError: A device failed.
        """
        total = [0.0] * 3
        distances: list[float | None] = []
        for detector in self._touch:
            detector.reset()
        for done in range(samples):
            report(done / samples)
            volts = self._volts()
            self._watch.check(volts)
            total = [a + b for a, b in zip(total, self._acceleration(volts), strict=True)]
            for detector in self._touch:
                detector.feed(volts[detector.gauge.channel - self._low])
            if self._belly is not None:
                distances.append(self._distance(*self._belly))
            self._clock.sleep(self._period)
        report(1.0)
        mean = [value / samples for value in total]
        length = math.hypot(*mean)
        if not PLAUSIBLE_G[0] <= length <= PLAUSIBLE_G[1]:
            raise DeviceDataError(
                f"The accelerometer reads {length:.2f} g at rest instead of 1 g.",
                "Check its wiring, supply and calibration.",
            )
        tilt = tilt_at_rest(mean)
        clearance, saturated = self._clearance(distances)
        if self._underside is not None and clearance is not None and mean[2] > 0 and not saturated:
            self._underside.check(clearance, tilt)
        return Reading(
            tilt=tilt,
            touch=tuple(detector.touching for detector in self._touch) or None,
            clearance=clearance,
            clearance_saturated=saturated,
            samples=samples,
            time=self._clock.now(),
        )

    def _volts(self) -> list[float]:
        volts = self._adc.scan(self._low, self._high)
        self._watch.feed(volts)
        return volts

    def _acceleration(self, volts: Sequence[float]) -> tuple[float, ...]:
        picked = [volts[channel - self._low] for channel in self._accelerometer.channels]
        return self._accelerometer.acceleration(picked)

    @staticmethod
    def _distance(finder: RangeFinder, sensor: BellySensor) -> float | None:
        millimetres = finder.range_mm()
        return None if millimetres is None else sensor.clearance(millimetres)

    def _clearance(self, distances: Sequence[float | None]) -> tuple[float | None, bool]:
        if self._belly is None:
            return None, False
        reach = self._belly[1].reach
        seen = [value for value in distances if value is not None and value < reach]
        if 2 * len(seen) < len(distances):
            return reach, True
        return sum(seen) / len(seen), False
