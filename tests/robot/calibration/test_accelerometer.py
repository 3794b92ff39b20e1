"""Six positions find zero, gain and sign of each axis, however carelessly; level finds zeros."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from robot.calibration.accelerometer import POSITIONS, AccelerometerSession
from robot.calibration.questions import Questions
from robot.configuration.calibration_file import AxesCalibration
from robot.drivers.sensors.analogue import AnalogueAccelerometer, AnalogueAxes
from robot.errors import AbandonedError
from tests.robot.calibration.desk import Answer, Inputs, Script
from tests.robot.clocks import InstantClock

BELIEVED = AnalogueAxes(channels=(1, 2, 3), zero=(2.5, 2.5, 2.5), per_g=(1.0, 1.0, 1.0))
ZERO, GAIN = (2.3, 2.6, 2.5), (-0.9, 1.2, 0.8)


class Body:
    """Feels gravity along its axes, on channels 1 to 3."""

    def __init__(self, wires: tuple[int, ...] = (0, 1, 2)):
        self.inputs = Inputs(0, 0, 0, 0)
        self.wires = wires
        self.put(0, 0, 1)

    def put(self, *up: float) -> None:
        length = math.hypot(*up)
        for channel, axis in enumerate(self.wires):
            self.inputs.volts[1 + channel] = ZERO[axis] + GAIN[axis] * up[axis] / length

    def into(self, axis: int, sign: float, lean: float = 0.0) -> Callable[[], None]:
        up = [lean, lean, lean]
        up[axis] = sign
        return lambda: self.put(*up)

    def six(self, lean: float = 0.0) -> list[Answer]:
        return [(self.into(axis, sign, lean), "") for _, axis, sign in POSITIONS]


def run(body: Body, script: Script) -> AxesCalibration | None:
    return AccelerometerSession(
        BELIEVED,
        AnalogueAccelerometer(BELIEVED, body.inputs.connected(dict(enumerate("xyz", 1)))),
        rate=50,
        clock=InstantClock(),
        dialogue=Questions(script),
    ).run()


def test_an_axis_at_its_rail_is_measured_again() -> None:
    body = Body()
    first, *others = body.six()
    loose = (lambda: body.inputs.volts.__setitem__(1, 9.0), "")
    calibration = run(body, Script("six", loose, first, *others))
    assert calibration is not None
    assert calibration.zero == pytest.approx(ZERO, abs=1e-3)


def test_six_positions_find_zero_gain_and_sign() -> None:
    body = Body()
    calibration = run(body, Script("six", *body.six()))
    assert calibration is not None
    assert calibration.zero == pytest.approx(ZERO, abs=1e-3)
    assert calibration.per_g == pytest.approx(GAIN, abs=1e-3)


def test_leaning_by_3_degrees_costs_little() -> None:
    body = Body()
    calibration = run(body, Script("six", *body.six(lean=math.tan(math.radians(3)))))
    assert calibration is not None
    # cos 3° twice (two axes lean): 0.3 % of the gain, 0.1° at 30°.
    assert calibration.per_g == pytest.approx(GAIN, rel=4e-3)


def test_a_position_that_leans_too_much_is_asked_for_again() -> None:
    body = Body()
    six = body.six()
    six[2] = (body.into(1, 1, 0.3), "")
    script = Script("six", *six, (body.into(1, 1), ""))
    calibration = run(body, script)
    assert script.heard("'left side up'")
    assert script.prompts[-1].startswith("left side up")
    assert calibration is not None
    assert calibration.per_g == pytest.approx(GAIN, abs=1e-3)


def test_swapped_wires_are_named() -> None:
    body = Body(wires=(1, 0, 2))
    script = Script("six", *body.six(), "skip")
    assert run(body, script) is None
    assert script.heard("The x axis answers on channel 2")


def test_an_axis_that_feels_nothing_is_named() -> None:
    body = Body()
    script = Script("six", *[("" if axis == 2 else body.six()[n]) for n, (_, axis, _) in
                             enumerate(POSITIONS)], "skip")  # fmt: skip
    assert run(body, script) is None
    assert script.heard("z axis")


def test_a_moving_robot_is_not_measured() -> None:
    body = Body()

    def hold_still() -> None:
        body.inputs.noise = 1e-4

    body.inputs.noise = 0.1
    script = Script("six", body.six()[0], (hold_still, ""), *body.six()[1:])
    assert run(body, script) is not None
    assert script.heard("not still")


def test_level_finds_the_zeros_whatever_the_table_leans() -> None:
    body = Body()
    lean = math.sin(math.radians(2))
    quarters: list[Answer] = [
        (lambda x=x, y=y: body.put(x, y, 1), "")  # type: ignore[misc]
        for x, y in ((lean, 0.0), (0.0, lean), (-lean, 0.0), (0.0, -lean))
    ]
    calibration = run(body, Script("level", *quarters))
    assert calibration is not None
    assert calibration.zero[:2] == pytest.approx(ZERO[:2], abs=1e-3)
    assert calibration.per_g == BELIEVED.per_g


def test_level_refuses_what_it_cannot_know() -> None:
    body = Body()
    body.put(0.9, 0, 0.44)  # not level at all
    script = Script("level", "", "", "", "", "skip")
    assert run(body, script) is None
    assert script.heard("six positions")


def test_it_can_be_left_in_any_position() -> None:
    for position in range(len(POSITIONS)):
        body = Body()
        with pytest.raises(AbandonedError):
            run(body, Script("six", *body.six()[:position], "q"))
