from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.wire.readings import (
    belly_ray,
    clearance_of,
    tilt_of,
    touch_is_doubtful,
    touches,
    up_in_body,
    up_of,
)

components = st.floats(-1.0, 1.0)


@st.composite
def orientations(draw: st.DrawFn) -> tuple[float, ...]:
    quaternion = tuple(draw(components) for _ in range(4))
    length = math.hypot(*quaternion)
    return tuple(part / length for part in quaternion) if length > 0.1 else (0.0, 0.0, 0.0, 1.0)


@given(orientations())
def test_up_is_a_unit_vector_and_no_tilt_exceeds_a_right_angle(
    orientation: tuple[float, ...],
) -> None:
    up = up_in_body(orientation)
    assert math.hypot(*up) == pytest.approx(1.0, abs=1e-9)
    assert all(abs(angle) <= math.pi / 2 for angle in tilt_of(up))


@given(st.floats(-1.0, 1.0), st.floats(-0.5, 0.5))
def test_up_follows_from_the_tilt_of_a_body_that_is_not_on_its_back(
    left: float, ahead: float
) -> None:
    up = up_of((left, ahead))
    assert tilt_of(up) == pytest.approx((left, ahead))
    assert math.hypot(*up) == pytest.approx(1.0)
    assert up[2] > 0


@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_tilt_in_roll_and_pitch(roll: float, pitch: float) -> None:
    cr, sr, cp, sp = (f(a / 2) for a in (roll, pitch) for f in (math.cos, math.sin))
    up = up_in_body((sr * cp, cr * sp, -sr * sp, cr * cp))
    left_right, nose = tilt_of(up)
    assert nose == pytest.approx(-pitch, abs=1e-6)
    assert math.sin(left_right) == pytest.approx(math.cos(pitch) * math.sin(roll), abs=1e-9)


@given(orientations(), st.floats(-0.1, 1.0), st.floats(0.01, 0.5))
def test_clearance_is_capped_and_never_shorter_than_the_height(
    orientation: tuple[float, ...], height: float, cap: float
) -> None:
    distance, saturated = clearance_of(belly_ray(height, up_in_body(orientation)), cap)
    assert min(max(0.0, height), cap) * (1 - 1e-9) <= distance <= cap
    assert saturated == (distance == cap)


def test_a_belly_below_the_ground_lies_on_it_and_one_that_looks_up_sees_nothing() -> None:
    level, upside_down = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
    assert belly_ray(-0.0004, level) == -0.0004
    assert clearance_of(-0.0004, 0.2) == (0.0, False)
    assert clearance_of(belly_ray(0.05, upside_down), 0.2) == (0.2, True)
    assert clearance_of(belly_ray(-0.05, upside_down), 0.2) == (0.2, True)


def test_touch_is_a_gap_below_a_millimetre() -> None:
    assert touches(-0.01)
    assert touches(0.000999)
    assert not touches(0.001)


def test_touch_is_doubtful_just_above_the_ground() -> None:
    assert not touch_is_doubtful(0.0)
    assert touch_is_doubtful(0.0005)
    assert touch_is_doubtful(0.0019)
    assert not touch_is_doubtful(0.002)
