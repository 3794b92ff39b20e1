from __future__ import annotations

import errno
import os
import termios
import time
import tty
from collections.abc import Callable, Iterator
from typing import Any, cast

import pytest
import serial
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.clock import SteppedClock
from robot.drivers.sv203 import OUTPUTS, SV203, open_serial
from robot.errors import (
    CommandError,
    DeviceDataError,
    DeviceError,
    DeviceMissingError,
    DeviceTimeoutError,
)
from sim_robot.electronics.sv203 import SV203Emulator

COUNTS = st.dictionaries(st.integers(1, 8), st.integers(1, 255))


class Wire:
    """A bare pty: what the driver writes can be read as bytes."""

    def __init__(self) -> None:
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        self.name = os.ttyname(self.slave)

    def lines(self, written: int) -> list[bytes]:
        data = b""
        while len(data) < written:
            data += os.read(self.master, 4096)
        assert data.endswith(b"\r") or not data
        return data.split(b"\r")[:-1]

    def close(self) -> None:
        os.close(self.master)
        os.close(self.slave)


@pytest.fixture
def wire() -> Iterator[Wire]:
    found = Wire()
    yield found
    found.close()


class Line:
    """Stands in for pyserial, to be fed any answer and to fail in any way."""

    port = "/dev/ttyS0"
    baudrate = 9600
    timeout = 0.2
    in_waiting = 0

    def __init__(self, reply: Callable[[], bytes], failure: dict[str, Exception] | None = None):
        self._reply = reply
        self._failure = {} if failure is None else failure

    def _maybe_fail(self, name: str) -> None:
        if name in self._failure:
            raise self._failure[name]

    def reset_input_buffer(self) -> None:
        self._maybe_fail("reset_input_buffer")

    def write(self, data: bytes) -> int:
        self._maybe_fail("write")
        return len(data)

    def read_until(self, expected: bytes, size: int) -> bytes:
        self._maybe_fail("read_until")
        reply = self._reply()
        end = reply.find(expected)
        return reply[: end + 1 if end >= 0 else size][:size]

    def read(self, size: int) -> bytes:
        return b""

    def close(self) -> None:
        self._maybe_fail("close")


def on_line(line: Line, clock: SteppedClock) -> SV203:
    return SV203(cast(serial.Serial, line), clock=clock)


def written_by(wire: Wire, board: int, act: Callable[[SV203], object]) -> list[bytes]:
    driver = SV203(open_serial(wire.name), board=board, clock=SteppedClock())
    act(driver)
    driver.close()
    return wire.lines(driver.bytes_written)


def test_a_line_selects_board_and_servo_and_carries_two_servos(wire: Wire) -> None:
    lines = written_by(wire, 1, lambda driver: driver.set_counts({8: 255, 1: 7, 3: 128}))
    assert lines == [b"BD1SV1M7SV3M128", b"BD1SV8M255"]


def test_no_line_exceeds_19_characters(wire: Wire) -> None:
    lines = written_by(wire, 255, lambda driver: driver.set_counts(dict.fromkeys(OUTPUTS, 255)))
    assert len(lines) == 4
    assert max(map(len, lines)) == 19


def test_only_changes_are_sent(wire: Wire) -> None:
    def act(driver: SV203) -> None:
        driver.set_counts({1: 10, 2: 20})
        driver.set_counts({1: 10, 2: 21})
        driver.set_counts({1: 10, 2: 21})
        driver.forget()
        driver.set_counts({1: 10})

    assert written_by(wire, 1, act) == [b"BD1SV1M10SV2M20", b"BD1SV2M21", b"BD1SV1M10"]


def test_release_is_always_sent_and_forgets(wire: Wire) -> None:
    def act(driver: SV203) -> None:
        driver.set_counts({2: 20})
        driver.release([2])
        driver.release([2])
        driver.set_counts({2: 20})

    assert written_by(wire, 1, act) == [b"BD1SV2M20", b"BD1SV2M0", b"BD1SV2M0", b"BD1SV2M20"]


@pytest.mark.parametrize("counts", [{0: 5}, {9: 5}, {1: 0}, {1: 256}, {1: -3}, {1: 5, 2: 1000}])
def test_what_the_board_would_ignore_is_refused_and_nothing_is_sent(
    servos: SV203, counts: dict[int, int]
) -> None:
    with pytest.raises(CommandError, match=r"must lie in 1 to 255|outputs 1 to 8"):
        servos.set_counts(counts)
    assert servos.bytes_written == 0


def test_other_arguments_out_of_range_are_refused(
    servos: SV203, servo_board: SV203Emulator, clock: SteppedClock
) -> None:
    for act in (
        lambda: servos.release([0]),
        lambda: servos.read_counts([9]),
        lambda: servos.read_analogue(6),
        lambda: open_serial(servo_board.port, 38400),
        lambda: on_line_with_board(256, clock),
    ):
        with pytest.raises(CommandError):
            act()


