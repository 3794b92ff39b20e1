"""What the servo board is told, in which bytes and how fast; whether it still has it."""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain, repeat
from typing import cast

import pytest
import serial
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.drivers.links.device_files import open_serial
from robot.drivers.servos.sv203 import SV203
from robot.errors import CommandError, DeviceDataError
from sim_robot.electronics.sv203 import SV203Emulator
from tests.robot.clocks import InstantClock
from tests.robot.drivers.servos.lines import Line

COUNTS = st.dictionaries(st.integers(1, 8), st.integers(1, 255))


def written_by(board: int, act: Callable[[SV203], object], held: int = 128) -> list[bytes]:
    """The lines that follow the first query, where later ones are answered with ``held``."""
    answers = chain([128], repeat(held))
    line = Line(lambda: b"%d\r" % next(answers))
    driver = SV203(lambda: cast(serial.Serial, line), boards=[board], clock=InstantClock())
    driver.read_counts([1])
    act(driver)
    assert len(line.written) == driver.bytes_written
    query, *lines, rest = line.written.split(b"\r")
    assert (query, rest) == (b"BD%dRR51" % board, b"")
    return lines


def test_a_line_selects_the_servo_never_the_board_and_carries_two_servos() -> None:
    lines = written_by(1, lambda driver: driver.set_counts({8: 255, 1: 7, 3: 128}))
    assert lines == [b"SV1M7SV3M128", b"SV8M255"]


def test_no_line_exceeds_15_characters() -> None:
    def act(driver: SV203) -> None:
        driver.set_counts(dict.fromkeys(range(1, 9), 255))
        driver.release()

    lines = written_by(255, act)
    assert len(lines) == 8
    assert max(map(len, lines)) == 15


def test_only_changes_are_sent() -> None:
    def act(driver: SV203) -> None:
        driver.set_counts({1: 10, 2: 20})
        driver.set_counts({1: 10, 2: 21})
        driver.set_counts({1: 10, 2: 21})
        driver.forget()
        driver.read_counts([1])
        driver.set_counts({1: 10})

    assert written_by(1, act) == [b"SV1M10SV2M20", b"SV2M21", b"BD1RR51", b"SV1M10"]


def test_release_is_always_sent_to_any_board_and_forgets() -> None:
    def act(driver: SV203) -> None:
        driver.set_counts({2: 20})
        driver.release([2])
        driver.release([2])
        driver.set_counts({2: 20})

    lines = written_by(1, act, held=0)
    assert lines == [b"SV2M20", b"BD1SV2M0", b"BD1SV2M0", b"BD1RR52", b"SV2M20"]


@pytest.mark.parametrize("counts", [{0: 5}, {9: 5}, {1: 0}, {1: 256}, {1: -3}, {1: 5, 2: 1000}])
def test_what_the_board_would_ignore_is_refused_and_nothing_is_sent(
    servos: SV203, counts: dict[int, int]
) -> None:
    servos.read_counts()
    before = servos.bytes_written
    with pytest.raises(CommandError, match=r"must lie in 1 to 255|outputs 1 to 8"):
        servos.set_counts(counts)
    assert servos.bytes_written == before


def test_a_board_that_was_not_read_is_not_moved(servos: SV203) -> None:
    with pytest.raises(CommandError, match="read the servo board's counts"):
        servos.set_counts({1: 10})
    assert servos.bytes_written == 0


def test_other_outputs_out_of_range_are_refused(servos: SV203) -> None:
    for act in (lambda: servos.release([0]), lambda: servos.read_counts([9])):
        with pytest.raises(CommandError):
            act()


@settings(max_examples=40)
@given(st.lists(COUNTS, max_size=4))
def test_the_servos_get_what_was_commanded(history: list[dict[int, int]]) -> None:
    emulator = SV203Emulator()
    driver = SV203(lambda: open_serial(emulator.port, 9600), clock=InstantClock())
    expected = driver.read_counts()
    for counts in history:
        driver.set_counts(counts)
        expected |= counts
    assert emulator.wait_until_read(driver.bytes_written, 5.0)
    assert emulator.pulses() == tuple(expected.values())
    assert driver.read_counts() == expected
    assert driver.verify(expected) == []
    driver.close()
    emulator.close()


