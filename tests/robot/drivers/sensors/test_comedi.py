"""The comedi driver against a library of C functions made on the spot: no comedi is needed here.

The functions are called through the machine's own calling convention, with a device pointer that
does not fit into 32 bits, so that a missing prototype shows.
"""

from __future__ import annotations

import ctypes
import errno
from collections.abc import Callable
from ctypes import POINTER, c_char_p, c_int, c_uint, c_void_p
from typing import Any

import pytest

from robot.configuration.device_tables import read_board
from robot.drivers.buses import Buses
from robot.drivers.sensors.comedi import ComediInput, ComediRange, load_library
from robot.drivers.sensors.contracts import attach_board
from robot.errors import DeviceMissingError, DeviceTimeoutError
from robot.host.clock import WallClock
from robot.toml_sections import toml_section

POINTER_BITS = 8 * ctypes.sizeof(c_void_p)
DEVICE = (1 << (POINTER_BITS - 2)) + 4096
VOLT, MILLIAMPERE = 0, 1
# As Linux' driver dmm32at numbers them.
RANGES = ((0, 10, VOLT), (0, 5, VOLT), (-10, 10, VOLT), (-5, 5, VOLT))


class FakeComedi:
    """A board with 32 inputs of 16 bits as its second subdevice; attributes are C functions."""

    def __init__(self) -> None:
        self.samples = dict.fromkeys(range(32), 0x8000)
        self.ranges: tuple[tuple[float, float, int], ...] = RANGES
        self.inputs = 1
        self.channels = 32
        self.error = 0
        self.opened: list[bytes] = []
        self.closed: list[int] = []
        self.read: list[tuple[int, ...]] = []
        self._kept: list[object] = []
        self._c("comedi_open", c_void_p, self._open, c_char_p)
        self._c("comedi_close", c_int, self._close, c_void_p)
        self._c("comedi_errno", c_int, lambda: self.error)
        self._c("comedi_strerror", c_void_p, self._text, c_int)
        self._c("comedi_find_subdevice_by_type", c_int, self._find, c_void_p, c_int, c_uint)
        self._c("comedi_get_n_channels", c_int, lambda *_: self.channels, c_void_p, c_uint)
        self._c("comedi_get_maxdata", c_uint, lambda *_: 0xFFFF, c_void_p, c_uint, c_uint)
        self._c("comedi_get_n_ranges", c_int, lambda *_: len(self.ranges), c_void_p, c_uint, c_uint)
        self._c("comedi_get_range", c_void_p, self._range, c_void_p, c_uint, c_uint, c_uint)
        self._c(
            "comedi_data_read",
            c_int,
            self._read,
            c_void_p,
            *(c_uint,) * 4,
            POINTER(c_uint),
        )

    def _c(self, name: str, result: Any, function: Callable[..., Any], *arguments: Any) -> None:
        """A function as ``CDLL`` gives it: an address, of which Python knows no prototype."""
        callback = ctypes.CFUNCTYPE(result, *arguments)(function)
        address = ctypes.cast(callback, c_void_p).value
        assert address is not None
        self._kept.append(callback)
        setattr(self, name, ctypes.CDLL(None)._FuncPtr(address))

    def _open(self, name: bytes) -> int:
        self.opened.append(name)
        return 0 if self.error else DEVICE

    def _close(self, device: int) -> int:
        self.closed.append(device)
        return 0

    def _text(self, number: int) -> int:
        text = ctypes.create_string_buffer(f"reason {number}".encode())
        self._kept.append(text)
        return ctypes.addressof(text)

    def _find(self, device: int, kind: int, first: int) -> int:
        return self.inputs if (device, kind, first) == (DEVICE, 1, 0) else -1

    def _range(self, device: int, subdevice: int, channel: int, number: int) -> int:
        low, high, unit = self.ranges[number]
        limits = ComediRange(low, high, unit)
        self._kept.append(limits)
        return ctypes.addressof(limits)

    def _read(self, *arguments: Any) -> int:
        *where, sample = arguments
        self.read.append(tuple(where))
        if self.error:
            return -1
        sample[0] = self.samples[where[2]]
        return 1


@pytest.fixture
def fake() -> FakeComedi:
    return FakeComedi()


def opened(fake: FakeComedi, range_: str = "±5V") -> ComediInput:
    board = ComediInput("/dev/comedi0", range_=range_, library=fake)
    board.probe()
    return board


