"""Recorded bytes, crowds and garbage, with real sockets."""

from __future__ import annotations

import logging
import os
import re
import secrets
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING

import pytest
import zmq

from protocol.security.keys import KeyDirectory
from protocol.sockets.zmq_sockets import Endpoint
from protocol.transport.client import RobotClient
from protocol.wire.codec import encode
from tests.protocol.transport.tap import Tap
from tests.waiting import until

if TYPE_CHECKING:
    from tests.protocol.conftest import FakeRobot, Keyring, Serve

TARGETS = {"a": 0.1, "b": -0.1}


# --- replays --------------------------------------------------------------------------------------


@pytest.fixture
def tapped() -> Iterator[Callable[[str], Tap]]:
    with ExitStack() as stack:

        def tap(target: str) -> Tap:
            made = Tap(target)
            stack.callback(made.close)
            return made

        yield tap


def replay(endpoint: str, record: list[bytes]) -> bytes:
    """Sends recorded pieces again, as slowly as they came; all that the other side says to that."""
    place = Endpoint.parse(endpoint)
    answer = b""
    with (
        suppress(ConnectionError),
        socket.create_connection((place.host, place.port), timeout=0.5) as thief,
    ):
        for piece in record:
            thief.sendall(piece)
            with suppress(TimeoutError):
                answer += thief.recv(65_536)
        with suppress(TimeoutError):
            while more := thief.recv(65_536):
                answer += more
    return answer


def test_recorded_bytes_tell_nothing_and_do_nothing_on_a_new_connection(
    serve: Serve, robot: FakeRobot, keyring: Keyring, tapped: Callable[[str], Tap]
) -> None:
    server = serve(robot, keys=keyring.robot)
    tap = tapped(server.endpoint)
    with RobotClient(tap.endpoint, keys=keyring.client("ann", "controller")) as client:
        client.acquire()
        client.perform(TARGETS)
        client.stop()
        client.clear()
        session = client.session
    (record,) = tap.recorded
    for secret in (b"perform", b"stop", session.encode(), client.client_id.encode()):
        assert secret not in b"".join(record)
    answer = replay(server.endpoint, record)
    assert b"WELCOME" in answer  # the handshake began as it had done
    assert b"READY" not in answer  # and did not succeed
    assert robot.state == "holding"  # a stop that was taken would have stopped it
    assert len(robot.motions) == 1
    assert server.garbage == 0


def test_recorded_bytes_do_nothing_on_the_same_connection(
    serve: Serve, robot: FakeRobot, keyring: Keyring, tapped: Callable[[str], Tap]
) -> None:
    server = serve(robot, keys=keyring.robot)
    tap = tapped(server.endpoint)
    with RobotClient(tap.endpoint, keys=keyring.client("ann", "controller")) as client:
        client.acquire()
        before = len(tap.recorded[0])
        client.stop()
        stop = b"".join(tap.recorded[0][before:])
        client.clear()
        tap.inject(stop)
        assert until(lambda: len(tap.recorded) == 2)  # the robot hung up, the client came back
        assert client.status().state == "holding"


def test_without_keys_a_recorded_stop_stops_again(
    serve: Serve, robot: FakeRobot, tapped: Callable[[str], Tap]
) -> None:
    """What keys are for: the other tests of replays could fail."""
    server = serve(robot)
    tap = tapped(server.endpoint)
    with RobotClient(tap.endpoint) as client:
        client.acquire()
        client.stop()
        client.clear()
    (record,) = tap.recorded
    assert until(lambda: b"READY" in replay(server.endpoint, record))
    assert until(lambda: robot.state == "stopped")


# --- floods ---------------------------------------------------------------------------------------


@contextmanager
def crowd(endpoint: str, size: int, opening: bytes) -> Iterator[list[socket.socket]]:
    """Connections that go no further than their first bytes."""
    place = Endpoint.parse(endpoint)
    with ExitStack() as stack:
        clients = []
        for _ in range(size):
            made = socket.create_connection((place.host, place.port), timeout=120)
            clients.append(stack.enter_context(made))
            made.sendall(opening)
        yield clients


