"""The I²C bus, and the registers of the emulated MPU-6050 and ADS1115, by their data sheets."""

from __future__ import annotations

import errno

import pytest
from smbus2 import i2c_msg

from robot.errors import DeviceMissingError
from sim_robot.electronics.ads1115 import ADS1115Emulator
from sim_robot.electronics.i2c_bus import I2CBus
from sim_robot.electronics.mpu6050 import MPU6050Emulator
from tests.robot.clocks import InstantClock


class Bench:
    def __init__(self) -> None:
        self.clock = InstantClock()
        self.volts = [0.5, 1.0, 2.0, 3.0]
        self.acceleration = (0.5, -0.25, 0.75)
        self.adc = ADS1115Emulator(lambda n: self.volts[n], self.clock)
        self.imu = MPU6050Emulator(lambda: self.acceleration, self.clock)
        self.bus = I2CBus([self.adc, self.imu], self.clock)

    def write(self, address: int, register: int, *values: int) -> None:
        self.bus.i2c_rdwr(i2c_msg.write(address, [register, *values]))

    def read(self, address: int, register: int, count: int) -> bytes:
        data = i2c_msg.read(address, count)
        self.bus.i2c_rdwr(i2c_msg.write(address, [register]), data)
        return bytes(data)

    def word(self, address: int, register: int) -> int:
        return int.from_bytes(self.read(address, register, 2), "big", signed=True)


@pytest.fixture
def bench() -> Bench:
    return Bench()


# --- the bus


def test_a_read_that_is_not_the_last_message_is_refused_as_a_raspberry_pi_does(
    bench: Bench,
) -> None:
    data = i2c_msg.read(0x68, 1)
    with pytest.raises(OSError, match="not supported") as caught:
        bench.bus.i2c_rdwr(i2c_msg.write(0x68, [0x75]), data, i2c_msg.write(0x68, [0x6B]))
    assert caught.value.errno == errno.EOPNOTSUPP


def test_nobody_at_an_address(bench: Bench) -> None:
    with pytest.raises(OSError, match="Remote I/O") as caught:
        bench.read(0x40, 0, 1)
    assert caught.value.errno == errno.EREMOTEIO


def test_a_device_that_holds_the_bus_low_hangs_all_of_it(bench: Bench) -> None:
    bench.adc.inject("hang")
    before = bench.clock.now()
    with pytest.raises(TimeoutError):
        bench.read(0x68, 0x75, 1)
    assert bench.clock.now() - before == pytest.approx(0.1)


def test_every_nth_transfer_is_not_acknowledged(bench: Bench) -> None:
    bench.imu.inject("nak", 3)
    answered = []
    for _ in range(6):
        try:
            bench.read(0x68, 0x75, 1)
            answered.append(True)
        except OSError:
            answered.append(False)
    assert answered == [True, True, False] * 2


def test_a_transfer_can_be_carried_out_and_not_be_heard_of(bench: Bench) -> None:
    bench.imu.inject("unheard", 2)
    assert bench.read(0x68, 0x75, 1) == b"\x68"
    with pytest.raises(OSError, match="Remote I/O"):
        bench.write(0x68, 0x19, 7)
    assert bench.read(0x68, 0x19, 1) == b"\x07"


def test_what_was_open_when_the_adapter_was_pulled_out_is_dead(bench: Bench) -> None:
    handle = bench.bus.open("/dev/i2c-1")
    bench.bus.inject("unplugged")
    with pytest.raises(DeviceMissingError, match="/dev/i2c-1 cannot be opened: No such file"):
        bench.bus.open("/dev/i2c-1")
    bench.bus.mend()
    with pytest.raises(OSError, match="No such device") as caught:
        handle.i2c_rdwr(i2c_msg.write(0x68, [0x75]))
    assert caught.value.errno == errno.ENODEV
    handle.close()
    bench.bus.open("/dev/i2c-1").i2c_rdwr(i2c_msg.write(0x68, [0x75]))
    assert len(bench.bus.handles) == 1


# --- MPU-6050


def test_it_sleeps_after_a_reset(bench: Bench) -> None:
    assert bench.read(0x68, 0x75, 1) == b"\x68"
    assert bench.read(0x68, 0x6B, 1) == b"\x40"
    assert bench.read(0x68, 0x3B, 6) == bytes(6)
    bench.write(0x68, 0x1C, 0x18)
    bench.write(0x68, 0x6B, 0x80)
    assert bench.read(0x68, 0x1C, 1) == b"\x00"
    assert bench.read(0x68, 0x6B, 1) == b"\x40"


@pytest.mark.parametrize(("setting", "codes"), [(0, 16384), (1, 8192), (2, 4096), (3, 2048)])
def test_the_four_ranges(bench: Bench, setting: int, codes: int) -> None:
    bench.write(0x68, 0x6B, 0)
    bench.write(0x68, 0x1C, setting << 3)
    bench.clock.sleep(0.01)
    measured = [bench.word(0x68, register) / codes for register in (0x3B, 0x3D, 0x3F)]
    assert measured == pytest.approx(bench.acceleration, abs=1.5 / codes)


def test_a_sample_stays_within_its_range_and_a_sleeping_chip_repeats_it(bench: Bench) -> None:
    bench.write(0x68, 0x6B, 0)
    bench.acceleration = (3.0, -3.0, 0.0)
    bench.clock.sleep(0.01)
    assert [bench.word(0x68, register) for register in (0x3B, 0x3D)] == [32767, -32768]
    bench.write(0x68, 0x6B, 0x40)
    bench.acceleration = (0.0, 0.0, 0.0)
    bench.clock.sleep(0.01)
    assert bench.word(0x68, 0x3B) == 32767


