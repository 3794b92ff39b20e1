"""The driver of DYNAMIXEL servos, on emulated ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from robot.drivers.buses import Buses
from robot.drivers.servos.answering_servos import AnsweringServos
from robot.drivers.servos.dynamixel import MODELS, DynamixelSettings
from robot.errors import (
    CommandError,
    DeviceDataError,
    DeviceError,
    DeviceMissingError,
    DeviceTimeoutError,
)
from sim_robot.electronics.bus_servos import LIMP
from sim_robot.electronics.dynamixel import EEPROM, REGISTERS, DynamixelEmulator
from sim_robot.electronics.servos import Felt
from tests.robot.clocks import InstantClock

IDS = (1, 2, 7)
STAND = (2048.0, 1500.0, 2600.0)


@pytest.fixture
def bus(clock: InstantClock) -> Iterator[DynamixelEmulator]:
    emulator = DynamixelEmulator(IDS)
    for servo, position in zip(emulator.servos, STAND, strict=True):
        servo.position = position
    emulator.connect(clock)
    yield emulator
    emulator.close()


@pytest.fixture
def servos(bus: DynamixelEmulator, clock: InstantClock) -> Iterator[AnsweringServos]:
    driver = DynamixelSettings(port=bus.port, baud=1_000_000).open(Buses(clock=clock))
    yield driver
    driver.close()


@pytest.fixture
def driven(servos: AnsweringServos) -> AnsweringServos:
    """With their torque on, where they stand."""
    servos.read_counts(IDS)
    servos.set_counts({1: 2048, 2: 1500, 7: 2600})
    assert servos.verify({1: 2048, 2: 1500, 7: 2600}) == []
    return servos


def test_servos_without_torque_are_limp_and_say_where_they_are(servos: AnsweringServos) -> None:
    assert servos.read_counts(IDS) == {1: 0, 2: 0, 7: 0}
    states = servos.read_states(IDS)
    assert [states[n].position for n in IDS] == list(STAND)
    assert not any(state.driven or state.fault for state in states.values())
    assert (states[1].voltage, states[1].temperature, states[1].load) == (5.0, 38, 0.0)


def test_torque_goes_on_where_a_servo_stands_and_it_goes_on_slowly(
    bus: DynamixelEmulator, servos: AnsweringServos, clock: InstantClock
) -> None:
    servos.read_counts(IDS)
    bus.servos[0].position = 3000.0  # by hand, since it was read
    servos.set_counts({1: 2048})
    servos.verify({1: 2048})  # it is through
    assert bus.pulses()[1:] == (LIMP, LIMP)
    assert bus.pulses()[0] == pytest.approx(3000, abs=20)
    clock.sleep(1.0)
    assert bus.pulses()[0] == pytest.approx(3000 - 75 / 360 * 4096, abs=30)
    clock.sleep(1.0)
    assert bus.pulses()[0] == 2048
    assert servos.read_states([1])[1].position == 2048


def test_what_was_sent_is_read_back(
    bus: DynamixelEmulator, driven: AnsweringServos, clock: InstantClock
) -> None:
    driven.set_counts({1: 2100, 7: 2500})
    assert driven.verify({1: 2100, 2: 1500, 7: 2500}) == []
    assert driven.verify({1: 2048, 2: 1500, 7: 2500}) == [1]
    clock.sleep(1.0)
    assert bus.pulses() == (2100, 1500, 2500)
    bus.inject("moved", 2)
    assert driven.verify({1: 2100, 2: 1500, 7: 2500}) == [2]
    driven.release([2])
    assert driven.read_counts(IDS) == {1: 2100, 2: 0, 7: 2500}
    assert bus.pulses()[1] == LIMP


def test_nothing_permanent_is_ever_written(bus: DynamixelEmulator, driven: AnsweringServos) -> None:
    driven.set_counts({1: 2100})
    driven.release(IDS)
    bus.inject("overload", 1)
    driven.forget()
    driven.read_counts(IDS)
    changed = {
        name
        for name, register in REGISTERS.items()
        for servo in bus.servos
        if register.address in EEPROM and servo[name] != register.initial
    }
    assert changed == {"id", "baud"}  # the emulator's own


@pytest.mark.parametrize("number", IDS)
def test_a_servo_that_restarts_in_mid_motion_gets_nothing(
    bus: DynamixelEmulator, driven: AnsweringServos, clock: InstantClock, number: int
) -> None:
    index = IDS.index(number)
    driven.set_counts({number: 2000})
    bus.inject("reboot", index + 1)
    with pytest.raises(DeviceError) as failed:
        driven.set_counts({number: 2010})
    assert f"Servo {number}" in str(failed.value)
    clock.sleep(1.0)
    with pytest.raises(DeviceDataError, match=r"was not read|restarted"):
        driven.verify({number: 2000})
    assert bus.pulses()[index] == LIMP
    driven.forget()
    assert driven.read_counts([number]) == {number: 0}


def test_a_restart_that_is_over_is_known_by_the_speed(
    bus: DynamixelEmulator, driven: AnsweringServos, clock: InstantClock
) -> None:
    bus.servos[1]["startup"] = 1  # set since: its torque goes on by itself
    bus.inject("reboot", 2)
    clock.sleep(1.0)
    with pytest.raises(DeviceDataError, match=r"Servo 2 \(DYNAMIXEL\) restarted"):
        driven.set_counts({1: 2000})
    driven.forget()
    with pytest.raises(DeviceDataError, match="Startup Configuration to 0"):
        driven.read_counts(IDS)


@pytest.mark.parametrize(
    ("fault", "words"), [("overload", "reports an overload"), ("hot", "reports overheating")]
)
def test_a_servo_that_gives_up_is_a_fault_and_rebooted_when_that_is_over(
    bus: DynamixelEmulator, driven: AnsweringServos, fault: str, words: str
) -> None:
    bus.inject(fault, 3)
    with pytest.raises(DeviceDataError, match=f"Servo 7 .* {words} and switched its torque off"):
        driven.set_counts({1: 2000})
    assert bus.pulses()[0] == 2048
    driven.forget()
    if fault == "hot":
        with pytest.raises(DeviceDataError, match="overheating, also after a reboot"):
            driven.read_counts(IDS)
        bus.mend()
    assert driven.read_counts(IDS) == {1: 2048, 2: 1500, 7: 0}
    driven.set_counts({7: 2600})
    assert driven.verify({7: 2600}) == []
    assert bus.pulses() == (2048, 1500, 2600)


def test_a_servo_that_complains_and_holds_is_not_let_go(
    bus: DynamixelEmulator, driven: AnsweringServos
) -> None:
    for servo in bus.servos:
        servo["shutdown"] = 0x34  # as some models leave the factory: it does not let go for a dip
    bus.inject("dip")
    with pytest.raises(DeviceDataError, match="reports a supply out of its limits"):
        driven.verify({1: 2048})
    driven.forget()
    with pytest.raises(DeviceDataError, match="reports a supply"):
        driven.read_counts(IDS)
    assert bus.pulses() == STAND
    bus.mend()
    driven.forget()
    assert driven.read_counts(IDS) == {1: 2048, 2: 1500, 7: 2600}
    bus.servos[0]["hardware_error"] |= 0x10  # as if its Shutdown did not say to let go for that
    driven.forget()
    with pytest.raises(DeviceDataError, match=r"Servo 1 .* reports an electrical shock\."):
        driven.read_counts(IDS)
    assert bus.pulses() == STAND


def wrong_mode(bus: DynamixelEmulator) -> None:
    bus.servos[1]["mode"] = 1


def torque_by_goal(bus: DynamixelEmulator) -> None:
    bus.servos[1]["drive_mode"] = 8


def unknown_model(bus: DynamixelEmulator) -> None:
    bus.servos[1]["model"] = 2020


def silent(bus: DynamixelEmulator) -> None:
    bus.inject("silent", 2)


def twin(bus: DynamixelEmulator) -> None:
    bus.inject("twin", 2)


def other_baud(bus: DynamixelEmulator) -> None:
    bus.servos[1]["baud"] = 1


@pytest.mark.parametrize(
    ("wrong", "error", "words"),
    [
        (wrong_mode, DeviceDataError, r"is in velocity \(wheel\) mode.* Operating Mode to 3"),
        (torque_by_goal, DeviceDataError, "has Drive Mode 8: .*torque that goes on with a goal"),
        (unknown_model, DeviceDataError, "is a model 2020, whose registers are not known"),
        (silent, DeviceTimeoutError, "does not answer.*robotd scan"),
        (other_baud, DeviceTimeoutError, "does not answer.* baud rate"),
        (twin, DeviceDataError, "is damaged: two servos have this ID, or the line is bad"),
    ],
)
def test_a_servo_that_is_not_fit_for_use_is_refused_in_a_sentence(
    bus: DynamixelEmulator,
    servos: AnsweringServos,
    wrong: Callable[[DynamixelEmulator], None],
    error: type[DeviceError],
    words: str,
) -> None:
    wrong(bus)
    with pytest.raises(error, match=rf"(Servo|servo) 2 \(DYNAMIXEL\).*{words}"):
        servos.read_counts(IDS)
    with pytest.raises(CommandError, match="read the servos' counts"):
        servos.set_counts({2: 1500})


@pytest.mark.parametrize("fault", ["lost", "garbage"])
def test_answers_that_do_not_come_are_asked_for_again(
    bus: DynamixelEmulator, driven: AnsweringServos, fault: str
) -> None:
    bus.inject(fault, 4)
    before = driven.repeats
    assert driven.read_counts(IDS) == {1: 2048, 2: 1500, 7: 2600}
    assert driven.repeats > before


def test_an_unplugged_adapter_is_missing_and_opened_anew(
    bus: DynamixelEmulator, driven: AnsweringServos
) -> None:
    bus.unplug()
    with pytest.raises(DeviceMissingError, match="failed while"):
        driven.set_counts({1: 2000})
    with pytest.raises(DeviceMissingError, match="cannot be opened"):
        driven.reopen()
    bus.replug()
    driven.reopen()
    assert driven.read_counts(IDS) == {1: 2048, 2: 1500, 7: 2600}


def test_an_adapter_that_echoes_does_no_harm(bus: DynamixelEmulator, clock: InstantClock) -> None:
    answer = bus.receive
    bus.receive = lambda data: data + answer(data)  # type: ignore[method-assign]
    driver = DynamixelSettings(port=bus.port, baud=1_000_000).open(Buses(clock=clock))
    assert driver.read_counts(IDS) == {1: 0, 2: 0, 7: 0}
    assert driver.repeats == 0
    driver.close()


@pytest.mark.parametrize("baud", [57600, 1_000_000])
def test_an_update_takes_as_long_as_its_bytes_and_the_return_delays(
    clock: InstantClock, baud: int
) -> None:
    bus = DynamixelEmulator(IDS, baud=baud)
    bus.connect(clock)
    driver = DynamixelSettings(port=bus.port, baud=baud).open(Buses(clock=clock))
    driver.read_counts(IDS)
    driver.set_counts(dict.fromkeys(IDS, 2048))
    before = clock.now()
    driver.set_counts(dict.fromkeys(IDS, 2050))
    assert clock.now() - before == pytest.approx(driver.seconds_for(3), rel=0.02)
    driver.close()
    bus.close()


@pytest.mark.parametrize(
    ("model", "amperes"), [("XL330-M288", 0.3675), ("XM430-W350", 0.9886), ("XL430-W250", None)]
)
def test_current_has_the_unit_of_its_model(
    bus: DynamixelEmulator, driven: AnsweringServos, model: str, amperes: float | None
) -> None:
    (number,) = (number for number, name in MODELS.items() if name == model)
    bus.servos[0]["model"] = number
    driven.forget()
    driven.read_counts(IDS)
    bus.servos[0].feel(Felt(2048.0, -0.25))
    state = driven.read_states([1])[1]
    assert state.load == pytest.approx(-0.25, abs=0.01)
    assert state.current == (None if amperes is None else pytest.approx(amperes, abs=0.002))
    assert state.limits == (0, 4095)
