"""``robotd`` in real time on still electronics, with its servo board in another process.

So the board outlives the daemon: ``python -m bench.latency.outboard --bind URI --port
SERIAL_PORT``. With ``--times FILE`` it leaves behind when it wrote what to the line, for the jitter
of the control loop: a pseudo-terminal passes bytes on when the kernel finds the time, so its far
end cannot tell.
"""

from __future__ import annotations

import argparse
import json
import logging
import math
import sys
import time
from dataclasses import replace
from pathlib import Path

import serial

from bench.sick_drivers import make_sick
from bench.still_robot import StillWorld, example_config
from protocol.transport.server import Server
from robot.drivers.buses import Buses
from robot.drivers.links.device_files import open_serial
from robot.errors import DeviceError
from robot.host.clock import WallClock
from robot.host.logs import complain, set_up_logging
from robot.service.daemon import HOUSEKEEPING, build_controller, serve
from robot.service.devices import open_devices
from sim_robot.electronics.dmm32 import DMM32Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator


def main() -> None:
    """Serves until SIGTERM."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--bind", required=True)
    parser.add_argument("--port", required=True, help="serial port of the servo board")
    parser.add_argument("--speed", type=float, default=60.0, help="of the joints, degrees/s")
    parser.add_argument("--telemetry-rate", type=float, default=2.0, help="publications/s")
    parser.add_argument("--sick", help="a driver, as bench.sick_drivers takes it")
    parser.add_argument("--sick-while", type=Path, help="while there is this file")
    parser.add_argument("--times", type=Path, help="write the lines there at the end, as JSON")
    options = parser.parse_args()
    set_up_logging()
    log = logging.getLogger("robotd")
    clock = WallClock()
    config = replace(example_config(options.port), speed=math.radians(options.speed))
    world = StillWorld.around(config)
    times: list[tuple[float, str]] = []
    daq = DMM32Emulator(world.input, clock)
    distance = VL6180XEmulator(lambda: world.distance_mm, clock)
    buses = Buses(
        clock=clock,
        open_serial=lambda port, baud: watched(open_serial(port, baud), times),
        open_ports=lambda base: daq,
        open_i2c=lambda path: distance,
    )
    devices = open_devices(config, buses)
    if options.sick is not None:
        make_sick(devices, options.sick, only_while=options.sick_while)
    controller = build_controller(
        config, devices, clock=clock, operator=None, housekeeping=HOUSEKEEPING, log=log
    )
    server = Server(controller, bind=options.bind, telemetry_rate=options.telemetry_rate, log=log)
    try:
        serve(controller, server, log)
    except DeviceError as error:
        complain("robotd", error)
        sys.exit(1)
    if options.times is not None:
        options.times.write_text(json.dumps(times), encoding="utf-8")


def watched(line: serial.Serial, times: list[tuple[float, str]]) -> serial.Serial:
    """A line of which every write is recorded: its time, s, and its text."""
    write = line.write

    def recorded(data: bytes) -> int | None:
        times.append((time.perf_counter(), data.decode("ascii")))
        return write(data)

    line.write = recorded  # type: ignore[method-assign, assignment]
    return line


if __name__ == "__main__":
    main()
