"""One PCA9685 by its registers.

Source: NXP PCA9685 data sheet, revision 4 (registers, address and reset values of table 4 and the
remark below it, RESTART of 7.3.1.1, PRE_SCALE of 7.3.5, general and all-call addresses of 7.1). The
chip has no identity; what tells it from others is the four address registers, which hardly anybody
changes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Final

from robot.drivers.links.i2c import I2CLink, I2CRegisters
from robot.errors import DeviceDataError, DeviceMissingError

NAME: Final = "PCA9685"
OUTPUTS: Final = 16
ALL_CALL: Final = 0x70
TICKS: Final = 4096

_PRESCALE: Final = 0xFE  # reading on from here comes to MODE1 next
_MODE1: Final = 0x00
_MODE2: Final = 0x01
_ADDRESS_REGISTERS: Final = range(0x02, 0x06)
_LED0: Final = 0x06  # ON low and high, OFF low and high, of each output
_ALL_LED_OFF_H: Final = 0xFD
_SETTINGS: Final = (_PRESCALE, _MODE1, _MODE2, *_ADDRESS_REGISTERS)
_NAMES: Final = ("PRE_SCALE", "MODE1", "MODE2", "SUBADR1", "SUBADR2", "SUBADR3", "ALLCALLADR")
_OUTPUT_BYTES: Final = 4

_ASLEEP: Final = 0x31  # registers advance, answers to all-call, oscillator off
_AWAKE: Final = 0x21
_RESTART: Final = 0x80  # outputs slept while they pulsed, and stay off; writing it restarts them
_SLEEP: Final = 0x10
_TOTEM_POLE: Final = 0x04
_OFF: Final = 0x10  # in the high bytes: no pulse at all; or one that never ends
_ADDRESSES_AT_RESET: Final = bytes((0xE2, 0xE4, 0xE8, 0xE0))
_WAKING: Final = 1e-3  # s; the oscillator needs 500 µs

BYTES_TO_READ: Final = 3 + len(_SETTINGS) + _OUTPUT_BYTES * OUTPUTS
"""Bytes on the bus for a reading of all counts of a board."""

BYTES_TO_MOVE: Final = 3 + len(_SETTINGS)
"""Bytes on the bus for a move, besides ``BYTES_PER_OUTPUT`` for each output that is moved."""

BYTES_PER_OUTPUT: Final = 2 + _OUTPUT_BYTES


def by_board(outputs: Iterable[int]) -> dict[int, list[int]]:
    """Outputs of several boards, ascending, by the index of the board that has them, from 0."""
    groups: dict[int, list[int]] = {}
    for output in sorted(outputs):
        groups.setdefault(output // OUTPUTS, []).append(output)
    return groups


class PCA9685Board:
    """A chip, or all of them at ``ALL_CALL``. Outputs are numbered as on the chip, from 0.

    Args:
        link: The bus.
        address: Address of the chip.
        prescale: Prescale of the chip's oscillator, once it is set up.
        counts: Widths that outputs may have been commanded to, in ticks.
    """

    def __init__(self, link: I2CLink, address: int, *, prescale: int, counts: range):
        self._address = address
        self._registers = I2CRegisters(link, address, NAME)
        self._counts = counts
        self._settings = bytes((prescale, _AWAKE, _TOTEM_POLE)) + _ADDRESSES_AT_RESET

    def identify(self) -> None:
        """Checks that the chip is a PCA9685.

        Raises:
            DeviceMissingError: The chip is something else.
        """
        registers = self._one_by_one(_ADDRESS_REGISTERS)
        if registers != _ADDRESSES_AT_RESET:
            raise DeviceMissingError(
                f"The device at I²C address 0x{self._address:x} is no PCA9685: its registers 2 to "
                f"5 hold {registers.hex(' ')} instead of {_ADDRESSES_AT_RESET.hex(' ')}.",
                "Check which board is fitted, and the addresses in the configuration. If another "
                "program has written there, switch the board's supply off and on.",
            )

    def set_up(self, sleep: Callable[[float], None]) -> None:
        """Sets the chip up with all outputs off, unless it runs as it should.

        Raises:
            DeviceDataError: The chip does not keep its settings.
            DeviceError: The chip failed, or is something else.
        """
        self.identify()
        if self._runs():
            return
        self.all_off()
        self._registers.write(_MODE1, _ASLEEP)  # or it takes no prescale
        self._registers.write(_PRESCALE, self._settings[0])
        self._registers.write(_MODE2, _TOTEM_POLE)
        self._registers.write(_MODE1, _AWAKE)
        sleep(_WAKING)
        self._registers.write(_MODE1, _AWAKE | _RESTART)
        if not self._runs():
            raise DeviceDataError(
                f"The servo board (PCA9685) at 0x{self._address:x} does not keep its settings: "
                f"{self._differences(self._one_by_one(_SETTINGS)) or 'its pulses change'}.",
                "Check its supply, and that no other program uses the bus; an external clock (bit "
                "6 of MODE1) stays chosen until the supply is switched off.",
            )

    def pulses(self) -> bool:
        """Whether the chip outlived the last daemon, with servos that it holds."""
        return self._runs() and any(self.counts())

    def counts(self) -> tuple[int, ...]:
        """The ticks of each output's pulse, 0 for none.

        All that a pulse depends on is read with them, in one transfer.

        Raises:
            DeviceDataError: The chip does not run as it was set up.
        """
        for _ in range(2):  # it may be the reading that was damaged
            data = self._registers.read(_PRESCALE, len(_SETTINGS) + _OUTPUT_BYTES * OUTPUTS)
            settings, outputs = data[: len(_SETTINGS)], data[len(_SETTINGS) :]
            if settings == self._settings:
                starts = range(0, len(outputs), _OUTPUT_BYTES)
                return tuple(_count(outputs[start : start + _OUTPUT_BYTES]) for start in starts)
            settings = self._one_by_one(_SETTINGS)
            if settings != self._settings:
                break
        raise self._altered(settings)

    def move(self, counts: Mapping[int, int]) -> None:
        """Commands outputs to counts, all at the same time.

        Raises:
            DeviceDataError: The chip does not run as it was set up; it got the counts all the same.
        """
        writes = [(_led(n), 0, 0, count & 0xFF, count >> 8) for n, count in counts.items()]
        settings = self._registers.write_and_read(writes, _PRESCALE, len(_SETTINGS))
        if settings != self._settings:
            raise self._altered(settings)

    def off(self, output: int) -> None:
        """Ends the pulses of an output."""
        self._registers.write(_led(output) + 3, _OFF)

    def all_off(self) -> None:
        """Ends the pulses of all outputs."""
        self._registers.write(_ALL_LED_OFF_H, _OFF)

    def _runs(self) -> bool:
        """Whether the chip runs as set up, with no pulse wider or narrower than allowed."""
        try:
            counts = self.counts()
        except DeviceDataError:
            return False
        return all(count == 0 or count in self._counts for count in counts)

    def _one_by_one(self, registers: Iterable[int]) -> bytes:
        """Reads registers singly: a board may not go on to the next by itself after a reset."""
        return b"".join(self._registers.read(number) for number in registers)

    def _differences(self, found: bytes) -> str:
        """The registers that differ from how they were set up, in words; empty: none."""
        rows = zip(_NAMES, found, self._settings, strict=True)
        return ", ".join(
            f"{name} is 0x{value:02x} instead of 0x{expected:02x}"
            for name, value, expected in rows
            if value != expected
        )

    def _altered(self, found: bytes) -> DeviceDataError:
        if found[1] & (_SLEEP | _RESTART):
            effect = "; its outputs are off and the joints limp"
        elif found[0] != self._settings[0]:
            times = (found[0] + 1) / (self._settings[0] + 1)
            effect = f"; its pulses are {times:.2f} times as long, and the joints elsewhere"
        else:
            effect = ""
        return DeviceDataError(
            f"The servo board (PCA9685) at 0x{self._address:x} does not run as it was set up: "
            f"{self._differences(found)}{effect}. It was reset, or another program wrote to it.",
            "Check its supply, and that nothing else drives it. Then keep clear: once held, the "
            "joints go back to where they were.",
        )


def _count(registers: bytes) -> int:
    """The ticks of an output's pulse, 0 for none, by its four registers."""
    on_low, on_high, off_low, off_high = registers
    if off_high & _OFF:
        return 0
    if on_high & _OFF:
        return TICKS
    on, off = on_low | (on_high & 0x0F) << 8, off_low | (off_high & 0x0F) << 8
    return (off - on) % TICKS


def _led(output: int) -> int:
    """The first register of an output."""
    return _LED0 + _OUTPUT_BYTES * output
