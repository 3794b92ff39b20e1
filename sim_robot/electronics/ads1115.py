"""An emulated ADS1115: four analogue inputs on an I²C bus.

Source: TI ADS1113/4/5 data sheet, SBAS444. The comparator and its pin are not modelled, its
registers are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar, Final

from robot.host.clock import Clock
from sim_robot.electronics.fault_switch import Fault
from sim_robot.electronics.i2c_bus import I2CDevice

_CONVERSION: Final = 0
_CONFIG: Final = 1
_RESET_CONFIG: Final = 0x8583
_START: Final = 0x8000
_SINGLE_SHOT: Final = 0x0100
_WAKE_TIME: Final = 25e-6  # s
_FULL_SCALES: Final = (6.144, 4.096, 2.048, 1.024, 0.512, 0.256, 0.256, 0.256)
_RATES: Final = (8, 16, 32, 64, 128, 250, 475, 860)
_INPUT_PAIRS: Final = ((0, 1), (0, 3), (1, 3), (2, 3), (0, None), (1, None), (2, None), (3, None))


class ADS1115Emulator(I2CDevice):
    """One chip.

    Args:
        volts: The voltage at input 0 to 3; asked at the end of each conversion.
        clock: Is charged 100 µs per transfer and times the conversions.
        address: Address that the chip's pin sets.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        **I2CDevice.FAULTS,
        "busy": Fault("no conversion ever ends"),
        "stuck_channel": Fault(
            "input n keeps the voltage that it has when the fault begins", range(4)
        ),
        "railed_channel": Fault("input n reads the top of the range", range(4)),
        "reset": Fault(
            "the supply dips: the chip forgets its settings, and a conversion under way", once=True
        ),
        "comparing": Fault(
            "another program uses the comparator and converts input 0 on and on", once=True
        ),
    }

    def __init__(self, volts: Callable[[int], float], clock: Clock, *, address: int = 0x48):
        super().__init__(clock)
        self._volts = volts
        self._address = address
        self.power_cycle()

    def power_cycle(self) -> None:
        """Resets the chip: every setting is lost."""
        self._pointer = _CONVERSION
        self._registers = [0x0000, _RESET_CONFIG, 0x8000, 0x7FFF]
        self._done_at: float | None = None
        self._conversion_config = _RESET_CONFIG  # the settings of the conversion under way

    def answers(self, address: int) -> bool:
        """Whether an address is the chip's, or that of the general call."""
        return address in (self._address, 0x00)

    def receive(self, data: bytes) -> bool:
        """Takes the number of a register, and its two bytes."""
        if data == b"\x06" and self._called == 0x00:
            self.power_cycle()
            return True
        if not data:
            return False
        self._pointer = data[0] & 0x03
        if len(data) >= 3 and self._pointer != _CONVERSION:
            self._store(self._pointer, int.from_bytes(data[1:3], "big"))
        return True

    def send(self, count: int) -> bytes:
        """Gives the register at the pointer, again and again."""
        self._finish()
        value = self._registers[self._pointer]
        if self._pointer == _CONFIG:
            value = value & ~_START | (_START if self._done_at is None else 0)
        word = value.to_bytes(2, "big")
        return (word * (count // 2 + 1))[:count]

    def _happen(self, event: str, value: int) -> None:
        if event == "reset":
            self.power_cycle()
        else:
            self._registers[2:] = [0x0000, 0x8000]  # its pin tells when a conversion has ended
            self._store(_CONFIG, 0x4280)

    def _store(self, register: int, value: int) -> None:
        self._finish()
        starts = register == _CONFIG and (value & _START or not value & _SINGLE_SHOT)
        self._registers[register] = value
        if starts and self._done_at is None:
            self._begin()

    def _begin(self) -> None:
        self._conversion_config = self._registers[_CONFIG]
        rate = _RATES[self._conversion_config >> 5 & 0x07]
        self._done_at = self._clock.now() + _WAKE_TIME + 1.0 / rate

    def _finish(self) -> None:
        if self._done_at is None or self._clock.now() < self._done_at or "busy" in self._faults:
            return
        self._registers[_CONVERSION] = self._convert() & 0xFFFF
        self._done_at = None
        if not self._registers[_CONFIG] & _SINGLE_SHOT:
            self._begin()

    def _convert(self) -> int:
        config = self._conversion_config
        plus, minus = _INPUT_PAIRS[config >> 12 & 0x07]
        full_scale = _FULL_SCALES[config >> 9 & 0x07]
        if self._faults.get("railed_channel") == plus:
            return 32767
        volts = self._volts_at(plus) - (0.0 if minus is None else self._volts_at(minus))
        return max(-32768, min(32767, round(volts / full_scale * 32768)))

    def _volts_at(self, channel: int) -> float:
        if self._faults.get("stuck_channel") == channel:
            volts: float = self._held.setdefault("stuck_channel", self._volts(channel))
            return volts
        return self._volts(channel)