def test_the_self_test_moves_each_axis_by_its_factory_trim(bench: Bench) -> None:
    """FT = 4096 x 0.34 x (0.92 / 0.34) ^ ((code - 1) / 30), register map 4.4, within 14 %."""
    bench.write(0x68, 0x6B, 0)
    trims = bench.read(0x68, 0x0D, 4)
    for axis in range(3):
        code = (trims[axis] >> 5) << 2 | (trims[3] >> (4 - 2 * axis)) & 3
        assert 1 <= code <= 31
        measured = []
        for bits in (0x10, 0x10 | 0x80 >> axis):
            bench.write(0x68, 0x1C, bits)
            bench.clock.sleep(0.01)
            measured.append(bench.word(0x68, 0x3B + 2 * axis))
        trim = 4096 * 0.34 * (0.92 / 0.34) ** ((code - 1) / 30)
        assert (measured[1] - measured[0]) / trim == pytest.approx(1, abs=0.14)


def test_an_offset_shifts_an_axis_by_codes_of_8_g_and_a_reset_brings_back_its_own(
    bench: Bench,
) -> None:
    bench.write(0x68, 0x6B, 0)
    factory = bench.word(0x68, 0x08)
    bench.write(0x68, 0x08, *(factory + 1024).to_bytes(2, "big"))  # y, by 0.25 g
    bench.clock.sleep(0.01)
    assert bench.word(0x68, 0x3D) == pytest.approx(0.0, abs=2)
    bench.write(0x68, 0x6B, 0x80)
    assert bench.word(0x68, 0x08) == factory


def test_the_sample_rate_is_divided(bench: Bench) -> None:
    bench.write(0x68, 0x6B, 0)
    bench.write(0x68, 0x19, 99)
    bench.clock.sleep(0.1)
    first = bench.read(0x68, 0x3B, 6)
    bench.acceleration = (0.0, 0.0, 0.0)
    bench.clock.sleep(0.09)
    assert bench.read(0x68, 0x3B, 6) == first
    bench.clock.sleep(0.01)
    assert bench.read(0x68, 0x3B, 6) != first


def test_an_axis_that_stands_by_keeps_its_sample(bench: Bench) -> None:
    bench.write(0x68, 0x6B, 0, 0x10)  # y
    bench.clock.sleep(0.01)
    assert [bench.word(0x68, at) for at in (0x3B, 0x3D)] == pytest.approx([8192, 0], abs=1)


# --- ADS1115


def test_its_registers_after_a_reset(bench: Bench) -> None:
    assert [bench.read(0x48, register, 2).hex() for register in range(4)] == [
        "0000",
        "8583",
        "8000",
        "7fff",
    ]


def test_a_single_shot_is_busy_until_it_is_done(bench: Bench) -> None:
    bench.write(0x48, 1, 0xC3, 0x83)  # input 0, ±4.096 V, 128 a second
    assert bench.read(0x48, 1, 2)[0] & 0x80 == 0
    assert bench.word(0x48, 0) == 0
    bench.clock.sleep(1 / 128)
    assert bench.read(0x48, 1, 2) == b"\xc3\x83"
    assert bench.word(0x48, 0) == 4000  # 0.5 V


@pytest.mark.parametrize(
    ("mux", "volts"),
    [(0, -0.5), (1, -2.5), (2, -2.0), (3, -1.0), (4, 0.5), (5, 1.0), (6, 2.0), (7, 3.0)],
)
def test_inputs_and_pairs_of_inputs(bench: Bench, mux: int, volts: float) -> None:
    bench.write(0x48, 1, 0x83 | mux << 4, 0xE3)
    bench.clock.sleep(0.002)
    assert bench.word(0x48, 0) == round(volts / 4.096 * 32768)


@pytest.mark.parametrize(
    ("gain", "full_scale"), [(0, 6.144), (1, 4.096), (2, 2.048), (3, 1.024), (4, 0.512), (7, 0.256)]
)
def test_ranges(bench: Bench, gain: int, full_scale: float) -> None:
    bench.volts[0] = 0.2
    bench.write(0x48, 1, 0xC1 | gain << 1, 0xE3)
    bench.clock.sleep(0.002)
    assert bench.word(0x48, 0) == round(0.2 / full_scale * 32768)
    bench.volts[0] = 7.0
    bench.write(0x48, 1, 0xC1 | gain << 1, 0xE3)
    bench.clock.sleep(0.002)
    assert bench.word(0x48, 0) == 32767


def test_a_conversion_ends_with_the_settings_that_it_began_with(bench: Bench) -> None:
    bench.write(0x48, 1, 0xC2, 0x83)  # input 0, on and on
    bench.clock.sleep(0.001)
    bench.write(0x48, 1, 0xF3, 0x83)  # input 3, once: the start comes to nothing
    bench.clock.sleep(0.02)
    assert bench.word(0x48, 0) == round(0.5 / 4.096 * 32768)
    bench.write(0x48, 1, 0xF3, 0x83)
    bench.clock.sleep(0.02)
    assert bench.word(0x48, 0) == round(3.0 / 4.096 * 32768)


def test_continuous_conversions(bench: Bench) -> None:
    bench.write(0x48, 1, 0xC2, 0xE3)
    for volts in (0.5, 1.5):
        bench.volts[0] = volts
        bench.clock.sleep(0.002)
        bench.read(0x48, 0, 2)
        bench.clock.sleep(0.002)
        assert bench.word(0x48, 0) == round(volts / 4.096 * 32768)
