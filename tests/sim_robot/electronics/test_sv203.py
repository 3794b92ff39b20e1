from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import cast

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from robot.errors import CommandError
from sim_robot.electronics.serial_device import Follower
from sim_robot.electronics.sv203 import Board, SV203Emulator

NEUTRAL = (128,) * 8


@pytest.fixture
def emulator() -> Iterator[SV203Emulator]:
    board = SV203Emulator()
    yield board
    board.close()


def after(*lines: bytes) -> Board:
    board = Board()
    for line in lines:
        board.receive(line + b"\r")
    return board


def first(board: Board) -> int:
    return board.pulses[0]


def test_powers_up_at_neutral_and_deaf() -> None:
    assert after().pulses == NEUTRAL
    assert after(b"SV1M20").pulses == NEUTRAL
    assert after(b"BD2SV1M20").pulses == NEUTRAL


@pytest.mark.parametrize("wake", [b"BD1", b"BD0"])
def test_wakes_by_its_number_or_zero(wake: bytes) -> None:
    assert first(after(wake + b"SV1M20")) == 20


def test_another_board_being_selected_deselects_it() -> None:
    assert first(after(b"BD1", b"SV1M20", b"BD2", b"SV1M30")) == 20


def test_nothing_happens_before_the_carriage_return() -> None:
    board = Board()
    board.receive(b"BD1SV1M20")
    assert first(board) == 128
    board.receive(b"\r\n")
    assert first(board) == 20


def test_selections_stay_in_force() -> None:
    assert after(b"BD1SV3", b"M20").pulses[2] == 20


@pytest.mark.parametrize("line", [b"BD1 SV1 M20", b"BD1,SV1,M20", b"BD 1SV 1M 20"])
def test_separators(line: bytes) -> None:
    assert first(after(line)) == 20


def test_lines_of_more_than_20_characters_are_void() -> None:
    assert first(after(b"BD1 SV1 SV1 SV1  M20")) == 20
    assert first(after(b"BD1 SV1 SV1 SV1   M20")) == 128


@pytest.mark.parametrize(
    "line", [b"BD1SV1M256", b"BD1SV9M20", b"BD1SV1M-1", b"BD1SV0M5", b"BD1SV1M"]
)
def test_what_is_out_of_range_is_ignored(line: bytes) -> None:
    assert after(line).pulses == NEUTRAL


def test_relative_moves_and_limp() -> None:
    assert first(after(b"BD1SV1M20I-5")) == 15
    assert first(after(b"BD1SV1M20I127I127")) == 147
    assert first(after(b"BD1SV1M0")) == 0


def test_ram_51_to_58_are_the_servos() -> None:
    board = after(b"BD1WR51 20", b"SV2M77")
    assert first(board) == 20
    assert board.receive(b"RR52\r") == b"77\r"
    assert board.receive(b"RR51 RR52\r") == b"20\r77\r"


def test_other_cells_keep_what_is_written() -> None:
    board = after(b"BD1WR100 9WE20 200")
    assert board.receive(b"RR100RE20\r") == b"9\r200\r"
    assert board.receive(b"RE9\r") == b"50\r"  # 9600 baud, as it leaves the factory


def test_analogue_inputs_answer_in_decimal() -> None:
    board = after(b"BD1")
    board.analogue[4] = 137
    assert board.receive(b"AD5\r") == b"137\r"
    assert board.receive(b"AD6\r") == b""


def test_pins_carry_no_pulses() -> None:
    assert after(b"BD1PS3").pulses[2] == 0
    assert after(b"BD1PS3PC3PT3SV3M9").pulses[2] == 9


def test_a_brown_out_forgets_everything_but_the_eeprom() -> None:
    board = after(b"BD1SV1M20WE20 7")
    board.power_up()
    assert board.pulses == NEUTRAL
    assert board.receive(b"RR51\r") == b""
    assert board.receive(b"BD1RE20\r") == b"7\r"


