"""The PCA9685's driver against the emulated board."""

from __future__ import annotations

import math
import os
from pathlib import Path

import pytest
from smbus2 import i2c_msg

from robot.drivers.buses import Buses
from robot.drivers.servos.pca9685 import PCA9685, PCA9685Settings
from robot.errors import (
    CommandError,
    ConfigError,
    DeviceDataError,
    DeviceMissingError,
    DeviceTimeoutError,
)
from robot.toml_sections import toml_section
from sim_robot.electronics.i2c_bus import I2CBus
from sim_robot.electronics.pca9685 import PCA9685Emulator
from tests.robot.clocks import InstantClock

MIDDLE = 307  # 1.5 ms at 50 Hz


def settings(text: str = "") -> PCA9685Settings:
    return PCA9685Settings.read(toml_section(f"[servos]\n{text}", "robot.toml").table("servos"))


class Bench:
    """Two boards on a bus."""

    def __init__(self) -> None:
        self.clock = InstantClock()
        self.boards = [PCA9685Emulator(self.clock, address=one) for one in (0x40, 0x41)]
        self.settings = settings("address = [0x40, 0x41]")
        self.bus = I2CBus(self.boards, self.clock)
        self.servos = self.open()

    def open(self) -> PCA9685:
        return self.settings.open(Buses(clock=self.clock, open_i2c=lambda path: self.bus))


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_board_fresh_from_its_reset_is_set_up_with_all_outputs_off(bench: Bench) -> None:
    assert bench.servos.read_counts([0, 15, 16]) == {0: 0, 15: 0, 16: 0}
    assert bench.boards[0].tick_us == pytest.approx(4.88)
    assert bench.boards[0].pulses() == (0,) * 16


def test_outputs_get_the_pulses_that_they_are_sent_on_every_board(bench: Bench) -> None:
    bench.servos.read_counts([0])
    bench.servos.set_counts({0: 103, 15: 512, 17: MIDDLE})
    assert (bench.boards[0].pulses()[0], bench.boards[0].pulses()[15]) == (103, 512)
    assert bench.boards[1].pulses() == (0, MIDDLE) + (0,) * 14
    assert bench.servos.read_counts([0, 17, 18]) == {0: 103, 17: MIDDLE, 18: 0}
    assert bench.servos.verify({0: 103, 17: MIDDLE}) == []
    assert bench.servos.verify({0: 104, 17: MIDDLE}) == [0]


def test_an_update_lasts_a_pulse_and_no_longer_than_it_says(bench: Bench) -> None:
    bench.servos.read_counts([0])
    before = bench.clock.now()
    bench.servos.set_counts(dict.fromkeys(range(8), MIDDLE))
    took = bench.clock.now() - before
    assert bench.settings.period <= took <= bench.servos.seconds_for(8)


def test_nothing_moves_before_the_boards_were_read(bench: Bench) -> None:
    with pytest.raises(CommandError, match="read the servo board"):
        bench.servos.set_counts({0: MIDDLE})


@pytest.mark.parametrize("count", [0, 102, 513, 4096])
def test_no_pulse_is_shorter_than_500_or_longer_than_2500_microseconds(
    bench: Bench, count: int
) -> None:
    bench.servos.read_counts([0])
    with pytest.raises(CommandError, match="must lie in 103 to 512"):
        bench.servos.set_counts({0: MIDDLE, 1: count})
    assert bench.boards[0].pulses() == (0,) * 16


def test_a_board_that_outlived_its_daemon_is_read_back_and_goes_on(bench: Bench) -> None:
    bench.servos.read_counts([0])
    bench.servos.set_counts({3: 400})
    bench.servos.close()
    again = bench.open()
    assert again.read_counts([2, 3, 4]) == {2: 0, 3: 400, 4: 0}
    again.release([2])
    assert bench.boards[0].pulses()[3] == 400


