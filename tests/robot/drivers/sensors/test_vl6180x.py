from __future__ import annotations

import ctypes
from collections.abc import Callable
from itertools import count, cycle

import pytest
from hypothesis import given
from hypothesis import strategies as st
from smbus2 import i2c_msg

from robot.drivers.links.i2c import I2CBus, I2CLink
from robot.drivers.sensors.vl6180x import VL6180X
from robot.errors import (
    DeviceDataError,
    DeviceError,
    DeviceMissingError,
    DeviceTimeoutError,
)
from sim_robot.electronics.vl6180x import VL6180XEmulator
from tests.robot.clocks import InstantClock


def link_to(bus: I2CBus) -> I2CLink:
    return I2CLink(lambda path: bus, "/dev/i2c-1")


class Target:
    def __init__(self) -> None:
        self.distance: float | None = 50.0

    def __call__(self) -> float | None:
        return self.distance


@pytest.fixture
def target() -> Target:
    return Target()


@pytest.fixture
def chip(target: Target, clock: InstantClock) -> VL6180XEmulator:
    return VL6180XEmulator(target, clock)


@pytest.fixture
def sensor(chip: VL6180XEmulator, clock: InstantClock) -> VL6180X:
    started = VL6180X(link_to(chip), clock=clock)
    started.start()
    return started


@pytest.mark.parametrize(
    ("distance", "reading"),
    [(0.0, 0), (0.4, 0), (17.6, 18), (200.0, 200), (200.1, None), (None, None), (-3.0, 0)],
)
def test_distances(
    sensor: VL6180X, target: Target, distance: float | None, reading: int | None
) -> None:
    target.distance = distance
    assert sensor.range_mm() == reading


def test_every_measurement_is_fresh(sensor: VL6180X, target: Target) -> None:
    distances = []
    for distance in (10.0, None, 30.0, 40.0):
        target.distance = distance
        distances.append(sensor.range_mm())
    assert distances == [10, None, 30, 40]


def test_starting_again_without_a_reset_keeps_the_settings(
    sensor: VL6180X, chip: VL6180XEmulator, clock: InstantClock
) -> None:
    again = VL6180X(link_to(chip), clock=clock)
    again.start()
    assert again.range_mm() == 50


@pytest.mark.parametrize(
    ("error", "outcome"),
    [(0, 255), (6, None), (7, None), (8, None), (13, None), (15, None), (12, 0), (14, 0)],
)
def test_error_codes_that_are_readings(
    sensor: VL6180X, chip: VL6180XEmulator, error: int, outcome: int | None
) -> None:
    chip.inject("error", error)
    assert sensor.range_mm() == outcome


@pytest.mark.parametrize("error", [1, 2, 3, 4, 5, 9, 10, 11])
def test_error_codes_that_are_faults(sensor: VL6180X, chip: VL6180XEmulator, error: int) -> None:
    chip.inject("error", error)
    with pytest.raises(DeviceDataError, match=rf"\(error {error}\)"):
        sensor.range_mm()
    chip.mend()
    assert sensor.range_mm() == 50


@pytest.mark.parametrize(
    ("fault", "kind", "words"),
    [
        ("nak", DeviceMissingError, "Nothing acknowledges at I²C address 0x29"),
        ("hang", DeviceTimeoutError, "bus hangs"),
        ("busy", DeviceTimeoutError, "not done with a measurement within"),
    ],
)
def test_a_faulty_sensor_is_an_error_in_time_and_recovers(
    target: Target, fault: str, kind: type[DeviceError], words: str
) -> None:
    clock = InstantClock()
    chip = VL6180XEmulator(target, clock)
    sensor = VL6180X(link_to(chip), clock=clock)
    sensor.start()
    chip.inject(fault)
    start = clock.now()
    with pytest.raises(kind, match=words):
        sensor.range_mm()
    assert clock.now() - start < 0.5
    chip.mend()
    assert sensor.range_mm() == 50


def test_a_measurement_in_progress_forever_delays_the_next_only_so_long(
    sensor: VL6180X, chip: VL6180XEmulator
) -> None:
    chip.inject("busy")
    for words in ("not done", "not ready"):
        with pytest.raises(DeviceTimeoutError, match=words):
            sensor.range_mm()


def test_an_abandoned_measurement_is_not_served_as_the_next(
    sensor: VL6180X, chip: VL6180XEmulator, target: Target, clock: InstantClock
) -> None:
    chip.inject("busy")
    with pytest.raises(DeviceTimeoutError):
        sensor.range_mm()
    chip.mend()
    target.distance = 20.0
    clock.sleep(1.0)
    assert sensor.range_mm() == 20


