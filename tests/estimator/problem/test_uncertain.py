"""What a problem says of how well its robot is known."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.errors import ProblemError
from estimator.problem.problem import Problem
from protocol.wire.capabilities import Capabilities
from tests.docs.pages import section
from tests.estimator.problem.test_problem import NAMES, robot


def problem(section: str) -> Problem:
    return Problem.parse(
        f"{Problem.load('parametric').source}\n[uncertain]\n{section}\n", "mine.toml"
    )


def narrow(section: str) -> dict[str, float]:
    return {row.name: row.narrow for row in problem(section).table}


def test_robots_are_as_people_build_them_where_nothing_is_said() -> None:
    rows = {row.name: row.narrow for row in Problem.load("parametric").table}
    assert rows["thickness of all parts"] == 0.25
    assert rows["zero of left upper"] == pytest.approx(math.radians(0.4))
    assert narrow("") == rows


def test_a_group_is_widened_or_closed_in_the_unit_of_its_sentence() -> None:
    rows = narrow("zero_deg = 2.0\nthickness = 0\nservo_dead = 0\ndistance_mm = 1.5")
    assert rows["zero of left upper"] == pytest.approx(math.radians(2.0))
    assert rows["distance sensor's offset"] == pytest.approx(0.0015)
    assert "thickness of all parts" not in rows
    assert not any(name.endswith("dead") and "servo" in name for name in rows)
    assert not problem("exact = true").table


def calibrated(joints: dict[int, tuple[float, float]], tilt: float, gain: float) -> Capabilities:
    """A robot that announces zero and travel of some joints, and zero and gain of sensors."""
    known = [
        replace(joint, zero_sigma=joints[index][0], travel_sigma=joints[index][1])
        if index in joints
        else joint
        for index, joint in enumerate(robot().joints)
    ]
    sensors = [replace(one, zero_sigma=tilt, gain_sigma=gain) for one in robot().sensors]
    return replace(robot(), joints=tuple(known), sensors=tuple(sensors))


spreads = st.floats(1e-9, 1e300)


@settings(max_examples=50)
@given(st.dictionaries(st.integers(0, 7), st.tuples(spreads, spreads)), spreads, spreads)
def test_a_calibration_tightens_the_rows_that_it_is_of_and_widens_none(
    joints: dict[int, tuple[float, float]], zero: float, gain: float
) -> None:
    asked = Problem.load("parametric")
    known = asked.for_robot(calibrated(joints, zero, gain)).table
    expected = {}
    for motor, part in enumerate(("left", "front", "right", "back")):
        if motor in joints:
            at_zero, travel = joints[motor]
            expected[f"zero of {part} upper"] = min(at_zero, math.radians(0.4))
            expected[f"travel of {part} upper"] = min(travel, 0.01)
    level = min(math.hypot(zero, math.radians(0.2)), math.radians(0.4))  # the ground is not level
    for way in ("left/right", "forward/back"):
        expected[f"accelerometer's own tilt, {way}"] = level
    expected["accelerometer's gain"] = expected["distance sensor's gain"] = min(gain, 0.01)
    expected["distance sensor's offset"] = min(zero, 0.002)
    for before, row in zip(asked.table, known, strict=True):
        assert row.narrow == expected.get(row.name, before.narrow)
        assert (row.name, row.wide, row.limit) == (before.name, before.wide, before.limit)


@pytest.mark.parametrize(
    ("measured", "expected"),
    [([0.001, 0.002], 0.002), ([0.001, None], math.radians(1)), ([0.5, 0.5], math.radians(1))],
)
def test_where_servos_stop_matters_only_where_no_joint_is_measured(
    measured: list[float | None], expected: float
) -> None:
    first, *others = robot().joints
    joints = [replace(one, measured_noise=measured[1]) for one in others]
    joints.insert(0, replace(first, measured_noise=measured[0]))
    known = replace(robot(), joints=tuple(joints))
    rows = {row.name: row.narrow for row in problem("").for_robot(known).table}
    assert rows["where all servos stop"] == pytest.approx(expected)


def test_servos_that_are_measured_without_any_error_stop_where_they_are_said_to() -> None:
    joints = tuple(replace(one, measured_noise=0.0) for one in robot().joints)
    known = problem("").for_robot(replace(robot(), joints=joints))
    assert "where all servos stop" not in {row.name for row in known.table}


def test_what_a_person_writes_comes_before_what_a_robot_announces() -> None:
    asked = problem("zero_deg = 1.0\ntravel_of_each = 0\naccelerometer_deg = 0.1")
    known = calibrated({0: (0.001, 0.001)}, 0.001, 0.001)
    rows = {row.name: row.narrow for row in asked.for_robot(known).table}
    assert rows["zero of left upper"] == pytest.approx(math.radians(1.0))
    assert "travel of left upper" not in rows
    assert rows["accelerometer's own tilt, left/right"] == pytest.approx(math.radians(0.1))
    assert rows["accelerometer's gain"] == 0.001
    assert not problem("exact = true").for_robot(known).table


def test_a_joint_keeps_its_calibration_wherever_the_robot_has_it() -> None:
    text = Problem.load("parametric").source
    for number, name in enumerate(NAMES[:4], 1):
        text = re.sub(rf"(?m)^motor = {number}$", f'motor = "{name}"', text)
    driven = ", ".join(f'"{name}"' for name in NAMES[:4])
    text = re.sub(r"(?m)^driven = \[.*\]", f"driven = [{driven}]", text)
    known = calibrated({1: (0.001, 0.001)}, 1.0, 1.0)
    known = replace(known, joints=known.joints[::-1])
    rows = Problem.parse(text, "named").for_robot(known).table
    assert [row.name for row in rows if row.narrow == 0.001] == [
        "zero of front upper",
        "travel of front upper",
    ]


@pytest.mark.parametrize(
    ("zero_tilt", "spread"), [(None, 0.4), ((0.9, -0.8), 0.4), ((-0.5, -2.7), 2.7)]
)
def test_a_robot_that_leans_in_its_zero_pose_may_have_an_accelerometer_that_is_turned_as_far(
    zero_tilt: tuple[float, float] | None, spread: float
) -> None:
    tilts = None if zero_tilt is None else tuple(map(math.radians, zero_tilt))
    leaning = Problem.load("parametric").for_robot(robot(), tilts)
    spreads = [row.narrow for row in leaning.table if row.group == "accelerometer_deg"]
    assert spreads == pytest.approx([math.radians(spread)] * 2)
    assert leaning.reads_zero_pose == (spread > 1)
    assert not problem("accelerometer_deg = 0").for_robot(robot(), tilts).reads_zero_pose


def test_only_a_doubtful_accelerometer_is_read_lying_flat() -> None:
    assert problem("accelerometer_deg = 2.0").reads_flat_first
    assert not problem("accelerometer_deg = 0.2").reads_flat_first
    assert not Problem.load("parametric").reads_flat_first


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("thicknes = 0.1", "thicknes: is nothing that may be otherwise on this robot: name some"),
        ("servo_dead = 1.0", "servo_dead: either is so or is not: write 0 where it is sure"),
        ("zero_deg = -1.0", "zero_deg: must lie in 0 to 100 of its unit, not -1"),
        ("zero_deg = inf", "zero_deg: must be finite, not inf"),
    ],
)
def test_what_cannot_be_is_a_sentence(line: str, sentence: str) -> None:
    with pytest.raises(ProblemError) as caught:
        problem(line)
    assert sentence in str(caught.value)


def test_the_page_has_all_that_may_be_otherwise_and_how_far() -> None:
    rows = {
        name: cells
        for names, *cells in re.findall(
            r"^\| (`.+) \| .+ \| (.+) \| (.+) \|$",
            section("problems", "How well the robot is known"),
            re.MULTILINE,
        )
        for name in re.findall(r"`(\w+)`", names)
    }
    table = {row.group: row for row in Problem.load("parametric").table}
    assert rows.keys() == table.keys()
    for group, (narrow, wide) in rows.items():
        row = table[group]
        assert number(narrow) == pytest.approx(row.narrow * row.unit)
        assert (wide == "yes or no") == row.switch
        assert row.switch or number(wide) == pytest.approx(row.wide * row.unit)


def number(cell: str) -> float:
    """A standard deviation of the page; – stands for 0."""
    return 0.0 if cell == "–" else float(cell.removesuffix("°").removesuffix(" mm"))
