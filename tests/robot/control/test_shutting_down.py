"""SIGTERM, as the control loop sees it: a motion ends, the robot parks, the rest is refused."""

from __future__ import annotations

from collections.abc import Mapping
from threading import Event, Thread
from typing import Any

import pytest

from protocol.errors import RobotError
from protocol.wire.messages import Clear, ErrorReply, Hold, Ok, Perform, Read, Relax, Stop
from tests.robot.stepped import Bench, hip, program, request


def test_shutting_down_parks_at_zero(bench: Bench) -> None:
    bench.perform(hip_left=30.0)
    assert bench.robot.controller.shut_down()
    assert hip(bench) == pytest.approx(0, abs=0.68)


def test_shutting_down_leaves_a_stopped_robot_as_it_is(bench: Bench) -> None:
    bench.perform(hip_left=30.0)
    bench.ok(Stop(id=1, client="anybody"))
    assert bench.robot.controller.shut_down()
    assert hip(bench) == pytest.approx(30, abs=0.68)


@pytest.mark.parametrize("kind", [Perform, Read, Hold, Relax, Clear])
def test_while_it_parks_everything_new_is_refused(bench: Bench, kind: type[Any]) -> None:
    bench.perform(hip_left=30.0)
    bench.clock.freeze()
    leaving = Thread(target=bench.robot.controller.shut_down, args=(20.0,))
    leaving.start()
    bench.clock.advance_to(bench.clock.now() + 0.1)
    with pytest.raises(RobotError, match="shutting down") as refused:
        bench.submit(program(bench.robot) if kind is Perform else request(kind))
    assert refused.value.code == "shutting_down"
    assert refused.value.retryable
    bench.clock.free()
    leaving.join()
    assert hip(bench) == pytest.approx(0, abs=0.68)


def test_while_it_parks_it_says_that_it_moves(bench: Bench) -> None:
    bench.perform(hip_left=30.0)
    bench.clock.freeze()
    leaving = Thread(target=bench.robot.controller.shut_down, args=(20.0,))
    leaving.start()
    bench.clock.advance_to(bench.clock.now() + 0.3)
    assert 1 < hip(bench) < 29
    assert bench.state() == "moving"
    bench.clock.free()
    leaving.join()
    assert bench.state() == "holding"


def test_a_stop_ends_the_parking_too(bench: Bench) -> None:
    bench.perform(hip_left=30.0)
    bench.clock.freeze()
    leaving = Thread(target=bench.robot.controller.shut_down, args=(20.0,))
    leaving.start()
    bench.clock.advance_to(bench.clock.now() + 0.1)
    stopping = bench.submit(Stop(id=1, client="anybody"))
    bench.clock.free()
    leaving.join()
    assert bench.end_of(stopping) == Ok(id=1, state="stopped")
    assert 5 < hip(bench) < 30  # parking would have taken 0.5 s
    assert bench.ok(Stop(id=2, client="anybody")).state == "stopped"  # answered to the very end


def test_a_robot_that_is_too_slow_to_park_stops_on_its_way(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    bench.perform(hip_left=30.0)
    drive = bench.robot.servos.set_counts

    def slowly(counts: Mapping[int, int]) -> None:
        Event().wait(0.1)
        drive(counts)

    monkeypatch.setattr(bench.robot.servos, "set_counts", slowly)
    assert bench.robot.controller.shut_down(0.05)
    assert 5 < hip(bench) < 30.68
    assert "not parked: zero is too far off" in caplog.text


def hold_until_refused(bench: Bench) -> None:
    while not Event().wait(0.001):
        bench.submit(request(Hold))


def test_what_has_not_begun_when_the_daemon_leaves_is_refused(bench: Bench) -> None:
    bench.clock.freeze()
    motion = bench.submit(program(bench.robot, hip_left=30.0))
    bench.clock.advance_to(0.1)
    bench.submit(Hold(id=1, client="test", session="s"))
    waiting = bench.submit(request(Read))
    leaving = Thread(target=bench.robot.controller.shut_down, args=(20.0,))
    leaving.start()
    with pytest.raises(RobotError, match="shutting down"):
        hold_until_refused(bench)  # the clock stands still: the motion cannot end before
    bench.clock.free()
    leaving.join()
    assert isinstance(bench.end_of(motion), ErrorReply)
    ended = bench.end_of(waiting)
    assert isinstance(ended, ErrorReply)
    assert ended.code == "shutting_down"


def test_parking_does_not_leap_after_a_reset(bench: Bench) -> None:
    bench.perform(hip_left=60.0)
    bench.robot.servo_board.power_cycle()
    neutral = bench.pulses()
    assert bench.robot.controller.shut_down()
    assert bench.state() == "fault"
    assert bench.pulses() == neutral
