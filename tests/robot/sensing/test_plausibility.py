"""A distance and a tilt that cannot go together."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from robot.errors import DeviceDataError
from robot.sensing.plausibility import LEAST_MARGIN, Underside


def test_a_belly_that_leans_is_not_on_the_ground() -> None:
    lean = math.radians(20)
    least = 0.14 / 2 * math.tan(lean)  # the lower edge on the ground, the middle above it
    belly = Underside(length=0.2, width=0.14)
    belly.check(least, (lean, 0.0), sensor="ruler")
    with pytest.raises(DeviceDataError, match=r"leans by 20° is at least 25 mm up"):
        belly.check(least - LEAST_MARGIN - 1e-6, (lean, 0.0), sensor="ruler")


@pytest.mark.parametrize(
    ("size", "tilt_deg", "clearance", "margin"),
    [
        ((0.14, 0.14, 0.085), 0.0, 0.0, LEAST_MARGIN),
        ((0.14, 0.14, 0.085), 0.3, 0.001, 0.01 + 5 * math.radians(0.3) * 0.14),
        ((1.0, 0.5, 0.1), 0.3, 0.001, 0.01 + 5 * math.radians(0.3) * 0.75),
        ((0.14, 0.14, 0.085), 0.0, 0.006, 0.06),
    ],
)
def test_sensors_that_err_as_announced_may_contradict_each_other(
    size: tuple[float, ...], tilt_deg: float, clearance: float, margin: float
) -> None:
    belly = Underside.of(size, tilt_noise=math.radians(tilt_deg), clearance_noise=clearance)
    lean = math.radians(20)
    least = size[1] / 2 * math.tan(lean)
    belly.check(least - margin + 1e-6, (lean, 0.0), sensor="ruler")
    with pytest.raises(DeviceDataError):
        belly.check(least - margin - 1e-6, (lean, 0.0), sensor="ruler")


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
    belly = Underside(length=footprint[0], width=footprint[1])
    belly.check(middle / z, (math.asin(y), math.asin(x)), sensor="ruler")
