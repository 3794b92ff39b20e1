"""Joints of a problem file by their names, wherever a number may stand."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from estimator.errors import ProblemError
from estimator.problem.problem import Problem
from protocol.wire.capabilities import Capabilities
from tests.estimator.problem.test_problem import NAMES, robot

BY_NUMBER = re.sub(
    r"(?m)^sensor = (\d)$",
    lambda found: f"{found[0]}\nlocked = {int(found[1]) + 4}",
    Problem.load("parametric").source,
)


def _by_name(text: str) -> str:
    """A problem file with the paper's joints by their names."""
    named = re.sub(
        r"(?m)^(motor|locked) = (\d)$",
        lambda found: f'{found[1]} = "{NAMES[int(found[2]) - 1]}"',
        text,
    )
    driven = ", ".join(f'"{name}"' for name in NAMES[:4])
    return re.sub(r"(?m)^driven = \[.*\]", f"driven = [{driven}]", named)


def _turned_round() -> Capabilities:
    """The same robot with its joints in another order."""
    one = robot()
    return replace(one, joints=one.joints[::-1])


def test_names_stand_for_the_robots_numbers() -> None:
    text = _by_name(BY_NUMBER)
    assert text.count('"hip_left"') == 2
    assert text.count('"knee_b"') == 1
    known = Problem.parse(BY_NUMBER, "numbered")
    for read in (Problem.parse(text, "named"), Problem.parse(text, "named").for_robot(robot())):
        assert read.parts == known.parts
        assert read.motors == known.motors


def test_joints_are_found_by_name_wherever_the_robot_has_them() -> None:
    problem = Problem.parse(_by_name(BY_NUMBER), "named").for_robot(_turned_round())
    assert problem.motors.driven == (7, 6, 5, 4)
    assert [part.motor for part in problem.parts[:4]] == [7, 6, 5, 4]
    assert [part.locked for part in problem.parts[4:]] == [3, 2, 1, 0]
    assert problem.for_robot(_turned_round()) is problem
    assert problem.for_robot(robot()).motors.driven == (0, 1, 2, 3)


def test_names_in_a_table_by_the_number_of_joints() -> None:
    text = _by_name(BY_NUMBER)
    (driven,) = re.findall(r"(?m)^driven = (\[.*\])", text)
    table = text.replace(f"driven = {driven}", f'driven = {{ 8 = {driven}, other = "all" }}')
    assert Problem.parse(table, "named").motors.driven == (0, 1, 2, 3)
    assert Problem.parse(table, "named").for_robot(_turned_round()).motors.driven == (7, 6, 5, 4)


@pytest.mark.parametrize("number", [1, 4])
def test_names_and_numbers_in_one_file_are_refused(number: int) -> None:
    text = _by_name(BY_NUMBER).replace(f'motor = "{NAMES[number - 1]}"', f"motor = {number}")
    said = rf"motors\.driven has 'hip_left', parts\[{number}\]\.motor has {number}"
    with pytest.raises(ProblemError, match=rf"mixed: joints go by .* not by both: {said}"):
        Problem.parse(text, "mixed")


def test_a_joint_that_the_robot_does_not_have_is_named() -> None:
    problem = Problem.parse(_by_name(BY_NUMBER).replace('"hip_back"', '"tail"'), "mine.toml")
    with pytest.raises(
        ProblemError,
        match=r"mine\.toml: motors\.driven: the robot has no joint named 'tail'; its joints are "
        r"hip_left, hip_front, ",
    ):
        problem.for_robot(robot())
    locked = _by_name(BY_NUMBER).replace('"knee_b"', '"tail"')
    with pytest.raises(ProblemError, match=r"parts\[8\]\.locked: the robot has no joint named 't"):
        Problem.parse(locked, "mine.toml").for_robot(robot())
