"""The registers, driven by hand as the application note does it."""

from __future__ import annotations

import errno

import pytest
from smbus2 import i2c_msg

from robot.drivers.links.i2c import I2CLink
from robot.drivers.sensors.vl6180x import VL6180X
from sim_robot.electronics.vl6180x import VL6180XEmulator
from tests.robot.clocks import InstantClock

ADDRESS = 0x29


class Bench:
    def __init__(self) -> None:
        self.clock = InstantClock()
        self.distance: float | None = 42.0
        self.chip = VL6180XEmulator(lambda: self.distance, self.clock)
        self.link = I2CLink(lambda path: self.chip, "/dev/i2c-1")

    def read(self, register: int, count: int = 1) -> bytes:
        data = i2c_msg.read(ADDRESS, count)
        self.chip.i2c_rdwr(i2c_msg.write(ADDRESS, [register >> 8, register & 0xFF]), data)
        return bytes(data)

    def measure(self) -> tuple[int, int]:
        """Error and value."""
        self.write(0x018, 0x01)
        self.clock.sleep(0.1)
        return self.read(0x04D)[0] >> 4, self.read(0x062)[0]

    def write(self, register: int, *values: int) -> None:
        self.chip.i2c_rdwr(i2c_msg.write(ADDRESS, [register >> 8, register & 0xFF, *values]))


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def tuned(bench: Bench) -> Bench:
    VL6180X(bench.link, clock=bench.clock).start()
    return bench


def test_fresh_out_of_reset(bench: Bench) -> None:
    assert bench.read(0x000) == b"\xb4"
    assert bench.read(0x016) == b"\x01"
    assert bench.read(0x04D) == b"\x01"


def test_the_index_advances(bench: Bench) -> None:
    bench.write(0x100, 1, 2, 3)
    assert bench.read(0x100, 3) == b"\x01\x02\x03"
    assert bench.read(0x101) == b"\x02"


def test_a_single_shot(tuned: Bench) -> None:
    tuned.write(0x018, 0x01)
    assert tuned.read(0x04F)[0] & 7 == 0
    assert tuned.read(0x04D)[0] & 1 == 0
    tuned.clock.sleep(0.1)
    assert tuned.read(0x04F)[0] & 7 == 4
    assert tuned.read(0x04D) == b"\x01"
    assert tuned.read(0x062) == b"\x2a"
    tuned.write(0x015, 0x07)
    assert tuned.read(0x04F)[0] & 7 == 0
    assert tuned.read(0x062) == b"\x2a"  # the old value stays: only the status tells


def test_no_target(tuned: Bench) -> None:
    tuned.distance = None
    tuned.write(0x018, 0x01)
    tuned.clock.sleep(0.03)
    assert tuned.read(0x04F)[0] & 7 == 0  # it tries for longer than with a target
    tuned.clock.sleep(0.1)
    assert tuned.read(0x04D)[0] >> 4 == 7


def test_without_its_settings_it_measures_wrongly_and_says_nothing(bench: Bench) -> None:
    assert bench.measure() == (0, 34)


def test_one_wrong_setting_is_enough(tuned: Bench) -> None:
    tuned.write(0x0DB, 0xCD)
    assert tuned.measure() == (0, 34)


@pytest.mark.parametrize(("scaler", "reading"), [(253, 99), (127, 54), (84, 39)])
def test_the_range_is_scaled_and_the_offset_is_not(tuned: Bench, scaler: int, reading: int) -> None:
    """As libraries know it, which divide the offset themselves: 9 mm of offset, 90 mm before it."""
    tuned.distance = 99.0
    tuned.write(0x096, *scaler.to_bytes(2, "big"))
    assert tuned.measure() == (0, reading)


@pytest.mark.parametrize(
    ("register", "values", "distance", "outcome"),
    [
        (0x01C, (5,), 42.0, (7, 255)),  # ms
        (0x01C, (5,), 10.0, (0, 10)),
        (0x022, (0x09, 0x00), 42.0, (6, 255)),  # 18 Mcps
        (0x022, (0x09, 0x00), 10.0, (0, 10)),
        (0x024, (0xFF,), 42.0, (0, 32)),  # an offset of -1 instead of 9
    ],
)
def test_settings_of_a_measurement(
    tuned: Bench,
    register: int,
    values: tuple[int, ...],
    distance: float,
    outcome: tuple[int, int],
) -> None:
    tuned.distance = distance
    tuned.write(register, *values)
    assert tuned.measure() == outcome


def test_a_weak_return_is_ignored_where_that_is_switched_on(tuned: Bench) -> None:
    tuned.write(0x026, 0x09, 0x00)
    assert tuned.measure() == (0, 42)
    tuned.write(0x02D, 0x13)
    assert tuned.measure() == (8, 255)


def test_settings_are_held_back_while_they_are_written(tuned: Bench) -> None:
    assert tuned.measure() == (0, 42)
    tuned.write(0x017, 0x01)
    tuned.write(0x024, 0x00)
    assert tuned.measure() == (0, 42)
    tuned.write(0x017, 0x00)
    assert tuned.measure() == (0, 33)


def test_measurements_go_on_and_on_until_they_are_started_again(tuned: Bench) -> None:
    tuned.write(0x018, 0x03)
    for distance in (30.0, 60.0):
        tuned.distance = distance
        for _ in range(2):  # the one under way, and the next
            tuned.clock.sleep(0.1)
            assert tuned.read(0x04D)[0] & 1 == 0
        assert tuned.read(0x062)[0] == distance
    tuned.write(0x018, 0x01)
    tuned.clock.sleep(0.1)
    assert tuned.read(0x04D) == b"\x01"
    tuned.distance = 42.0
    assert tuned.measure() == (0, 42)


def test_results_cannot_be_written(tuned: Bench) -> None:
    tuned.write(0x062, 99)
    assert tuned.read(0x062) == b"\x00"


def test_a_reset_forgets_everything(tuned: Bench) -> None:
    assert tuned.read(0x016) == b"\x00"
    tuned.chip.power_cycle()
    assert tuned.read(0x016) == b"\x01"


def test_other_addresses_are_not_acknowledged(bench: Bench) -> None:
    with pytest.raises(OSError, match="Remote I/O") as caught:
        bench.chip.i2c_rdwr(i2c_msg.write(0x30, [0, 0]))
    assert caught.value.errno == errno.EREMOTEIO
    bench.write(0x212, 0x30)
    bench.chip.i2c_rdwr(i2c_msg.write(0x30, [0, 0]))
    bench.chip.power_cycle()
    assert bench.read(0x000) == b"\xb4"


def test_a_transfer_takes_100_microseconds(bench: Bench) -> None:
    bench.read(0x000)
    bench.write(0x100, 1)
    assert bench.clock.now() == pytest.approx(200e-6)


def test_a_frozen_distance_thaws(tuned: Bench) -> None:
    sensor = VL6180X(tuned.link, clock=tuned.clock)
    sensor.start()
    tuned.chip.inject("frozen")
    assert sensor.range_mm() == 42
    tuned.distance = 10.0
    assert sensor.range_mm() == 42
    tuned.chip.mend()
    assert sensor.range_mm() == 10
