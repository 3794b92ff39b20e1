"""The subcommands of ``robotd``.

A subcommand's module has ``HELP`` (one line), ``add_arguments(parser)`` and ``run(options)``, which
returns the exit code and raises ``BodyschemaError`` for whatever a person should read as one
sentence.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Sequence
from types import MappingProxyType
from typing import Final

from protocol.errors import BodyschemaError
from robot.cli.startup import add_version
from robot.host.logs import complain, set_up_logging

COMMANDS: Final = MappingProxyType(
    {
        "new": "robot.cli.new",
        "run": "robot.cli.run",
        "doctor": "robot.cli.doctor",
        "calibrate": "robot.cli.calibrate",
        "scan": "robot.cli.scan",
        "try": "robot.cli.try_out",
        "drivers": "robot.cli.drivers",
        "keys": "robot.cli.keys",
    }
)
"""Subcommand → module."""


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
