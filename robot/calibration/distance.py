"""The distance sensor: what it reads with the belly on the ground, and at one known height.

Such a sensor differs by more from one placement to the next than within one, so samples of one
placement are not enough: the robot is put down again and again, as often as its announced noise
makes it worth.
"""

from __future__ import annotations

import math
from typing import Final

from robot.calibration.questions import Questions
from robot.configuration.calibration_file import RulerCalibration
from robot.drivers.sensors.contracts import DistanceSensor
from robot.errors import DeviceDataError
from robot.sensing.samples import Spread, sample_distance, spread
from robot.sensing.sensors import BellySensor

SAMPLES: Final = 10
AIM: Final = 0.25e-3  # m: how well the mean of all placements shall be known
PLACEMENTS: Final = (3, 25)
SCALES: Final = (0.7, 1.4)  # beyond these somebody erred


class DistanceSession:
    """Leads through the distance sensor.

    Args:
        sensor: What was believed so far.
        finder: The sensor.
        noise: Its error from one placement to the next, m rms.
        dialogue: With whom.
    """

    def __init__(
        self, sensor: BellySensor, finder: DistanceSensor, *, noise: float, dialogue: Questions
    ):
        self._sensor = sensor
        self._finder = finder
        self._dialogue = dialogue
        self.placements = min(max(math.ceil((noise / AIM) ** 2), PLACEMENTS[0]), PLACEMENTS[1])

    def run(self) -> RulerCalibration | None:
        """The calibration, or ``None`` if it was skipped.

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
        for what, means in (("ground", ground), ("plate", raised)):
            deviation = 1000 * means.deviation
            self._dialogue.say(
                f"{what}: {1000 * means.mean:.1f} mm, {deviation:.1f} mm rms from placement to "
                f"placement, known to {deviation / math.sqrt(means.count):.2f} mm"
            )
        return RulerCalibration(zero=ground.mean, scale=height / rise)

    def _placements(self, what: str) -> Spread:
        means: list[float] = []
        while len(means) < self.placements:
            prompt = f"{what}, {len(means) + 1} of {self.placements}: Enter"
            if self._dialogue.choose(prompt, "", "done") and len(means) >= PLACEMENTS[0]:
                break
            means.append(self._dialogue.attempt(self._measure))
        return spread(means)

    def _measure(self) -> float:
        distances = sample_distance(self._finder, count=SAMPLES)
        if distances is None:
            raise DeviceDataError(
                "The distance sensor sees no target.",
                "Use a light, dull surface, and look that nothing covers the sensor.",
            )
        return distances.mean
