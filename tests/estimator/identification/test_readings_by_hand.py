import json
import math
import time
from dataclasses import replace
from pathlib import Path

import pytest

from estimator.errors import EstimatorError, ReadingsError
from estimator.identification.robot_link import RobotLink, open_robot
from estimator.readings.observation import Observation
from estimator.readings.readings_csv import write
from tests.estimator.model_robot import make_capabilities

TABLE = "angle_deg_a,angle_deg_b,touch_1,tilt_lr_deg,tilt_fb_deg,clearance_mm\n30,-10,1,5,-5,40\n"
ROBOT = {"base_size": [0.14, 0.14, 0.085], "base_mass": 0.6}


def opened(
    folder: Path, table: str = TABLE, robot: object = ROBOT, driven: tuple[int, ...] = (0, 1)
) -> RobotLink:
    (folder / "readings.csv").write_text(table)
    if robot is not None:
        text = robot if isinstance(robot, str) else json.dumps(robot)
        (folder / "robot.json").write_text(text)
    return open_robot(
        f"file:{folder}/readings.csv", driven=lambda _: driven, client_id="me", first_id=1
    )


def test_three_lines_by_hand_are_a_robot(tmp_path: Path) -> None:
    link = opened(tmp_path, robot={**ROBOT, "clearance_upper": 0.15})
    assert [joint.name for joint in link.capabilities.joints] == ["a", "b"]
    assert link.capabilities.base_size == (0.14, 0.14, 0.085)
    sensor = link.capabilities.sensor("clearance")
    assert sensor is not None
    assert sensor.upper == 0.15
    assert link.capabilities.part_radii is None
    assert link.recorded is not None
    (program,) = link.recorded
    observation = link.perform(0, program, link.ticket(), lambda phase, fraction: None)
    assert observation.angles == program == pytest.approx([math.radians(30), math.radians(-10)])
    assert observation.touch == (True,)
    assert observation.clearance == pytest.approx(0.04)


def test_a_round_robot_by_hand(tmp_path: Path) -> None:
    link = opened(tmp_path, robot={**ROBOT, "base_radius": 0.07})
    assert link.capabilities.base_radius == 0.07


def test_a_modality_without_a_column_is_a_sensor_that_the_robot_lacks(tmp_path: Path) -> None:
    link = opened(tmp_path, "angle_deg_a,touch_1\n30,1\n", driven=(0,))
    assert [sensor.modality for sensor in link.capabilities.sensors] == ["touch"]


def test_joints_that_are_not_driven_need_no_column(tmp_path: Path) -> None:
    joints = [
        {"name": name, "lower": -1.0, "upper": 1.0, "speed": 1.0, "resolution": 0.01}
        for name in ("b", "knee", "a")
    ]
    link = opened(tmp_path, robot={**ROBOT, "joints": joints}, driven=(0, 2))
    assert link.recorded is not None
    assert link.recorded[0] == pytest.approx([math.radians(-10), 0.0, math.radians(30)])


def test_a_joint_that_moved_and_is_not_driven_is_refused(tmp_path: Path) -> None:
    table = TABLE.replace("30,-10,", "30,-2.5,")
    assert opened(tmp_path, table, driven=(0,)).recorded  # measured a little off 0
    with pytest.raises(ReadingsError, match=r"interaction 1: b stands at -10°, and the problem do"):
        opened(tmp_path, driven=(0,))


def test_the_table_of_a_run_is_read_as_it_was_felt(tmp_path: Path) -> None:
    """A servo may stand past the end to which it was commanded; the ground may be out of range."""
    robot = make_capabilities()
    first, *others = robot.joints
    robot = replace(robot, joints=(replace(first, measured_noise=0.005), *others))
    felt = [
        Observation(
            angles=(1.0, -1.0, 0.5, 0.0),
            measured=(measured, None, None, None),
            touch=(True, True, False, None),
            tilt=(0.1, None),
            clearance=clearance,
            clearance_saturated=clearance == 0.2,
        )
        for measured, clearance in ((1.03, 0.2), (1.3, 0.199), (1.0, None))
    ]
    table = tmp_path / "felt.csv"
    write(table, [joint.name for joint in robot.joints], felt)
    link = opened(tmp_path, table.read_text(), robot.to_map(), driven=(0, 1, 2))
    for number, wanted in enumerate(felt):
        got = link.perform(number, wanted.angles, None, lambda phase, fraction: None)
        assert got.taken == pytest.approx(wanted.taken, abs=1e-5)
        assert got.angles == pytest.approx(wanted.angles, abs=1e-5)
        assert got.clearance == wanted.clearance
        assert got.clearance_saturated == wanted.clearance_saturated


