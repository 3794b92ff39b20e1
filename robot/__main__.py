"""The command ``robotd``, also ``python -m robot``."""

from __future__ import annotations

import sys

from robot.starting import start


def main() -> int:
    """Runs a subcommand; returns its exit code."""
    return start("robotd", "robot.cli")


if __name__ == "__main__":
    sys.exit(main())
