"""The command ``robotd``, also ``python -m robot``."""

from __future__ import annotations

import sys

from robot.cli.startup import start


def main() -> int:
    """Runs a subcommand; returns its exit code."""
    return start("robotd", "robot.cli.command_line")


if __name__ == "__main__":
    sys.exit(main())
