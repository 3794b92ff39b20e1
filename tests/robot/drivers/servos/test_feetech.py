"""The driver of Feetech servos, and what it shares with others that answer, on emulated ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from robot.drivers.buses import Buses
from robot.drivers.servos.answering_servos import AnsweringServos
from robot.drivers.servos.feetech import FeetechSettings
from robot.errors import (
    CommandError,
    DeviceDataError,
    DeviceError,
    DeviceMissingError,
    DeviceTimeoutError,
)
from sim_robot.electronics import feetech
from sim_robot.electronics.bus_servos import LIMP
from sim_robot.electronics.feetech import FeetechEmulator
from sim_robot.electronics.servos import Felt
from tests.robot.clocks import InstantClock

IDS = (1, 2, 7)
STAND = (2048, 1500, 2600)
GOALS = dict(zip(IDS, STAND, strict=True))


@pytest.fixture
def bus(clock: InstantClock) -> Iterator[FeetechEmulator]:
    emulator = FeetechEmulator(IDS)
    emulator.feel(lambda: [Felt(position, 0.0) for position in STAND])
    emulator.connect(clock)
    yield emulator
    emulator.close()


def opened(bus: FeetechEmulator, clock: InstantClock) -> AnsweringServos:
    return FeetechSettings(port=bus.port, baud=1_000_000).open(Buses(clock=clock))


@pytest.fixture
def servos(bus: FeetechEmulator, clock: InstantClock) -> Iterator[AnsweringServos]:
    driver = opened(bus, clock)
    yield driver
    driver.close()


@pytest.fixture
def driven(servos: AnsweringServos) -> AnsweringServos:
    """With their torque on, where they stand."""
    servos.read_counts(IDS)
    servos.set_counts(GOALS)
    assert servos.verify(GOALS) == []
    return servos


def test_servos_without_torque_are_limp_and_say_where_they_are(servos: AnsweringServos) -> None:
    assert servos.read_counts(IDS) == {1: 0, 2: 0, 7: 0}
    states = servos.read_states(IDS)
    assert tuple(states[n].position for n in IDS) == STAND
    assert not any(state.driven or state.fault for state in states.values())
    first = states[1]
    assert (first.voltage, first.temperature, first.load, first.limits) == (7.4, 38, 0, (0, 4095))


def test_torque_goes_on_where_a_servo_stands(bus: FeetechEmulator, servos: AnsweringServos) -> None:
    servos.read_counts(IDS)
    moves: list[tuple[int, float, float]] = []
    bus.watch_moves(lambda *move: moves.append(move))
    servos.set_counts({1: 2000})
    servos.verify({1: 2000})
    assert moves == [(1, 2048, 2048), (1, 2048, 2000)]
    assert bus.pulses() == (2000, LIMP, LIMP)
    assert bus.servos[0].word(feetech.SPEED) == 1024  # 90°/s at most, whoever sends it


def test_what_was_sent_is_read_back(bus: FeetechEmulator, driven: AnsweringServos) -> None:
    driven.set_counts({1: 2100, 7: 2500})
    assert driven.verify({1: 2100, 2: 1500, 7: 2500}) == []
    assert driven.verify({1: 2048, 2: 1500, 7: 2500}) == [1]
    assert bus.pulses() == (2100, 1500, 2500)
    driven.release([2])
    assert driven.read_counts(IDS) == {1: 2100, 2: 0, 7: 2500}


def test_nothing_permanent_is_ever_written(bus: FeetechEmulator, driven: AnsweringServos) -> None:
    driven.set_counts({1: 2100})
    driven.release(IDS)
    bus.inject("overload", 1)
    driven.forget()
    driven.read_counts(IDS)
    assert [servo.permanent_writes for servo in bus.servos] == [0, 0, 0]


@pytest.mark.parametrize("torque", [0, 1])
def test_a_servo_that_restarted_gets_nothing(
    bus: FeetechEmulator, driven: AnsweringServos, clock: InstantClock, torque: int
) -> None:
    bus.inject("reboot", 2)
    clock.sleep(1.0)
    bus.servos[1].memory[feetech.TORQUE] = torque  # by whom ever
    with pytest.raises(DeviceDataError, match=r"Servo 2 \(Feetech\) restarted"):
        driven.set_counts({1: 2000})
    assert bus.pulses()[0] == 2048
    with pytest.raises(DeviceDataError, match="was not read"):
        driven.verify({2: 1500})
    driven.forget()
    assert driven.read_counts([2]) == {2: 1500 * torque}


@pytest.mark.parametrize(("fault", "words"), [("overload", "overload"), ("hot", "overheat")])
def test_a_servo_that_gives_up_is_a_fault_until_that_is_over(
    bus: FeetechEmulator, driven: AnsweringServos, fault: str, words: str
) -> None:
    bus.inject(fault, 3)
    sentence = rf"Servo 7 \(Feetech\) reports {words} and switched its torque off"
    with pytest.raises(DeviceDataError, match=sentence):
        driven.set_counts({1: 2000})
    assert bus.pulses()[0] == 2048
    driven.forget()
    if fault == "hot":
        with pytest.raises(DeviceDataError, match=sentence):
            driven.read_counts(IDS)
        bus.mend()
    assert driven.read_counts(IDS) == {1: 2048, 2: 1500, 7: 0}
    driven.set_counts({7: 2600})
    assert driven.verify(GOALS) == []
    assert bus.pulses() == STAND


def test_a_goal_that_another_program_gave_is_a_fault(
    bus: FeetechEmulator, driven: AnsweringServos
) -> None:
    bus.inject("moved", 2)
    assert driven.verify(GOALS) == [2]
    with pytest.raises(DeviceDataError, match=r"Servo 2 \(Feetech\) has the goal 3000, not 1500"):
        driven.set_counts({1: 2000})
    assert bus.pulses()[0] == 2048


def test_a_goal_that_was_lost_is_sent_again(bus: FeetechEmulator, driven: AnsweringServos) -> None:
    driven.set_counts({1: 2100, 2: 1520})
    driven.verify({1: 2100})  # it is through
    bus.servos[1].set_word(feetech.GOAL, 1500)  # as if it had not come
    driven.set_counts({1: 2110})
    assert driven.verify({1: 2110, 2: 1520, 7: 2600}) == []
    assert driven.repeats == 1


def wheel(bus: FeetechEmulator) -> None:
    bus.servos[1].memory[feetech.MODE] = 1


def silent(bus: FeetechEmulator) -> None:
    bus.inject("silent", 2)


def twin(bus: FeetechEmulator) -> None:
    bus.inject("twin", 2)


def other_baud(bus: FeetechEmulator) -> None:
    bus.servos[1].memory[feetech.BAUD] = 4


@pytest.mark.parametrize(
    ("wrong", "error", "words"),
    [
        (wheel, DeviceDataError, r"is in wheel \(constant speed\) mode.*Set its mode to 0"),
        (silent, DeviceTimeoutError, "does not answer.*robotd scan"),
        (other_baud, DeviceTimeoutError, "does not answer.*baud rate"),
        (twin, DeviceDataError, "is damaged: two servos have this ID"),
    ],
)
def test_a_servo_that_is_not_fit_for_use_is_refused_in_a_sentence(
    bus: FeetechEmulator,
    servos: AnsweringServos,
    wrong: Callable[[FeetechEmulator], None],
    error: type[DeviceError],
    words: str,
) -> None:
    wrong(bus)
    with pytest.raises(error, match=rf"(Servo|servo) 2 \(Feetech\).*{words}"):
        servos.read_counts(IDS)
    with pytest.raises(CommandError, match="read the servos' counts"):
        servos.set_counts({2: 1500})


@pytest.mark.parametrize("fault", ["lost", "garbage"])
def test_answers_that_do_not_come_are_asked_for_again(
    bus: FeetechEmulator, driven: AnsweringServos, fault: str
) -> None:
    bus.inject(fault, 4)
    for _ in range(3):
        assert driven.read_counts(IDS) == GOALS
    assert driven.repeats > 1


def test_an_unplugged_adapter_is_missing_and_opened_anew(
    bus: FeetechEmulator, driven: AnsweringServos
) -> None:
    bus.unplug()
    with pytest.raises(DeviceMissingError, match="failed while"):
        driven.set_counts({1: 2000})
    bus.replug()
    driven.reopen()
    assert driven.read_counts(IDS) == GOALS


def test_an_adapter_that_echoes_does_no_harm(bus: FeetechEmulator, clock: InstantClock) -> None:
    answer = bus.receive
    bus.receive = lambda data: data + answer(data)  # type: ignore[method-assign]
    driver = opened(bus, clock)
    assert driver.read_counts(IDS) == {1: 0, 2: 0, 7: 0}
    assert driver.repeats == 0
    driver.close()


def test_an_update_takes_as_long_as_its_bytes(clock: InstantClock, driven: AnsweringServos) -> None:
    before = clock.now()
    driven.set_counts(dict.fromkeys(IDS, 2050))
    assert clock.now() - before == pytest.approx(driven.seconds_for(3), rel=0.02)
