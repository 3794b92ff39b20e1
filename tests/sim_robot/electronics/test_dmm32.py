"""The register file, held to the vendor's manual and the probe of Linux' driver, byte by byte."""

from __future__ import annotations

import pytest

from sim_robot.electronics.dmm32 import DMM32Emulator
from tests.robot.clocks import InstantClock

BASE = 0x300


class Bench:
    """The board with port access by offset."""

    def __init__(self) -> None:
        self.clock = InstantClock()
        self.volts = dict.fromkeys(range(32), 0.0)
        self.board = DMM32Emulator(lambda channel: self.volts[channel], self.clock)

    def read(self, offset: int) -> int:
        return self.board.read(BASE + offset)[0]

    def write(self, offset: int, value: int) -> None:
        self.board.write(BASE + offset, value)

    def select(self, low: int, high: int, range_: int = 0) -> None:
        self.write(7, 0x02)
        self.write(2, low)
        self.write(3, high)
        self.write(11, range_)
        self.clock.sleep(1e-3)

    def convert(self) -> int:
        self.write(0, 0)
        self.clock.sleep(1e-3)
        return self.sample()

    def sample(self) -> int:
        low = self.read(0)
        value = low | self.read(1) << 8
        return value - 0x10000 if value >= 0x8000 else value


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_the_probe_of_the_kernel_driver(bench: Bench) -> None:
    bench.write(0, 0)  # leave something to reset
    bench.write(8, 0x20)
    bench.clock.sleep(1e-3)
    bench.write(7, 0x00)
    bench.write(9, 0x00)
    bench.write(2, 0x80)
    bench.write(3, 0xFF)
    bench.write(11, 0x0C)
    bench.clock.sleep(100e-6)
    registers = [bench.read(offset) for offset in (2, 3, 7, 8, 9, 11)]
    assert registers == [0x00, 0x1F, 0x80, 0x60, 0x00, 0x0C]


