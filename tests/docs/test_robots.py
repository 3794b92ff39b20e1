"""The robots in ``docs/robots`` can be rehearsed and identified: files, body and problem agree."""

from __future__ import annotations

from pathlib import Path

import pytest

from estimator.problem.problem import Problem
from protocol.wire.capabilities import MODALITIES
from robot.configuration.robot_config import load_config
from robot.service.daemon import describe
from sim_robot.simulator.emulated_electronics import EmulatedElectronics
from sim_robot.simulator.fitted_body import fitted
from sim_robot.world.body import body_path, load_body

ROBOTS = Path(__file__).parents[2] / "docs" / "robots"
SHIPPED = {"crawler": ("quadruped", "topological"), "tripod": ("tripod", "tripod")}


@pytest.mark.parametrize("name", sorted(folder.name for folder in ROBOTS.iterdir()))
def test_files_of_a_robot_agree(name: str) -> None:
    folder = ROBOTS / name
    body, problem = SHIPPED.get(name, (str(folder / "body.urdf"), str(folder / "problem.toml")))
    config = load_config(folder / "robot.toml")
    _, differences = fitted(load_body(body_path(body)), config)
    assert differences == []
    electronics = EmulatedElectronics(config)
    assert electronics.notes == ()
    electronics.close()
    robot = describe(config)
    senses = [one for one in MODALITIES if robot.sensor(one) is not None]
    assert Problem.load(problem).for_robot(robot).check_robot(robot, senses) == ()


def test_each_sensor_is_missing_on_one_of_them() -> None:
    lacking = set()
    for folder in ROBOTS.iterdir():
        robot = describe(load_config(folder / "robot.toml"))
        lacking |= {one for one in MODALITIES if robot.sensor(one) is None}
    assert lacking == set(MODALITIES)
