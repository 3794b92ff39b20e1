"""The emulated Feetech servos, held to their table; the maker's library speaks to them."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import Any

import pytest
import serial

from robot.drivers.servos.servo_packets import Instruction, Packet
from sim_robot.electronics import feetech
from sim_robot.electronics.bus_servos import BOOT, LIMP
from sim_robot.electronics.feetech import FeetechEmulator, Servo
from sim_robot.electronics.servos import Felt
from tests.robot.clocks import InstantClock


@pytest.fixture
def clock() -> InstantClock:
    return InstantClock()


@pytest.fixture
def bus(clock: InstantClock) -> Iterator[FeetechEmulator]:
    emulator = FeetechEmulator((1, 2, 7))
    emulator.feel(lambda: [Felt(2048, 0.0), Felt(1500, -0.25), Felt(2600, 0.0)])
    emulator.connect(clock)
    yield emulator
    emulator.close()


@pytest.fixture
def servo() -> Servo:
    return Servo(1)


def written(servo: Servo, address: int, *data: int) -> bytes | None:
    answer = servo.answer(Packet(1, Instruction.WRITE, bytes((address, *data))))
    return None if answer is None else bytes((answer.instruction,))


def read(servo: Servo, address: int, count: int = 2) -> bytes:
    answer = servo.answer(Packet(1, Instruction.READ, bytes((address, count))))
    assert answer is not None
    return answer.parameters


class Host:
    """Asks the emulator over its port; bytes as in the protocol manual."""

    def __init__(self, bus: FeetechEmulator, baud: int = 1_000_000):
        self._line = serial.Serial(bus.port, baud, timeout=60.0)

    def ask(self, text: str) -> str:
        """What comes before the answer to a ping of servo 7."""
        end = bytes.fromhex("FF FF 07 02")
        self._line.write(bytes.fromhex(text) + end + b"\x01\xf5")
        answers = self._line.read_until(end).removesuffix(end)
        self._line.read(2)  # its error and checksum
        return answers.hex(" ").upper()

    def close(self) -> None:
        self._line.close()


@pytest.fixture
def host(bus: FeetechEmulator) -> Iterator[Host]:
    line = Host(bus)
    yield line
    line.close()


@pytest.mark.parametrize(
    ("asked", "answered"),
    [
        ("FF FF 01 02 01 FB", "FF FF 01 02 00 FC"),  # ping
        ("FF FF 01 04 02 38 02 BE", "FF FF 01 04 00 00 08 F2"),  # present position: 2048
        ("FF FF 02 04 02 3C 02 B9", "FF FF 02 04 00 00 00 F9"),  # load of a limp one
        ("FF FF 01 04 02 03 02 F3", "FF FF 01 04 00 09 03 EE"),  # model 777
        ("FF FF 03 02 01 F9", ""),  # nobody
        ("FF FF 01 02 01 FA", ""),  # wrong checksum
        ("FF FF 01 04 03 28 01 CE", "FF FF 01 02 00 FC"),  # torque on
        (
            "FF FF FE 06 82 38 02 01 02 3C",
            "FF FF 01 04 00 00 08 F2 FF FF 02 04 00 DC 05 18",
        ),  # sync read of two positions
        ("FF FF FE 08 83 28 01 01 01 07 01 43", ""),  # sync write, which nobody answers
        ("00 FF FF FF 01 02 01 FB", "FF FF 01 02 00 FC"),  # noise before it
    ],
)
def test_packets_are_answered_as_in_the_manual(host: Host, asked: str, answered: str) -> None:
    assert host.ask(asked) == answered


def test_a_servo_listens_at_its_own_baud_rate(bus: FeetechEmulator) -> None:
    bus.servos[2].memory[feetech.BAUD] = 4
    slow = Host(bus, 115_200)
    assert slow.ask("FF FF 01 02 01 FB") == ""
    bus.servos[0].memory[feetech.BAUD] = 4
    assert slow.ask("FF FF 01 02 01 FB") == "FF FF 01 02 00 FC"
    slow.close()


def test_a_goal_switches_the_torque_on_and_is_cut_to_the_limits_in_secret(servo: Servo) -> None:
    assert servo.driven_to() == LIMP
    servo.set_word(feetech.MIN_ANGLE, 1000)
    written(servo, feetech.GOAL, 0x10, 0x00)
    assert servo.memory[feetech.TORQUE] == 1
    assert read(servo, feetech.GOAL) == b"\x10\x00"
    assert servo.driven_to() == 1000


def test_a_reset_wipes_out_what_is_not_permanent(servo: Servo) -> None:
    servo.feel(Felt(1234.4, 0.0))
    written(servo, feetech.ACCELERATION, 213, 0x00, 0x08)
    servo.power_up()
    assert servo.memory[feetech.ACCELERATION] == 0
    assert servo.word(feetech.GOAL) == 1234
    assert servo.driven_to() == LIMP
    assert servo.answer(Packet(1, Instruction.READ, bytes((56, 2)))) is None  # deaf as yet
    servo.now = lambda: BOOT
    assert read(servo, feetech.POSITION) == (1234).to_bytes(2, "little")


@pytest.mark.parametrize(("position", "goal"), [(-5.0, 0), (4100.0, 4095)])
def test_a_reset_beyond_the_turn_leaves_a_goal_in_it(
    servo: Servo, position: float, goal: int
) -> None:
    servo.feel(Felt(position, 0.0))
    servo.power_up()
    assert servo.word(feetech.GOAL) == goal


def test_the_permanent_memory_keeps_nothing_while_it_is_locked(servo: Servo) -> None:
    written(servo, feetech.MODE, 1)
    assert (servo.memory[feetech.MODE], servo.permanent_writes) == (1, 1)
    servo.power_up()
    assert servo.memory[feetech.MODE] == 0
    written(servo, feetech.POSITION, 1, 2)  # can only be read
    servo.now = lambda: 1.0
    assert read(servo, feetech.POSITION) == b"\x00\x08"


@pytest.mark.parametrize(
    ("fault", "status", "limp"), [("hot", 0x04, True), ("dip", 0x01, False), ("overload", 32, True)]
)
def test_each_answer_says_what_is_wrong(
    bus: FeetechEmulator, host: Host, fault: str, status: int, *, limp: bool
) -> None:
    host.ask("FF FF 01 04 03 28 01 CE")
    bus.inject(fault, 0 if fault == "dip" else 1)
    assert host.ask("FF FF 01 02 01 FB")[12:14] == f"{status:02X}"
    assert (bus.pulses()[0] == LIMP) == limp


@pytest.mark.parametrize(
    ("torque", "goal", "load", "current"),
    [(0.25, 2048, 250, 92), (-0.25, 2048, 250 | 1 << 10, 92), (0.0, 2600, 1000, 0)],
)
def test_load_is_the_drive_and_has_its_sign_in_bit_10(
    servo: Servo, torque: float, goal: int, load: int, current: int
) -> None:
    servo.feel(Felt(2048, torque))
    written(servo, feetech.GOAL, *goal.to_bytes(2, "little"))
    assert read(servo, feetech.LOAD) == load.to_bytes(2, "little")
    assert read(servo, feetech.CURRENT) == current.to_bytes(2, "little")  # 6.5 mA


def test_a_position_below_zero_has_its_sign_in_bit_15(servo: Servo) -> None:
    servo.feel(Felt(-3.2, 0.0))
    assert read(servo, feetech.POSITION) == (3 | 1 << 15).to_bytes(2, "little")


def test_the_makers_library_speaks_with_them(bus: FeetechEmulator, clock: InstantClock) -> None:
    sdk: Any = importlib.import_module("scservo_sdk")
    port = sdk.PortHandler(bus.port)
    packets = sdk.PacketHandler(0)
    port.isPacketTimeout = lambda: False  # by the wall clock, on a computer that may be busy
    assert port.setBaudRate(1_000_000)
    try:
        assert packets.ping(port, 2) == (777, 0, 0)
        assert packets.write2ByteTxRx(port, 1, feetech.GOAL, 1000) == (0, 0)
        goals = sdk.GroupSyncWrite(port, packets, feetech.GOAL, 2)
        assert goals.addParam(7, [0xE8, 0x03])
        assert goals.txPacket() == 0
        group = sdk.GroupSyncRead(port, packets, feetech.POSITION, 2)
        assert all(group.addParam(number) for number in (1, 2, 7))
        assert group.txRxPacket() == 0
        assert [group.getData(n, feetech.POSITION, 2) for n in (1, 2, 7)] == [2048, 1500, 2600]
        assert bus.pulses() == (1000, LIMP, 1000)
        bus.inject("overload", 1)
        assert packets.read1ByteTxRx(port, 1, feetech.TORQUE) == (0, 0, feetech.OVERLOAD)
    finally:
        port.closePort()


def test_wheel_mode_that_moves_to_another_servo_leaves_the_first(bus: FeetechEmulator) -> None:
    modes = []
    for number in (2, 1):
        bus.inject("wheel_mode", number)
        modes.append([servo.memory[feetech.MODE] for servo in bus.servos])
    bus.mend("wheel_mode")
    assert modes == [[0, 1, 0], [1, 0, 0]]
    assert [servo.memory[feetech.MODE] for servo in bus.servos] == [0, 0, 0]
