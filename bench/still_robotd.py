"""``robotd`` on emulated electronics in a world that never moves: what the daemon itself costs."""

from __future__ import annotations

import logging
import sys

from bench.still_pi import still_pi
from bench.still_robot import still_robot
from protocol.transport.server import Server
from robot.host.clock import WallClock
from robot.service.daemon import HOUSEKEEPING, serve


def main() -> None:
    """Serves on the address given as argument until SIGTERM; with ``pi``, on the chips of a Pi."""
    log = logging.getLogger("robotd")
    build = still_pi if sys.argv[2:] == ["pi"] else still_robot
    with build(WallClock(), housekeeping=HOUSEKEEPING, log=log) as robot:
        server = Server(robot.controller, bind=sys.argv[1], telemetry_rate=2.0, log=log)
        print(server.endpoint, flush=True)
        serve(robot.controller, server, log)


if __name__ == "__main__":
    main()
