"""``robotd try`` on still electronics: what keys do to joints, and what the sensors show."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import pytest

from bench.still_robot import StillRobot, still_robot
from robot.drivers.buses import Buses
from robot.drivers.sensors.analogue import AnalogueGauge
from robot.drivers.sensors.vl6180x import VL6180X
from robot.drivers.servos.sv203 import SV203, SV203Settings
from robot.errors import DeviceMissingError
from robot.trial.session import QUIT, Trial
from sim_robot.electronics.sv203 import SV203Emulator
from tests.robot.clocks import InstantClock
from tests.robot.trial.person import Answer, Person


class BoardClock(InstantClock):
    """Lets time pass only when the board has read what was written to it."""

    def __init__(self) -> None:
        super().__init__()
        self.wait: Callable[[], bool] = lambda: True

    def sleep(self, seconds: float) -> None:
        assert self.wait()
        super().sleep(seconds)


@dataclass(frozen=True, kw_only=True)
class FollowedServos(SV203Settings):
    """Servos whose board the clock waits for."""

    board: SV203Emulator
    clock: BoardClock

    def open(self, buses: Buses) -> SV203:
        driver, before = super().open(buses), self.board.bytes_read
        self.clock.wait = lambda: self.board.wait_until_read(before + driver.bytes_written, 5.0)
        return driver


class Desk:
    """A robot whose devices nobody has open, and somebody who tries it."""

    def __init__(self, robot: StillRobot, clock: BoardClock):
        self.robot = robot
        self.clock = clock
        self.moves: list[tuple[float, int, int, int]] = []
        robot.devices.close()
        assert isinstance(robot.config.servos, SV203Settings)
        servos = FollowedServos(**vars(robot.config.servos), board=robot.servo_board, clock=clock)
        self.config = replace(robot.config, servos=servos)
        robot.servo_board.watch_moves(lambda *move: self.moves.append((clock.now(), *move)))

    def tried(self, *script: Answer) -> Person:
        person = Person(self.clock, script)
        Trial(self.config, self.robot.buses, person).run()
        return person

    def release(self, output: int) -> None:
        servos = self.config.servos.open(self.robot.buses)
        servos.release([output])
        self.clock.sleep(0.0)
        servos.close()

    def degrees(self, index: int = 0) -> float:
        joint = self.robot.config.joints[index]
        return math.degrees(joint.scale.angle(self.robot.servo_board.pulses()[joint.output - 1]))


@pytest.fixture
def desk() -> Iterator[Desk]:
    clock = BoardClock()
    with still_robot(clock, housekeeping=None, log=logging.getLogger("test")) as robot:
        yield Desk(robot, clock)


def test_every_sensor_is_shown_in_physical_units(desk: Desk) -> None:
    seen = desk.tried().seen[-1]
    for words in ("z +1.00", "nose up", "N, free", "0.0 mm below the belly", "> hip_left"):
        assert words in seen
    assert not desk.moves


def test_a_robot_without_sensors_shows_its_joints(desk: Desk) -> None:
    desk.config = replace(desk.config, daq=None, accelerometer=None, touch=(), distance=None)
    seen = desk.tried("0", 2.0, "right", 1.0).seen[-1]
    assert "> hip_left" in seen
    assert desk.degrees() == pytest.approx(1.0, abs=0.7)


def test_a_joint_moves_by_a_degree_and_the_others_stay(desk: Desk) -> None:
    others = desk.robot.servo_board.pulses()[1:]
    desk.tried("0", 2.0, *["right"] * 5, 1.0, "left", 1.0)
    assert desk.degrees() == pytest.approx(4.0, abs=1.7)  # 0.68° a count
    assert desk.robot.servo_board.pulses()[1:] == others
    desk.tried("down", "0", 2.0, "page down", 1.0)
    assert desk.degrees(1) == pytest.approx(-10.0, abs=0.7)


def test_it_never_leaves_its_limits_nor_exceeds_its_speed(desk: Desk) -> None:
    desk.tried("0", 2.0)
    del desk.moves[:]
    script: list[Answer] = ["page up", 1.0]
    desk.tried(*script * 12)
    joint = desk.robot.config.joints[0]
    assert desk.degrees() == pytest.approx(math.degrees(joint.reachable[1]))
    assert len(desk.moves) > 10
    for (time, _, _, _), (later, _, before, after) in zip(desk.moves, desk.moves[1:], strict=False):
        way = abs(joint.scale.angle(after) - joint.scale.angle(before))
        assert way <= desk.robot.config.speed * (later - time) + 1e-6


def test_keys_in_quick_succession_are_no_faster(desk: Desk) -> None:
    desk.tried("0", 2.0)
    start, begun = desk.degrees(), desk.clock.now()
    desk.tried(*["page up"] * 40)
    limit = math.degrees(desk.robot.config.speed)
    assert desk.degrees() - start <= limit * (desk.clock.now() - begun)


@pytest.mark.parametrize("end", ["space", QUIT, "down"])
def test_a_motion_ends_where_it_is(desk: Desk, end: str) -> None:
    desk.tried("0", 2.0)
    person = desk.tried("page up", "page up", "page up", "page up", 0.05, end)
    stopped = len(desk.moves)
    assert 0.5 < desk.degrees() < 9
    desk.clock.sleep(5.0)
    assert len(desk.moves) == stopped
    assert end != "space" or "Stopped: it holds." in person.seen[-1]


def test_a_limp_joint_is_driven_only_when_asked_twice(desk: Desk) -> None:
    desk.release(1)
    assert desk.robot.servo_board.pulses()[0] == 0
    person = desk.tried("right", "0", "h", "right")
    assert desk.robot.servo_board.pulses()[0] == 0
    assert "hip_left is limp: h, and h again" in person.seen[-1]
    desk.tried("h", "h", 0.5)
    assert desk.degrees() == pytest.approx(0.0, abs=0.4)


def test_a_reset_is_said_and_nothing_moves_until_somebody_looks(desk: Desk) -> None:
    person = desk.tried(
        "page up", 1.0, lambda: desk.robot.servo_board.inject("brown_out"), 3.0, "page up", 1.0
    )
    assert "it was reset" in "\n".join(person.seen)
    assert "The servos failed: r looks again." in person.seen[-1]
    assert set(desk.robot.servo_board.pulses()) == {128}
    person = desk.tried("r", "0", 2.0)
    assert desk.degrees() == pytest.approx(0.0, abs=0.4)


def test_a_cable_that_comes_back_is_opened_anew(desk: Desk) -> None:
    board = desk.robot.servo_board
    person = desk.tried("0", 2.0, board.unplug, 3.0, board.replug, "r", 0.5, "page down", 1.0)
    assert "plugged in" in "\n".join(person.seen)
    assert desk.degrees() == pytest.approx(-10.0, abs=0.7)


def test_a_sensor_that_fails_hides_no_other(desk: Desk) -> None:
    desk.robot.panel.mend()
    desk.robot.distance.inject("nak")
    person = desk.tried("right", 1.0)
    failed = [line for line in person.seen[-1].splitlines() if line.startswith("!")]
    assert len(failed) == 1
    assert "distance" in failed[0]
    assert "z +1.00" in person.seen[-1]
    desk.robot.distance.mend()
    assert "! distance" not in desk.tried("r").seen[-1]


def test_without_servos_it_says_why(desk: Desk) -> None:
    desk.robot.servo_board.unplug()
    with pytest.raises(DeviceMissingError, match="cannot be opened"):
        desk.tried()
    desk.robot.servo_board.replug()


def test_a_joint_that_is_not_where_it_was_read_does_not_leap(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = SV203.read_counts
    answers = [dict.fromkeys(range(1, 9), 12)]  # a digit was lost on the line
    monkeypatch.setattr(
        SV203,
        "read_counts",
        lambda servos, outputs: answers.pop() if answers else read(servos, outputs),
    )
    person = desk.tried("right", 1.0)
    assert "does not have the command for hip_left" in person.seen[-1]
    assert not desk.moves


def test_a_driver_that_would_end_the_program_is_a_sentence(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    def leave(*_: object) -> None:
        raise SystemExit(0)

    def break_everything() -> None:
        monkeypatch.setattr(VL6180X, "distance", leave)
        monkeypatch.setattr(AnalogueGauge, "load", lambda _: math.nan)
        monkeypatch.setattr(SV203, "set_counts", leave)

    seen = desk.tried(break_everything, 0.5, "right", 0.5).seen[-1]
    assert "! distance" in seen
    assert "VL6180X failed in distance: SystemExit: 0" in seen
    assert "gave nan for a reading, which is no finite number" in seen
    assert "! The driver of the SV203 failed in set_counts: SystemExit: 0" in seen
