"""The sensors of a trial, in physical units; one that fails says why and hides no other."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import replace
from typing import Any

from robot.configuration.robot_config import RobotConfig
from robot.drivers.buses import Buses
from robot.drivers.guard import open_driver
from robot.drivers.sensors.contracts import (
    Accelerometer,
    DistanceSensor,
    SensorDriver,
    SensorSettings,
    TouchSensor,
    attach_board,
)
from robot.errors import DeviceError
from robot.sensing.sensors import BellySensor, TouchDetector, TouchPoint, tilt_at_rest


class LiveSensor:
    """One sensor.

    Args:
        name: Name of the sensor.
        settings: Settings of its driver.
        say: Takes one sample of its driver, and says in words what that means.

    Attributes:
        name: As given.
        text: The latest sample in words, or why there is none.
        failed: Whether there is no latest sample.
    """

    def __init__(self, name: str, settings: SensorSettings, say: Callable[[Any], str]):
        self.name = name
        self.text = ""
        self.failed = True
        self._settings = settings
        self._say = say
        self._driver: SensorDriver | None = None

    def open(self, buses: Buses, called: str) -> None:
        """Opens and starts the driver, or says why not."""
        self.close()
        if self._settings.channels and buses.analogue is None:
            return self._fail("not read: it is on analogue inputs, which do not work.")
        try:
            self._driver = open_driver(self._settings, buses, called)
            self._driver.start()
            self.failed = False
        except DeviceError as error:
            self._fail(str(error))
        return None

    def sample(self) -> None:
        """Takes a sample, unless the sensor has failed."""
        if self.failed:
            return
        try:
            self.text = self._say(self._driver)
            assert self._driver is not None
            self._driver.check()
        except DeviceError as error:
            self._fail(str(error))

    def close(self) -> None:
        """Closes the link."""
        if self._driver is not None:
            with suppress(DeviceError):
                self._driver.close()
            self._driver = None

    def _fail(self, sentence: str) -> None:
        self.failed, self.text = True, sentence


class LiveSensors:
    """All sensors of a robot.

    Args:
        config: Configuration of the robot.
        buses: Buses that lead to its devices.
    """

    def __init__(self, config: RobotConfig, buses: Buses):
        self._config = config
        self._buses = buses
        self._board = ExitStack()
        self.rows = list(_sensors(config))

    def open(self) -> None:
        """Opens all sensors; those that were open, anew."""
        self.close()
        buses = self._buses
        if self._config.daq is not None:
            with suppress(DeviceError):  # the sensors on it say so
                buses = attach_board(buses, self._config.daq)
                assert buses.analogue is not None
                self._board.callback(buses.analogue.board.close)
        for row in self.rows:
            row.open(buses, row.name.removeprefix("touch "))

    def sample(self) -> None:
        """Takes a sample of each sensor."""
        for row in self.rows:
            row.sample()

    def close(self) -> None:
        """Closes all sensors."""
        for row in self.rows:
            row.close()
        self._board.close()


def _sensors(config: RobotConfig) -> Iterator[LiveSensor]:
    if config.accelerometer is not None:
        yield LiveSensor("accelerometer", config.accelerometer, _acceleration)
    for point in config.touch:
        yield LiveSensor(f"touch {point.name}", point.driver, _Touch(point).say)
    if config.distance is not None:
        yield LiveSensor("distance", config.distance.driver, _Belly(config.distance).say)


def _acceleration(driver: Accelerometer) -> str:
    acceleration = driver.acceleration()
    x, y, z = acceleration
    across, along = (math.degrees(angle) for angle in tilt_at_rest(acceleration))
    return (
        f"x {x:+.3f}  y {y:+.3f}  z {z:+.3f} g; left side up {across:+.1f}°, nose up {along:+.1f}°"
    )


class _Touch:
    def __init__(self, point: TouchPoint):
        self._detector = TouchDetector(replace(point, debounce=1))

    def say(self, driver: TouchSensor) -> str:
        load = driver.load()
        word = "touching" if self._detector.feed(load) else "free"
        return word if isinstance(load, bool) else f"{load:+.3f} N, {word}"


class _Belly:
    def __init__(self, sensor: BellySensor):
        self._sensor = sensor

    def say(self, driver: DistanceSensor) -> str:
        distance = driver.distance()
        clearance = None if distance is None else self._sensor.clearance(distance)
        if clearance is None or clearance >= self._sensor.reach:
            return f"nothing within {self._sensor.reach * 1000:.0f} mm below the belly"
        return f"{clearance * 1000:.1f} mm below the belly"
