import math
import re
from dataclasses import replace

import pytest

from estimator.readings.observation import Observation
from estimator.readings.plausibility import AnswerChecks, implausible_body, impossible_reading
from protocol.wire.capabilities import Sensor
from tests.estimator.model_robot import make_capabilities

ROBOT = make_capabilities()
LEVEL = Observation(angles=(0.0,) * 4, touch=(True,) * 4, tilt=(0.0, 0.0), clearance=0.03)


def test_what_can_be_is_left_alone() -> None:
    assert implausible_body(ROBOT) is None
    assert impossible_reading(LEVEL, ROBOT) is None
    ends = LEVEL.model_copy(
        update={"angles": (1.0, -1.0, 1.005, 0.0), "tilt": (math.pi / 2, None), "clearance": 0.2}
    )
    assert impossible_reading(ends, ROBOT) is None
    nothing = Observation(angles=(0.0,) * 4, touch=(None,) * 4)
    assert impossible_reading(nothing, ROBOT) is None


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"tilt": (1e300, 0.0)}, "a tilt of 5.73e[+]301°, which must lie in -90° to 90°"),
        ({"tilt": (0.0, -1.6)}, "a tilt of -91.67°"),
        ({"clearance": 0.21}, "a clearance of 210 mm, which must lie in -20 to 200 mm"),
        ({"clearance": -0.021}, "a clearance of -21 mm"),
        ({"touch": (True,) * 3}, "3 touch bits of 4 touch sensors"),
        ({"touch": (True,) * 5}, "5 touch bits of 4 touch sensors"),
        ({"measured": (0.1, None, None, None)}, "a measured angle of joint left"),
        ({"angles": (0.0, 1.02, 0.0, 0.0)}, "an angle of 58.44° of joint front, which reaches"),
    ],
)
def test_what_cannot_be_read_is_named(changed: dict[str, object], sentence: str) -> None:
    complaint = impossible_reading(LEVEL.model_copy(update=changed), ROBOT)
    assert complaint is not None
    assert re.search(sentence, complaint)


def test_a_sensor_may_read_too_little_and_a_noisy_one_less() -> None:
    """Of robots as people build them one in forty was refused for a belly 5 mm below the ground."""
    noisy = Sensor(modality="clearance", unit="m", count=1, noise=0.002, rate=20.0, upper=0.2)
    robot = replace(ROBOT, sensors=(*ROBOT.sensors[:2], noisy))
    assert impossible_reading(LEVEL.model_copy(update={"clearance": -0.029}), robot) is None
    assert impossible_reading(LEVEL.model_copy(update={"clearance": -0.031}), robot) is not None


def test_touch_bits_of_a_robot_without_touch_sensors_are_impossible() -> None:
    robot = replace(ROBOT, sensors=ROBOT.sensors[1:])
    assert impossible_reading(LEVEL, robot) == "4 touch bits of 0 touch sensors"
    assert impossible_reading(LEVEL.model_copy(update={"touch": ()}), robot) is None


def test_a_robot_that_stands_on_the_same_legs_again_is_not_frozen() -> None:
    touch, *others = ROBOT.sensors
    checks = AnswerChecks(replace(ROBOT, sensors=(replace(touch, noise=0.02), *others)))
    for angle in (0.0, 0.1, 0.2, 0.3):
        program = (angle, 0.0, 0.0, 0.0)
        observation = LEVEL.model_copy(update={"angles": program, "tilt": (angle, 0.0)})
        assert checks.wrong(program, observation) is None


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"base_size": (140.0, 140.0, 85.0)}, "base_size holds 140 m"),
        ({"base_size": (1.4, 1.4, 0.85)}, "has a density of 0.18 kg/m³"),
        ({"base_size": (1.4, 1.4, 0.85), "base_radius": 0.7}, "has a density of 0.229 kg/m³"),
        ({"base_mass": 300.0}, "has a density of 5.1e[+]05 kg/m³"),
        ({"part_radii": (6.0, 13.0, 6.0, 13.0)}, "part_radii holds 13 m"),
        ({"sensors": (replace(ROBOT.sensors[2], upper=200.0),)}, "clearance reaches 200 m"),
    ],
)
def test_a_slip_of_the_unit_is_named(changed: dict[str, object], sentence: str) -> None:
    complaint = implausible_body(replace(ROBOT, **changed))  # type: ignore[arg-type]
    assert complaint is not None
    assert re.search(sentence, complaint)
