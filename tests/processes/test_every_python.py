"""From a simulated robot to a result, with the engines that this Python has."""

from __future__ import annotations

import json
import platform
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from bench.daemons import simulator

pytestmark = pytest.mark.every_python


def test_a_simulated_robot_is_identified(tmp_path: Path) -> None:
    with simulator("--seed", "1") as robot:
        identified = subprocess.run(
            [
                *(sys.executable, "-m", "estimator", "identify", "--robot", robot.uri),
                *("--problem", "parametric", "--method", "paper", "--physics", "statics"),
                *("--interactions", "2", "--population", "10", "--generations", "3"),
                *("--seed", "1", "--jobs", "1", "--out", tmp_path / "run"),
            ],
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )
    assert identified.returncode == 0, identified.stderr
    result = json.loads((tmp_path / "run" / "result.json").read_text(encoding="utf-8"))
    assert result["complete"]
    assert result["versions"]["python"] == platform.python_version()
    assert result["reference"] == ("pybullet" if find_spec("pybullet") else "mujoco")
    assert all(model["sensor_error"] is not None for model in result["best_models"])