def test_an_output_that_is_let_go_leaves_those_on_that_an_earlier_driver_left_on(
    bench: Bench,
) -> None:
    bench.servos.read_counts([3])
    bench.servos.set_counts({3: 400})
    bench.servos.close()
    again = bench.open()
    again.read_counts([15])
    again.set_counts({15: MIDDLE})
    again.release([15])
    assert bench.boards[0].pulses()[3] == 400


@pytest.mark.parametrize("ticks", [50, 600, 4096])
def test_a_board_with_pulses_that_no_servo_knows_is_switched_off(bench: Bench, ticks: int) -> None:
    bench.servos.read_counts([0])
    bench.boards[0].receive(bytes((6 + 4 * 5, 0, ticks >> 8 & 0x10, ticks & 0xFF, ticks >> 8 & 15)))
    bench.boards[0].stop()
    assert bench.boards[0].pulses()[5] == ticks
    assert bench.open().read_counts([5]) == {5: 0}


ALTERED = (
    ("reset", 0, "PRE_SCALE is 0x1e instead of 0x79, MODE1 is 0x11 instead of 0x21"),
    ("sleep", 0, "MODE1 is 0xb1 instead of 0x21; its outputs are off and the joints limp"),
    ("doze", 0, "MODE1 is 0xa1 instead of 0x21; its outputs are off and the joints limp"),
    ("prescale", 60, "PRE_SCALE is 0x3c instead of 0x79; its pulses are 0.50 times as long"),
    ("prescale", 255, "its pulses are 2.10 times as long"),
    ("mode2", 0x14, "MODE2 is 0x14 instead of 0x04"),
    ("mode2", 0x0C, "MODE2 is 0x0c instead of 0x04"),
)
"""What leaves no board as it was set up, and what is said of it."""


class Alteration:
    """Two boards with pulses; the second is about to be altered."""

    def __init__(self, bench: Bench):
        self.servos = bench.servos
        self.board = bench.boards[1]
        self.commands: list[tuple[int, int, int]] = []
        self.servos.read_counts([0])
        self.servos.set_counts({0: MIDDLE, 17: 400, 18: 110})
        for board in bench.boards:
            board.on_pulse = lambda *move: self.commands.append(move)

    def make(self, event: str, number: int) -> None:
        self.board.inject(event, number)
        self.after = self.board.pulses()


@pytest.mark.parametrize(("event", "number", "words"), ALTERED)
def test_a_board_that_does_not_run_as_it_was_set_up_is_noticed_and_nothing_is_written(
    bench: Bench, event: str, number: int, words: str
) -> None:
    alteration = Alteration(bench)
    alteration.make(event, number)
    with pytest.raises(DeviceDataError, match="0x41 does not run as it was set up: ") as caught:
        bench.servos.set_counts({0: MIDDLE + 1})  # not even on the board that is in order
    assert words in caught.value.message
    with pytest.raises(CommandError):
        bench.servos.set_counts({17: 401})
    with pytest.raises(DeviceDataError):
        bench.servos.verify({0: MIDDLE})
    assert bench.boards[1].pulses() == alteration.after
    assert not alteration.commands
    # As at power-up: set up anew, with all outputs off.
    assert bench.servos.read_counts([0, 17, 18]) == {0: MIDDLE, 17: 0, 18: 0}
    assert all(after % 4096 == 0 for _, _, after in alteration.commands)
    bench.servos.set_counts({17: 400})
    assert bench.boards[1].pulses() == (0, 400) + (0,) * 14
    assert bench.boards[1].tick_us == pytest.approx(4.88)


@pytest.mark.parametrize(("event", "number", "words"), ALTERED)
def test_every_comparison_notices_it_also_of_an_output_that_is_as_it_was(
    bench: Bench, event: str, number: int, words: str
) -> None:
    Alteration(bench).make(event, number)
    with pytest.raises(DeviceDataError, match="0x41 does not run as it was set up: ") as caught:
        bench.servos.verify({0: MIDDLE})
    assert words in caught.value.message


