"""The command ``sim-robotd``, also ``python -m sim_robot``."""

from __future__ import annotations

import sys

from robot.cli.startup import start


def main() -> int:
    """Runs the command; returns its exit code."""
    return start("sim-robotd", "sim_robot.command_line", extra="sim")


if __name__ == "__main__":
    sys.exit(main())
