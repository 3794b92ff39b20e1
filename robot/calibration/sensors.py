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
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Final, Protocol

from robot.calibration.questions import Questions, number
from robot.configuration.calibration_file import (
    AxesCalibration,
    DistanceCalibration,
    GaugeCalibration,
)
from robot.drivers.sensors.contracts import CalibratedAxes, DistanceSensor
from robot.errors import DeviceDataError
from robot.host.clock import Clock
from robot.sensing.samples import Spread, spread
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


def calibrate_accelerometer(
    sensor: CalibratedAxes, sample: Callable[[], Axes], dialogue: Questions
) -> AxesCalibration | None:
    """Leads through the accelerometer; returns its calibration, or ``None`` if it was skipped.

    Args:
        sensor: Axes of the accelerometer, with their calibration so far.
        sample: Returns what the axes read at rest, as ``sample_at_rest`` does.
        dialogue: Dialogue with the person.

    Raises:
        AbandonedError: Somebody left.
    """

    def measure(position: str) -> Axes:
        dialogue.choose(f"{position}, hold it still, then Enter", "")
        return dialogue.attempt(sample)

    dialogue.say(
        "\nAccelerometer\n"
        "  six    hold the robot still in six positions, each axis up and down: zero and gain\n"
        "  level  put it on a level surface: the zeros alone, with the gains that are set"
    )
    while True:
        choice = dialogue.choose("accelerometer: six, level or skip", "six", "level", "skip")
        if choice == "skip":
            return None
        lead = _six if choice == "six" else _level
        calibration = lead(sensor, measure, dialogue.say)
        if calibration is not None:
            return calibration


def sample_at_rest(driver: RawAxes, *, rate: float, clock: Clock) -> Axes:
    """Mean of some samples of the axes, at ``rate`` per second.

    Raises:
        DeviceError: The device failed, or the robot was not still.
    """
    samples = []
    for _ in range(SAMPLES):
        samples.append(driver.raw())
        driver.check()
        clock.sleep(1.0 / rate)
    axes = [spread(axis) for axis in zip(*samples, strict=True)]
    if max(component.deviation for component in axes) > _MAX_REST_DEVIATION:
        raise DeviceDataError("The robot was not still.", "Put it against something solid.")
    return tuple(component.mean for component in axes)


def _six(
    sensor: CalibratedAxes, measure: Callable[[str], Axes], say: Callable[[str], None]
) -> AxesCalibration | None:
    seen = {name: measure(name) for name, _, _ in POSITIONS}
    while True:
        pairs = [
            tuple(seen[name] for name, axis, _ in POSITIONS if axis == turned_axis)
            for turned_axis in range(3)
        ]
        swings = [tuple((up - down) / 2 for up, down in zip(*pair, strict=True)) for pair in pairs]
        if not _channels_match(sensor, swings, say):
            return None
        zero = tuple((pair[0][axis] + pair[1][axis]) / 2 for axis, pair in enumerate(pairs))
        gains = tuple(swing[axis] for axis, swing in enumerate(swings))
        position = _leaning_position(seen, zero, gains)
        if position is None:
            return AxesCalibration(
                wiring=sensor.wiring,
                unit=sensor.unit,
                zero=zero,
                per_g=gains,
                uncertainty=Uncertainty(gain=_gain_error(seen.values(), zero, gains)),
            )
        say(f"It leaned too much in the position '{position}': that once more.")
        seen[position] = measure(position)


def _channels_match(
    sensor: CalibratedAxes, swings: Sequence[Axes], say: Callable[[str], None]
) -> bool:
    """Whether each axis answers on its own channel."""
    for axis, swing in enumerate(swings):
        sizes = [abs(value) for value in swing]
        strongest = sizes.index(max(sizes))
        if sizes[strongest] < _MIN_GAIN:
            say(
                f"Nothing saw the {'xyz'[axis]} axis turn over ({sizes[strongest] * 1000:.0f} "
                f"m{sensor.unit} a g). Check the sensor's supply and wires, and that you did turn "
                "the robot."
            )
            return False
        if strongest != axis:
            say(
                f"The {'xyz'[axis]} axis answers on {sensor.axis(strongest)}, and {sensor.key} in "
                f"robot.toml says {sensor.axis(axis)}. Correct it there, or take the six positions "
                "in the order that is asked for."
            )
            return False
    return True


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


