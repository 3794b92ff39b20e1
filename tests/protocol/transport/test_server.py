"""A server among strangers: addresses, garbage, lost frames, bugs of the robot."""

from __future__ import annotations

import logging
import random
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

import pytest
import zmq

from protocol.errors import EndpointError, RobotError, RobotUnreachableError
from protocol.rules.robot_interface import Finished, Progressed
from protocol.sockets.zmq_sockets import Endpoint
from protocol.transport.client import RobotClient
from protocol.transport.server import LogLimiter, Server
from protocol.transport.telemetry import TOPIC, TelemetrySubscriber
from protocol.wire.codec import MAX_FRAME, MAX_MESSAGE, decode, encode
from protocol.wire.messages import Ok

if TYPE_CHECKING:
    from tests.protocol.conftest import FakeRobot, HandClock, Serve

TARGETS = {"a": 0.1, "b": -0.1}
TIMEOUT = 5000  # ms


@contextmanager
def raw(kind: int, endpoint: str) -> Iterator[zmq.Socket[bytes]]:
    """A socket of the test's own, connected."""
    context = zmq.Context()
    made: zmq.Socket[bytes] = context.socket(kind)
    made.setsockopt(zmq.RCVTIMEO, TIMEOUT)
    made.connect(endpoint)
    try:
        yield made
    finally:
        context.destroy(linger=0)


def still_serves(server: Server) -> bool:
    with RobotClient(server.endpoint, timeout=120.0) as client:
        return client.status().state == "idle"


# --- garbage --------------------------------------------------------------------------------------


def test_garbage_is_answered_counted_and_survived(
    serve: Serve, robot: FakeRobot, caplog: pytest.LogCaptureFixture
) -> None:
    server = serve(robot)
    noise = random.Random(1)
    frames = [noise.randbytes(noise.randrange(200)) for _ in range(300)]
    with raw(zmq.DEALER, server.endpoint) as client:
        for number, frame in enumerate(frames, start=1):
            client.send(frame)
            assert decode(client.recv())["type"] == "error"
            assert server.garbage == number
    assert still_serves(server)
    warnings = [record for record in caplog.records if record.levelno == logging.WARNING]
    assert len(warnings) == 9  # at 1, 2, 4 … 256


