"""The registers, driven by hand as the application note does it."""

from __future__ import annotations

import errno

import pytest
from smbus2 import i2c_msg

from robot.drivers.sensors.vl6180x import VL6180X
from sim_robot.electronics.vl6180x import VL6180XEmulator
from tests.robot.clocks import InstantClock

ADDRESS = 0x29


class Bench:
    def __init__(self) -> None:
        self.clock = InstantClock()
        self.distance: float | None = 42.0
        self.chip = VL6180XEmulator(lambda: self.distance, self.clock)

    def read(self, register: int, count: int = 1) -> bytes:
        data = i2c_msg.read(ADDRESS, count)
        self.chip.i2c_rdwr(i2c_msg.write(ADDRESS, [register >> 8, register & 0xFF]), data)
        return bytes(data)

    def write(self, register: int, *values: int) -> None:
        self.chip.i2c_rdwr(i2c_msg.write(ADDRESS, [register >> 8, register & 0xFF, *values]))


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def tuned(bench: Bench) -> Bench:
    VL6180X(bench.chip, clock=bench.clock).start()
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


def test_without_its_settings_it_does_not_measure(bench: Bench) -> None:
    bench.write(0x018, 0x01)
    bench.clock.sleep(0.1)
    assert bench.read(0x04D)[0] >> 4 in range(1, 6)


def test_one_wrong_setting_is_enough(tuned: Bench) -> None:
    tuned.write(0x0DB, 0xCD)
    tuned.write(0x018, 0x01)
    tuned.clock.sleep(0.1)
    assert tuned.read(0x04D)[0] >> 4 in range(1, 6)


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
    sensor = VL6180X(tuned.chip, clock=tuned.clock)
    tuned.chip.inject("frozen")
    assert sensor.range_mm() == 42
    tuned.distance = 10.0
    assert sensor.range_mm() == 42
    tuned.chip.mend()
    assert sensor.range_mm() == 10
