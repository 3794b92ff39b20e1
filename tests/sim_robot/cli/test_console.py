"""``sim-robotd --console``: what a person can rehearse without a robot."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot.configuration.calibration_file import read_calibration
from robot.drivers.servos.sv203 import COUNTS
from sim_robot.cli.console import RehearsalConsole
from sim_robot.simulator.daemon import Emulation, emulation
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.sensor_noise import NoiseLevels
from tests.terminal_window import TerminalWindow

BODY = load_body(default_body_path())
COMMAND = [sys.executable, "-m", "sim_robot", "--console", "--miscalibrated", "7", "--calibration"]


@pytest.fixture
def parts() -> Iterator[Emulation]:
    with emulation(
        BODY, seed=0, levels=NoiseLevels(), real_time=False, log=logging.getLogger("test"), wrong=7
    ) as emulated:
        yield emulated


def typed(
    parts: Emulation, file: Path | None, monkeypatch: pytest.MonkeyPatch, *lines: str
) -> None:
    """Types lines, in virtual time; after them the input ends."""
    left = list(lines)

    def line(prompt: str) -> str:
        if not left:
            raise EOFError
        return left.pop(0)

    monkeypatch.setattr("builtins.input", line)
    RehearsalConsole(parts, seed=1, file=file).run()
    assert not left


def test_a_doctor_a_session_and_a_doctor_again(
    parts: Emulation,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = tmp_path / "calibration.toml"
    typed(
        parts, file, monkeypatch,
        "doctor", "calibrate accelerometer", "six", *[""] * 6, "yes",
        "fault distance.nak", "doctor", "mend", "stand", "doctor --move", "ground",
    )  # fmt: skip
    said = capsys.readouterr().out
    assert "(simulated: six)" in said
    assert "accelerometer is written" in said
    assert said.count("\nBAD   distance") == 1
    assert "move knee_back" in said
    calibrated, truth = read_calibration(file, COUNTS).accelerometer, parts.truth.axes
    assert calibrated is not None
    assert truth is not None
    assert calibrated.zero == pytest.approx(truth.zero, abs=0.02)
    assert calibrated.per_g == pytest.approx(truth.per_g, abs=0.02)


def test_what_it_does_not_know_is_answered_with_what_it_does(
    parts: Emulation, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    typed(parts, None, monkeypatch, "dance", 'doctor "', "calibrate", "fault daq", "try", "quit")
    said = capsys.readouterr().out
    assert said.count("doctor [--move]") == 2  # at the beginning, and after "dance"
    assert "No closing quotation" in said
    assert "--calibration FILE" in said
    assert "'daq' is no fault" in said
    assert "run it in a terminal" in said


def test_a_lost_connection_costs_one_part_at_most(tmp_path: Path) -> None:
    file = tmp_path / "calibration.toml"
    window = TerminalWindow([*COMMAND, str(file)])
    try:
        window.until("simulated robot > ")
        window.press("try\n")
        window.until("> hip_left")
        window.press("q")
        window.until("simulated robot > ")
        window.press("calibrate hip_left hip_front\n")
        window.until("on the stand")
        window.press("\n")
        for answer in ("u 15", "done"):
            shown = window.until(r"protractor shows (-?[\d.]+)°\)\r\nhip_left: .* measured > ")
            angle = shown.rsplit("shows ", 1)[1].split("°")[0]
            window.press(f"{angle}\n")
            window.until("measured > ")
            window.press(f"{answer}\n")
        window.until("at its new 0")
        window.press("\n")
        window.until("write this")
        window.press("yes\n")
        window.until("hip_left is written(.|\n)*hip_front: .* measured > ")
        window.hang_up()
    finally:
        window.close()
    assert list(read_calibration(file, COUNTS).joints) == ["hip_left"]
