"""Bodies: frames, lengths, masses and what cannot exist."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.body.morphology import BASE, Base, Morphology, Part
from estimator.errors import MorphologyError
from tests.estimator.kinematics import part_frames, tips

BODY = Base(size=(0.14, 0.14, 0.085), mass=1.0)
LEG = Part(parent=BASE, mount=1, hinge=2, length=0.1, radius=0.006, motor=0)


def body(*parts: Part) -> Morphology:
    return Morphology(base=BODY, parts=parts, density=1000.0)


def table_1() -> Morphology:
    """The paper's robot: upper legs of 95 mm and lower legs of 125 mm on a body of 140 mm."""
    upper = [replace(LEG, mount=leg, motor=leg, length=0.095, radius=0.013) for leg in range(4)]
    lower = [replace(LEG, parent=leg, motor=None, sensor=leg, length=0.125) for leg in range(4)]
    return body(*upper, *lower)


def ends(of: Morphology, program: Any) -> Any:
    return tips(of, program)


def test_planar_legs_reach_as_far_as_table_1_says() -> None:
    reach = 0.070 + 0.095 + 0.125
    expected = [(0, reach, 0), (reach, 0, 0), (0, -reach, 0), (-reach, 0, 0)]
    assert ends(table_1(), np.zeros(4))[4:] == pytest.approx(np.array(expected), abs=1e-12)


def test_mass_and_reach() -> None:
    robot = table_1()
    assert robot.reach == pytest.approx(0.070 + 0.095 + 0.125)
    assert robot.mass == pytest.approx(BODY.mass + robot.masses.sum())
    twig = replace(LEG, parent=0, mount=0, motor=None, length=0.3)  # on the leg's middle
    assert body(LEG, twig).reach == pytest.approx(0.070 + 0.050 + 0.3)
    assert body(replace(LEG, length=0.01), replace(LEG, motor=1)).reach == pytest.approx(0.17)
    assert body().reach == 0.07


def test_a_positive_hip_lifts_the_whole_leg() -> None:
    left = ends(table_1(), [math.radians(30), 0, 0, 0])[4]
    assert left == pytest.approx([0, 0.070 + 0.220 * math.cos(math.pi / 6), 0.110])


@pytest.mark.parametrize(
    ("hinge", "moved"),
    [
        (0, (0, 1, 0)),  # leftward
        (1, (0, -1, 0)),
        (2, (0, 0, 1)),  # upward
        (3, (0, 0, -1)),
        (4, (0, 0, 0)),  # about its own axis: the tip stays
        (5, (0, 0, 0)),
    ],
)
def test_a_right_angle_turns_the_front_leg(hinge: int, moved: tuple[int, int, int]) -> None:
    tip = ends(body(replace(LEG, hinge=hinge)), [math.pi / 2])[0]
    expected = np.array([0.070, 0, 0]) + 0.1 * np.array(moved if any(moved) else (1, 0, 0))
    assert tip == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("hinge", "up"), [(4, -1), (5, 1)])
def test_rolling_turns_what_sits_on_the_side(hinge: int, up: int) -> None:
    twig = Part(parent=0, mount=0, hinge=2, length=0.08, radius=0.006)
    tip = ends(body(replace(LEG, hinge=hinge), twig), [math.pi / 2])[1]
    assert tip == pytest.approx([0.070 + 0.05, 0, up * 0.08], abs=1e-12)


@pytest.mark.parametrize(
    ("mount", "start", "towards"),
    [(0, 0.05, (0, 1, 0)), (1, 0.1, (1, 0, 0)), (2, 0.05, (0, -1, 0)), (3, 0.0, (-1, 0, 0))],
)
def test_parts_sit_on_their_parents_axis(
    mount: int, start: float, towards: tuple[int, int, int]
) -> None:
    child = Part(parent=0, mount=mount, hinge=0, length=0.05, radius=0.006)
    origins, rotations = part_frames(body(LEG, child), [0.0])
    assert origins[1] == pytest.approx([0.070 + start, 0, 0], abs=1e-12)
    assert rotations[1][:, 0] == pytest.approx(towards, abs=1e-12)
    assert rotations[1][:, 2] == pytest.approx([0, 0, 1])  # z stays up in the planar pose


@given(length=st.floats(0, 0.4), radius=st.floats(0.001, 0.05))
def test_length_is_measured_to_the_outermost_tip(length: float, radius: float) -> None:
    part = replace(LEG, length=length, radius=radius)
    assert part.far + radius == pytest.approx(length)
    assert part.near <= part.far
    assert ends(body(part), [0.0])[0][0] == pytest.approx(0.070 + length)


def test_mass_is_that_of_a_capsule() -> None:
    sphere = 4 / 3 * math.pi * 0.006**3
    cylinder = math.pi * 0.006**2 * (0.1 - 0.006)
    short = replace(LEG, length=0.004, motor=None)
    assert body(LEG, short).masses == pytest.approx([1000 * (sphere + cylinder), 1000 * sphere])


def test_a_touch_sensor_feels_what_is_rigidly_joined_to_its_part() -> None:
    robot = table_1()
    assert robot.sensors == 4
    assert robot.motors == 4
    assert robot.sensor_parts(2) == (2, 6)
    bent = replace(robot, parts=(*robot.parts[:6], replace(robot.parts[6], motor=6), LEG_7))
    assert bent.motors == 7
    assert bent.sensor_parts(2) == (6,)


LEG_7 = Part(parent=3, mount=1, hinge=2, length=0.125, radius=0.006, sensor=3)


def test_the_main_body_joins_nothing() -> None:
    locked = replace(LEG, motor=None, sensor=0)
    assert body(locked, replace(locked, mount=3, sensor=1)).sensor_parts(0) == (0,)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"parent": 0}, "part 1: its parent must be the main body or an earlier part"),
        ({"parent": -2}, "its parent"),
        ({"mount": 4}, "mount must be 0 to 3"),
        ({"hinge": 6}, "hinge must be 0 to 5"),
        ({"length": -0.01}, "length must be at least 0"),
        ({"length": math.nan}, "length"),
        ({"radius": 0.0}, "radius must be above 0"),
        ({"motor": -1}, "motor must be at least 0"),
    ],
)
def test_impossible_parts_are_refused(change: dict[str, Any], reason: str) -> None:
    with pytest.raises(MorphologyError, match=reason):
        body(replace(LEG, **change))


def test_impossible_bodies_are_refused() -> None:
    with pytest.raises(MorphologyError, match="each motor belongs to one part"):
        body(LEG, LEG)
    with pytest.raises(MorphologyError, match="density"):
        Morphology(base=BODY, parts=(LEG,), density=0.0)
    with pytest.raises(MorphologyError, match="three lengths"):
        Base(size=(0.1, 0.1, -0.1), mass=1.0)
    with pytest.raises(MorphologyError, match="mass"):
        Base(size=(0.1, 0.1, 0.1), mass=math.inf)


def test_a_short_motor_program_is_refused() -> None:
    with pytest.raises(MorphologyError, match="1 angles, but the body has 4 motors"):
        part_frames(table_1(), [0.0])


def test_a_plate_has_the_inertia_of_a_cylinder() -> None:
    plate = Base(size=(0.14, 0.14, 0.02), mass=0.4, round=True)
    across = 0.4 * (3 * 0.07**2 + 0.02**2) / 12
    assert plate.inertia == pytest.approx((across, across, 0.4 * 0.07**2 / 2))
    with pytest.raises(MorphologyError, match=r"as wide as long, not 0\.14 x 0\.2"):
        Base(size=(0.14, 0.2, 0.02), mass=0.4, round=True)
