"""The whole guided session: servo boards, joints, accelerometer, gauges, distance.

Each part is saved when it was measured, so that whoever leaves loses one part at most; it may be
skipped, and then keeps what it had. Whenever the session ends, the servos hold their last counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from functools import partial
from typing import Any, Final

from robot.calibration.joints import HELP, Mover, calibrate_joint
from robot.calibration.oscillators import measure_oscillators
from robot.calibration.questions import Questions
from robot.calibration.sensors import (
    SAMPLES,
    calibrate_accelerometer,
    calibrate_distance,
    calibrate_gauge,
    sample_at_rest,
)
from robot.configuration.calibration_file import (
    AxesCalibration,
    Calibration,
    DistanceCalibration,
    GaugeCalibration,
    JointCalibration,
    Part,
    check_calibration,
)
from robot.configuration.robot_config import RobotConfig
from robot.devices import Devices
from robot.errors import AbandonedError, CommandError, ConfigError
from robot.host.clock import Clock
from robot.sensing.samples import sample_channel
from robot.uncertainty import Uncertainty

WELCOME: Final = """\
Calibrates {robot}. Each part is written when it was measured. 'q' leaves at any question: the robot
then holds, and the part that you are at keeps what it had.
Keep clear of the legs: they move when you say so, slowly, and only as far as you say."""

JOINTS: Final = """
Joints. Put the robot on a stand, so that every leg can move freely. 0° is the planar pose: legs
straight out, level with the body; upward is positive."""

GAUGES: Final = """
Strain gauges. Leave the robot on its stand, no foot touching anything. You need one weight that
you know, 100 g or more, to hang on each foot in turn as the ground would push it: upward."""


def parts(config: RobotConfig) -> list[str]:
    """The names of everything that can be calibrated, in order.

    Other accelerometers and touch sensors give g and newtons by themselves.
    """
    return uncalibrated_parts(config, Calibration(robot=config.name))


def uncalibrated_parts(config: RobotConfig, calibration: Calibration) -> list[str]:
    """The names of those parts that a calibration lacks; a joint and a gauge may share a name."""
    joints, gauges = calibration.joints, calibration.gauges
    return [
        *(joint.name for joint in config.joints if joint.name not in joints),
        *(["accelerometer"] if config.axes and calibration.accelerometer is None else []),
        *(name for name in config.gauges if name not in gauges),
        *(["distance"] if config.distance and calibration.distance is None else []),
    ]


class GuidedSession:
    """One guided session.

    Args:
        config: Configuration of the robot, with its calibration so far.
        devices: Drivers of the robot's devices.
        clock: The robot clock.
        dialogue: Dialogue with the person.
        only: Names out of ``parts``; empty for all of them.

    Raises:
        CommandError: ``only`` names what is no part.
    """

    def __init__(
        self,
        config: RobotConfig,
        devices: Devices,
        *,
        clock: Clock,
        dialogue: Questions,
        only: Collection[str] = (),
    ):
        part_names = parts(config)
        for name in only:
            if name not in part_names:
                raise CommandError(f"this robot has no {name!r}; it has {', '.join(part_names)}")
        self._config = config
        self._devices = devices
        self._clock = clock
        self._dialogue = dialogue
        self._parts = set(only or part_names)

    def run(self, before: Calibration, save: Callable[[str, Calibration], None]) -> None:
        """Leads through all parts; each is confirmed and saved before the next begins.

        Args:
            before: Calibration so far, of which a skipped part keeps its own.
            save: Called with the name of a part, and with the whole calibration including it.

        Raises:
            AbandonedError: Somebody left, or the servo boards' oscillators were measured, which
                ``robot.toml`` must state before a joint is calibrated.
        """
        calibration = before
        try:
            self._dialogue.say(WELCOME.format(robot=self._config.name))
            for name, part in self._measured():
                updated = calibration.with_part(name, part)
                if updated != calibration and self._confirmed(name, calibration, updated):
                    save(name, updated)
                    calibration = updated
        except KeyboardInterrupt:
            raise AbandonedError("You left the session.") from None

    def _confirmed(self, name: str, before: Calibration, after: Calibration) -> bool:
        try:
            check_calibration(after, self._config.servos.known_counts)
        except ConfigError as error:
            self._dialogue.say(f"{name} is not taken and keeps what it had: {error}")
            return False
        self._dialogue.say("\n" + "\n".join(self._changes(before, after)))
        return self._dialogue.choose("write this: yes or no", "yes", "no") == "yes"

    def _measured(self) -> Iterator[tuple[str, Part]]:
        """Yields name and calibration of each part that is not skipped."""
        yield from self._joints()
        if (axes := self._accelerometer()) is not None:
            yield "accelerometer", axes
        yield from self._gauges()
        if (ruler := self._distance()) is not None:
            yield "distance", ruler

    def _joints(self) -> Iterator[tuple[str, JointCalibration]]:
        joints = [joint for joint in self._config.joints if joint.name in self._parts]
        if joints:
            measure_oscillators(
                self._config.servos,
                [joint.output for joint in self._config.joints],
                self._devices.servos,
                self._dialogue,
            )
            self._dialogue.say(JOINTS + HELP)
            self._dialogue.choose("on the stand: Enter", "")
        for joint in joints:
            make = partial(Mover, self._devices.servos, joint, self._clock)
            mover = self._dialogue.attempt(make)
            measured = calibrate_joint(joint, mover, self._dialogue)
            if measured is not None:
                yield joint.name, measured

    def _accelerometer(self) -> AxesCalibration | None:
        axes = self._config.axes
        driver: Any = self._devices.accelerometer  # where there are axes, it is a ``RawAxes``
        if "accelerometer" not in self._parts or axes is None:
            return None
        sample = partial(sample_at_rest, driver, rate=self._config.settling.rate, clock=self._clock)
        return calibrate_accelerometer(axes, sample, self._dialogue)

    def _gauges(self) -> Iterator[tuple[str, GaugeCalibration]]:
        gauges, inputs = self._config.gauges, self._devices.inputs
        points = [p for p in self._config.touch if p.name in gauges and p.name in self._parts]
        if not points or inputs is None:
            return
        rate, clock = self._config.settling.rate, self._clock
        self._dialogue.say(GAUGES)
        for point in points:
            channel = gauges[point.name].channel
            sample = partial(sample_channel, inputs, channel, count=SAMPLES, rate=rate, clock=clock)
            measured = calibrate_gauge(point, channel, sample, self._dialogue)
            if measured is not None:
                yield point.name, measured

    def _distance(self) -> DistanceCalibration | None:
        belly, finder = self._config.distance, self._devices.distance
        if "distance" not in self._parts or belly is None or finder is None:
            return None
        return calibrate_distance(belly, finder, self._config.noise.clearance, self._dialogue)

    def _changes(self, before: Calibration, after: Calibration) -> Iterator[str]:
        """Yields what is new, line by line."""
        for joint in self._config.joints:
            new = after.joints.get(joint.name)
            if new != before.joints.get(joint.name) and new is not None:
                scales = new.scale, joint.scale
                counts = [scale.count(0.0) for scale in scales]
                slopes = [math.degrees(scale.resolution) for scale in scales]
                limits = math.degrees(new.lower_limit), math.degrees(new.upper_limit)
                yield (
                    f"{joint.name}: 0° at count {counts[0]} (was {counts[1]}), {slopes[0]:.2f}° a "
                    f"count (was {slopes[1]:.2f}°), {limits[0]:.1f}° to {limits[1]:.1f}°; "
                    f"{_uncertainty_text(new.uncertainty, math.degrees(1), '°')}"
                )
        axes, old_axes = after.accelerometer, self._config.axes
        if axes != before.accelerometer and axes is not None and old_axes is not None:
            for index, name in enumerate("xyz"):
                yield (
                    f"accelerometer {name}: {axes.zero[index]:.3f} {axes.unit} at 0 g (was "
                    f"{old_axes.zero[index]:.3f}), {axes.per_g[index]:.3f} {axes.unit}/g (was "
                    f"{old_axes.per_g[index]:.3f})"
                )
            yield f"accelerometer: {_uncertainty_text(axes.uncertainty, math.degrees(1), '°')}"
        for name, gauge in self._config.gauges.items():
            bridge = after.gauges.get(name)
            if bridge != before.gauges.get(name) and bridge is not None:
                yield (
                    f"{name}: {bridge.tare:.3f} V when free (was {gauge.tare:.3f}), "
                    f"{bridge.volts_per_newton:.3f} V/N (was {gauge.volts_per_newton:.3f}), "
                    f"touches above {bridge.on:g} N"
                )
        ruler, belly = after.distance, self._config.distance
        if ruler != before.distance and ruler is not None and belly is not None:
            yield (
                f"distance: {ruler.zero * 1000:.1f} mm on the ground (was "
                f"{belly.zero * 1000:.1f}), scale {ruler.scale:.3f} (was "
                f"{belly.scale:.3f}); {_uncertainty_text(ruler.uncertainty, 1000, ' mm')}"
            )


def _uncertainty_text(known: Uncertainty, scale: float, unit: str) -> str:
    phrases = [] if known.zero is None else [f"its zero to {known.zero * scale:.2f}{unit}"]
    phrases += [] if known.gain is None else [f"its gain to {100 * known.gain:.1f} %"]
    return f"known, as announced to clients: {' and '.join(phrases) or 'nothing'}"
