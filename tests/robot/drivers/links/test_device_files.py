"""A GPIO line, and a PCA9685 whose pin OE it drives."""

from __future__ import annotations

import fcntl
import os
import struct
from pathlib import Path

import pytest

from robot.drivers.buses import Buses
from robot.drivers.links.device_files import (
    ClosedPorts,
    DevPort,
    GPIOLine,
    claimed_by,
    open_dev_port,
)
from robot.drivers.servos.pca9685 import PCA9685, PCA9685Settings
from robot.errors import DeviceMissingError, DeviceTimeoutError
from robot.toml_sections import toml_section
from sim_robot.electronics.pca9685 import PCA9685Emulator
from tests.robot.clocks import InstantClock

MIDDLE = 307


class Kernel:
    """Takes the calls of a GPIO chip as ``linux/gpio.h`` lays them out."""

    def __init__(self, line: int):
        self.line = line
        self.calls: list[tuple[int, bytes]] = []

    def ioctl(self, file: int, request: int, data: bytes | bytearray) -> int:
        self.calls.append((request, bytes(data)))
        if request == 0xC250B407:  # GPIO_V2_GET_LINE_IOCTL, a structure of 592 bytes
            assert isinstance(data, bytearray)
            assert len(data) == 592
            data[588:592] = struct.pack("=i", self.line)
        return 0


def test_a_line_is_asked_for_with_its_first_level_and_driven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chip = tmp_path / "gpiochip0"
    chip.touch()
    kernel = Kernel(os.open(chip, os.O_RDONLY))
    monkeypatch.setattr(fcntl, "ioctl", kernel.ioctl)
    line = GPIOLine(str(chip), 17, True)
    line.set(False)
    line.close()
    (_, request), (number, values) = kernel.calls
    assert struct.unpack_from("=II", request, 0) == (17, 0)
    assert request[256:263] == b"robotd\0"
    assert struct.unpack_from("=QI", request, 288) == (1 << 3, 1)  # an output, with one attribute:
    assert struct.unpack_from("=I4xQQ", request, 320) == (2, 1, 1)  # its value, high, of line 0
    assert struct.unpack_from("=I", request, 560) == (1,)
    assert (number, struct.unpack("=QQ", values)) == (0xC010B40F, (0, 1))
    with pytest.raises(OSError, match="Bad file"):
        os.close(kernel.line)


@pytest.mark.parametrize("chip", ["/dev/gpiochip250", "/dev/null"])
def test_a_line_that_cannot_be_had_is_a_sentence(chip: str) -> None:
    with pytest.raises(DeviceMissingError, match=f"The GPIO line 3 of {chip} cannot be opened"):
        GPIOLine(chip, 3, True)


class Wired:
    """A board with its pin OE on line 17."""

    def __init__(self) -> None:
        self.clock = InstantClock()
        self.board = PCA9685Emulator(self.clock)
        self.levels: list[bool] = []
        self.gone = False
        table = toml_section("[servos]\nenable_line = 17", "robot.toml").table("servos")
        self.settings = PCA9685Settings.read(table)
        self.servos = self.open()

    def open(self) -> PCA9685:
        return self.settings.open(
            Buses(clock=self.clock, open_i2c=lambda path: self.board, open_line=self._line)
        )

    def _line(self, chip: str, line: int, high: bool) -> Wired:
        assert (chip, line) == ("/dev/gpiochip0", 17)
        self.gone = False
        self.set(high)
        return self

    def set(self, high: bool) -> None:
        if self.gone:
            raise DeviceMissingError("The GPIO line cannot be driven.", "Plug it in.")
        self.levels.append(high)
        self.board.drive_enable(high)

    def close(self) -> None:
        """The level stays."""


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
    wired.gone = True
    with pytest.raises(DeviceMissingError):
        wired.servos.set_counts({0: MIDDLE + 1})
    wired.servos.forget()
    with pytest.raises(DeviceMissingError):  # though the bus answers
        wired.servos.read_counts([0])
    wired.servos.reopen()
    assert wired.servos.read_counts([0]) == {0: MIDDLE + 1}
    wired.servos.release([0])
    assert wired.board.pulses()[0] == 0


def test_a_chip_that_is_not_there_names_those_that_are(tmp_path: Path) -> None:
    (tmp_path / "gpiochip4").touch()
    with pytest.raises(DeviceMissingError, match=f"There are {tmp_path}/gpiochip4"):
        GPIOLine(str(tmp_path / "gpiochip0"), 3, True)


IOPORTS = """\
0000-0cf7 : PCI Bus 0000:00
  0000-001f : dma1
  0300-030f : dmm32at
  03f8-03ff : serial
"""


@pytest.fixture
def claims(tmp_path: Path) -> str:
    file = tmp_path / "ioports"
    file.write_text(IOPORTS)
    return str(file)


@pytest.fixture
def ports(tmp_path: Path) -> str:
    file = tmp_path / "port"
    file.write_bytes(bytes(range(256)) * 4)
    return str(file)


def test_ports_are_offsets_in_the_file(ports: str) -> None:
    port_io = DevPort(ports)
    port_io.write(0x102, 0xAB)
    assert port_io.read(0x102) == b"\xab"
    assert port_io.read(0x101, 3) == b"\x01\xab\x03"
    port_io.close()


@pytest.mark.parametrize(
    ("base", "owner"),
    [(0x300, "dmm32at"), (0x2F1, "dmm32at"), (0x30F, "dmm32at"), (0x2F0, None), (0x310, None)],
)
def test_claims_of_the_kernel(claims: str, base: int, owner: str | None) -> None:
    assert claimed_by(base, 16, claims) == owner


def test_a_claimed_range_is_refused(claims: str, ports: str) -> None:
    with pytest.raises(DeviceMissingError, match="0x300-0x30f belong to the kernel driver dmm32at"):
        open_dev_port(0x300, path=ports, claims=claims)
    open_dev_port(0x280, path=ports, claims=claims).close()


def test_ports_that_cannot_be_opened_say_why(tmp_path: Path, claims: str) -> None:
    with pytest.raises(DeviceMissingError, match="CONFIG_DEVPORT"):
        open_dev_port(0x280, path=str(tmp_path / "none"), claims=claims)
    with pytest.raises(DeviceMissingError, match="CAP_SYS_RAWIO"):
        open_dev_port(0x280, path=str(tmp_path), claims=claims)
    assert claimed_by(0x280, 16, str(tmp_path / "none")) is None


def test_ports_that_are_not_open_cannot_be_used() -> None:
    ports = ClosedPorts()
    for access in (lambda: ports.read(0x300), lambda: ports.write(0x300, 1)):
        with pytest.raises(OSError, match="not open"):
            access()
    ports.close()
