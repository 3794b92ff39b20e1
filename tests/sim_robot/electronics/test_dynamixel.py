"""The emulated DYNAMIXEL servos, held to the manual; and its maker's library talks to them."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import Any

import pytest
import serial

from robot.drivers.servos.dynamixel_packets import Decoder, encode, read, sync_read, sync_write
from robot.drivers.servos.servo_packets import BROADCAST, Instruction, Packet
from robot.errors import CommandError
from sim_robot.electronics.bus_servos import BOOT, LIMP
from sim_robot.electronics.dynamixel import OVERLOAD, DynamixelEmulator, Servo
from sim_robot.electronics.servos import Felt
from tests.robot.clocks import InstantClock

ACCESS, LENGTH, RANGE, LIMIT = 7, 5, 4, 6
ALERT = 0x80


@pytest.fixture
def clock() -> InstantClock:
    return InstantClock()


class Bus(DynamixelEmulator):
    """Counts the bytes that it answers."""

    answered = 0

    def receive(self, data: bytes) -> bytes:
        answer = super().receive(data)
        self.answered += len(answer)
        return answer


@pytest.fixture
def bus(clock: InstantClock) -> Iterator[Bus]:
    emulator = Bus((1, 2, 7), baud=57600)
    emulator.feel(lambda: [Felt(2048.0, 0.0), Felt(1500.0, 0.0), Felt(2600.0, 0.0)])
    emulator.connect(clock)
    yield emulator
    emulator.close()


@pytest.fixture
def servo(clock: InstantClock) -> Servo:
    return Servo(1, clock.now)


def told(servo: Servo, packet: Packet) -> bytes:
    answer = servo.answer(packet)
    assert answer is not None
    assert answer.instruction == Instruction.STATUS
    return answer.parameters


def write(servo: int, address: int, value: int, size: int) -> Packet:
    number = value.to_bytes(size, "little", signed=value < 0)
    return Packet(servo, Instruction.WRITE, address.to_bytes(2, "little") + number)


def of(data: bytes) -> int:
    return int.from_bytes(data[1:], "little", signed=True)


class Host:
    """Asks the emulator over its port."""

    def __init__(self, bus: Bus, baud: int = 57600):
        self._bus = bus
        self._line = serial.Serial(bus.port, baud, timeout=60.0)
        self._sent = bus.bytes_read

    def send(self, packet: Packet) -> None:
        line = encode(packet)
        self._line.write(line)
        self._sent += len(line)
        assert self._bus.wait_until_read(self._sent, 60.0)

    def ask(self, packet: Packet) -> list[Packet]:
        """What the emulator answers; the system may deliver it a little later."""
        before = self._bus.answered
        self.send(packet)
        return Decoder().feed(self._line.read(self._bus.answered - before))

    def close(self) -> None:
        self._line.close()


@pytest.fixture
def host(bus: Bus) -> Iterator[Host]:
    line = Host(bus)
    yield line
    line.close()


def test_as_it_leaves_the_factory() -> None:
    servo = Servo(1)
    facts = {"model": 1200, "mode": 3, "return_delay": 250, "shutdown": 53, "torque": 0}
    facts |= {"position_min": 0, "position_max": 4095, "velocity_limit": 445, "return_level": 2}
    assert {name: servo[name] for name in facts} == facts
    assert servo.baud == 57600


def test_a_ping_tells_model_and_firmware(servo: Servo) -> None:
    assert told(servo, Packet(1, Instruction.PING)) == b"\x00\xb0\x04\x34"


def test_position_mode_has_4096_steps_a_turn_and_steps_without_a_profile(servo: Servo) -> None:
    servo["torque"] = 1
    told(servo, write(1, 116, 3072, 4))  # 90° from the middle
    assert servo.driven_to() == 3072


def test_a_profile_velocity_of_1_is_0_229_turns_a_minute(servo: Servo, clock: InstantClock) -> None:
    told(servo, write(1, 112, 44, 4))  # 60.5°/s
    told(servo, write(1, 64, 1, 1))
    told(servo, write(1, 116, 4095, 4))
    clock.sleep(0.5)
    assert servo.driven_to() == pytest.approx(2048 + 44 * 0.229 / 60 * 4096 / 2, abs=1)
    assert told(servo, read(1, 122, 1)) == b"\x00\x01"  # it moves
    clock.sleep(10)
    assert servo.driven_to() == 4095
    assert told(servo, read(1, 122, 1)) == b"\x00\x00"


def test_a_goal_moves_nothing_without_torque_and_is_gone_to_with_it(servo: Servo) -> None:
    told(servo, write(1, 116, 1000, 4))
    assert servo.driven_to() == LIMP
    servo.position = 2100  # moved by hand
    assert of(told(servo, read(1, 132, 4))) == 2100
    told(servo, write(1, 64, 1, 1))
    assert servo.driven_to() == 1000  # a leap, for whoever does not set the goal first


@pytest.mark.parametrize(
    ("packet", "error"),
    [
        (write(1, 116, 4096, 4), LIMIT),
        (write(1, 116, -1, 4), LIMIT),
        (write(1, 64, 2, 1), RANGE),
        (write(1, 116, 5, 2), LENGTH),
        (write(1, 117, 5, 1), LENGTH),
        (write(1, 132, 5, 4), ACCESS),  # only to be read
        (write(1, 66, 5, 1), ACCESS),  # undefined
        (read(1, 64, 7), ACCESS),  # 66 and 67 are undefined
        (read(1, 400, 1), ACCESS),
        (Packet(1, 0x77), 2),
        (Packet(1, Instruction.READ, b"\x00"), LENGTH),
    ],
)
def test_refusals_say_why(servo: Servo, packet: Packet, error: int) -> None:
    before = servo["goal"], servo["torque"]
    assert told(servo, packet) == bytes((error,))
    assert (servo["goal"], servo["torque"]) == before


def test_the_eeprom_area_is_locked_while_the_torque_is_on(servo: Servo) -> None:
    assert told(servo, write(1, 7, 5, 1)) == b"\x00"
    assert servo["id"] == 5
    told(servo, write(5, 64, 1, 1))
    assert told(servo, write(5, 7, 1, 1)) == bytes((ACCESS,))
    assert told(servo, write(5, 112, 10, 4)) == b"\x00"  # RAM is not


def test_limits_in_the_eeprom_bound_the_goal(servo: Servo) -> None:
    told(servo, write(1, 48, 3000, 4))
    assert told(servo, write(1, 116, 3001, 4)) == bytes((LIMIT,))


def test_an_overload_switches_the_torque_off_until_a_reboot(
    servo: Servo, clock: InstantClock
) -> None:
    told(servo, write(1, 64, 1, 1))
    servo.fail(OVERLOAD)
    assert servo.driven_to() == LIMP
    assert told(servo, read(1, 64, 1)) == bytes((ALERT, 0))
    assert told(servo, read(1, 70, 1)) == bytes((ALERT, OVERLOAD))
    assert told(servo, write(1, 64, 1, 1)) == bytes((ALERT | 1,))
    assert servo["torque"] == 0
    told(servo, Packet(1, Instruction.REBOOT))
    clock.sleep(BOOT)
    assert told(servo, write(1, 64, 1, 1)) == b"\x00"


def test_heat_and_a_low_supply_switch_the_torque_off_unless_shutdown_says_otherwise(
    servo: Servo, clock: InstantClock
) -> None:
    servo["shutdown"] = 0x34
    told(servo, write(1, 64, 1, 1))
    servo.volts = 34
    assert servo.driven_to() != LIMP
    assert told(servo, read(1, 70, 1)) == bytes((ALERT, 0x01))
    servo.heat = 71
    assert servo.driven_to() == LIMP
    assert told(servo, read(1, 70, 1)) == bytes((ALERT, 0x05))
    told(servo, Packet(1, Instruction.REBOOT))
    clock.sleep(BOOT)
    assert told(servo, read(1, 64, 1))[0] == ALERT  # it is still hot


def test_a_reboot_begins_anew_limp_where_it_stands(servo: Servo, clock: InstantClock) -> None:
    told(servo, write(1, 112, 50, 4))
    told(servo, write(1, 64, 1, 1))
    told(servo, write(1, 116, 3000, 4))
    servo.feel(Felt(2500, 0.0))
    told(servo, Packet(1, Instruction.REBOOT))
    assert servo.driven_to() == LIMP
    assert servo.answer(Packet(1, Instruction.PING)) is None
    clock.sleep(BOOT)
    assert told(servo, Packet(1, Instruction.PING))
    assert (servo["goal"], servo["profile_velocity"]) == (2500, 0)


def test_it_may_be_set_to_begin_with_torque(servo: Servo) -> None:
    told(servo, write(1, 60, 1, 1))
    told(servo, Packet(1, Instruction.REBOOT))
    assert servo.driven_to() == servo.position


def test_a_bus_watchdog_that_tripped_refuses_goals(servo: Servo, clock: InstantClock) -> None:
    told(servo, write(1, 64, 1, 1))
    told(servo, write(1, 98, 10, 1))  # 200 ms
    clock.sleep(0.19)
    assert told(servo, write(1, 116, 2000, 4)) == b"\x00"
    clock.sleep(0.21)
    assert told(servo, write(1, 116, 2100, 4)) == bytes((RANGE,))
    told(servo, write(1, 98, 0, 1))
    assert told(servo, write(1, 116, 2100, 4)) == b"\x00"


def test_it_says_where_it_is_how_it_drives_and_what_it_takes(servo: Servo) -> None:
    told(servo, write(1, 64, 1, 1))
    servo.feel(Felt(2003.4, 0.25))
    assert of(told(servo, read(1, 132, 4))) == 2003
    drive = 0.25 * 885 + 400 / 128 * (2048 - 2003.4)  # and what it misses, by its gain
    assert of(told(servo, read(1, 124, 2))) == pytest.approx(drive, abs=1)
    assert of(told(servo, read(1, 126, 2))) == pytest.approx(0.25 * 1470, abs=1)
    servo.feel(Felt(1500, 0.0))
    assert of(told(servo, read(1, 124, 2))) == 885
    assert of(told(servo, read(1, 126, 2))) == 0  # as of a dead motor
    assert of(told(servo, read(1, 144, 2))) == 50
    assert of(told(servo, read(1, 146, 1))) == 38


def test_the_return_level_says_what_is_answered(servo: Servo) -> None:
    assert servo.answer(write(1, 68, 1, 1)) is None
    assert servo.answer(write(1, 65, 1, 1)) is None
    assert told(servo, read(1, 65, 1)) == b"\x00\x01"
    servo.answer(write(1, 68, 0, 1))
    assert servo.answer(read(1, 65, 1)) is None
    assert told(servo, Packet(1, Instruction.PING))[0] == 0
    assert servo.answer(write(BROADCAST, 65, 0, 1)) is None
    assert servo["led"] == 0


def test_several_are_written_and_read_at_once(host: Host, bus: Bus) -> None:
    host.send(sync_write(116, {1: 1000, 7: 3000}, 4))
    assert [servo["goal"] for servo in bus.servos] == [1000, 2048, 3000]
    answers = host.ask(sync_read(132, 4, (7, 1)))
    assert [(one.id, of(one.parameters)) for one in answers] == [(7, 2600), (1, 2048)]
    answers = host.ask(Packet(BROADCAST, Instruction.PING))
    assert [one.id for one in answers] == [1, 2, 7]
    assert host.ask(read(3, 132, 4)) == []
    assert host.ask(read(BROADCAST, 132, 4)) == []


def test_at_another_baud_rate_nobody_listens(bus: Bus) -> None:
    deaf = Host(bus, 1_000_000)
    assert deaf.ask(Packet(1, Instruction.PING)) == []
    deaf.close()


def test_two_servos_of_one_id_answer_at_once(host: Host, bus: Bus, clock: InstantClock) -> None:
    bus.inject("twin", 2)
    (ping,) = host.ask(Packet(2, Instruction.PING))  # of one model, they say the same
    assert ping.id == 2
    clock.sleep(1.0)
    assert host.ask(read(2, 120, 2)) == []  # not about how long they have been on
    assert [one.id for one in host.ask(sync_read(120, 2, (1, 2, 7)))] == [1, 7]
    bus.mend()
    assert len(host.ask(read(2, 120, 2))) == 1


def test_faults_befall_single_servos(host: Host, bus: Bus) -> None:
    host.send(sync_write(116, {1: 2048, 2: 1500, 7: 2600}, 4))
    host.send(sync_write(64, {1: 1, 2: 1, 7: 1}, 1))
    assert bus.pulses() == (2048, 1500, 2600)
    bus.inject("overload", 1)
    assert bus.pulses() == (LIMP, 1500, 2600)
    bus.inject("hot", 2)
    assert bus.pulses() == (LIMP, LIMP, 2600)
    bus.inject("silent", 3)
    assert bus.pulses() == (LIMP, LIMP, LIMP)
    assert host.ask(Packet(7, Instruction.PING)) == []
    bus.mend()
    assert bus.pulses() == (LIMP, LIMP, 2600)
    bus.inject("moved", 3)
    assert bus.pulses()[2] == 3000
    bus.inject("reboot")
    assert bus.pulses() == (LIMP, LIMP, LIMP)
    with pytest.raises(CommandError, match="a number from 1 to 3"):
        bus.inject("overload", 4)


def test_answers_are_lost_and_damaged(host: Host, bus: Bus) -> None:
    everyone = sync_read(132, 4, (1, 2, 7))
    for fault in ("lost", "garbage"):
        bus.inject(fault, 2)
        assert len(host.ask(everyone) + host.ask(everyone)) == 3
        bus.mend()
    assert len(host.ask(everyone)) == 3


def test_a_damaged_instruction_is_not_followed(host: Host, bus: Bus) -> None:
    bus.inject("drop", 40)
    for goal in range(1000, 1020):
        host.send(write(1, 116, goal, 4))
        assert bus.servos[0]["goal"] in (2048, *range(1000, goal + 1))
    assert bus.servos[0]["goal"] >= 1017


def test_the_makers_library_moves_and_reads_the_servos(bus: Bus, clock: InstantClock) -> None:
    sdk: Any = importlib.import_module("dynamixel_sdk")
    port = sdk.PortHandler(bus.port)
    packets = sdk.PacketHandler(2.0)
    assert port.setBaudRate(57600)
    try:
        assert packets.ping(port, 2) == (1200, 0, 0)
        assert packets.write4ByteTxRx(port, 1, 116, 5000) == (0, LIMIT)
        assert packets.write1ByteTxRx(port, 1, 64, 1) == (0, 0)
        assert packets.write1ByteTxRx(port, 1, 11, 1) == (0, ACCESS)
        goals = sdk.GroupSyncWrite(port, packets, 116, 4)
        for number in (1, 2):
            assert goals.addParam(number, [0xE8, 0x03, 0, 0])
        assert goals.txPacket() == 0
        group = sdk.GroupSyncRead(port, packets, 132, 4)
        assert all(group.addParam(number) for number in (1, 2, 7))
        assert group.txRxPacket() == 0
        assert [group.getData(n, 132, 4) for n in (1, 2, 7)] == [2048, 1500, 2600]
        assert bus.pulses() == (1000, LIMP, LIMP)
        bus.inject("overload", 1)
        assert packets.read1ByteTxRx(port, 1, 70) == (OVERLOAD, 0, ALERT)
        assert packets.reboot(port, 1)[0] == 0
        clock.sleep(BOOT)
        assert packets.read1ByteTxRx(port, 1, 70) == (0, 0, 0)
    finally:
        port.closePort()
