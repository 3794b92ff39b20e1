"""What is called settled is at rest: robots that stand on an edge are not read before they tip."""

from __future__ import annotations

import math

import pytest

from bench.daemons import simulator
from protocol import RobotClient

# Radians. PyBullet's body stands still in these poses for half a second, then tips over by 11° and
# 24°; a look back of 0.3 s called it settled before.
ON_AN_EDGE = (
    (0.053, 0.281, -0.013, -0.494, 0.324, -0.457, 0.314, -0.343),
    (-0.312, 0.139, -0.323, 0.398, -0.471, -0.412, 0.236, -0.196),
)


def test_what_is_settled_does_not_tip_over_afterwards() -> None:
    pytest.importorskip("pybullet")
    with (
        simulator("--noise", "none", "--engine", "pybullet") as robot,
        RobotClient(robot.uri) as client,
    ):
        client.acquire()
        names = [joint.name for joint in client.capabilities.joints]
        for pose in ON_AN_EDGE:
            seen = client.perform(dict(zip(names, pose, strict=True)))
            assert seen.settled
            assert seen.tilt is not None
            for _ in range(5):  # each a second of robot time
                later = client.read()
            assert later.tilt == pytest.approx(seen.tilt, abs=math.radians(0.3))
