"""An emulated MPU-6050: accelerometer and thermometer on an I²C bus; its gyroscope reads 0.

Source: InvenSense MPU-6000/6050 register map 4.2, and application note *MPU Hardware Offset
Registers* (the accelerometer's, in codes of ±8 g, which a reset loads from the factory's). FIFO,
interrupts, filters and the auxiliary bus are not modelled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, Final

from robot.host.clock import Clock
from sim_robot.electronics.fault_switch import Fault
from sim_robot.electronics.i2c_bus import I2CDevice

SAMPLE_PERIOD: Final = 1e-3  # s

_OFFSETS: Final = 0x06
_FACTORY_OFFSETS: Final = (-1210, 344, 1502)
_SELF_TEST: Final = 0x0D
_TRIM_CODES: Final = (14, 17, 11)
_SAMPLE_RATE: Final = 0x19
_ACCELEROMETER_CONFIG: Final = 0x1C
_SAMPLE: Final = 0x3B
_SAMPLE_SIZE: Final = 14
_POWER: Final = 0x6B
_STANDBY: Final = 0x6C
_WHO_AM_I: Final = 0x75
_SIZE: Final = 0x76
_DEVICE_RESET: Final = 0x80
_ASLEEP: Final = 0x40
_CODES_PER_G: Final = (16384, 8192, 4096, 2048)
_READ_ONLY: Final = frozenset({*range(_SAMPLE, _SAMPLE + _SAMPLE_SIZE), _WHO_AM_I})
_DITHER: Final = ((0, 1, 0), (1, 0, -1), (0, -1, 1), (-1, 0, 0))


class MPU6050Emulator(I2CDevice):
    """One chip.

    Args:
        acceleration: Returns the acceleration along the chip's axes, g; asked once per sample.
        clock: Is charged 100 µs per transfer and times the samples.
        address: Address of the chip: 0x68, or 0x69 by its pin.

    Attributes:
        celsius: Temperature of the die, °C.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        **I2CDevice.FAULTS,
        "stuck_axis": Fault(
            "axis n (0, 1, 2) keeps the code that it has when the fault begins", range(3)
        ),
        "railed_axis": Fault("axis n is at the end of its range", range(3)),
        "weak": Fault("axis n moves by 70 % of what it should in the self-test", range(3)),
        "other": Fault("another chip is there, which calls itself n", range(256)),
        "untrimmed": Fault("a copy of the chip is there, without factory trim"),
        "reset": Fault("the supply dips: the chip sleeps and has lost its settings", once=True),
        "sleep": Fault("something puts the chip to sleep: it repeats its last sample", once=True),
        "reranged": Fault("another program sets the range of ±8 g", once=True),
    }

    def __init__(
        self, acceleration: Callable[[], Sequence[float]], clock: Clock, *, address: int = 0x68
    ):
        super().__init__(clock)
        self._acceleration = acceleration
        self._address = address
        self._samples = 0
        self.celsius = 28.0
        self.power_cycle()

    def power_cycle(self) -> None:
        """Resets the chip: it sleeps, and every setting is lost."""
        self._registers = bytearray(_SIZE)
        x, y, z = _TRIM_CODES
        self._registers[_SELF_TEST : _SELF_TEST + 4] = bytes(
            (x >> 2 << 5, y >> 2 << 5, z >> 2 << 5, (x & 3) << 4 | (y & 3) << 2 | z & 3)
        )
        for axis, offset in enumerate(_FACTORY_OFFSETS):
            self._registers[_OFFSETS + 2 * axis : _OFFSETS + 2 * axis + 2] = _bytes(offset)
        self._registers[_POWER] = _ASLEEP
        self._registers[_WHO_AM_I] = 0x68
        self._pointer = 0
        self._sampled_at = -1.0

    def restart_dither(self) -> None:
        """Restarts the last bit's noise, so that a repeated observation reads the same."""
        self._samples = 0

    def answers(self, address: int) -> bool:
        """Whether an address is the chip's."""
        return address == self._address

    def receive(self, data: bytes) -> bool:
        """Takes the number of a register and what is written from there on."""
        if data:
            self._pointer = data[0] % _SIZE
        for value in data[1:]:
            self._store(self._pointer, value)
            self._pointer = (self._pointer + 1) % _SIZE
        return True

    def send(self, count: int) -> bytes:
        """Registers from the pointer on; a sample is of one moment."""
        self._sample()
        data = bytearray()
        for _ in range(count):
            value = self._registers[self._pointer]
            if self._pointer == _WHO_AM_I:
                value = self._faults.get("other", value) & 0xFF
            if "untrimmed" in self._faults and _SELF_TEST <= self._pointer < _SELF_TEST + 4:
                value = 0
            data.append(value)
            self._pointer = (self._pointer + 1) % _SIZE
        return bytes(data)

    def _happen(self, event: str, value: int) -> None:
        if event == "reset":
            self.power_cycle()
        elif event == "sleep":
            self._registers[_POWER] |= _ASLEEP
        else:
            self._registers[_ACCELEROMETER_CONFIG] = 0x10

    def _store(self, register: int, value: int) -> None:
        if register == _POWER and value & _DEVICE_RESET:
            self.power_cycle()
        elif register not in _READ_ONLY:
            self._registers[register] = value

    def _sample(self) -> None:
        now = self._clock.now()
        period = SAMPLE_PERIOD * (1 + self._registers[_SAMPLE_RATE])
        if self._registers[_POWER] & _ASLEEP or now - self._sampled_at < period:
            return
        self._sampled_at = now
        self._samples += 1
        codes = [self._code(axis, value) for axis, value in enumerate(self._acceleration())]
        stuck_axis = self._faults.get("stuck_axis")
        if stuck_axis is not None and 0 <= stuck_axis < 3:
            codes[stuck_axis] = self._held.setdefault("stuck_axis", codes[stuck_axis])
        words = [*codes, _word((self.celsius - 36.53) * 340), 0, 0, 0]
        for axis in range(3):
            if self._registers[_STANDBY] & 0x20 >> axis:
                words[axis] = int.from_bytes(
                    self._registers[_SAMPLE + 2 * axis : _SAMPLE + 2 * axis + 2], "big", signed=True
                )
        self._registers[_SAMPLE : _SAMPLE + _SAMPLE_SIZE] = b"".join(_bytes(word) for word in words)

    def _code(self, axis: int, value: float) -> int:
        config = self._registers[_ACCELEROMETER_CONFIG]
        scale = _CODES_PER_G[config >> 3 & 0x03]
        start = _OFFSETS + 2 * axis
        offset = int.from_bytes(self._registers[start : start + 2], "big", signed=True)
        value += (offset - _FACTORY_OFFSETS[axis]) / _CODES_PER_G[2]
        code = value * scale + _DITHER[self._samples % 4][axis]
        if config & 0x80 >> axis:
            share = 0.7 if self._faults.get("weak") == axis else 1.02
            trim = 0.34 * (0.92 / 0.34) ** ((_TRIM_CODES[axis] - 1) / 30)
            code += share * trim * scale
        if self._faults.get("railed_axis") == axis:
            return 32767
        return _word(code)


def _bytes(word: int) -> bytes:
    return word.to_bytes(2, "big", signed=True)


def _word(value: float) -> int:
    return max(-32768, min(32767, round(value)))
