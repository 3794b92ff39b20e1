"""InvenSense MPU-6050: an accelerometer of ±2 g on I²C; its gyroscope only keeps time.

It reads g, and is wrong by up to 0.05 g, which is 3° of tilt: ``robotd calibrate`` puts that right
(``zero_g``, ``g_per_g``). ``forward``, ``left`` and ``up`` say which of the axes printed on the
board points where.

A chip that was reset sleeps, and one that sleeps repeats its last sample for ever: so its power
registers are read with every sample. What another program left in the chip ends with the reset at
every start; what such a program changes later shows in the settings, which are read back with every
sample of an observation.

Source: InvenSense MPU-6000/6050 product specification 3.4 (sensitivity, self-test limits of ±14 %)
and register map 4.2 (reset values of 3, factory trim of 4.4, temperature of 4.18); the identities
of related chips from Linux' driver ``inv_mpu6050``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Final

from robot.drivers.buses import Buses
from robot.drivers.links.i2c import I2CLink, I2CRegisters
from robot.drivers.sensors.contracts import AXIS_KEYS, MOUNTING_KEYS, CalibratedAxes, read_axes
from robot.errors import DeviceDataError, DeviceMissingError
from robot.host.clock import Clock
from robot.toml_sections import Section

ADDRESSES: Final = (0x68, 0x69)
DIRECTIONS: Final = ("x", "y", "z", "-x", "-y", "-z")

_OFFSETS: Final = 0x06  # of three axes, 16 bits each, which the chip loads at its reset
_OFFSETS_SIZE: Final = 6
_SELF_TEST: Final = 0x0D  # x, y, z: three bits of the accelerometer at the top; then two bits each
_SAMPLE_RATE: Final = 0x19  # then the filter, the gyroscope's range, the accelerometer's
_CONFIG: Final = 0x1A
_ACCELEROMETER_CONFIG: Final = 0x1C
_SAMPLE: Final = 0x3B  # three axes and the temperature, 16 bits each
_POWER: Final = 0x6B  # then a register with the axes that stand by
_WHO_AM_I: Final = 0x75

_IDENTITY: Final = 0x68
_RELATIVES: Final = MappingProxyType(
    {
        0x11: "ICM-20600",
        0x12: "ICM-20602",
        0x19: "MPU-6886",
        0x20: "ICM-20690",
        0x70: "MPU-6500",
        0x71: "MPU-9250",
        0x73: "MPU-9255",
        0x74: "MPU-6515",
        0x78: "MPU-6880",
        0x98: "ICM-20689",
        0xAF: "ICM-20608-G",
    }
)
_RESET: Final = 0x80
_AWAKE: Final = 0x01  # on the gyroscope's clock
_ASLEEP: Final = 0x40  # as a reset leaves the chip
_FILTER_44_HZ: Final = 0x03
_TWO_G: Final = 0x00
_EIGHT_G: Final = 0x10  # the range of the self-test
_ALL_AXES_TESTED: Final = 0xE0

_RESETTING: Final = 0.1  # s
_SETTLING: Final = 0.05  # s; ten times the filter's delay
_TEST_SAMPLES: Final = 10  # not tuned
_SAMPLE_PERIOD: Final = 2e-3  # s; the chip takes a sample every millisecond
_TOLERANCE: Final = 0.14  # share of the factory trim
_FULL_SCALE: Final = 32767
_CODES_PER_G: Final = 16384
_FROZEN_AFTER: Final = 20  # samples with exactly the same code; the noise is some 40 codes
_TEMPERATURES: Final = (-40.0, 85.0)  # °C in which the chip may be used


@dataclass(frozen=True, kw_only=True)
class MPU6050Settings(CalibratedAxes):
    """Where the chip is, how it is mounted, and what it reads at 0 g and per g."""

    name: ClassVar[str] = "MPU-6050"
    unit: ClassVar[str] = "g"
    channels: ClassVar[tuple[int, ...]] = ()
    bus: int
    address: int
    mounting: tuple[str, ...] = DIRECTIONS[:3]
    zero: tuple[float, ...] = (0.0, 0.0, 0.0)  # by the data sheet
    per_g: tuple[float, ...] = (1.0, 1.0, 1.0)

    @property
    def claims(self) -> tuple[str, ...]:
        """Address and bus of the chip."""
        return (f"0x{self.address:x} on I²C bus {self.bus}",)

    @classmethod
    def read(cls, table: Section) -> MPU6050Settings:
        """Reads ``bus``, ``address``, ``forward``, ``left``, ``up``, ``zero_g``, ``g_per_g``."""
        defaults = zip(MOUNTING_KEYS, DIRECTIONS, strict=False)
        mounting = tuple(table.choice(key, DIRECTIONS, axis) for key, axis in defaults)
        if not _right_handed(mounting):
            raise table.refuse(
                "forward",
                f"is {mounting[0]}, left {mounting[1]} and up {mounting[2]}: a chip can be turned, "
                "but not mirrored. Look at the arrows on it.",
            )
        zero, per_g = cls.zero, cls.per_g
        if any(table.has(key) for key in AXIS_KEYS[cls.unit]):
            zero, per_g = read_axes(table, cls.unit)
        return cls(
            bus=table.integer("bus", 0, 255, 1),
            address=table.one_of("address", ADDRESSES, ADDRESSES[0], written="{:#x}"),
            mounting=mounting,
            zero=zero,
            per_g=per_g,
        )

    def open(self, buses: Buses, called: str) -> MPU6050:
        """Driver of the chip; its ``start`` opens the bus."""
        del called
        return MPU6050(buses.i2c(self.bus), settings=self, clock=buses.clock)

    def axis(self, index: int) -> str:
        """The chip's axis that serves as x, y or z, for a sentence."""
        return f"the chip's {self.mounting[index].strip('-')}"

    @property
    def wiring(self) -> Mapping[str, str]:
        """How the chip is mounted."""
        return dict(zip(MOUNTING_KEYS, self.mounting, strict=True))

    @property
    def key(self) -> str:
        """Keys of ``robot.toml`` that say which axis is which."""
        return "accelerometer.forward, left and up"

    def __str__(self) -> str:
        return f"0x{self.address:x} on I²C bus {self.bus}"