@given(st.lists(st.binary(max_size=30) | st.from_regex(rb"(BD|SV|M|I|WR|RR|PS)[0-9 ]{0,4}\r?")))
def test_garbage_never_breaks_the_board(chunks: list[bytes]) -> None:
    board = Board()
    for chunk in chunks:
        board.receive(chunk)
    assert len(board.pulses) == 8
    assert all(0 <= count <= 255 for count in board.pulses)
    assert board.receive(b"\rBD1SV1M20RR51\r").endswith(b"20\r")


def test_pyserial_talks_to_it(emulator: SV203Emulator) -> None:
    with serial.Serial(emulator.port, 9600, timeout=120.0, exclusive=True) as line:
        line.write(b"BD1SV1M20RR51\r")
        assert line.read_until(b"\r") == b"20\r"
        assert emulator.bytes_read == 14
    assert emulator.pulses()[0] == 20


def test_waiting_sees_the_effect_of_the_bytes(emulator: SV203Emulator) -> None:
    with serial.Serial(emulator.port, 9600) as line:
        for count in range(1, 100):
            line.write(b"BD1SV1M%03d\r" % count)
            assert emulator.wait_until_read(11 * count, 5.0)
            assert emulator.pulses()[0] == count
    assert not emulator.wait_until_read(10**6, 0.01)


def test_an_idle_emulator_costs_no_time(emulator: SV203Emulator) -> None:
    assert emulator.bytes_read == 0
    before = time.process_time()
    time.sleep(0.2)
    assert time.process_time() - before < 0.02


def test_unplugging_wakes_those_who_wait(emulator: SV203Emulator) -> None:
    waited: list[bool] = []
    waiter = threading.Thread(target=lambda: waited.append(emulator.wait_until_read(5, 30.0)))
    waiter.start()
    emulator.unplug()
    waiter.join(10.0)
    assert waited == [True]


def test_the_name_survives_unplugging_and_the_pose_too(emulator: SV203Emulator) -> None:
    with serial.Serial(emulator.port) as line:
        line.write(b"BD1SV1M20\r")
        assert emulator.wait_until_read(10, 5.0)
        emulator.unplug()
        emulator.unplug()
        with pytest.raises(serial.SerialException):
            line.write(b"BD1SV1M30\r")
    assert not Path(emulator.port).exists()
    emulator.replug()
    emulator.replug()
    assert emulator.bytes_read == 10
    with serial.Serial(emulator.port, timeout=120.0) as line:
        line.write(b"BD1RR51\r")
        assert line.read_until(b"\r") == b"20\r"


def test_nothing_stays_behind() -> None:
    threads = threading.active_count()
    emulator = SV203Emulator()
    folder = Path(emulator.port).parent
    emulator.close()
    emulator.close()
    assert not folder.exists()
    assert threading.active_count() == threads


@pytest.mark.parametrize(
    ("fault", "sent", "count"),
    [("drop", b"BD1SV1M25\r", 5), ("corrupt", b"BD1SV1M20\r", 30)],
)
def test_bytes_are_lost_or_altered(
    emulator: SV203Emulator, fault: str, sent: bytes, count: int
) -> None:
    emulator.inject(fault, 8)  # the eighth byte is the first digit of the count
    with serial.Serial(emulator.port) as line:
        line.write(sent)
        assert emulator.wait_until_read(len(sent), 5.0)
    assert emulator.pulses()[0] == count


def test_unknown_faults_are_refused(emulator: SV203Emulator) -> None:
    with pytest.raises(CommandError, match="drop, corrupt, mute, garbage"):
        emulator.inject("gremlin")
    emulator.inject("mute")
    assert emulator.faults == {"mute": 0}
    emulator.mend("mute")
    assert emulator.faults == {}


KILLED = """
import os, signal
from sim_robot.electronics.sv203 import SV203Emulator
print(SV203Emulator().port, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_the_port_of_one_that_was_killed_is_removed_by_the_next(emulator: SV203Emulator) -> None:
    done = subprocess.run(
        [sys.executable, "-c", KILLED], capture_output=True, text=True, check=False, timeout=120
    )
    left = Path(done.stdout.strip())
    assert left.is_symlink()
    SV203Emulator().close()
    assert not left.parent.exists()
    assert Path(emulator.port).exists()  # it lives


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
    return Follower(cast(SV203Emulator, wires), wires)


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