def _level(
    sensor: CalibratedAxes, measure: Callable[[str], Axes], say: Callable[[str], None]
) -> AxesCalibration | None:
    quarters = [
        measure(f"level, {quarter} of {QUARTERS}, a quarter turn after each")
        for quarter in range(1, QUARTERS + 1)
    ]
    gains = sensor.per_g
    mean = [sum(axis) / QUARTERS for axis in zip(*quarters, strict=True)]
    zero = (mean[0], mean[1], mean[2] - gains[2])
    shifts = zip(zero, sensor.zero, gains, strict=True)
    if any(abs((new - old) / gain) > 0.5 for new, old, gain in shifts):
        say(
            "That would shift a zero by more than 0.5 g: the robot is not level, or an axis points "
            "the other way. Take the six positions."
        )
        return None
    return AxesCalibration(
        wiring=sensor.wiring,
        unit=sensor.unit,
        zero=zero,
        per_g=gains,
        uncertainty=replace(sensor.uncertainty, zero=_level_error(quarters, gains)),
    )


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


def calibrate_gauge(
    point: TouchPoint, channel: int, sample: Callable[[], Spread], dialogue: Questions
) -> GaugeCalibration | None:
    """Leads through one gauge; returns its calibration, or ``None`` if it was skipped.

    Args:
        point: The part that carries it, and its thresholds so far.
        channel: Analogue input of the gauge.
        sample: Returns statistics of the volts at that input.
        dialogue: Dialogue with the person.

    Raises:
        AbandonedError: Somebody left.
    """

    def sample_loaded() -> tuple[float, Spread]:
        return _load(point.name, dialogue), sample()

    if dialogue.choose(f"{point.name} free of any load: Enter or skip", "", "skip"):
        return None
    free = dialogue.attempt(sample)
    while True:
        load, loaded = dialogue.attempt(sample_loaded)
        change = loaded.mean - free.mean
        if abs(change) > max(_MIN_CHANGE, _CLEAR_OF_NOISE * free.deviation):
            break
        dialogue.say(
            f"{load:g} N changed it by {change * 1000:.1f} mV only, with "
            f"{free.deviation * 1000:.1f} mV of noise. Is the load on this foot, and is channel "
            f"{channel} this gauge's? Load it again, or leave with q."
        )
    gain = change / load
    on, off = _thresholds(point, free.deviation / abs(gain), dialogue.say)
    return GaugeCalibration(channel=channel, tare=free.mean, volts_per_newton=gain, on=on, off=off)


def _load(name: str, dialogue: Questions) -> float:
    """The known load on a foot, N."""
    while True:
        answer = dialogue.ask(f"{name} with a known load: newtons, or grams as in '100 g'")
        value = number(answer.removesuffix("g"))
        if value is not None:
            load = value * GRAVITY / 1000 if answer.endswith("g") else value
            if LOADS[0] <= load <= LOADS[1]:
                dialogue.say(f"{load:g} N ({1000 * load / GRAVITY:.0f} g)")
                return load
        dialogue.say(
            f"Answer a load from {LOADS[0]:g} to {LOADS[1]:g} N, grams with their unit as in "
            "'100 g', or q to leave."
        )


def _thresholds(point: TouchPoint, noise: float, say: Callable[[str], None]) -> tuple[float, float]:
    """The thresholds on and off that are set, N, unless the noise would cross them."""
    on = point.on
    if on < _ON_SIGMAS * noise:
        on = math.ceil(_ON_SIGMAS * noise * 100) / 100
        say(
            f"The free foot reads {noise:.3f} N of noise, so it touches above {on:g} N instead of "
            f"{point.on:g} N."
        )
    return on, on * (point.off / point.on if point.on else 0.5)


