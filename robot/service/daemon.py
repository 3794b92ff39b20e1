"""Puts a robot together and serves it: devices, control loop, server, signals."""

from __future__ import annotations

import logging
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib import metadata
from types import FrameType

from protocol.sockets.zmq_sockets import DEFAULT_BIND, Endpoint
from protocol.transport.server import Server
from protocol.wire.capabilities import Capabilities, Joint, Sensor
from robot.configuration.robot_config import RobotConfig
from robot.control.controller import Controller
from robot.control.interaction import MotorProgramRunner, Operator
from robot.devices import Devices, revive
from robot.drivers.servos.servo_bus import answering
from robot.errors import DeviceTimeoutError
from robot.host.clock import Clock, SteadyClock
from robot.host.service_manager import ServiceManager
from robot.sensing.sensors import RobotSensors
from robot.uncertainty import Uncertainty

HOUSEKEEPING = 3.0  # s between checks that the servo board was not reset
TURN = 0.0005  # s that one thread may keep the other waiting


def build_controller(
    config: RobotConfig,
    devices: Devices,
    *,
    clock: Clock,
    operator: Operator | None,
    housekeeping: float | None,
    log: logging.Logger,
    manager: ServiceManager | None = None,
) -> Controller:
    """The control loop of a robot, not yet started.

    Args:
        config: Configuration of the robot.
        devices: Drivers of the robot's devices.
        clock: The robot clock.
        operator: Operator who puts the robot back on its belly, or ``None``.
        housekeeping: Seconds between checks of the idle board, or ``None`` for none.
        log: Log for what a person may want to know.
        manager: Service manager, which is told that the control loop turns.
    """
    steady = SteadyClock(clock)
    belly = None
    if config.distance is not None and devices.distance is not None:
        belly = (devices.distance, config.distance)
    sensing = RobotSensors(
        accelerometer=devices.accelerometer,
        touch=list(zip(config.touch, devices.touch, strict=True)),
        belly=belly,
        clock=steady,
        rate=config.settling.rate,
        underside=config.underside,
    )
    interaction = MotorProgramRunner(
        config,
        servos=devices.servos,
        sensing=sensing,
        clock=steady,
        revive=partial(revive, config, devices),
        operator=operator,
    )
    return Controller(
        interaction,
        capabilities=describe(config, measured=answering(devices.servos) is not None),
        housekeeping=housekeeping,
        log=log,
        manager=manager,
    )


def describe(config: RobotConfig, *, measured: bool = False) -> Capabilities:
    """What ``hello`` tells about a robot; the server adds the endpoint of its telemetry.

    Args:
        config: Configuration of the robot.
        measured: Whether the servos report their positions.
    """
    rate = config.settling.rate
    level = config.axes.uncertainty if config.axes else Uncertainty()
    sensors = []
    if config.touch:
        sensors.append(
            Sensor(modality="touch", unit="bool", count=len(config.touch), noise=0.0, rate=rate)
        )
    if config.accelerometer is not None:
        sensors.append(
            Sensor(
                modality="tilt",
                unit="rad",
                count=2,
                noise=config.noise.tilt,
                rate=rate,
                zero_sigma=level.zero,
                gain_sigma=level.gain,
            )
        )
    if config.distance is not None:
        sensors.append(
            Sensor(
                modality="clearance",
                unit="m",
                count=1,
                noise=config.noise.clearance,
                rate=rate,
                upper=config.distance.reach,
                zero_sigma=config.distance.uncertainty.zero,
                gain_sigma=config.distance.uncertainty.gain,
            )
        )
    radii = [joint.part_radius for joint in config.joints if joint.part_radius is not None]
    return Capabilities(
        robot=config.name,
        software=f"bodyschema {metadata.version('bodyschema')}",
        config_hash=config.hash,
        base_size=config.body.size,
        base_radius=config.body.radius,
        base_mass=config.body.mass,
        part_radii=tuple(radii) if len(radii) == len(config.joints) else None,
        joints=tuple(
            Joint(
                name=joint.name,
                lower=joint.reachable[0],
                upper=joint.reachable[1],
                speed=config.speed,
                resolution=joint.scale.resolution,
                measured_noise=config.noise.joint if measured else None,
                zero_sigma=joint.uncertainty.zero,
                travel_sigma=joint.uncertainty.gain,
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
    """Serves until SIGTERM, SIGINT or SIGHUP; then ends a motion, parks and returns.

    Raises:
        DeviceTimeoutError: The control loop did not end in time, or had ended before.
    """
    manager = manager or ServiceManager({})
    ended_well = True

    def shut_down(reason: signal.Signals) -> None:
        nonlocal ended_well
        log.info("%s: shutting down", reason.name)
        manager.stopping("parking")
        ended_well = controller.shut_down()
        server.request_stop()

    with _quick_turns(), _on_signals(shut_down):
        controller.start(str(Endpoint.parse(server.endpoint).seen_from(DEFAULT_BIND)))
        status = f"serving {controller.capabilities.robot} on {server.endpoint}"
        log.info("%s, telemetry on %s", status, server.telemetry_endpoint)
        manager.ready(status)
        with server:
            server.run()
    if not ended_well:
        raise DeviceTimeoutError(
            "The control loop did not end as it should; the servos keep their last commands.",
            "See the log for what failed.",
        )
    log.info("shut down")


@contextmanager
def _quick_turns() -> Iterator[None]:
    """Lets the server have its turn soon while the control loop computes.

    Python's threads hand over every 5 ms by default; an answer would wait for that long.
    """
    interval = sys.getswitchinterval()
    sys.setswitchinterval(TURN)
    try:
        yield
    finally:
        sys.setswitchinterval(interval)


@contextmanager
def _on_signals(action: Callable[[signal.Signals], None]) -> Iterator[None]:
    """Calls ``action`` in a thread of its own at the first signal; the next ones are ignored.

    A signal that is ignored already, as SIGHUP under ``nohup``, stays so.
    """
    signalled = threading.Event()

    def handler(number: int, frame: FrameType | None) -> None:
        del frame
        if not signalled.is_set():
            signalled.set()
            reason = signal.Signals(number)
            threading.Thread(target=action, args=(reason,), name="shutdown").start()

    old_handlers = {
        number: signal.signal(number, handler)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
        if signal.getsignal(number) is not signal.SIG_IGN
    }
    try:
        yield
    finally:
        for number, previous in old_handlers.items():
            signal.signal(number, previous)
