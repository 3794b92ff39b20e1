"""A robot by hand, from a terminal."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest

from bench.daemons import simulator
from protocol.__main__ import main
from protocol.transport.client import RobotClient


def test_stop_latches_until_clear(capsys: pytest.CaptureFixture[str]) -> None:
    with simulator() as robot:
        states = []
        for command in ("status", "stop", "hold", "clear", "relax", "hold"):
            code = main([robot.uri, command])
            seen = capsys.readouterr()
            states.append((command, code, seen.out.split(":")[0].strip()))
            if command == "stop" or code:  # whoever finds it frozen is told how to go on
                assert f"python -m protocol {robot.uri} clear" in seen.out + seen.err
            else:
                assert "clear" not in seen.out
    assert states == [
        ("status", 0, "idle"),
        ("stop", 0, "stopped"),
        ("hold", 1, ""),
        ("clear", 0, "holding"),
        ("relax", 0, "relaxed"),
        ("hold", 0, "holding"),
    ]


def test_a_stop_that_is_not_confirmed_is_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    sick = ("--sick", "servos.verify=hang")  # which is asked for every 3 s
    with simulator(*sick, module="bench.still_robotd") as daemon:
        uri = daemon.uri
        with RobotClient(uri) as client:
            while client.status().state != "fault":
                time.sleep(0.02)
        assert main([uri, "stop"]) == 1
        said = capsys.readouterr().err
        assert "does not turn: the driver of the SV203 does not return from verify" in said
        assert "Cut the servos' power if anything moves" in said
        assert main([uri, "status"]) == 0
        assert "does not turn" in capsys.readouterr().out


def test_nobody_there_is_a_sentence(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("protocol.__main__.TIMEOUT", 0.5)
    assert main(["tcp://127.0.0.1:9", "status"]) == 1
    assert "127.0.0.1:9" in capsys.readouterr().err


def test_watch_shows_what_changes_until_it_is_interrupted() -> None:
    with simulator() as robot:
        watch = subprocess.Popen(
            [sys.executable, "-m", "protocol", robot.uri, "watch"],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert watch.stdout is not None
        try:
            assert watch.stdout.readline() == "idle\n"
            pose = watch.stdout.readline()
            assert "hip_left -" in pose
            assert "controlled by nobody" in pose
            assert main([robot.uri, "stop"]) == 0
            assert watch.stdout.readline() == "stopped: A client sent stop.\n"
            assert f"python -m protocol {robot.uri} clear" in watch.stdout.readline()
            watch.send_signal(signal.SIGINT)
            assert watch.wait(120) == 0
        finally:
            watch.kill()
            watch.wait()
            watch.stdout.close()
