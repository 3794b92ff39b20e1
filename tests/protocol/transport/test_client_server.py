"""Clients and a server over real sockets, a robot without a body behind them."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from typing import TYPE_CHECKING

import pytest

from protocol.errors import RobotError, RobotUnreachableError
from protocol.transport.client import RobotClient
from protocol.wire.messages import Progress
from tests.protocol.background import in_background

if TYPE_CHECKING:
    from tests.protocol.conftest import FakeRobot, HandClock, Serve

TARGETS = {"a": 0.1, "b": -0.1}


def test_a_whole_session(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    progress: list[Progress] = []
    with RobotClient(server.endpoint, software="test 1") as client:
        assert client.capabilities.robot == "fake"
        assert client.telemetry_endpoint == server.telemetry_endpoint
        assert client.status().controller is None
        client.acquire()
        assert client.status().controller == client.client_id
        performed = client.perform(TARGETS, on_progress=progress.append)
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
        assert slow_robot.begun.acquire(timeout=120)
        assert bystander.stop().state == "stopped"
        with pytest.raises(RobotError) as caught:
            motion.result(timeout=120)
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
            assert slow_robot.begun.acquire(timeout=120)
            end()
            with pytest.raises(RobotError) as caught:
                motion.result(timeout=120)
            assert caught.value.code == code


def test_letting_go_in_mid_motion_holds(serve: Serve, slow_robot: FakeRobot) -> None:
    server = serve(slow_robot)
    with RobotClient(server.endpoint) as client:
        client.acquire()
        motion = in_background(lambda: client.perform(TARGETS))
        assert slow_robot.begun.acquire(timeout=120)
        client.release()
        with pytest.raises(RobotError) as caught:
            motion.result(timeout=120)
        assert caught.value.code == "aborted_silent"


def test_ctrl_c_ends_the_wait_and_closing_holds_the_robot(
    serve: Serve, slow_robot: FakeRobot
) -> None:
    server = serve(slow_robot)
    main = threading.get_ident()

    def interrupt() -> None:
        assert slow_robot.begun.acquire(timeout=120)
        signal.pthread_kill(main, signal.SIGINT)

    client = RobotClient(server.endpoint)
    client.acquire()
    pressed = in_background(interrupt)
    with pytest.raises(KeyboardInterrupt), client:
        client.perform(TARGETS)
    pressed.result()
    assert slow_robot.silences == 1
    assert slow_robot.controllers[-1] is None


def test_control_that_was_asked_for_in_vain_is_given_back(serve: Serve, robot: FakeRobot) -> None:
    taken, interrupted = threading.Event(), threading.Event()
    changed = robot.controller_changed

    def hesitate(client: str | None) -> None:
        changed(client)
        taken.set()
        assert interrupted.wait(120)  # until then, nothing is answered

    robot.controller_changed = hesitate  # type: ignore[method-assign]
    server = serve(robot)
    main = threading.get_ident()

    def interrupt() -> None:
        assert taken.wait(120)
        signal.pthread_kill(main, signal.SIGINT)

    with RobotClient(server.endpoint) as client:
        pressed = in_background(interrupt)
        with pytest.raises(KeyboardInterrupt):
            client.acquire()
        pressed.result()
        interrupted.set()
    assert robot.controllers == [client.client_id, None]


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
        assert slow_robot.begun.acquire(timeout=120)
        hand_clock.now += 5.0
        server.wake()
        with pytest.raises(RobotError) as caught:
            motion.result(timeout=120)
        assert caught.value.code == "aborted_silent"
        assert caught.value.retryable
        assert client.hold().state == "holding"  # it was heard again: control is still its own


KILLED = """
import sys
from protocol.transport.client import RobotClient
client = RobotClient(sys.argv[1])
client.acquire()
client.perform({"a": 0.1, "b": 0.1})
"""


def test_a_controller_that_is_killed(
    serve: Serve, slow_robot: FakeRobot, hand_clock: HandClock
) -> None:
    server = serve(slow_robot, clock=hand_clock)
    with subprocess.Popen([sys.executable, "-c", KILLED, server.endpoint]) as process:
        assert slow_robot.begun.acquire(timeout=120)
        process.send_signal(signal.SIGKILL)
    hand_clock.now += 5.0
    server.wake()
    assert slow_robot.silenced.wait(120)
    with RobotClient(server.endpoint) as client:
        with pytest.raises(RobotError, match="holds the robot"):
            client.acquire()
        hand_clock.now += 25.0
        server.wake()
        assert slow_robot.freed.wait(120)
        client.acquire()
