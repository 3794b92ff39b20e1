"""One PCA9685 by its registers.

Source: NXP PCA9685 data sheet, revision 4 (registers, address and reset values of table 4,
PRE_SCALE of 7.3.5, general and all-call addresses of 7.1). The chip has no identity; what tells it
from others is the four address registers, which nobody changes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Final

from robot.drivers.links.i2c import I2CLink, I2CRegisters
from robot.errors import DeviceDataError, DeviceMissingError

NAME: Final = "PCA9685"
OUTPUTS: Final = 16
ALL_CALL: Final = 0x70
OSCILLATOR_MHZ: Final = 25.0
TICKS: Final = 4096

_MODE1: Final = 0x00
_MODE2: Final = 0x01
_ADDRESS_REGISTERS: Final = range(0x02, 0x06)
_LED0: Final = 0x06  # ON low and high, OFF low and high, of each output
_ALL_LED_OFF_H: Final = 0xFD
_PRESCALE: Final = 0xFE

_ASLEEP: Final = 0x31  # registers advance, answers to all-call, oscillator off
_AWAKE: Final = 0x21
_TOTEM_POLE: Final = 0x04
_OFF: Final = 0x10  # in the high bytes: no pulse at all; or one that never ends
_ADDRESSES_AT_RESET: Final = bytes((0xE2, 0xE4, 0xE8, 0xE0))
_WAKING: Final = 1e-3  # s; the oscillator needs 500 µs


def by_board(outputs: Iterable[int]) -> dict[int, list[int]]:
    """Outputs of several boards, ascending, by the board that has them, from 0."""
    groups: dict[int, list[int]] = {}
    for output in sorted(outputs):
        groups.setdefault(output // OUTPUTS, []).append(output)
    return groups


class PCA9685Board:
    """A chip, or all of them at ``ALL_CALL``. Outputs are numbered as on the chip, from 0.

    Args:
        link: The bus.
        address: The chip's.
        prescale: How it divides its oscillator, once it is set up.
        counts: The widths that it may have been commanded to, in ticks.
    """

    def __init__(self, link: I2CLink, address: int, *, prescale: int, counts: range):
        self._address = address
        self._registers = I2CRegisters(link, address, NAME)
        self._prescale = prescale
        self._counts = counts

    def identify(self) -> None:
        """Checks that it is such a chip.

        Raises:
            DeviceMissingError: It is something else.
        """
        # One by one: after a reset the board does not go on to the next by itself.
        registers = b"".join(self._registers.read(number) for number in _ADDRESS_REGISTERS)
        if registers != _ADDRESSES_AT_RESET:
            raise DeviceMissingError(
                f"The device at I²C address 0x{self._address:x} is no PCA9685: its registers 2 to "
                f"5 hold {registers.hex(' ')} instead of {_ADDRESSES_AT_RESET.hex(' ')}.",
                "Check which board is fitted, and the addresses in the configuration.",
            )

    def set_up(self, sleep: Callable[[float], None]) -> None:
        """Sets it up with all outputs off, unless it runs as it should.

        Raises:
            DeviceDataError: It does not keep its settings.
            DeviceError: It failed, or is something else.
        """
        self.identify()
        if self._runs():
            return
        self.all_off()
        self._registers.write(_MODE1, _ASLEEP)  # or it takes no prescale
        self._registers.write(_PRESCALE, self._prescale)
        self._registers.write(_MODE2, _TOTEM_POLE)
        self._registers.write(_MODE1, _AWAKE)
        sleep(_WAKING)
        if not self._runs():
            raise DeviceDataError(
                f"The servo board (PCA9685) at 0x{self._address:x} does not keep its settings.",
                "Check its supply, and that no other program uses the bus.",
            )

    def pulses(self) -> bool:
        """Whether it outlived the last daemon, with servos that it holds."""
        return self._runs() and any(self.count(output) for output in range(OUTPUTS))

    def awake(self) -> bool:
        """Whether its oscillator runs, and so its outputs."""
        return _is_awake(self._registers.read(_MODE1))

    def count(self, output: int) -> int:
        """The ticks of an output's pulse, 0 for none."""
        on_low, on_high, off_low, off_high = self._registers.read(_led(output), 4)
        if off_high & _OFF:
            return 0
        if on_high & _OFF:
            return TICKS
        on, off = on_low | (on_high & 0x0F) << 8, off_low | (off_high & 0x0F) << 8
        return (off - on) % TICKS

    def move(self, counts: Mapping[int, int]) -> bool:
        """Commands outputs to counts, all at the same time; whether it is awake."""
        writes = [(_led(one), 0, 0, count & 0xFF, count >> 8) for one, count in counts.items()]
        return _is_awake(self._registers.write_and_read(writes, _MODE1))

    def off(self, output: int) -> None:
        """Ends the pulses of an output."""
        self._registers.write(_led(output) + 3, _OFF)

    def all_off(self) -> None:
        """Ends the pulses of all outputs."""
        self._registers.write(_ALL_LED_OFF_H, _OFF)

    def _runs(self) -> bool:
        """Whether it pulses as this driver has it do, no wider and no narrower."""
        mode1, mode2, prescale = (
            self._registers.read(number)[0] for number in (_MODE1, _MODE2, _PRESCALE)
        )
        if (mode1 & 0x7F, mode2 & 0x1F, prescale) != (_AWAKE, _TOTEM_POLE, self._prescale):
            return False
        counts = (self.count(output) for output in range(OUTPUTS))
        return all(count == 0 or count in self._counts for count in counts)


def _is_awake(mode1: bytes) -> bool:
    return mode1[0] & 0x7F == _AWAKE


def _led(output: int) -> int:
    """The first register of an output."""
    return _LED0 + 4 * output
