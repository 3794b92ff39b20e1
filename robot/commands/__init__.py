"""The subcommands of ``robotd``, one module each.

A module has ``HELP`` (one line), ``add_arguments(parser)`` and ``run(options)``, which returns the
exit code and raises ``BodyschemaError`` for whatever a person should read as one sentence.
``robot.cli`` finds them in ``COMMANDS``.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

COMMANDS: Final = MappingProxyType(
    {
        "run": "robot.commands.run",
        "doctor": "robot.commands.doctor",
        "calibrate": "robot.commands.calibrate",
        "keys": "robot.commands.keys",
    }
)
"""Subcommand → module."""