def on_line_with_board(board: int, clock: SteppedClock) -> SV203:
    return SV203(cast(serial.Serial, Line(lambda: b"")), board=board, clock=clock)


@settings(max_examples=40)
@given(st.lists(COUNTS, max_size=4))
def test_the_servos_get_what_was_commanded(history: list[dict[int, int]]) -> None:
    emulator = SV203Emulator()
    driver = SV203(open_serial(emulator.port), clock=SteppedClock())
    expected = dict.fromkeys(OUTPUTS, 128)
    for counts in history:
        driver.set_counts(counts)
        expected |= counts
    assert emulator.wait_until_read(driver.bytes_written, 5.0)
    assert emulator.pulses() == tuple(expected.values())
    assert driver.read_counts() == expected
    assert driver.verify(expected) == []
    driver.close()
    emulator.close()


@pytest.mark.parametrize(("count", "seconds"), [(8, 0.087), (2, 0.02175), (1, 0.01446), (0, 0.0)])
def test_pacing_is_the_wire_time_at_9600_baud_plus_3_ms(
    servos: SV203, clock: SteppedClock, count: int, seconds: float
) -> None:
    servos.set_counts(dict.fromkeys(range(1, count + 1), 200))
    assert clock.now() == pytest.approx(seconds, abs=1e-5)
    assert servos.seconds_for(count) == pytest.approx(seconds, abs=1e-5)


def test_answers_take_their_time_on_the_wire(servos: SV203, clock: SteppedClock) -> None:
    assert servos.read_counts([1]) == {1: 128}
    assert clock.now() == pytest.approx((len("BD1RR51\r") + len("128\r")) * 10 / 9600 + 0.003)


def test_analogue_inputs_read_volts(servos: SV203, servo_board: SV203Emulator) -> None:
    servo_board.set_analogue(3, 51)
    assert servos.read_analogue(3) == pytest.approx(1.0)


def test_a_brown_out_is_found_and_mended(servos: SV203, servo_board: SV203Emulator) -> None:
    pose = {1: 100, 2: 128, 5: 30}
    servos.set_counts(pose)
    assert servo_board.wait_until_read(servos.bytes_written, 5.0)
    servo_board.power_cycle()
    assert servos.verify(pose) == [1, 5]  # 2 stood at neutral anyway
    servos.set_counts(pose)
    assert servos.verify(pose) == []


def test_bytes_lost_on_the_line_are_found_and_mended(
    servos: SV203, servo_board: SV203Emulator
) -> None:
    pose = {n: 40 + n for n in OUTPUTS}
    servo_board.inject("drop", 10)
    servos.set_counts(pose)
    assert servo_board.wait_until_read(servos.bytes_written, 5.0)
    servo_board.mend()
    assert servos.verify(pose) != []
    servos.set_counts(pose)
    assert servos.verify(pose) == []


def test_one_damaged_answer_is_asked_again(servos: SV203, servo_board: SV203Emulator) -> None:
    servo_board.inject("garbage", 2)
    assert servos.read_counts() == dict.fromkeys(OUTPUTS, 128)


