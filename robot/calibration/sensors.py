"""Sensors: an accelerometer by gravity, a strain gauge by a load, a distance sensor by a height.

With an axis straight up and straight down an accelerometer reads +1 g and −1 g, which gives its
zero and its gain; a placement that leans by a few degrees hardly matters, because gravity along an
axis changes with the cosine. Level only finds the zeros, believing the gains, and a lean matters in
full: so the robot is turned a quarter at a time.

A distance sensor differs by more from one placement to the next than within one, so samples of one
placement are not enough: the robot is put down again and again, as often as its announced noise
makes it worth.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final, Protocol

from robot.calibration.questions import Questions, number
from robot.configuration.calibration_file import (
    AxesCalibration,
    DistanceCalibration,
    GaugeCalibration,
)
from robot.drivers.links.analogue_inputs import AnalogueInputs
from robot.drivers.sensors.contracts import CalibratedAxes, DistanceSensor
from robot.errors import DeviceDataError
from robot.host.clock import Clock
from robot.sensing.samples import Spread, sample_channel, sample_distance, spread
from robot.sensing.sensors import BellySensor, TouchPoint
from robot.uncertainty import Uncertainty

POSITIONS: Final = (
    ("nose up", 0, 1),
    ("nose down", 0, -1),
    ("left side up", 1, 1),
    ("left side down", 1, -1),
    ("upright", 2, 1),
    ("upside down", 2, -1),
)
QUARTERS: Final = 4
SAMPLES: Final = 100  # their mean has a tenth of the noise
_MAX_REST_DEVIATION: Final = 0.02  # V or g rms: far above the noise of any such sensor
_NONLINEARITY: Final = 0.005  # of the gain: the MPU-6050's nonlinearity by its data sheet
_SEAT_ERROR: Final = math.radians(0.1)  # how a main body lies: 0.25 mm of unevenness below 140 mm
_MAX_LEAN: Final = math.sin(math.radians(8))  # a placement that leans by more costs 1 % of the gain
_MIN_GAIN: Final = 0.05  # V or g per g: far below any sensor's, so the axis did not turn over

Axes = tuple[float, ...]


class RawAxes(Protocol):
    """A driver of three axes that are to be calibrated."""

    def raw(self) -> Sequence[float]:
        """One sample of the axes, in their unit.

        Raises:
            DeviceError: The device failed.
        """

    def check(self) -> None:
        """Does what ``SensorDriver.check`` does."""


@dataclass(frozen=True, kw_only=True)
class AccelerometerSession:
    """Leads through the accelerometer.

    Attributes:
        sensor: Axes of the accelerometer, with their calibration so far.
        driver: Driver that reads the axes.
        rate: Samples per second.
        clock: The robot clock.
        dialogue: Dialogue with the person.
    """

    sensor: CalibratedAxes
    driver: RawAxes
    rate: float
    clock: Clock
    dialogue: Questions

    def run(self) -> AxesCalibration | None:
        """Returns the calibration, or ``None`` if it was skipped.

        Raises:
            AbandonedError: Somebody left.
        """
        self.dialogue.say(
            "\nAccelerometer\n"
            "  six    hold the robot still in six positions, each axis up and down: zero and gain\n"
            "  level  put it on a level surface: the zeros alone, with the gains that are set"
        )
        while True:
            choice = self.dialogue.choose(
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
                tuple(seen[name] for name, axis, _ in POSITIONS if axis == turned_axis)
                for turned_axis in range(3)
            ]
            swings = [
                tuple((up - down) / 2 for up, down in zip(*pair, strict=True)) for pair in pairs
            ]
            if not self._channels_match(swings):
                return None
            zero = tuple((pair[0][axis] + pair[1][axis]) / 2 for axis, pair in enumerate(pairs))
            gains = tuple(swing[axis] for axis, swing in enumerate(swings))
            position = self._leaning_position(seen, zero, gains)
            if position is None:
                return AxesCalibration(
                    wiring=self.sensor.wiring,
                    unit=self.sensor.unit,
                    zero=zero,
                    per_g=gains,
                    uncertainty=Uncertainty(gain=_gain_error(seen.values(), zero, gains)),
                )
            self.dialogue.say(f"It leaned too much in the position '{position}': that once more.")
            seen[position] = self._measure(position)

    def _channels_match(self, swings: Sequence[Axes]) -> bool:
        """Whether each axis answers on its own channel."""
        for axis, swing in enumerate(swings):
            sizes = [abs(value) for value in swing]
            strongest = sizes.index(max(sizes))
            if sizes[strongest] < _MIN_GAIN:
                self.dialogue.say(
                    f"Nothing saw the {'xyz'[axis]} axis turn over ({sizes[strongest] * 1000:.0f} "
                    f"m{self.sensor.unit} a g). Check the sensor's supply and wires, and that you "
                    "did turn the robot."
                )
                return False
            if strongest != axis:
                self.dialogue.say(
                    f"The {'xyz'[axis]} axis answers on {self.sensor.axis(strongest)}, and "
                    f"{self.sensor.key} in robot.toml says {self.sensor.axis(axis)}. Correct it "
                    "there, or take the six positions in the order that is asked for."
                )
                return False
        return True

    @staticmethod
    def _leaning_position(seen: dict[str, Axes], zero: Axes, gains: Axes) -> str | None:
        """The position that leaned most, if it leaned too much."""
        leans = {
            name: max(
                abs((seen[name][other_axis] - zero[other_axis]) / gains[other_axis])
                for other_axis in range(3)
                if other_axis != axis
            )
            for name, axis, _ in POSITIONS
        }
        worst_position = max(leans, key=lambda name: leans[name])
        return worst_position if leans[worst_position] > _MAX_LEAN else None

    def _level(self) -> AxesCalibration | None:
        quarters = [
            self._measure(f"level, {quarter} of {QUARTERS}, a quarter turn after each")
            for quarter in range(1, QUARTERS + 1)
        ]
        gains = self.sensor.per_g
        mean = [sum(axis) / QUARTERS for axis in zip(*quarters, strict=True)]
        zero = (mean[0], mean[1], mean[2] - gains[2])
        shifts = zip(zero, self.sensor.zero, gains, strict=True)
        if any(abs((new - old) / gain) > 0.5 for new, old, gain in shifts):
            self.dialogue.say(
                "That would shift a zero by more than 0.5 g: the robot is not level, or an axis "
                "points the other way. Take the six positions."
            )
            return None
        return AxesCalibration(
            wiring=self.sensor.wiring,
            unit=self.sensor.unit,
            zero=zero,
            per_g=gains,
            uncertainty=replace(self.sensor.uncertainty, zero=_level_error(quarters, gains)),
        )

    def _measure(self, position: str) -> Axes:
        """What the three axes read, once the robot is still."""
        self.dialogue.choose(f"{position}, hold it still, then Enter", "")
        return self.dialogue.attempt(self._sample_at_rest)

    def _sample_at_rest(self) -> Axes:
        samples = []
        for _ in range(SAMPLES):
            samples.append(self.driver.raw())
            self.driver.check()
            self.clock.sleep(1.0 / self.rate)
        axes = [spread(axis) for axis in zip(*samples, strict=True)]
        if max(component.deviation for component in axes) > _MAX_REST_DEVIATION:
            raise DeviceDataError("The robot was not still.", "Put it against something solid.")
        return tuple(component.mean for component in axes)


def _gain_error(seen: Iterable[Axes], zero: Axes, gains: Axes) -> float:
    """Uncertainty of the gains, as a fraction: in each position gravity should come out as 1 g.

    Axes that lean feel less of gravity, by as much as all three together then feel too much. A
    board that sits askew on the main body does not show: the zeros are the axes', not the body's.
    """
    lengths = [
        math.hypot(*((x - x0) / gain for x, x0, gain in zip(axes, zero, gains, strict=True)))
        for axes in seen
    ]
    rms = math.sqrt(sum((length - 1.0) ** 2 for length in lengths) / len(lengths))
    return math.hypot(_NONLINEARITY, rms)


def _level_error(quarters: Sequence[Axes], gains: Axes) -> float:
    """Uncertainty of what is level, rad.

    Opposite quarters cancel how the table leans, so both pairs should find the same zeros. Two axes
    are two degrees of freedom.
    """
    first, second, third, fourth = quarters
    differences = [
        (first[axis] + third[axis] - second[axis] - fourth[axis]) / (2 * gains[axis])
        for axis in (0, 1)
    ]
    return math.hypot(_SEAT_ERROR, math.hypot(*differences) / math.sqrt(8))


GRAVITY: Final = 9.81
LOADS: Final = (0.05, 50.0)  # N: 5 g to 5 kg; beyond, somebody typed another unit
_CLEAR_OF_NOISE: Final = 10.0  # a load must exceed the noise this many times
_ON_SIGMAS: Final = 6.0  # times the noise: with such a threshold, a free foot never seems to touch
_MIN_CHANGE: Final = 2e-3  # V; six codes of 16 bits at ±10 V


@dataclass(frozen=True, kw_only=True)
class GaugeSession:
    """Leads through one gauge.

    Attributes:
        point: The part that carries it, and its thresholds so far.
        channel: Analogue input of the gauge.
        inputs: Analogue inputs of its board.
        rate: Samples per second.
        clock: The robot clock.
        dialogue: Dialogue with the person.
    """

    point: TouchPoint
    channel: int
    inputs: AnalogueInputs
    rate: float
    clock: Clock
    dialogue: Questions

    def run(self) -> GaugeCalibration | None:
        """Returns the calibration, or ``None`` if it was skipped.

        Raises:
            AbandonedError: Somebody left.
        """
        name = self.point.name
        if self.dialogue.choose(f"{name} free of any load: Enter or skip", "", "skip"):
            return None
        free = self.dialogue.attempt(self._sample)
        while True:
            load, loaded = self.dialogue.attempt(self._loaded)
            change = loaded.mean - free.mean
            if abs(change) > max(_MIN_CHANGE, _CLEAR_OF_NOISE * free.deviation):
                break
            self.dialogue.say(
                f"{load:g} N changed it by {change * 1000:.1f} mV only, with "
                f"{free.deviation * 1000:.1f} mV of noise. Is the load on this foot, and is "
                f"channel {self.channel} this gauge's? Load it again, or leave with q."
            )
        gain = change / load
        return self._thresholds(free, gain)

    def _thresholds(self, free: Spread, gain: float) -> GaugeCalibration:
        """Keeps the thresholds that are set, unless the noise would cross them."""
        noise = free.deviation / abs(gain)
        on = self.point.on
        if on < _ON_SIGMAS * noise:
            on = math.ceil(_ON_SIGMAS * noise * 100) / 100
            self.dialogue.say(
                f"The free foot reads {noise:.3f} N of noise, so it touches above {on:g} N "
                f"instead of {self.point.on:g} N."
            )
        share = self.point.off / self.point.on if self.point.on else 0.5
        return GaugeCalibration(
            channel=self.channel, tare=free.mean, volts_per_newton=gain, on=on, off=on * share
        )

    def _load(self) -> float:
        prompt = f"{self.point.name} with a known load: newtons, or grams as in '100 g'"
        while True:
            answer = self.dialogue.ask(prompt)
            value = number(answer.removesuffix("g"))
            if value is not None:
                load = value * GRAVITY / 1000 if answer.endswith("g") else value
                if LOADS[0] <= load <= LOADS[1]:
                    self.dialogue.say(f"{load:g} N ({1000 * load / GRAVITY:.0f} g)")
                    return load
            self.dialogue.say(
                f"Answer a load from {LOADS[0]:g} to {LOADS[1]:g} N, grams with their unit as in "
                "'100 g', or q to leave."
            )

    def _loaded(self) -> tuple[float, Spread]:
        return self._load(), self._sample()

    def _sample(self) -> Spread:
        return sample_channel(
            self.inputs, self.channel, count=SAMPLES, rate=self.rate, clock=self.clock
        )


DISTANCE_SAMPLES: Final = 10  # of one placement
AIM: Final = 0.25e-3  # m: how well the mean of all placements shall be known
PLACEMENTS: Final = (3, 25)  # at least, and at most
SCALES: Final = (0.7, 1.4)  # beyond these somebody erred
_ROUNDING: Final = 1e-3 / math.sqrt(12)  # m: sensors tell whole millimetres
_RULER_ERROR: Final = 0.5e-3  # m: how well a person measures a height


class DistanceSession:
    """Leads through the distance sensor.

    Args:
        sensor: Calibration of the sensor so far.
        finder: Driver of the sensor.
        noise: Error of the sensor from one placement to the next, m rms.
        dialogue: Dialogue with the person.
    """

    def __init__(
        self, sensor: BellySensor, finder: DistanceSensor, *, noise: float, dialogue: Questions
    ):
        self._sensor = sensor
        self._finder = finder
        self._noise = noise
        self._dialogue = dialogue
        self.placements = min(max(math.ceil((noise / AIM) ** 2), PLACEMENTS[0]), PLACEMENTS[1])

    def run(self) -> DistanceCalibration | None:
        """Returns the calibration, or ``None`` if it was skipped.

        Raises:
            AbandonedError: Somebody left.
        """
        self._dialogue.say(
            "\nDistance sensor\n"
            f"  First its zero, then one known height, {self.placements} placements each: lift "
            "the robot, or\n  the plate, and put it back every time. 'done' after three is enough "
            "if they agree."
        )
        if self._dialogue.choose("distance: Enter or skip", "", "skip"):
            return None
        ground = self._placements("belly flat on the ground")
        while True:
            height = self._dialogue.number(
                "height of a plate below the belly, mm; best the highest that you expect",
                10,
                1000 * self._sensor.reach,
            )
            raised = self._placements(f"plate at {height:g} mm")
            rise = 1000 * (raised.mean - ground.mean)
            if rise > 0 and SCALES[0] <= height / rise <= SCALES[1]:
                break
            self._dialogue.say(
                f"The plate is {height:g} mm away, and the sensor reads {rise:.1f} mm more than "
                "on the ground. Measure from the belly, not from the sensor, and try again."
            )
        for surface, means in (("ground", ground), ("plate", raised)):
            deviation = 1000 * means.deviation
            self._dialogue.say(
                f"{surface}: {1000 * means.mean:.1f} mm, {deviation:.1f} mm rms from placement to "
                f"placement, known to {1000 * self._known_to(means):.2f} mm"
            )
        rise_error = math.hypot(self._known_to(ground), self._known_to(raised))
        return DistanceCalibration(
            zero=ground.mean,
            scale=height / rise,
            uncertainty=Uncertainty(
                zero=self._known_to(ground),
                gain=math.hypot(1000 * rise_error / rise, 1000 * _RULER_ERROR / height),
            ),
        )

    def _known_to(self, means: Spread) -> float:
        """Error of the mean, m; of few placements, which may agree by chance, as is announced."""
        return math.hypot(_ROUNDING, max(means.deviation, self._noise) / math.sqrt(means.count))

    def _placements(self, what: str) -> Spread:
        means: list[float] = []
        while len(means) < self.placements:
            prompt = f"{what}, {len(means) + 1} of {self.placements}: Enter"
            if self._dialogue.choose(prompt, "", "done") and len(means) >= PLACEMENTS[0]:
                break
            means.append(self._dialogue.attempt(self._measure))
        return spread(means)

    def _measure(self) -> float:
        distances = sample_distance(self._finder, count=DISTANCE_SAMPLES)
        if distances is None:
            raise DeviceDataError(
                "The distance sensor sees no target.",
                "Use a light, dull surface, and look that nothing covers the sensor.",
            )
        return distances.mean