@pytest.mark.parametrize(
    ("event", "number", "outputs"),
    [("moved", 1, [17]), ("full_on", 2, [18]), ("all_off", 0, [17, 18])],
)
def test_a_pulse_that_another_program_changed_is_noticed_and_nothing_is_written(
    bench: Bench, event: str, number: int, outputs: list[int]
) -> None:
    alteration = Alteration(bench)
    alteration.make(event, number)
    named = ", ".join(map(str, outputs))
    with pytest.raises(DeviceDataError, match=f"not have the commands for outputs? {named}: an"):
        bench.servos.set_counts({0: MIDDLE + 1})
    assert bench.servos.verify({0: MIDDLE, 17: 400, 18: 110}) == outputs
    assert bench.boards[1].pulses() == alteration.after
    assert not alteration.commands


def test_outputs_without_a_joint_are_another_programs_to_use(bench: Bench) -> None:
    alteration = Alteration(bench)
    alteration.make("moved", 15)
    bench.servos.set_counts({17: 401})
    assert bench.boards[1].pulses() == (0, 401, 110, *(0,) * 12, MIDDLE)


def test_what_is_changed_between_the_reading_and_the_move_is_found_by_that_move(
    bench: Bench,
) -> None:
    Alteration(bench)
    carry, transfers = bench.bus.i2c_rdwr, 0

    def doze_before_the_move(*messages: i2c_msg) -> None:
        nonlocal transfers
        transfers += 1
        if transfers == 3:  # two boards were read
            bench.boards[0].inject("doze")
        carry(*messages)

    bench.bus.i2c_rdwr = doze_before_the_move  # type: ignore[method-assign]
    with pytest.raises(DeviceDataError, match="MODE1 is 0xa1"):
        bench.servos.set_counts({0: MIDDLE + 1})


def test_a_reading_that_was_damaged_is_made_again(bench: Bench) -> None:
    bench.servos.read_counts([0])
    bench.servos.set_counts({0: MIDDLE})
    send, damaged = bench.boards[0].send, [0, 9]  # a byte of the settings, then one of a count

    def damage(count: int) -> bytes:
        data = bytearray(send(count))
        if count > 1 and damaged:
            data[damaged.pop(0)] ^= 0x20
        return bytes(data)

    bench.boards[0].send = damage  # type: ignore[method-assign]
    assert bench.servos.verify({0: MIDDLE}) == []
    assert not damaged


def test_an_address_at_which_it_answers_that_another_program_changed(bench: Bench) -> None:
    bench.servos.read_counts([0])
    bench.servos.set_counts({0: MIDDLE})
    bench.bus.i2c_rdwr(i2c_msg.write(0x40, [0x05, 0xE8]))
    with pytest.raises(DeviceDataError, match="ALLCALLADR is 0xe8 instead of 0xe0"):
        bench.servos.set_counts({0: MIDDLE + 1})
    assert bench.boards[0].pulses()[0] == MIDDLE
    with pytest.raises(DeviceMissingError, match="switch the board's supply off and on"):
        bench.servos.read_counts([0])


def test_an_external_clock_stays_until_the_supply_is_switched_off(bench: Bench) -> None:
    bench.servos.read_counts([0])
    for mode1 in (0x31, 0x71, 0x21):
        bench.bus.i2c_rdwr(i2c_msg.write(0x40, [0x00, mode1]))
    with pytest.raises(DeviceDataError, match="MODE1 is 0x61 instead of 0x21"):
        bench.servos.verify({0: 0})
    with pytest.raises(DeviceDataError, match=r"keep its settings: MODE1 is 0x61.*switched off"):
        bench.servos.read_counts([0])
    bench.boards[0].power_cycle()
    assert bench.servos.read_counts([0]) == {0: 0}


def test_a_write_that_was_lost_is_found_out(bench: Bench) -> None:
    bench.servos.read_counts([0])
    bench.boards[0].inject("lost", 3)
    bench.servos.set_counts({0: MIDDLE, 1: MIDDLE})
    assert bench.servos.verify({0: MIDDLE, 1: MIDDLE})
    with pytest.raises(DeviceDataError, match="or writes were lost"):
        bench.servos.set_counts({0: MIDDLE + 1})


