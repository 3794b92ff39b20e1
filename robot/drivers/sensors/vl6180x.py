"""ST VL6180X distance sensor on I²C: 0 to about 100 mm, up to 200 mm with a bright target.

Registers have 16-bit addresses, so each access is a combined transfer; of one read only, which is
all that the controller of a Raspberry Pi can do.

The chip keeps its supply, and so what another program left in it, when the computer starts again.
All that a range depends on is therefore written at every start, and the scale and limits of a
measurement are read back before each. One value is not known beforehand: the part-to-part offset,
which the chip loads from its own memory at a reset and which programs divide when they scale the
range. So it is copied, when it is known to be right, into a register of the light sensor, which is
not used.

Source: ST application note AN4545 (mandatory and recommended settings, single-shot sequence) and
the VL6180X data sheet (status and error codes, result registers, reset values). How long a
measurement takes depends on the target; the deadline below covers the longest convergence time.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Final

from robot.drivers.buses import Buses
from robot.drivers.links.i2c import I2CLink, I2CRegisters
from robot.errors import DeviceDataError, DeviceMissingError, DeviceTimeoutError
from robot.host.clock import Clock
from robot.toml_sections import Section

_MODEL_ID: Final = 0x000
_INTERRUPT_CLEAR: Final = 0x015
_FRESH_OUT_OF_RESET: Final = 0x016
_RANGE_START: Final = 0x018
_OFFSET: Final = 0x024
_LIGHT_START: Final = 0x038
_OFFSET_COPY: Final = 0x03A  # the light sensor's upper threshold: the offset, and its complement
_RANGE_STATUS: Final = 0x04D
_INTERRUPT_STATUS: Final = 0x04F
_RANGE_VALUE: Final = 0x062
_COUNTS: Final = 0x06C  # photons and convergence times of the last measurement, six of 32 bits
_COUNTS_SIZE: Final = 24
_SCALER: Final = 0x096
_IN_TURN: Final = 0x2A3  # ranges and light are measured alternately

_MODEL: Final = 0xB4
_READY: Final = 0x01  # range status: idle, a measurement can be started
_SAMPLE_READY: Final = 4  # interrupt status, low three bits
_FIRST_LOOK: Final = 6e-3  # s; no measurement is faster
_LOOK_INTERVAL: Final = 2e-3  # s
_DEADLINE: Final = 0.1  # s; a measurement converges within 49 ms, or fails
_LIGHT_DEADLINE: Final = 0.3  # s; a measurement of light takes 0.1 s and may have just begun
_NO_SCALING: Final = 0x00FD
_FROZEN_AFTER: Final = 10  # measurements that count exactly the same photons; no live one does

# Private registers; the note gives the values and no meanings.
_MANDATORY: Final = (
    (0x207, 0x01), (0x208, 0x01), (0x096, 0x00), (0x097, 0xFD), (0x0E3, 0x01), (0x0E4, 0x03),
    (0x0E5, 0x02), (0x0E6, 0x01), (0x0E7, 0x03), (0x0F5, 0x02), (0x0D9, 0x05), (0x0DB, 0xCE),
    (0x0DC, 0x03), (0x0DD, 0xF8), (0x09F, 0x00), (0x0A3, 0x3C), (0x0B7, 0x00), (0x0BB, 0x3C),
    (0x0B2, 0x09), (0x0CA, 0x09), (0x198, 0x01), (0x1B0, 0x17), (0x1AD, 0x00), (0x0FF, 0x05),
    (0x100, 0x05), (0x199, 0x05), (0x1A6, 0x1B), (0x1AC, 0x3E), (0x1A7, 0x1F), (0x030, 0x00),
)  # fmt: skip

_RECOMMENDED: Final = (
    (0x011, 0x10),  # interrupt pin as output, active when a sample is ready
    (0x10A, 0x30),  # averaging
    (0x03F, 0x46),  # light sensor gain
    (0x031, 0xFF),  # recalibrate for temperature after 255 measurements
    (0x041, 0x63),  # light sensor integration time
    (0x02E, 0x01),  # recalibrate once now
    (0x01B, 0x09),  # interval of continuous ranging, unused
    (0x03E, 0x31),  # interval of continuous light measurement, unused
    (0x014, 0x24),  # tell when a new sample is ready
)

# Register and value, as a reset leaves them: in one block, which is read back.
_MEASURING: Final = (
    (0x01C, 0x31),  # longest convergence, ms
    (0x01E, 0x00), (0x01F, 0x00),  # crosstalk compensation: none
    (0x021, 0x14),  # crosstalk compensation from how many mm on
    (0x022, 0x00), (0x023, 0x00),  # early convergence estimate
    (0x025, 0x00), (0x026, 0x00), (0x027, 0x00),  # range ignore: height and threshold
    (0x02C, 0xA0),  # ambient level multiplier
    (0x02D, 0x11),  # checks: early convergence, signal to noise
)  # fmt: skip
_BLOCK: Final = range(_MEASURING[0][0], _MEASURING[-1][0] + 1)

_MODE_SETTINGS: Final = (
    (0x017, 0x00),  # or the chip would not take what is written
    (0x012, 0x00),  # no history of measurements
    (0x119, 0x01),  # scale of the results
    (_IN_TURN, 0x00),
)

_NO_TARGET: Final = frozenset({6, 7, 8, 13, 15})  # no convergence, ignored, or beyond the range
_TOO_NEAR: Final = frozenset({12, 14})  # below zero after the chip's offset correction
_ERRORS: Final = MappingProxyType(
    {
        1: "its laser failed the continuity test",
        2: "its laser watchdog tripped during the test",
        3: "its laser watchdog tripped",
        4: "its first clock loop does not lock",
        5: "its second clock loop does not lock",
        11: "there is too much ambient light",
    }
)


@dataclass(frozen=True, kw_only=True)
class VL6180XSettings:
    """I²C bus and address of the sensor."""

    name: ClassVar[str] = "VL6180X"
    channels: ClassVar[tuple[int, ...]] = ()
    reach: ClassVar[float] = 0.255
    bus: int
    address: int

    @classmethod
    def read(cls, table: Section) -> VL6180XSettings:
        """Reads the keys ``bus`` and ``address``."""
        return cls(
            bus=table.integer("bus", 0, 255), address=table.integer("address", 0x08, 0x77, 0x29)
        )

    @property
    def claims(self) -> tuple[str, ...]:
        """Address and bus of the sensor."""
        return (f"0x{self.address:x} on I²C bus {self.bus}",)

    def open(self, buses: Buses, called: str) -> VL6180X:
        """Driver of the sensor; its ``start`` opens the bus."""
        del called
        return VL6180X(buses.i2c(self.bus), address=self.address, clock=buses.clock)

    def __str__(self) -> str:
        return f"0x{self.address:x} on I²C bus {self.bus}"


class VL6180X:
    """One sensor; call ``start`` before the first measurement.

    Args:
        link: The I²C bus, which the driver opens and closes.
        address: Address of the sensor: 0x29 after every power-up.
        clock: Paces the polls.
    """

    name = VL6180XSettings.name

    def __init__(self, link: I2CLink, *, address: int = 0x29, clock: Clock):
        self.link = link
        self._registers = I2CRegisters(self.link, address, self.name, wide=True)
        self._address = address
        self._clock = clock
        self._counts = b""
        self._repeats = 0
        self._checked = dict(_MEASURING)

    def start(self) -> None:
        """Opens the bus, anew if need be, identifies the sensor and loads its settings.

        Raises:
            DeviceError: Nothing, or something else, answers, the sensor is never ready, or another
                program changed it so that only a reset helps.
        """
        self.link.open()
        (model,) = self._registers.read(_MODEL_ID)
        if model != _MODEL:
            raise DeviceMissingError(
                f"The device at I²C address 0x{self._address:x} is no VL6180X: it calls itself "
                f"0x{model:02x} instead of 0x{_MODEL:02x}.",
                "Check which sensor is fitted, and the address in the configuration.",
            )
        self._stop()
        offset = self._factory_offset()
        for register, value in (*_MODE_SETTINGS, *_MANDATORY, *_RECOMMENDED, *_MEASURING):
            self._registers.write(register, value)
        self._registers.write(_OFFSET, offset)
        self._registers.write(_OFFSET_COPY, offset, offset ^ 0xFF)
        self._registers.write(_FRESH_OUT_OF_RESET, 0)  # last: until then it counts as reset
        self._checked = {**dict(_MEASURING), _OFFSET: offset}
        self._counts, self._repeats = b"", 0
        self._check_settings()

    def range_mm(self) -> int | None:
        """Measures once; takes about 10 ms, and up to 0.1 s without a target.

        Returns:
            The distance, mm, 0 when the target is too near to tell, or ``None`` when there is no
            target within reach.

        Raises:
            DeviceError: The sensor is gone, was reset or set otherwise, hangs, repeats itself or
                reports an error of its own.
        """
        self._await_ready()
        self._check_settings()
        # The interrupt of the last measurement, maybe an abandoned one.
        self._registers.write(_INTERRUPT_CLEAR, 0x07)
        self._registers.write(_RANGE_START, 0x01, done=lambda: not self._ready())
        self._clock.sleep(_FIRST_LOOK)
        self._await_sample()
        (status,) = self._registers.read(_RANGE_STATUS)
        (value,) = self._registers.read(_RANGE_VALUE)
        counts = self._registers.read(_COUNTS, _COUNTS_SIZE)
        error = status >> 4
        if error == 0:
            self._look_for_life(counts)
            return value
        if error in _NO_TARGET:
            return None
        if error in _TOO_NEAR:
            return 0
        raise DeviceDataError(
            f"The VL6180X could not measure: {_ERRORS.get(error, 'unknown reason')} "
            f"(error {error}).",
            "Shade it if it is in bright light; else switch it off and on.",
        )

    def distance(self) -> float | None:
        """Distance in m, measured once as by ``range_mm``, with its errors."""
        millimetres = self.range_mm()
        return None if millimetres is None else millimetres / 1000.0

    def check(self) -> None:
        """Does nothing: each measurement is checked when it is made."""

    def close(self) -> None:
        """Closes the bus."""
        self.link.close()

    def _look_for_life(self, counts: bytes) -> None:
        unchanged = counts == self._counts and any(counts)
        self._repeats = self._repeats + 1 if unchanged else 1
        self._counts = counts
        if self._repeats >= _FROZEN_AFTER:
            raise DeviceDataError(
                f"The VL6180X is frozen: {self._repeats} measurements counted exactly the same "
                "photons.",
                "Switch it off and on.",
            )

    def _stop(self) -> None:
        """Ends what another program left running: settings are taken only at rest."""
        if self._rests(_DEADLINE):
            return
        (in_turn,) = self._registers.read(_IN_TURN)
        # Where measurements go on and on, a second start is their end.
        self._registers.write(_LIGHT_START if in_turn else _RANGE_START, 0x01)
        if not self._rests(_LIGHT_DEADLINE):
            raise self._late("ready for its settings", _DEADLINE + _LIGHT_DEADLINE)

    def _factory_offset(self) -> int:
        """The offset that the chip loaded at its reset."""
        (offset,) = self._registers.read(_OFFSET)
        (fresh,) = self._registers.read(_FRESH_OUT_OF_RESET)
        if fresh == 1:
            return offset
        copy, complement = self._registers.read(_OFFSET_COPY, 2)
        if copy ^ complement == 0xFF:
            return copy
        scaler = int.from_bytes(self._registers.read(_SCALER, 2), "big")
        if scaler != _NO_SCALING:
            raise DeviceDataError(
                f"Another program set the VL6180X to another scale (0x{scaler:04x} instead of "
                f"0x{_NO_SCALING:04x}), and its factory offset is lost.",
                "Switch the sensor's supply off and on.",
            )
        return offset

    def _check_settings(self) -> None:
        """Checks that scale and limits of a measurement are still those that ``start`` set."""
        scaler = int.from_bytes(self._registers.read(_SCALER, 2), "big")
        values = dict(zip(_BLOCK, self._registers.read(_BLOCK[0], len(_BLOCK)), strict=True))
        wrong = [register for register, value in self._checked.items() if values[register] != value]
        if scaler == _NO_SCALING and not wrong:
            return
        flaw = f"register 0x{wrong[0]:03x}" if wrong else f"its range is scaled (0x{scaler:04x})"
        raise DeviceDataError(
            f"The VL6180X does not measure as it was set up: {flaw}.",
            "End the other program that uses the sensor.",
        )

    def _await_ready(self) -> None:
        for _ in range(round(_DEADLINE / _LOOK_INTERVAL)):
            (fresh,) = self._registers.read(_FRESH_OUT_OF_RESET)
            ready = self._ready()
            if fresh != 0:
                raise DeviceDataError(
                    "The VL6180X has been reset and lost its settings.",
                    "Check its supply.",
                )
            if ready:
                return
            self._clock.sleep(_LOOK_INTERVAL)
        raise self._late("ready for a measurement")

    def _rests(self, within: float) -> bool:
        for _ in range(round(within / _LOOK_INTERVAL)):
            if self._ready():
                return True
            self._clock.sleep(_LOOK_INTERVAL)
        return False

    def _ready(self) -> bool:
        (status,) = self._registers.read(_RANGE_STATUS)
        return bool(status & _READY)

    def _await_sample(self) -> None:
        for _ in range(round(_DEADLINE / _LOOK_INTERVAL)):
            (status,) = self._registers.read(_INTERRUPT_STATUS)
            if status >> 6:
                kind = "laser safety" if status >> 6 == 1 else "clock"
                raise DeviceDataError(
                    f"The VL6180X stopped with a {kind} error.", "Switch it off and on."
                )
            if status & 0x07 == _SAMPLE_READY:
                return
            self._clock.sleep(_LOOK_INTERVAL)
        raise self._late("done with a measurement")

    def _late(self, what: str, within: float = _DEADLINE) -> DeviceTimeoutError:
        return DeviceTimeoutError(
            f"The VL6180X was not {what} within {within:g} s.", "Switch it off and on."
        )
