"""A wrongly wired robot, calibrated and then served, as a user would do it."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import pytest

from bench.daemons import simulator
from estimator.problem.problem import Problem
from protocol.transport.client import RobotClient
from protocol.wire.capabilities import Capabilities
from protocol.wire.messages import ObservationReply


def legs_down(*options: str) -> tuple[Capabilities, ObservationReply]:
    """All hips 30° down: the body rises straight, if its legs do what they are told."""
    with simulator(*options) as robot, RobotClient(robot.uri) as client:
        client.acquire()
        joints = client.capabilities.joints
        return client.capabilities, client.perform(
            {joint.name: math.radians(-30 * joint.name.startswith("hip")) for joint in joints}
        )


def test_a_wrongly_wired_robot_stands_level_once_it_is_calibrated(tmp_path: Path) -> None:
    wrong = "--electronics", "pi", "--miscalibrated", "12", "--noise", "none"
    file = tmp_path / "calibration.toml"
    calibrate = [sys.executable, "-m", "sim_robot", *wrong, "--calibrate", "--calibration"]
    done = subprocess.run(
        [*calibrate, str(file)], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert f"{file} is written, revision 1" in done.stdout
    robot, seen = legs_down(*wrong, "--calibration", str(file))
    assert seen.touch is not None
    assert sum(seen.touch) >= 2  # half a count of difference lifts a foot by a millimetre
    assert seen.tilt == pytest.approx((0, 0), abs=math.radians(1))
    # Hips at 42.5 mm, feet of 6 mm at 214 mm from the hips.
    down = -seen.angles["hip_left"]
    assert seen.clearance == pytest.approx(0.214 * math.sin(down) + 0.006 - 0.0425, abs=0.003)
    problem = Problem.load("topological")
    built = {row.name: row.narrow for row in problem.table}
    known = {row.name: row.narrow for row in problem.for_robot(robot).table}
    zeros = {f"zero of leg {leg}" for leg in range(1, 5)}
    gains = {f"travel of leg {leg}" for leg in range(1, 5)}
    others = {"accelerometer's gain", "distance sensor's offset", "distance sensor's gain"}
    assert {name for name in built if known[name] < built[name]} == zeros | gains | others
    assert known["zero of leg 1"] == pytest.approx(math.radians(0.3), rel=0.01)


def test_it_cannot_be_calibrated_into_nothing() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "sim_robot", "--calibrate"],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 2
    assert "--calibration" in done.stderr
