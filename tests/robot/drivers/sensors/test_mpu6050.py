"""The MPU-6050's driver against the emulated chip."""

from __future__ import annotations

import pytest
from smbus2 import i2c_msg

from robot.drivers.buses import Buses
from robot.drivers.sensors.mpu6050 import MPU6050, MPU6050Settings
from robot.errors import ConfigError, DeviceDataError, DeviceMissingError, DeviceTimeoutError
from robot.toml_sections import toml_section
from sim_robot.electronics.mpu6050 import MPU6050Emulator
from tests.robot.clocks import InstantClock


def settings(text: str = "") -> MPU6050Settings:
    section = toml_section(f"[accelerometer]\n{text}", "robot.toml").table("accelerometer")
    found = MPU6050Settings.read(section)
    section.done()
    return found


class Bench:
    """A chip that lies still."""

    def __init__(self, text: str = "") -> None:
        self.clock = InstantClock()
        self.felt = (0.1, -0.2, 0.95)
        self.chip = MPU6050Emulator(lambda: self.felt, self.clock)
        buses = Buses(clock=self.clock, open_i2c=lambda path: self.chip)
        self.sensor: MPU6050 = settings(text).open(buses, "accelerometer")

    def next(self) -> tuple[float, float, float]:
        self.clock.sleep(0.02)
        sample = self.sensor.acceleration()
        self.sensor.check()
        return sample


@pytest.fixture
def bench() -> Bench:
    found = Bench()
    found.sensor.start()
    return found


def test_gravity_in_g(bench: Bench) -> None:
    assert bench.next() == pytest.approx(bench.felt, abs=1e-3)
    bench.felt = (-0.9, 0.3, -0.3)
    assert bench.next() == pytest.approx(bench.felt, abs=1e-3)


def test_calibration_and_mounting() -> None:
    bench = Bench(
        'forward = "-y"\nleft = "x"\nup = "z"\n'
        "zero_g = [0.05, 0, -0.04]\ng_per_g = [1.02, -1, 0.98]"
    )
    bench.sensor.start()
    x, y, z = bench.felt
    expected = ((-y - 0.05) / 1.02, -x, (z + 0.04) / 0.98)
    assert bench.next() == pytest.approx(expected, abs=1e-3)


def test_the_doctor_is_told_of_the_self_test_and_the_temperature(bench: Bench) -> None:
    bench.chip.celsius = 31.2
    bench.next()
    assert bench.sensor.details() == "self-test x +2%, y +2%, z +2% of at most 14%; 31 °C"


@pytest.mark.parametrize(
    ("fault", "number", "error", "words"),
    [
        ("nak", 0, DeviceMissingError, "Nothing acknowledges"),
        ("hang", 0, DeviceTimeoutError, "hangs"),
        ("railed_axis", 2, DeviceDataError, "at the end of its range, 2 g"),
        ("reset", 0, DeviceDataError, "was reset: it sleeps and has lost its settings"),
        ("sleep", 0, DeviceDataError, "sleeps, or lost its clock"),
    ],
)
def test_a_fault_is_a_sentence_and_start_mends_it(
    bench: Bench, fault: str, number: int, error: type[Exception], words: str
) -> None:
    bench.next()
    bench.chip.inject(fault, number)
    with pytest.raises(error, match=words):
        bench.next()
    bench.chip.mend()
    bench.sensor.start()
    assert bench.next() == pytest.approx(bench.felt, abs=1e-3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_axis_that_never_changes_is_stuck(bench: Bench, axis: int) -> None:
    for _ in range(40):
        bench.next()  # a live one does
    bench.chip.inject("stuck_axis", axis)
    for _ in range(20):
        bench.clock.sleep(0.02)
        bench.sensor.raw()
    with pytest.raises(DeviceDataError, match=f"{'xyz'[axis]} axis is stuck"):
        bench.sensor.check()


def test_another_axis_sticks_where_it_is_itself(bench: Bench) -> None:
    bench.chip.inject("stuck_axis", 0)
    bench.next()
    bench.chip.inject("stuck_axis", 2)
    assert bench.next() == pytest.approx(bench.felt, abs=1e-2)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_axis_that_fails_its_self_test_is_named(bench: Bench, axis: int) -> None:
    bench.chip.inject("weak", axis)
    with pytest.raises(DeviceDataError, match=f"its {'xyz'[axis]} axis moved by"):
        bench.sensor.start()


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (0x70, "itself 0x70 instead of 0x68, as an MPU-6500 does. Many boards sold as GY-521"),
        (0x98, "itself 0x98 instead of 0x68, as an ICM-20689 does. Many boards sold as GY-521"),
        (0x72, "itself 0x72 instead of 0x68. Check which sensor is fitted"),
    ],
)
def test_another_chip_at_the_address_is_named(bench: Bench, number: int, words: str) -> None:
    bench.chip.inject("other", number)
    with pytest.raises(DeviceMissingError, match="0x68 is no MPU-6050: it calls ") as caught:
        bench.sensor.start()
    assert words in str(caught.value)
    assert "will not do" in str(caught.value)