@pytest.mark.parametrize(("count", "seconds"), [(8, 0.0745), (2, 0.018625), (1, 0.01133), (0, 0.0)])
def test_pacing_is_the_wire_time_at_9600_baud_plus_3_ms(
    servos: SV203, clock: InstantClock, count: int, seconds: float
) -> None:
    servos.read_counts()
    start = clock.now()
    servos.set_counts(dict.fromkeys(range(1, count + 1), 200))
    assert clock.now() - start == pytest.approx(seconds, abs=1e-5)
    assert servos.seconds_for(count) == pytest.approx(seconds, abs=1e-5)


def test_answers_take_their_time_on_the_wire(servos: SV203, clock: InstantClock) -> None:
    assert servos.read_counts([1, 2]) == {1: 128, 2: 128}
    written = len("BD1RR51\r" + "RR52\r" + "128\r" * 2)
    assert clock.now() == pytest.approx(written * 10 / 9600 + 2 * 0.003)


def test_a_board_that_was_reset_ignores_moves_and_is_found_out(
    servos: SV203, servo_board: SV203Emulator
) -> None:
    pose = {1: 100, 2: 128, 5: 30}
    servos.read_counts()
    servos.set_counts(pose)
    assert servo_board.wait_until_read(servos.bytes_written, 5.0)
    servo_board.power_cycle()
    servos.set_counts(pose | {1: 101, 7: 10})
    assert servo_board.wait_until_read(servos.bytes_written, 5.0)
    assert set(servo_board.pulses()) == {128}
    with pytest.raises(DeviceDataError, match="it was reset"):
        servos.verify({2: 128})  # where it is by chance
    with pytest.raises(CommandError, match="read the servo board's counts"):
        servos.set_counts(pose)
    assert servos.read_counts() == dict.fromkeys(range(1, 9), 128)
    servos.set_counts(pose)
    assert servos.verify(pose) == []


def test_a_board_that_was_reset_is_released_all_the_same(
    servos: SV203, servo_board: SV203Emulator
) -> None:
    servos.read_counts()
    servo_board.power_cycle()
    servos.release()
    assert servo_board.wait_until_read(servos.bytes_written, 5.0)
    assert set(servo_board.pulses()) == {0}


@pytest.mark.parametrize("pose", [{1: 200, 2: 60}, {1: 128, 2: 60}])
def test_a_release_lets_no_move_through_to_a_board_that_was_reset(
    servos: SV203, servo_board: SV203Emulator, pose: dict[int, int]
) -> None:
    servos.read_counts()
    servos.set_counts(pose | {3: 90})
    servos.release([3])
    assert servo_board.wait_until_read(servos.bytes_written, 5.0)
    servo_board.power_cycle()
    servos.release([4])
    with pytest.raises(DeviceDataError, match="it was reset"):
        servos.set_counts({1: pose[1] + 2})
    assert servo_board.wait_until_read(servos.bytes_written, 5.0)
    assert servo_board.pulses()[:4] == (128, 128, 128, 0)


def test_a_board_whose_servos_are_limp_or_at_neutral_is_found_out_by_the_limp_ones(
    servos: SV203, servo_board: SV203Emulator
) -> None:
    servos.read_counts()
    servos.release([3])
    assert servo_board.wait_until_read(servos.bytes_written, 5.0)
    servo_board.power_cycle()
    with pytest.raises(DeviceDataError, match="count 128 at output 3 instead of 0: it was reset"):
        servos.set_counts({1: 130})


def test_bytes_lost_on_the_line_are_found_and_mended(
    servos: SV203, servo_board: SV203Emulator
) -> None:
    pose = {n: 40 + n for n in range(1, 9)}
    servos.read_counts()
    servo_board.inject("drop", 10)
    servos.set_counts(pose)
    assert servo_board.wait_until_read(servos.bytes_written, 5.0)
    servo_board.mend()
    assert servos.verify(pose) != []
    servos.set_counts(pose)
    assert servos.verify(pose) == []
