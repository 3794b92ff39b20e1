"""``robotd calibrate`` around the session: which file, when written, what is said."""

from __future__ import annotations

import errno
import logging
import os
from importlib import resources
from pathlib import Path

import pytest

from bench.still_robot import still_robot
from robot.cli.calibrate import calibrate
from robot.cli.command_line import main
from robot.configuration.calibration_file import Calibration, read_calibration
from robot.drivers.servos.sv203 import COUNTS
from robot.errors import AbandonedError
from tests.robot.calibration.desk import Script
from tests.robot.clocks import InstantClock

EXAMPLE = Path(str(resources.files("robot") / "robot.toml"))
LEVEL = ("level", "", "", "", "", "yes")


def level(file: Path, before: Calibration, script: Script) -> None:
    clock = InstantClock()
    with still_robot(clock, housekeeping=None, log=logging.getLogger("test")) as robot:
        calibrate(
            robot.config,
            before,
            robot.devices,
            clock=clock,
            terminal=script,
            file=file,
            only=["accelerometer"],
        )


def test_the_revision_grows_and_the_one_before_is_named(tmp_path: Path) -> None:
    file = tmp_path / "calibration.toml"
    level(file, Calibration(robot="quadruped"), Script(*LEVEL))
    first = read_calibration(file, COUNTS)
    assert first.revision == 1
    assert first.made.endswith("Z")
    script = Script(*LEVEL)
    level(file, first, script)
    assert read_calibration(file, COUNTS).revision == 2
    assert script.heard("calibration.toml.1")
    assert read_calibration(tmp_path / "calibration.toml.1", COUNTS) == first


def test_a_full_disk_does_not_cost_the_measurements(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "calibration.toml"
    failures = [OSError(errno.ENOSPC, "No space left on device")]
    sync = os.fsync

    def full(fd: int) -> None:
        if failures:
            raise failures.pop()
        sync(fd)

    monkeypatch.setattr(os, "fsync", full)
    script = Script(*LEVEL, "")
    level(file, Calibration(robot="quadruped"), script)
    assert script.heard("No space left")
    assert read_calibration(file, COUNTS).accelerometer is not None


def test_a_disk_that_stays_full_leaves_the_file_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(fd: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(AbandonedError, match="as it was"):
        level(tmp_path / "calibration.toml", Calibration(robot="quadruped"), Script(*LEVEL, "q"))
    assert not list(tmp_path.iterdir())


def test_without_a_file_to_write_nothing_is_touched(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "--config", str(EXAMPLE)]) == 1
    assert "[calibration]" in capsys.readouterr().err


def test_an_adapter_that_was_plugged_in_again_goes_on_with_the_part(tmp_path: Path) -> None:
    file, clock = tmp_path / "calibration.toml", InstantClock()
    with still_robot(clock, housekeeping=None, log=logging.getLogger("test")) as robot:

        def unplug() -> None:
            robot.bus.inject("unplugged")

        def raise_plate() -> None:
            robot.world.distance_mm = 108.0

        robot.world.distance_mm = 8.0
        script = Script(
            "", "", (unplug, ""), "", (robot.bus.mend, ""), "", "done",
            "98", (raise_plate, ""), "", "", "done", "yes",
        )  # fmt: skip
        calibrate(
            robot.config,
            Calibration(robot="quadruped"),
            robot.devices,
            clock=clock,
            terminal=script,
            file=file,
            only=["distance"],
        )
    assert script.heard("Plug it in again")
    assert script.left == 0
    assert read_calibration(file, COUNTS).distance is not None
