"""Many threads, many viewers, nothing to do: what a server and its clients leave and cost."""

from __future__ import annotations

import os
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import pytest

from protocol.errors import RobotError, RobotUnreachableError
from protocol.transport.client import RobotClient
from protocol.transport.server import Server
from protocol.transport.telemetry import TelemetrySubscriber
from protocol.wire.messages import ObservationReply
from tests.protocol.background import in_background, links
from tests.waiting import until

if TYPE_CHECKING:
    from tests.protocol.conftest import FakeRobot, Serve

TARGETS = {"a": 0.1, "b": -0.1}


def test_many_threads_share_a_client(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    with RobotClient(server.endpoint) as client, ThreadPoolExecutor(8) as pool:

        def work(number: int) -> list[Any]:
            return [client.read() if number % 2 else client.status() for _ in range(20)]

        replies = [item for items in pool.map(work, range(8)) for item in items]
    assert len({item.id for item in replies}) == 160
    sequences = [item.sequence for item in replies if isinstance(item, ObservationReply)]
    assert sorted(sequences) == list(range(1, 81))


def test_closing_while_another_thread_waits(serve: Serve, slow_robot: FakeRobot) -> None:
    server = serve(slow_robot)
    client = RobotClient(server.endpoint)
    reader = RobotClient(server.endpoint)
    client.acquire()
    motion = in_background(lambda: client.perform(TARGETS))
    assert slow_robot.begun.acquire(timeout=120)
    client.close()
    with pytest.raises((RobotError, RobotUnreachableError)):
        motion.result(timeout=120)
    reader.close()


def test_nothing_leaks(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    with RobotClient(server.endpoint):
        assert links() == 1
    files = len(os.listdir("/proc/self/fd"))
    for _ in range(20):
        with RobotClient(server.endpoint) as client:
            client.acquire()
        with TelemetrySubscriber(client.telemetry_endpoint):
            pass
    assert links() == 0
    assert until(lambda: len(os.listdir("/proc/self/fd")) <= files)


def test_fifty_viewers_are_served_beside_a_controller(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot, telemetry_rate=10.0)
    viewers = [TelemetrySubscriber(server.telemetry_endpoint) for _ in range(50)]
    try:
        with RobotClient(server.endpoint) as client:
            for _ in range(5):
                assert client.status().state == "idle"
                assert {viewer.next(5.0).state for viewer in viewers} == {"idle"}
    finally:
        for viewer in viewers:
            viewer.close()


def test_idle_costs_nothing(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    with RobotClient(server.endpoint):
        begun = time.process_time()
        threading.Event().wait(1.0)
        assert time.process_time() - begun < 0.05


def test_a_signal_handler_may_stop_the_server(robot: FakeRobot) -> None:
    server = Server(robot, bind="tcp://127.0.0.1:*")
    before = signal.signal(signal.SIGUSR1, lambda number, frame: server.request_stop())
    main = threading.get_ident()

    def hello_then_signal() -> str:
        with RobotClient(server.endpoint) as client:
            session = client.session
        signal.pthread_kill(main, signal.SIGUSR1)
        return session

    try:
        session = in_background(hello_then_signal)
        server.run()
        assert session.result(timeout=120)
    finally:
        signal.signal(signal.SIGUSR1, before)
        server.close()
