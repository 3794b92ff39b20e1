"""``docs/extending.md`` is true: a robot runs on its drivers, which lie outside our tree."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from protocol.transport.client import RobotClient
from tests.docs.pages import blocks, section
from tests.free_ports import free_address
from tests.terminal_window import TerminalWindow

PYTHON, POINTS, TABLES = blocks(section("extending", "Drivers"), "(?:python|toml)")
REST = """
[robot]
name = "bench"
joints = 1
touch_sensors = 1

[calibration]
file = "calibration.toml"

[body]
size_mm = [140, 140, 85]
mass_kg = 0.6

[motion]

[settling]

[noise]
tilt_deg = 0
clearance_mm = 0

[[joint]]
name = "hip"
output = 15
limits_deg = [-80, 80]
part_radius_mm = 13
calibration = [[1, -90], [4095, 90]]
"""
HIP = ["", "0", "u 15", "10.4", "done", "", "yes"]  # 240 counts are 10.4°


def install(folder: Path, points: str) -> None:
    """What pip would put on the path."""
    distribution = folder / "bench_drivers-1.0.dist-info"
    distribution.mkdir(parents=True)
    (distribution / "METADATA").write_text("Metadata-Version: 2.1\nName: bench-drivers\n")
    points = points.replace('[project.entry-points."', "[").replace('"]', "]").replace('"', "")
    (distribution / "entry_points.txt").write_text(points)


class Bench:
    """A folder with a ``robot.toml``, and the drivers on the path."""

    def __init__(self, folder: Path):
        self._config = folder / "robot.toml"
        self._config.write_text(TABLES + REST)
        install(folder / "site", POINTS)
        (folder / "site" / "bench_drivers.py").write_text(PYTHON)
        self.environment = os.environ | {"PYTHONPATH": str(folder / "site")}

    def command(self, name: str, *options: str) -> list[str]:
        return [sys.executable, "-m", "robot", name, "--config", str(self._config), *options]

    def done(self, name: str, *options: str, typed: str = "") -> str:
        ended = subprocess.run(
            self.command(name, *options),
            env=self.environment,
            input=typed,
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )
        assert ended.returncode == 0, ended
        return ended.stdout

    @contextmanager
    def robotd(self, bind: str, log: Path) -> Iterator[None]:
        with log.open("w") as stderr:
            process = subprocess.Popen(
                self.command("run", "--bind", bind), env=self.environment, stderr=stderr
            )
            try:
                yield
                process.send_signal(signal.SIGTERM)
                assert process.wait(120) == 0
            finally:
                process.kill()
                process.wait()


def test_a_robot_runs_on_drivers_from_outside(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    assert "hip is written" in bench.done("calibrate", typed="\n".join([*HIP, "skip", ""]))
    findings = bench.done("doctor", "--move")
    assert "BAD" not in findings
    for words in (
        "bench servos answers",
        "bench sensor: 1.000 g",
        "bench sensor: free",
        "move hip",
    ):
        assert words in findings
    window = TerminalWindow(bench.command("try"), bench.environment)
    try:
        shown = window.until("> hip")
        assert "z +1.000 g" in shown
        assert "0.0 mm below the belly" in shown
        window.press("q")
        assert window.ended() == 0
    finally:
        window.close()
    uri, log = free_address(), tmp_path / "log"
    with bench.robotd(uri, log), RobotClient(uri, timeout=120) as client:
        (joint,) = client.capabilities.joints
        assert joint.resolution < 0.001
        client.acquire()
        observation = client.perform({"hip": 0.3})
        assert observation.angles["hip"] == pytest.approx(0.3, abs=joint.resolution)
        assert observation.touch == (False,)
        assert observation.tilt == (0.0, 0.0)
        assert observation.clearance == pytest.approx(0.0)
    said = log.read_text()
    assert "servos (bench servos): every 10 ms" in said
    assert "accelerometer (bench sensor): in memory" in said
