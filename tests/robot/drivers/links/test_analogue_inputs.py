"""The inputs of one board: what is shared in one scan, and what cannot be believed."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from robot.drivers.links.analogue_inputs import STUCK_AFTER, AnalogueInputs
from robot.errors import DeviceDataError
from tests.robot.clocks import InstantClock

CODE = 10 / 65536


@dataclass
class Board:
    """Gives what a test says for its channels 2 to 4, and counts."""

    volts: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    scans: int = 0

    def probe(self) -> None:
        """It is there."""

    def close(self) -> None:
        """There is no link."""

    def scan(self, low: int, high: int) -> list[float]:
        assert (low, high) == (2, 4)
        self.scans += 1
        return list(self.volts)


def inputs(board: Board, clock: InstantClock | None = None) -> AnalogueInputs:
    connected = AnalogueInputs(
        board, name="DMM-32", rails=(-5.0, 5.0), clock=clock or InstantClock()
    )
    connected.connect({2: "the x axis"})
    connected.connect({4: "the gauge"})
    return connected


def test_sensors_that_are_read_together_share_a_scan_and_later_ones_do_not() -> None:
    board, clock = Board(), InstantClock()
    connected = inputs(board, clock)
    assert connected.scan() == {2: 0.0, 4: 0.0}
    assert connected.same_moment()[4] == 0.0
    assert board.scans == 1
    clock.sleep(1e-3)
    board.volts = [0.0, 0.0, 1.0]
    assert connected.same_moment()[4] == 1.0
    clock.sleep(-1.0)
    connected.scan()
    assert board.scans == 3


def test_a_clock_that_ran_backwards_makes_no_scan_look_new() -> None:
    board, clock = Board(), InstantClock(10.0)
    connected = inputs(board, clock)
    connected.scan()
    clock.charge(-5.0)
    connected.same_moment()
    assert board.scans == 2


@pytest.mark.parametrize("volts", [-5.0, 5.0 - CODE])
@pytest.mark.parametrize("channel", [2, 4])
def test_an_input_at_an_end_of_its_range_is_no_reading(volts: float, channel: int) -> None:
    board = Board()
    board.volts[channel - 2] = volts
    connected = inputs(board)
    connected.scan()
    connected.check([2 if channel == 4 else 4])
    with pytest.raises(DeviceDataError, match=f"DMM-32 input {channel}"):
        connected.check([2, 4])


def test_an_input_next_to_the_end_is_one_and_an_unused_one_may_be_anywhere() -> None:
    connected = inputs(Board([5.0 - 2 * CODE, 5.0 - CODE, CODE - 5.0]))
    connected.scan()
    connected.check([2, 4])


def test_an_input_that_repeats_itself_is_stuck_and_one_that_dithers_is_not() -> None:
    board = Board()
    connected = inputs(board)
    for scan in range(STUCK_AFTER):
        board.volts = [1.0, 0.0, 1.0 + scan % 2 * CODE]
        connected.scan()
    connected.check([4])
    with pytest.raises(DeviceDataError, match="DMM-32 input 2, the x axis, is stuck"):
        connected.check([2])
    board.volts = [1.0 + CODE, 0.0, 1.0]
    connected.scan()
    connected.check([2, 4])
