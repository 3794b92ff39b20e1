"""``robotd new``: what it writes can be run, or says what is missing."""

from __future__ import annotations

import shlex
from importlib import resources
from pathlib import Path

import pytest

from robot.cli.command_line import main
from robot.cli.new import SERVOS, SETS, robot_toml
from robot.configuration.robot_config import load_config

EXAMPLE = resources.files("robot").joinpath("robot.toml").read_text(encoding="utf-8")


def test_the_default_is_the_documented_example_with_a_calibration_file() -> None:
    text = robot_toml("pc104", name="quadruped", joints=8, touch=4)
    assert text == EXAMPLE.replace("# [calibration]\n# file", "[calibration]\nfile")


@pytest.mark.parametrize("servos", [None, *SERVOS])
@pytest.mark.parametrize("electronics", SETS)
@pytest.mark.parametrize(("joints", "touch"), [(8, 4), (1, 0), (9, 5), (17, 3), (24, 16)])
def test_any_number_of_joints_is_a_configuration(
    tmp_path: Path, electronics: str, servos: str | None, joints: int, touch: int
) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(
        robot_toml(electronics, servos=servos, name='Ann\'s "crawler"', joints=joints, touch=touch),
        encoding="utf-8",
    )
    config = load_config(file, uncalibrated=True)
    assert config.name == 'Ann\'s "crawler"'
    assert [joint.output for joint in config.joints] == list(config.servos.outputs)[:joints]
    assert len({joint.name for joint in config.joints}) == joints
    assert len(config.touch) == touch
    assert servos is None or config.servos.name.lower() == servos
    assert (config.daq is None) == (electronics == "pi" and not touch)


@pytest.mark.parametrize("electronics", SETS)
def test_run_says_what_comes_first(
    tmp_path: Path, electronics: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "robot.toml"
    assert main(["new", "--electronics", electronics, str(file)]) == 0
    steps = capsys.readouterr().out
    assert f"robotd calibrate --config {file}" in steps
    assert main(["run", "--config", str(file)]) == 1
    assert f"robotd calibrate --config {file}" in capsys.readouterr().err
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("/dev/ttyS0", "/dev/none").replace("bus = 1 ", "bus = 250 "))
    assert main(["calibrate", "--config", str(file)]) == 1
    assert "cannot be opened" in capsys.readouterr().err


def test_what_it_says_can_be_typed_whatever_the_file_is_called(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "my robot.toml"
    assert main(["new", "--electronics", "pc104", str(file)]) == 0
    _, *steps = capsys.readouterr().out.splitlines()
    assert [shlex.split(step) for step in steps] == [
        ["robotd", name, "--config", str(file)] for name in ("doctor", "calibrate", "run")
    ]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--joints", "25"], "--joints: must be from 1 to 24, not 25"),
        (["--name", ""], "--name: must have 1 to 64 characters, not 0"),
        (["--name", "r" * 65], "--name: must have 1 to 64 characters, not 65"),
        (["--touch", "-1"], "--touch: must be from 0 to 24, not -1"),
    ],
)
def test_what_it_cannot_write_is_refused(
    tmp_path: Path, options: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "robot.toml"
    assert main(["new", "--electronics", "pc104", *options, str(file)]) == 1
    assert words in capsys.readouterr().err
    assert not file.exists()


@pytest.mark.parametrize("name", ["joints = 8", "touch_sensors = 4", 'a "b" \\ é', "x\ny"])
def test_any_name_is_written_as_it_is(tmp_path: Path, name: str) -> None:
    file = tmp_path / "robot.toml"
    made = ["new", "--electronics", "pc104", "--joints", "3", "--name", name, str(file)]
    assert main(made) == 0
    config = load_config(file, uncalibrated=True)
    assert (config.name, len(config.joints)) == (name, 3)


def test_a_file_that_is_there_stays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "robot.toml"
    file.write_text("mine", encoding="utf-8")
    assert main(["new", "--electronics", "pi", str(file)]) == 1
    assert "exists already" in capsys.readouterr().err
    assert file.read_text(encoding="utf-8") == "mine"
    assert main(["new", "--electronics", "pi", str(tmp_path / "no" / "robot.toml")]) == 1
    assert "cannot be written" in capsys.readouterr().err
