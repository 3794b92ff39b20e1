"""A foot switch on a GPIO line."""

from __future__ import annotations

import pytest

from robot.configuration.device_tables import read_touch
from robot.drivers.buses import Buses
from robot.drivers.sensors.gpio import GPIOSwitch, GPIOSwitchSettings
from robot.errors import ConfigError, DeviceMissingError
from robot.toml_sections import toml_section
from sim_robot.electronics.gpio import Chip, GPIOEmulator
from tests.robot.clocks import InstantClock


def settings(keys: str) -> GPIOSwitchSettings:
    text = f'[[touch]]\nname = "foot"\ndriver = "gpio"\n{keys}'
    (table,) = toml_section(text, "robot.toml").tables("touch")
    driver = read_touch(table).driver
    assert isinstance(driver, GPIOSwitchSettings)
    return driver


class Foot:
    """A switch between line 17 and ground, or the supply."""

    def __init__(self, keys: str = "line = 17", *, to_ground: bool = True):
        self.closed = False
        self._to_ground = to_ground
        self.gpio = GPIOEmulator([Chip(names={17: "GPIO17"})], self._level, InstantClock())
        buses = Buses(clock=InstantClock(), gpio=self.gpio)
        self.switch: GPIOSwitch = settings(keys).open(buses, "foot")
        self.switch.start()

    def _level(self, chip: str, line: int) -> bool | None:
        assert (chip, line) == ("/dev/gpiochip0", 17)
        return not self._to_ground if self.closed else None

    def felt(self) -> list[bool]:
        found = []
        for self.closed in (False, True, False):
            self.switch.check()
            found.append(self.switch.load())
        return found


@pytest.mark.parametrize("line", ["17", '"GPIO17"'])
@pytest.mark.parametrize("chip", ["/dev/gpiochip0", "pinctrl-bcm2835"])
def test_a_switch_to_ground_is_pulled_up_and_low_when_pressed(line: str, chip: str) -> None:
    assert Foot(f'line = {line}\nchip = "{chip}"').felt() == [False, True, False]


def test_a_switch_to_the_supply_is_pulled_down_and_high_when_pressed() -> None:
    foot = Foot('line = 17\npressed = "high"', to_ground=False)
    assert foot.felt() == [False, True, False]


def test_a_wire_that_came_off_feels_like_a_free_foot_and_a_short_like_a_pressed_one() -> None:
    foot = Foot()
    foot.gpio.inject("broken", 17)
    assert foot.felt() == [False, False, False]
    foot.gpio.mend()
    foot.gpio.inject("short", 17)
    assert foot.felt() == [True, True, True]


def test_a_chip_that_was_unplugged_is_opened_anew() -> None:
    foot = Foot()
    foot.gpio.inject("unplugged")
    with pytest.raises(DeviceMissingError, match="line 17 of /dev/gpiochip0 cannot be read"):
        foot.switch.load()
    with pytest.raises(DeviceMissingError, match="There is no GPIO chip at all"):
        foot.switch.start()
    foot.gpio.mend()
    foot.switch.start()
    assert foot.felt() == [False, True, False]
    foot.switch.close()
    foot.switch.close()
    assert foot.gpio.handles == 0


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("", "line: is missing."),
        ("line = 512", "must be a name, or an integer from 0 to 511, not 512."),
        ("line = true", "must be a name, or an integer from 0 to 511, not True."),
        ('line = ""', "must be a name, or an integer from 0 to 511, not ''."),
        (
            'line = 17\npull = "down"',
            "pull: is down, and the line low while pressed: it would be low all the time. Write "
            "up, or none where the line has a resistor of its own.",
        ),
        ("line = 17\ndebounce_ms = 1000", "must be a number from 0 to 100 milliseconds"),
        ("line = 17\nchannel = 3", "is not a known key."),
    ],
)
def test_a_wrong_table_is_refused(keys: str, words: str) -> None:
    with pytest.raises(ConfigError, match=r"robot\.toml: touch 1 \(foot\)") as refused:
        settings(keys)
    assert words in str(refused.value)
