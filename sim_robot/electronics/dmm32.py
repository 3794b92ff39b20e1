"""An emulated DMM-32X-AT: the register file of its analogue inputs, seen through I/O ports.

Source: Diamond Systems DMM-32DX-AT hardware manual, held to the probe of Linux' comedi driver.
Assumed where the manual gives no figure: a conversion that is started while the input settles
(WAIT) repeats the sample before, so that a hasty driver is found out. Not modelled: DACs, digital
I/O, counters, interrupts, differential inputs.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import ClassVar, Final

from robot.host.clock import Clock
from sim_robot.electronics.fault_switch import Fault, FaultSwitch

WINDOW: Final = 16  # ports
ACCESS_TIME: Final = 1e-6  # s; of an ISA bus cycle
SETTLE_TIME: Final = 10e-6  # s
CONVERSION_TIME: Final = 4e-6  # s

_FLOATING: Final = 0xFF
_SCAN_INTERVALS: Final = (20e-6, 15e-6, 10e-6, 5e-6)  # s
_GAINS: Final = (1.0, 2.0, 4.0, 8.0)
_CODES_PER_SIDE: Final = 32768


class Dither:
    """The noise of a converter itself, which is never quite still, as volts to add to its inputs.

    From scan to scan the codes are off by 0, +1, 0, -1.

    Args:
        full_scale: Full scale of the bipolar range in use, V.
    """

    def __init__(self, full_scale: float = 5.0):
        self._code = full_scale / _CODES_PER_SIDE
        self.restart()

    def restart(self) -> None:
        """Restarts the sequence, so that a repeated observation reads the same."""
        self._scans = 0

    def next_scan(self) -> float:
        """Volts to add to every input in the next scan."""
        self._scans += 1
        return (0.0, self._code, 0.0, -self._code)[self._scans % 4]


class DMM32Emulator(FaultSwitch):
    """The board, as an object to give to the driver in place of ``/dev/port``.

    Args:
        volts: The voltage at channel 0 to 31; asked once per conversion.
        clock: Is charged 1 µs per access and times settling and conversion.
        base: Base address.
        fifo_depth: Number of samples that the FIFO holds.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        "absent": Fault("no board answers: every port reads 0xFF"),
        "stuck_wait": Fault("WAIT never falls"),
        "stuck_busy": Fault("STS never falls"),
        "overflow": Fault("every conversion overflows the FIFO"),
        "lost_sample": Fault("every conversion loses its last sample"),
        "stuck_channel": Fault(
            "channel n keeps the code that it has when the fault begins", range(32)
        ),
        "railed_channel": Fault("channel n reads the top of the range", range(32)),
        "swapped_channels": Fault("the wires of channels n and n+1 are exchanged", range(31)),
    }

    def __init__(
        self,
        volts: Callable[[int], float],
        clock: Clock,
        *,
        base: int = 0x300,
        fifo_depth: int = 1024,
    ):
        super().__init__()
        self._volts = volts
        self._clock = clock
        self._base = base
        self._depth = fifo_depth
        self._paged = [bytearray(4) for _ in range(8)]
        self._last_code = 0
        self._reset()
        self._readers: tuple[Callable[[float], int], ...] = (
            self._read_lsb,
            self._read_msb,
            lambda now: self._low,
            lambda now: self._high,
            lambda now: 0,  # converters idle, digital inputs low
            lambda now: 0,
            lambda now: self._depth >> 1 & 0xFF,
            self._read_fifo_status,
            self._read_control_status,
            lambda now: self._interrupts,
            lambda now: self._counters,
            self._read_analogue_status,
        )

    def read(self, port: int, n: int = 1) -> bytes:
        """Reads ``n`` successive ports, lowest first."""
        self._clock.charge(n * ACCESS_TIME)
        now = self._clock.now()
        if n == 1:
            return bytes((self._read(port - self._base, now),))
        return bytes(self._read(port - self._base + i, now) for i in range(n))

    def write(self, port: int, value: int) -> None:
        """Writes one byte, 0 to 255, to a port."""
        self._clock.charge(ACCESS_TIME)
        offset = port - self._base
        if "absent" in self._faults or not 0 <= offset < WINDOW:
            return
        match offset:
            case 0:
                self._start()
            case 2:
                self._low = self._channel = value & 0x1F
                self._settled_at = self._clock.now() + SETTLE_TIME
            case 3:
                self._high = value & 0x1F
            case 7 if value & 0x02:
                self._reset_fifo(value)
            case 7:
                self._fifo_flags = value & 0x0C
            case 8:
                if value & 0x20:
                    self._reset()
                self._page = value & 0x07
            case 9:
                self._interrupts = value & 0xE3
            case 10:
                self._counters = value
            case 11:
                self._analogue = value & 0x3F
                self._settled_at = self._clock.now() + SETTLE_TIME
            case 12 | 13 | 14 | 15:
                self._paged[self._page][offset - 12] = value

    def close(self) -> None:
        """Does nothing."""

    def _reset(self) -> None:
        self._low = self._high = self._channel = 0
        self._page = self._interrupts = self._counters = self._analogue = 0
        self._settled_at = self._done_at = 0.0
        self._reset_fifo(0)

    def _reset_fifo(self, flags: int) -> None:
        self._fifo: deque[tuple[float, int]] = deque()  # (when it is there, code)
        self._overflowed = False
        self._fifo_flags = flags & 0x08  # FIFOEN survives where it is written with the reset

    # --- reading

    def _read(self, offset: int, now: float) -> int:
        if "absent" in self._faults or not 0 <= offset < WINDOW:
            return _FLOATING
        if offset >= 12:
            return self._paged[self._page][offset - 12]
        return self._readers[offset](now)

    def _read_lsb(self, now: float) -> int:
        if not self._has_sample(now):
            return _FLOATING
        return self._fifo[0][1] & 0xFF

    def _read_msb(self, now: float) -> int:
        if not self._has_sample(now):
            return _FLOATING
        return self._fifo.popleft()[1] >> 8 & 0xFF

    def _has_sample(self, now: float) -> bool:
        return bool(self._fifo) and self._fifo[0][0] <= now

    def _read_fifo_status(self, now: float) -> int:
        samples = sum(ready <= now for ready, _ in self._fifo)
        return (
            (samples == 0) << 7
            | (samples >= self._depth // 2) << 6
            | (samples >= self._depth) << 5
            | self._overflowed << 4
            | self._fifo_flags
            | self._page & 0x03
        )

    def _read_control_status(self, now: float) -> int:
        busy = now < self._done_at or "stuck_busy" in self._faults
        return busy << 7 | 0x60 | self._channel  # 0x60: all inputs single-ended

    def _read_analogue_status(self, now: float) -> int:
        wait = now < self._settled_at or "stuck_wait" in self._faults
        return wait << 7 | self._analogue & 0x0F

    # --- converting

    def _start(self) -> None:
        now = self._clock.now()
        if now < self._done_at:
            return  # busy
        if self._fifo_flags & 0x04:
            count = (self._high - self._low & 0x1F) + 1
            interval = _SCAN_INTERVALS[self._analogue >> 4 & 0x03]
        else:
            count, interval = 1, CONVERSION_TIME
        is_unsettled = now < self._settled_at
        for index in range(count):
            code = self._last_code if is_unsettled else self._convert(self._channel)
            if len(self._fifo) >= self._depth:
                self._overflowed = True
            else:
                self._fifo.append((now + (index + 1) * interval, code))
            self._last_code = code
            self._channel = self._low if self._channel == self._high else self._channel + 1 & 0x1F
        self._done_at = now + count * interval
        if self._low != self._high:
            self._settled_at = self._done_at + SETTLE_TIME
        if "overflow" in self._faults:
            self._overflowed = True
        if "lost_sample" in self._faults:
            self._fifo.pop()

    def _convert(self, channel: int) -> int:
        if self._faults.get("railed_channel") == channel:
            return _CODES_PER_SIDE - 1
        if self._faults.get("stuck_channel") == channel:
            code: int = self._held.setdefault("stuck_channel", self._code(channel))
            return code
        return self._code(channel)

    def _code(self, channel: int) -> int:
        full_scale = (10.0 if self._analogue & 0x08 else 5.0) / _GAINS[self._analogue & 0x03]
        swapped = self._faults.get("swapped_channels")
        if swapped is not None and channel in (swapped, swapped + 1):
            channel = 2 * swapped + 1 - channel
        volts = self._volts(channel)
        if self._analogue & 0x04:  # unipolar: the same codes over 0 V to full scale
            volts, full_scale = volts - full_scale / 2, full_scale / 2
        code = round(volts / full_scale * _CODES_PER_SIDE)
        return min(max(code, -_CODES_PER_SIDE), _CODES_PER_SIDE - 1)
