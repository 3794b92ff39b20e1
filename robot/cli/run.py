"""``robotd run``: serves a robot until SIGTERM, SIGHUP or Ctrl-C."""

from __future__ import annotations

import argparse
import logging
from importlib import metadata, resources
from pathlib import Path
from typing import Final

from protocol.sockets.zmq_sockets import DEFAULT_BIND
from protocol.transport.server import Server
from robot.configuration.robot_config import load_config
from robot.devices import open_devices, report_devices
from robot.drivers.buses import Buses
from robot.host.clock import WallClock, WatchedClock
from robot.host.service_manager import ServiceManager
from robot.service.daemon import HOUSEKEEPING, build_controller, serve
from robot.service.dry_run import dry_config, dry_devices

HELP = "serve the robot until SIGTERM or Ctrl-C"
EXAMPLE: Final = Path(str(resources.files("robot") / "robot.toml"))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options."""
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="the robot's robot.toml; only a dry run can do without, and takes the example's",
    )
    parser.add_argument(
        "--dry",
        action="store_true",
        help="touch no hardware: commanded angles come back, and there are no sensors",
    )
    add_server_arguments(parser)
    parser.set_defaults(refuse=parser.error)


def add_server_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options that ``robotd run`` and ``sim-robotd`` share."""
    parser.add_argument(
        "--bind",
        default=DEFAULT_BIND,
        metavar="URI",
        help="where to take requests (default %(default)s; telemetry on the next port)",
    )
    parser.add_argument(
        "--keys",
        type=Path,
        metavar="DIR",
        help="let in only clients that this key directory knows (see robotd keys)",
    )
    parser.add_argument(
        "--insecure",
        action="store_true",
        help="allow an address that other computers can reach, without keys",
    )


def run(options: argparse.Namespace) -> int:
    """Serves the robot that a configuration describes."""
    if options.config is None and not options.dry:
        options.refuse("give the robot's --config FILE, or say --dry")
    path = options.config or EXAMPLE
    config = load_config(path, uncalibrated=options.dry)
    if options.dry:
        config = dry_config(config)
    log = logging.getLogger("robotd")
    log.info(
        "bodyschema %s: robot %s, %s (configuration %s)",
        metadata.version("bodyschema"),
        config.name,
        path,
        config.hash,
    )
    manager = ServiceManager()
    clock = WatchedClock(WallClock(), manager.alive)
    if options.dry:
        log.warning("dry run: no hardware is touched, and there are no sensors")
        devices = dry_devices(config)
    else:
        devices = open_devices(config, Buses(clock=clock), file=str(path))
    try:
        controller = build_controller(
            config,
            devices,
            clock=clock,
            operator=None,
            housekeeping=HOUSEKEEPING,
            log=log,
            manager=manager,
        )
        if not options.dry:
            report_devices(config, log)
        server = Server(
            controller,
            bind=options.bind,
            keys=options.keys,
            insecure=options.insecure,
            log=log,
        )
        serve(controller, server, log, manager=manager)
    finally:
        devices.close()
    return 0
