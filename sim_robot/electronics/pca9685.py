"""An emulated PCA9685: sixteen PWM outputs on an I²C bus.

Source: NXP PCA9685 data sheet, revision 4. Where it gives no figure the emulator assumes: whatever
clears RESTART starts the outputs again; an oscillator stops, and starts, at once; nothing clocks
the pin EXTCLK, nothing pulls an open-drain output up, and outputs change at the end of a transfer
even where MODE2 has them change with each acknowledge. Not modelled: test mode.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar, Final

from robot.host.clock import Clock
from sim_robot.electronics.fault_switch import EVERY_NTH, Fault
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
_WAKE_TIME: Final = 500e-6  # s

_INVERT: Final = 0x10
_CHANGE_AT_ACK: Final = 0x08
_TOTEM_POLE: Final = 0x04
_WHEN_DISABLED: Final = 0x03
_HIGH: Final = 0x01

_ASLEEP: Final = _AUTO_INCREMENT | _SLEEP | _ALL_CALL
_AWAKE: Final = _AUTO_INCREMENT | _ALL_CALL
_MOVED_TICKS: Final = 307  # where other programs move servos to: 1.5 ms at 50 Hz


class PCA9685Emulator(I2CDevice):
    """One board.

    Args:
        clock: Is charged 100 µs per transfer.
        address: Address that the board's jumpers set.
        oscillator_mhz: Frequency at which the oscillator really runs, MHz.

    Attributes:
        enabled: Whether the pin OE is low, as the boards pull it; see ``drive_enable``.
        on_pulse: Called with output, ticks before and ticks after whenever a command changes the
            pulse of an output; a reset is no command, nor is what another program does.
        on_reset: Called when the board was reset.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        **I2CDevice.FAULTS,
        "lost": Fault("every n-th write to an output is acknowledged and lost", EVERY_NTH),
        "reset": Fault(
            "the supply dips: the board sleeps without settings, outputs are off", once=True
        ),
        "sleep": Fault(
            "another program puts the board to sleep: outputs are off, settings are kept", once=True
        ),
        "doze": Fault(
            "another program puts the board to sleep and wakes it: outputs stay off", once=True
        ),
        "prescale": Fault(
            "another program sets PRE_SCALE to n, as servo libraries do: every pulse has another "
            "width at once",
            range(_LEAST_PRESCALE, 256),
            once=True,
        ),
        "mode2": Fault(
            "another program writes n to MODE2: 20 inverts the outputs, 0 opens them",
            range(32),
            once=True,
        ),
        "moved": Fault(
            "another program gives output n a pulse of 307 ticks", range(OUTPUTS), once=True
        ),
        "full_on": Fault("another program switches output n fully on", range(OUTPUTS), once=True),
        "all_off": Fault("another program switches all outputs fully off", once=True),
    }

    def __init__(self, clock: Clock, *, address: int = 0x40, oscillator_mhz: float = 25.0):
        super().__init__(clock)
        self._address = address
        self._oscillator_mhz = oscillator_mhz
        self._writes = 0
        self.enabled = True
        self.on_pulse: Callable[[int, int, int], None] = lambda output, before, after: None
        self.on_reset: Callable[[], None] = lambda: None
        self.power_cycle()

    def power_cycle(self) -> None:
        """Resets the board: every output is off, and every setting is lost."""
        self._registers = bytearray(256)
        self._registers[_MODE1] = _SLEEP | _ALL_CALL
        self._registers[_MODE2] = 0x04
        self._registers[_SUBADDRESS_1 : _ALL_CALL_ADDRESS + 1] = b"\xe2\xe4\xe8\xe0"
        for output in range(OUTPUTS):
            self._registers[_LED0 + 4 * output + 3] = _FULL
        self._registers[_PRESCALE] = 0x1E
        self._pointer = 0
        self._awake_since = 0.0
        self._loaded: set[int] = set()  # registers of outputs, written since the last transfer
        self._pulses: tuple[int, ...] = (0,) * OUTPUTS
        self.on_reset()

    def pulses(self) -> tuple[int, ...]:
        """Ticks of 4096 for which each output is high in every period; 0 and 4096 are levels."""
        return self._pulses

    def drive_enable(self, high: bool) -> None:
        """Drives the pin OE: high cuts all pulses."""
        self.enabled = not high
        self._command()

    @property
    def tick_us(self) -> float:
        """The length of a tick, µs."""
        return (self._registers[_PRESCALE] + 1) / self._oscillator_mhz

    def answers(self, address: int) -> bool:
        """Whether an address is the board's own, or one that several boards share."""
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
        if not data or _LAST_LED < data[0] < _ALL_LED:  # there is no such register
            return False
        self._pointer = data[0]
        for value in data[1:]:
            self._store(self._pointer, value)
            self._advance()
        return True

    def send(self, count: int) -> bytes:
        """Gives registers from the pointer on; the ones for all outputs read as zero."""
        data = bytearray()
        for _ in range(count):
            for_all = _ALL_LED <= self._pointer < _PRESCALE
            data.append(0 if for_all else self._registers[self._pointer])
            self._advance()
        return bytes(data)

    def stop(self) -> None:
        """Changes the outputs, at the end of a transfer."""
        self._end_transfer()
        self._command()

    def _happen(self, event: str, value: int) -> None:
        if event == "reset":
            self.power_cycle()
            return
        for register, written in _written_by_others(event, value):
            self._store(register, written)
            self._awake_since = -_WAKE_TIME  # others wait as long as the data sheet asks
        self._end_transfer()
        self._drive()

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
        if self._strikes("lost", self._writes):
            return
        is_high_byte = (register - _LED0) % 2
        self._registers[register] = value & 0x1F if is_high_byte else value
        self._loaded.add(register)

    def _store_mode(self, value: int) -> None:
        old_mode = self._registers[_MODE1]
        new_mode = value & ~_RESTART | old_mode & (_RESTART | _EXTERNAL_CLOCK)
        if not old_mode & _SLEEP:
            new_mode = new_mode & ~_EXTERNAL_CLOCK | old_mode & _EXTERNAL_CLOCK
        now = self._clock.now()
        if value & _SLEEP and not old_mode & _SLEEP and any(self._widths()):
            new_mode |= _RESTART
        if old_mode & _SLEEP and not value & _SLEEP:
            self._awake_since = now
        elif value & _RESTART and not value & _SLEEP and now - self._awake_since >= _WAKE_TIME:
            new_mode &= ~_RESTART
        self._registers[_MODE1] = new_mode

    def _end_transfer(self) -> None:
        """Clears RESTART if an output was written, in all registers if it changes at each ACK."""
        needed = 4 if self._registers[_MODE2] & _CHANGE_AT_ACK else 1
        for output in range(OUTPUTS):
            registers = range(_LED0 + 4 * output, _LED0 + 4 * output + 4)
            if len(self._loaded.intersection(registers)) >= needed:
                self._registers[_MODE1] &= ~_RESTART
        self._loaded.clear()

    def _command(self) -> None:
        """Drives the outputs, and reports what changes."""
        old_pulses = self._pulses
        self._drive()
        for output, (old, new) in enumerate(zip(old_pulses, self._pulses, strict=True)):
            if old != new:
                self.on_pulse(output, old, new)

    def _drive(self) -> None:
        stopped = self._registers[_MODE1] & (_SLEEP | _RESTART | _EXTERNAL_CLOCK)
        widths = (0,) * OUTPUTS if stopped else self._widths()
        mode2 = self._registers[_MODE2]
        if not mode2 & _TOTEM_POLE:
            self._pulses = (0,) * OUTPUTS
        elif not self.enabled:
            level = TICKS if mode2 & _WHEN_DISABLED == _HIGH else 0
            self._pulses = (level,) * OUTPUTS
        elif mode2 & _INVERT:
            self._pulses = tuple(TICKS - width for width in widths)
        else:
            self._pulses = widths

    def _widths(self) -> tuple[int, ...]:
        return tuple(self._width(_LED0 + 4 * output) for output in range(OUTPUTS))

    def _width(self, register: int) -> int:
        on_low, on_high, off_low, off_high = self._registers[register : register + 4]
        if off_high & _FULL:
            return 0
        if on_high & _FULL:
            return TICKS
        return ((off_low | off_high << 8) - (on_low | on_high << 8)) % TICKS


def _written_by_others(event: str, value: int) -> tuple[tuple[int, int], ...]:
    """Registers and values that another program writes, in order."""
    match event:
        case "sleep":
            return ((_MODE1, _ASLEEP),)
        case "doze":
            return ((_MODE1, _ASLEEP), (_MODE1, _AWAKE))
        case "prescale":
            restarted = (_MODE1, _AWAKE | _RESTART)
            return ((_MODE1, _ASLEEP), (_PRESCALE, value), (_MODE1, _AWAKE), restarted)
        case "mode2":
            return ((_MODE2, value),)
        case "all_off":
            return ((_ALL_LED + 3, _FULL),)
    first_register = _LED0 + 4 * value
    pulse = (_FULL, 0, 0) if event == "full_on" else (0, _MOVED_TICKS & 0xFF, _MOVED_TICKS >> 8)
    return tuple(zip(range(first_register, first_register + 4), (0, *pulse), strict=True))
