"""Puts a robot together and serves it: devices, control loop, server, signals.

``Electronics`` holds the three seams to the outside: an open serial line, I/O ports, an I²C bus. A
simulated robot brings emulated ones, and everything above them is this same code.
"""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import metadata
from types import FrameType

import serial

from protocol.capabilities import Capabilities, Joint, Sensor
from protocol.server import Server
from robot.clock import Clock
from robot.config import RobotConfig
from robot.controller import Controller
from robot.drivers.dmm32 import DMM32
from robot.drivers.i2c import I2CBus, open_i2c
from robot.drivers.portio import PortIO, open_dev_port
from robot.drivers.sv203 import SV203, open_serial
from robot.drivers.vl6180x import VL6180X
from robot.interaction import Attendant, Interaction
from robot.sensing import Sensing

HOUSEKEEPING = 3.0  # s between checks that the servo board was not reset


@dataclass(frozen=True, kw_only=True)
class Electronics:
    """The seams between drivers and devices; ``i2c`` is ``None`` without a distance sensor."""

    serial: serial.Serial
    ports: PortIO
    i2c: I2CBus | None


@dataclass(frozen=True, kw_only=True)
class Devices:
    """The drivers of one robot, found and identified."""

    servos: SV203
    adc: DMM32
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
    line = open_serial(config.servo_board.port, config.servo_board.baud)
    try:
        ports = open_dev_port(config.daq.base)
        bus = open_i2c(f"/dev/i2c-{config.distance.bus}") if config.distance else None
    except BaseException:
        line.close()
        raise
    return Electronics(serial=line, ports=ports, i2c=bus)


def start_devices(config: RobotConfig, electronics: Electronics, clock: Clock) -> Devices:
    """Finds and identifies each device.

    Raises:
        DeviceError: One of them is not what it should be.
    """
    board = config.servo_board
    servos = SV203(electronics.serial, board=board.board, clock=clock, line_gap=board.line_gap)
    adc = DMM32(electronics.ports, base=config.daq.base, clock=clock, range_=config.daq.input_range)
    adc.probe()
    distance = None
    if config.distance is not None and electronics.i2c is not None:
        distance = VL6180X(electronics.i2c, address=config.distance.address, clock=clock)
        distance.start()
    return Devices(servos=servos, adc=adc, distance=distance)


def build_controller(
    config: RobotConfig,
    devices: Devices,
    *,
    clock: Clock,
    attendant: Attendant | None,
    housekeeping: float | None,
    log: logging.Logger,
) -> Controller:
    """The control loop of a robot, not yet started.

    Args:
        config: What is connected where.
        devices: The drivers.
        clock: The robot clock.
        attendant: Who puts the robot back on its belly, or ``None``.
        housekeeping: Seconds between checks of the idle board, or ``None`` for none.
        log: Where to write what a person may want to know.
    """
    belly = None
    if config.distance is not None and devices.distance is not None:
        belly = (devices.distance, config.distance.sensor)
    sensing = Sensing(
        devices.adc,
        belly=belly,
        accelerometer=config.accelerometer,
        gauges=config.gauges,
        clock=clock,
        rate=config.settling.rate,
    )
    interaction = Interaction(
        joints=config.joints,
        servos=devices.servos,
        sensing=sensing,
        clock=clock,
        speed=config.speed,
        rest=config.settling,
        samples=config.samples,
        attendant=attendant,
    )
    return Controller(
        interaction,
        capabilities=describe(config),
        housekeeping=housekeeping,
        log=log,
    )


def describe(config: RobotConfig) -> Capabilities:
    """What ``hello`` tells about a robot; the server adds where it publishes telemetry."""
    rate = config.settling.rate
    sensors = [
        Sensor(modality="tilt", unit="rad", count=2, noise=config.noise.tilt, rate=rate),
    ]
    if config.gauges:
        sensors.insert(
            0, Sensor(modality="touch", unit="bool", count=len(config.gauges), noise=0.0, rate=rate)
        )
    if config.distance is not None:
        sensors.append(
            Sensor(
                modality="clearance",
                unit="m",
                count=1,
                noise=config.noise.clearance,
                rate=rate,
                upper=config.distance.sensor.reach,
            )
        )
    return Capabilities(
        robot=config.name,
        software=f"bodyschema {metadata.version('bodyschema')}",
        config_hash=config.hash,
        base_size=config.body.size,
        base_mass=config.body.mass,
        part_radii=tuple(joint.part_radius for joint in config.joints),
        joints=tuple(
            Joint(
                name=joint.name,
                lower=joint.reachable[0],
                upper=joint.reachable[1],
                speed=config.speed,
                resolution=joint.scale.resolution,
            )
            for joint in config.joints
        ),
        sensors=tuple(sensors),
        telemetry="*",
        telemetry_rate=1.0,
    )


def serve(controller: Controller, server: Server, log: logging.Logger) -> None:
    """Serves until SIGTERM or SIGINT; then ends a motion, parks and returns."""

    def shut_down() -> None:
        if not controller.shut_down():
            log.error("the control loop did not end in time")
        server.request_stop()

    with _on_signals(lambda: threading.Thread(target=shut_down, name="shutdown").start()):
        controller.start()
        log.info("serving %s on %s", controller.capabilities.robot, server.endpoint)
        with server:
            server.run()


@contextmanager
def _on_signals(action: object) -> Iterator[None]:
    seen = threading.Event()

    def handler(number: int, frame: FrameType | None) -> None:
        del number, frame
        if not seen.is_set():
            seen.set()
            assert callable(action)
            action()

    kept = {number: signal.signal(number, handler) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield
    finally:
        for number, previous in kept.items():
            signal.signal(number, previous)
