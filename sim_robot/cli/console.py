"""``sim-robotd --console``: ``doctor``, ``calibrate`` and ``try`` on emulated electronics."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from protocol.errors import BodyschemaError
from robot.calibration.questions import Console
from robot.cli.doctor import print_findings
from robot.configuration.robot_config import RobotConfig, with_calibration
from robot.diagnosis.doctor import Doctor
from robot.errors import CommandError
from robot.service.devices import open_devices
from robot.trial.keyboard import keyboard
from robot.trial.session import Trial
from sim_robot.faults.fault_panel import FaultSpec
from sim_robot.simulator.daemon import Emulation
from sim_robot.simulator.person import STAND, Rehearsal

HELP: Final = """\
  doctor [--move]      looks at each device, joint and sensor, as robotd doctor does
  calibrate [NAME …]   the guided session, whole or by parts; the simulated hands help
  try                  one joint by hand, every sensor live
  stand, ground        put the robot on a stand, or on its belly
  fault SPEC, mend     break something (sim-robotd --help lists what), and mend it all
  quit"""


class RehearsalConsole:
    """Commands that are typed, on one simulated robot.

    Args:
        parts: Its emulated electronics; the drivers that are open there are closed.
        seed: Of the errors of the simulated hands.
        file: The calibration file, which need not exist, or ``None``.
    """

    def __init__(self, parts: Emulation, *, seed: int, file: Path | None):
        self._parts = parts
        self._seed = seed
        self._file = file
        parts.devices.close()  # each command opens its own, as on a robot

    def run(self) -> None:
        """Reads commands from standard input until its end, or ``quit``."""
        console = Console()
        console.say(f"{self._parts.config.name}, simulated, in real time:\n{HELP}")
        while True:
            try:
                words = shlex.split(console.ask("simulated robot"))
                if words[:1] == ["quit"]:
                    return
                if words:
                    self._obey(words[0], words[1:])
            except EOFError:
                return
            except (BodyschemaError, ValueError) as error:  # ValueError: a quote without its end
                console.say(f"! {error}")

    def _obey(self, command: str, arguments: Sequence[str]) -> None:
        parts, world = self._parts, self._parts.world
        match command, list(arguments):
            case "doctor", [] | ["--move"]:
                doctor = Doctor(self._config(), parts.buses, move=bool(arguments))
                print_findings(doctor.examine(), print)
            case "calibrate", names:
                self._calibrate(names)
            case "try", []:
                with keyboard() as view:
                    Trial(self._config(), parts.buses, view).run()
            case "stand", []:
                world.hold(STAND, (0.0, 0.0, 1.0))
            case "ground", []:
                world.lay_down()
            case "fault", [spec]:
                parts.panel.order(FaultSpec.parse(spec))
            case "mend", []:
                parts.panel.mend()
            case _:
                print(HELP)

    def _config(self) -> RobotConfig:
        return with_calibration(self._parts.config, self._file)[0]

    def _calibrate(self, only: Sequence[str]) -> None:
        if self._file is None:
            raise CommandError("start with --calibration FILE, which this writes")
        devices = open_devices(self._config(), self._parts.buses)
        try:
            Rehearsal(self._parts, seed=self._seed, echo=print).calibrate(devices, self._file, only)
        finally:
            devices.close()
