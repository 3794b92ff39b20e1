from __future__ import annotations

import ctypes

import pytest
from hypothesis import given
from hypothesis import strategies as st
from smbus2 import i2c_msg

from robot.drivers.sensors.vl6180x import VL6180X
from robot.errors import (
    DeviceDataError,
    DeviceError,
    DeviceMissingError,
    DeviceTimeoutError,
)
from sim_robot.electronics.vl6180x import VL6180XEmulator
from tests.robot.clocks import InstantClock


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
    started = VL6180X(chip, clock=clock)
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
    again = VL6180X(chip, clock=clock)
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
    sensor = VL6180X(chip, clock=clock)
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
        VL6180X(chip, address=0x30, clock=clock).start()


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
        VL6180X(Noise(b"\xee"), clock=clock).start()


@pytest.mark.parametrize(("status", "words"), [(0x44, "laser safety"), (0x84, "clock")])
def test_status_bits_of_a_chip_that_shut_down(clock: InstantClock, status: int, words: str) -> None:
    bus = Noise(bytes((0x00, 0x01, status)))  # not reset, ready, interrupt status
    with pytest.raises(DeviceDataError, match=words):
        VL6180X(bus, clock=clock).range_mm()


@given(st.binary(min_size=1, max_size=30))
def test_noise_on_the_bus_ends_in_a_reading_or_an_error(data: bytes) -> None:
    clock = InstantClock()
    sensor = VL6180X(Noise(data), clock=clock)
    try:
        distance = sensor.range_mm()
    except DeviceError:
        distance = None
    assert distance is None or 0 <= distance <= 255
    assert clock.now() < 1.0


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
