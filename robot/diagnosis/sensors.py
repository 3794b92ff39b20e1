"""The analogue inputs, the accelerometer, the strain gauges and the distance sensor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from robot.configuration.robot_config import RobotConfig
from robot.diagnosis.findings import Finding, bad, failed, look, ok
from robot.drivers.dmm32 import RANGES
from robot.errors import DeviceDataError, DeviceError
from robot.host.clock import Clock
from robot.sensing.plausibility import STUCK_AFTER, ChannelWatch
from robot.sensing.raw_samples import spread
from robot.sensing.sensors import (
    PLAUSIBLE_G,
    AnalogueInput,
    BellySensor,
    RangeFinder,
    tilt_at_rest,
)
from robot.sensing.touch import TouchGauge

FAST_SCANS: Final = 200
SCANS: Final = 5 * STUCK_AFTER
DISTANCES: Final = 20
_FLICKER: Final = 4.0  # a threshold nearer to zero than so many rms of noise is crossed by it
_MOST_FORCE: Final = 50.0  # N; the robot weighs a few
_LEANS: Final = math.radians(10)
_BELOW_GROUND: Final = -0.005  # m
_UNSTEADY: Final = 3.0  # mm rms


class Inputs:
    """What the analogue inputs gave while the robot rested.

    Args:
        config: The robot.
        scans: Volts, scan by scan, from channel ``low`` on.
        low: That channel.
    """

    def __init__(self, config: RobotConfig, scans: Sequence[Sequence[float]], low: int):
        self._range = RANGES[config.daq.input_range]
        self._scans = scans
        self._low = low

    def of(self, channel: int) -> list[float]:
        """The volts at one channel."""
        return [scan[channel - self._low] for scan in self._scans]

    def dead(self, names: Mapping[int, str]) -> DeviceDataError | None:
        """The first of some channels that is at an end of its range or stuck."""
        watch = ChannelWatch(names, first=self._low, rails=(self._range.low, self._range.high))
        for scan in self._scans:
            watch.feed(scan)
        try:
            watch.check(self._scans[-1])
        except DeviceDataError as error:
            return error
        return None


def check_inputs(
    config: RobotConfig, adc: AnalogueInput, clock: Clock
) -> tuple[Finding, Inputs | None]:
    """Scans as fast as possible, for the rate, and then at the rate of the settings."""
    subject = "analogue inputs"
    channels = [*config.accelerometer.channels, *(gauge.channel for gauge in config.gauges)]
    low, high = min(channels), max(channels)
    wanted = config.settling.rate
    try:
        start = clock.now()
        for _ in range(FAST_SCANS):
            adc.scan(low, high)
        rate = FAST_SCANS / max(clock.now() - start, 1e-9)
        scans = []
        for _ in range(SCANS):
            scans.append(adc.scan(low, high))
            clock.sleep(1.0 / wanted)
    except DeviceError as error:
        return failed(subject, error), None
    text = f"channels {low} to {high}, {config.daq.input_range}, {rate:,.0f} scans a second"
    inputs = Inputs(config, scans, low)
    if rate < wanted:
        return bad(
            subject,
            f"{text}: slower than settling.rate_hz, {wanted:g}.",
            "Lower settling.rate_hz, or end what else keeps this computer busy.",
        ), inputs
    return ok(subject, text), inputs


def check_accelerometer(
    config: RobotConfig, inputs: Inputs
) -> tuple[Finding, tuple[float, float] | None]:
    """Returns what was found, and the tilt (left/right, forward/back; rad) if it is believable."""
    subject, sensor = "accelerometer", config.accelerometer
    dead = inputs.dead(dict(zip(sensor.channels, ("axis x", "axis y", "axis z"), strict=True)))
    if dead is not None:
        return failed(subject, dead), None
    volts = zip(*(inputs.of(channel) for channel in sensor.channels), strict=True)
    samples = [sensor.acceleration(triple) for triple in volts]
    axes = [spread(axis) for axis in zip(*samples, strict=True)]
    x, y, z = (axis.mean for axis in axes)
    length = math.hypot(x, y, z)
    noise = max(axis.deviation for axis in axes) * 1000
    if not PLAUSIBLE_G[0] <= length <= PLAUSIBLE_G[1]:
        return bad(
            subject,
            f"{length:.2f} g at rest instead of 1 g (x {x:+.2f}, y {y:+.2f}, z {z:+.2f}).",
            "Check its wires and supply; then: robotd calibrate --only accelerometer",
        ), None
    tilt = tilt_at_rest((x, y, z))
    across, along = (math.degrees(angle) for angle in tilt)
    text = (
        f"{length:.3f} g; tilt {across:+.1f}° left up, {along:+.1f}° nose up; noise {noise:.1f} mg"
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
            "If it does not: robotd calibrate --only accelerometer",
        ), tilt
    if max(abs(across), abs(along)) > math.degrees(_LEANS):
        return look(
            subject, text, "If the robot is level: robotd calibrate --only accelerometer"
        ), tilt
    return ok(subject, text), tilt


def check_gauge(gauge: TouchGauge, inputs: Inputs) -> Finding:
    """One strain gauge."""
    subject = f"touch {gauge.name}"
    again = f"robotd calibrate --only {gauge.name}"
    dead = inputs.dead({gauge.channel: "this gauge"})
    if dead is not None:
        return failed(subject, dead)
    force = spread([gauge.force(volts) for volts in inputs.of(gauge.channel)])
    text = f"{force.mean:+.3f} N, noise {force.deviation:.3f} N; touches above {gauge.on:g} N"
    if force.mean < -gauge.on or force.mean > _MOST_FORCE:
        return bad(
            subject,
            f"{text}. The ground does not pull, nor does the robot weigh that much.",
            f"If no foot is clamped: {again}",
        )
    if gauge.on < _FLICKER * force.deviation:
        return bad(
            subject, f"{text}: noise alone makes it flicker.", f"Check shield and supply; {again}"
        )
    return ok(subject, f"{text}: {'touching' if force.mean > gauge.on else 'free'}")


def check_distance(
    config: RobotConfig,
    sensor: BellySensor,
    finder: RangeFinder,
    tilt: tuple[float, float] | None,
    clock: Clock,
) -> Finding:
    """The distance sensor, also against the tilt where that is known (rad)."""
    subject = "distance"
    start = clock.now()
    try:
        seen = [finder.range_mm() for _ in range(DISTANCES)]
    except DeviceError as error:
        return failed(subject, error)
    took = (clock.now() - start) / DISTANCES * 1000
    near = [value for value in seen if value is not None]
    if 2 * len(near) < DISTANCES:
        return look(
            subject,
            f"sees nothing within {sensor.reach * 1000:.0f} mm; {took:.0f} ms a measurement",
            "Right, if the belly is that high. Else clean the sensor, use a light, dull ground.",
        )
    found = spread(near)
    clearance = sensor.clearance(found.mean)
    text = (
        f"{clearance * 1000:+.1f} mm of clearance, noise {found.deviation:.1f} mm, "
        f"{took:.0f} ms a measurement"
    )
    if clearance < _BELOW_GROUND:
        return bad(
            subject,
            f"{text}: the ground would be inside the belly.",
            "Look that nothing covers the sensor; then: robotd calibrate --only distance",
        )
    if tilt is not None:
        try:
            config.underside.check(clearance, tilt)
        except DeviceDataError as error:
            return failed(subject, error)
    if found.deviation > _UNSTEADY or len(near) < DISTANCES:
        missed = DISTANCES - len(near)
        return look(
            subject,
            f"{text}; {missed} of {DISTANCES} saw nothing",
            "Shade it from bright light, clean it, use a light, dull ground.",
        )
    return ok(subject, text)
