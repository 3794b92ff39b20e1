"""A robot with keys, as its owner and a researcher use it."""

from __future__ import annotations

import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from bench.daemons import simulator
from estimator.identification.robot_link import open_robot
from protocol.__main__ import main as protocol_main
from protocol.errors import RobotUnreachableError
from protocol.security.keys import ROBOT, KeyDirectory, KnownPeer, read_public
from protocol.sockets.zmq_sockets import Endpoint
from protocol.transport.client import RobotClient


def test_an_address_that_others_can_reach_needs_keys() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "sim_robot", "--bind", "tcp://0.0.0.0:*"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 1
    assert "without keys anybody there could move the robot: give --keys DIR" in done.stderr


def test_a_researcher_reaches_a_robot_with_keys(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot, ann = KeyDirectory(tmp_path / "robot"), KeyDirectory(tmp_path / "ann")
    _, robots_key = read_public(robot.create("crawler"))
    _, anns_key = read_public(ann.create("ann"))
    robot.add(KnownPeer(name="ann", public=anns_key, role="controller"))
    ann.add(KnownPeer(name="crawler", public=robots_key, role=ROBOT))
    with simulator("--keys", str(robot.path), bind="tcp://0.0.0.0:*") as running:
        uri = f"tcp://127.0.0.1:{Endpoint.parse(running.uri).port}"
        assert protocol_main([uri, "status"]) == 1
        assert "asks for a key" in capsys.readouterr().err
        assert protocol_main([uri, "status", "--keys", str(ann.path)]) == 0
        assert capsys.readouterr().out == "idle\n"
        link = open_robot(uri, driven=lambda _: (0,), client_id="run", first_id=1, keys=ann.path)
        with closing(link):
            assert len(link.capabilities.joints) == 8
            assert link.ticket() is not None
        robot.remove("ann")
        with pytest.raises(RobotUnreachableError, match="does not know this key"):
            RobotClient(uri, keys=ann.path, timeout=0.5)
