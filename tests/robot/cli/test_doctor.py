"""``robotd doctor`` as a command: exit codes, and what it says without any hardware."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import pytest

from robot.cli.command_line import main
from robot.cli.doctor import describe_config, print_findings
from robot.configuration.calibration_file import (
    AxesCalibration,
    Calibration,
    DistanceCalibration,
    GaugeCalibration,
    JointCalibration,
    save_calibration,
)
from robot.configuration.robot_config import load_config
from robot.diagnosis.findings import Severity, bad, look, ok
from robot.drivers.servos.sv203 import COUNTS

EXAMPLE = Path(str(resources.files("robot") / "robot.toml"))


def test_only_what_is_bad_fails() -> None:
    lines: list[str] = []
    fine = [ok("a", "good"), look("b", "odd", "Look.")]
    assert print_findings(fine, lines.append, str) == 0
    worse = [*fine, bad("c", "dead", "Mend."), ok("d", "good")]
    assert print_findings(worse, lines.append, str) == 1
    assert [line.split()[0] for line in lines] == ["ok", "look", "->"] * 2 + ["BAD", "->", "ok"]


def robot_toml(folder: Path) -> Path:
    text = EXAMPLE.read_text(encoding="utf-8")
    text = text.replace("# [calibration]\n# file", "[calibration]\nfile")
    text = text.replace('"/dev/ttyS0"', f'"{folder}/no-adapter"')
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    return folder / "robot.toml"


def test_the_configuration_says_how_old_its_calibration_is(tmp_path: Path) -> None:
    plain = describe_config(load_config(EXAMPLE), EXAMPLE)
    assert plain.verdict is Severity.LOOK
    assert "robotd calibrate" in plain.advice
    file = robot_toml(tmp_path)
    calibration = Calibration(robot="quadruped", revision=7, made="2026-11-20T03:57:20Z")
    save_calibration(tmp_path / "calibration.toml", calibration, COUNTS)
    finding = describe_config(load_config(file), file)
    assert finding.verdict is Severity.LOOK
    assert "revision 7 of 2026-11-20" in finding.text
    assert "not calibrated yet: hip_left, hip_front" in finding.text
    assert "lower_back, distance" in finding.text
    config = load_config(EXAMPLE)
    whole = Calibration(
        robot="quadruped",
        revision=8,
        joints={
            joint.name: JointCalibration(
                output=joint.output,
                lower_limit=joint.lower_limit,
                upper_limit=joint.upper_limit,
                scale=joint.scale,
            )
            for joint in config.joints
        },
        accelerometer=AxesCalibration(
            wiring={"channels": (0, 1, 2)}, unit="V", zero=(2.5,) * 3, per_g=(1.0,) * 3
        ),
        gauges={
            name: GaugeCalibration(
                channel=gauge.channel, tare=0.2, volts_per_newton=0.2, on=0.1, off=0.05
            )
            for name, gauge in config.gauges.items()
        },
        distance=DistanceCalibration(zero=0.01, scale=1.0),
    )
    save_calibration(tmp_path / "calibration.toml", whole, COUNTS)
    assert describe_config(load_config(file), file).verdict is Severity.OK


def test_a_gauge_is_not_calibrated_because_a_joint_of_its_name_is(tmp_path: Path) -> None:
    file = robot_toml(tmp_path)
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace('"lower_left"', '"hip_left"'), encoding="utf-8")
    joint = load_config(file, uncalibrated=True).joints[0]
    measured = JointCalibration(
        output=joint.output,
        lower_limit=joint.lower_limit,
        upper_limit=joint.upper_limit,
        scale=joint.scale,
    )
    calibration = Calibration(robot="quadruped", revision=1, joints={"hip_left": measured})
    save_calibration(tmp_path / "calibration.toml", calibration, COUNTS)
    remaining = describe_config(load_config(file), file).text.split("not calibrated yet: ")[1]
    assert remaining.startswith("hip_front")
    assert "accelerometer, hip_left, lower_front" in remaining


def test_a_calibration_that_is_yet_to_be_made_hinders_no_examination(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "my robot"
    folder.mkdir()
    file = robot_toml(folder)
    assert main(["doctor", "--config", str(file)]) == 1  # no hardware, but it does examine
    output = capsys.readouterr().out
    assert f"{folder / 'calibration.toml'} does not exist yet" in output
    assert f"robotd calibrate --config '{file}'" in output
    assert "no-adapter" in output


def test_without_hardware_every_device_is_missed_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = robot_toml(tmp_path)
    save_calibration(
        tmp_path / "calibration.toml",
        Calibration(robot="quadruped", revision=1, made="now"),
        COUNTS,
    )
    text = file.read_text(encoding="utf-8").replace("bus = 1 ", "bus = 250 ")
    file.write_text(text, encoding="utf-8")
    assert main(["doctor", "--config", str(file)]) == 1
    output = capsys.readouterr().out
    missed = [line.split("  ")[0] for line in output.splitlines() if line.startswith("BAD")]
    assert len(missed) == 3
    assert "no-adapter" in output
    assert "/dev/i2c-250" in output


def test_a_wrong_configuration_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--config", str(tmp_path / "none.toml")]) == 1
    assert "none.toml" in capsys.readouterr().err
