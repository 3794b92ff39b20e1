"""Puts a robot together and serves it: devices, control loop, server, signals.

``Electronics`` holds the three seams to the outside: an open serial line, I/O ports, an I²C bus. A
simulated robot brings emulated ones, and everything above them is this same code.
"""

from __future__ import annotations

import importlib
import logging
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import metadata
from types import FrameType

import serial

from protocol.capabilities import Capabilities, Joint, Sensor
from protocol.server import Server
from robot.clock import Clock
from robot.config import RobotConfig
from robot.controller import Controller
from robot.drivers import ANALOGUE_DRIVERS
from robot.drivers.dmm32 import RANGES
from robot.drivers.i2c import I2CBus, open_i2c
from robot.drivers.portio import PortIO, open_dev_port
from robot.drivers.sv203 import SV203, open_serial
from robot.drivers.vl6180x import VL6180X
from robot.errors import DeviceError
from robot.interaction import Attendant, Interaction
from robot.notify import ServiceManager
from robot.sensing import AnalogueBoard, Senses, Sensing
from robot.servo_bus import ServoBus
from robot.steady import SteadyClock

HOUSEKEEPING = 3.0  # s between checks that the servo board was not reset
TURN = 0.0005  # s that one thread may keep the other waiting


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


def build_controller(
    config: RobotConfig,
    devices: Devices,
    *,
    clock: Clock,
    attendant: Attendant | None,
    housekeeping: float | None,
    log: logging.Logger,
    manager: ServiceManager | None = None,
) -> Controller:
    """The control loop of a robot, not yet started.

    Args:
        config: What is connected where.
        devices: The drivers.
        clock: The robot clock.
        attendant: Who puts the robot back on its belly, or ``None``.
        housekeeping: Seconds between checks of the idle board, or ``None`` for none.
        log: Where to write what a person may want to know.
        manager: Who is told that the control loop turns.
    """
    steady = SteadyClock(clock)
    inputs = RANGES[config.daq.input_range]
    belly = None
    if config.distance is not None and devices.distance is not None:
        belly = (devices.distance, config.distance.sensor)
    sensing = Sensing(
        devices.adc,
        belly=belly,
        accelerometer=config.accelerometer,
        gauges=config.gauges,
        clock=steady,
        rate=config.settling.rate,
        rails=(inputs.low, inputs.high),
        underside=config.underside,
    )
    return assemble(
        config,
        servos=devices.servos,
        sensing=sensing,
        capabilities=describe(config),
        clock=steady,
        revive=partial(revive, config, devices),
        attendant=attendant,
        housekeeping=housekeeping,
        log=log,
        manager=manager,
    )


def assemble(
    config: RobotConfig,
    *,
    servos: ServoBus,
    sensing: Senses,
    capabilities: Capabilities,
    clock: SteadyClock,
    attendant: Attendant | None,
    housekeeping: float | None,
    log: logging.Logger,
    manager: ServiceManager | None,
    revive: Callable[[], None] = lambda: None,
) -> Controller:
    """The control loop around given servos and sensors; arguments as in ``build_controller``.

    ``revive`` makes the devices work again after a fault, or raises ``DeviceError``.
    """
    interaction = Interaction(
        joints=config.joints,
        servos=servos,
        sensing=sensing,
        clock=clock,
        speed=config.speed,
        rest=config.settling,
        samples=config.samples,
        revive=revive,
        attendant=attendant,
    )
    return Controller(
        interaction,
        capabilities=capabilities,
        housekeeping=housekeeping,
        log=log,
        manager=manager,
    )


def report_devices(config: RobotConfig, log: logging.Logger) -> None:
    """Logs what was found and identified where."""
    board, daq, distance = config.servo_board, config.daq, config.distance
    where = daq.device if daq.driver == "comedi" else f"0x{daq.base:x}"
    log.info("found: servo board %d on %s, %d baud", board.board, board.port, board.baud)
    log.info("found: analogue inputs (%s) at %s, %s", daq.driver, where, daq.input_range)
    if distance is not None:
        log.info("found: distance sensor at 0x%x on I²C bus %d", distance.address, distance.bus)


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


def serve(
    controller: Controller,
    server: Server,
    log: logging.Logger,
    *,
    manager: ServiceManager | None = None,
) -> None:
    """Serves until SIGTERM or SIGINT; then ends a motion, parks and returns."""
    manager = manager or ServiceManager({})

    def shut_down(reason: signal.Signals) -> None:
        log.info("%s: shutting down", reason.name)
        manager.stopping("parking")
        if not controller.shut_down():
            log.error("the control loop did not end in time; the servos keep their last commands")
        server.request_stop()

    with _quick_turns(), _on_signals(shut_down):
        controller.start()
        status = f"serving {controller.capabilities.robot} on {server.endpoint}"
        log.info("%s, telemetry on %s", status, server.telemetry_endpoint)
        manager.ready(status)
        with server:
            server.run()
    log.info("shut down")


@contextmanager
def _quick_turns() -> Iterator[None]:
    """Lets the server have its turn soon while the control loop computes.

    Python's threads hand over every 5 ms by default; an answer would wait for that long.
    """
    before = sys.getswitchinterval()
    sys.setswitchinterval(TURN)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


@contextmanager
def _on_signals(action: Callable[[signal.Signals], None]) -> Iterator[None]:
    """Calls ``action`` in a thread of its own at the first signal; the next ones are ignored."""
    seen = threading.Event()

    def handler(number: int, frame: FrameType | None) -> None:
        del frame
        if not seen.is_set():
            seen.set()
            reason = signal.Signals(number)
            threading.Thread(target=action, args=(reason,), name="shutdown").start()

    kept = {number: signal.signal(number, handler) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield
    finally:
        for number, previous in kept.items():
            signal.signal(number, previous)
