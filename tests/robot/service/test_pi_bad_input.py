"""What is wrong with a robot on I²C is a sentence with file, key and, where there is one, joint."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from robot.cli.command_line import main
from robot.configuration.robot_config import load_config
from robot.devices import open_devices
from robot.drivers.buses import Buses
from robot.errors import ConfigError, DeviceMissingError
from sim_robot.electronics.ads1115 import ADS1115Emulator
from sim_robot.electronics.i2c_bus import I2CBus, I2CDevice
from sim_robot.electronics.mpu6050 import MPU6050Emulator
from sim_robot.electronics.pca9685 import PCA9685Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator
from tests.robot.clocks import InstantClock


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "robot.toml"
    assert main(["new", "--electronics", "pi", str(path)]) == 0
    text = path.read_text(encoding="utf-8").replace("\n[calibration]", "\n#[calibration]")
    path.write_text(text.replace('\nfile = "cal', '\n#file = "cal'), encoding="utf-8")
    load_config(path)
    return path


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        # two devices at one address
        ("address = 0x68 ", "address = 0x29 ", ["accelerometer.address", "0x68, 0x69, not 0x29"]),
        (
            "address = 0x29",
            "address = 0x48",
            ["distance: is at 0x48 on I²C bus 1, where daq answers already"],
        ),
        ("address = 0x29", "address = 0x70", ["distance: is at 0x70", "where servos answers"]),
        ("address = 0x40 ", "address = [0x40, 0x48] ", ["daq: is at 0x48", "where servos answers"]),
        ("address = 0x40 ", "address = [0x40, 0x40] ", ["servos.address", "different ones"]),
        # an update rate that a servo cannot follow
        ("update_hz = 50", "update_hz = 100", ["servos.update_hz: is 100, and an analogue servo"]),
        # pulse widths outside 500 to 2,500 µs
        ("pulse_us = [500, 2500]", "pulse_us = [400, 2500]", ["servos.pulse_us", "500 to 2500"]),
        (
            "calibration = [[123, -90], [492, 90]]",
            "calibration = [[90, -90], [492, 90]]",
            ["joint 1 (", ").calibration: counts must lie in 91 to 573"],
        ),
        # a sensor named twice
        ("[distance]", "[accelerometer]", ["accelerometer", "TOML"]),
        ("output = 1\n", "output = 0\n", ["joint 2 (", ".output: is 0, as that of joint 1 ("]),
        ("output = 1\n", "output = 16\n", ["joint 2 (", ".output", "is 16"]),
    ],
)
def test_a_wrong_value_is_named(file: Path, old: str, new: str, words: list[str]) -> None:
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_config(file)
    sentence = str(caught.value)
    assert sentence.startswith(f"{file}: ")
    assert all(word in sentence for word in words), sentence


def test_a_touch_sensor_named_twice(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    *_, third, fourth = [line for line in text.splitlines() if line.startswith("name = ")]
    file.write_text(text.replace(fourth, third), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"touch 4 \(.+\)\.name: is '.+', as that of touch 3"):
        load_config(file)


def test_a_bus_that_is_not_there(file: Path) -> None:
    text = file.read_text(encoding="utf-8").replace("bus = 1", "bus = 250")
    file.write_text(text, encoding="utf-8")
    with pytest.raises(DeviceMissingError) as caught:
        open_devices(load_config(file), Buses(clock=InstantClock()), file=str(file))
    assert f"{file}: servos: The I²C bus /dev/i2c-250 cannot be opened" in str(caught.value)


def other_servo_board(clock: InstantClock) -> I2CDevice:
    return MPU6050Emulator(lambda: (0.0, 0.0, 1.0), clock, address=0x40)


def other_accelerometer(clock: InstantClock) -> I2CDevice:
    chip = MPU6050Emulator(lambda: (0.0, 0.0, 1.0), clock)
    chip.inject("other", 0x70)
    return chip


def other_inputs(clock: InstantClock) -> I2CDevice:
    return MPU6050Emulator(lambda: (0.0, 0.0, 1.0), clock, address=0x48)


def other_distance(clock: InstantClock) -> I2CDevice:
    return ADS1115Emulator(lambda channel: 0.0, clock, address=0x29)


@pytest.mark.parametrize(
    ("table", "other", "words"),
    [
        ("servos", other_servo_board, "0x40 is no PCA9685: its registers 2 to 5 hold"),
        ("daq", other_inputs, "0x48 is no ADS1115: its registers 2 and 3 hold"),
        ("accelerometer", other_accelerometer, "0x68 is no MPU-6050: it calls itself 0x70"),
        ("distance", other_distance, "0x29 is no VL6180X: it calls itself"),
    ],
)
def test_another_chip_at_the_address(
    file: Path, table: str, other: Callable[[InstantClock], I2CDevice], words: str
) -> None:
    clock = InstantClock()
    chips: dict[str, I2CDevice] = {
        "servos": PCA9685Emulator(clock),
        "daq": ADS1115Emulator(lambda channel: 0.2, clock),
        "accelerometer": MPU6050Emulator(lambda: (0.0, 0.0, 1.0), clock),
        "distance": VL6180XEmulator(lambda: 10.0, clock),
        table: other(clock),
    }
    bus = I2CBus(chips.values(), clock)
    with pytest.raises(DeviceMissingError) as caught:
        open_devices(
            load_config(file),
            Buses(clock=clock, open_i2c=lambda path: bus),
            file=str(file),
        )
    assert str(caught.value).startswith(f"{file}: {table}: The device at I²C address ")
    assert words in str(caught.value)
