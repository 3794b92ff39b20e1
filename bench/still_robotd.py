"""``robotd`` in real time on still electronics: what the daemon itself costs.

``python -m bench.still_robotd --bind URI`` serves until SIGTERM and logs where. With ``--port`` the
servo board is in another process, so that it outlives the daemon. With ``--times FILE`` it writes
to FILE what it sent over the line and when, for the jitter of the control loop: a pseudo-terminal
passes bytes on when the kernel finds the time, so its far end cannot tell.
"""

from __future__ import annotations

import argparse
import json
import logging
import math
import sys
import time
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import serial

from bench.still_robot import (
    OnElectronics,
    StillWorld,
    example_config,
    on_electronics,
    still_pi,
    still_robot,
)
from protocol.transport.server import Server
from robot.devices import Devices
from robot.drivers.buses import Buses
from robot.drivers.links.device_files import open_serial
from robot.errors import DeviceError
from robot.host.clock import WallClock
from robot.host.logs import complain, set_up_logging
from robot.service.daemon import HOUSEKEEPING, serve
from sim_robot.electronics.dmm32 import DMM32Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator
from sim_robot.faults.control_socket import FaultSocket

DEATHS: Final = MappingProxyType(
    {kind.__name__: kind for kind in (SystemExit, KeyboardInterrupt, GeneratorExit, MemoryError)}
)
"""Exceptions that no driver should raise and a sick one does, by name."""


def main() -> None:
    """Serves until SIGTERM."""
    parser = argparse.ArgumentParser(prog="python -m bench.still_robotd", description=__doc__)
    parser.add_argument("--bind", required=True)
    parser.add_argument("--electronics", choices=("pc104", "pi"), default="pc104")
    parser.add_argument("--telemetry-rate", type=float, default=2.0, help="publications/s")
    parser.add_argument("--control", action="store_true", help="and a socket for faults")
    parser.add_argument("--sick", metavar="DEVICE.METHOD=HOW", help="hangs, or dies of HOW")
    parser.add_argument("--sick-while", type=Path, help="while there is this file")
    parser.add_argument("--port", help="serial port of a servo board in another process; with it:")
    parser.add_argument("--speed", type=float, default=60.0, help="of the joints, degrees/s")
    parser.add_argument("--times", type=Path, help="write the lines there at the end, as JSON")
    options = parser.parse_args()
    set_up_logging()
    log = logging.getLogger("robotd")
    times: list[tuple[float, str]] = []
    with ExitStack() as stack:
        robot = stack.enter_context(_robot(options, times, log))
        if options.sick:
            make_sick(robot.devices, options.sick, only_while=options.sick_while)
        if options.control:
            control = stack.enter_context(FaultSocket(robot.panel, "tcp://127.0.0.1:*"))
            log.info("faults can be injected at %s", control.endpoint)
        rate = options.telemetry_rate
        server = Server(robot.controller, bind=options.bind, telemetry_rate=rate, log=log)
        try:
            serve(robot.controller, server, log)
        except DeviceError as error:
            complain("robotd", error)
            sys.exit(1)
    if options.times is not None:
        options.times.write_text(json.dumps(times), encoding="utf-8")


def _robot(
    options: argparse.Namespace, times: list[tuple[float, str]], log: logging.Logger
) -> AbstractContextManager[OnElectronics]:
    clock = WallClock()
    if options.port is None:
        build = still_pi if options.electronics == "pi" else still_robot
        return build(clock, housekeeping=HOUSEKEEPING, log=log)
    config = replace(example_config(options.port), speed=math.radians(options.speed))
    world = StillWorld.around(config)
    daq = DMM32Emulator(world.input, clock)
    distance = VL6180XEmulator(lambda: world.distance_mm, clock)
    buses = Buses(
        clock=clock,
        open_serial=lambda port, baud: watched(open_serial(port, baud), times),
        open_ports=lambda base: daq,
        open_i2c=lambda path: distance,
    )
    electronics = {"daq": daq, "distance": distance}
    return on_electronics(config, electronics, buses, housekeeping=HOUSEKEEPING, log=log)


def watched(line: serial.Serial, times: list[tuple[float, str]]) -> serial.Serial:
    """Has every write to a line recorded: its time, s, and its text; returns the line."""
    write = line.write

    def recorded(data: bytes) -> int | None:
        times.append((time.perf_counter(), data.decode("ascii")))
        return write(data)

    line.write = recorded  # type: ignore[method-assign, assignment]
    return line


def make_sick(devices: Devices, order: str, *, only_while: Path | None = None) -> None:
    """Has a method of a driver hang or raise, as drivers of other people may.

    Args:
        devices: The drivers, opened.
        order: ``DEVICE.METHOD=HOW``, such as ``servos.set_counts=hang`` or
            ``distance.distance=SystemExit``; ``touch`` is the first touch sensor.
        only_while: File during whose existence the method is sick, while it works before and after;
            ``None``: it is sick from now on.
    """
    place, _, death = order.partition("=")
    device, _, method = place.partition(".")
    driver = devices.touch[0] if device == "touch" else getattr(devices, device)
    original = getattr(driver, method)

    def is_sick() -> bool:
        return only_while is None or only_while.exists()

    def sick(*given: Any) -> Any:
        if is_sick() and death != "hang":
            raise DEATHS[death]
        while is_sick():
            time.sleep(0.01)
        return original(*given)

    setattr(driver, method, sick)


if __name__ == "__main__":
    main()
