from __future__ import annotations

from typing import cast

import pytest

from robot.drivers.servos.sv203 import SV203
from sim_robot.electronics.clock import Follower
from sim_robot.electronics.sv203 import SV203Emulator


class Wires:
    """Counts what a driver has written and its board has read; the board reads in its own time."""

    def __init__(self) -> None:
        self.bytes_written = 0
        self.bytes_read = 0
        self.awaited: list[int] = []

    def wait_until_read(self, count: int, timeout: float) -> None:
        assert timeout > 0
        self.awaited.append(count)


@pytest.fixture
def wires() -> Wires:
    return Wires()


@pytest.fixture
def follower(wires: Wires) -> Follower:
    return Follower(cast(SV203Emulator, wires), cast(SV203, wires))


def test_all_that_was_written_is_waited_for(wires: Wires, follower: Follower) -> None:
    for written in (3, 10):
        wires.bytes_written = wires.bytes_read = written
        follower()
    assert wires.awaited == [3, 10]


def test_bytes_that_never_come_are_waited_for_once(wires: Wires, follower: Follower) -> None:
    wires.bytes_written, wires.bytes_read = 10, 4
    follower()
    wires.bytes_written, wires.bytes_read = 15, 9
    follower()
    assert wires.awaited == [10, 9]


def test_after_bytes_that_were_late_all_are_waited_for_again(
    wires: Wires, follower: Follower
) -> None:
    wires.bytes_written, wires.bytes_read = 10, 4
    follower()
    wires.bytes_written, wires.bytes_read = 15, 15  # the six have come after all
    follower()
    wires.bytes_written = 21
    follower()
    assert wires.awaited[-1] == 21