def test_an_answer_that_waited_for_the_processor_is_not_late(
    servo_board: SV203Emulator, clock: SteppedClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver = SV203(open_serial(servo_board.port), clock=clock, reply_timeout=5.0)
    read, lost = serial.Serial.read, [0.0]

    def read_and_lose_the_processor(port: serial.Serial, size: int = 1) -> bytes:
        data = read(port, size)
        lost[0] += 60.0
        return data

    monkeypatch.setattr(serial.Serial, "read", read_and_lose_the_processor)
    monkeypatch.setattr(
        serial.serialutil.Timeout, "TIME", staticmethod(lambda: time.monotonic() + lost[0])
    )
    assert driver.read_counts() == dict.fromkeys(OUTPUTS, 128)
    assert driver.repeats == 0
    driver.close()


def test_nothing_but_damaged_answers_are_an_error(
    servos: SV203, servo_board: SV203Emulator
) -> None:
    servo_board.inject("garbage", 1)
    with pytest.raises(DeviceDataError, match="~28"):
        servos.read_counts([1])


def test_a_silent_board_is_an_error_in_time(
    servos: SV203, servo_board: SV203Emulator, clock: SteppedClock
) -> None:
    servo_board.inject("mute")
    start = time.monotonic()
    with pytest.raises(DeviceTimeoutError, match=r"did not answer RR51 within 0\.2 s"):
        servos.read_counts()
    assert time.monotonic() - start < 5.0
    assert clock.now() >= 0.6  # three attempts, charged to the robot's clock


def test_another_board_number_gets_no_answer(
    servo_board: SV203Emulator, clock: SteppedClock
) -> None:
    driver = SV203(open_serial(servo_board.port), board=2, clock=clock, reply_timeout=0.02)
    with pytest.raises(DeviceTimeoutError, match="board number"):
        driver.read_counts([1])
    driver.close()


def test_a_line_that_nobody_empties_is_an_error_in_time(wire: Wire) -> None:
    driver = SV203(open_serial(wire.name), clock=SteppedClock())
    start = time.monotonic()

    def write_on() -> None:
        for _ in range(20_000):
            driver.forget()
            driver.set_counts({1: 100, 2: 100})

    with pytest.raises(DeviceTimeoutError, match="took no more bytes"):
        write_on()
    assert time.monotonic() - start < 10.0
    driver.close()


def test_unplugged_while_moving_and_back(
    servos: SV203, servo_board: SV203Emulator, clock: SteppedClock
) -> None:
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
        open_serial(servo_board.port)
    servos.close()
    servo_board.replug()
    again = SV203(open_serial(servo_board.port), clock=clock)
    assert again.read_counts([1]) == {1: 90}  # the board held by itself
    again.close()


def test_a_count_that_may_not_have_arrived_is_sent_again() -> None:
    failure: dict[str, Exception] = {}
    driver = on_line(Line(lambda: b"", failure), SteppedClock())
    driver.set_counts({1: 10})
    failure["write"] = OSError(errno.EIO, "Input/output error")
    with pytest.raises(DeviceMissingError):
        driver.set_counts({1: 20})
    failure.clear()
    before = driver.bytes_written
    driver.set_counts({1: 10})  # the board may have 20 by now
    driver.set_counts({1: 10})
    assert driver.bytes_written - before == len("BD1SV1M10\r")


def test_one_wrong_but_sound_answer_is_not_taken_for_a_reset() -> None:
    replies = iter([b"128\r", b"12\r", b"128\r"])
    driver = on_line(Line(lambda: next(replies)), SteppedClock())
    assert driver.verify({1: 128, 2: 128}) == []


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
    driver = on_line(Line(lambda: b"128\r", {where: failure}), SteppedClock())
    with pytest.raises(DeviceMissingError, match=r"^The serial port /dev/ttyS0 failed while .*\.$"):
        driver.read_counts([1])


def test_closing_a_vanished_line_is_no_error() -> None:
    failure: dict[str, Exception] = {"close": OSError(errno.EIO, "Input/output error")}
    on_line(Line(lambda: b"", failure), SteppedClock()).close()


@given(
    st.lists(
        st.binary(max_size=40) | st.from_regex(rb"[0-9]{0,4}[ \n]?\r?", fullmatch=True),
        min_size=1,
        max_size=4,
    )
)
def test_garbage_is_never_taken_for_a_count(chunks: list[bytes]) -> None:
    replies = iter(chunks * 3)
    driver = on_line(Line(lambda: next(replies)), SteppedClock())
    try:
        found = driver.read_counts([1])[1]
    except DeviceError:
        return
    sound = [chunk.partition(b"\r") for chunk in chunks]
    assert found in [int(text) for text, end, _ in sound if end and text.strip(b"\n ").isdigit()]
    assert 0 <= found <= 255


def test_open_serial_says_why_it_cannot(tmp_path: Any, servo_board: SV203Emulator) -> None:
    with pytest.raises(DeviceMissingError, match="by-id"):
        open_serial(str(tmp_path / "ttyUSB0"))
    plain = tmp_path / "plain"
    plain.touch()
    with pytest.raises(DeviceMissingError, match="Name the device file of a serial port"):
        open_serial(str(plain))


def test_a_second_program_is_told_that_the_port_is_taken(
    servos: SV203, servo_board: SV203Emulator
) -> None:
    assert servos.bytes_written == 0
    with pytest.raises(DeviceMissingError, match="other program"):
        open_serial(servo_board.port)


def test_a_line_that_is_another_device_now_is_opened_anew(
    servos: SV203, servo_board: SV203Emulator
) -> None:
    servos.set_counts({1: 90})
    before = servos.bytes_written
    assert servo_board.wait_until_read(before, 5.0)
    servo_board.unplug()
    with pytest.raises(DeviceMissingError, match="by-id"):
        servos.reopen(lambda: open_serial(servo_board.port))
    with pytest.raises(DeviceMissingError, match="plugged in"):
        servos.read_counts([1])
    servo_board.replug()
    servos.reopen(lambda: open_serial(servo_board.port))
    assert servos.read_counts([1]) == {1: 90}
    servos.set_counts({1: 90})  # what the old line carried is not taken for granted
    assert servos.bytes_written == before + len("BD1RR51\r" + "BD1SV1M90\r")
    assert servo_board.wait_until_read(servos.bytes_written, 5.0)