@pytest.mark.parametrize(
    ("range_", "volts", "code"),
    [
        (0x0, 2.71027, 17762),
        (0x0, -2.29004, -15008),
        (0xC, 7.71027, 17762),
        (0x0, 5.0, 32767),
        (0x0, -9.0, -32768),
        (0x8, 5.0, 16384),
        (0x3, 0.3125, 16384),
        (0xB, 0.3125, 32767 // 4 + 1),
        (0xC, 0.0, -32768),
        (0xD, 2.5, 0),
        (0xE, 1.25, 0),
        (0xF, 1.25, 32767),
    ],
)
def test_ranges_and_codes(bench: Bench, range_: int, volts: float, code: int) -> None:
    bench.volts[4] = volts
    bench.select(4, 4, range_)
    assert bench.convert() == code


def test_waits_ten_microseconds_after_a_change(bench: Bench) -> None:
    bench.select(1, 1)
    assert not bench.read(11) & 0x80
    for offset in (2, 11):
        bench.write(offset, 1)
        start = bench.clock.now()
        polls = 0
        while bench.read(11) & 0x80:
            polls += 1
        assert 5 <= polls <= 10
        assert bench.clock.now() - start == pytest.approx(11e-6, abs=2e-6)


def test_a_start_while_the_input_settles_is_found_out(bench: Bench) -> None:
    bench.volts.update({1: 1.0, 2: 2.0})
    bench.select(1, 1)
    one = bench.convert()
    bench.write(2, 2)
    bench.write(3, 2)
    assert bench.convert() == one  # not yet 2 V
    assert bench.convert() == pytest.approx(2 * one, abs=1)


def test_busy_for_four_microseconds_and_nothing_to_read_before(bench: Bench) -> None:
    bench.volts[0] = 1.0
    bench.select(0, 0)
    bench.write(0, 0)
    assert bench.read(8) & 0x80
    assert bench.read(7) & 0x80
    assert bench.sample() != 0  # the rest of the 4 µs passes meanwhile
    bench.clock.sleep(4e-6)
    assert not bench.read(8) & 0x80


def test_the_channel_advances_and_wraps(bench: Bench) -> None:
    bench.volts.update({5: 0.5, 6: 0.6, 7: 0.7})
    bench.select(5, 7)
    volts_read = []
    for _ in range(4):
        volts_read.append(bench.convert() / 32768 * 5)
    assert volts_read == [pytest.approx(volts, abs=1e-3) for volts in (0.5, 0.6, 0.7, 0.5)]
    assert bench.read(8) & 0x1F == 6


def test_more_than_one_channel_must_settle_again(bench: Bench) -> None:
    bench.select(5, 7)
    bench.write(0, 0)
    bench.clock.sleep(5e-6)
    assert bench.read(11) & 0x80
    bench.clock.sleep(10e-6)
    assert not bench.read(11) & 0x80


def test_a_scan_fills_the_fifo_in_order(bench: Bench) -> None:
    bench.volts.update({n: n / 10 for n in range(8)})
    bench.select(0, 7)
    bench.write(7, 0x04)
    assert bench.read(7) & 0x04
    bench.write(0, 0)
    bench.clock.sleep(150e-6)
    assert bench.read(8) & 0x80  # eight times 20 µs are not over
    bench.clock.sleep(10e-6)
    assert not bench.read(8) & 0x80
    volts_read = [bench.sample() / 32768 * 5 for _ in range(8)]
    assert volts_read == [pytest.approx(n / 10, abs=1e-3) for n in range(8)]
    assert bench.read(7) & 0x80


def test_the_scan_interval_code(bench: Bench) -> None:
    for code, microseconds in ((0, 20), (1, 15), (2, 10), (3, 5)):
        bench.select(0, 3, code << 4)
        bench.write(7, 0x04)
        start = bench.clock.now()
        bench.write(0, 0)
        while bench.read(8) & 0x80:
            pass
        assert (bench.clock.now() - start) * 1e6 == pytest.approx(4 * microseconds, abs=4)


def test_reset_of_the_fifo_changes_its_neighbours(bench: Bench) -> None:
    bench.write(7, 0x0C)
    assert bench.read(7) & 0x0C == 0x0C
    bench.write(7, 0x0A)
    assert bench.read(7) & 0x0C == 0x08
    bench.write(7, 0x02)
    assert bench.read(7) & 0x0C == 0x00


def test_the_fifo_overflows_and_says_so_until_reset(bench: Bench) -> None:
    bench.board = DMM32Emulator(lambda channel: 1.0, bench.clock, fifo_depth=4)
    bench.select(0, 0)
    for _ in range(4):
        bench.write(0, 0)
        bench.clock.sleep(1e-3)
    assert bench.read(7) & 0x30 == 0x20
    bench.write(0, 0)
    bench.clock.sleep(1e-3)
    bench.sample()
    assert bench.read(7) & 0x10
    bench.write(7, 0x02)
    assert bench.read(7) == 0x80


def test_two_ports_at_once_are_low_byte_then_high_byte(bench: Bench) -> None:
    bench.volts[0] = 2.71027
    bench.select(0, 0)
    bench.write(0, 0)
    bench.clock.sleep(1e-3)
    assert bench.board.read(BASE, 2) == (17762).to_bytes(2, "little")
    assert bench.board.read(BASE, 2) == b"\xff\xff"  # empty


def test_an_empty_bus_floats(bench: Bench) -> None:
    assert bench.board.read(BASE + 16) == b"\xff"
    assert bench.board.read(BASE - 1, 2)[0] == 0xFF
    bench.board.inject("absent")
    assert [bench.read(offset) for offset in range(16)] == [0xFF] * 16


def test_an_access_takes_a_microsecond(bench: Bench) -> None:
    bench.board.read(BASE, 2)
    bench.write(2, 0)
    bench.board.read(0x200)
    assert bench.clock.now() == pytest.approx(4e-6)


def test_paged_registers_keep_their_pages(bench: Bench) -> None:
    bench.write(8, 1)
    bench.write(12, 0xAA)
    bench.write(8, 0)
    assert bench.read(12) == 0
    bench.write(8, 1)
    assert bench.read(12) == 0xAA


def test_stuck_and_railed_channels(bench: Bench) -> None:
    bench.volts.update({2: 1.0, 3: 1.0})
    bench.board.inject("stuck_channel", 2)
    bench.board.inject("railed_channel", 3)
    bench.select(2, 2)
    before = bench.convert()
    bench.volts[2] = 4.0
    assert bench.convert() == before
    bench.board.mend("stuck_channel")
    assert bench.convert() == pytest.approx(4 * before, abs=4)
    bench.select(3, 3)
    assert bench.convert() == 32767
