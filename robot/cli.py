"""The command ``robotd``."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from protocol.endpoints import DEFAULT_BIND
from protocol.errors import BodyschemaError
from protocol.server import Server
from robot.clock import WallClock
from robot.config import load_config
from robot.daemon import (
    HOUSEKEEPING,
    build_controller,
    open_electronics,
    serve,
    start_devices,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; returns 0 when done, 1 after a sentence on standard error."""
    options = _parser().parse_args(arguments)
    set_up_logging()
    try:
        run(options)
    except BodyschemaError as error:
        print(f"robotd: {error}", file=sys.stderr)
        return 1
    return 0


def run(options: argparse.Namespace) -> None:
    """Serves the robot that a configuration describes, until a signal."""
    log = logging.getLogger("robotd")
    config = load_config(options.config)
    clock = WallClock()
    devices = start_devices(config, open_electronics(config), clock)
    try:
        controller = build_controller(
            config, devices, clock=clock, attendant=None, housekeeping=HOUSEKEEPING, log=log
        )
        server = Server(controller, bind=options.bind, insecure=options.insecure, log=log)
        serve(controller, server, log)
    finally:
        devices.close()


def add_server_options(parser: argparse.ArgumentParser) -> None:
    """The options that ``robotd`` and ``sim-robotd`` share."""
    parser.add_argument(
        "--bind",
        default=DEFAULT_BIND,
        metavar="URI",
        help="where to take requests (default %(default)s; telemetry on the next port)",
    )
    parser.add_argument(
        "--insecure",
        action="store_true",
        help="allow an address that other computers can reach, without keys",
    )


def set_up_logging() -> None:
    """Log lines go to standard error, with time and reason."""
    logging.basicConfig(format="%(asctime)s %(name)s %(levelname)s: %(message)s", level="INFO")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="robotd", description="Drives a robot's servos and reads its sensors for a client."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    serving = commands.add_parser("run", help="serve the robot until SIGTERM or Ctrl-C")
    serving.add_argument(
        "--config", type=Path, required=True, metavar="FILE", help="the robot's robot.toml"
    )
    add_server_options(serving)
    return parser


if __name__ == "__main__":
    sys.exit(main())
