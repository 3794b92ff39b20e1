"""A robot on emulated electronics, to be examined."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

from bench.still_robot import StillRobot
from robot.configuration.calibration_file import calibration_command
from robot.configuration.robot_config import RobotConfig
from robot.diagnosis.doctor import Doctor
from robot.diagnosis.findings import Finding, Severity
from tests.robot.clocks import InstantClock

COMMAND = partial(calibration_command, "my robot.toml")


@dataclass
class Clinic:
    robot: StillRobot
    clock: InstantClock

    @property
    def config(self) -> RobotConfig:
        return self.robot.config

    def examine(self, *, move: bool = False) -> list[Finding]:
        buses = replace(self.robot.buses, clock=self.clock)
        return list(Doctor(self.config, buses, move=move).examine())

    def bad(self, *, move: bool = False) -> dict[str, Finding]:
        """What is bad, by subject; each with advice."""
        findings = [one for one in self.examine(move=move) if one.verdict is Severity.BAD]
        assert all(one.advice for one in findings)
        return {one.subject: one for one in findings}
