"""``robotd calibrate``: a guided session that writes the robot's calibration file."""

from __future__ import annotations

import argparse
from collections.abc import Collection
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from robot.calibration.guided_session import GuidedSession
from robot.calibration.questions import Console, Questions, Terminal
from robot.configuration.calibration_file import Calibration, save_calibration
from robot.configuration.robot_config import RobotConfig, read_config, with_calibration
from robot.devices import Devices, open_devices, revive
from robot.drivers.buses import Buses
from robot.errors import AbandonedError, ConfigError
from robot.host.clock import Clock, WallClock

HELP = "measure joints and sensors with a person's help, and write the calibration file"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options."""
    parser.add_argument(
        "--config", type=Path, required=True, metavar="FILE", help="the robot's robot.toml"
    )
    parser.add_argument(
        "--only",
        nargs="+",
        default=[],
        metavar="NAME",
        help="joints or touch sensors by name, accelerometer, distance (default: all of them)",
    )


def run(options: argparse.Namespace) -> int:
    """Calibrates the robot that a configuration describes."""
    config, file = read_config(options.config)
    if file is None:
        raise ConfigError(
            'names no file to write. Add [calibration] and below it file = "calibration.toml".',
            file=str(options.config),
            key="calibration",
        )
    config, before = with_calibration(config, file)
    clock = WallClock()
    devices = open_devices(config, Buses(clock=clock), file=str(options.config))
    try:
        calibrate(
            config,
            before,
            devices,
            clock=clock,
            terminal=Console(),
            file=file,
            only=options.only,
        )
    finally:
        devices.close()
    return 0


def calibrate(
    config: RobotConfig,
    before: Calibration,
    devices: Devices,
    *,
    clock: Clock,
    terminal: Terminal,
    file: Path,
    only: Collection[str] = (),
) -> None:
    """Leads through a session and writes its outcome.

    Args:
        config: Configuration of the robot, with its calibration so far.
        before: Calibration that the file holds so far.
        devices: Drivers of the robot's devices.
        clock: The robot clock.
        terminal: Terminal of the session.
        file: File that each part is written to when it was measured; the one before is kept.
        only: Names of the parts to calibrate; empty for everything.

    Raises:
        AbandonedError: Somebody left, or nothing was measured; what was measured is in the file,
            and the robot holds.
    """
    dialogue = Questions(terminal, reconnect=partial(revive, config, devices))
    session = GuidedSession(config, devices, clock=clock, dialogue=dialogue, only=only)
    made_at = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    written: list[str] = []
    backups: list[str] = []

    def save(name: str, calibration: Calibration) -> None:
        calibration = replace(calibration, revision=before.revision + 1, made=made_at)
        # A full disk is no reason to measure everything again.
        backup = dialogue.attempt(
            lambda: save_calibration(
                file,
                calibration,
                config.servos.known_counts,
                keep=not written,  # one revision a session
            )
        )
        written.append(name)
        backups.extend([backup.name] if backup else [])
        terminal.say(f"{name} is written.")

    try:
        session.run(before, save)
        if not written:
            raise AbandonedError("Nothing new was measured.")
    except (AbandonedError, KeyboardInterrupt) as error:
        reason = f"{error} " if isinstance(error, AbandonedError) else ""
        file_state = f"has {', '.join(written)}" if written else "is as it was"
        raise AbandonedError(f"{reason}The robot holds; {file} {file_state}.") from None
    terminal.say(
        f"{file} is written, revision {before.revision + 1}"
        + (f"; the one before is {backups[0]}." if backups else ".")
        + " Restart robotd to use it."
    )