DISTANCE_SAMPLES: Final = 10  # of one placement
AIM: Final = 0.25e-3  # m: how well the mean of all placements shall be known
PLACEMENTS: Final = (3, 25)  # at least, and at most
SCALES: Final = (0.7, 1.4)  # beyond these somebody erred
_ROUNDING: Final = 1e-3 / math.sqrt(12)  # m: sensors tell whole millimetres
_RULER_ERROR: Final = 0.5e-3  # m: how well a person measures a height


def calibrate_distance(
    sensor: BellySensor, finder: DistanceSensor, noise: float, dialogue: Questions
) -> DistanceCalibration | None:
    """Leads through the distance sensor; returns its calibration, or ``None`` if it was skipped.

    Args:
        sensor: Calibration of the sensor so far.
        finder: Driver of the sensor.
        noise: Error of the sensor from one placement to the next, m rms.
        dialogue: Dialogue with the person.

    Raises:
        AbandonedError: Somebody left.
    """

    def known_to(means: Spread) -> float:
        """Error of the mean, m; of few placements, which may agree by chance, as is announced."""
        return math.hypot(_ROUNDING, max(means.deviation, noise) / math.sqrt(means.count))

    count = placements(noise)
    dialogue.say(
        "\nDistance sensor\n"
        f"  First its zero, then one known height, {count} placements each: lift "
        "the robot, or\n  the plate, and put it back every time. 'done' after three is enough "
        "if they agree."
    )
    if dialogue.choose("distance: Enter or skip", "", "skip"):
        return None
    ground = _place(finder, count, "belly flat on the ground", dialogue)
    while True:
        height = dialogue.number(
            "height of a plate below the belly, mm; best the highest that you expect",
            10,
            1000 * sensor.reach,
        )
        raised = _place(finder, count, f"plate at {height:g} mm", dialogue)
        rise = 1000 * (raised.mean - ground.mean)
        if rise > 0 and SCALES[0] <= height / rise <= SCALES[1]:
            break
        dialogue.say(
            f"The plate is {height:g} mm away, and the sensor reads {rise:.1f} mm more than "
            "on the ground. Measure from the belly, not from the sensor, and try again."
        )
    for surface, means in (("ground", ground), ("plate", raised)):
        dialogue.say(
            f"{surface}: {1000 * means.mean:.1f} mm, {1000 * means.deviation:.1f} mm rms from "
            f"placement to placement, known to {1000 * known_to(means):.2f} mm"
        )
    rise_error = math.hypot(known_to(ground), known_to(raised))
    return DistanceCalibration(
        zero=ground.mean,
        scale=height / rise,
        uncertainty=Uncertainty(
            zero=known_to(ground),
            gain=math.hypot(1000 * rise_error / rise, 1000 * _RULER_ERROR / height),
        ),
    )


def placements(noise: float) -> int:
    """Number of placements, by the error from one to the next, m rms."""
    return min(max(math.ceil((noise / AIM) ** 2), PLACEMENTS[0]), PLACEMENTS[1])


def _place(finder: DistanceSensor, count: int, what: str, dialogue: Questions) -> Spread:
    means: list[float] = []
    while len(means) < count:
        prompt = f"{what}, {len(means) + 1} of {count}: Enter"
        if dialogue.choose(prompt, "", "done") and len(means) >= PLACEMENTS[0]:
            break
        means.append(dialogue.attempt(partial(_measure, finder)))
    return spread(means)


def _measure(finder: DistanceSensor) -> float:
    """Mean of the measurements of one placement that saw a target, m."""
    measured = [finder.distance() for _ in range(DISTANCE_SAMPLES)]
    distances = [distance for distance in measured if distance is not None]
    if 2 * len(distances) < DISTANCE_SAMPLES:
        raise DeviceDataError(
            "The distance sensor sees no target.",
            "Use a light, dull surface, and look that nothing covers the sensor.",
        )
    return spread(distances).mean
