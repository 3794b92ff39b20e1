"""An emulated PCA9685: sixteen PWM outputs on an I²C bus.

Source: NXP PCA9685 data sheet, revision 4. Where it gives no figure the emulator assumes: a write
to a PWM register restarts outputs that were put to sleep while they pulsed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import ClassVar, Final

from robot.host.clock import Clock
from sim_robot.electronics.fault_switch import EVERY_NTH
from sim_robot.electronics.i2c_bus import I2CDevice

OUTPUTS: Final = 16
TICKS: Final = 4096

_MODE1: Final = 0x00
_MODE2: Final = 0x01
_SUBADDRESS_1: Final = 0x02
_ALL_CALL_ADDRESS: Final = 0x05
_LED0: Final = 0x06
_LAST_LED: Final = 0x45
_ALL_LED: Final = 0xFA
_PRESCALE: Final = 0xFE
_TEST_MODE: Final = 0xFF

_RESTART: Final = 0x80
_EXTERNAL_CLOCK: Final = 0x40
_AUTO_INCREMENT: Final = 0x20
_SLEEP: Final = 0x10
_ALL_CALL: Final = 0x01
_FULL: Final = 0x10
_LEAST_PRESCALE: Final = 3
_GENERAL_CALL: Final = 0x00
_SOFTWARE_RESET: Final = b"\x06"
_MICROSECONDS: Final = 25.0  # periods of the oscillator


class PCA9685Emulator(I2CDevice):
    """One board.

    Args:
        clock: Is charged 100 µs per transfer.
        address: Set by the board's jumpers.

    Attributes:
        enabled: Whether the pin OE is low, to which the boards pull it; see ``drive_enable``.
        on_pulse: Called with output, ticks before and ticks after whenever a command changes the
            pulse of an output; what a reset switches off is no command.
        on_reset: Called when the board was reset.
    """

    FAULTS: ClassVar[Mapping[str, str]] = MappingProxyType(
        {**I2CDevice.FAULTS, "lost": "every n-th write to an output is acknowledged and lost"}
    )
    NUMBERS: ClassVar[Mapping[str, range]] = MappingProxyType(
        {**I2CDevice.NUMBERS, "lost": EVERY_NTH}
    )
    EVENTS: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "reset": "the supply dips: the board sleeps without settings, outputs are off",
            "sleep": "something puts the board to sleep: outputs are off, settings are kept",
        }
    )

    def __init__(self, clock: Clock, *, address: int = 0x40):
        super().__init__(clock)
        self._address = address
        self._writes = 0
        self.enabled = True
        self.on_pulse: Callable[[int, int, int], None] = lambda output, before, after: None
        self.on_reset: Callable[[], None] = lambda: None
        self.power_cycle()

    def power_cycle(self) -> None:
        """A reset: every output is off, and every setting is lost."""
        self._registers = bytearray(256)
        self._registers[_MODE1] = _SLEEP | _ALL_CALL
        self._registers[_MODE2] = 0x04
        self._registers[_SUBADDRESS_1 : _ALL_CALL_ADDRESS + 1] = b"\xe2\xe4\xe8\xe0"
        for output in range(OUTPUTS):
            self._registers[_LED0 + 4 * output + 3] = _FULL
        self._registers[_PRESCALE] = 0x1E
        self._pointer = 0
        self._halted = False  # outputs that slept while they pulsed, and were not restarted
        self._pulses: tuple[int, ...] = (0,) * OUTPUTS
        self.on_reset()

    def pulses(self) -> tuple[int, ...]:
        """Ticks of 4096 for which each output is high in every period; 0 for no pulse."""
        return self._pulses

    def drive_enable(self, high: bool) -> None:
        """Drives the pin OE: high cuts all pulses."""
        self.enabled = not high
        self._drive()

    @property
    def tick_us(self) -> float:
        """The length of a tick, µs."""
        return (self._registers[_PRESCALE] + 1) / _MICROSECONDS

    def answers(self, address: int) -> bool:
        """Whether it is the board's own, or one that several boards share."""
        if address in (self._address, _GENERAL_CALL):
            return True
        mode = self._registers[_MODE1]
        shared = zip((0x08, 0x04, 0x02, _ALL_CALL), range(_SUBADDRESS_1, _LED0), strict=True)
        return any(mode & bit and self._registers[at] >> 1 == address for bit, at in shared)

    def receive(self, data: bytes) -> bool:
        """Takes the number of a register and what is written from there on."""
        if data == _SOFTWARE_RESET and self._called == _GENERAL_CALL:
            self.power_cycle()
            return True
        if not data or not _exists(data[0]):
            return False
        self._pointer = data[0]
        for value in data[1:]:
            self._store(self._pointer, value)
            self._advance()
        return True

    def send(self, count: int) -> bytes:
        """Registers from the pointer on; the ones for all outputs read as zero."""
        data = bytearray()
        for _ in range(count):
            shown = self._pointer if not _ALL_LED <= self._pointer < _PRESCALE else None
            data.append(0 if shown is None else self._registers[shown])
            self._advance()
        return bytes(data)

    def stop(self) -> None:
        """Outputs change at the end of a transfer."""
        self._drive()

    def _happen(self, event: str, value: int) -> None:
        if event == "reset":
            self.power_cycle()
        else:
            self._registers[_MODE1] |= _SLEEP
            self._pulses = (0,) * OUTPUTS

    def _advance(self) -> None:
        if self._registers[_MODE1] & _AUTO_INCREMENT:
            at_end = self._pointer in (_LAST_LED, _PRESCALE, _TEST_MODE)
            self._pointer = 0 if at_end else self._pointer + 1

    def _store(self, register: int, value: int) -> None:
        if _LED0 <= register <= _LAST_LED:
            self._store_output(register, value)
        elif _ALL_LED <= register < _PRESCALE:
            for output in range(OUTPUTS):
                self._store_output(_LED0 + 4 * output + register - _ALL_LED, value)
        elif register == _MODE1:
            self._store_mode(value)
        elif register == _PRESCALE:
            if self._registers[_MODE1] & _SLEEP:
                self._registers[_PRESCALE] = max(value, _LEAST_PRESCALE)
        elif register == _MODE2:
            self._registers[_MODE2] = value & 0x1F
        elif register != _TEST_MODE:
            self._registers[register] = value & 0xFE

    def _store_output(self, register: int, value: int) -> None:
        self._writes += 1
        number = self._faults.get("lost")
        if number is not None and self._writes % max(number, 1) == 0:
            return
        high = (register - _LED0) % 2
        self._registers[register] = value & 0x1F if high else value
        self._halted = False
        self._registers[_MODE1] &= ~_RESTART

    def _store_mode(self, value: int) -> None:
        before = self._registers[_MODE1]
        after = value & ~_RESTART | before & _RESTART
        if not before & _SLEEP:
            after = after & ~_EXTERNAL_CLOCK | before & _EXTERNAL_CLOCK
        if value & _SLEEP and not before & _SLEEP and any(self._widths()):
            self._halted = True
            after |= _RESTART
        if value & _RESTART and not value & _SLEEP:
            self._halted = False
            after &= ~_RESTART
        self._registers[_MODE1] = after

    def _drive(self) -> None:
        before = self._pulses
        off = self._halted or not self.enabled or self._registers[_MODE1] & _SLEEP
        self._pulses = (0,) * OUTPUTS if off else self._widths()
        for output, (old, new) in enumerate(zip(before, self._pulses, strict=True)):
            if old != new:
                self.on_pulse(output, old, new)

    def _widths(self) -> tuple[int, ...]:
        return tuple(self._width(_LED0 + 4 * output) for output in range(OUTPUTS))

    def _width(self, register: int) -> int:
        on_low, on_high, off_low, off_high = self._registers[register : register + 4]
        if off_high & _FULL:
            return 0
        if on_high & _FULL:
            return TICKS
        return ((off_low | off_high << 8) - (on_low | on_high << 8)) % TICKS


def _exists(register: int) -> bool:
    return register <= _LAST_LED or register >= _ALL_LED
