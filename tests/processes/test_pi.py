"""A robot on a PCA9685: its servos are off until somebody confirms where the joints are."""

from __future__ import annotations

import pytest

from bench.daemons import simulator
from protocol.errors import RobotError
from protocol.transport.client import RobotClient
from sim_robot.faults.control_socket import FaultClient


def test_outputs_stay_off_until_a_hold_and_the_daemon_says_so() -> None:
    with (
        simulator(
            "--electronics", "pi", "--no-operator", "--control", "tcp://127.0.0.1:*"
        ) as robot,
        RobotClient(robot.uri) as client,
    ):
        assert any("The servos get no pulses, as after power-up" in line for line in robot.log)
        status = client.status()
        assert status.state == "relaxed"
        assert "Put each joint at 0° by hand and keep clear" in (status.reason or "")
        client.acquire()
        targets = {joint.name: 0.0 for joint in client.capabilities.joints}
        with pytest.raises(RobotError, match="no pulses") as refused:
            client.perform(targets)
        assert refused.value.code == "wrong_state"
        faults = FaultClient(robot.control)
        assert set(faults.report()["pulses"]) == {0}
        assert client.hold().state == "holding"
        assert 0 not in faults.report()["pulses"]
        assert client.status().reason is None
        seen = client.read()
        assert max(map(abs, seen.angles.values())) < 0.01  # rad
