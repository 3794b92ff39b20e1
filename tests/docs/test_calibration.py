"""The calibration of ``docs/your-robot.md``: a newcomer runs its commands, in order.

The devices are emulated, and the newcomer types into a terminal that is a list. Time is virtual.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from importlib import resources
from pathlib import Path

import pytest

from bench.still_robot import StillWorld, example_config
from robot.cli.command_line import main
from robot.configuration.calibration_file import read_calibration
from robot.configuration.robot_config import load_config
from robot.drivers.buses import Buses
from robot.drivers.servos.sv203 import COUNTS
from sim_robot.electronics.dmm32 import DMM32Emulator
from sim_robot.electronics.sv203 import SV203Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator
from tests.docs.pages import section
from tests.robot.clocks import InstantClock

PAGE = section("your-robot", "Calibration")
EXAMPLE = Path(str(resources.files("robot") / "robot.toml")).read_text(encoding="utf-8")
HIP = ["-20", "u 20", "u 20", "4", "done", "0", "yes"]  # count 128 is -20°, and 0.6° a count
GROUND, PLATE = ["", "", "", "done"], ["100", "", "", "", "done"]


class Newcomer:
    """Types what was written down; the plate lies under the robot when its height was typed."""

    def __init__(self, world: StillWorld):
        self._world = world
        self.lines: list[str] = []

    def __call__(self, prompt: str) -> str:
        line = self.lines.pop(0)
        if "belly flat" in prompt:
            self._world.distance_mm = 12.0
        elif "height of a plate" in prompt:
            self._world.distance_mm = 112.0
        return line


@pytest.fixture
def newcomer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Newcomer]:
    """Somebody in the folder of a new ``robot.toml``, whose devices are emulated."""
    monkeypatch.chdir(tmp_path)
    board, clock = SV203Emulator(), InstantClock()
    world = StillWorld.around(example_config(board.port))
    daq = DMM32Emulator(world.input, clock)
    distance = VL6180XEmulator(lambda: world.distance_mm, clock)
    found = Newcomer(world)
    buses = Buses(clock=clock, open_ports=lambda base: daq, open_i2c=lambda path: distance)
    for module in ("calibrate", "doctor"):
        monkeypatch.setattr(f"robot.cli.{module}.WallClock", lambda: clock)
        monkeypatch.setattr(f"robot.cli.{module}.Buses", lambda clock: buses)
    monkeypatch.setattr("builtins.input", found)
    Path("robot.toml").write_text(EXAMPLE.replace("/dev/ttyS0", board.port), encoding="utf-8")
    yield found
    board.close()


def test_the_page_can_be_followed(newcomer: Newcomer, capsys: pytest.CaptureFixture[str]) -> None:
    doctor, calibrate, go_on = re.findall(r"^ {4,}robotd (.+)$", PAGE, re.MULTILINE)[:3]
    (names_the_file,) = re.findall(r"```toml\n(.+?)```", PAGE, re.DOTALL)
    with Path("robot.toml").open("a", encoding="utf-8") as file:
        file.write(names_the_file.replace("\n   ", "\n"))

    assert main(["run", "--config", "robot.toml"]) == 1
    assert f"robotd {calibrate}" in capsys.readouterr().err  # what to do first

    assert main(shlex.split(doctor)) == 0
    output = capsys.readouterr().out
    assert "does not exist yet" in output
    assert f"robotd {calibrate}" in output

    newcomer.lines = ["", *HIP, "q"]
    assert main(shlex.split(calibrate)) == 1
    assert "calibration.toml has hip_left." in capsys.readouterr().err
    assert list(read_calibration(Path("calibration.toml"), COUNTS).joints) == ["hip_left"]

    newcomer.lines = ["", "skip", "", *GROUND, *PLATE, "yes"]
    assert main(shlex.split(go_on)) == 0
    assert not newcomer.lines
    assert "revision 2; the one before is calibration.toml.1" in capsys.readouterr().out

    assert main(shlex.split(doctor)) == 0
    assert "not calibrated yet: hip_front, " in capsys.readouterr().out
    config = load_config(Path("robot.toml"))
    assert config.joints[0].scale.count(0.0) == 161
    assert config.distance is not None
    assert config.distance.zero == pytest.approx(0.012)


def test_a_dry_run_needs_no_calibration(
    newcomer: Newcomer, capsys: pytest.CaptureFixture[str]
) -> None:
    del newcomer
    text = Path("robot.toml").read_text(encoding="utf-8")
    Path("robot.toml").write_text(
        text.replace("# [calibration]\n# file", "[calibration]\nfile"), encoding="utf-8"
    )
    assert main(["run", "--config", "robot.toml", "--dry", "--bind", "nonsense"]) == 1
    refusal = capsys.readouterr().err.splitlines()[-1]
    assert "nonsense" in refusal  # all that it minds is the address
