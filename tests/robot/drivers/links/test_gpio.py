"""GPIO lines: what the kernel is asked, what is said of lines that cannot be had, and who has one.

The layouts are those of ``linux/gpio.h``, as its own compiler sees them.
"""

from __future__ import annotations

import errno
import fcntl
import os
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from robot.drivers.buses import Buses
from robot.drivers.links.gpio import LinePlace, LinuxGPIO, input_line, output_line
from robot.drivers.servos.pca9685 import PCA9685, PCA9685Settings
from robot.errors import DeviceMissingError, DeviceTimeoutError
from robot.toml_sections import toml_section
from sim_robot.electronics.gpio import Chip, GPIOEmulator
from sim_robot.electronics.pca9685 import PCA9685Emulator
from tests.robot.clocks import InstantClock

MIDDLE = 307


class Kernel:
    """Takes the calls of a chip and its lines as ``linux/gpio.h`` lays them out."""

    def __init__(self, line: int):
        self.line = line
        self.calls: list[tuple[int, bytes]] = []

    def ioctl(self, file: int, request: int, data: bytearray) -> int:
        self.calls.append((request, bytes(data)))
        assert len(data) == request >> 16 & 0x3FFF
        if request == 0x8044B401:  # GPIO_GET_CHIPINFO_IOCTL
            struct.pack_into("=I", data, 64, 54)
        elif request == 0xC250B407:  # GPIO_V2_GET_LINE_IOCTL
            struct.pack_into("=i", data, 588, self.line)
        elif request == 0xC010B40E:  # GPIO_V2_LINE_GET_VALUES_IOCTL
            struct.pack_into("=Q", data, 0, 1)
        return 0


@pytest.fixture
def kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Kernel:
    chip = tmp_path / "gpiochip0"
    chip.touch()
    kernel = Kernel(os.open(chip, os.O_RDONLY))
    monkeypatch.setattr(fcntl, "ioctl", kernel.ioctl)
    return kernel


def test_an_output_is_asked_for_with_its_first_level_and_driven(
    kernel: Kernel, tmp_path: Path
) -> None:
    line = output_line(LinuxGPIO(), LinePlace(f"{tmp_path}/gpiochip0", 17), True)
    line.set(False)
    line.close()
    _, (_, request), (number, values) = kernel.calls
    assert struct.unpack_from("=II", request, 0) == (17, 0)
    assert request[256:263] == b"robotd\0"
    assert struct.unpack_from("=QI", request, 288) == (1 << 3, 1)  # an output, with one attribute:
    assert struct.unpack_from("=I4xQQ", request, 320) == (2, 1, 1)  # its value, high, of line 0
    assert struct.unpack_from("=I", request, 560) == (1,)
    assert (number, struct.unpack("=QQ", values)) == (0xC010B40F, (0, 1))
    with pytest.raises(OSError, match="Bad file"):
        os.close(kernel.line)


@pytest.mark.parametrize(("pull", "bias"), [("up", 1 << 8), ("down", 1 << 9), ("none", 1 << 10)])
def test_an_input_is_asked_for_with_its_pull_and_debounce_and_read(
    kernel: Kernel, tmp_path: Path, pull: str, bias: int
) -> None:
    place = LinePlace(f"{tmp_path}/gpiochip0", 4)
    line = input_line(LinuxGPIO(), place, pull=pull, active_low=True, debounce=0.005)
    assert line.get()
    line.close()
    _, (_, request), (number, values) = kernel.calls
    assert struct.unpack_from("=QI", request, 288) == (1 << 1 | 1 << 2 | bias, 1)
    assert struct.unpack_from("=I4xI4xQ", request, 320) == (3, 5000, 1)  # µs, of line 0
    assert (number, struct.unpack("=QQ", values)) == (0xC010B40E, (0, 1))


PI = Chip(
    label="pinctrl-rp1",
    names={17: "GPIO17", 18: "GPIO18", 40: "NC", 41: "NC"},
    taken={8: "spi0 CS0"},
)


class Computer(GPIOEmulator):
    """One whose user may not do everything."""

    def __init__(self, *chips: Chip, forbidden: int = 0):
        super().__init__(chips, lambda chip, line: None, InstantClock())
        self._forbidden = forbidden

    def open(self, path: str) -> int:
        if self._forbidden:
            raise OSError(self._forbidden, os.strerror(self._forbidden))
        return super().open(path)


def sentence(computer: Any, chip: str, line: int | str) -> str:
    with pytest.raises(DeviceMissingError) as refused:
        input_line(computer, LinePlace(chip, line), pull="up", active_low=True, debounce=0.0)
    return str(refused.value)


OTHER = Chip(path="/dev/gpiochip1", label="gpio-fan")


