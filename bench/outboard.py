"""``robotd`` in real time on still electronics, with its servo board in another process.

So one can look at the board from outside, and the board outlives the daemon:
``python -m bench.outboard --bind URI --port SERIAL_PORT``.
"""

from __future__ import annotations

import argparse
import logging
import math
from dataclasses import replace

from protocol.server import Server
from robot.clock import WallClock
from robot.daemon import HOUSEKEEPING, Electronics, build_controller, serve, start_devices
from robot.drivers.sv203 import open_serial
from robot.logs import set_up_logging
from sim_robot.electronics.dmm32 import DMM32Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator
from sim_robot.still import StillWorld, example_config


def main() -> None:
    """Serves until SIGTERM."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--bind", required=True)
    parser.add_argument("--port", required=True, help="serial port of the servo board")
    parser.add_argument("--speed", type=float, default=60.0, help="of the joints, degrees/s")
    parser.add_argument("--telemetry-rate", type=float, default=2.0, help="publications/s")
    options = parser.parse_args()
    set_up_logging()
    log = logging.getLogger("robotd")
    clock = WallClock()
    config = replace(example_config(options.port), speed=math.radians(options.speed))
    world = StillWorld.around(config)
    electronics = Electronics(
        serial=open_serial(options.port),
        ports=DMM32Emulator(world.input, clock),
        i2c=VL6180XEmulator(lambda: world.distance_mm, clock),
    )
    devices = start_devices(config, electronics, clock)
    controller = build_controller(
        config, devices, clock=clock, attendant=None, housekeeping=HOUSEKEEPING, log=log
    )
    server = Server(controller, bind=options.bind, telemetry_rate=options.telemetry_rate, log=log)
    serve(controller, server, log)


if __name__ == "__main__":
    main()