def test_a_flood_of_connections(serve: Serve, robot: FakeRobot, keyring: Keyring) -> None:
    ann = keyring.client("ann", "controller")
    mallory = KeyDirectory(keyring.stranger("mallory")).client_keys()
    server = serve(robot, keys=keyring.robot)
    files = len(os.listdir("/proc/self/fd"))
    greeting = b"\xff" + bytes(8) + b"\x7f\x03\x00CURVE" + bytes(47)
    with RobotClient(server.endpoint, keys=ann) as client, ExitStack() as stack:
        client.acquire()
        for opening in (b"", greeting, secrets.token_bytes(500), greeting + bytes(500)):
            stack.enter_context(crowd(server.endpoint, 75, opening))
        context = stack.enter_context(zmq.Context())
        for _ in range(50):
            dealer = stack.enter_context(context.socket(zmq.DEALER))
            dealer.setsockopt(zmq.LINGER, 0)
            dealer.setsockopt(zmq.CURVE_SERVERKEY, mallory.robot.encode())
            dealer.setsockopt(zmq.CURVE_PUBLICKEY, mallory.own.public.encode())
            dealer.setsockopt(zmq.CURVE_SECRETKEY, mallory.own.secret.encode())
            dealer.connect(server.endpoint)
        assert client.perform(TARGETS).sequence == 1
        with RobotClient(server.endpoint, keys=keyring.client("bob", "viewer")) as viewer:
            assert viewer.stop().state == "stopped"
        client.clear()
    assert until(lambda: len(os.listdir("/proc/self/fd")) <= files)
    with RobotClient(server.endpoint, keys=ann) as client:
        assert client.acquire().state == "holding"


def test_half_open_connections_are_closed(
    serve: Serve, robot: FakeRobot, keyring: Keyring, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("protocol.sockets.zmq_sockets._HANDSHAKE", 200)
    server = serve(robot, keys=keyring.robot)
    greeting = b"\xff" + bytes(8) + b"\x7f\x03\x00CURVE" + bytes(47)
    for opening in (b"", greeting):
        with crowd(server.endpoint, 20, opening) as connections:
            for connection in connections:
                while connection.recv(100):  # until the robot hangs up; else this times out
                    continue


FEW_FILES = """
import resource, sys
resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))
from bench import still_robotd
sys.argv[1:] = ["--bind", "tcp://127.0.0.1:*"]
still_robotd.main()
"""


def test_more_connections_than_the_robot_has_file_descriptors() -> None:
    process = subprocess.Popen([sys.executable, "-c", FEW_FILES], stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        (endpoint,) = re.findall(r"serving .*? on (tcp://[^\s,]+)", process.stderr.readline())
        with RobotClient(endpoint) as client:
            client.acquire()
            with crowd(endpoint, 120, b""):  # the others wait in the kernel's queue
                assert client.read().sequence == 1
                assert client.stop().state == "stopped"
            client.clear()
        with RobotClient(endpoint) as client:  # the crowd is gone: others are let in again
            assert client.status().state == "holding"
    finally:
        process.terminate()
        process.communicate(timeout=120)
    assert process.returncode == 0


def test_a_flood_of_garbage_from_a_known_key(
    serve: Serve, robot: FakeRobot, keyring: Keyring, caplog: pytest.LogCaptureFixture
) -> None:
    ann, bob = keyring.client("ann", "controller"), keyring.client("bob", "viewer")
    known = KeyDirectory(bob).client_keys()
    server = serve(robot, keys=keyring.robot)
    with RobotClient(server.endpoint, keys=ann) as client, zmq.Context() as context:
        client.acquire()
        with context.socket(zmq.DEALER) as dealer:
            dealer.setsockopt(zmq.LINGER, 0)
            dealer.setsockopt(zmq.CURVE_SERVERKEY, known.robot.encode())
            dealer.setsockopt(zmq.CURVE_PUBLICKEY, known.own.public.encode())
            dealer.setsockopt(zmq.CURVE_SECRETKEY, known.own.secret.encode())
            dealer.connect(server.endpoint)
            garbage = [b"\xc1", bytes(70_000), encode({"type": "dance", "id": 1})]
            for number in range(3000):
                dealer.send(garbage[number % 3])
            begun = time.monotonic()
            assert client.stop().state == "stopped"
            assert time.monotonic() - begun < 30.0
            assert until(lambda: server.garbage == 3000)
        client.clear()
        assert client.perform(TARGETS).sequence == 1
    assert sum(record.levelno >= logging.WARNING for record in caplog.records) < 20


def test_strangers_cannot_fill_the_log(
    serve: Serve, robot: FakeRobot, keyring: Keyring, caplog: pytest.LogCaptureFixture
) -> None:
    mallory = KeyDirectory(keyring.stranger("mallory")).client_keys()
    server = serve(robot, keys=keyring.robot)
    with zmq.Context() as context, ExitStack() as stack:
        for _ in range(40):
            dealer = stack.enter_context(context.socket(zmq.DEALER))
            dealer.setsockopt(zmq.LINGER, 0)
            dealer.setsockopt(zmq.CURVE_SERVERKEY, mallory.robot.encode())
            dealer.setsockopt(zmq.CURVE_PUBLICKEY, mallory.own.public.encode())
            dealer.setsockopt(zmq.CURVE_SECRETKEY, mallory.own.secret.encode())
            dealer.connect(server.endpoint)
        assert until(lambda: "(32 so far)" in caplog.text)
    assert caplog.text.count("turned away") <= 7  # at 1, 2, 4, 8, 16, 32 and no more than 40
