"""Every way in which the servo board's line and its answers go wrong."""

from __future__ import annotations

import errno
import fcntl
import os
import termios
import time
from pathlib import Path
from typing import Any

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from robot.drivers.links.device_files import open_serial
from robot.drivers.servos.sv203 import SV203
from robot.errors import DeviceDataError, DeviceError, DeviceMissingError, DeviceTimeoutError
from sim_robot.electronics.sv203 import SV203Emulator
from tests.robot.clocks import InstantClock
from tests.robot.drivers.servos.lines import Line, Wire, on_line

TIOCGEXCL = 0x80045440  # of asm-generic/ioctls.h; Python has no name for it


def test_one_damaged_answer_is_asked_again(servos: SV203, servo_board: SV203Emulator) -> None:
    servo_board.inject("garbage", 2)
    assert servos.read_counts() == dict.fromkeys(range(1, 9), 128)


def test_an_answer_that_waited_for_the_processor_is_not_late(
    servo_board: SV203Emulator, clock: InstantClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver = SV203(lambda: open_serial(servo_board.port, 9600), clock=clock, reply_timeout=5.0)
    read, lost = serial.Serial.read, [0.0]

    def read_and_lose_the_processor(port: serial.Serial, size: int = 1) -> bytes:
        data = read(port, size)
        lost[0] += 60.0
        return data

    monkeypatch.setattr(serial.Serial, "read", read_and_lose_the_processor)
    monkeypatch.setattr(
        serial.serialutil.Timeout, "TIME", staticmethod(lambda: time.monotonic() + lost[0])
    )
    assert driver.read_counts() == dict.fromkeys(range(1, 9), 128)
    assert driver.repeats == 0
    driver.close()


def test_nothing_but_damaged_answers_are_an_error(
    servos: SV203, servo_board: SV203Emulator
) -> None:
    servo_board.inject("garbage", 1)
    with pytest.raises(DeviceDataError, match="~28"):
        servos.read_counts([1])


@pytest.mark.parametrize("known", [False, True])
def test_a_silent_board_is_an_error_in_time(
    servos: SV203, servo_board: SV203Emulator, clock: InstantClock, known: bool
) -> None:
    if known:  # it is asked once more, whether it was reset
        servos.read_counts()
    servo_board.inject("mute")
    start = time.monotonic()
    with pytest.raises(DeviceTimeoutError, match=r"did not answer RR51 within 0\.2 s"):
        servos.read_counts()
    assert time.monotonic() - start < 5.0
    assert clock.now() >= 0.6  # three attempts, charged to the robot's clock


def is_exclusive(file: int) -> bool:
    flag = bytearray(4)
    fcntl.ioctl(file, TIOCGEXCL, flag)
    return any(flag)


def test_nobody_else_can_open_a_line_until_it_is_closed(wire: Wire) -> None:
    line = open_serial(wire.name, 9600)
    assert is_exclusive(wire.slave)
    line.close()
    assert not is_exclusive(wire.slave)  # whoever reads it already does not keep us out
    open_serial(wire.name, 9600).close()


def test_a_daemon_that_was_killed_leaves_no_emulated_line_shut(
    servos: SV203, servo_board: SV203Emulator
) -> None:
    servos.read_counts([1])
    line = os.open(servo_board.port, os.O_RDWR | os.O_NOCTTY)
    assert not is_exclusive(line)
    os.close(line)


@pytest.mark.parametrize("reply", [b"", b"8~\r"])
def test_a_second_reader_of_the_line_is_thought_of(reply: bytes) -> None:
    driver = on_line(Line(lambda: reply), InstantClock())
    with pytest.raises(DeviceError) as caught:
        driver.read_counts([1])
    assert (
        "and that no other program reads the line (fuser -v /dev/ttyS0; systemctl stop "
        "serial-getty@ttyS0)." in str(caught.value)
    )


def test_another_board_number_gets_no_answer(
    servo_board: SV203Emulator, clock: InstantClock
) -> None:
    driver = SV203(
        lambda: open_serial(servo_board.port, 9600), boards=[2], clock=clock, reply_timeout=0.02
    )
    with pytest.raises(DeviceTimeoutError, match="board number"):
        driver.read_counts([1])
    driver.close()


def test_a_line_that_nobody_empties_is_an_error_in_time(wire: Wire) -> None:
    driver = SV203(lambda: open_serial(wire.name, 9600), clock=InstantClock())
    start = time.monotonic()

    def write_on() -> None:
        for _ in range(20_000):
            driver.release([1, 2])

    with pytest.raises(DeviceTimeoutError, match="took no more bytes"):
        write_on()
    assert time.monotonic() - start < 10.0
    driver.close()


def test_a_process_that_stood_still_while_it_wrote_has_written(
    servo_board: SV203Emulator, clock: InstantClock
) -> None:
    class Stalled(serial.Serial):
        def write(self, data: Any, /) -> int | None:
            super().write(data)
            raise serial.SerialTimeoutException("Write timeout")  # it looks at the clock at last

    driver = SV203(lambda: Stalled(servo_board.port, 9600, timeout=1, write_timeout=1), clock=clock)
    driver.read_counts([1])
    driver.set_counts({1: 90})
    assert servo_board.wait_until_read(driver.bytes_written, 5.0)
    assert servo_board.pulses()[0] == 90
    driver.close()


def test_unplugged_while_moving_and_back(
    servos: SV203, servo_board: SV203Emulator, clock: InstantClock
) -> None:
    servos.read_counts([1])
    servos.set_counts({1: 90})
    assert servo_board.wait_until_read(servos.bytes_written, 5.0)
    servo_board.unplug()
    assert servo_board.wait_until_read(servos.bytes_written + 100, 0.0)
    for act in (
        lambda: servos.set_counts({1: 91}),
        lambda: servos.release([1]),
        lambda: servos.read_counts([1]),
        lambda: servos.verify({1: 90}),
    ):
        with pytest.raises(DeviceMissingError, match="plugged in"):
            act()
    with pytest.raises(DeviceMissingError, match="by-id"):
        open_serial(servo_board.port, 9600)
    servos.close()
    servo_board.replug()
    again = SV203(lambda: open_serial(servo_board.port, 9600), clock=clock)
    assert again.read_counts([1]) == {1: 90}  # the board held by itself
    again.close()


def test_a_count_that_may_not_have_arrived_is_sent_again() -> None:
    failure: dict[str, Exception] = {}
    driver = on_line(Line(lambda: b"128\r", failure), InstantClock())
    driver.read_counts([1])
    driver.set_counts({1: 10})
    failure["write"] = OSError(errno.EIO, "Input/output error")
    with pytest.raises(DeviceMissingError):
        driver.set_counts({1: 20})
    failure.clear()
    before = driver.bytes_written
    driver.set_counts({1: 10})  # the board may have 20 by now
    driver.set_counts({1: 10})
    assert driver.bytes_written - before == len("SV1M10\r")


def test_one_wrong_but_sound_answer_is_not_taken_for_a_reset() -> None:
    replies = iter([b"128\r", b"12\r", b"128\r"])
    driver = on_line(Line(lambda: next(replies)), InstantClock())
    assert driver.verify({1: 128, 2: 128}) == []


@pytest.mark.parametrize("lost", [0, 1, 2])
def test_a_reset_is_named_although_answers_are_lost(lost: int) -> None:
    deselected = [b""] * 3
    replies = iter([b"200\r", *deselected, *[b""] * lost, b"128\r"])
    driver = on_line(Line(lambda: next(replies)), InstantClock())
    driver.read_counts([1])
    with pytest.raises(DeviceDataError, match="not selected any more: it was reset"):
        driver.read_counts([1])


@pytest.mark.parametrize("where", ["reset_input_buffer", "write", "read_until"])
@pytest.mark.parametrize(
    "failure",
    [
        serial.SerialException("device disconnected"),
        serial.PortNotOpenError(),
        OSError(errno.EIO, "Input/output error"),
        termios.error(errno.EIO, "Input/output error"),
    ],
    ids=lambda failure: type(failure).__name__,
)
def test_every_way_a_line_fails_is_a_sentence(where: str, failure: Exception) -> None:
    driver = on_line(Line(lambda: b"128\r", {where: failure}), InstantClock())
    with pytest.raises(DeviceMissingError, match=r"^The serial port /dev/ttyS0 failed while .*\.$"):
        driver.read_counts([1])


def test_closing_a_vanished_line_is_no_error() -> None:
    failure: dict[str, Exception] = {"close": OSError(errno.EIO, "Input/output error")}
    on_line(Line(lambda: b"", failure), InstantClock()).close()


@given(
    st.lists(
        st.binary(max_size=40) | st.from_regex(rb"[0-9]{0,4}[ \n]?\r?", fullmatch=True),
        min_size=1,
        max_size=4,
    )
)
def test_garbage_is_never_taken_for_a_count(chunks: list[bytes]) -> None:
    replies = iter(chunks * 3)
    driver = on_line(Line(lambda: next(replies)), InstantClock())
    try:
        count = driver.read_counts([1])[1]
    except DeviceError:
        return
    sound = [chunk.partition(b"\r") for chunk in chunks]
    assert count in [int(text) for text, end, _ in sound if end and text.strip(b"\n ").isdigit()]
    assert 0 <= count <= 255


def test_open_serial_says_why_it_cannot(tmp_path: Path, servo_board: SV203Emulator) -> None:
    with pytest.raises(DeviceMissingError, match="by-id"):
        open_serial(str(tmp_path / "ttyUSB0"), 9600)
    plain = tmp_path / "plain"
    plain.touch()
    with pytest.raises(DeviceMissingError, match="Name the device file of a serial port"):
        open_serial(str(plain), 9600)


def test_a_second_program_is_told_that_the_port_is_taken(
    servos: SV203, servo_board: SV203Emulator
) -> None:
    assert servos.bytes_written == 0
    with pytest.raises(DeviceMissingError, match="other program"):
        open_serial(servo_board.port, 9600)


def test_a_line_that_is_another_device_now_is_opened_anew(
    servos: SV203, servo_board: SV203Emulator
) -> None:
    servos.read_counts([1])
    servos.set_counts({1: 90})
    before = servos.bytes_written
    assert servo_board.wait_until_read(before, 5.0)
    servo_board.unplug()
    with pytest.raises(DeviceMissingError, match="by-id"):
        servos.reopen()
    with pytest.raises(DeviceMissingError, match="plugged in"):
        servos.read_counts([1])
    servo_board.replug()
    servos.reopen()
    assert servos.read_counts([1]) == {1: 90}
    servos.set_counts({1: 90})  # what the old line carried is not taken for granted
    assert servos.bytes_written == before + len("BD1RR51\r" + "SV1M90\r")
    assert servo_board.wait_until_read(servos.bytes_written, 5.0)
