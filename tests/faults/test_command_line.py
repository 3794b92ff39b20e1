"""Faults ordered on the command line of ``sim-robotd``."""

from __future__ import annotations

import subprocess
import sys
import time
from contextlib import suppress

import pytest

from bench.daemons import simulator
from protocol.errors import RobotError
from protocol.transport.client import RobotClient


def test_a_fault_comes_in_its_interaction_and_goes_by_itself() -> None:
    options = ("--fault", "daq.stuck_wait@2i+0.3w", "--fault", "servos.dead=1@9i")
    with simulator(*options) as robot, RobotClient(robot.uri) as client:
        client.acquire()
        flat = {joint.name: 0.0 for joint in client.capabilities.joints}
        assert client.perform(flat).settled
        with pytest.raises(RobotError, match="WAIT") as down:
            client.perform(flat)
        assert down.value.code == "fault"
        deadline = time.monotonic() + 120
        while client.status().state == "fault":  # which ends by the clock on the wall
            assert time.monotonic() < deadline
            with suppress(RobotError):
                client.clear()
        assert client.perform(flat).sequence == 2


@pytest.mark.parametrize("fault", ["daq.stuk_wait", "daq", "servo_board.brown_out+1s"])
def test_a_fault_that_cannot_be_is_refused_before_anything_starts(fault: str) -> None:
    command = [sys.executable, "-m", "sim_robot", "--fault", fault]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 2
    assert "argument --fault" in done.stderr