def test_a_transfer_that_nobody_acknowledged_is_made_again(bench: Bench) -> None:
    bench.servos.read_counts([0])
    bench.boards[0].inject("nak", 3)
    bench.servos.set_counts({0: MIDDLE})
    assert bench.servos.read_counts(range(8)) == {0: MIDDLE} | dict.fromkeys(range(1, 8), 0)
    assert bench.servos.repeats > 0


@pytest.mark.parametrize(
    ("fault", "error"), [("nak", DeviceMissingError), ("hang", DeviceTimeoutError)]
)
def test_a_dead_bus_is_a_sentence(bench: Bench, fault: str, error: type[Exception]) -> None:
    bench.servos.read_counts([0])
    bench.boards[0].inject(fault)
    for action in (
        lambda: bench.servos.set_counts({0: MIDDLE}),
        lambda: bench.servos.read_counts([0]),
        lambda: bench.servos.release([0]),
    ):
        with pytest.raises(error, match=r"0x40 \(PCA9685\)"):
            action()


def test_all_outputs_off_takes_one_transfer_and_reaches_a_board_that_does_not_answer(
    bench: Bench,
) -> None:
    bench.servos.read_counts([0])
    bench.servos.set_counts({0: MIDDLE, 20: MIDDLE})
    deaf, answers = bench.boards[1], bench.boards[1].answers
    deaf.answers = lambda address: address != 0x41 and answers(address)  # type: ignore[method-assign]
    with pytest.raises(DeviceMissingError):
        bench.servos.release([0, 20])
    assert [any(board.pulses()) for board in bench.boards] == [False, False]


def test_one_of_several_outputs_is_released_alone(bench: Bench) -> None:
    bench.servos.read_counts([0])
    bench.servos.set_counts({0: MIDDLE, 1: MIDDLE, 20: MIDDLE})
    bench.servos.release([1])
    assert bench.servos.read_counts([0, 1, 20]) == {0: MIDDLE, 1: 0, 20: MIDDLE}


@pytest.mark.parametrize("output", [-1, 32])
def test_outputs_that_the_boards_do_not_have(bench: Bench, output: int) -> None:
    bench.servos.read_counts([0])
    for action in (
        lambda: bench.servos.set_counts({output: MIDDLE}),
        lambda: bench.servos.read_counts([output]),
        lambda: bench.servos.release([output]),
    ):
        with pytest.raises(CommandError, match="outputs 0 to 31"):
            action()


class FileBus:
    """An emulated bus with a file, as a real one has."""

    def __init__(self, bus: I2CBus, path: Path):
        self._bus = bus
        self.fd = os.open(path, os.O_RDWR | os.O_CREAT)

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        self._bus.i2c_rdwr(*messages)

    def close(self) -> None:
        os.close(self.fd)


def test_two_programs_cannot_drive_the_same_servos(bench: Bench, tmp_path: Path) -> None:
    buses = Buses(
        clock=bench.clock, open_i2c=lambda path: FileBus(bench.bus, tmp_path / Path(path).name)
    )
    first = bench.settings.open(buses)
    with pytest.raises(DeviceMissingError, match="Another program drives the servos") as caught:
        bench.settings.open(buses)
    assert isinstance(caught.value.__cause__, BlockingIOError)  # by which the doctor knows it
    first.reopen()
    first.close()
    bench.settings.open(buses).close()


def test_another_chip_at_the_address_is_named() -> None:
    clock = InstantClock()
    board = PCA9685Emulator(clock)
    board.receive(bytes((0x02, 0x10)))
    with pytest.raises(
        DeviceMissingError, match=r"0x40 is no PCA9685: its registers 2 to 5 hold 10.*supply off"
    ):
        settings().open(Buses(clock=clock, open_i2c=lambda path: board))


