"""The doctor names what keeps a robot from being identified, or finds nothing."""

from __future__ import annotations

import logging
import re
import socket
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from bench.still_robot import still_robot
from estimator.cli import doctor
from estimator.cli.command_line import app
from estimator.cli.doctor import examine
from estimator.cli.findings import ExaminedItem, Fitness
from protocol.errors import EndpointError, KeysError, RobotError
from protocol.rules.robot_interface import Robot
from protocol.security.keys import KeyDirectory
from protocol.transport.client import RobotClient
from protocol.wire.messages import ObservationReply, Read, RobotRequest
from robot.host.clock import Clock, WallClock
from tests.protocol.conformance.spoilt import Fault, SpoiltServer
from tests.protocol.conftest import FakeRobot, Keyring
from tests.protocol.transport.faults import FAULTS
from tests.robot.stepped import SteppedClock


@contextmanager
def serving(robot: Robot, fault: Fault | None = None, **options: Any) -> Iterator[str]:
    options = {"bind": "tcp://127.0.0.1:*", "telemetry_rate": 20.0} | options
    server = SpoiltServer(robot, fault or Fault(), **options)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield server.endpoint
    finally:
        server.close()
        thread.join()


@contextmanager
def daemon(clock: Clock, **options: Any) -> Iterator[str]:
    with still_robot(clock, housekeeping=None, log=logging.getLogger("still")) as robot:
        robot.controller.start()
        with serving(robot.controller, **options) as uri:
            yield uri
        assert robot.controller.shut_down()


@pytest.fixture
def keyring(tmp_path: Path) -> Keyring:
    return Keyring(tmp_path)


def bad(uri: str, keys: Path | None = None) -> list[tuple[str, str]]:
    return [
        (finding.subject, finding.sentence)
        for finding in examine(uri, keys)
        if finding.verdict is Fitness.BAD
    ]


def the_trouble(uri: str, keys: Path | None = None) -> tuple[str, str]:
    (trouble,) = bad(uri, keys)
    return trouble


class SoundRobot(FakeRobot):
    """Its readings are of the moment."""

    def observe(self, request_id: int) -> ObservationReply:
        return replace(super().observe(request_id), monotonic=time.monotonic())


@pytest.fixture(autouse=True)
def busy(monkeypatch: pytest.MonkeyPatch) -> None:
    """A computer that runs many tests holds up answers, and the doctor would say so."""
    for name in ("HEARTBEAT", "SLOW", "_JITTER"):
        monkeypatch.setattr(doctor, name, 60.0)


def remarkable(findings: Iterable[ExaminedItem]) -> list[ExaminedItem]:
    return [finding for finding in findings if finding.verdict is not Fitness.FINE]


# --- all is well ----------------------------------------------------------------------------------


def test_a_robot_in_real_time() -> None:
    with daemon(WallClock()) as uri:
        findings = list(examine(uri))
        with RobotClient(uri) as client:
            assert client.status().state == "idle"  # nothing moved
            assert client.status().controller is None
    assert remarkable(findings) == []
    assert [finding.subject for finding in findings] == [
        "reachability", "keys", "version", "robot", "latency", "control", "state", "freshness",
        "clock", "telemetry",
    ]  # fmt: skip
    (clock,) = (finding.sentence for finding in findings if finding.subject == "clock")
    assert re.fullmatch(r"Clocks agree to \d+\.\d ms\.", clock)


def test_a_robot_in_virtual_time_with_keys(keyring: Keyring) -> None:
    ann = keyring.client("ann", "controller")
    with daemon(SteppedClock(), keys=keyring.robot) as uri:
        findings = {finding.subject: finding for finding in examine(uri, ann)}
    assert remarkable(findings.values()) == []
    assert "virtual" in findings["clock"].sentence
    assert findings["keys"].sentence == "The robot knows this key, as a controller's."


# --- nobody answers -------------------------------------------------------------------------------


def test_nothing_listens() -> None:
    subject, sentence = the_trouble("tcp://127.0.0.1:1")
    assert subject == "reachability"
    assert sentence == "Nothing listens at tcp://127.0.0.1:1: no robot daemon runs."


def test_something_else_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as stranger:

        def refuse() -> None:
            stream, _ = stranger.accept()
            with stream:
                stream.recv(100)
                stream.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")

        thread = threading.Thread(target=refuse)
        thread.start()
        port = stranger.getsockname()[1]
        assert the_trouble(f"tcp://127.0.0.1:{port}")[1].endswith("it speaks no ZeroMQ.")
        thread.join()
        # Now it lets the kernel accept connections, and says nothing.
        assert "says nothing" in the_trouble(f"tcp://127.0.0.1:{port}")[1]


def test_an_unknown_host() -> None:
    subject, sentence = the_trouble("tcp://no-such-host.invalid:5750")
    assert subject == "reachability"
    assert "cannot be reached" in sentence


@pytest.mark.parametrize("uri", ["replay:somewhere", "file:readings.csv", "5750"])
def test_what_is_no_daemon(uri: str) -> None:
    with pytest.raises(EndpointError, match="is no address"):
        list(examine(uri))


# --- keys -----------------------------------------------------------------------------------------


