"""The command line of ``robotd``.

=========================== =====================================================================
Module                      What is in it
=========================== =====================================================================
``run``, ``doctor``, …      a subcommand each, by its name: ``new``, ``calibrate``, ``drivers``,
                            ``keys``; ``try_out`` is ``try``
``command_line``            finds the subcommands in ``COMMANDS``
``startup``                 what a person sees who stops a command before it got to its work
=========================== =====================================================================

A subcommand's module has ``HELP`` (one line), ``add_arguments(parser)`` and ``run(options)``, which
returns the exit code and raises ``BodyschemaError`` for whatever a person should read as one
sentence.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

COMMANDS: Final = MappingProxyType(
    {
        "new": "robot.cli.new",
        "run": "robot.cli.run",
        "doctor": "robot.cli.doctor",
        "calibrate": "robot.cli.calibrate",
        "try": "robot.cli.try_out",
        "drivers": "robot.cli.drivers",
        "keys": "robot.cli.keys",
    }
)
"""Subcommand → module."""
