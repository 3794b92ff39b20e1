from __future__ import annotations

import errno
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.drivers.links.device_files import PortIO
from robot.drivers.sensors.dmm32 import BASES, DMM32, RANGES
from robot.errors import (
    CommandError,
    DeviceDataError,
    DeviceError,
    DeviceMissingError,
    DeviceTimeoutError,
)
from sim_robot.electronics.dmm32 import DMM32Emulator
from tests.robot.clocks import InstantClock


def staircase(channel: int) -> float:
    return 0.125 * channel - 2.0


@pytest.fixture
def board(clock: InstantClock) -> DMM32Emulator:
    return DMM32Emulator(staircase, clock)


@pytest.fixture
def driver(board: DMM32Emulator, clock: InstantClock) -> DMM32:
    probed = on(board, clock)
    probed.probe()
    return probed


def on(board: PortIO, clock: InstantClock, *, base: int = 0x300, range_: str = "±5V") -> DMM32:
    """A driver with its ports open."""
    driver = DMM32(lambda address: board, base=base, clock=clock, range_=range_)
    driver.open()
    return driver


class Glitch:
    """A board that drops off the bus for some accesses."""

    def __init__(self, board: DMM32Emulator, first: int, count: int):
        self._board = board
        self._gone = range(first, first + count)
        self.accesses = 0

    def _next(self) -> None:
        if self.accesses in self._gone:
            self._board.inject("absent")
        else:
            self._board.mend("absent")
        self.accesses += 1

    def read(self, port: int, n: int = 1) -> bytes:
        self._next()
        return self._board.read(port, n)

    def write(self, port: int, value: int) -> None:
        self._next()
        self._board.write(port, value)

    def close(self) -> None:
        pass


@pytest.mark.parametrize(
    ("range_", "code", "volts"),
    [("±5V", 17762, 2.71027), ("±5V", -15008, -2.29004), ("0..10V", 17762, 7.71027)],
)
def test_codes_are_volts_as_the_vendor_computes_them(range_: str, code: int, volts: float) -> None:
    assert RANGES[range_].volts(code) == pytest.approx(volts, abs=5e-6)


@pytest.mark.parametrize(
    ("range_", "microvolts"),
    [
        ("±10V", 305),
        ("±5V", 153),
        ("±2.5V", 76),
        ("±1.25V", 38),
        ("±0.625V", 19),
        ("0..10V", 153),
        ("0..5V", 76),
        ("0..2.5V", 38),
        ("0..1.25V", 19),
    ],
)
def test_one_step_is_what_the_range_table_says(range_: str, microvolts: int) -> None:
    step = RANGES[range_].volts(1) - RANGES[range_].volts(0)
    assert step * 1e6 == pytest.approx(microvolts, abs=0.6)


@pytest.mark.parametrize("range_", RANGES)
@given(share=st.floats(0.0, 1.0))
def test_every_range_reads_back_what_is_there(range_: str, share: float) -> None:
    kind = RANGES[range_]
    volts = kind.low + share * (kind.high - kind.low)
    clock = InstantClock()
    driver = on(DMM32Emulator(lambda channel: volts, clock), clock, range_=range_)
    step = (kind.high - kind.low) / 65536
    assert driver.scan(5, 5) == [pytest.approx(volts, abs=step)]
    assert driver.scan(3, 4) == [pytest.approx(volts, abs=step)] * 2


def test_a_voltage_beyond_the_range_reads_the_end(clock: InstantClock) -> None:
    driver = on(DMM32Emulator(lambda channel: 7.0, clock), clock, range_="±2.5V")
    assert driver.scan(0, 0) == [pytest.approx(2.5, abs=1e-4)]


@given(st.lists(st.tuples(st.integers(0, 31), st.integers(0, 31)), min_size=1, max_size=6))
def test_scans_and_single_readings_keep_their_channels_apart(
    spans: list[tuple[int, int]],
) -> None:
    clock = InstantClock()
    driver = on(DMM32Emulator(staircase, clock), clock)
    driver.probe()
    for one, other in spans:
        low, high = min(one, other), max(one, other)
        expected = [pytest.approx(staircase(n), abs=1e-4) for n in range(low, high + 1)]
        assert driver.scan(low, high) == expected
        assert driver.scan(one, one) == [pytest.approx(staircase(one), abs=1e-4)]


@pytest.mark.parametrize("base", BASES)
def test_any_base_address_of_the_board(base: int, clock: InstantClock) -> None:
    driver = on(DMM32Emulator(staircase, clock, base=base), clock, base=base)
    driver.probe()
    assert driver.scan(9, 9) == [pytest.approx(staircase(9), abs=1e-4)]