def test_oversized_frames(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    with raw(zmq.DEALER, server.endpoint) as client:
        for size in (MAX_FRAME + 1, MAX_MESSAGE):
            client.send(b"x" * size)
            assert decode(client.recv())["code"] == "too_large"
        watch = client.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        client.send(b"x" * (MAX_MESSAGE + 1))
        assert watch.poll(TIMEOUT)  # closed, unanswered
        assert not client.poll(50)
        client.disable_monitor()
        watch.close()
    assert still_serves(server)


def test_messages_of_several_parts(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    hello = encode({"type": "hello", "id": 1, "client": "c", "versions": [1]})
    with raw(zmq.DEALER, server.endpoint) as client:
        client.send_multipart([hello, hello])
        assert "not 2" in decode(client.recv())["message"]
    with raw(zmq.REQ, server.endpoint) as client:  # puts an empty part before its frame
        client.send(hello)
        while server.garbage < 2:  # the test's time limit ends it
            assert not client.poll(50)
        assert server.garbage == 2
    assert still_serves(server)


def test_what_has_arrived_when_it_ends_is_answered(robot: FakeRobot) -> None:
    with (
        Server(robot, bind="tcp://127.0.0.1:*") as server,
        raw(zmq.DEALER, server.endpoint) as client,
    ):
        client.send(encode({"type": "hello", "id": 1, "client": "c", "versions": [1]}))
        while not server._listener.waiting:
            assert server._wait(TIMEOUT / 1000)
        server.request_stop()
        server.run()
        assert decode(client.recv())["type"] == "welcome"


def test_what_is_no_zeromq_at_all(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    port = Endpoint.parse(server.endpoint).port
    for greeting in (b"GET / HTTP/1.1\r\n\r\n", b"\xff" * 500, b""):
        with socket.create_connection(("127.0.0.1", port), timeout=120) as stranger:
            stranger.sendall(greeting)
    assert still_serves(server)


def test_a_flood_does_not_keep_a_stop_waiting(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    done = threading.Event()

    def flood() -> None:
        with raw(zmq.DEALER, server.endpoint) as client:
            client.setsockopt(zmq.SNDTIMEO, 100)
            while not done.is_set():
                try:
                    client.send(b"\xc1")
                except zmq.Again:
                    continue

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        with RobotClient(server.endpoint, timeout=120.0) as client:
            assert client.stop().state == "stopped"
    finally:
        done.set()
        thread.join()


def test_replayed_and_reordered_frames_move_nothing_twice(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    recorded: list[bytes] = []
    replies: list[dict[str, Any]] = []
    with raw(zmq.DEALER, server.endpoint) as client:

        def ask(message: dict[str, Any]) -> dict[str, Any]:
            recorded.append(encode(message))
            client.send(recorded[-1])
            while (reply := decode(client.recv()))["type"] in ("accepted", "progress"):
                pass
            return reply

        session = ask({"type": "hello", "id": 0, "client": "c", "versions": [1]})["session"]
        common = {"client": "c", "session": session}
        ask({"type": "acquire", "id": 1, **common})
        for number in (2, 3):
            ask({"type": "perform", "id": number, **common, "targets": TARGETS})
        assert len(robot.motions) == 2
    with raw(zmq.DEALER, server.endpoint) as thief:
        for frame in [*reversed(recorded), *recorded]:
            thief.send(frame)
            replies.append(decode(thief.recv()))
    assert len(robot.motions) == 2
    assert [reply["sequence"] for reply in replies if "sequence" in reply] == [2, 1, 1, 2]


# --- lost frames ----------------------------------------------------------------------------------


class LossyWire:
    """Passes frames on between one client and a server, but for those to be lost."""

    def __init__(self, target: str, *, lose: set[str]):
        self._lose = lose
        self._context = zmq.Context()
        self._front: zmq.Socket[bytes] = self._context.socket(zmq.ROUTER)
        self._back: zmq.Socket[bytes] = self._context.socket(zmq.DEALER)
        self.endpoint = f"tcp://127.0.0.1:{self._front.bind_to_random_port('tcp://127.0.0.1')}"
        self._back.connect(target)
        self._done = threading.Event()
        self.lost: list[str] = []
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        peer = b""
        poller = zmq.Poller()
        poller.register(self._front, zmq.POLLIN)
        poller.register(self._back, zmq.POLLIN)
        while not self._done.is_set():
            for ready, _ in poller.poll(20):
                if ready is self._front:
                    peer, frame = self._front.recv_multipart()
                    if not self._loses(frame):
                        self._back.send(frame)
                else:
                    frame = self._back.recv()
                    if not self._loses(frame):
                        self._front.send_multipart([peer, frame])

    def _loses(self, frame: bytes) -> bool:
        kind = decode(frame)["type"]
        if kind not in self._lose:
            return False
        self._lose.remove(kind)
        self.lost.append(kind)
        return True

    def close(self) -> None:
        self._done.set()
        self._thread.join()
        self._context.destroy(linger=0)


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as closing:
        yield closing


def test_each_kind_of_frame_may_be_lost_once(
    serve: Serve, robot: FakeRobot, stack: ExitStack
) -> None:
    kinds = {"hello", "welcome", "acquire", "ok", "perform", "accepted", "observation", "release"}
    server = serve(robot)
    wire = LossyWire(server.endpoint, lose=set(kinds))
    stack.callback(wire.close)
    with RobotClient(wire.endpoint, timeout=3.0) as client:  # repeats twice, after a third each
        client.acquire()
        assert client.perform(TARGETS).sequence == 1
        client.release()
    assert set(wire.lost) == kinds
    assert len(robot.motions) == 1


# --- addresses ------------------------------------------------------------------------------------


def test_an_address_in_use_is_refused_in_a_sentence(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    sentence = r"Cannot serve at .*in use.*another address\."
    with pytest.raises(EndpointError, match=sentence):
        Server(robot, bind=server.endpoint)
    with pytest.raises(EndpointError, match=sentence):
        Server(robot, bind="tcp://127.0.0.1:*", telemetry_bind=server.endpoint)


@pytest.mark.parametrize("bind", ["tcp://*:0", "tcp://0.0.0.0:0", "tcp://192.0.2.1:0"])
def test_an_open_address_needs_to_be_wanted(robot: FakeRobot, bind: str) -> None:
    with pytest.raises(EndpointError, match=r"without keys .* --insecure"):
        Server(robot, bind=bind)
    with pytest.raises(EndpointError, match="--insecure"):
        Server(robot, bind="tcp://127.0.0.1:*", telemetry_bind=bind)


def test_a_wildcard_address(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot, bind="tcp://*:0", insecure=True)
    port = Endpoint.parse(server.endpoint).port
    with RobotClient(f"tcp://127.0.0.1:{port}") as client:
        published = Endpoint.parse(server.telemetry_endpoint).port
        assert client.telemetry_endpoint == f"tcp://127.0.0.1:{published}"
        with TelemetrySubscriber(client.telemetry_endpoint) as subscriber:
            assert subscriber.next(5.0).robot == "fake"


def has_ipv6() -> bool:
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        return False
    return True


@pytest.mark.parametrize("bind", ["tcp://localhost:0", "tcp://[::1]:0"])
def test_other_names_of_this_computer(serve: Serve, robot: FakeRobot, bind: str) -> None:
    if "::1" in bind and not has_ipv6():
        pytest.skip("this computer has no IPv6")
    assert still_serves(serve(robot, bind=bind))


# --- the robot ------------------------------------------------------------------------------------


def test_a_bug_of_the_robot_is_answered_and_logged(
    serve: Serve, robot: FakeRobot, caplog: pytest.LogCaptureFixture
) -> None:
    server = serve(robot)
    with RobotClient(server.endpoint) as client:
        robot.broken = True
        with pytest.raises(RobotError, match="The daemon failed on read; see its log") as caught:
            client.read()
        assert caught.value.code == "fault"
        robot.broken = False
        assert client.read().sequence == 1
    assert "a bug" in caplog.text


def test_news_of_a_request_that_is_not_under_way_ends_nothing(
    serve: Serve, robot: FakeRobot, caplog: pytest.LogCaptureFixture
) -> None:
    server = serve(robot)
    with RobotClient(server.endpoint) as client:
        robot.emit(Finished(ticket=99, reply=Ok(id=1, state="idle")))
        robot.emit(Progressed(ticket=99, phase="moving", fraction=0.5, robot_time=1.0))
        assert client.read().sequence == 1
    assert caplog.text.count("is not under way") == 2


def test_run_after_close_returns_at_once(robot: FakeRobot) -> None:
    server = Server(robot, bind="tcp://127.0.0.1:*")
    server.close()
    server.close()
    server.run()
    server.wake()


# --- telemetry ------------------------------------------------------------------------------------


def test_telemetry_tells_of_state_and_controller(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot, telemetry_rate=50.0)
    with (
        TelemetrySubscriber(server.telemetry_endpoint) as subscriber,
        RobotClient(server.endpoint) as client,
    ):
        assert subscriber.next(5.0).controller is None
        client.acquire()
        client.stop()
        telemetry = subscriber.next(5.0)
        while telemetry.state != "stopped":
            telemetry = subscriber.next(5.0)
        assert telemetry.controller == client.client_id
        assert telemetry.angles == {"a": 0.0, "b": 0.0}


def test_telemetry_keeps_its_rate(serve: Serve, robot: FakeRobot, hand_clock: HandClock) -> None:
    server = serve(robot, clock=hand_clock, telemetry_rate=2.0)
    with TelemetrySubscriber(server.telemetry_endpoint) as subscriber:
        first = None
        while first is None:  # until the subscription has arrived
            hand_clock.now += 0.5
            server.wake()
            try:
                first = subscriber.next(0.05)
            except RobotUnreachableError:
                continue
        for _ in range(20):
            server.wake()
        with pytest.raises(RobotUnreachableError, match=r"for 0\.05 s"):
            subscriber.next(0.05)
        hand_clock.now += 0.5
        server.wake()
        assert subscriber.next(5.0).robot == "fake"


def test_a_subscriber_skips_garbage_and_returns_the_newest(stack: ExitStack) -> None:
    context = stack.enter_context(zmq.Context())
    publisher: zmq.Socket[bytes] = stack.enter_context(context.socket(zmq.XPUB))
    port = publisher.bind_to_random_port("tcp://127.0.0.1")
    subscriber = stack.enter_context(TelemetrySubscriber(f"tcp://127.0.0.1:{port}"))
    assert publisher.poll(TIMEOUT)
    publisher.recv()  # the subscription

    def publish(sequence: int) -> bytes:
        message = {"type": "telemetry", "robot": "r", "state": "idle", "robot_time": 0.0}
        return encode({**message, "sequence": sequence, "angles": {}})

    for frame in (b"\xc1", publish(1), publish(2), b""):
        publisher.send_multipart([TOPIC, frame])
    newest = subscriber.next(5.0)
    while newest.sequence != 2:
        newest = subscriber.next(5.0)
    while subscriber.garbage < 2:
        with pytest.raises(RobotUnreachableError):
            subscriber.next(0.01)


def test_one_in_a_period_is_let_through_with_the_number_kept_back() -> None:
    limiter = LogLimiter()
    assert limiter.count("held", 0) == 0
    assert [limiter.count("held", second) for second in (1, 2, 59.9)] == [None] * 3
    assert limiter.count("busy", 2) == 0  # another kind
    assert limiter.count("held", 60) == 3
    assert limiter.count("held", 119) is None
    assert limiter.count("held", 500) == 1
