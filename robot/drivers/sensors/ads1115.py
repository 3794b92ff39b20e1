"""TI ADS1115: four analogue inputs of 16 bits on I²C, up to four chips on a bus.

It takes the place of a data acquisition board: a force-sensitive resistor or a switch with its
resistor, from the supply to an input and on to ground, is a sensor with the driver ``analogue`` or
``switch``. Inputs are numbered 0 to 3 on the first chip, 4 to 7 on the second, and so on.

Each conversion is started by itself (single shot), so no result is ever an old one, and the
settings are read back before the result, so that a reset is noticed. The converter is so quiet that
its last bit often stands still: that an input is stuck cannot be told from its codes.

Source: TI ADS1113/4/5 data sheet, SBAS444 (registers and reset values of 9.6; that a conversion
under way ends with the settings that it began with, 9.4). The chip has no identity; what tells it
from others is its two threshold registers, which are not used here: they hold their reset values,
or take them again, all 16 bits, where another program used them.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Final

from robot.drivers.buses import Buses
from robot.drivers.links.i2c import I2CLink, I2CRegisters
from robot.errors import CommandError, DeviceDataError, DeviceMissingError, DeviceTimeoutError
from robot.host.clock import Clock
from robot.toml_sections import Section

ADDRESSES: Final = range(0x48, 0x4C)
INPUTS_PER_CHIP: Final = 4

_CONVERSION: Final = 0
_CONFIG: Final = 1
_THRESHOLDS: Final = (2, 3)
_THRESHOLDS_AT_RESET: Final = (0x8000, 0x7FFF)

_START: Final = 0x8000  # written: start; read: no conversion is under way
_INPUT_0: Final = 0x4000  # against ground; the other inputs follow in steps of 0x1000
_SINGLE_SHOT: Final = 0x0100
_860_PER_SECOND: Final = 0x00E0
_NO_COMPARATOR: Final = 0x0003
_CONVERSION_TIME: Final = 1.1 / 860 + 25e-6  # s; the rate may be 10 % off, and waking takes 25 µs
_LOOK_INTERVAL: Final = 0.5e-3  # s
_DEADLINE: Final = 10e-3  # s beyond the time of a conversion
_SLOWEST: Final = 0.15  # s; a conversion of another program at 8 a second

FULL_SCALES: Final = MappingProxyType(
    {"±6.144V": 0x0000, "±4.096V": 0x0200, "±2.048V": 0x0400, "±1.024V": 0x0600, "±0.512V": 0x0800}
)
"""Input ranges by name, and their bits in the configuration register."""


@dataclass(frozen=True, kw_only=True)
class ADS1115Settings:
    """Where the chips are, and their input range."""

    name: ClassVar = "ADS1115"
    dithers: ClassVar = False
    bus: int
    addresses: tuple[int, ...]
    input_range: str

    @property
    def rails(self) -> tuple[float, float]:
        """The volts at the ends of the input range."""
        full_scale = float(self.input_range.strip("±V"))
        return -full_scale, full_scale

    @property
    def inputs(self) -> range:
        """The numbers of the inputs."""
        return range(INPUTS_PER_CHIP * len(self.addresses))

    @property
    def claims(self) -> tuple[str, ...]:
        """The chips' addresses, each with its bus."""
        return tuple(f"0x{address:x} on I²C bus {self.bus}" for address in self.addresses)

    @classmethod
    def read(cls, table: Section) -> ADS1115Settings:
        """Reads the keys ``bus``, ``address`` and ``input_range``."""
        return cls(
            bus=table.integer("bus", 0, 255, 1),
            addresses=table.integers(
                "address", ADDRESSES[0], ADDRESSES[-1], (ADDRESSES[0],), written="{:#x}"
            ),
            input_range=table.choice("input_range", tuple(FULL_SCALES), "±4.096V"),
        )

    def open(self, buses: Buses) -> ADS1115:
        """Driver of the chips; its ``probe`` opens the bus."""
        return ADS1115(buses.i2c(self.bus), settings=self, clock=buses.clock)

    def __str__(self) -> str:
        chips = " and ".join(f"0x{address:x}" for address in self.addresses)
        return f"{chips} on I²C bus {self.bus}, {self.input_range}"


