"""The analogue inputs, the accelerometer, the touch sensors and the distance sensor."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, Final, Generic, TypeVar

from robot.calibration.sensors import LOADS
from robot.configuration.robot_config import RobotConfig
from robot.diagnosis.findings import Finding, bad, failed, look, ok
from robot.drivers.links.analogue_inputs import STUCK_AFTER, AnalogueInputs
from robot.drivers.sensors.analogue import StrainGauge
from robot.drivers.sensors.contracts import BoardSettings, DistanceSensor, SensorDriver
from robot.errors import DeviceDataError, DeviceError
from robot.host.clock import Clock
from robot.sensing.samples import spread
from robot.sensing.sensors import PLAUSIBLE_G, BellySensor, TouchPoint, tilt_at_rest

Sample = TypeVar("Sample")

FAST_SCANS: Final = 200  # enough to be timed; not tuned
SAMPLES: Final = 5 * STUCK_AFTER  # so that a stuck input is noticed
DISTANCES: Final = 20  # not tuned
_FLICKER_SIGMAS: Final = 4.0  # a threshold below this many rms of noise is crossed by it
_MAX_LEAN: Final = math.radians(2)  # on ground that slopes by more lengths are found wrong
_BELOW_GROUND: Final = -0.005  # m; beyond the error of a calibrated sensor
_MAX_DISTANCE_NOISE: Final = 3e-3  # m rms; not tuned


class Recording(Generic[Sample]):
    """The samples of one sensor while the robot rested, until the sensor failed.

    Args:
        driver: Driver of the sensor.
        read: Takes one sample of the sensor.

    Attributes:
        name: Name of the device.
        samples: Samples that were taken.
        failure: Why the sensor cannot be believed, or ``None``.
    """

    def __init__(self, driver: SensorDriver, read: Callable[[], Sample]):
        self._driver = driver
        self._read = read
        self.name = driver.name
        self.samples: list[Sample] = []
        self.failure: DeviceError | None = None

    @property
    def details(self) -> str:
        """What else the driver has to tell, for the end of a sentence; a driver need not."""
        tell: Callable[[], str] | None = getattr(self._driver, "details", None)
        return f"; {tell()}" if tell is not None and self.failure is None else ""

    def sample(self) -> None:
        """Takes one sample."""
        self._attempt(lambda: self.samples.append(self._read()))

    def check(self) -> None:
        """Asks the driver whether its latest readings can be believed."""
        self._attempt(self._driver.check)

    def _attempt(self, action: Callable[[], None]) -> None:
        if self.failure is None:
            try:
                action()
            except DeviceError as error:
                self.failure = error


def record(recordings: Sequence[Recording[Any]], rate: float, clock: Clock) -> None:
    """Samples sensors together, ``rate`` times a second, and asks whether they can be believed."""
    for _ in range(SAMPLES):
        for recording in recordings:
            recording.sample()
        clock.sleep(1.0 / rate)
    for recording in recordings:
        recording.check()


def check_inputs(
    inputs: AnalogueInputs, settings: BoardSettings, wanted: float, clock: Clock
) -> tuple[Finding, bool]:
    """Scans as fast as possible; the rate must be at least ``wanted``, that of the settings.

    Returns:
        What was observed, and whether the board works at all.
    """
    subject = "analogue inputs"
    try:
        start = clock.now()
        for _ in range(FAST_SCANS):
            inputs.scan()
        rate = FAST_SCANS / max(clock.now() - start, 1e-9)
    except DeviceError as error:
        return failed(subject, error), False
    low, high = inputs.channels
    text = f"{settings.name}: channels {low} to {high}, {settings}, {rate:,.0f} scans a second"
    if rate < wanted:
        return bad(
            subject,
            f"{text}: slower than settling.rate_hz, {wanted:g}.",
            "Lower settling.rate_hz, or end what else keeps this computer busy.",
        ), True
    return ok(subject, text), True


def check_accelerometer(
    config: RobotConfig, recording: Recording[tuple[float, float, float]]
) -> tuple[Finding, tuple[float, float] | None]:
    """Examines the accelerometer.

    Args:
        config: Configuration of the robot.
        recording: The sensor's samples.

    Returns:
        What was observed, and the tilt (left/right, forward/back; rad) if it is credible.
    """
    subject = "accelerometer"
    if recording.failure is not None:
        return failed(subject, recording.failure), None
    ending, part = ("; then:", subject) if config.axes else (".", "")
    axes = [spread(axis) for axis in zip(*recording.samples, strict=True)]
    x, y, z = (axis.mean for axis in axes)
    length = math.hypot(x, y, z)
    noise = max(axis.deviation for axis in axes) * 1000
    if not PLAUSIBLE_G[0] <= length <= PLAUSIBLE_G[1]:
        return bad(
            subject,
            f"{recording.name}: {length:.2f} g at rest instead of 1 g "
            f"(x {x:+.2f}, y {y:+.2f}, z {z:+.2f}).",
            f"Check its wires and supply{ending}",
            part,
        ), None
    tilt = tilt_at_rest((x, y, z))
    across, along = (math.degrees(angle) for angle in tilt)
    text = (
        f"{recording.name}: {length:.3f} g; tilt {across:+.1f}° left up, {along:+.1f}° nose up; "
        f"noise {noise:.1f} mg{recording.details}"
    )
    swing = max(math.asin(min(1.0, axis.most - axis.least)) for axis in axes[:2])
    if swing > config.settling.swing:
        allowed = math.degrees(config.settling.swing)
        return bad(
            subject,
            f"{text}: swings by {math.degrees(swing):.1f}°, and rest is at most {allowed:g}°.",
            "Let nothing shake the robot, add a filter capacitor, or raise settling.swing_deg.",
        ), tilt
    if z < 0:
        return bad(
            subject,
            f"{text}: it says the robot lies on its back.",
            f"If it does not, look how it is mounted{ending}",
            part,
        ), tilt
    if max(abs(across), abs(along)) > math.degrees(_MAX_LEAN):
        advice = f"Level the ground, or, if it is level, look how the sensor is mounted{ending}"
        return look(subject, text, advice, part), tilt
    return ok(subject, text), tilt


def check_touch(point: TouchPoint, recording: Recording[float | bool]) -> Finding:
    """Examines one touch sensor."""
    subject = f"touch {point.name}"
    if recording.failure is not None:
        return failed(subject, recording.failure)
    if all(isinstance(load, bool) for load in recording.samples):
        changes = sum(a != b for a, b in pairwise(recording.samples))
        text = f"{recording.name}: {'touching' if recording.samples[-1] else 'free'}"
        if changes:
            return bad(subject, f"{text}; it flickered {changes} times.", "Check its wires.")
        return ok(subject, text)
    part = point.name if isinstance(point.driver, StrainGauge) else ""
    force = spread(recording.samples)
    text = (
        f"{recording.name}: {force.mean:+.3f} N, noise {force.deviation:.3f} N; touches above "
        f"{point.on:g} N"
    )
    if force.mean < -point.on or force.mean > LOADS[1]:
        return bad(
            subject,
            f"{text}. The ground does not pull, nor does the robot weigh that much.",
            "Look that no foot is clamped, and at its wires.",
            part,
        )
    if point.on < _FLICKER_SIGMAS * force.deviation:
        return bad(
            subject, f"{text}: noise alone makes it flicker.", "Check shield and supply.", part
        )
    return ok(subject, f"{text}: {'touching' if force.mean > point.on else 'free'}")


def check_distance(
    config: RobotConfig,
    sensor: BellySensor,
    finder: DistanceSensor,
    tilt: tuple[float, float] | None,
    clock: Clock,
) -> Finding:
    """Examines the distance sensor, also against the tilt (rad) where that is known."""
    subject = "distance"
    start = clock.now()
    try:
        samples = [finder.distance() for _ in range(DISTANCES)]
    except DeviceError as error:
        return failed(subject, error)
    took = (clock.now() - start) / DISTANCES * 1000
    distances = [value for value in samples if value is not None]
    if 2 * len(distances) < DISTANCES:
        return look(
            subject,
            f"{finder.name}: sees nothing within {sensor.reach * 1000:.0f} mm; {took:.0f} ms a "
            "measurement",
            "Right, if the belly is that high. Else clean the sensor, use a light, dull ground.",
        )
    measured = spread(distances)
    clearance = sensor.clearance(measured.mean)
    text = (
        f"{finder.name}: {clearance * 1000:+.1f} mm of clearance, noise "
        f"{measured.deviation * 1000:.1f} mm, "
        f"{took:.0f} ms a measurement"
    )
    if clearance < _BELOW_GROUND:
        return bad(
            subject,
            f"{text}: the ground would be inside the belly.",
            "Look that nothing covers the sensor; then:",
            subject,
        )
    if tilt is not None:
        try:
            config.underside.check(clearance, tilt, sensor=finder.name)
        except DeviceDataError as error:
            return failed(subject, error)
    if measured.deviation > _MAX_DISTANCE_NOISE or len(distances) < DISTANCES:
        missed = DISTANCES - len(distances)
        return look(
            subject,
            f"{text}; {missed} of {DISTANCES} saw nothing",
            "Shade it from bright light, clean it, use a light, dull ground.",
        )
    return ok(subject, text)