@pytest.mark.parametrize(
    ("robot", "driven", "sentence"),
    [
        (None, (0,), "says nothing about the main body.*base_size"),
        ("{", (0,), "robot.json is no JSON file"),
        ([1], (0,), "must hold an object"),
        ({"base_size": [1, 2, 3]}, (0,), "lacks base_mass"),
        ({**ROBOT, "base_mass": -1}, (0,), "'base_mass' must be at least"),
        ({**ROBOT, "base_radius": 0.1}, (0,), "of a round main body must begin with its width"),
        ({**ROBOT, "base_size": [0.1, 0.1]}, (0,), "'base_size' must have 3 items"),
    ],
)
def test_a_wrong_robot_file_is_refused(
    tmp_path: Path, robot: object, driven: tuple[int, ...], sentence: str
) -> None:
    with pytest.raises(ReadingsError, match=sentence):
        opened(tmp_path, robot=robot, driven=driven)


def named(*names: str) -> dict[str, object]:
    joint = {"lower": -1.0, "upper": 1.0, "speed": 1.0, "resolution": 0.01}
    return {**ROBOT, "joints": [{"name": name, **joint} for name in names]}


def test_a_column_of_an_unknown_joint_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadingsError, match=r"no joint b; .*names a, c"):
        opened(tmp_path, robot=named("a", "c"))


def test_a_driven_joint_needs_its_column(tmp_path: Path) -> None:
    with pytest.raises(ReadingsError, match="drives c, so write the columns angle_deg_c"):
        opened(tmp_path, robot=named("a", "b", "c"), driven=(0, 1, 2))


def test_a_table_of_impossible_readings_is_refused_by_row(tmp_path: Path) -> None:
    table = TABLE + "30,-10,1,5,-5,240\n"
    with pytest.raises(ReadingsError, match="row 2: says a clearance of 240 mm"):
        opened(tmp_path, table)
    assert opened(tmp_path, table, {**ROBOT, "clearance_upper": 0.3}).recorded


def test_a_main_body_in_millimetres_is_refused(tmp_path: Path) -> None:
    with pytest.raises(EstimatorError, match=r"base_size holds 140 m, .*Write metres"):
        opened(tmp_path, robot={"base_size": [140, 140, 85], "base_mass": 0.6})


@pytest.mark.parametrize(
    ("robot", "sentence"),
    [
        ("[" * 100_000, "is no JSON file"),
        ('{"base_size": [1, 1, 1], "base_mass": 1' + "0" * 400 + "}", "that a float can hold"),
        ('{"base_size": [1, 1, 1], "base_mass": 1' + "0" * 5000 + "}", "is no JSON file"),
    ],
)
def test_what_no_parser_should_meet_is_a_sentence(
    tmp_path: Path, robot: str, sentence: str
) -> None:
    with pytest.raises(ReadingsError, match=sentence):
        opened(tmp_path, robot=robot)


def test_a_hundred_thousand_columns_are_refused_at_once(tmp_path: Path) -> None:
    header = ",".join(f"angle_deg_{number}" for number in range(100_000))
    begun = time.monotonic()
    with pytest.raises(ReadingsError, match="has 100000 columns, and a robot"):
        opened(tmp_path, header + "\n" + "0," * 99_999 + "0\n")
    assert time.monotonic() - begun < 30


def test_a_sensor_without_a_column_is_one_that_the_robot_lacks(tmp_path: Path) -> None:
    sensors = [
        {"modality": "touch", "unit": "bool", "count": 4, "noise": 0.0, "rate": 1.0},
        {"modality": "tilt", "unit": "rad", "count": 2, "noise": 0.0, "rate": 1.0},
    ]
    robot = {**ROBOT, "sensors": sensors}
    link = opened(tmp_path, "angle_deg_a,tilt_lr_deg\n30,1\n", robot, driven=(0,))
    assert [sensor.modality for sensor in link.capabilities.sensors] == ["tilt"]
    with pytest.raises(ReadingsError, match="has 1 touch columns, but the robot has 4"):
        opened(tmp_path, robot=robot)