def test_codes_become_volts(fake: FakeComedi) -> None:
    fake.samples |= {3: 0, 4: 0xFFFF, 5: 17762 + 0x8000}  # offset binary
    volts = opened(fake).scan(3, 6)
    assert volts[:2] == [-5.0, 5.0]  # the ends are numbers, not NaN
    # comedi divides by 65535, the maker by 65536: at most one step of 153 µV apart.
    assert volts[2] == pytest.approx(2.71027, abs=154e-6)
    assert volts[3] == pytest.approx(0.0, abs=154e-6)
    assert fake.opened == [b"/dev/comedi0"]
    assert fake.read == [(DEVICE, 1, channel, 3, 0) for channel in (3, 4, 5, 6)]


@pytest.mark.parametrize(("range_", "number"), [("0..10V", 0), ("0..5V", 1), ("±10V", 2)])
def test_the_range_is_the_one_that_was_asked_for(
    fake: FakeComedi, range_: str, number: int
) -> None:
    fake.samples[0] = 0xFFFF
    assert opened(fake, range_).scan(0, 0) == [5.0 if range_ == "0..5V" else 10.0]
    assert fake.read[0][3] == number


def test_a_range_that_the_board_lacks_is_refused_with_those_it_has(fake: FakeComedi) -> None:
    fake.ranges = (*RANGES, (-2.5, 2.5, MILLIAMPERE))
    with pytest.raises(
        DeviceMissingError, match=r"no input range ±2\.5V.*±10V, ±5V, 0\.\.10V, 0\.\.5V"
    ):
        opened(fake, "±2.5V")


@pytest.mark.parametrize(("low", "high"), [(-1, 3), (5, 4), (0, 32)])
def test_channels_that_the_board_lacks_are_refused(fake: FakeComedi, low: int, high: int) -> None:
    with pytest.raises(DeviceMissingError, match="has channels 0 to 31, not"):
        opened(fake).scan(low, high)


@pytest.mark.parametrize(
    ("error", "advice"), [(errno.ENOENT, "comedi_config"), (errno.EACCES, "the group iocard")]
)
def test_what_cannot_be_opened_is_named_with_the_reason(
    fake: FakeComedi, error: int, advice: str
) -> None:
    fake.error = error
    with pytest.raises(
        DeviceMissingError, match=rf"/dev/comedi0 cannot be opened: reason {error}\..*{advice}"
    ):
        opened(fake)


@pytest.mark.parametrize(("attribute", "value"), [("inputs", -1), ("channels", -1)])
def test_a_board_without_analogue_inputs(fake: FakeComedi, attribute: str, value: int) -> None:
    setattr(fake, attribute, value)
    with pytest.raises(DeviceMissingError, match="inputs"):
        opened(fake)


@pytest.mark.parametrize(
    ("number", "kind"), [(errno.ETIME, DeviceTimeoutError), (errno.ENODEV, DeviceMissingError)]
)
def test_a_board_that_fails_later(
    fake: FakeComedi, number: int, kind: type[DeviceMissingError | DeviceTimeoutError]
) -> None:
    board = opened(fake)
    fake.error = number
    with pytest.raises(kind, match=f"channel 7: reason {number}"):
        board.scan(7, 8)
    fake.error = 0
    board.probe()  # after the cause is mended: with a device that was opened anew
    assert len(board.scan(7, 8)) == 2
    board.close()
    board.close()
    assert fake.closed == [DEVICE, DEVICE]


def test_a_configuration_names_it(fake: FakeComedi, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robot.drivers.sensors.comedi.load_library", lambda: fake)
    table = toml_section('[daq]\ndriver = "comedi"\ndevice = "/dev/comedi3"', "").table("daq")
    analogue = attach_board(Buses(clock=WallClock()), read_board(table)).analogue
    assert analogue is not None
    board = analogue.board
    assert board.scan(0, 6) == pytest.approx([0.0] * 7, abs=154e-6)
    assert fake.opened == [b"/dev/comedi3"]


def test_a_library_that_is_not_installed() -> None:
    with pytest.raises(DeviceMissingError, match="apt install libcomedi0"):
        load_library("libcomedi.so.none")


def test_a_board_that_is_not_open_is_not_read() -> None:
    """Comedilib would follow a null pointer."""
    library = FakeComedi()
    board = ComediInput("/dev/comedi0", library=library)
    board.probe()
    board.close()
    with pytest.raises(DeviceMissingError, match="/dev/comedi0 is not open"):
        board.scan(0, 0)
    assert not library.read