def test_a_copy_without_factory_trim_is_named(bench: Bench) -> None:
    bench.chip.inject("untrimmed")
    with pytest.raises(DeviceMissingError, match="no factory trim: it is no genuine MPU-6050"):
        bench.sensor.start()


LEFT = {  # register and what another program leaves there
    "an offset": (0x06, [0x00, 0x00]),
    "sample rate": (0x19, [255]),
    "filter": (0x1A, [0x06]),
    "range": (0x1C, [0x18]),
    "self-test": (0x1C, [0xE0]),
    "sleep": (0x6B, [0x40]),
    "cycles": (0x6B, [0x28]),
    "clock": (0x6B, [0x07]),
    "an axis that stands by": (0x6C, [0x20]),
}


@pytest.mark.parametrize("setting", LEFT)
def test_what_another_program_left_ends_with_the_reset_of_a_start(setting: str) -> None:
    bench = Bench()
    bench.chip.i2c_rdwr(i2c_msg.write(0x68, [0x6B, 0x00]))
    register, values = LEFT[setting]
    bench.chip.i2c_rdwr(i2c_msg.write(0x68, [register, *values]))
    bench.sensor.start()
    assert bench.next() == pytest.approx(bench.felt, abs=1e-3)


@pytest.mark.parametrize("setting", LEFT)
def test_what_another_program_changes_meanwhile_is_noticed(bench: Bench, setting: str) -> None:
    bench.next()
    register, values = LEFT[setting]
    bench.chip.i2c_rdwr(i2c_msg.write(0x68, [register, *values]))
    with pytest.raises(DeviceDataError, match=r"as it was set up|sleeps"):
        bench.next()
    bench.sensor.start()
    assert bench.next() == pytest.approx(bench.felt, abs=1e-3)


class Stubborn(MPU6050Emulator):
    """A copy that takes no reset."""

    def receive(self, data: bytes) -> bool:
        return data == b"\x6b\x80" or super().receive(data)


def test_a_chip_that_takes_no_reset_is_not_believed() -> None:
    bench = Bench()
    chip = Stubborn(lambda: bench.felt, bench.clock)
    chip.i2c_rdwr(i2c_msg.write(0x68, [0x6B, 0x01]))
    sensor = settings().open(Buses(clock=bench.clock, open_i2c=lambda path: chip), "accelerometer")
    with pytest.raises(DeviceDataError, match="told to reset and did not"):
        sensor.start()


@pytest.mark.parametrize("fault", ["nak", "unheard"])
@pytest.mark.parametrize("every", [2, 3, 7, 40])
def test_lost_acknowledges_cost_no_sample(fault: str, every: int) -> None:
    bench = Bench()
    bench.chip.inject(fault, every)
    bench.sensor.start()
    for _ in range(20):
        assert bench.next() == pytest.approx(bench.felt, abs=1e-3)
    assert bench.sensor.link.repeats > 0


@pytest.mark.parametrize("celsius", [-55.0, 120.0])
def test_a_temperature_that_cannot_be(bench: Bench, celsius: float) -> None:
    bench.chip.celsius = celsius
    with pytest.raises(DeviceDataError, match="°C"):
        bench.next()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("address = 0x40", "accelerometer.address: must be one of 0x68, 0x69, not 0x40"),
        ('forward = "y"', "accelerometer.forward: is y, left y and up z: a chip can be turned"),
        ('up = "-z"', "but not mirrored"),
        ('up = "down"', "accelerometer.up: must be one of x, y, z, -x, -y, -z"),
        ("zero_g = [1, 0, 0]\ng_per_g = [1, 1, 1]", "from -0.5 to 0.5 g, not 1"),
        ("zero_g = [0, 0, 0]", "accelerometer.g_per_g: is missing"),
        ("g_per_g = [1, 1, 9]", "from 0.5 to 2 g, not 9"),
    ],
)
def test_a_wrong_value_is_named(text: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        settings(text)
    assert words in str(caught.value)
