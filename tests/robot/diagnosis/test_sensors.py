"""Sensors that answer and yet cannot be right."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from typing import Any

import pytest

from robot.diagnosis.findings import Finding, Severity
from tests.robot.diagnosis.clinic import COMMAND, Clinic


def of(clinic: Clinic, subject: str) -> Finding:
    (finding,) = [one for one in clinic.examine() if one.subject == subject]
    return finding


class Trembling(list[float]):
    """Volts with noise on one channel."""

    def __init__(self, volts: list[float], channel: int, rms: float):
        super().__init__(volts)
        self._channel, self._rms = channel, rms
        self._random = random.Random(2)

    def __getitem__(self, index: Any) -> Any:
        noise = self._random.gauss(0, self._rms) if index == self._channel else 0.0
        return super().__getitem__(index) + noise


def lean(clinic: Clinic, across: float, along: float) -> None:
    y, x = math.sin(math.radians(across)), math.sin(math.radians(along))
    z = math.sqrt(1 - x * x - y * y)
    clinic.robot.world.volts[:3] = [2.5 + x, 2.5 + y, 2.5 + z]


def test_tilt_noise_and_rates_are_told(clinic: Clinic) -> None:
    lean(clinic, 4, -2)
    clinic.robot.world.distance_mm = 25
    clinic.robot.world.volts = Trembling(clinic.robot.world.volts, 2, 0.0015)
    text = of(clinic, "accelerometer").text
    assert "+4.0° left up" in text
    assert "-2.0° nose up" in text
    assert 1.2 < float(text.split("noise ")[1].split(" mg")[0]) < 1.8
    assert "scans a second" in of(clinic, "analogue inputs").text
    distance = of(clinic, "distance").text
    assert "+15.0 mm" in distance
    assert "ms a measurement" in distance


@pytest.mark.parametrize(("along", "verdict"), [(1.0, Severity.OK), (-3.0, Severity.LOOK)])
def test_ground_that_slopes_is_told_of(clinic: Clinic, along: float, verdict: Severity) -> None:
    """Of 3°, an identification has lengths wrong by up to 50 mm."""
    lean(clinic, 0, along)
    finding = of(clinic, "accelerometer")
    assert finding.verdict is verdict
    assert ("Level the ground" in finding.advice) == (verdict is Severity.LOOK)


@pytest.mark.parametrize(
    ("volts", "words"),
    [
        ([2.5, 2.5, 2.9], "0.40 g at rest"),
        ([2.5, 2.5, 4.2], "1.70 g at rest"),
        ([2.5, 2.5, 1.5], "on its back"),
    ],
)
def test_gravity_that_cannot_be_is_bad(clinic: Clinic, volts: list[float], words: str) -> None:
    clinic.robot.world.volts[:3] = volts
    finding = of(clinic, "accelerometer")
    assert finding.verdict is Severity.BAD
    assert words in finding.text
    assert finding.part == "accelerometer"


def test_a_robot_that_never_comes_to_rest_is_told_of(clinic: Clinic) -> None:
    clinic.robot.world.volts = Trembling(clinic.robot.world.volts, 0, 0.01)
    finding = of(clinic, "accelerometer")
    assert finding.verdict is Severity.BAD
    assert "rest is at most 0.5°" in finding.text


def test_a_leaning_robot_is_worth_a_look(clinic: Clinic) -> None:
    lean(clinic, 0, 15)
    clinic.robot.world.distance_mm = 60
    assert of(clinic, "accelerometer").verdict is Severity.LOOK


@pytest.mark.parametrize(("force", "verdict"), [
    (0.0, Severity.OK), (2.0, Severity.OK), (-0.5, Severity.BAD), (80.0, Severity.BAD),
])  # fmt: skip
def test_the_ground_pushes_and_does_not_pull(
    clinic: Clinic, force: float, verdict: Severity
) -> None:
    clinic.robot.world.volts[4] = 0.2 + 0.05 * force
    point = clinic.config.touch[1]
    gauge = replace(clinic.config.gauges[point.name], volts_per_newton=0.05)
    config = replace(clinic.config, touch=(replace(point, driver=gauge),))
    clinic.robot = replace(clinic.robot, config=config)
    finding = of(clinic, "touch lower_front")
    assert finding.verdict is verdict
    assert f"{force:+.1f}" in finding.text
    if verdict is Severity.OK:
        assert finding.text.endswith("touching" if force else "free")
    else:
        assert finding.part == "lower_front"


def test_a_threshold_within_the_noise_flickers(clinic: Clinic) -> None:
    clinic.robot.world.volts = Trembling(clinic.robot.world.volts, 4, 0.01)  # 0.05 N
    finding = of(clinic, "touch lower_front")
    assert finding.verdict is Severity.BAD
    assert "flicker" in finding.text


def test_a_slow_board_cannot_keep_the_rate(clinic: Clinic) -> None:
    settling = replace(clinic.config.settling, rate=50_000)
    clinic.robot = replace(clinic.robot, config=replace(clinic.config, settling=settling))
    finding = of(clinic, "analogue inputs")
    assert finding.verdict is Severity.BAD
    assert "settling.rate_hz" in finding.text


@pytest.mark.parametrize(
    ("millimetres", "across", "verdict", "words"),
    [
        (None, 0, Severity.LOOK, "sees nothing"),
        (2.0, 0, Severity.BAD, "inside the belly"),
        (10.0, 20, Severity.BAD, "leans"),  # on the ground, and leaning by 20°
        (110.0, 20, Severity.OK, "+100.0 mm"),
    ],
)
def test_a_distance_that_cannot_be_is_bad(
    clinic: Clinic, millimetres: float | None, across: float, verdict: Severity, words: str
) -> None:
    lean(clinic, across, 0)
    clinic.robot.world.distance_mm = millimetres
    finding = of(clinic, "distance")
    assert finding.verdict is verdict, finding
    assert words in finding.text


def test_a_command_that_is_advised_can_be_typed_as_it_is(clinic: Clinic) -> None:
    point = clinic.config.touch[1]
    config = replace(clinic.config, touch=(replace(point, name="left foot"),))
    clinic.robot = replace(clinic.robot, config=config)
    clinic.robot.world.volts[4] = 0.0
    clinic.robot.world.distance_mm = 2.0
    command = "robotd calibrate --config 'my robot.toml' --only"
    for subject, part in (("touch left foot", "'left foot'"), ("distance", "distance")):
        _, advice = of(clinic, subject).lines(COMMAND)
        assert advice.endswith(f" {command} {part}")


def test_a_robot_without_distance_sensor_is_no_fault(clinic: Clinic) -> None:
    clinic.robot = replace(clinic.robot, config=replace(clinic.config, distance=None))
    assert of(clinic, "distance").verdict is Severity.OK
