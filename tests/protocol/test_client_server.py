"""Clients and a server over real sockets, a robot without a body behind them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, TypeVar

import pytest

from protocol.client import RobotClient
from protocol.errors import RobotError, RobotRestartedError, RobotUnreachableError
from protocol.messages import Observation, Progress
from protocol.server import Server
from protocol.telemetry import TelemetrySubscriber

if TYPE_CHECKING:
    from tests.protocol.conftest import FakeRobot, HandClock, Serve

T = TypeVar("T")
TARGETS = {"a": 0.1, "b": -0.1}


def in_background(function: Callable[[], T]) -> Future[T]:
    pool = ThreadPoolExecutor(1)
    try:
        return pool.submit(function)
    finally:
        pool.shutdown(wait=False)


def test_a_whole_session(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    progress: list[Progress] = []
    with RobotClient(server.endpoint, software="test 1", on_progress=progress.append) as client:
        assert client.capabilities.robot == "fake"
        assert client.telemetry_endpoint == server.telemetry_endpoint
        assert client.status().controller is None
        client.acquire()
        assert client.status().controller == client.client_id
        performed = client.perform(TARGETS)
        assert performed.tilt == (0.1, -0.1)
        assert performed.touch == (True, False, True, False)
        assert progress == [Progress(id=performed.id, phase="moving", fraction=0.5, robot_time=1.0)]
        assert client.read().sequence == performed.sequence + 1
        assert client.hold().state == "holding"
        assert client.relax().state == "holding"
        client.release()
        assert client.status().controller is None
    assert [dict(motion.targets) for motion in robot.motions] == [TARGETS]
    assert robot.controllers == [client.client_id, None]


def test_leaving_gives_control_back(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    with RobotClient(server.endpoint) as client:
        client.acquire()
    with RobotClient(server.endpoint) as other:
        assert other.acquire().state == "idle"
    client.close()  # again: harmless
    with pytest.raises(RobotUnreachableError, match="closed"):
        client.read()


def test_two_controllers(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    with (
        RobotClient(server.endpoint, software="first 1") as first,
        RobotClient(server.endpoint) as second,
    ):
        first.acquire()
        with pytest.raises(RobotError, match=r"first 1 \(client .*\) holds the robot") as caught:
            second.acquire()
        assert caught.value.code == "held"
        with pytest.raises(RobotError) as caught:
            second.perform(TARGETS)
        assert caught.value.code == "not_controller"
        first.perform(TARGETS)
    assert len(robot.motions) == 1


def test_stop_from_anyone_ends_a_motion_and_latches(serve: Serve, slow_robot: FakeRobot) -> None:
    server = serve(slow_robot)
    with RobotClient(server.endpoint) as client, RobotClient(server.endpoint) as bystander:
        client.acquire()
        motion = in_background(lambda: client.perform(TARGETS))
        assert slow_robot.begun.acquire(timeout=5)
        assert bystander.stop().state == "stopped"
        with pytest.raises(RobotError) as caught:
            motion.result(timeout=5)
        assert caught.value.code == "aborted_stop"
        with pytest.raises(RobotError) as caught:
            client.perform(TARGETS)
        assert caught.value.code == "stopped"
        with pytest.raises(RobotError) as caught:
            bystander.clear()
        assert caught.value.code == "not_controller"
        assert client.clear().state == "holding"


def test_stop_and_hold_from_another_thread_of_the_same_client(
    serve: Serve, slow_robot: FakeRobot
) -> None:
    server = serve(slow_robot)
    with RobotClient(server.endpoint) as client:
        client.acquire()
        for end, code in ((client.hold, "aborted_hold"), (client.stop, "aborted_stop")):
            motion = in_background(lambda: client.perform(TARGETS))
            assert slow_robot.begun.acquire(timeout=5)
            end()
            with pytest.raises(RobotError) as caught:
                motion.result(timeout=5)
            assert caught.value.code == code


def test_letting_go_in_mid_motion_holds(serve: Serve, slow_robot: FakeRobot) -> None:
    server = serve(slow_robot)
    with RobotClient(server.endpoint) as client:
        client.acquire()
        motion = in_background(lambda: client.perform(TARGETS))
        assert slow_robot.begun.acquire(timeout=5)
        client.release()
        with pytest.raises(RobotError) as caught:
            motion.result(timeout=5)
        assert caught.value.code == "aborted_silent"


def test_ctrl_c_ends_the_wait_and_closing_holds_the_robot(
    serve: Serve, slow_robot: FakeRobot
) -> None:
    server = serve(slow_robot)
    main = threading.get_ident()

    def interrupt() -> None:
        assert slow_robot.begun.acquire(timeout=5)
        signal.pthread_kill(main, signal.SIGINT)

    client = RobotClient(server.endpoint)
    client.acquire()
    pressed = in_background(interrupt)
    with pytest.raises(KeyboardInterrupt), client:
        client.perform(TARGETS)
    pressed.result()
    assert slow_robot.silences == 1
    assert slow_robot.controllers[-1] is None


def test_an_exception_in_on_progress_comes_out(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)

    def refuse(progress: Progress) -> None:
        raise ZeroDivisionError(progress.phase)

    with RobotClient(server.endpoint) as client:
        client.acquire()
        with pytest.raises(ZeroDivisionError, match="moving"):
            client.perform(TARGETS, on_progress=refuse)
        assert client.read().sequence > 1


def test_a_motion_that_outlasts_its_limit(serve: Serve, slow_robot: FakeRobot) -> None:
    server = serve(slow_robot)
    with RobotClient(server.endpoint) as client:
        client.acquire()
        with pytest.raises(RobotUnreachableError, match=r"within 0\.2 s; it may still go on"):
            client.perform(TARGETS, timeout=0.2)


def test_the_robot_holds_when_the_controller_falls_silent_and_says_so(
    serve: Serve, slow_robot: FakeRobot, hand_clock: HandClock
) -> None:
    server = serve(slow_robot, clock=hand_clock)
    with RobotClient(server.endpoint) as client:
        client.acquire()
        motion = in_background(lambda: client.perform(TARGETS))
        assert slow_robot.begun.acquire(timeout=5)
        hand_clock.now += 5.0
        server.wake()
        with pytest.raises(RobotError) as caught:
            motion.result(timeout=5)
        assert caught.value.code == "aborted_silent"
        assert caught.value.retryable
        assert client.hold().state == "holding"  # it was heard again: control is still its own


KILLED = """
import sys
from protocol.client import RobotClient
client = RobotClient(sys.argv[1])
client.acquire()
client.perform({"a": 0.1, "b": 0.1})
"""


def test_a_controller_that_is_killed(
    serve: Serve, slow_robot: FakeRobot, hand_clock: HandClock
) -> None:
    server = serve(slow_robot, clock=hand_clock)
    with subprocess.Popen([sys.executable, "-c", KILLED, server.endpoint]) as process:
        assert slow_robot.begun.acquire(timeout=20)
        process.send_signal(signal.SIGKILL)
    hand_clock.now += 5.0
    server.wake()
    assert slow_robot.silenced.wait(5)
    with RobotClient(server.endpoint) as client:
        with pytest.raises(RobotError, match="holds the robot"):
            client.acquire()
        hand_clock.now += 25.0
        server.wake()
        assert slow_robot.freed.wait(5)
        client.acquire()


# --- restarts -------------------------------------------------------------------------------------


def test_a_restarted_daemon_is_noticed_and_the_motion_is_not_repeated(
    serve: Serve, slow_robot: FakeRobot, robot: FakeRobot
) -> None:
    first = serve(slow_robot)
    with RobotClient(first.endpoint, timeout=3.0) as client:
        client.acquire()
        session = client.session
        motion = in_background(lambda: client.perform(TARGETS))
        assert slow_robot.begun.acquire(timeout=5)
        first.close()
        second = serve(robot, bind=first.endpoint, telemetry_bind="tcp://127.0.0.1:*")
        with pytest.raises(RobotRestartedError, match="whether perform"):
            motion.result(timeout=10)
        with pytest.raises(RobotRestartedError, match="nothing was sent"):
            client.perform(TARGETS)
        assert robot.motions == []
        assert second.garbage == 0

        client.hello()
        assert client.restarted
        assert client.session != session
        with pytest.raises(RobotRestartedError, match="not repeated"):
            client.perform(TARGETS, request_id=2)
        with pytest.raises(RobotError, match="not control"):
            client.perform(TARGETS)
        client.acquire()
        client.perform(TARGETS)
        assert len(robot.motions) == 1


def test_a_restarted_program_gets_the_first_outcome(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    client = RobotClient(server.endpoint)
    client.acquire()
    number = client.reserve_id()
    first = client.perform(TARGETS, request_id=number)
    client.close()
    with RobotClient(
        server.endpoint,
        client_id=client.client_id,
        next_id=client.next_id,
        resume_session=client.session,
    ) as again:
        assert not again.restarted
        assert again.perform(TARGETS, request_id=number) == first
        with pytest.raises(RobotError) as caught:
            again.perform({"a": 0.2, "b": 0.2}, request_id=number)
        assert caught.value.code == "id_reused"
        again.acquire()
        assert again.perform(TARGETS).sequence > first.sequence
    assert [motion.id for motion in robot.motions] == [number, again.next_id - 2]


def test_a_program_that_resumes_a_forgotten_session(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    with RobotClient(server.endpoint, next_id=8, resume_session="of yesterday") as client:
        assert client.restarted
        client.acquire()
        with pytest.raises(RobotRestartedError, match=r"Request 7 .* not repeated"):
            client.perform(TARGETS, request_id=7)
        client.perform(TARGETS)
    assert [motion.id for motion in robot.motions] == [9]


def test_a_daemon_that_goes_away_for_good(serve: Serve, slow_robot: FakeRobot) -> None:
    server = serve(slow_robot)
    with RobotClient(server.endpoint, timeout=0.6) as client:
        client.acquire()
        motion = in_background(lambda: client.perform(TARGETS))
        assert slow_robot.begun.acquire(timeout=5)
        server.close()
        with pytest.raises(RobotUnreachableError, match=r"perform \(request 2\)"):
            motion.result(timeout=10)


def test_a_stop_for_a_daemon_that_is_gone_does_not_reach_the_next(
    serve: Serve, slow_robot: FakeRobot, robot: FakeRobot
) -> None:
    first = serve(slow_robot)
    with RobotClient(first.endpoint, timeout=0.6) as client:
        first.close()
        with pytest.raises(RobotUnreachableError):
            client.stop()
        serve(robot, bind=first.endpoint, telemetry_bind="tcp://127.0.0.1:*")
        assert client.hello().session == client.session
        assert client.restarted
        assert client.status().state == "idle"


def test_nothing_listens_there() -> None:
    with pytest.raises(RobotUnreachableError, match=r"tcp://127\.0\.0\.1:1\b.* no robot daemon"):
        RobotClient("tcp://127.0.0.1:1", timeout=0.3)
    assert links() == 0


# --- concurrency and cost -------------------------------------------------------------------------


def test_many_threads_share_a_client(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    with RobotClient(server.endpoint) as client, ThreadPoolExecutor(8) as pool:

        def work(number: int) -> list[Any]:
            return [client.read() if number % 2 else client.status() for _ in range(20)]

        found = [item for items in pool.map(work, range(8)) for item in items]
    assert len({item.id for item in found}) == 160
    sequences = [item.sequence for item in found if isinstance(item, Observation)]
    assert sorted(sequences) == list(range(1, 81))


def test_closing_while_another_thread_waits(serve: Serve, slow_robot: FakeRobot) -> None:
    server = serve(slow_robot)
    client = RobotClient(server.endpoint)
    reader = RobotClient(server.endpoint)
    client.acquire()
    motion = in_background(lambda: client.perform(TARGETS))
    assert slow_robot.begun.acquire(timeout=5)
    client.close()
    with pytest.raises((RobotError, RobotUnreachableError)):
        motion.result(timeout=5)
    reader.close()


def links() -> int:
    return sum(thread.name.startswith("link to") for thread in threading.enumerate())


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
    assert len(os.listdir("/proc/self/fd")) <= files + 2  # the server may close one a little later


def test_fifty_viewers_cost_little(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot, telemetry_rate=10.0)
    viewers = [TelemetrySubscriber(server.telemetry_endpoint) for _ in range(50)]
    try:
        with RobotClient(server.endpoint) as client:
            for viewer in viewers:
                assert viewer.next(5.0).state == "idle"
            waits = []
            for _ in range(200):
                begun = time.perf_counter()
                client.status()
                waits.append(time.perf_counter() - begun)
            assert sorted(waits)[100] < 0.005
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
        found = in_background(hello_then_signal)
        server.run()
        assert found.result(timeout=5)
    finally:
        signal.signal(signal.SIGUSR1, before)
        server.close()
