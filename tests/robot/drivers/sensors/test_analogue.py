"""A switch on an analogue input, on an ADS1115 as a foot has it."""

from __future__ import annotations

import pytest

from robot.drivers.buses import Buses
from robot.drivers.registry import SENSORS, read_settings
from robot.drivers.sensors.ads1115 import ADS1115Settings
from robot.drivers.sensors.analogue import Switch, SwitchSettings
from robot.drivers.sensors.contracts import attach_board
from robot.errors import ConfigError, DeviceDataError
from robot.toml_sections import toml_section
from sim_robot.electronics.ads1115 import ADS1115Emulator
from tests.robot.clocks import InstantClock


def settings(text: str) -> SwitchSettings:
    section = toml_section(f'[touch]\ndriver = "switch"\n{text}', "robot.toml").table("touch")
    found: SwitchSettings = read_settings(section, SENSORS, "analogue", kind="touch")
    return found


class Foot:
    """With a resistor to the supply of 3.3 V, another across the switch: 1.65 V free, 0 pressed."""

    def __init__(self) -> None:
        self.volts = 1.65
        self.clock = InstantClock()
        chip = ADS1115Emulator(lambda channel: self.volts, self.clock)
        board = ADS1115Settings(bus=1, addresses=(0x48,), input_range="±4.096V")
        buses = attach_board(Buses(clock=self.clock, open_i2c=lambda path: chip), board)
        self.switch: Switch = settings("channel = 2\npressed_v = 0\nfree_v = 1.65").open(
            buses, "lower_left"
        )

    def feel(self, volts: float) -> bool:
        self.volts = volts
        self.clock.sleep(0.02)
        pressed = self.switch.load()
        self.switch.check()
        return pressed


def test_pressed_and_free_with_hysteresis_in_between() -> None:
    foot = Foot()
    volts = (1.65, 0.9, 0.1, 0.8, 1.1, 0.8, 0.0)
    assert [foot.feel(one) for one in volts] == [False, False, True, True, False, False, True]


def test_a_switch_that_rests_for_long_is_not_stuck() -> None:
    foot = Foot()
    assert not any(foot.feel(1.65) for _ in range(60))


def test_a_wire_that_has_come_off_is_noticed() -> None:
    foot = Foot()
    with pytest.raises(DeviceDataError, match=r"switch of lower_left has 3\.30 V, and pressed 0 V"):
        foot.feel(3.3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("channel = 0\npressed_v = 1\nfree_v = 1.1", "pressed_v: must differ from free_v, 1.1"),
        ("channel = 1024\npressed_v = 0\nfree_v = 3.3", "channel: must be an integer from 0 to"),
        ("channel = 0\nfree_v = 3.3", "pressed_v: is missing"),
    ],
)
def test_a_wrong_value_is_named(text: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        settings(text)
    assert words in str(caught.value)


def test_an_input_beyond_those_of_our_boards_is_for_the_board_to_refuse() -> None:
    assert settings("channel = 40\npressed_v = 0\nfree_v = 3.3").channel == 40