def test_a_sensor_that_was_reset_says_so_instead_of_measuring_badly(
    sensor: VL6180X, chip: VL6180XEmulator
) -> None:
    chip.power_cycle()
    with pytest.raises(DeviceDataError, match="reset"):
        sensor.range_mm()
    sensor.start()
    assert sensor.range_mm() == 50


def test_nobody_at_the_address(chip: VL6180XEmulator, clock: InstantClock) -> None:
    with pytest.raises(DeviceMissingError, match="0x30"):
        VL6180X(link_to(chip), address=0x30, clock=clock).start()


class Noise:
    """A bus on which every read yields the next of some bytes."""

    def __init__(self, data: bytes):
        self._data = data
        self._at = 0

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        for message in messages:
            if message.flags & 1:
                value = self._data[self._at % len(self._data)]
                self._at += 1
                ctypes.memmove(message.buf, bytes((value,)), 1)

    def close(self) -> None:
        pass


def test_another_chip_at_the_address(clock: InstantClock) -> None:
    with pytest.raises(DeviceMissingError, match="calls itself 0xee instead of 0xb4"):
        VL6180X(link_to(Noise(b"\xee")), clock=clock).start()


class Shown(VL6180XEmulator):
    """A chip of which some registers show what they should not."""

    def __init__(self, clock: InstantClock, shown: Callable[[int], int | None]):
        super().__init__(lambda: 50.0, clock)
        self._shown = shown

    def send(self, count: int) -> bytes:
        shown, data = self._shown(self._index), super().send(count)
        return data if shown is None else bytes((shown,)) * count


@pytest.mark.parametrize(("status", "words"), [(0x44, "laser safety"), (0x84, "clock")])
def test_status_bits_of_a_chip_that_shut_down(clock: InstantClock, status: int, words: str) -> None:
    sensor = VL6180X(link_to(Shown(clock, {0x04F: status}.get)), clock=clock)
    sensor.start()
    with pytest.raises(DeviceDataError, match=words):
        sensor.range_mm()


@given(st.binary(min_size=1, max_size=30))
def test_noise_in_what_the_chip_says_ends_in_a_reading_or_an_error(data: bytes) -> None:
    clock = InstantClock()
    noise = cycle(data)
    results = {0x04D, 0x04F, 0x062, 0x06C}
    chip = Shown(clock, lambda register: next(noise) if register in results and started else None)
    sensor, started = VL6180X(link_to(chip), clock=clock), False
    sensor.start()
    started = True
    before = clock.now()
    try:
        distance = sensor.range_mm()
    except DeviceError:
        distance = None
    assert distance is None or 0 <= distance <= 255
    assert clock.now() - before < 1.0


SETTINGS = {  # register, what another program leaves there, whether that spoils a range
    "range scaler": (0x096, [0x00, 0x54], True),
    "longest convergence": (0x01C, [0x05], True),
    "crosstalk compensation": (0x01E, [0x01, 0x00], True),
    "valid height": (0x021, [0xFF], False),
    "early convergence estimate": (0x022, [0x0A, 0x00], True),
    "offset": (0x024, [0x20], True),
    "range ignore threshold": (0x025, [0xFF, 0x0A, 0x00], False),  # and its check:
    "range checks": (0x02D, [0x12], False),
    "ambient multiplier": (0x02C, [0xFF], False),
    "interval": (0x01B, [0xFF], False),
    "parameter hold": (0x017, [0x01], False),
    "history": (0x012, [0x03], False),
    "result scaler": (0x119, [0x02], True),
    "alternation": (0x2A3, [0x01], True),
    "averaging": (0x10A, [0x05], False),
    "a private one": (0x0DB, [0x00], True),
}


def tell(bus: I2CBus, register: int, *values: int) -> None:
    bus.i2c_rdwr(i2c_msg.write(0x29, [register >> 8, register & 0xFF, *values]))


def held(bus: I2CBus) -> bytes:
    """The settings, other than the triggers and the results."""
    contents = b""
    for first, size in ((0x010, 4), (0x017, 1), (0x019, 21), (0x038, 13), (0x090, 0x270)):
        data = i2c_msg.read(0x29, size)
        bus.i2c_rdwr(i2c_msg.write(0x29, [first >> 8, first & 0xFF]), data)
        contents += bytes(data)
    return contents