def test_keys_that_do_not_fit(keyring: Keyring, tmp_path: Path) -> None:
    ann, eve = keyring.client("ann", "controller"), keyring.stranger("eve")
    other = KeyDirectory(tmp_path / "other")
    other.create("other")
    with serving(SoundRobot(), keys=keyring.robot) as uri:
        assert the_trouble(uri)[0] == "keys"
        assert "asks for a key" in the_trouble(uri)[1]
        assert "does not know this key" in the_trouble(uri, eve)[1]
        with pytest.raises(KeysError, match="knows no robot"):
            list(examine(uri, other.path))
    with serving(SoundRobot(), keys=other.path) as uri:
        assert "another robot" in the_trouble(uri, ann)[1]
    with serving(SoundRobot()) as uri:
        assert "does without keys" in the_trouble(uri, ann)[1]


def test_a_viewers_key(keyring: Keyring) -> None:
    bob = keyring.client("bob", "viewer")
    with serving(SoundRobot(), keys=keyring.robot) as uri:
        subject, sentence = the_trouble(uri, bob)
    assert subject == "keys"
    assert sentence.startswith("bob is a viewer here and may not release. To identify the robot,")


# --- it answers, but ------------------------------------------------------------------------------


def test_another_version(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("protocol.rules.server_core.PROTOCOL_VERSION", 2)
    with serving(SoundRobot()) as uri:
        subject, sentence = the_trouble(uri)
    assert subject == "version"
    assert sentence == "Version 2 is spoken here, not [1]. Install a matching client."


def test_held_by_another() -> None:
    with serving(SoundRobot()) as uri, RobotClient(uri, client_id="eve") as other:
        other.acquire()
        assert the_trouble(uri) == (
            "control",
            "Client eve holds the robot: wait until it releases, or ask its owner.",
        )
        assert other.status().controller == "eve"


def test_stopped() -> None:
    with serving(SoundRobot()) as uri, RobotClient(uri) as other:
        other.stop()
        subject, sentence = the_trouble(uri)
        assert other.status().state == "stopped"
    assert subject == "state"
    advice = f"Make sure that it is safe, then: python -m protocol {uri} clear"
    assert sentence == f"The robot is stopped. {advice}"


def test_another_software_is_worth_a_note() -> None:
    with serving(SoundRobot()) as uri:
        notes = [item for item in examine(uri) if item.verdict is Fitness.NOTE]
    assert [note.subject for note in notes] == ["version"]
    assert notes[0].sentence.startswith("The robot runs fake 1, this is bodyschema ")


class StaleRobot(SoundRobot):
    def submit(self, ticket: int, request: RobotRequest) -> None:
        if isinstance(request, Read):
            raise RobotError("stale", "The distance sensor has no fresh value.")
        super().submit(ticket, request)


class RepeatingRobot(SoundRobot):
    def observe(self, request_id: int) -> ObservationReply:
        return replace(super().observe(request_id), sequence=7)


class FrozenRobot(SoundRobot):
    def observe(self, request_id: int) -> ObservationReply:
        return replace(super().observe(request_id), monotonic=1.0)


class HastyRobot(SoundRobot):
    def observe(self, request_id: int) -> ObservationReply:
        reply = super().observe(request_id)
        return replace(reply, monotonic=reply.monotonic * 1e6)


@pytest.mark.parametrize(
    ("robot", "subject", "sentence"),
    [
        (StaleRobot, "freshness", "It cannot be read: The distance sensor has no fresh value."),
        (RepeatingRobot, "freshness", "It cannot be read: read .* answered with observation 7"),
        (FrozenRobot, "freshness", "A second reading is not younger than the first"),
        (HastyRobot, "clock", "one of the clocks is wrong"),
    ],
)
def test_readings_that_are_not_to_be_trusted(
    robot: type[FakeRobot], subject: str, sentence: str
) -> None:
    with serving(robot()) as uri:
        trouble = the_trouble(uri)
    assert trouble[0] == subject
    assert re.search(sentence, trouble[1])


def test_telemetry_that_does_not_arrive(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_PATIENCE", 0.5)
    with serving(SoundRobot(), FAULTS["publishes at another address"][1]) as uri:
        subject, sentence = the_trouble(uri)
    assert subject == "telemetry"
    assert sentence.startswith("Nothing is heard at tcp://127.0.0.1:1, although")


def test_a_slow_network(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "ROUND_TRIPS", 3)
    monkeypatch.setattr(doctor, "HEARTBEAT", 0.0)
    with serving(SoundRobot()) as uri:
        subject, sentence = the_trouble(uri)
    assert subject == "latency"
    assert "mend the network" in sentence


# --- the command ----------------------------------------------------------------------------------


def test_the_command() -> None:
    runner = CliRunner()
    with serving(SoundRobot()) as uri:
        done = runner.invoke(app, ["doctor", "--robot", uri])
        assert done.exit_code == 0, done.output
        assert "fine  reachability" in done.output
        assert "note  version" in done.output
    done = runner.invoke(app, ["doctor", "--robot", uri])
    assert done.exit_code == 1
    assert "bad   reachability Nothing listens at" in done.output
    done = runner.invoke(app, ["doctor", "--robot", "replay:x"])
    assert done.exit_code == 1
    assert runner.invoke(app, ["doctor"]).exit_code == 2
