"""A wrongly wired robot, calibrated and then served, as a user would do it."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import pytest

from bench.daemons import simulator
from protocol.transport.client import RobotClient
from protocol.wire.messages import ObservationReply


def legs_down(*options: str) -> ObservationReply:
    """All hips 30° down: the body rises straight, if its legs do what they are told."""
    with simulator(*options) as robot, RobotClient(robot.uri) as client:
        client.acquire()
        joints = client.capabilities.joints
        return client.perform(
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
    seen = legs_down(*wrong, "--calibration", str(file))
    assert seen.touch is not None
    assert sum(seen.touch) >= 2  # half a count of difference lifts a foot by a millimetre
    assert seen.tilt == pytest.approx((0, 0), abs=math.radians(1))
    # Hips at 42.5 mm, feet of 6 mm at 214 mm from the hips.
    down = -seen.angles["hip_left"]
    assert seen.clearance == pytest.approx(0.214 * math.sin(down) + 0.006 - 0.0425, abs=0.003)


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
