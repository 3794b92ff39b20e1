"""Looks at every part of a robot, one failing part not hiding the next."""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass

from robot.configuration.robot_config import RobotConfig
from robot.diagnosis.findings import Finding, Severity, failed, look, ok
from robot.diagnosis.sensors import (
    check_accelerometer,
    check_distance,
    check_gauge,
    check_inputs,
)
from robot.diagnosis.servos import check_board, check_joints, move_joints
from robot.drivers.sv203 import SV203
from robot.drivers.vl6180x import VL6180X
from robot.errors import DeviceError, DeviceMissingError
from robot.host.clock import Clock
from robot.sensing.sensors import AnalogueBoard


@dataclass(frozen=True, kw_only=True)
class DeviceOpeners:
    """How to open and identify each device; each raises ``DeviceError`` by itself."""

    servos: Callable[[], SV203]
    adc: Callable[[], AnalogueBoard]
    distance: Callable[[], VL6180X | None]


class Doctor:
    """One examination.

    Args:
        config: The robot.
        access: Its devices.
        clock: The robot clock.
        move: Whether joints may be moved.
    """

    def __init__(self, config: RobotConfig, access: DeviceOpeners, clock: Clock, *, move: bool):
        self._config = config
        self._access = access
        self._clock = clock
        self._move = move

    def examine(self) -> Iterator[Finding]:
        """Finding by finding, as they are made; closes what it opened."""
        with ExitStack() as stack:
            try:
                servos: SV203 | None = self._access.servos()
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

    def _servos(self, servos: SV203) -> Iterator[Finding]:
        joints = self._config.joints
        found, counts = check_board(servos, [joint.output for joint in joints], self._clock)
        yield from found
        if counts:
            yield from check_joints(joints, counts)
            if self._move and any(one.verdict is Severity.BAD for one in found):
                yield look("moves", "none made over such a line.", "See the servo board.")
            elif self._move:
                yield from move_joints(joints, counts, servos, self._clock)

    def _sensors(self, stack: ExitStack) -> Iterator[Finding]:
        tilt = None
        try:
            adc = self._access.adc()
        except DeviceError as error:
            yield failed("analogue inputs", error)
        else:
            stack.callback(adc.close)
            finding, inputs = check_inputs(self._config, adc, self._clock)
            yield finding
            if inputs is not None:
                finding, tilt = check_accelerometer(self._config, inputs)
                yield finding
                for gauge in self._config.gauges:
                    yield check_gauge(gauge, inputs)
        yield from self._distance(stack, tilt)

    def _distance(self, stack: ExitStack, tilt: tuple[float, float] | None) -> Iterator[Finding]:
        if self._config.distance is None:
            yield ok("distance", "no sensor is configured")
            return
        try:
            finder = self._access.distance()
        except DeviceError as error:
            yield failed("distance", error)
            return
        if finder is not None:
            stack.callback(finder.close)
            sensor = self._config.distance.sensor
            yield check_distance(self._config, sensor, finder, tilt, self._clock)


def _taken(error: DeviceError) -> bool:
    """Whether the serial line is locked by another program."""
    cause = error.__cause__
    return (
        isinstance(error, DeviceMissingError)
        and isinstance(cause, OSError)
        and cause.errno in (errno.EAGAIN, errno.EBUSY)
    )
