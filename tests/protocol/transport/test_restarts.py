"""Daemons and programs that restart, go away, or were never there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from protocol.errors import RobotError, RobotRestartedError, RobotUnreachableError
from protocol.transport.client import RobotClient
from tests.protocol.background import in_background, links

if TYPE_CHECKING:
    from tests.protocol.conftest import FakeRobot, Serve

TARGETS = {"a": 0.1, "b": -0.1}


def test_a_restarted_daemon_is_noticed_and_the_motion_is_not_repeated(
    serve: Serve, slow_robot: FakeRobot, robot: FakeRobot
) -> None:
    first = serve(slow_robot)
    with RobotClient(first.endpoint, timeout=3.0) as client:
        client.acquire()
        session = client.session
        motion = in_background(lambda: client.perform(TARGETS))
        assert slow_robot.begun.acquire(timeout=120)
        first.close()
        second = serve(robot, bind=first.endpoint, telemetry_bind="tcp://127.0.0.1:*")
        with pytest.raises(RobotRestartedError, match="whether perform"):
            motion.result(timeout=120)
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


def test_a_program_that_kept_no_ids_gets_no_old_outcome(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    for start in range(2):
        with RobotClient(server.endpoint, client_id="legs-lab") as client:
            assert client.next_id == 1 + 3 * start  # acquire, perform and release
            client.acquire()
            client.perform({"a": 0.1 * start, "b": 0.0})
    assert [motion.targets["a"] for motion in robot.motions] == [0.0, 0.1]


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
        assert slow_robot.begun.acquire(timeout=120)
        server.close()
        with pytest.raises(RobotUnreachableError, match=r"perform \(request 2\)"):
            motion.result(timeout=120)


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
