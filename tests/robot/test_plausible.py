"""Sensors that still answer, but with what cannot be."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from robot.errors import DeviceDataError
from robot.plausible import CLEARANCE_MARGIN, STUCK_AFTER, ChannelWatch, check_clearance

CODE = 10 / 65536


def watch() -> ChannelWatch:
    return ChannelWatch({2: "the x axis", 4: "the gauge"}, first=2, rails=(-5.0, 5.0))


@pytest.mark.parametrize("volts", [-5.0, 5.0 - CODE])
@pytest.mark.parametrize("index", [0, 2])
def test_an_input_at_an_end_of_its_range_is_no_reading(volts: float, index: int) -> None:
    scan = [0.0, 0.0, 0.0]
    scan[index] = volts
    with pytest.raises(DeviceDataError, match=f"Input {index + 2}"):
        watch().check(scan)


def test_an_input_next_to_the_end_is_one_and_an_unused_one_may_be_anywhere() -> None:
    watch().check([5.0 - 2 * CODE, 5.0 - CODE, CODE - 5.0])


def test_an_input_that_repeats_itself_is_stuck_and_one_that_dithers_is_not() -> None:
    found = watch()
    for scan in range(STUCK_AFTER):
        found.feed([1.0, 0.0, 1.0 + scan % 2 * CODE])
    with pytest.raises(DeviceDataError, match="Input 2, the x axis, is stuck"):
        found.check([1.0, 0.0, 1.0])
    found.feed([1.0 + CODE, 0.0, 1.0])
    found.check([1.0 + CODE, 0.0, 1.0])


def test_a_belly_that_leans_is_not_on_the_ground() -> None:
    lean = math.radians(20)
    least = 0.14 / 2 * math.tan(lean)  # the lower edge on the ground, the middle above it
    check_clearance(least, (lean, 0.0), (0.14, 0.14))
    with pytest.raises(DeviceDataError, match=r"leans by 20° is at least 25 mm up"):
        check_clearance(least - CLEARANCE_MARGIN - 1e-6, (lean, 0.0), (0.14, 0.14))


@given(
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0),
    st.floats(0, 0.1),
    st.tuples(st.floats(0.01, 0.5), st.floats(0.01, 0.5)),
)
def test_no_body_above_the_ground_is_refused(
    roll: float, pitch: float, height: float, footprint: tuple[float, float]
) -> None:
    x, y = -math.sin(pitch), math.cos(pitch) * math.sin(roll)
    z = math.cos(pitch) * math.cos(roll)
    assume(z > 0.1)
    corners = [
        a * footprint[0] / 2 * x + b * footprint[1] / 2 * y for a in (-1, 1) for b in (-1, 1)
    ]
    middle = height - min(corners)  # the lowest corner is `height` above the ground
    check_clearance(middle / z, (math.asin(y), math.asin(x)), footprint)
