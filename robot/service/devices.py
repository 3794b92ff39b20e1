"""A robot's devices: opened, found and identified, and made to work again after a fault.

``Electronics`` holds the three seams to the outside: an open serial line, I/O ports, an I²C bus. A
simulated robot brings emulated ones, and everything above them is this same code.
"""

from __future__ import annotations

import importlib
import logging
from dataclasses import dataclass

import serial

from robot.configuration.robot_config import RobotConfig
from robot.drivers import ANALOGUE_DRIVERS
from robot.drivers.i2c import I2CBus, open_i2c
from robot.drivers.portio import PortIO, open_dev_port
from robot.drivers.sv203 import SV203, open_serial
from robot.drivers.vl6180x import VL6180X
from robot.errors import DeviceError
from robot.host.clock import Clock
from robot.sensing.sensors import AnalogueBoard


@dataclass(frozen=True, kw_only=True)
class Electronics:
    """The seams between drivers and devices.

    ``ports`` is ``None`` where the analogue inputs are not reached by I/O ports, ``i2c`` where
    there is no distance sensor.
    """

    serial: serial.Serial
    ports: PortIO | None
    i2c: I2CBus | None


@dataclass(frozen=True, kw_only=True)
class Devices:
    """The drivers of one robot, found and identified."""

    servos: SV203
    adc: AnalogueBoard
    distance: VL6180X | None

    def close(self) -> None:
        """Closes all of them."""
        self.servos.close()
        self.adc.close()
        if self.distance is not None:
            self.distance.close()


def open_electronics(config: RobotConfig) -> Electronics:
    """Opens the real devices that a configuration names.

    Raises:
        DeviceMissingError: One of them cannot be opened; the sentence says which and why.
    """
    line = open_line(config)
    try:
        return Electronics(serial=line, ports=open_ports(config), i2c=open_bus(config))
    except BaseException:
        line.close()
        raise


def open_line(config: RobotConfig) -> serial.Serial:
    """Opens the serial line to the servo board."""
    return open_serial(config.servo_board.port, config.servo_board.baud)


def open_ports(config: RobotConfig) -> PortIO | None:
    """Opens the I/O ports of the data acquisition board, if its driver needs them."""
    return open_dev_port(config.daq.base) if config.daq.driver == "dmm32" else None


def open_bus(config: RobotConfig) -> I2CBus | None:
    """Opens the distance sensor's bus, if there is such a sensor."""
    return open_i2c(f"/dev/i2c-{config.distance.bus}") if config.distance else None


def start_devices(config: RobotConfig, electronics: Electronics, clock: Clock) -> Devices:
    """Finds and identifies each device.

    Raises:
        DeviceError: One of them is not what it should be.
    """
    return Devices(
        servos=start_servos(config, electronics.serial, clock),
        adc=start_adc(config, electronics.ports, clock),
        distance=start_distance(config, electronics.i2c, clock),
    )


def start_servos(config: RobotConfig, line: serial.Serial, clock: Clock) -> SV203:
    """The servo board's driver; the board is first heard of at the first query."""
    board = config.servo_board
    return SV203(line, board=board.board, clock=clock, line_gap=board.line_gap)


def start_adc(config: RobotConfig, ports: PortIO | None, clock: Clock) -> AnalogueBoard:
    """The data acquisition board's driver, once the board was found.

    Args:
        config: What is connected where.
        ports: Access to the I/O ports, or ``None`` for a driver that needs none.
        clock: Measures deadlines.
    """
    daq = config.daq
    module, name = ANALOGUE_DRIVERS[daq.driver]
    driver = getattr(importlib.import_module(module), name)
    if ports is None:
        adc = driver(daq.device, range_=daq.input_range)
    else:
        adc = driver(ports, base=daq.base, clock=clock, range_=daq.input_range)
    adc.probe()
    found: AnalogueBoard = adc
    return found


def start_distance(config: RobotConfig, bus: I2CBus | None, clock: Clock) -> VL6180X | None:
    """The distance sensor's driver, once the sensor was identified and set up."""
    if config.distance is None or bus is None:
        return None
    sensor = VL6180X(bus, address=config.distance.address, clock=clock)
    sensor.start()
    return sensor


def revive(config: RobotConfig, devices: Devices) -> None:
    """Makes devices that failed work again, as far as that takes no person.

    A serial line that no longer works is opened anew, under the name in the configuration.

    Raises:
        DeviceError: One of them still fails.
    """
    try:
        devices.servos.read_counts([config.joints[0].output])
    except DeviceError:
        devices.servos.reopen(lambda: open_line(config))
    devices.adc.probe()
    if devices.distance is not None:
        devices.distance.start()


def report_devices(config: RobotConfig, log: logging.Logger) -> None:
    """Logs what was found and identified where."""
    board, daq, distance = config.servo_board, config.daq, config.distance
    where = daq.device if daq.driver == "comedi" else f"0x{daq.base:x}"
    log.info("found: servo board %d on %s, %d baud", board.board, board.port, board.baud)
    log.info("found: analogue inputs (%s) at %s, %s", daq.driver, where, daq.input_range)
    if distance is not None:
        log.info("found: distance sensor at 0x%x on I²C bus %d", distance.address, distance.bus)
