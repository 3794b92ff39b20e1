"""An emulated VL6180X distance sensor on an I²C bus.

Source: ST application note AN4545 and the VL6180X data sheet. Assumed, for want of figures: how
long convergence takes, how photon counts scatter, how the return rate falls with the distance, and
how wrongly a chip measures without the settings that it should have: as the real one it gives no
error then, and here reads a fifth too little. Not modelled: light sensor, ambient light, history
buffer, interrupt pin.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import ClassVar, Final

from robot.host.clock import Clock
from sim_robot.electronics.fault_switch import Fault
from sim_robot.electronics.i2c_bus import I2CDevice

_SIZE: Final = 0x300
_OVERHEAD_TIME: Final = 7.5e-3  # s; preparation and read-out
_LEAST_CONVERGENCE: Final = 1e-3  # s; convergence at no distance
_LONGEST_CONVERGENCE: Final = 49e-3  # s; convergence without a target in reach, as set by a reset
_NEAR_RATE: Final = 20.0  # Mcps returned at no distance

_COUNTS: Final = 0x06C
_COUNTS_SIZE: Final = 24
_READ_ONLY: Final = frozenset({0x000, 0x04D, 0x04F, 0x062, *range(_COUNTS, _COUNTS + _COUNTS_SIZE)})

_EARLY_CONVERGENCE: Final = 6
_NO_CONVERGENCE: Final = 7
_RANGE_IGNORED: Final = 8
_RANGE_UNDERFLOW: Final = 12

_START: Final = 0x018
_OFFSET: Final = 0x024
_LIGHT_START: Final = 0x038
_SCALER: Final = 0x096
_NO_SCALING: Final = 253
_IN_TURN: Final = 0x2A3

_RESET_VALUES: Final = {
    0x000: 0xB4, 0x016: 0x01, 0x01B: 0xFF, 0x01C: 0x31, 0x021: 0x14, 0x02C: 0xA0, 0x02D: 0x11,
    0x03A: 0xFF, 0x03B: 0xFF, 0x04D: 0x01, 0x119: 0x01,
}  # fmt: skip

# Registers whose settings spoil a measurement: crosstalk compensation, result scaler, alternation.
_NEUTRAL: Final = {0x01E: 0x00, 0x01F: 0x00, 0x119: 0x01, _IN_TURN: 0x00}

# The private registers that the application note demands, address and value in hexadecimal.
_MANDATORY: Final = {
    int(register, 16): int(value, 16)
    for register, value in re.findall(
        r"(\w+)=(\w+)",
        "0207=01 0208=01 00e3=01 00e4=03 00e5=02 00e6=01 00e7=03 00f5=02 "
        "00d9=05 00db=ce 00dc=03 00dd=f8 009f=00 00a3=3c 00b7=00 00bb=3c 00b2=09 00ca=09 "
        "0198=01 01b0=17 01ad=00 00ff=05 0100=05 0199=05 01a6=1b 01ac=3e 01a7=1f 0030=00",
    )
}


class VL6180XEmulator(I2CDevice):
    """The sensor.

    Args:
        distance_mm: Distance to the target, mm, or ``None`` where there is none; asked once per
            measurement.
        clock: Is charged 100 µs per transfer and times the measurements.
        reach_mm: Distance of the farthest target that is still seen, mm; at most 255.
        offset_mm: Amount that the chip reads too little, measured and stored in the factory, mm.

    Attributes:
        address: Address on the bus; 0x29 after every reset.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        **I2CDevice.FAULTS,
        "busy": Fault("no measurement ever ends"),
        "frozen": Fault("every measurement repeats the first one's result, photon counts included"),
        "error": Fault("every measurement ends with error n", range(16)),
        "reset": Fault("the supply dips: the sensor forgets its settings", once=True),
        "rescaled": Fault("another program scales the range: the sensor reads a third", once=True),
    }

    def __init__(
        self,
        distance_mm: Callable[[], float | None],
        clock: Clock,
        *,
        reach_mm: float = 200.0,
        offset_mm: int = 9,
    ):
        super().__init__(clock)
        self._reach = reach_mm
        self._factory_offset = offset_mm
        self._distance = distance_mm
        self._measurements = 0
        self.power_cycle()

    def power_cycle(self) -> None:
        """Resets the sensor: every setting is lost."""
        self.address = 0x29
        self._registers = bytearray(_SIZE)
        for register, value in _RESET_VALUES.items():
            self._registers[register] = value
        self._registers[_OFFSET] = self._factory_offset & 0xFF
        self._used = bytes(self._registers)  # by the measurement under way
        self._endless = False
        self._index = 0
        self._done_at: float | None = None
        self._result = (0, 0, bytes(_COUNTS_SIZE))

    def answers(self, address: int) -> bool:
        """Whether an address is the sensor's."""
        return address == self.address

    def send(self, count: int) -> bytes:
        """Gives registers from the index on."""
        self._finish()
        return bytes(self._read() for _ in range(count))

    def _happen(self, event: str, value: int) -> None:
        if event == "reset":
            self.power_cycle()
        else:
            self._registers[_SCALER : _SCALER + 2] = (84).to_bytes(2, "big")
            self._registers[_OFFSET] = self._factory_offset // 3 & 0xFF

    def _read(self) -> int:
        value = self._registers[self._index]
        self._index = (self._index + 1) % _SIZE
        return value

    def receive(self, data: bytes) -> bool:
        """Takes the index and what is written from there on."""
        if len(data) >= 2:
            self._index = int.from_bytes(data[:2], "big") % _SIZE
        for value in data[2:]:
            self._store(self._index, value)
            self._index = (self._index + 1) % _SIZE
        return True

    def _store(self, register: int, value: int) -> None:
        if register == 0x015:
            if value & 0x01:
                self._registers[0x04F] &= ~0x07
        elif register == _START or (register == _LIGHT_START and self._registers[_IN_TURN]):
            self._finish()
            if value & 0x01 and self._endless:
                self._endless = False
            elif value & 0x01 and self._done_at is None:
                self._endless = bool(value & 0x02)
                self._start()
        elif register == 0x212:
            self.address = value & 0x7F
        elif register not in _READ_ONLY:
            self._registers[register] = value

    def _start(self) -> None:
        if not self._registers[0x017]:  # else settings are held back
            self._used = bytes(self._registers)
        distance = self._distance()
        max_convergence = self._used[0x01C] / 1000
        convergence = min(max_convergence, self._convergence(distance))
        self._done_at = self._clock.now() + _OVERHEAD_TIME + convergence
        self._result = self._measure(distance)
        self._registers[0x04D] = 0x00

    def _convergence(self, distance: float | None) -> float:
        if distance is None or distance > self._reach:
            return _LONGEST_CONVERGENCE
        return _LEAST_CONVERGENCE + max(distance, 0.0) / self._reach * _LONGEST_CONVERGENCE / 2

    def _measure(self, distance: float | None) -> tuple[int, int, bytes]:
        """Error code, value and photon counts of a measurement."""
        self._measurements += 1
        measured = (*self._see(distance), self._count())
        return self._held.setdefault("frozen", measured) if "frozen" in self._faults else measured

    def _see(self, distance: float | None) -> tuple[int, int]:
        if "error" in self._faults:
            return self._faults["error"] & 0x0F, 255
        if distance is None or (error := self._range_error(distance)):
            return (_NO_CONVERGENCE if distance is None else error), 255
        used = self._used
        scaler = int.from_bytes(used[_SCALER : _SCALER + 2], "big") or _NO_SCALING
        offset = int.from_bytes(used[_OFFSET : _OFFSET + 1], "big", signed=True)
        value = (distance - self._factory_offset) * scaler / _NO_SCALING + offset
        if any(used[register] != wanted for register, wanted in {**_MANDATORY, **_NEUTRAL}.items()):
            value *= 0.8
        return (_RANGE_UNDERFLOW, 0) if value < -0.5 else (0, min(255, round(value)))

    def _range_error(self, distance: float) -> int:
        """Why a target at a distance cannot be measured, an error code, or 0."""
        used = self._used
        rate = _NEAR_RATE * (1 - max(distance, 0.0) / 255)
        checks, estimate, threshold = used[0x02D], _mcps(used[0x022:]), _mcps(used[0x026:])
        if checks & 0x01 and rate < estimate:
            return _EARLY_CONVERGENCE
        if distance > self._reach or self._convergence(distance) > used[0x01C] / 1000:
            return _NO_CONVERGENCE
        return _RANGE_IGNORED if checks & 0x02 and rate < threshold else 0

    def _count(self) -> bytes:
        """Photon counts, which are never the same twice; only that they differ is modelled."""
        scatter = self._measurements * 2654435761 % 2**32
        counts = (12_000 + (scatter >> shift) % 256 for shift in range(0, 24, 4))
        return b"".join(count.to_bytes(4, "big") for count in counts)

    def _finish(self) -> None:
        if self._done_at is None or self._clock.now() < self._done_at or "busy" in self._faults:
            return
        error, value, counts = self._result
        self._done_at = None
        self._registers[_COUNTS : _COUNTS + _COUNTS_SIZE] = counts
        self._registers[0x062] = value
        self._registers[0x04D] = error << 4 | 0x01
        self._registers[0x04F] = self._registers[0x04F] & ~0x07 | 0x04
        if self._endless:
            self._start()


def _mcps(register: bytes) -> float:
    """A rate out of two registers, fixed point of 9.7 bits, Mcps."""
    return int.from_bytes(register[:2], "big") / 128