@pytest.mark.parametrize(
    ("computer", "chip", "line", "words"),
    [
        (Computer(PI, OTHER), "/dev/gpiochip4", 3, "There are /dev/gpiochip0, /dev/gpiochip1."),
        (Computer(), "/dev/gpiochip0", 3, "There is no GPIO chip at all."),
        (Computer(), "pinctrl-rp1", 3, "There is no GPIO chip that this user may open."),
        (
            Computer(PI, OTHER),
            "pinctrl-bcm2711",
            3,
            "No GPIO chip is called pinctrl-bcm2711. Write one of /dev/gpiochip0 (pinctrl-rp1), "
            "/dev/gpiochip1 (gpio-fan).",
        ),
        (Computer(PI), "/dev/gpiochip0", 54, "That chip has the lines 0 to 53."),
        (Computer(PI), "/dev/gpiochip0", "GPIO1", "Did you mean GPIO18 or GPIO17?"),
        (Computer(PI), "/dev/gpiochip0", "foot", "gpioinfo shows which names it has."),
        (Computer(PI), "/dev/gpiochip0", "NC", "There is more than one GPIO line NC"),
        (Computer(PI, replace(PI, path="/dev/gpiochip4")), "pinctrl-rp1", 3, "More than one GPIO"),
        (
            Computer(PI),
            "pinctrl-rp1",
            8,
            "The GPIO line 8 of pinctrl-rp1 is in use by spi0 CS0. End that, or use another line: "
            "gpioinfo shows which are free.",
        ),
        (
            Computer(PI, forbidden=errno.EACCES),
            "/dev/gpiochip0",
            3,
            "The GPIO chip /dev/gpiochip0 cannot be opened: Permission denied. Add the user to the "
            "group gpio, then log in again.",
        ),
        (LinuxGPIO(), "/dev/null", 3, "Name the device file of a GPIO chip"),
    ],
)
def test_a_line_that_cannot_be_had_is_a_sentence(
    computer: Any, chip: str, line: int | str, words: str
) -> None:
    assert words in sentence(computer, chip, line)


def test_a_line_that_somebody_else_has_names_them_until_it_is_free() -> None:
    computer = Computer(PI)
    first = output_line(computer, LinePlace("pinctrl-rp1", "GPIO17"), False)
    assert "is in use by robotd" in sentence(computer, "/dev/gpiochip0", 17)
    first.close()
    output_line(computer, LinePlace("/dev/gpiochip0", 17), False).close()


def test_a_chip_that_could_not_be_used_is_closed() -> None:
    computer = Computer(PI)
    for line in (8, 60, "foot"):
        sentence(computer, "pinctrl-rp1", line)
    assert computer.handles == 0


class Wired:
    """A board with its pin OE on line 17."""

    def __init__(self) -> None:
        self.clock = InstantClock()
        self.board = PCA9685Emulator(self.clock)
        self.levels: list[bool] = []
        self.gpio = GPIOEmulator([Chip()], lambda *_: None, self.clock, driven=self._driven)
        table = toml_section("[servos]\nenable_line = 17", "robot.toml").table("servos")
        self.settings = PCA9685Settings.read(table)
        self.servos = self.open()

    def open(self) -> PCA9685:
        return self.settings.open(
            Buses(clock=self.clock, open_i2c=lambda path: self.board, gpio=self.gpio)
        )

    def _driven(self, chip: str, line: int, high: bool) -> None:
        assert (chip, line) == ("/dev/gpiochip0", 17)
        self.levels.append(high)
        self.board.drive_enable(high)


def test_outputs_are_cut_until_the_first_command_and_by_the_last_release() -> None:
    wired = Wired()
    wired.servos.read_counts([0])
    assert set(wired.levels) == {True}
    wired.levels.clear()
    wired.servos.set_counts({0: MIDDLE, 1: MIDDLE})
    assert wired.board.pulses()[:2] == (MIDDLE, MIDDLE)
    wired.servos.release([0])
    assert wired.levels == [False]
    wired.servos.release([1])
    assert wired.levels == [False, True]


def test_all_pulses_are_cut_though_the_bus_hangs() -> None:
    wired = Wired()
    wired.servos.read_counts([0])
    wired.servos.set_counts({0: MIDDLE})
    wired.board.inject("hang")
    with pytest.raises(DeviceTimeoutError):
        wired.servos.release([0])
    assert wired.board.pulses() == (0,) * 16


def test_a_board_that_outlived_its_daemon_is_not_cut() -> None:
    wired = Wired()
    wired.servos.read_counts([0])
    wired.servos.set_counts({0: MIDDLE})
    wired.servos.close()
    wired.levels.clear()
    assert wired.open().read_counts([0]) == {0: MIDDLE}
    assert set(wired.levels) == {False}
    assert wired.board.pulses()[0] == MIDDLE


def test_a_line_whose_chip_was_plugged_in_again_is_opened_anew() -> None:
    wired = Wired()
    wired.servos.read_counts([0])
    wired.servos.set_counts({0: MIDDLE})
    wired.gpio.inject("unplugged")
    wired.gpio.mend()
    with pytest.raises(DeviceMissingError, match="plug that in again"):
        wired.servos.set_counts({0: MIDDLE + 1})
    wired.servos.forget()
    with pytest.raises(DeviceMissingError):  # though the bus answers
        wired.servos.read_counts([0])
    wired.servos.reopen()
    assert wired.servos.read_counts([0]) == {0: MIDDLE + 1}
    wired.servos.release([0])
    assert wired.board.pulses()[0] == 0