def test_a_scan_takes_its_interval_per_channel(clock: InstantClock) -> None:
    driver = on(DMM32Emulator(staircase, clock), clock)
    start = clock.now()
    driver.scan(0, 6)
    assert 7 * 20 <= (clock.now() - start) * 1e6 < 7 * 20 + 60


@pytest.mark.parametrize(("low", "high"), [(-1, 0), (4, 3), (0, 32)])
def test_channels_out_of_range_are_refused(driver: DMM32, low: int, high: int) -> None:
    with pytest.raises(CommandError):
        driver.scan(low, high)


def test_no_board_at_the_base_address(clock: InstantClock) -> None:
    driver = on(DMM32Emulator(staircase, clock, base=0x280), clock)
    with pytest.raises(DeviceMissingError, match=r"No DMM-32 answers at 0x300.*0xFF.*jumper J7"):
        driver.probe()
    with pytest.raises(DeviceMissingError, match="0xFF"):
        driver.scan(0, 6)


def test_something_else_at_the_base_address(clock: InstantClock) -> None:
    class Memory:
        def read(self, port: int, n: int = 1) -> bytes:
            return bytes(n)

        def write(self, port: int, value: int) -> None:
            pass

        def close(self) -> None:
            pass

    with pytest.raises(DeviceMissingError, match="00 00 00 00 00 00 instead of 00 1f 80 60 00 0c"):
        on(Memory(), clock).probe()


def test_differential_jumpers_are_named(board: DMM32Emulator, clock: InstantClock) -> None:
    class Differential(Glitch):
        def read(self, port: int, n: int = 1) -> bytes:
            data = super().read(port, n)
            return bytes((data[0] & ~0x40,)) if port == 0x308 else data

    with pytest.raises(DeviceDataError, match=r"differential.*J5"):
        on(Differential(board, 0, 0), clock).probe()


@pytest.mark.parametrize(("fault", "flag"), [("stuck_wait", "WAIT"), ("stuck_busy", "STS")])
def test_a_board_that_hangs_is_found_all_the_same(
    driver: DMM32, board: DMM32Emulator, fault: str, flag: str
) -> None:
    board.inject(fault)
    with pytest.raises(DeviceTimeoutError, match=rf"{flag}.*off and on"):
        driver.probe()
    board.mend()
    driver.probe()


@pytest.mark.parametrize(
    ("fault", "kind", "words"),
    [
        ("stuck_wait", DeviceTimeoutError, "WAIT"),
        ("stuck_busy", DeviceTimeoutError, "STS"),
        ("overflow", DeviceDataError, "overflowed"),
        ("lost_sample", DeviceDataError, "fewer samples"),
    ],
)
def test_a_faulty_board_is_an_error_and_recovers(
    driver: DMM32, board: DMM32Emulator, fault: str, kind: type[DeviceError], words: str
) -> None:
    board.inject(fault)
    with pytest.raises(kind, match=words):
        driver.scan(0, 6)
    with pytest.raises(kind, match=words):
        driver.scan(3, 3)
    board.mend()
    assert driver.scan(3, 3) == [pytest.approx(staircase(3), abs=1e-4)]


def test_a_stuck_flag_ends_even_on_a_clock_that_stands_still(clock: InstantClock) -> None:
    class Frozen(InstantClock):
        def charge(self, seconds: float) -> None:
            pass

    board = DMM32Emulator(staircase, clock)
    board.inject("stuck_wait")
    with pytest.raises(DeviceTimeoutError):
        on(board, Frozen()).scan(0, 0)


@pytest.mark.parametrize(("low", "high"), [(12, 12), (8, 14)])
@pytest.mark.parametrize("count", [1, 2, 3, 7, 30])
def test_a_board_that_drops_off_the_bus_never_yields_a_wrong_voltage(
    low: int, high: int, count: int
) -> None:
    outcomes: set[type] = set()
    for first in range(60):
        clock = InstantClock()
        board = DMM32Emulator(staircase, clock)
        on(board, clock, range_="±10V").scan(0, 6)
        driver = on(Glitch(board, first, count), clock)
        try:
            volts = driver.scan(low, high)
        except DeviceError as error:
            outcomes.add(type(error))
        else:
            assert volts == [pytest.approx(staircase(n), abs=1e-4) for n in range(low, high + 1)]
            outcomes.add(type(None))
    assert len(outcomes) > 1


def test_ports_that_fail_are_a_sentence(clock: InstantClock) -> None:
    class Refusing:
        def read(self, port: int, n: int = 1) -> bytes:
            raise OSError(errno.EPERM, os.strerror(errno.EPERM))

        def write(self, port: int, value: int) -> None:
            pass

        def close(self) -> None:
            pass

    driver = on(Refusing(), clock)
    for act in (driver.probe, lambda: driver.scan(0, 3)):
        with pytest.raises(DeviceMissingError, match="CAP_SYS_RAWIO"):
            act()
