"""A robot's devices: opened, found and identified, and made to work again after a fault."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

from robot.configuration.robot_config import RobotConfig
from robot.drivers.buses import Buses
from robot.drivers.guard import open_driver
from robot.drivers.links.analogue_inputs import AnalogueInputs
from robot.drivers.sensors.contracts import (
    Accelerometer,
    DistanceSensor,
    SensorDriver,
    SensorSettings,
    TouchSensor,
    attach_board,
)
from robot.drivers.servos.servo_bus import ServoBus
from robot.errors import DeviceError
from robot.toml_sections import numbered


@dataclass(frozen=True, kw_only=True)
class Devices:
    """The drivers of one robot; ``touch`` in the order of the configuration."""

    servos: ServoBus
    inputs: AnalogueInputs | None
    accelerometer: Accelerometer | None
    touch: tuple[TouchSensor, ...]
    distance: DistanceSensor | None

    @property
    def sensors(self) -> tuple[SensorDriver, ...]:
        """The drivers of all sensors."""
        drivers = (self.accelerometer, *self.touch, self.distance)
        return tuple(driver for driver in drivers if driver is not None)

    def close(self) -> None:
        """Closes all devices; one that fails does not keep the others open.

        Raises:
            DeviceError: A device failed, or its driver did not return.
        """
        errors: list[DeviceError] = []
        board = [] if self.inputs is None else [self.inputs.board.close]
        for close in [self.servos.close, *(sensor.close for sensor in self.sensors), *board]:
            try:
                close()
            except DeviceError as error:
                errors.append(error)
        if errors:
            raise errors[0]


def open_devices(config: RobotConfig, buses: Buses, *, file: str = "") -> Devices:
    """Opens, finds and identifies each device that a configuration names.

    Args:
        config: Configuration of the robot.
        buses: Buses that lead to its devices.
        file: Name of the configuration's file, for messages.

    Raises:
        DeviceError: One of them cannot be opened or is not what it should be; the sentence says
            which, by file and table, and why.
    """
    with ExitStack() as opened:
        with _named(file, "servos"):
            servos: ServoBus = open_driver(config.servos, buses)
        opened.callback(servos.close)
        if config.daq is not None:
            with _named(file, "daq"):
                buses = attach_board(buses, config.daq)
            assert buses.analogue is not None
            opened.callback(buses.analogue.board.close)

        def start(table: str, settings: SensorSettings, called: str) -> Any:
            with _named(file, table):
                driver: SensorDriver = open_driver(settings, buses, called)
                opened.callback(driver.close)
                driver.start()
            return driver

        tilt, distance = config.accelerometer, config.distance
        devices = Devices(
            servos=servos,
            inputs=buses.analogue,
            accelerometer=start("accelerometer", tilt, "accelerometer") if tilt else None,
            touch=tuple(
                start(numbered("touch", number, point.name), point.driver, point.name)
                for number, point in enumerate(config.touch, 1)
            ),
            distance=start("distance", distance.driver, "distance") if distance else None,
        )
        opened.pop_all()
    return devices


@contextmanager
def _named(file: str, table: str) -> Iterator[None]:
    """Adds file and table of the configuration to the error of a device that fails."""
    try:
        yield
    except DeviceError as error:
        if not file:
            raise
        raise type(error)(f"{file}: {table}: {error.message}", error.advice) from error


def revive(config: RobotConfig, devices: Devices) -> None:
    """Makes devices that failed work again, as far as that takes no person.

    The link to servos that do not answer, or cannot, is opened anew, under the name in the
    configuration; the links to all sensors are in any case, after all of them were closed: while
    one is open, an adapter that was plugged in again cannot get its number back.

    Raises:
        DeviceError: One of them still fails.
    """
    for sensor in devices.sensors:
        sensor.close()
    if devices.inputs is not None:
        devices.inputs.board.close()
    try:
        devices.servos.read_counts([config.joints[0].output])
    except DeviceError:
        devices.servos.reopen()
    else:
        if not config.servos.reads_back:
            devices.servos.reopen()
    if devices.inputs is not None:
        devices.inputs.board.probe()
    for sensor in devices.sensors:
        sensor.start()


def report_devices(config: RobotConfig, log: logging.Logger) -> None:
    """Logs which driver was found where; a sensor on the inputs of a board with that board."""
    log.info("found: servos (%s): %s", config.servos.name, config.servos)
    if not config.servos.reads_back:
        log.warning("the %s cannot be read back: a reset goes unnoticed", config.servos.name)
    if config.daq is not None:
        log.info("found: analogue inputs (%s): %s", config.daq.name, config.daq)
    if config.accelerometer is None:
        log.warning(
            "there is no accelerometer: each settling takes %g s, since nobody can tell rest, and "
            "whether the robot lies flat is not checked",
            config.settling.timeout,
        )
    for subject, driver in config.sensors.items():
        if not driver.channels:
            log.info("found: %s (%s): %s", subject, driver.name, driver)