class ADS1115:
    """The inputs of one robot; call ``probe`` before the first scan.

    Args:
        link: The I²C bus, which the driver opens and closes.
        settings: Where the chips are, and their input range.
        clock: Paces the conversions.
    """

    def __init__(self, link: I2CLink, *, settings: ADS1115Settings, clock: Clock):
        self.link = link
        self._settings = settings
        self._clock = clock
        self._chips = [I2CRegisters(self.link, one, settings.name) for one in settings.addresses]

    def probe(self) -> None:
        """Opens the bus, anew if need be, identifies the chips and ends what they are doing.

        Raises:
            DeviceError: Nothing, or something else, answers, or a chip is busy without end.
        """
        self.link.open()
        for index in range(len(self._chips)):
            self._identify(index)
            self._halt(index)

    def scan(self, low: int, high: int) -> list[float]:
        """Volts of the inputs ``low`` to ``high``, converted one after another.

        Raises:
            CommandError: There are no such inputs.
            DeviceError: A chip is gone, was reset, or does not end a conversion.
        """
        inputs = self._settings.inputs
        if not 0 <= low <= high <= inputs[-1]:
            raise CommandError(f"the inputs are 0 to {inputs[-1]}, not {low} to {high}")
        return [self._convert(number) for number in range(low, high + 1)]

    def close(self) -> None:
        """Closes the bus."""
        self.link.close()

    def _identify(self, index: int) -> None:
        chip = self._chips[index]
        if (found := _thresholds(chip)) == _THRESHOLDS_AT_RESET:
            return
        for register, value in zip(_THRESHOLDS, _THRESHOLDS_AT_RESET, strict=True):
            chip.write(register, *value.to_bytes(2, "big"))
        if (held := _thresholds(chip)) != _THRESHOLDS_AT_RESET:
            raise DeviceMissingError(
                f"The device at I²C address 0x{self._settings.addresses[index]:x} is no ADS1115: "
                f"its registers 2 and 3 hold {found[0]:04x} and {found[1]:04x}, and when told to "
                f"hold 8000 and 7fff they hold {held[0]:04x} and {held[1]:04x}.",
                "Check which chip is fitted, and the addresses in the configuration.",
            )

    def _halt(self, index: int) -> None:
        """Ends conversions that another program left going: the last would be taken for ours."""
        wanted = self._config(0)
        self._chips[index].write(_CONFIG, *wanted.to_bytes(2, "big"))
        self._await_end(index, wanted, _SLOWEST)

    def _convert(self, number: int) -> float:
        index, channel = divmod(number, INPUTS_PER_CHIP)
        wanted = self._config(channel)
        # Writing this twice does no harm: the chip takes no start while it converts.
        self._chips[index].write(_CONFIG, *(wanted | _START).to_bytes(2, "big"))
        self._clock.sleep(_CONVERSION_TIME)
        self._await_end(index, wanted, _DEADLINE)
        code = _word(self._chips[index], _CONVERSION)
        return (code - (code >> 15 << 16)) / 32768 * self._settings.rails[1]

    def _config(self, channel: int) -> int:
        return (
            _INPUT_0
            | channel << 12
            | FULL_SCALES[self._settings.input_range]
            | _SINGLE_SHOT
            | _860_PER_SECOND
            | _NO_COMPARATOR
        )

    def _await_end(self, index: int, wanted: int, within: float) -> None:
        chip = f"The ADS1115 at 0x{self._settings.addresses[index]:x}"
        for _ in range(round(within / _LOOK_INTERVAL)):
            config = _word(self._chips[index], _CONFIG)
            if config & ~_START != wanted:
                raise DeviceDataError(
                    f"{chip} has lost its settings: {config & ~_START:04x} instead of "
                    f"{wanted:04x}. It was reset.",
                    "Check its supply, and that no other program uses the bus.",
                )
            if config & _START:
                return
            self._clock.sleep(_LOOK_INTERVAL)
        raise DeviceTimeoutError(
            f"{chip} did not end a conversion within {within:g} s.", "Switch it off and on."
        )


def _thresholds(chip: I2CRegisters) -> tuple[int, ...]:
    return tuple(_word(chip, register) for register in _THRESHOLDS)


def _word(chip: I2CRegisters, register: int) -> int:
    return int.from_bytes(chip.read(register, 2), "big")
