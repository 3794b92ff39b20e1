"""What peers do that no ZeroMQ of good faith would, with real sockets; the crowds are elsewhere."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING

import pytest
import zmq

from bench.attackers import GREETING, MORE, RawPeer, frame, guessed_identities
from bench.daemons import simulator
from protocol.security.keys import KeyDirectory
from protocol.sockets.tcp_connection import FrameCounter
from protocol.sockets.zmq_sockets import Endpoint
from protocol.transport.client import RobotClient
from protocol.transport.telemetry import MAX_SUBSCRIBED, TelemetrySubscriber
from protocol.wire.codec import MAX_FRAME, MAX_MESSAGE, decode, encode
from tests.waiting import until

if TYPE_CHECKING:
    from tests.protocol.conftest import FakeRobot, Keyring, Serve

HELLO = encode({"type": "hello", "id": 1, "client": "c", "versions": [1]})
STOP = encode({"type": "stop", "id": 1, "client": "c"})
EMPTY_MAPS = b"\x81\xa1a" + b"\xdc\x00\x40" + 64 * (b"\xdc\x03\xf8" + b"\x80" * 1016)


@pytest.fixture
def peers() -> Iterator[Callable[..., RawPeer]]:
    with ExitStack() as stack:

        def connect(endpoint: str, kind: bytes = b"DEALER", identity: bytes = b"") -> RawPeer:
            peer = RawPeer(endpoint, kind, identity)
            stack.callback(peer.close)
            return peer

        yield connect


def answered(peer: RawPeer) -> bool:
    peer.send(HELLO)
    return bool(decode(peer.receive())["type"] == "welcome")


def is_cut(peer: RawPeer) -> bool:
    """Whether the robot hangs up; else this times out."""
    with suppress(ConnectionError):
        while True:
            peer.receive()
    return True


def flood(peer: RawPeer, body: bytes, flags: int, most: int) -> None:
    """Sends a frame again and again, until the robot hangs up."""
    piece = max(1, min(1000, 100_000 // (len(body) + 2)))
    with suppress(ConnectionError):
        for _ in range(0, most, piece):
            peer.socket.sendall(piece * frame(body, flags))


# --- identities -----------------------------------------------------------------------------------


@pytest.mark.parametrize("identity", [b"somebody", b"\0\0\0\0\1"])
def test_an_identity_that_others_claim_is_still_served(
    serve: Serve, robot: FakeRobot, peers: Callable[..., RawPeer], identity: bytes
) -> None:
    server = serve(robot)
    first, second, third = (peers(server.endpoint, identity=identity) for _ in range(3))
    assert answered(third)
    assert answered(first)
    assert answered(second)


def test_claiming_the_identities_of_others_ends_no_daemon() -> None:
    with simulator(module="bench.still_robotd") as robot, ExitStack() as stack:
        for identity in guessed_identities(sockets=12, connections=3):
            stack.callback(RawPeer(robot.uri, identity=identity).close)
        for _ in range(3):  # ZeroMQ names these
            nameless = RawPeer(robot.uri)
            stack.callback(nameless.close)
            assert answered(nameless)
        assert robot.terminate()[0] == 0


# --- memory ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("part", "most"), [(bytes(MAX_FRAME), 300), (b"", 100_000)], ids=["large", "empty"]
)
def test_a_message_without_end_is_cut_off(
    serve: Serve, robot: FakeRobot, peers: Callable[..., RawPeer], part: bytes, most: int
) -> None:
    server = serve(robot)
    with RobotClient(server.endpoint) as client:
        peer = peers(server.endpoint)
        flood(peer, part, MORE, most)
        assert is_cut(peer)
        assert client.stop().state == "stopped"
    assert server.garbage == 0  # it never became a message


def test_a_message_without_end_from_a_known_key_is_cut_off(
    serve: Serve, robot: FakeRobot, keyring: Keyring
) -> None:
    known = KeyDirectory(keyring.client("bob", "viewer")).client_keys()
    server = serve(robot, keys=keyring.robot)
    with zmq.Context() as context, context.socket(zmq.DEALER) as dealer:
        dealer.setsockopt(zmq.LINGER, 0)
        dealer.setsockopt(zmq.CURVE_SERVERKEY, known.robot.encode())
        dealer.setsockopt(zmq.CURVE_PUBLICKEY, known.own.public.encode())
        dealer.setsockopt(zmq.CURVE_SECRETKEY, known.own.secret.encode())
        watch = dealer.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        dealer.connect(server.endpoint)
        dealer.send_multipart([bytes(100_000)] * 30)
        assert watch.poll(5000)
        dealer.disable_monitor()
        watch.close()
    assert server.garbage == 0


def test_a_whole_message_of_many_parts_is_only_malformed(
    serve: Serve, robot: FakeRobot, peers: Callable[..., RawPeer]
) -> None:
    server = serve(robot)
    peer = peers(server.endpoint)
    for _ in range(3):  # each is within the bound, all together are not
        for _ in range(9):
            peer.send(bytes(60_000), MORE)
        peer.send(b"")
        assert decode(peer.receive())["message"] == "A message is one frame, not 10."
    assert answered(peer)


def test_many_unfinished_messages_share_one_bound(
    serve: Serve,
    robot: FakeRobot,
    peers: Callable[..., RawPeer],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("protocol.sockets.tcp_listener.TOTAL", 4 * MAX_MESSAGE // 2)
    server = serve(robot)
    crowd = [peers(server.endpoint) for _ in range(5)]
    for peer in crowd:
        with suppress(ConnectionError):
            peer.send(bytes(MAX_MESSAGE // 2), MORE)
    assert until(lambda: len(server._listener) == 3)  # a little is added to each half megabyte
    assert answered(peers(server.endpoint))


def test_subscriptions_are_bounded(
    serve: Serve, robot: FakeRobot, peers: Callable[..., RawPeer]
) -> None:
    server = serve(robot, telemetry_rate=20.0)
    with TelemetrySubscriber(server.telemetry_endpoint) as listener:
        for topic in (b"\1x", b"\1" + bytes(200), b"\1telemetry", b"\0x"):
            peer = peers(server.telemetry_endpoint, b"SUB")
            flood(peer, topic, 0, 10 * MAX_SUBSCRIBED)
            assert is_cut(peer)
            assert listener.next(5.0).state == "idle"


# --- time -----------------------------------------------------------------------------------------


def test_a_hundred_costly_frames_do_not_keep_a_stop_waiting(
    serve: Serve, robot: FakeRobot, peers: Callable[..., RawPeer]
) -> None:
    server = serve(robot)
    with RobotClient(server.endpoint) as client:
        for _ in range(3):
            peers(server.endpoint).socket.sendall(30 * frame(EMPTY_MAPS))
        begun = time.monotonic()
        assert client.stop().state == "stopped"
        assert time.monotonic() - begun < 30.0
    assert until(lambda: server.garbage == 90)


def test_the_last_words_of_a_peer_count(
    serve: Serve, robot: FakeRobot, peers: Callable[..., RawPeer]
) -> None:
    server = serve(robot)
    for _ in range(10):
        peer = peers(server.endpoint)
        peer.socket.sendall(20 * frame(b"\xc1") + frame(STOP))
        peer.close()
        assert until(lambda: robot.state == "stopped")
        robot.state = type(robot.state)("idle")


# --- crowds ---------------------------------------------------------------------------------------


def test_who_has_spoken_is_not_pushed_out_by_who_has_not(
    serve: Serve,
    robot: FakeRobot,
    peers: Callable[..., RawPeer],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("protocol.sockets.tcp_listener.MOST", 12)
    server = serve(robot)
    with RobotClient(server.endpoint) as client:
        client.acquire()
        for _ in range(30):
            peers(server.endpoint)
        assert answered(peers(server.endpoint))
        assert len(server._listener) <= 8
        assert client.stop().state == "stopped"


def test_one_too_many_pushes_out_one(
    serve: Serve,
    robot: FakeRobot,
    peers: Callable[..., RawPeer],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("protocol.sockets.tcp_listener.MOST", 12)
    server = serve(robot)
    crowd = [peers(server.endpoint) for _ in range(8)]
    assert all(map(answered, crowd))
    assert answered(crowd[0])  # so that the second was not heard for longest
    assert answered(peers(server.endpoint))
    assert is_cut(crowd[1])
    assert len(server._listener) == 8
    assert answered(crowd[2])


def test_who_says_much_does_not_starve_beside_many_who_ask_again_and_again(
    serve: Serve, robot: FakeRobot, peers: Callable[..., RawPeer]
) -> None:
    server = serve(robot)
    asking = [peers(server.endpoint) for _ in range(30)]
    talker = peers(server.endpoint)
    talker.socket.sendall(50 * frame(b"\xc1"))
    for peer in asking * 3:
        assert answered(peer)
    assert until(lambda: server.garbage == 50)


def test_who_is_gone_before_the_door_opens_fills_no_log(
    serve: Serve, robot: FakeRobot, caplog: pytest.LogCaptureFixture
) -> None:
    server = serve(robot)
    place = Endpoint.parse(server.endpoint)
    for _ in range(50):
        gone = socket.create_connection((place.host, place.port), timeout=120)
        gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        gone.close()  # with a reset
    with RobotClient(server.endpoint) as client:
        assert client.stop().state == "stopped"
    assert len(caplog.records) < 10


# --- framing --------------------------------------------------------------------------------------


def test_frames_are_counted_however_they_are_cut() -> None:
    bodies = [b"", b"x", bytes(255), bytes(256), bytes(70_000), b"", b"y"]
    stream = GREETING + b"".join(frame(body, MORE) for body in bodies)
    for size in (1, 2, 3, 9, 10, 64, 65, 1000, len(stream)):
        counter = FrameCounter()
        pieces = [stream[at : at + size] for at in range(0, len(stream), size)]
        assert sum(map(counter.count, pieces)) == len(bodies)


@pytest.mark.parametrize(
    "greeting",
    [
        b"GET / HTTP/1.1\r\n",
        b"\x01\x00",
        b"\xff" * 20,
        b"\xff" + bytes(8) + b"\x7f\x01\x05\x00\x00",
    ],
    ids=["http", "zmtp 1", "noise", "zmtp 2"],
)
def test_other_protocols_are_not_counted_but_refused(greeting: bytes) -> None:
    with pytest.raises(ValueError, match="ZMTP"):
        FrameCounter().count(greeting)
