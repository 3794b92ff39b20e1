"""The registers of the emulated PCA9685, by the data sheet's tables and sequences."""

from __future__ import annotations

import pytest
from smbus2 import i2c_msg

from sim_robot.electronics.pca9685 import PCA9685Emulator
from tests.robot.clocks import InstantClock

AWAKE = 0x21


class Bench:
    def __init__(self) -> None:
        self.clock = InstantClock()
        self.chip = PCA9685Emulator(self.clock)

    def write(self, register: int, *values: int, address: int = 0x40) -> None:
        self.chip.i2c_rdwr(i2c_msg.write(address, [register, *values]))

    def read(self, register: int, count: int = 1) -> bytes:
        data = i2c_msg.read(0x40, count)
        self.chip.i2c_rdwr(i2c_msg.write(0x40, [register]), data)
        return bytes(data)


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def awake(bench: Bench) -> Bench:
    bench.write(0x00, AWAKE)
    return bench


def test_table_4_after_a_reset(bench: Bench) -> None:
    assert bench.read(0x00) == b"\x11"  # asleep, answers to all-call
    assert bench.read(0x01) == b"\x04"  # totem pole
    assert b"".join(bench.read(register) for register in range(2, 6)) == b"\xe2\xe4\xe8\xe0"
    for output in range(16):
        registers = range(6 + 4 * output, 10 + 4 * output)
        assert b"".join(map(bench.read, registers)) == b"\x00\x00\x00\x10"  # full off
    assert bench.read(0xFE) == b"\x1e"  # 200 Hz
    assert bench.chip.pulses() == (0,) * 16


def test_registers_advance_only_when_told(bench: Bench) -> None:
    bench.write(0x02, 0x10, 0x20)
    assert bench.read(0x02) == b"\x20"
    assert bench.read(0x02, 2) == b"\x20\x20"
    bench.write(0x00, AWAKE)
    assert bench.read(0x02, 3) == b"\x20\xe4\xe8"
    assert bench.read(0x45, 2)[1:] == bench.read(0x00)  # rolls over
    assert bench.read(0xFE, 2)[1:] == bench.read(0x00)


def test_prescale_is_written_only_asleep_and_has_a_least_value(bench: Bench) -> None:
    bench.write(0xFE, 121)
    assert bench.chip.tick_us == pytest.approx(4.88)
    bench.write(0xFE, 0)
    assert bench.read(0xFE) == b"\x03"
    bench.write(0x00, AWAKE)
    bench.write(0xFE, 121)
    assert bench.read(0xFE) == b"\x03"


@pytest.mark.parametrize(
    ("registers", "ticks"),
    [
        ((0x00, 0x00, 0x33, 0x01), 307),
        ((0x99, 0x01, 0xCC, 0x04), 819),  # example 1 of 7.3.3: on at 409, off at 1228
        ((0xFF, 0x0E, 0xCC, 0x04), 1228 - 3839 + 4096),  # example 2: off in the next cycle
        ((0x00, 0x10, 0x00, 0x00), 4096),  # full on
        ((0x00, 0x10, 0x00, 0x10), 0),  # full off has the last word
        ((0x00, 0x00, 0x00, 0x00), 0),
    ],
)
def test_the_width_of_a_pulse(awake: Bench, registers: tuple[int, ...], ticks: int) -> None:
    awake.write(0x06 + 4 * 3, *registers)
    assert awake.chip.pulses()[3] == ticks


def test_all_outputs_at_once(awake: Bench) -> None:
    awake.write(0xFA, 0, 0, 100, 0)
    assert awake.chip.pulses() == (100,) * 16
    assert awake.read(0xFA, 4) == bytes(4)  # always read as zero
    awake.write(0xFD, 0x10)
    assert awake.chip.pulses() == (0,) * 16


def test_addresses_that_several_boards_share(awake: Bench) -> None:
    awake.write(0xFA, 0, 0, 100, 0, address=0x70)
    assert awake.chip.pulses()[0] == 100
    with pytest.raises(OSError, match="Remote I/O"):
        awake.write(0x00, AWAKE, address=0x71)
    awake.write(0x00, 0x28)  # sub-address 1, and no all-call
    awake.write(0x00, AWAKE, address=0x71)
    awake.write(0x00, 0x20)
    with pytest.raises(OSError, match="Remote I/O"):
        awake.write(0x00, AWAKE, address=0x70)


def test_a_software_reset_by_the_general_call(awake: Bench) -> None:
    awake.chip.i2c_rdwr(i2c_msg.write(0x00, [0x06]))
    assert awake.read(0x00) == b"\x11"


def doze(bench: Bench) -> None:
    """Output 0 pulses; the chip sleeps, and is woken."""
    bench.write(0x06, 0, 0, 100, 0)
    bench.write(0x00, 0x31)
    assert bench.chip.pulses()[0] == 0
    assert bench.read(0x00) == b"\xb1"
    bench.write(0x00, AWAKE)
    assert bench.chip.pulses()[0] == 0
    assert bench.read(0x00) == b"\xa1"


def test_outputs_that_slept_while_they_pulsed_wait_for_a_restart(awake: Bench) -> None:
    doze(awake)
    awake.write(0x00, AWAKE)  # a zero in bit 7 has no effect
    assert awake.read(0x00) == b"\xa1"
    awake.clock.sleep(500e-6)  # the oscillator must have run so long
    awake.write(0x00, AWAKE | 0x80)
    assert awake.chip.pulses()[0] == 100
    assert awake.read(0x00) == b"\x21"