class MPU6050:
    """One chip; call ``start`` before the first sample.

    Args:
        link: The I²C bus, which the driver opens and closes.
        settings: Where the chip is, and its calibration.
        clock: Paces the self-test.
    """

    name = MPU6050Settings.name

    def __init__(self, link: I2CLink, *, settings: MPU6050Settings, clock: Clock):
        self.link = link
        self._settings = settings
        self._chip = I2CRegisters(self.link, settings.address, self.name)
        self._clock = clock
        self._deviations: tuple[float, ...] = ()
        self._offsets = b""
        self._last: tuple[int, ...] = (0, 0, 0)
        self._repeats = [0, 0, 0]
        self.celsius = 25.0

    def start(self) -> None:
        """Opens the bus, anew if need be; identifies, resets, sets up and tests the chip: 0.3 s.

        The chip must lie still.

        Raises:
            DeviceError: Nothing, or something else, answers, or the chip takes no reset or fails
                its self-test.
        """
        self.link.open()
        self._identify()
        self._chip.write(_POWER, _RESET)
        self._clock.sleep(_RESETTING)
        (power,) = self._chip.read(_POWER)
        if power != _ASLEEP:
            raise DeviceDataError(
                f"The MPU-6050 was told to reset and did not (power register 0x{power:02x}).",
                "Switch it off and on; if that does not help, replace it.",
            )
        self._offsets = self._chip.read(_OFFSETS, _OFFSETS_SIZE)
        self._chip.write(_POWER, _AWAKE)
        self._chip.write(_CONFIG, _FILTER_44_HZ)
        self._test()
        self._chip.write(_ACCELEROMETER_CONFIG, _TWO_G)
        self._clock.sleep(_SETTLING)
        self._check_settings()
        self._last, self._repeats = (0, 0, 0), [0, 0, 0]

    def raw(self) -> tuple[float, float, float]:
        """One uncalibrated sample along the robot's axes, g.

        Raises:
            DeviceError: The chip is gone, sleeps, was reset, or is at an end of its range.
        """
        axes, celsius = self._sample()
        self._check_awake()
        if any(abs(code) >= _FULL_SCALE for code in axes):
            raise DeviceDataError(
                "The MPU-6050 is at the end of its range, 2 g.", "Let nothing shake the robot."
            )
        if not _TEMPERATURES[0] <= celsius <= _TEMPERATURES[1]:
            raise DeviceDataError(
                f"The MPU-6050 says that it has {celsius:.0f} °C.", "Check its supply."
            )
        pairs = list(zip(axes, self._last, strict=True))
        self._repeats = [
            count + 1 if code == previous else 1
            for count, (code, previous) in zip(self._repeats, pairs, strict=True)
        ]
        self._last = axes
        self.celsius = celsius
        x, y, z = (_along(axes, direction) for direction in self._settings.mounting)
        return x, y, z

    def acceleration(self) -> tuple[float, float, float]:
        """One sample, g; errors as those of ``raw``."""
        return self._settings.acceleration(self.raw())

    def check(self) -> None:
        """Checks that all axes are alive, and measure as they were set up.

        Raises:
            DeviceDataError: An axis gave exactly the same again and again, or another program
                changed the range, the filter, the rate or the offsets.
        """
        self._check_settings()
        for axis, count in zip("xyz", self._repeats, strict=True):
            if count >= _FROZEN_AFTER:
                raise DeviceDataError(
                    f"The MPU-6050's {axis} axis is stuck: it gave exactly the same {count} times "
                    "running.",
                    "Switch it off and on.",
                )

    def details(self) -> str:
        """What the doctor tells beside the acceleration: the self-test, and the temperature."""
        tested = ", ".join(
            f"{axis} {deviation:+.0%}"
            for axis, deviation in zip("xyz", self._deviations, strict=True)
        )
        return f"self-test {tested} of at most {_TOLERANCE:.0%}; {self.celsius:.0f} °C"

    def close(self) -> None:
        """Closes the bus."""
        self.link.close()

    def _identify(self) -> None:
        (identity,) = self._chip.read(_WHO_AM_I)
        if identity == _IDENTITY:
            return
        relative = _RELATIVES.get(identity)
        raise DeviceMissingError(
            f"The device at I²C address 0x{self._settings.address:x} is no MPU-6050: it calls "
            f"itself 0x{identity:02x} instead of 0x{_IDENTITY:02x}"
            + (f", as an {relative} does." if relative else "."),
            f"Many boards sold as GY-521 have an {relative} now. It will not do, for its self-test "
            "is another: fit a board with a genuine MPU-6050."
            if relative
            else "Check which sensor is fitted, and the address in the configuration; boards sold "
            "as MPU-6050 may have a copy of it, which will not do.",
        )

    def _check_settings(self) -> None:
        held = self._chip.read(_SAMPLE_RATE, 4)
        wanted = bytes((0, _FILTER_44_HZ, 0, _TWO_G))
        offsets = self._chip.read(_OFFSETS, _OFFSETS_SIZE)
        if (held, offsets) != (wanted, self._offsets):
            raise DeviceDataError(
                "The MPU-6050 does not measure as it was set up: its registers 19 to 1c hold "
                f"{held.hex(' ')} instead of {wanted.hex(' ')}, its offsets {offsets.hex(' ')} "
                f"instead of {self._offsets.hex(' ')}.",
                "End the other program that uses the chip.",
            )

    def _check_awake(self) -> None:
        power, standing_by = self._chip.read(_POWER, 2)
        if power == _ASLEEP:
            raise DeviceDataError(
                "The MPU-6050 was reset: it sleeps and has lost its settings.", "Check its supply."
            )
        if power != _AWAKE or standing_by:
            raise DeviceDataError(
                "The MPU-6050 sleeps, or lost its clock (power registers "
                f"0x{power:02x} 0x{standing_by:02x}).",
                "Check that no other program uses the bus.",
            )

    def _sample(self) -> tuple[tuple[int, ...], float]:
        """Codes of the chip's axes, and its temperature, °C."""
        data = self._chip.read(_SAMPLE, 8)
        words = [int.from_bytes(data[i : i + 2], "big", signed=True) for i in range(0, 8, 2)]
        return tuple(words[:3]), words[3] / 340 + 36.53

    def _test(self) -> None:
        trims = self._chip.read(_SELF_TEST, 4)
        codes = [trims[axis] >> 5 << 2 | trims[3] >> (4 - 2 * axis) & 0x03 for axis in range(3)]
        if not all(codes):
            raise DeviceMissingError(
                f"The chip at I²C address 0x{self._settings.address:x} has no factory trim: it is "
                "no genuine MPU-6050, and nothing tells whether it measures rightly.",
                "Fit a board with a genuine MPU-6050.",
            )
        at_rest, tested = self._mean(_EIGHT_G), self._mean(_EIGHT_G | _ALL_AXES_TESTED)
        self._check_awake()
        deviations = []
        for index, axis in enumerate("xyz"):
            trim = 4096 * 0.34 * (0.92 / 0.34) ** ((codes[index] - 1) / 30)
            response = tested[index] - at_rest[index]
            deviations.append(response / trim - 1)
            if not abs(deviations[-1]) <= _TOLERANCE:
                raise DeviceDataError(
                    f"The MPU-6050 failed its self-test: its {axis} axis moved by {response:.0f} "
                    f"codes instead of {trim:.0f}.",
                    "Let the robot lie still while it starts; if it fails again, replace the chip.",
                )
        self._deviations = tuple(deviations)

    def _mean(self, config: int) -> list[float]:
        self._chip.write(_ACCELEROMETER_CONFIG, config)
        self._clock.sleep(_SETTLING)
        samples = []
        for _ in range(_TEST_SAMPLES):
            samples.append(self._sample()[0])
            self._clock.sleep(_SAMPLE_PERIOD)
        return [sum(axis) / _TEST_SAMPLES for axis in zip(*samples, strict=True)]


def _along(axes: tuple[int, ...], direction: str) -> float:
    sign = -1 if direction[0] == "-" else 1
    return sign * axes["xyz".index(direction[-1])] / _CODES_PER_G


def _right_handed(mounting: tuple[str, ...]) -> bool:
    """Whether three axes are different and right-handed: turned into place, not mirrored."""
    order = ["xyz".index(direction[-1]) for direction in mounting]
    if len(set(order)) < 3:
        return False
    is_cyclic = (order[1] - order[0]) % 3 == 1
    return is_cyclic == (sum(direction[0] == "-" for direction in mounting) % 2 == 0)
