"""The ADS1115's driver against two emulated chips."""

from __future__ import annotations

import pytest

from robot.drivers.buses import Buses
from robot.drivers.sensors.ads1115 import ADS1115, ADS1115Settings
from robot.errors import (
    CommandError,
    ConfigError,
    DeviceDataError,
    DeviceError,
    DeviceMissingError,
    DeviceTimeoutError,
)
from robot.toml_sections import toml_section
from sim_robot.electronics.ads1115 import ADS1115Emulator
from sim_robot.electronics.i2c_bus import I2CBus
from tests.robot.clocks import InstantClock


def settings(text: str = "") -> ADS1115Settings:
    return ADS1115Settings.read(toml_section(f"[daq]\n{text}", "robot.toml").table("daq"))


class Bench:
    """Eight inputs."""

    def __init__(self) -> None:
        self.clock = InstantClock()
        self.volts = [0.0, 0.4, 1.65, 3.3, -0.1, 0.001, 4.0, 2.5]
        self.chips = [
            ADS1115Emulator(lambda n: self.volts[n], self.clock),
            ADS1115Emulator(lambda n: self.volts[4 + n], self.clock, address=0x49),
        ]
        bus = I2CBus(self.chips, self.clock)
        self.inputs: ADS1115 = settings("address = [0x48, 0x49]").open(
            Buses(clock=self.clock, open_i2c=lambda path: bus)
        )
        self.inputs.probe()


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_volts_of_every_input_on_every_chip(bench: Bench) -> None:
    assert bench.inputs.scan(0, 7) == pytest.approx(bench.volts, abs=1e-4)
    assert bench.inputs.scan(3, 5) == pytest.approx(bench.volts[3:6], abs=1e-4)


def test_every_conversion_is_fresh_and_soon_done(bench: Bench) -> None:
    before = bench.clock.now()
    bench.inputs.scan(0, 3)
    assert bench.clock.now() - before < 0.009
    bench.volts[0] = 2.0
    assert bench.inputs.scan(0, 0) == pytest.approx([2.0], abs=1e-4)


def test_the_range_is_the_one_of_the_configuration() -> None:
    clock = InstantClock()
    chip = ADS1115Emulator(lambda n: 1.5, clock)
    buses = Buses(clock=clock, open_i2c=lambda path: chip)
    narrow = settings('input_range = "±1.024V"')
    assert narrow.rails == (-1.024, 1.024)
    wide = settings('input_range = "±6.144V"')
    for found, volts in ((narrow, 1.024), (wide, 1.5)):  # the first is at its end
        board = found.open(buses)
        board.probe()
        assert board.scan(0, 0) == pytest.approx([volts], abs=2e-4)


@pytest.mark.parametrize(
    ("fault", "error", "words"),
    [
        ("nak", DeviceMissingError, r"0x49 \(ADS1115\)"),
        ("hang", DeviceTimeoutError, "hangs"),
        ("busy", DeviceTimeoutError, "0x49 did not end a conversion"),
    ],
)
def test_a_fault_is_a_sentence(
    bench: Bench, fault: str, error: type[DeviceError], words: str
) -> None:
    bench.chips[1].inject(fault)
    with pytest.raises(error, match=words):
        bench.inputs.scan(0, 7)
    bench.chips[1].mend()
    bench.clock.sleep(0.1)
    assert bench.inputs.scan(0, 7) == pytest.approx(bench.volts, abs=1e-4)


def test_a_reset_in_mid_conversion_is_noticed_and_one_in_between_costs_nothing(
    bench: Bench,
) -> None:
    bench.chips[0].inject("reset")
    assert bench.inputs.scan(0, 0) == pytest.approx([0.0], abs=1e-4)
    slept = bench.clock.sleep

    def dip(seconds: float) -> None:
        slept(seconds)
        bench.chips[0].inject("reset")

    bench.clock.sleep = dip  # type: ignore[method-assign]
    with pytest.raises(DeviceDataError, match=r"0583 instead of 43e3\. It was reset"):
        bench.inputs.scan(0, 0)


class Thermometer(ADS1115Emulator):
    """An LM75: of the two limits in its registers 2 and 3 there are 9 bits each."""

    def receive(self, data: bytes) -> bool:
        if len(data) == 3 and data[0] in (2, 3):
            data = bytes((*data[:2], data[2] & 0x80))
        return super().receive(data)


def test_another_chip_at_the_address_is_named() -> None:
    clock = InstantClock()
    chip = Thermometer(lambda channel: 0.0, clock)
    for limit in ((2, 0x4B, 0x00), (3, 0x50, 0x00)):
        chip.receive(bytes(limit))
    board = settings().open(Buses(clock=clock, open_i2c=lambda path: chip))
    with pytest.raises(
        DeviceMissingError,
        match=r"0x48 is no ADS1115.* hold 4b00 and 5000, and when told .* hold 8000 and 7f80",
    ):
        board.probe()


@pytest.mark.parametrize("rate", range(8))
def test_what_another_program_left_is_ended(bench: Bench, rate: int) -> None:
    """The comparator's pin tells of each of its conversions, which go on and on."""
    bench.chips[1].inject("comparing")
    bench.chips[1].receive(bytes((1, 0x42, rate << 5)))
    bench.inputs.probe()
    assert bench.inputs.scan(5, 7) == pytest.approx(bench.volts[5:], abs=1e-4)


@pytest.mark.parametrize("fault", ["nak", "unheard"])
@pytest.mark.parametrize("every", [2, 3, 7, 40])
def test_lost_acknowledges_cost_no_conversion(bench: Bench, fault: str, every: int) -> None:
    for chip in bench.chips:
        chip.inject(fault, every)
    bench.inputs.probe()
    for _ in range(5):
        assert bench.inputs.scan(0, 7) == pytest.approx(bench.volts, abs=1e-4)
    assert bench.inputs.link.repeats > 0


def test_inputs_that_the_chips_do_not_have(bench: Bench) -> None:
    for low, high in ((-1, 0), (3, 8), (2, 1)):
        with pytest.raises(CommandError, match="0 to 7"):
            bench.inputs.scan(low, high)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("address = 0x50", "daq.address: must be an integer from 0x48 to 0x4b"),
        ('input_range = "±5V"', "daq.input_range: must be one of ±6.144V, ±4.096V"),
    ],
)
def test_a_wrong_value_is_named(text: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        settings(text)
    assert words in str(caught.value)
