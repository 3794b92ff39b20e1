"""The command ``sim-robotd``, also ``python -m sim_robot``."""

from __future__ import annotations

import sys

from robot.starting import start


def main() -> int:
    """Runs the command; returns its exit code."""
    return start("sim-robotd", "sim_robot.cli", extra="sim")


if __name__ == "__main__":
    sys.exit(main())
