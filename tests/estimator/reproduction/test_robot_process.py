"""Real ``sim-robotd`` processes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from estimator.errors import EstimatorError, InteractionError
from estimator.reproduction import robot_process
from estimator.reproduction.robot_process import RobotProcess
from protocol.errors import RobotUnreachableError
from protocol.transport.client import RobotClient

KEEPER = """
import sys
from estimator.reproduction.robot_process import RobotProcess
with RobotProcess(1) as robot:
    print(robot.uri, flush=True)
    sys.stdin.read()
"""


def test_it_serves_until_it_is_closed() -> None:
    with RobotProcess(1) as robot, RobotClient(robot.uri) as client:
        assert len(client.capabilities.joints) == 8
    with pytest.raises(RobotUnreachableError):
        RobotClient(robot.uri, timeout=0.3)


def test_it_ends_with_whoever_started_it() -> None:
    keeper = subprocess.Popen(
        [sys.executable, "-c", KEEPER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert keeper.stdout is not None
    assert keeper.stdout.readline().startswith("tcp://")
    (robot,) = psutil.Process(keeper.pid).children()
    keeper.kill()
    keeper.communicate()
    robot.wait(timeout=120)
    assert not robot.is_running()


def test_ctrl_c_in_the_terminal_is_not_for_it() -> None:
    with RobotProcess(1) as robot:
        (process,) = [
            child
            for child in psutil.Process().children()
            if child.status() != psutil.STATUS_ZOMBIE and "sim-robotd" in str(child.cmdline())
        ]
        assert os.getpgid(process.pid) != os.getpgid(0)
        with RobotClient(robot.uri) as client:
            client.status()


def test_a_robot_that_does_not_start_is_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = tmp_path / "sim-robotd"
    broken.write_text("#!/bin/sh\necho no servo board >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    with pytest.raises(InteractionError, match="ended at once: no servo board"):
        RobotProcess(1)
    with pytest.raises(EstimatorError, match="failed: no servo board"):
        robot_process.print_body()


def test_a_missing_simulator_is_a_sentence(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(EstimatorError, match="not installed"):
        RobotProcess(1)


def test_sigterm_is_what_it_gets(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """It parks and cleans up, which SIGKILL would prevent."""
    witness = tmp_path / "sim-robotd"
    witness.write_text(
        "#!/bin/sh\n"
        f"trap 'echo parked > {tmp_path}/ended; exit 0' TERM\n"
        "echo 'serving robot on tcp://127.0.0.1:1, telemetry on tcp://127.0.0.1:2' >&2\n"
        "while :; do sleep 0.05; done\n"
    )
    witness.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    with RobotProcess(1) as robot:
        assert robot.uri == "tcp://127.0.0.1:1"
    assert (tmp_path / "ended").read_text() == "parked\n"
