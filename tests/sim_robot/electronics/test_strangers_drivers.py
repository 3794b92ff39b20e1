"""Drivers that others wrote from the data sheets work on the emulated chips.

Each is a distribution of its own on the package index, made for a Raspberry Pi. They reach the bus
through ``smbus`` or ``smbus2``, of which ``Bus`` offers what they use, or make the kernel's calls.
"""

from __future__ import annotations

import ctypes
import fcntl
import importlib
import os
import sys
import types
from collections.abc import Iterator
from typing import Any, ClassVar

import pytest
import smbus2
from smbus2 import i2c_msg

from sim_robot.electronics.ads1115 import ADS1115Emulator
from sim_robot.electronics.gpio import Chip, GPIOEmulator
from sim_robot.electronics.i2c_bus import I2CBus
from sim_robot.electronics.mpu6050 import MPU6050Emulator
from sim_robot.electronics.pca9685 import PCA9685Emulator
from tests.robot.clocks import InstantClock


class Bus:
    """``smbus2.SMBus``, on emulated chips."""

    chips: ClassVar[I2CBus]

    def __init__(self, number: int):
        del number

    def __enter__(self) -> Bus:
        return self

    def __exit__(self, *_: object) -> None:
        """The bus stays open."""

    def write_byte_data(self, address: int, register: int, value: int) -> None:
        self.write_i2c_block_data(address, register, [value])

    def write_i2c_block_data(self, address: int, register: int, data: list[int]) -> None:
        self.chips.i2c_rdwr(i2c_msg.write(address, [register, *data]))

    def read_byte_data(self, address: int, register: int) -> int:
        return self.read_i2c_block_data(address, register, 1)[0]

    def read_i2c_block_data(self, address: int, register: int, length: int) -> list[int]:
        data = i2c_msg.read(address, length)
        self.chips.i2c_rdwr(i2c_msg.write(address, [register]), data)
        return list(bytes(data))


class Chips:
    """All of them on one bus."""

    def __init__(self) -> None:
        self.clock = InstantClock()
        self.volts = [0.0, 0.5, 1.65, 3.3]
        self.acceleration = (0.25, -0.5, 0.83)
        self.pwm = PCA9685Emulator(self.clock)
        self.adc = ADS1115Emulator(lambda channel: self.volts[channel], self.clock)
        self.imu = MPU6050Emulator(lambda: self.acceleration, self.clock)
        self.bus = I2CBus([self.pwm, self.adc, self.imu], self.clock)


@pytest.fixture
def chips(monkeypatch: pytest.MonkeyPatch) -> Iterator[Chips]:
    found = Chips()
    monkeypatch.setattr(Bus, "chips", found.bus, raising=False)
    monkeypatch.setattr(smbus2, "SMBus", Bus)
    smbus = types.ModuleType("smbus")
    smbus.SMBus = Bus  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "smbus", smbus)
    before = set(sys.modules)
    yield found
    for name in set(sys.modules) - before:  # what was imported has our bus in it
        if name.startswith(("PCA9685_smbus2", "mpu6050", "ADS1x15")):
            del sys.modules[name]


def load(module: str) -> Any:
    return importlib.import_module(module)


def test_pca9685_smbus2_moves_servos(chips: Chips) -> None:
    board = load("PCA9685_smbus2.PCA9685").PCA9685(interface=1, address=0x40)
    board.set_pwm_freq(50)
    assert chips.pwm.tick_us == pytest.approx(4.88)
    board.set_pwm(0, 0, 307)
    board.set_pwm(15, 1000, 1307)
    assert chips.pwm.pulses() == (307, *(0,) * 14, 307)
    board.set_all_pwm(0, 205)
    assert chips.pwm.pulses() == (205,) * 16
    board.set_all_pwm(0, 4096)  # its full-off bit
    assert chips.pwm.pulses() == (0,) * 16


def test_mpu6050_raspberrypi_feels_gravity(chips: Chips) -> None:
    sensor = load("mpu6050").mpu6050(0x68)
    measured = sensor.get_accel_data(g=True)
    assert [measured[axis] for axis in "xyz"] == pytest.approx(chips.acceleration, abs=2e-4)
    chips.imu.celsius = 41.5
    chips.clock.sleep(0.01)
    assert sensor.get_temp() == pytest.approx(41.5, abs=0.01)
    sensor.set_accel_range(sensor.ACCEL_RANGE_8G)
    assert sensor.read_accel_range() == 8
    chips.clock.sleep(0.01)
    measured = sensor.get_accel_data()
    assert measured["z"] == pytest.approx(0.83 * 9.80665, abs=5e-3)


def test_ads1x15_adc_measures_each_input(chips: Chips) -> None:
    module = load("ADS1x15")
    adc = module.ADS1115(1, 0x48)
    adc.setMode(adc.MODE_SINGLE)
    for gain, scale in ((adc.PGA_4_096V, 4.096), (adc.PGA_6_144V, 6.144)):
        adc.setGain(gain)
        assert adc.getMaxVoltage() == pytest.approx(scale)
        chips.clock.sleep(0.02)  # what each setting started ends with the settings before
        volts = [adc.toVoltage(adc.readADC(channel)) for channel in range(4)]
        assert volts == pytest.approx(chips.volts, abs=2e-4)
    assert adc.toVoltage(adc.readADC_Differential_0_1()) == pytest.approx(-0.5, abs=2e-4)
    adc.setMode(adc.MODE_CONTINUOUS)
    adc.requestADC(2)
    chips.clock.sleep(0.02)
    chips.volts[2] = 1.0
    chips.clock.sleep(0.02)
    adc.getValue()
    chips.clock.sleep(0.02)
    assert adc.toVoltage(adc.getValue()) == pytest.approx(1.0, abs=2e-4)


def test_python_periphery_reads_and_drives_gpio_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    outside: dict[int, bool | None] = {17: None}
    driven: list[tuple[int, bool]] = []
    chips = GPIOEmulator(
        [Chip(path="/dev/gpiochip7", names={17: "GPIO17"})],
        lambda chip, line: outside[line],
        InstantClock(),
        driven=lambda chip, line, high: driven.append((line, high)),
    )

    def ioctl(file: int, request: int, argument: ctypes.Structure) -> None:
        answer = bytearray(argument)
        chips.ioctl(file, request, answer)
        ctypes.memmove(ctypes.addressof(argument), bytes(answer), len(answer))

    monkeypatch.setattr(fcntl, "ioctl", ioctl)
    monkeypatch.setattr(os, "open", lambda path, flags: chips.open(path))
    monkeypatch.setattr(os, "close", chips.close)
    gpio = load("periphery").GPIO
    foot = gpio("/dev/gpiochip7", "GPIO17", "in", bias="pull_up", inverted=True)
    assert (foot.line, foot.chip_label, foot.name) == (17, "pinctrl-bcm2835", "GPIO17")
    assert not foot.read()
    outside[17] = False
    assert foot.read()
    with pytest.raises(Exception, match="busy"):
        gpio("/dev/gpiochip7", 17, "out")
    foot.close()
    with pytest.raises(Exception, match="Invalid argument"):
        gpio("/dev/gpiochip7", 54, "in")
    enable = gpio("/dev/gpiochip7", 17, "high", label="enable")
    enable.write(False)
    assert not enable.read()
    assert driven == [(17, True), (17, False)]
    assert enable.label == "enable"
    enable.close()
    assert chips.handles == 0
