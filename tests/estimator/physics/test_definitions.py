"""The engines' readings are those that ``protocol.wire.readings`` defines."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.body.morphology import Base, Morphology
from estimator.physics.base import WorldSettings
from estimator.physics.kernel import sensing
from estimator.physics.rest import fill_row
from estimator.readings.observation import PredictedReadings
from protocol.wire.readings import belly_ray, clearance_of, tilt_of, touch_is_doubtful, touches

BASE = Base(size=(0.14, 0.14, 0.085), mass=0.6)
EDGES = (-0.001, 0.0, 0.001, 0.002, 0.2)

heights = st.floats(-0.01, 1.0) | st.sampled_from(EDGES)
caps = st.floats(0.01, 0.5) | st.sampled_from((0.2,))
components = st.floats(-1.0, 1.0)


@st.composite
def ups(draw: st.DrawFn) -> tuple[float, float, float]:
    """Unit vectors, also of a body on its side or back; rounding may carry them beyond 1."""
    vector = [draw(components) for _ in range(3)]
    length = math.hypot(*vector)
    if length < 0.1:
        return draw(st.sampled_from([(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 1 + 1e-15, 0.0)]))
    x, y, z = (part / length for part in vector)
    return x, y, z


def _compile() -> Any:
    tilt, ray, clearance = sensing._tilt_of, sensing._belly_ray, sensing._clearance_of
    touch, doubtful = sensing._touches, sensing._touch_is_doubtful

    @numba.njit(error_model="numpy")
    def compiled(up: Any, height: float, cap: float, gap: float) -> Any:
        length = ray(height, up)
        return (
            tilt(up),
            length,
            clearance(length, cap),
            touch(height, gap),
            doubtful(height, gap),
        )

    return compiled


@pytest.fixture(scope="module")
def kernel() -> Any:
    return _compile()


@given(up=ups(), height=heights, cap=caps, gap=caps)
def test_the_kernel_compiles_the_definitions(
    kernel: Any, up: tuple[float, float, float], height: float, cap: float, gap: float
) -> None:
    length = belly_ray(height, up)
    assert kernel(np.array(up), height, cap, gap) == (
        tilt_of(up),
        length,
        clearance_of(length, cap),
        touches(height, gap),
        touch_is_doubtful(height, gap),
    )


@given(up=ups(), height=heights, cap=caps)
@settings(max_examples=50)
def test_an_engine_fills_a_row_with_the_definitions(
    up: tuple[float, float, float], height: float, cap: float
) -> None:
    body = Morphology(base=BASE, parts=(), density=1000.0)
    readings = PredictedReadings.empty(1, 0)
    fill_row(readings, 0, body, WorldSettings(clearance_cap=cap), height=height, up=up, gaps=())
    clearance, saturated = clearance_of(belly_ray(height - up[2] * 0.085 / 2, up), cap)
    assert tuple(readings.tilt[0]) == tilt_of(up)
    assert (readings.clearance[0], readings.saturated[0]) == (clearance, saturated)
