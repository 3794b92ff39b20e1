"""``robotd scan``: which serial bus servos answer on a line, and at which baud rate."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import Final

from robot.drivers.links.device_files import open_serial
from robot.drivers.servos.answering_servos import AnsweringServoSettings
from robot.drivers.servos.dynamixel import DynamixelSettings
from robot.drivers.servos.feetech import FeetechSettings
from robot.errors import CommandError, DeviceTimeoutError
from robot.host.clock import WallClock

HELP = "list the serial bus servos that answer on a line, by baud rate"

FAMILIES: Final[Mapping[str, type[AnsweringServoSettings]]] = MappingProxyType(
    {"feetech": FeetechSettings, "dynamixel": DynamixelSettings}
)
"""Settings by the name of the driver."""

_PATIENCE: Final = 0.02  # s; an adapter may hold an answer back for 16 ms
_USUAL_IDS: Final = 20


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options."""
    parser.add_argument("port", metavar="PORT", help="the serial line, such as /dev/ttyUSB0")
    parser.add_argument("--servos", choices=tuple(FAMILIES), help="only these (default: all)")
    parser.add_argument("--baud", type=int, help="only this baud rate (default: all)")
    parser.add_argument(
        "--ids",
        type=int,
        default=_USUAL_IDS,
        metavar="N",
        help="up to which id (default %(default)s; there may be 253, which takes minutes)",
    )


def run(options: argparse.Namespace) -> int:
    """Asks every id at every baud rate; nothing moves, and nothing is written."""
    families = {name: family for name, family in FAMILIES.items() if options.servos in (None, name)}
    if options.baud is not None:
        _check_baud(options.baud, families)
    servo_count = 0
    for name, family in families.items():
        for baud in family.bauds:
            if options.baud in (None, baud):
                line = family.chain(
                    partial(open_serial, options.port, baud),
                    clock=WallClock(),
                    reply_timeout=_PATIENCE,
                )
                try:
                    answering = [n for n in family.outputs if n <= options.ids and line.ping(n)]
                finally:
                    line.close()
                servo_count += len(answering)
                if answering:
                    print(f"{name}, {baud} baud: {', '.join(map(str, answering))}", flush=True)
    if not servo_count:
        raise DeviceTimeoutError(
            f"No servo answers on {options.port}.",
            "Check the servos' supply, the cable and the adapter; a servo's id may lie beyond "
            f"{options.ids} (--ids).",
        )
    return 0


def _check_baud(baud: int, families: Mapping[str, type[AnsweringServoSettings]]) -> None:
    """Refuses a baud rate that no servo has."""
    if not any(baud in family.bauds for family in families.values()):
        known = "; ".join(
            f"{name} has {', '.join(map(str, sorted(family.bauds)))}"
            for name, family in families.items()
        )
        raise CommandError(f"--baud {baud} is no rate of these servos: {known}")