def test_a_restart_while_the_oscillator_wakes_has_no_effect(awake: Bench) -> None:
    doze(awake)
    awake.write(0x00, AWAKE | 0x80)
    assert awake.read(0x00) == b"\xa1"
    awake.write(0x00, 0x31)
    awake.clock.sleep(1e-3)
    awake.write(0x00, AWAKE | 0x80)  # wakes it and asks for the restart at once
    assert awake.read(0x00) == b"\xa1"
    assert awake.chip.pulses()[0] == 0


def test_a_write_to_an_output_clears_restart_at_the_end_of_its_transfer(awake: Bench) -> None:
    doze(awake)
    mode1 = i2c_msg.read(0x40, 1)
    awake.chip.i2c_rdwr(i2c_msg.write(0x40, [0x0A, 0]), i2c_msg.write(0x40, [0x00]), mode1)
    assert bytes(mode1) == b"\xa1"
    assert awake.read(0x00) == b"\x21"
    assert awake.chip.pulses()[0] == 100


def test_where_outputs_change_with_each_acknowledge_all_four_registers_clear_it(
    awake: Bench,
) -> None:
    awake.write(0x01, 0x0C)
    doze(awake)
    awake.write(0x0A, 0, 0, 0)
    assert awake.read(0x00) == b"\xa1"
    awake.write(0x0A, 0, 0, 0, 0)
    assert awake.read(0x00) == b"\x21"


def test_outputs_that_were_off_when_it_slept_need_no_restart(awake: Bench) -> None:
    awake.write(0x06, 0, 0, 100, 0)
    awake.write(0xFD, 0x10)
    awake.write(0x00, 0x31)
    assert awake.read(0x00) == b"\x31"


def test_the_external_clock_is_chosen_asleep_and_until_a_reset(awake: Bench) -> None:
    awake.write(0x06, 0, 0, 100, 0)
    awake.write(0x00, AWAKE | 0x40)
    assert awake.read(0x00) == b"\x21"
    awake.write(0x00, 0x31)
    awake.write(0x00, 0x71)
    awake.write(0x00, AWAKE)
    assert awake.read(0x00) == b"\xe1"
    assert awake.chip.pulses()[0] == 0  # nothing clocks it
    awake.chip.power_cycle()
    assert awake.read(0x00) == b"\x11"


@pytest.mark.parametrize(
    ("mode2", "pulses", "disabled"),
    [
        (0x04, (100, 0, 4096), 0),
        (0x14, (3996, 4096, 0), 0),  # INVRT
        (0x00, (0, 0, 0), 0),  # open drain, and nothing pulls it up
        (0x05, (100, 0, 4096), 4096),  # OUTNE: high while OE is
        (0x06, (100, 0, 4096), 0),  # or not driven
    ],
)
def test_what_mode2_makes_of_outputs(
    awake: Bench, mode2: int, pulses: tuple[int, ...], disabled: int
) -> None:
    awake.write(0x06, 0, 0, 100, 0)
    awake.write(0x0E, 0, 0x10, 0, 0)
    awake.write(0x01, mode2)
    assert awake.chip.pulses()[:3] == pulses
    awake.chip.drive_enable(True)
    assert set(awake.chip.pulses()) == {disabled}
    assert awake.read(0x01) == bytes([mode2])


@pytest.mark.parametrize(
    ("event", "registers", "pulses"),
    [
        ("reset", b"\x1e\x11\x04", (0, 0)),
        ("sleep", b"\x1e\xb1\x04", (0, 0)),
        ("doze", b"\x1e\xa1\x04", (0, 0)),
        ("prescale=60", b"\x3c\x21\x04", (100, 0)),
        ("mode2=20", b"\x1e\x21\x14", (3996, 4096)),
        ("moved=1", b"\x1e\x21\x04", (100, 307)),
        ("full_on=1", b"\x1e\x21\x04", (100, 4096)),
        ("all_off", b"\x1e\x21\x04", (0, 0)),
    ],
)
def test_what_another_program_does_is_in_the_registers_and_is_no_command(
    awake: Bench, event: str, registers: bytes, pulses: tuple[int, ...]
) -> None:
    awake.write(0x06, 0, 0, 100, 0)
    moves: list[tuple[int, int, int]] = []
    awake.chip.on_pulse = lambda *move: moves.append(move)
    name, _, number = event.partition("=")
    awake.chip.inject(name, int(number or 0))
    assert awake.chip.pulses()[:2] == pulses
    assert b"".join(map(awake.read, (0xFE, 0x00, 0x01))) == registers
    assert not moves


def test_a_tick_is_as_long_as_the_oscillator_is_slow() -> None:
    chip = PCA9685Emulator(InstantClock(), oscillator_mhz=23.0)
    assert chip.tick_us == pytest.approx(31 / 23)


def test_outputs_change_together_at_the_end_of_a_transfer(awake: Bench) -> None:
    moves: list[tuple[int, int, int]] = []
    awake.chip.on_pulse = lambda *move: moves.append(move)
    awake.chip.receive(bytes((0x06, 0, 0, 100, 0)))
    assert not moves
    awake.chip.stop()
    assert moves == [(0, 0, 100)]
    awake.chip.power_cycle()
    assert len(moves) == 1


def test_reserved_registers_are_not_acknowledged(awake: Bench) -> None:
    for register in (0x46, 0xF9):
        with pytest.raises(OSError, match="Remote I/O"):
            awake.write(register)