@pytest.mark.parametrize("setting", SETTINGS)
def test_what_another_program_left_is_set_anew_at_every_start(
    sensor: VL6180X, chip: VL6180XEmulator, target: Target, clock: InstantClock, setting: str
) -> None:
    target.distance = 90.0
    before = held(chip)
    register, values, spoils = SETTINGS[setting]
    tell(chip, register, *values)
    assert held(chip) != before
    if spoils:
        assert measured_by_hand(chip, clock) != 90
    again = VL6180X(link_to(chip), clock=clock)
    again.start()
    assert held(chip) == before
    assert again.range_mm() == 90


def measured_by_hand(chip: VL6180XEmulator, clock: InstantClock) -> int:
    """The value and the error of a measurement, as one number."""
    tell(chip, 0x018, 0x01)
    clock.sleep(0.2)
    value, status = i2c_msg.read(0x29, 1), i2c_msg.read(0x29, 1)
    chip.i2c_rdwr(i2c_msg.write(0x29, [0x00, 0x62]), value)
    chip.i2c_rdwr(i2c_msg.write(0x29, [0x00, 0x4D]), status)
    return bytes(value)[0] + (bytes(status)[0] >> 4 << 8)


def test_a_scale_that_another_program_set_first_is_refused(
    chip: VL6180XEmulator, clock: InstantClock
) -> None:
    """Its offset, a third of the factory's, was rounded: nobody can tell what it was."""
    tell(chip, 0x016, 0x00)
    chip.inject("rescaled")
    with pytest.raises(DeviceDataError, match=r"another scale \(0x0054 .* supply off and on"):
        VL6180X(link_to(chip), clock=clock).start()
    chip.power_cycle()
    again = VL6180X(link_to(chip), clock=clock)
    again.start()
    assert again.range_mm() == 50


def test_a_sensor_that_another_program_set_up_without_scaling_is_taken_over(
    chip: VL6180XEmulator, clock: InstantClock
) -> None:
    tell(chip, 0x096, 0x00, 0xFD)
    tell(chip, 0x016, 0x00)
    found = VL6180X(link_to(chip), clock=clock)
    found.start()
    assert found.range_mm() == 50


@pytest.mark.parametrize("register", [0x096, 0x01C, 0x024, 0x02D])
def test_a_setting_that_another_program_changes_meanwhile_is_noticed(
    sensor: VL6180X, chip: VL6180XEmulator, register: int
) -> None:
    assert sensor.range_mm() == 50
    tell(chip, register, 0x55)
    with pytest.raises(DeviceDataError, match="does not measure as it was set up"):
        sensor.range_mm()
    sensor.start()
    assert sensor.range_mm() == 50


@pytest.mark.parametrize(("alternating", "start"), [(0x00, 0x018), (0x01, 0x038)])
def test_measurements_without_end_are_ended(
    chip: VL6180XEmulator, target: Target, clock: InstantClock, alternating: int, start: int
) -> None:
    tell(chip, 0x2A3, alternating)
    tell(chip, start, 0x03)
    clock.sleep(1.0)
    found = VL6180X(link_to(chip), clock=clock)
    found.start()
    for distance in (50, 70):
        target.distance = distance
        assert found.range_mm() == distance


@pytest.mark.parametrize("fault", ["nak", "unheard"])
@pytest.mark.parametrize("every", [3, 7, 40])
def test_lost_acknowledges_cost_no_measurement_and_start_none_twice(
    clock: InstantClock, fault: str, every: int
) -> None:
    asked = count()
    chip = VL6180XEmulator(lambda: 50.0 + 0 * next(asked), clock)
    chip.inject(fault, every)
    found = VL6180X(link_to(chip), clock=clock)
    found.start()
    assert [found.range_mm() for _ in range(20)] == [50] * 20
    assert next(asked) == 20
    assert found.link.repeats > 0


def test_a_sensor_that_counts_the_same_photons_again_and_again_is_frozen(
    sensor: VL6180X, chip: VL6180XEmulator
) -> None:
    assert [sensor.range_mm() for _ in range(30)] == [50] * 30  # a steady target is no fault
    chip.inject("frozen")
    assert [sensor.range_mm() for _ in range(9)] == [50] * 9
    with pytest.raises(DeviceDataError, match="frozen: 10 measurements"):
        sensor.range_mm()
    chip.mend()
    assert sensor.range_mm() == 50
