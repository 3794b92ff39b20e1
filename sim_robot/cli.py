"""The command ``sim-robotd``."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from protocol.errors import BodyschemaError
from protocol.server import Server
from robot.cli import set_up_logging
from robot.commands.run import add_server_arguments
from robot.daemon import serve
from sim_robot.body import default_body_path, load_body
from sim_robot.noise import load_noise


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; returns 0 when done, 1 after a sentence on standard error."""
    options = _parser().parse_args(arguments)
    set_up_logging()
    try:
        if options.print_body:
            load_body(options.body)
            print(options.body.read_text(encoding="utf-8"), end="")
        else:
            run(options)
    except BodyschemaError as error:
        print(f"sim-robotd: {error}", file=sys.stderr)
        return 1
    return 0


def run(options: argparse.Namespace) -> None:
    """Serves the simulated robot until a signal."""
    from sim_robot.daemon import simulated_robot  # noqa: PLC0415 - keeps --help fast

    log = logging.getLogger("sim-robotd")
    with simulated_robot(
        load_body(options.body),
        seed=options.seed,
        levels=load_noise(options.noise),
        real_time=options.real_time,
        attendant=options.attendant,
        log=log,
    ) as robot:
        server = Server(robot.controller, bind=options.bind, insecure=options.insecure, log=log)
        serve(robot.controller, server, log)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="sim-robotd",
        description="A simulated robot: the daemon of a real one, on emulated electronics.",
    )
    parser.add_argument(
        "--body",
        type=Path,
        default=default_body_path(),
        metavar="FILE.urdf",
        help="the body (default: the paper's quadruped)",
    )
    parser.add_argument("--print-body", action="store_true", help="print the body's URDF and exit")
    parser.add_argument(
        "--seed", type=_seed, default=0, help="seed of the sensor noise (default 0)"
    )
    parser.add_argument(
        "--noise",
        default="default",
        metavar="default|none|FILE",
        help="sensor noise (a file is TOML with the keys of the documentation)",
    )
    parser.add_argument(
        "--real-time",
        action="store_true",
        help="let time pass as on a wall clock (default: as fast as the physics goes)",
    )
    parser.add_argument(
        "--no-attendant",
        dest="attendant",
        action="store_false",
        help="leave the body as it fell, instead of laying it down before each interaction",
    )
    add_server_arguments(parser)
    return parser


def _seed(text: str) -> int:
    if not text.isdecimal() or int(text) >= 2**32:
        raise argparse.ArgumentTypeError(f"must be an integer from 0 to 2^32-1, not {text!r}")
    return int(text)


if __name__ == "__main__":
    sys.exit(main())
