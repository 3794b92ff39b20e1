"""Where emulated servos bring their joints."""

from __future__ import annotations

import math

import pytest

from robot.errors import CommandError
from sim_robot.electronics.servos import Servos


def turned(servos: Servos, *degrees: float) -> list[float]:
    return [math.degrees(servos.turned(0, math.radians(angle))) for angle in degrees]


def test_servos_stop_short_on_either_way() -> None:
    servos = Servos(2)
    assert turned(servos, 10.0) == pytest.approx([10.0])
    servos.inject("short", 2)
    assert turned(servos, 11.0, 20.0, 19.0, 0.0, -1.0, -20.0) == pytest.approx(
        [10.0, 18.0, 18.0, 2.0, 1.0, -18.0]
    )
    servos.mend("short")
    assert turned(servos, -20.0) == pytest.approx([-20.0])
    with pytest.raises(CommandError, match="short needs a number from 1 to 10, not 11"):
        servos.inject("short", 11)
