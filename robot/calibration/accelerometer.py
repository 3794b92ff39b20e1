"""The accelerometer: six positions, or one.

Gravity is the standard. With an axis straight up and straight down it reads +1 g and −1 g, which
gives its zero and its gain; a placement that leans by a few degrees hardly matters, because gravity
along an axis changes with the cosine. Level only finds the zeros, believing the gains, and a lean
matters in full: so the robot is turned a quarter at a time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Protocol

from robot.calibration.questions import Questions
from robot.configuration.calibration_file import AxesCalibration
from robot.drivers.sensors.contracts import CalibratedAxes
from robot.errors import DeviceDataError
from robot.host.clock import Clock
from robot.sensing.samples import spread

POSITIONS: Final = (
    ("nose up", 0, 1),
    ("nose down", 0, -1),
    ("left side up", 1, 1),
    ("left side down", 1, -1),
    ("upright", 2, 1),
    ("upside down", 2, -1),
)
QUARTERS: Final = 4
SAMPLES: Final = 100
_MOVING: Final = 0.02  # V or g rms: far above the noise of any such sensor
_LEAN: Final = math.sin(math.radians(8))
_MIN_GAIN: Final = 0.05  # V or g per g

Axes = tuple[float, ...]


class RawAxes(Protocol):
    """A driver of three axes that are to be calibrated."""

    def raw(self) -> Sequence[float]:
        """One sample of the axes, in their unit.

        Raises:
            DeviceError: The device failed.
        """

    def check(self) -> None:
        """As ``SensorDriver.check``."""


class AccelerometerSession:
    """Leads through the accelerometer.

    Args:
        sensor: Its axes and what was believed of them so far.
        driver: Reads them.
        rate: Samples per second.
        clock: The robot clock.
        dialogue: With whom.
    """

    def __init__(
        self,
        sensor: CalibratedAxes,
        driver: RawAxes,
        *,
        rate: float,
        clock: Clock,
        dialogue: Questions,
    ):
        self._sensor = sensor
        self._driver = driver
        self._rate = rate
        self._clock = clock
        self._dialogue = dialogue

    def run(self) -> AxesCalibration | None:
        """The calibration, or ``None`` if it was skipped.

        Raises:
            AbandonedError: Somebody left.
        """
        self._dialogue.say(
            "\nAccelerometer\n"
            "  six    hold the robot still in six positions, each axis up and down: zero and gain\n"
            "  level  put it on a level surface: the zeros alone, with the gains that are set"
        )
        while True:
            choice = self._dialogue.choose(
                "accelerometer: six, level or skip", "six", "level", "skip"
            )
            if choice == "skip":
                return None
            calibration = self._six() if choice == "six" else self._level()
            if calibration is not None:
                return calibration

    def _six(self) -> AxesCalibration | None:
        seen = {name: self._measure(name) for name, _, _ in POSITIONS}
        while True:
            pairs = [
                tuple(seen[name] for name, axis, _ in POSITIONS if axis == wanted)
                for wanted in range(3)
            ]
            swings = [
                tuple((up - down) / 2 for up, down in zip(*pair, strict=True)) for pair in pairs
            ]
            if not self._sound(swings):
                return None
            zero = tuple((pair[0][axis] + pair[1][axis]) / 2 for axis, pair in enumerate(pairs))
            gains = tuple(swing[axis] for axis, swing in enumerate(swings))
            leaning = self._leaning(seen, zero, gains)
            if leaning is None:
                return AxesCalibration(unit=self._sensor.unit, zero=zero, per_g=gains)
            self._dialogue.say(f"It leaned too much in the position '{leaning}': that once more.")
            seen[leaning] = self._measure(leaning)

    def _sound(self, swings: Sequence[Axes]) -> bool:
        """Whether each axis answers on its own channel."""
        for axis, swing in enumerate(swings):
            sizes = [abs(value) for value in swing]
            best = sizes.index(max(sizes))
            if sizes[best] < _MIN_GAIN:
                self._dialogue.say(
                    f"Nothing saw the {'xyz'[axis]} axis turn over ({sizes[best] * 1000:.0f} "
                    f"m{self._sensor.unit} a g). Check the sensor's supply and wires, and that you "
                    "did turn the robot."
                )
                return False
            if best != axis:
                self._dialogue.say(
                    f"The {'xyz'[axis]} axis answers on {self._sensor.axis(best)}, and "
                    f"{self._sensor.key} in robot.toml says {self._sensor.axis(axis)}. Correct it "
                    "there, or take the six positions in the order that is asked for."
                )
                return False
        return True

    @staticmethod
    def _leaning(seen: dict[str, Axes], zero: Axes, gains: Axes) -> str | None:
        """The position that leaned most, if it leaned too much."""
        leans = {
            name: max(
                abs((seen[name][other] - zero[other]) / gains[other])
                for other in range(3)
                if other != axis
            )
            for name, axis, _ in POSITIONS
        }
        worst = max(leans, key=lambda name: leans[name])
        return worst if leans[worst] > _LEAN else None

    def _level(self) -> AxesCalibration | None:
        quarters = [
            self._measure(f"level, {quarter} of {QUARTERS}, a quarter turn after each")
            for quarter in range(1, QUARTERS + 1)
        ]
        gains = self._sensor.per_g
        mean = [sum(axis) / QUARTERS for axis in zip(*quarters, strict=True)]
        zero = (mean[0], mean[1], mean[2] - gains[2])
        shifts = zip(zero, self._sensor.zero, gains, strict=True)
        if any(abs((new - old) / gain) > 0.5 for new, old, gain in shifts):
            self._dialogue.say(
                "That would shift a zero by more than 0.5 g: the robot is not level, or an axis "
                "points the other way. Take the six positions."
            )
            return None
        return AxesCalibration(unit=self._sensor.unit, zero=zero, per_g=gains)

    def _measure(self, position: str) -> Axes:
        """What the three axes read, once the robot is still."""
        self._dialogue.choose(f"{position}, hold it still, then Enter", "")
        return self._dialogue.attempt(self._rest)

    def _rest(self) -> Axes:
        samples = []
        for _ in range(SAMPLES):
            samples.append(self._driver.raw())
            self._driver.check()
            self._clock.sleep(1.0 / self._rate)
        axes = [spread(axis) for axis in zip(*samples, strict=True)]
        if max(one.deviation for one in axes) > _MOVING:
            raise DeviceDataError("The robot was not still.", "Put it against something solid.")
        return tuple(one.mean for one in axes)