@pytest.mark.parametrize(
    ("rate", "kind", "counts", "actual"),
    [
        (50, "analogue", (103, 512), 50.03),
        (40, "analogue", (82, 408), 39.9),
        (60, "analogue", (123, 612), 59.8),
        (333, "digital", (695, 3472), 339.1),
    ],
)
def test_counts_are_pulse_widths_at_the_update_rate(
    rate: float, kind: str, counts: tuple[int, int], actual: float
) -> None:
    found = settings(f'update_hz = {rate}\nservos = "{kind}"')
    assert (found.counts[0], found.counts[-1]) == counts
    assert 1 / found.period == pytest.approx(actual, abs=0.1)
    widths = [count * found.ticks_us[0] for count in counts]
    assert widths[0] >= 500
    assert widths[1] <= 2500
    assert math.isclose(widths[1], 2500, abs_tol=5)


@pytest.mark.parametrize("mhz", [(23.0, 23.0), (25.0, 25.0), (26.94, 26.94), (23.4, 26.1)])
@pytest.mark.parametrize("pulse_us", ["500, 2500", "1000, 2000"])
def test_no_pulse_is_narrower_or_wider_than_configured_whatever_the_oscillators(
    mhz: tuple[float, float], pulse_us: str
) -> None:
    clock = InstantClock()
    boards = [
        PCA9685Emulator(clock, address=address, oscillator_mhz=one)
        for address, one in zip((0x40, 0x41), mhz, strict=True)
    ]
    bus = I2CBus(boards, clock)
    found = settings(
        f"address = [0x40, 0x41]\npulse_us = [{pulse_us}]\noscillator_mhz = {list(mhz)}"
    )
    servos = found.open(Buses(clock=clock, open_i2c=lambda path: bus))
    servos.read_counts([0])
    low, high = found.widths_us
    slowest, fastest = (max(found.ticks_us), min(found.ticks_us))
    for count in (found.counts[0], found.counts[-1]):
        servos.set_counts({0: count, 16: count})
        for board in boards:
            assert low <= board.pulses()[0] * board.tick_us <= high
    assert (found.counts[0] - 1) * fastest < low  # and no count is given away
    assert (found.counts[-1] + 1) * slowest > high
    assert found.period == pytest.approx(max(4096e-6 * board.tick_us for board in boards))


def test_an_oscillator_that_is_measured_later_makes_no_count_another_pulse() -> None:
    before, after = settings(), settings("oscillator_mhz = 26.94")
    assert after.prescale == before.prescale == 121
    assert "not measured" in str(before)
    assert "counts of 4.53 µs" in str(after)
    assert "not measured" not in str(after)
    hz = 26.94e6 / 4096 / 122
    assert before.oscillator(hz) == pytest.approx(26.94)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("update_hz = 200", "servos.update_hz: is 200, and an analogue servo follows 40 to 60"),
        ("update_hz = 400\nservos = 'digital'", "from 40 to 333 hertz, not 400"),
        ("pulse_us = [400, 2500]", "servos.pulse_us: must be a number from 500 to 2500 micro"),
        ("pulse_us = [500, 2600]", "from 500 to 2500 microseconds, not 2600"),
        ("pulse_us = [2000, 1000]", "must rise, not 2000 to 1000"),
        (
            "address = [0x40, 0x40]",
            "servos.address: must be an integer from 0x40 to 0x7f, or different ones",
        ),
        ("address = [0x30]", "as in [0x41, 0x42], not [0x30]"),
        ("address = [0x70]", "must leave out 0x70"),
        ("address = []", "servos.address"),
        ("address = 20", "servos.address"),
        ("servos = 'steppers'", "servos.servos: must be one of analogue, digital"),
        ("oscillator_mhz = 250", "oscillator_mhz: must be a number from 22 to 28 megahertz, not"),
        (
            "address = [0x40, 0x41]\noscillator_mhz = 25",
            "oscillator_mhz: must be an array of 2 numbers, not 25",
        ),
    ],
)
def test_a_wrong_value_is_named(text: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        settings(text)
    assert str(caught.value).startswith("robot.toml: servos.")
    assert words in str(caught.value)
