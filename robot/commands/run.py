"""``robotd run``: serves a robot until SIGTERM or Ctrl-C."""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

from protocol.endpoints import DEFAULT_BIND
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

HELP = "serve the robot until SIGTERM or Ctrl-C"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options."""
    parser.add_argument(
        "--config", type=Path, required=True, metavar="FILE", help="the robot's robot.toml"
    )
    add_server_arguments(parser)


def add_server_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options that ``robotd run`` and ``sim-robotd`` share."""
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


def run(options: argparse.Namespace) -> int:
    """Serves the robot that a configuration describes."""
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
    return 0
