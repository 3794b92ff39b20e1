"""``robotd`` on emulated electronics in a world that never moves: what the daemon itself costs."""

from __future__ import annotations

import argparse
import logging
import sys
from contextlib import ExitStack

from bench.sick_drivers import make_sick
from bench.still_pi import still_pi
from bench.still_robot import still_robot
from protocol.transport.server import Server
from robot.errors import DeviceError
from robot.host.clock import WallClock
from robot.host.logs import complain
from robot.service.daemon import HOUSEKEEPING, serve
from sim_robot.faults.control_socket import FaultSocket


def main() -> None:
    """Serves until SIGTERM, and prints where."""
    parser = argparse.ArgumentParser(prog="python -m bench.still_robotd")
    parser.add_argument("bind")
    parser.add_argument("electronics", nargs="?", choices=("pc104", "pi"), default="pc104")
    parser.add_argument("--control", action="store_true", help="and a socket for faults")
    parser.add_argument("--sick", help="as bench.sick_drivers takes it")
    options = parser.parse_args()
    log = logging.getLogger("robotd")
    build = still_pi if options.electronics == "pi" else still_robot
    with ExitStack() as stack:
        robot = stack.enter_context(build(WallClock(), housekeeping=HOUSEKEEPING, log=log))
        if options.sick:
            make_sick(robot.devices, options.sick)
        server = Server(robot.controller, bind=options.bind, telemetry_rate=2.0, log=log)
        print(server.endpoint, flush=True)
        if options.control:
            control = FaultSocket(robot.panel, "tcp://127.0.0.1:*")
            print(stack.enter_context(control).endpoint, flush=True)
        try:
            serve(robot.controller, server, log)
        except DeviceError as error:
            complain("robotd", error)
            sys.exit(1)


if __name__ == "__main__":
    main()
