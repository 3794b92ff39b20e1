"""24 joints on three servo boards of one serial line: one update of all takes 0.27 s."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator

import pytest

from bench.still_robot import still_robot
from protocol.wire.messages import ErrorReply, ObservationReply, Ok, Stop
from sim_robot.electronics.serial_device import Follower
from tests.robot.stepped import Bench, SteppedClock, program, request

BOARDS = (1, 2, 5)
LINE = 0.035  # s for a line of two counts, and the question before it


class FollowingClock(SteppedClock):
    """Lets time pass only when the boards have read what was written to them."""

    def __init__(self) -> None:
        super().__init__()
        self.follow: Callable[[], None] = lambda: None

    def sleep(self, seconds: float) -> None:
        self.follow()
        super().sleep(seconds)


@pytest.fixture
def bench() -> Iterator[Bench]:
    clock = FollowingClock()
    with still_robot(
        clock, housekeeping=None, log=logging.getLogger("test"), boards=BOARDS
    ) as robot:
        clock.follow = Follower(robot.servo_board, robot.servos)
        stepped = Bench(robot, clock)
        robot.controller.set_notify(stepped.notify)
        robot.controller.start()
        yield stepped
        clock.free()
        assert robot.controller.shut_down()


def all_joints(bench: Bench, degrees: float) -> dict[str, float]:
    return {joint.name: degrees for joint in bench.robot.config.joints}


def test_all_of_them_arrive_and_none_runs_ahead(bench: Bench) -> None:
    config = bench.robot.config
    scales = {joint.output: joint.scale for joint in config.joints}
    sent: dict[int, float] = {}  # when, by output
    ahead: list[float] = []

    def on_move(output: int, before: int, after: int) -> None:
        now = bench.clock.now()
        way = abs(scales[output].angle(after) - scales[output].angle(before))
        if output in sent:
            ahead.append(way - config.speed * (now - sent[output]))
        sent[output] = now

    bench.perform(**all_joints(bench, 0.0))
    bench.robot.servo_board.watch_moves(on_move)
    observation = bench.perform(**all_joints(bench, 40.0))
    for joint in config.joints:
        assert observation.angles[joint.name] == pytest.approx(
            math.radians(40.0), abs=joint.scale.resolution
        )
        assert bench.pulses()[joint.output - 1] == joint.quantise(math.radians(40.0))
    assert len(sent) == 24
    assert max(ahead) < config.speed * LINE  # the clock is read before a line, not after it


def test_a_stop_cuts_in_between_lines(bench: Bench) -> None:
    assert isinstance(bench.perform(**all_joints(bench, 0.0)), ObservationReply)
    bench.clock.freeze()
    motion = bench.submit(program(bench.robot, **all_joints(bench, 60.0)))
    bench.clock.advance_to(bench.clock.now() + 1.6)  # the middle of an update, at some 20°
    assert bench.state() == "moving"
    before, begun = bench.pulses(), bench.clock.now()
    stop = bench.submit(request(Stop))
    bench.clock.free()
    assert isinstance(bench.end_of(stop), Ok)
    ended = bench.end_of(motion)
    assert isinstance(ended, ErrorReply)
    assert ended.code == "aborted_stop"
    assert bench.clock.now() - begun < 2 * LINE
    assert sum(a != b for a, b in zip(before, bench.pulses(), strict=True)) <= 2


def test_a_reset_of_one_board_is_noticed_and_its_servos_stay(bench: Bench) -> None:
    assert isinstance(bench.perform(**all_joints(bench, 30.0)), ObservationReply)
    bench.robot.servo_board.inject("brown_out", 2)
    neutral = bench.pulses()[8:16]
    ended = bench.end_of(bench.submit(program(bench.robot, **all_joints(bench, 20.0))))
    assert isinstance(ended, ErrorReply)
    assert "board 2" in ended.message
    assert bench.pulses()[8:16] == neutral
