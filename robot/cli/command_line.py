"""The subcommands of ``robotd``."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Sequence

from protocol.errors import BodyschemaError
from robot.cli import COMMANDS
from robot.cli.startup import add_version
from robot.host.logs import complain, set_up_logging


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a subcommand; returns its exit code, or 1 after a sentence on standard error."""
    parser = argparse.ArgumentParser(
        prog="robotd", description="Drives a robot's servos and reads its sensors for a client."
    )
    add_version(parser)
    commands = parser.add_subparsers(dest="command", required=True)
    modules = {name: importlib.import_module(module) for name, module in COMMANDS.items()}
    for name, module in modules.items():
        module.add_arguments(
            commands.add_parser(name, help=module.HELP, description=f"{name}: {module.HELP}.")
        )
    options = parser.parse_args(arguments)
    set_up_logging()
    try:
        return int(modules[options.command].run(options))
    except BodyschemaError as error:
        complain("robotd", error)
        return 1
