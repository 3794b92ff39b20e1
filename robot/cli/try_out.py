"""``robotd try``: moves one joint by hand and shows every sensor live, in the terminal."""

from __future__ import annotations

import argparse
from pathlib import Path

from robot.configuration.robot_config import load_config
from robot.drivers.buses import Buses
from robot.host.clock import WallClock
from robot.trial.keyboard import keyboard
from robot.trial.session import Trial

HELP = "move one joint by hand and watch every sensor live, in the terminal"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options."""
    parser.add_argument(
        "--config", type=Path, required=True, metavar="FILE", help="the robot's robot.toml"
    )
    parser.add_argument(
        "--limp",
        action="store_true",
        help="one joint at a time may be let go and moved by hand, where servos say where they are",
    )


def run(options: argparse.Namespace) -> int:
    """Tries the robot that a configuration describes."""
    config = load_config(options.config, uncalibrated=True)
    with keyboard() as view:
        Trial(config, Buses(clock=WallClock()), view, by_hand=options.limp).run()
    print("The robot holds.")
    return 0
