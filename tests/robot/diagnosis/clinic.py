"""A robot on emulated electronics, to be examined."""

from __future__ import annotations

from dataclasses import dataclass

from robot.configuration.robot_config import RobotConfig
from robot.diagnosis.doctor import DeviceOpeners, Doctor
from robot.diagnosis.findings import Finding, Severity
from robot.host.clock import SteppedClock
from robot.service.devices import open_line, start_adc, start_distance, start_servos
from sim_robot.simulator.still_robot import StillRobot


@dataclass
class Clinic:
    robot: StillRobot
    clock: SteppedClock

    @property
    def config(self) -> RobotConfig:
        return self.robot.config

    def access(self) -> DeviceOpeners:
        """The devices, opened each by itself as on a robot."""
        config, clock, robot = self.config, self.clock, self.robot
        return DeviceOpeners(
            servos=lambda: start_servos(config, open_line(config), clock),
            adc=lambda: start_adc(config, robot.daq, clock),
            distance=lambda: start_distance(config, robot.distance, clock),
        )

    def examine(self, *, move: bool = False) -> list[Finding]:
        return list(Doctor(self.config, self.access(), self.clock, move=move).examine())

    def bad(self, *, move: bool = False) -> dict[str, Finding]:
        """What is bad, by subject; each with advice."""
        found = [one for one in self.examine(move=move) if one.verdict is Severity.BAD]
        assert all(one.advice for one in found)
        return {one.subject: one for one in found}
