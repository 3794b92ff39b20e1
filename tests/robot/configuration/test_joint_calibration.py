"""Counts ↔ angles."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.configuration.joint_calibration import DrivenJoint, JointScale
from robot.drivers.servos.sv203 import COUNTS

HIP = JointScale(((3, math.radians(-96)), (253, math.radians(74))))


def joint(scale: JointScale, lower: float = -96, upper: float = 74) -> DrivenJoint:
    return DrivenJoint(
        name="hip",
        output=1,
        lower_limit=math.radians(lower),
        upper_limit=math.radians(upper),
        part_radius=0.01,
        counts=COUNTS,
        scale=scale,
    )


def test_a_hip_count_is_0_68_degrees_around_minus_11() -> None:
    assert math.degrees(HIP.resolution) == pytest.approx(0.68)
    assert math.degrees(HIP.angle(128)) == pytest.approx(-11)


@given(st.integers(1, 255))
def test_each_count_is_its_own_nearest(count: int) -> None:
    assert HIP.count(HIP.angle(count)) == count


@given(st.floats(-1.6, 1.2))
def test_no_angle_is_further_than_half_a_count(angle: float) -> None:
    assert abs(HIP.angle(HIP.count(angle)) - angle) <= HIP.resolution / 2 + 1e-12


def test_a_table_may_bend_and_fall() -> None:
    scale = JointScale(((10, 1.0), (100, 0.0), (200, -3.0)))
    assert scale.angle(55) == pytest.approx(0.5)
    assert scale.angle(150) == pytest.approx(-1.5)
    assert scale.count(-1.5) == 150


def test_no_position_is_nearest_to_a_count_that_cannot_be_commanded() -> None:
    assert [joint(HIP).nearest(position) for position in (-3, 0.4, 17.6, 300)] == [1, 1, 18, 255]


def test_a_joint_stays_within_limits_and_says_when_it_is_at_the_end() -> None:
    narrow = joint(HIP, lower=-30)
    count = narrow.quantise(math.radians(-30))
    assert math.radians(-30) <= HIP.angle(count) < math.radians(-29)
    assert narrow.at_end(count)
    assert not narrow.at_end(count + 1)
    assert narrow.quantise(0.0) == 144
    assert not narrow.at_end(144)
    assert narrow.at_end(count - 20)  # where a board that was reset may stand


@pytest.mark.parametrize(
    "points",
    [
        ((3, 0.0),),
        ((3, 0.0), (3, 1.0)),
        ((3, 0.0), (9, 0.0)),
        ((3, 0.0), (9, 1.0), (20, 0.5)),
    ],
)
def test_an_impossible_table_is_refused(points: tuple[tuple[float, float], ...]) -> None:
    with pytest.raises(ValueError, match=r"point|count|angles"):
        JointScale(points)
