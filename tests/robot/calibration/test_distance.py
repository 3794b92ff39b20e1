"""The distance sensor: zero and scale out of many placements."""

from __future__ import annotations

import random

import pytest

from robot.calibration.distance import DistanceSession
from robot.calibration.questions import Questions
from robot.configuration.calibration_file import RulerCalibration
from robot.errors import AbandonedError
from robot.sensing.sensors import BellySensor
from tests.robot.calibration.desk import Answer, Script

BELIEVED = BellySensor(zero=0.010, reach=0.2)


class Ruler:
    """Reads whole millimetres, with its own zero and scale, and an error at each placement."""

    name = "ruler"

    def __init__(self, rms: float = 1.0):
        self.rms = rms
        self.height: float | None = None
        self.offset = 0.0
        self._random = random.Random(3)

    def put(self, height: float | None) -> None:
        self.height = height
        self.offset = self._random.gauss(0, self.rms)

    def start(self) -> None:
        """It is there."""

    def check(self) -> None:
        """It works."""

    def close(self) -> None:
        """There is no link."""

    def distance(self) -> float | None:
        if self.height is None:
            return None
        return round(14.2 + self.height / 0.97 + self.offset + self._random.gauss(0, 0.3)) / 1000


def run(ruler: Ruler, script: Script, noise: float = 1e-3) -> RulerCalibration | None:
    dialogue = Questions(script)
    return DistanceSession(BELIEVED, ruler, noise=noise, dialogue=dialogue).run()


def placed(ruler: Ruler, height: float, times: int) -> list[Answer]:
    return [(lambda: ruler.put(height), "")] * times


def test_many_placements_find_zero_and_scale() -> None:
    ruler = Ruler()
    script = Script("", *placed(ruler, 0, 16), "150", *placed(ruler, 150, 16))
    calibration = run(ruler, script)
    assert script.left == 0
    assert calibration is not None
    sensor = BellySensor(zero=calibration.zero, scale=calibration.scale, reach=0.2)
    for height in (0, 75, 150):  # four standard errors
        assert sensor.clearance((14.2 + height / 0.97) / 1000) == pytest.approx(
            height / 1000, abs=1e-3
        )


@pytest.mark.parametrize(("noise", "placements"), [(0.1e-3, 3), (1e-3, 16), (1.0, 25)])
def test_a_noisier_sensor_is_placed_more_often(noise: float, placements: int) -> None:
    dialogue = Questions(Script())
    session = DistanceSession(BELIEVED, Ruler(), noise=noise, dialogue=dialogue)
    assert session.placements == placements


def test_three_placements_are_the_least() -> None:
    ruler = Ruler(rms=0.1)
    script = Script(
        "", *placed(ruler, 0, 2), "done", *placed(ruler, 0, 1), "done",
        "100", *placed(ruler, 100, 4), "done",
    )  # fmt: skip
    calibration = run(ruler, script)
    assert script.left == 0
    assert calibration is not None
    assert calibration.scale == pytest.approx(0.97, abs=0.01)


def test_a_plate_at_another_height_than_said_is_noticed() -> None:
    ruler = Ruler()
    script = Script(
        "", *placed(ruler, 0, 3), "done", "100", *placed(ruler, 30, 3), "done",
        "100", *placed(ruler, 100, 3), "done",
    )  # fmt: skip
    assert run(ruler, script) is not None
    assert script.heard("Measure from the belly")


def test_a_sensor_without_a_target_is_asked_again() -> None:
    ruler = Ruler()
    script = Script("", (lambda: ruler.put(None), ""), (lambda: ruler.put(0), ""))
    with pytest.raises(AbandonedError):
        run(ruler, script)
    assert script.heard("no target")


def test_it_can_be_skipped() -> None:
    assert run(Ruler(), Script("skip")) is None
