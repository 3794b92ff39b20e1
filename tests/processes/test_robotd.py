"""``robotd run --dry`` as a process, as a service manager runs it: what it says and to whom."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import pytest

from protocol.errors import RobotError
from protocol.transport.client import RobotClient
from tests.free_ports import free_address

COMMAND = (sys.executable, "-m", "robot", "run", "--dry", "--bind")


@contextmanager
def robotd(
    bind: str, *options: str, stderr: IO[bytes], **environment: str
) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(
        [*COMMAND, bind, *options], stderr=stderr, env=os.environ | environment
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def move(uri: str) -> None:
    with RobotClient(uri, timeout=120) as client:
        client.acquire()
        client.perform({joint.name: 0.1 for joint in client.capabilities.joints})


def test_it_echoes_and_claims_to_feel_nothing(tmp_path: Path) -> None:
    uri = free_address()
    with (tmp_path / "log").open("wb") as log, robotd(uri, stderr=log):
        with RobotClient(uri, timeout=120) as client:
            assert client.capabilities.robot == "quadruped (dry run)"
            assert client.capabilities.sensors == ()
            client.acquire()
            targets = {joint.name: -0.2 for joint in client.capabilities.joints}
            seen = client.perform(targets)
        for joint in client.capabilities.joints:
            assert seen.angles[joint.name] == pytest.approx(-0.2, abs=joint.resolution / 2)
        assert (seen.touch, seen.tilt, seen.clearance, seen.settled) == (None, None, None, False)


def test_the_service_manager_and_the_journal_hear_what_happened(tmp_path: Path) -> None:
    uri, name = free_address(), f"robotd-{uuid.uuid4()}"
    with (
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager,
        (tmp_path / "log").open("w+b") as log,
    ):
        manager.bind("\0" + name)
        manager.settimeout(20)
        found = os.fstat(log.fileno())
        environment = {
            "NOTIFY_SOCKET": "@" + name,
            "WATCHDOG_USEC": "4000000",
            "JOURNAL_STREAM": f"{found.st_dev}:{found.st_ino}",
        }
        with robotd(uri, stderr=log, **environment) as process:
            heard = [manager.recv(999)]
            while not heard[-1].startswith(b"READY=1"):
                heard.append(manager.recv(999))
            with RobotClient(uri, client_id="operator") as client:
                with pytest.raises(RobotError, match="control"):
                    client.hold()
                client.acquire()
                client.stop()
                for _ in range(3):
                    with pytest.raises(RobotError):
                        client.relax()
                client.clear()
            process.send_signal(signal.SIGTERM)
            assert process.wait(120) == 0
        manager.settimeout(0.1)
        while not heard[-1].startswith(b"STOPPING=1"):
            heard.append(manager.recv(999))
        log.seek(0)
        lines = log.read().decode().splitlines()
    assert f"READY=1\nSTATUS=serving quadruped (dry run) on {uri}".encode() in heard
    assert b"WATCHDOG=1" in heard
    patterns = [
        r"<6>bodyschema \S+: robot quadruped \(dry run\), .*robot.toml \(configuration \w{12}\)",
        r"<4>dry run: no hardware is touched, and there are no sensors",
        rf"<6>serving quadruped \(dry run\) on {uri}, telemetry on tcp://127.0.0.1:\d+",
        r"<6>refused: hold of client operator: not_controller: .*",
        r"<6>control: .*client operator.* acquired it",
        rf"<4>stopped by client operator; frozen until: python -m protocol {uri} clear",
        r"<6>refused: relax of client operator: stopped: .*",  # once, not three times
        r"<6>cleared by client operator",
        r"<6>control: .*client operator.* released it",
        r"<6>SIGTERM: shutting down",
        r"<6>parked",
        r"<6>shut down",
    ]
    assert len(lines) == len(patterns), lines
    for line, pattern in zip(lines, patterns, strict=True):
        assert re.fullmatch(pattern, line), line


def test_a_full_disk_under_standard_error_changes_nothing() -> None:
    uri = free_address()
    with Path("/dev/full").open("wb") as full, robotd(uri, stderr=full) as process:
        move(uri)
        process.send_signal(signal.SIGTERM)
        assert process.wait(120) == 0


def test_a_terminal_that_is_closed_is_a_reason_to_park(tmp_path: Path) -> None:
    uri = free_address()
    with (tmp_path / "log").open("wb") as log, robotd(uri, stderr=log) as process:
        move(uri)
        process.send_signal(signal.SIGHUP)
        assert process.wait(120) == 0
    said = (tmp_path / "log").read_text()
    assert re.search("SIGHUP: shutting down\n.*parked\n.*shut down", said), said


def test_a_log_that_nobody_reads_changes_nothing() -> None:
    uri = free_address()
    reading, writing = os.pipe()
    try:
        os.set_blocking(writing, False)
        while True:  # fill it
            try:
                os.write(writing, b"x" * 4096)
            except BlockingIOError:
                break
        os.set_blocking(writing, True)
        with open(writing, "wb", closefd=False) as pipe, robotd(uri, stderr=pipe) as process:
            move(uri)
            process.send_signal(signal.SIGTERM)
            assert process.wait(120) == 0
    finally:
        os.close(reading)
        os.close(writing)


def test_without_a_configuration_it_must_be_a_dry_run() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "robot", "run"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "--config" in done.stderr
    assert "--dry" in done.stderr
