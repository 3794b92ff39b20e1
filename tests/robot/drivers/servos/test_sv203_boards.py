"""Several servo boards on one line: whenever one is selected, it is asked if it was reset."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import pytest
import serial

from robot.drivers.links.device_files import open_serial
from robot.drivers.servos.sv203 import SV203
from robot.errors import CommandError, DeviceDataError, DeviceTimeoutError
from sim_robot.electronics.sv203 import SV203Emulator
from tests.robot.clocks import InstantClock
from tests.robot.drivers.servos.lines import Line

POSE = {3: 90, 8: 140, 9: 20, 16: 255, 24: 60}


@pytest.fixture
def boards() -> Iterator[SV203Emulator]:
    emulator = SV203Emulator(boards=[1, 2, 7])
    yield emulator
    emulator.close()


@pytest.fixture
def servos(boards: SV203Emulator, clock: InstantClock) -> Iterator[SV203]:
    driver = SV203(
        lambda: open_serial(boards.port, 9600), boards=[1, 2, 7], clock=clock, reply_timeout=5.0
    )
    yield driver
    driver.close()


def read(servos: SV203, boards: SV203Emulator) -> tuple[int, ...]:
    assert boards.wait_until_read(servos.bytes_written, 5.0)
    return boards.pulses()


def test_each_output_is_a_servo_of_its_board(servos: SV203, boards: SV203Emulator) -> None:
    assert servos.read_counts() == dict.fromkeys(range(1, 25), 128)
    servos.set_counts(POSE)
    assert read(servos, boards) == tuple(POSE.get(n, 128) for n in range(1, 25))
    assert servos.read_counts(POSE) == POSE
    servos.release([8, 9])
    assert read(servos, boards) == tuple((POSE | {8: 0, 9: 0}).get(n, 128) for n in range(1, 25))
    servos.set_counts(POSE)
    assert servos.verify(POSE) == []
    with pytest.raises(CommandError, match="outputs 1 to 24, not 25"):
        servos.read_counts([25])


def test_a_board_is_selected_with_a_question_and_no_line_is_too_long() -> None:
    line = Line(lambda: b"128\r")
    driver = SV203(lambda: cast(serial.Serial, line), boards=[1, 255], clock=InstantClock())
    driver.read_counts([1, 9])
    line.written = b""
    driver.set_counts({1: 7, 2: 8, 3: 9, 9: 200})
    assert line.written.split(b"\r")[:-1] == [b"SV1M200", b"BD1RR51", b"SV1M7SV2M8", b"SV3M9"]
    line.written = b""
    driver.release()
    assert max(map(len, line.written.split(b"\r"))) == len("BD255SV1M0SV2M0")


@pytest.mark.parametrize("selected", [1, 9, 17])
def test_a_board_that_was_reset_gets_no_move_and_is_found_out(
    servos: SV203, boards: SV203Emulator, selected: int
) -> None:
    moves: list[tuple[int, int, int]] = []
    servos.read_counts()
    servos.set_counts(POSE)
    servos.read_counts([selected])
    read(servos, boards)
    boards.watch_moves(lambda *move: moves.append(move))
    boards.inject("brown_out", 2)
    assert read(servos, boards)[8:16] == (128,) * 8
    if selected == 9:  # what is on its way when the supply dips is ignored
        servos.set_counts(POSE | {3: 91, 9: 21, 24: 61})
    with pytest.raises(DeviceDataError, match=r"board 2.*output 16 instead of 255: it was reset"):
        servos.set_counts(POSE | {3: 92, 9: 22, 24: 62})
    read(servos, boards)
    assert {output for output, _, _ in moves} <= {3, 24}
    with pytest.raises(CommandError, match="read the servo board's counts"):
        servos.set_counts(POSE)
    assert servos.read_counts([16]) == {16: 128}


def test_the_selected_one_ignores_moves_after_a_reset(
    boards: SV203Emulator, clock: InstantClock
) -> None:
    servos = SV203(  # the last query is not answered, three times
        lambda: open_serial(boards.port, 9600), boards=[1, 2, 7], clock=clock, reply_timeout=0.5
    )
    servos.read_counts()
    servos.set_counts(POSE)
    servos.read_counts([24])
    read(servos, boards)
    boards.inject("brown_out", 7)
    servos.set_counts({24: 61})
    assert read(servos, boards)[23] == 128
    with pytest.raises(DeviceDataError, match=r"board 7.*not selected any more"):
        servos.verify({24: 61})
    servos.close()


def test_a_board_that_is_not_there_is_named(boards: SV203Emulator, clock: InstantClock) -> None:
    servos = SV203(
        lambda: open_serial(boards.port, 9600), boards=[1, 3], clock=clock, reply_timeout=0.5
    )
    assert servos.read_counts([1]) == {1: 128}
    with pytest.raises(DeviceTimeoutError, match=r"\(SV203, board 3\) did not answer RR51"):
        servos.read_counts([9])
    servos.close()


def test_an_update_takes_no_longer_than_is_said(servos: SV203, clock: InstantClock) -> None:
    servos.read_counts()
    for joints in (1, 8, 12, 18, 24):
        start = clock.now()
        servos.set_counts(dict.fromkeys(range(1, joints + 1), 100 + joints))
        assert clock.now() - start <= servos.seconds_for(joints)
    assert clock.now() - start == pytest.approx(0.2545, abs=1e-4)  # 12 lines, 2 selections
