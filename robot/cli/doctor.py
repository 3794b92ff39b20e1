"""``robotd doctor``: looks at each device, joint and sensor, and says what to check."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

from protocol.system.files import may_exist
from robot.calibration.guided_session import uncalibrated_parts
from robot.configuration.calibration_file import calibration_command, read_calibration
from robot.configuration.robot_config import RobotConfig, load_config, read_config
from robot.diagnosis.doctor import Doctor
from robot.diagnosis.findings import Finding, Severity, look, ok
from robot.drivers.buses import Buses
from robot.host.clock import WallClock

HELP = "look at each device, joint and sensor, and say what to check; moves nothing"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options."""
    parser.add_argument(
        "--config", type=Path, required=True, metavar="FILE", help="the robot's robot.toml"
    )
    parser.add_argument(
        "--move",
        action="store_true",
        help="also move each joint by some degrees, one after another, and back",
    )


def run(options: argparse.Namespace) -> int:
    """Examines the robot that a configuration describes; 0 when all is well, else 1."""
    config = load_config(options.config, uncalibrated=True)
    buses = Buses(clock=WallClock())
    command = partial(calibration_command, options.config)
    print_findings([describe_config(config, options.config)], print, command)
    return print_findings(Doctor(config, buses, move=options.move).examine(), print, command)


def describe_config(config: RobotConfig, path: Path) -> Finding:
    """A finding that says what the configuration has, and how far it is calibrated."""
    text = f"{config.name}: {len(config.joints)} joints, {len(config.touch)} touch sensors"
    advice = f"{calibration_command(path)}; see docs/your-robot.md"
    _, file = read_config(path)
    if file is None or not may_exist(file):
        missing = f"; {file} does not exist yet" if file else ""
        return look(
            "configuration", f"{text}; not calibrated, the values of {path} stand{missing}", advice
        )
    calibration = read_calibration(file, config.servos.known_counts)
    text += f"; {file.name} revision {calibration.revision} of {calibration.made}"
    if remaining := uncalibrated_parts(config, calibration):
        return look("configuration", f"{text}; not calibrated yet: {', '.join(remaining)}", advice)
    return ok("configuration", text)


def print_findings(
    findings: Iterable[Finding], show: Callable[[str], None], command: Callable[[str], str]
) -> int:
    """Shows findings as they come, with the command that calibrates a part; 1 if one is bad."""
    worst = 0
    for finding in findings:
        for line in finding.lines(command):
            show(line)
        worst |= finding.verdict is Severity.BAD
    return int(worst)
