"""Looks at every part of a robot, one failing part not hiding the next."""

from __future__ import annotations

import errno
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from typing import Any, Final

from robot.configuration.robot_config import RobotConfig
from robot.diagnosis.findings import Finding, Severity, failed, look, ok, with_repeats
from robot.diagnosis.sensors import (
    Recording,
    check_accelerometer,
    check_distance,
    check_inputs,
    check_touch,
    record,
)
from robot.diagnosis.servos import check_board, check_joints, failing_alone, move_joints
from robot.drivers.buses import Buses
from robot.drivers.guard import open_driver
from robot.drivers.sensors.contracts import attach_board
from robot.drivers.servos.servo_bus import ServoBus
from robot.errors import DeviceError, DeviceMissingError

_TILT: Final = "accelerometer"
_DISTANCE: Final = "distance"


class Doctor:
    """One examination of a robot.

    Args:
        config: Configuration of the robot.
        buses: Buses that lead to its devices.
        move: Whether joints may be moved.
    """

    def __init__(self, config: RobotConfig, buses: Buses, *, move: bool):
        self._config = config
        self._buses = buses
        self._clock = buses.clock
        self._move = move

    def examine(self) -> Iterator[Finding]:
        """Yields the findings as they are made; closes what it opened."""
        with ExitStack() as stack:
            try:
                servos: ServoBus | None = open_driver(self._config.servos, self._buses)
            except DeviceError as error:
                servos = None
                yield failed("servo board", error)
                if _taken(error):
                    yield look(
                        "the rest",
                        "not looked at: another program drives this robot, and would be disturbed.",
                        "If that is robotd: systemctl stop robotd",
                    )
                    return
            if servos is not None:
                stack.callback(servos.close)
                yield from self._servos(servos)
            yield from self._sensors(stack)

    def _servos(self, servos: ServoBus) -> Iterator[Finding]:
        failing = failing_alone(servos, [joint.output for joint in self._config.joints])
        joints = [joint for joint in self._config.joints if joint.output not in failing]
        findings, counts = check_board(
            servos, self._config.servos, [joint.output for joint in joints], self._clock
        )
        yield from findings
        for joint in self._config.joints:
            if joint.output in failing:
                yield failed(f"joint {joint.name}", failing[joint.output])
        if counts:
            yield from check_joints(joints, counts, servos)
            if self._move and any(finding.verdict is Severity.BAD for finding in findings):
                yield look("moves", "none made over such a line.", "See the servo board.")
            elif self._move:
                yield from move_joints(joints, counts, servos, self._clock)

    def _sensors(self, stack: ExitStack) -> Iterator[Finding]:
        config, buses = self._config, self._buses
        if config.daq is not None:
            try:
                buses = attach_board(buses, config.daq)
            except DeviceError as error:
                yield failed("analogue inputs", error)
        inputs = buses.analogue
        if inputs is not None:
            stack.callback(inputs.board.close)
        drivers: dict[str, Any] = {}
        analogue_subjects: set[str] = set()
        for subject, settings in config.sensors.items():
            if settings.channels:
                analogue_subjects.add(subject)
                if inputs is None:
                    continue
            try:
                driver = open_driver(settings, buses, subject.removeprefix("touch "))
                stack.callback(driver.close)
                driver.start()
            except DeviceError as error:
                yield failed(subject, error)
            else:
                drivers[subject] = driver
        if inputs is not None and config.daq is not None and analogue_subjects:
            finding, working = check_inputs(inputs, config.daq, config.settling.rate, self._clock)
            yield with_repeats(finding, inputs.board)
            for subject in set() if working else analogue_subjects:
                drivers.pop(subject, None)
        yield from self._look_at(drivers)

    def _look_at(self, drivers: Mapping[str, Any]) -> Iterator[Finding]:
        """Examines the sensors that could be opened, given by subject."""
        config, tilt = self._config, None
        recordings = {
            subject: Recording(driver, driver.acceleration if subject == _TILT else driver.load)
            for subject, driver in drivers.items()
            if subject != _DISTANCE
        }
        record(list(recordings.values()), config.settling.rate, self._clock)
        if config.accelerometer is None:
            yield ok(_TILT, "no sensor is configured")
        elif _TILT in recordings:
            finding, tilt = check_accelerometer(config, recordings[_TILT])
            yield with_repeats(finding, drivers[_TILT])
        for point in config.touch:
            if (subject := f"touch {point.name}") in recordings:
                yield with_repeats(check_touch(point, recordings[subject]), drivers[subject])
        if config.distance is None:
            yield ok(_DISTANCE, "no sensor is configured")
        elif _DISTANCE in drivers:
            finder = drivers[_DISTANCE]
            finding = check_distance(config, config.distance, finder, tilt, self._clock)
            yield with_repeats(finding, finder)


def _taken(error: DeviceError) -> bool:
    """Whether the link to the servos is locked by another program."""
    cause = error.__cause__
    return (
        isinstance(error, DeviceMissingError)
        and isinstance(cause, OSError)
        and cause.errno in (errno.EAGAIN, errno.EBUSY)
    )
