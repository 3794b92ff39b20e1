"""From samples of the sensors to tilt, touch and clearance.

A resting accelerometer measures the world's up direction in the body frame times 1 g, so a reading
whose length is far from 1 g is no rest, or no accelerometer. A touch sensor's load becomes one bit,
with hysteresis against dithering and debounce against spikes. A body that leans cannot have its
belly on the ground: a distance that contradicts the tilt is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from protocol.wire.readings import tilt_of, up_of
from robot.drivers.sensors.contracts import (
    Accelerometer,
    DistanceSensor,
    DistanceSettings,
    SensorSettings,
    TouchSensor,
)
from robot.errors import DeviceDataError
from robot.host.clock import Clock
from robot.uncertainty import Uncertainty

OnProgress: TypeAlias = Callable[[float], None]
PLAUSIBLE_G: Final = (0.9, 1.1)
"""Least and greatest length of a calibrated reading at rest, g; chosen, not tuned."""


@dataclass(frozen=True, kw_only=True)
class BellySensor:
    """The distance sensor under the belly, with its calibration.

    Attributes:
        driver: Settings of its driver.
        zero: Reading with the belly on the ground, m.
        reach: Largest clearance that it tells, m.
        scale: Metres of clearance per metre that it reads; 1 for a sensor that reads true.
        uncertainty: Uncertainty of zero and scale.
    """

    driver: DistanceSettings
    zero: float
    reach: float
    scale: float = 1.0
    uncertainty: Uncertainty = Uncertainty()

    def clearance(self, distance: float) -> float:
        """The clearance that a reading stands for, m."""
        return (distance - self.zero) * self.scale


@dataclass(frozen=True, kw_only=True)
class Reading:
    """One average over a resting robot; its fields are those of ``ObservationReply``.

    ``robot_time`` is that of the last sample, s.
    """

    tilt: tuple[float, float] | None = None
    zero_tilt: tuple[float, ...] | None = None
    touch: tuple[bool, ...] | None = None
    clearance: float | None = None
    clearance_saturated: bool = False
    samples: int = 1
    robot_time: float = 0.0
    settled: bool = False
    settle_time: float = 0.0
    saturated_joints: tuple[str, ...] = ()
    measured: Mapping[str, float] | None = None
    off_target: Mapping[str, str] | None = None


def ignore(fraction: float) -> None:
    """An ``OnProgress`` that does nothing."""


def tilt_at_rest(acceleration: Sequence[float]) -> tuple[float, float]:
    """Both tilt angles, rad, of a robot whose accelerometer measures nothing but gravity."""
    length = math.hypot(*acceleration) or 1.0
    return tilt_of([value / length for value in acceleration])


@dataclass(frozen=True, kw_only=True)
class TouchPoint:
    """A part with a touch sensor.

    Attributes:
        name: Name of the part.
        driver: Settings of its sensor's driver.
        on: Load above which the part touches, N; a switch needs none.
        off: Load below which it no longer touches, N.
        debounce: Consecutive samples that must agree before the bit changes.
    """

    name: str
    driver: SensorSettings
    on: float
    off: float
    debounce: int


class TouchDetector:
    """The touch bit of one part, sample by sample."""

    def __init__(self, point: TouchPoint):
        self._point = point
        self.reset()

    def reset(self) -> None:
        """Forgets all samples: what a foot felt in an earlier pose says nothing about this one."""
        self.touching = False
        self._against = 0

    def feed(self, load: float | bool) -> bool:
        """Takes one sample of a ``TouchSensor`` and returns the bit."""
        if isinstance(load, bool):
            touching = load
        else:
            touching = load > (self._point.off if self.touching else self._point.on)
        self._against = self._against + 1 if touching != self.touching else 0
        if self._against >= self._point.debounce:
            self.touching = touching
            self._against = 0
        return self.touching


LEAST_MARGIN: Final = 0.010
"""Smallest margin by which distance and tilt may contradict each other, m."""

_DISTANCE_SIGMAS: Final = 10.0  # rms errors; wide, for such a sensor errs by placement, too
_TILT_SIGMAS: Final = 5.0  # rms errors; not tuned
_STEEPEST: Final = math.cos(math.radians(60))  # beyond it, 1° of tilt is worth too many metres


@dataclass(frozen=True, kw_only=True)
class Underside:
    """The belly, by which distance and tilt are checked against each other.

    Attributes:
        size: Size along x and y, m.
        round: Whether it is a disc, else a rectangle.
        tilt_noise: Root mean square error of one observation of tilt, rad.
        clearance_noise: Root mean square error of one observation of clearance, m.
    """

    size: tuple[float, ...]
    round: bool = False
    tilt_noise: float = 0.0
    clearance_noise: float = 0.0

    @property
    def margin(self) -> float:
        """Metres by which distance and tilt may contradict each other, both erring as announced."""
        lifted = _TILT_SIGMAS * self.tilt_noise * sum(self.size) / 2
        return max(LEAST_MARGIN, _DISTANCE_SIGMAS * self.clearance_noise + lifted)

    def check(self, clearance: float, tilt: tuple[float, float], *, sensor: str) -> None:
        """Checks that a clearance fits a tilt: nothing of the belly is below the ground.

        Args:
            clearance: Distance from belly to ground, m.
            tilt: Left/right and forward/back tilt, rad.
            sensor: Name of the distance sensor.

        Raises:
            DeviceDataError: The clearance does not fit the tilt.
        """
        along, across, upright = map(abs, up_of(tilt))
        if upright < _STEEPEST:
            return
        x, y = self.size[0] * along / 2, self.size[1] * across / 2
        least = (math.hypot(x, y) if self.round else x + y) / upright
        if clearance < least - self.margin:
            lean = math.degrees(math.acos(upright))
            raise DeviceDataError(
                f"The distance sensor ({sensor}) says {clearance * 1000:.0f} mm, but the belly of "
                f"a body that leans by {lean:.0f}° is at least {least * 1000:.0f} mm up.",
                "One of the two is wrong, or the ground is not level: check the distance sensor, "
                "then the accelerometer.",
            )


class RobotSensors:
    """All sensors of the robot.

    Args:
        accelerometer: Driver of the accelerometer, or ``None``.
        touch: The parts that feel touch, each with its driver; may be empty.
        belly: The distance sensor's driver and calibration, or ``None``.
        clock: The robot clock.
        rate: Samples per second.
        underside: The belly, or ``None`` not to hold the distance against the tilt.
    """

    def __init__(
        self,
        *,
        accelerometer: Accelerometer | None,
        touch: Sequence[tuple[TouchPoint, TouchSensor]],
        belly: tuple[DistanceSensor, BellySensor] | None,
        clock: Clock,
        rate: float,
        underside: Underside | None = None,
    ):
        self._accelerometer = accelerometer
        self._touch = [(TouchDetector(point), sensor) for point, sensor in touch]
        self._belly = belly
        self._clock = clock
        self._period = 1.0 / rate
        self._underside = underside

    def tilt(self) -> tuple[float, float] | None:
        """One sample of both tilt angles, rad, while the robot may still move; or ``None``."""
        if self._accelerometer is None:
            return None
        return tilt_at_rest(self._accelerometer.acceleration())

    def average(self, samples: int, report: OnProgress = ignore) -> Reading:
        """Averages ``samples`` samples of everything.

        Args:
            samples: Number of samples.
            report: Told the share that is done, before each sample and at the end; what it raises
                ends the average.

        Raises:
            DeviceDataError: The readings cannot be: what the accelerometer feels is not gravity, a
                sensor is stuck or disconnected, the distance contradicts the tilt.
            DeviceError: A device failed.
        """
        total = [0.0] * 3
        distances: list[float | None] = []
        for detector, _ in self._touch:
            detector.reset()
        for done in range(samples):
            report(done / samples)
            if self._accelerometer is not None:
                acceleration = self._accelerometer.acceleration()
                self._accelerometer.check()
                total = [a + b for a, b in zip(total, acceleration, strict=True)]
            for detector, sensor in self._touch:
                detector.feed(sensor.load())
                sensor.check()
            if self._belly is not None:
                distances.append(self._belly[0].distance())
                self._belly[0].check()
            self._clock.sleep(self._period)
        report(1.0)
        mean = [value / samples for value in total]
        tilt = self._tilt_of(mean)
        clearance, saturated = None, False
        if self._belly is not None:
            finder, belly = self._belly
            clearance, saturated = _clearance(belly, distances)
            if self._underside is not None and tilt is not None and mean[2] > 0 and not saturated:
                self._underside.check(clearance, tilt, sensor=finder.name)
        return Reading(
            tilt=tilt,
            touch=tuple(detector.touching for detector, _ in self._touch) or None,
            clearance=clearance,
            clearance_saturated=saturated,
            samples=samples,
            robot_time=self._clock.now(),
        )

    def _tilt_of(self, acceleration: Sequence[float]) -> tuple[float, float] | None:
        if self._accelerometer is None:
            return None
        length = math.hypot(*acceleration)
        if not PLAUSIBLE_G[0] <= length <= PLAUSIBLE_G[1]:
            raise DeviceDataError(
                f"The accelerometer ({self._accelerometer.name}) reads {length:.2f} g at rest "
                "instead of 1 g.",
                "Check its wiring, supply and calibration.",
            )
        return tilt_at_rest(acceleration)


def _clearance(belly: BellySensor, distances: Sequence[float | None]) -> tuple[float, bool]:
    """The mean clearance, m, and false; the reach and true where most samples lie beyond it."""
    clearances = (belly.clearance(distance) for distance in distances if distance is not None)
    in_reach = [clearance for clearance in clearances if clearance < belly.reach]
    if 2 * len(in_reach) < len(distances):
        return belly.reach, True
    return sum(in_reach) / len(in_reach), False
