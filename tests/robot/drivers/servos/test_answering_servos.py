"""Packets that nobody acknowledges get lost, on servos of every family."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from robot.drivers.buses import Buses
from robot.drivers.servos.answering_servos import AnsweringServos
from robot.drivers.servos.dynamixel import DynamixelSettings
from robot.drivers.servos.feetech import FeetechSettings
from robot.errors import DeviceDataError
from sim_robot.electronics.bus_servos import BusServos
from sim_robot.electronics.dynamixel import DynamixelEmulator
from sim_robot.electronics.feetech import FeetechEmulator
from tests.robot.clocks import InstantClock

IDS = (1, 2)
SYNC_WRITE = 0x83
FAMILIES: dict[str, tuple[Any, Any, int]] = {
    "feetech": (FeetechEmulator, FeetechSettings, 4),
    "dynamixel": (DynamixelEmulator, DynamixelSettings, 7),  # where the instruction stands
}


class Line:
    """Servos, their driver, and a line that loses what is written to several of them."""

    def __init__(self, bus: BusServos[Any], servos: AnsweringServos, at: int):
        self.bus, self.servos = bus, servos
        self.lost = 0
        self.moves: list[tuple[float, float]] = []
        receive = bus.receive

        def lose(data: bytes) -> bytes:
            if data[at] == SYNC_WRITE and self.lost:
                self.lost -= 1
                return b""
            return receive(data)

        bus.receive = lose  # type: ignore[method-assign]
        bus.watch_moves(lambda _, before, after: self.moves.append((before, after)))


@pytest.fixture(params=FAMILIES)
def line(request: pytest.FixtureRequest, clock: InstantClock) -> Iterator[Line]:
    emulator, settings, at = FAMILIES[request.param]
    bus: BusServos[Any] = emulator(IDS, baud=1_000_000)
    bus.connect(clock)
    servos = settings(port=bus.port, baud=1_000_000).open(Buses(clock=clock))
    servos.read_counts(IDS)
    yield Line(bus, servos, at)
    servos.close()
    bus.close()


def stand(line: Line) -> None:
    line.servos.set_counts(dict.fromkeys(IDS, 2048))
    assert line.servos.verify(dict.fromkeys(IDS, 2048)) == []
    line.moves.clear()


@pytest.mark.parametrize("lost", [1, 2, 4])
def test_goals_that_are_lost_are_not_made_up_for_in_one_step(line: Line, lost: int) -> None:
    stand(line)
    line.lost = lost
    for count in range(2058, 2108, 10):
        line.servos.set_counts(dict.fromkeys(IDS, count))
    assert line.servos.verify(dict.fromkeys(IDS, 2098)) == []
    assert {after - before for before, after in line.moves} == {10}
    assert line.servos.repeats >= lost


@pytest.mark.parametrize("lost", [1, 2])
def test_torque_goes_on_when_the_goal_is_there(line: Line, lost: int) -> None:
    stand(line)
    line.servos.release(IDS)
    for servo in line.bus.servos:
        servo.position = 3000.0  # by hand
    line.lost = lost
    line.servos.set_counts(dict.fromkeys(IDS, 3000))
    assert line.servos.verify(dict.fromkeys(IDS, 3000)) == []
    assert line.bus.pulses() == (3000, 3000)
    assert all(before == after for before, after in line.moves)


def move_on(servos: AnsweringServos) -> None:
    servos.set_counts(dict.fromkeys(IDS, 2058))
    servos.set_counts(dict.fromkeys(IDS, 2068))


def stiffen(servos: AnsweringServos) -> None:
    servos.release(IDS)
    servos.set_counts(dict.fromkeys(IDS, 2048))


@pytest.mark.parametrize("act", [move_on, stiffen])
def test_what_never_arrives_is_a_fault(line: Line, act: Callable[[AnsweringServos], None]) -> None:
    stand(line)
    if act is stiffen:
        line.servos.release(IDS)
    line.lost = 99
    with pytest.raises(DeviceDataError, match=r"did not (take what was sent|switch)"):
        act(line.servos)
    assert not line.moves


def test_what_was_read_before_a_question_was_repeated_is_read_again(line: Line) -> None:
    stand(line)
    receive, asked = line.bus.receive, []

    def lose(data: bytes) -> bytes:
        answer = receive(data)
        asked.append(data)
        if len(asked) > 1:
            return answer
        line.bus.servos[0].send_to(3000)  # another program, after this servo was asked
        return answer[: len(answer) // 2]  # the second one's is lost

    line.bus.receive = lose  # type: ignore[method-assign]
    with pytest.raises(DeviceDataError, match="has the goal 3000, not 2048: another program"):
        line.servos.set_counts(dict.fromkeys(IDS, 2058))
    assert not line.moves


def test_a_servo_that_is_driven_beyond_its_counts_is_not_called_limp(
    line: Line, clock: InstantClock
) -> None:
    stand(line)
    line.bus.servos[0].send_to(0)  # another program
    line.servos.forget()
    for _ in range(2):
        with pytest.raises(DeviceDataError, match=r"Servo 1 .* is driven to 0, beyond 1 to 4095"):
            line.servos.read_counts(IDS)
    line.bus.inject("reboot", 1)
    clock.sleep(1.0)
    assert line.servos.read_counts(IDS) == {1: 0, 2: 2048}
    stand(line)
