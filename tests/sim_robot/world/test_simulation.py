"""The world: it holds its poses, forgets its past, and is what the sensors are told."""

from __future__ import annotations

import itertools
import logging
import math
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import psutil
import pytest

from protocol.wire.readings import tilt_of, touches
from sim_robot.faults.world_faults import Ground
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.simulation import ENGINES, STEP, Pose, World, open_world

LOG = logging.getLogger("world")


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    pytest.importorskip(request.param)
    return str(request.param)


@pytest.fixture
def world(engine: str) -> Iterator[World]:
    with open_world(load_body(default_body_path()), log=LOG, engine=engine) as default:
        yield default


def rest(world: World, degrees: list[float], seconds: float = 3.0) -> None:
    """One interaction: flat, then the pose."""
    world.set_targets([0.0] * 8)
    world.lay_down()
    start = world.steps / 240
    world.advance_to(start + 0.3)
    world.set_targets([math.radians(value) for value in degrees])
    world.advance_to(start + 0.3 + seconds)


def test_the_default_body_holds_every_pose(world: World) -> None:
    corners = [list(corner) + [0.0] * 4 for corner in itertools.product((-30.0, 30.0), repeat=4)]
    rng = np.random.default_rng(7)
    inside = [[*rng.uniform(-30, 30, 4), 0.0, 0.0, 0.0, 0.0] for _ in range(8)]
    for degrees in corners + inside:
        rest(world, degrees)
        assert math.degrees(world.largest_miss()) < 0.1, degrees


@pytest.mark.every_python
def test_ground_that_rises_forward_tilts_the_body_and_loads_its_back_leg(world: World) -> None:
    ground = Ground()
    ground.inject("rises_forward", 8)
    world.incline(ground.up)
    rest(world, [-30.0] * 4 + [0.0] * 4)
    left_right, forward_back = map(math.degrees, tilt_of(world.up()))
    assert left_right == pytest.approx(0.0, abs=0.2)
    assert forward_back == pytest.approx(8.0, abs=0.2)
    loads = dict(zip(world._body.touch, world.loads(), strict=True))
    assert loads["lower_back"] > 1.2 * loads["lower_front"]
    world.incline(Ground().up)
    rest(world, [-30.0] * 4 + [0.0] * 4)
    assert world.up() == pytest.approx((0, 0, 1), abs=2e-3)


def enlarged(path: Path, scale: float, folder: Path) -> Path:
    """A body so many times as long, of the same materials, with servos to match."""
    powers = {"xyz": 1, "size": 1, "radius": 1, "length": 1, "value": 3, "effort": 4}
    powers |= dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 5)
    tree = ElementTree.parse(path)
    for element in tree.iter():
        for name in () if element.tag == "axis" else powers.keys() & element.keys():
            factor = scale ** powers[name]
            numbers = [factor * float(text) for text in element.get(name, "").split()]
            element.set(name, " ".join(map(str, numbers)))
    place = folder / "enlarged.urdf"
    tree.write(place)
    return place


def test_each_servo_drives_its_own_joint_in_whatever_order_the_body_has_them(engine: str) -> None:
    body = load_body(default_body_path())
    targets = [0.05 * number - 0.2 for number in range(8)]
    with open_world(replace(body, motors=body.motors[::-1]), log=LOG, engine=engine) as world:
        world.hold(1.0)
        world.set_targets(targets)
        world.advance_to(1.0)
        assert world.angles() == pytest.approx(targets, abs=0.005)


@pytest.mark.parametrize("scale", [0.5, 3.0])
def test_a_body_of_any_size_holds_its_poses(tmp_path: Path, engine: str, scale: float) -> None:
    body = load_body(enlarged(default_body_path(), scale, tmp_path))
    rng = np.random.default_rng(8)
    with open_world(body, log=LOG, engine=engine) as world:
        for degrees in rng.uniform(-30, 30, (8, 4)):
            rest(world, [*degrees, 0.0, 0.0, 0.0, 0.0], seconds=4.0)
            assert math.degrees(world.largest_miss()) < 0.1, degrees


def test_laid_down_it_lies_flat(world: World) -> None:
    rest(world, [-30.0, 20.0, 10.0, 30.0, 0.0, 0.0, 0.0, 0.0])
    world.set_targets([0.0] * 8)
    world.lay_down()
    assert world.up() == pytest.approx((0, 0, 1), abs=1e-9)
    assert world.belly_ray() == pytest.approx(0.0, abs=1e-6)


def test_laying_it_down_again_and_again_costs_no_memory(world: World) -> None:
    def resident() -> int:
        for _ in range(40):
            world.lay_down()
        return int(psutil.Process().memory_info().rss)

    # The allocator may take a page now and then; a leak grows every time.
    sizes = [resident() for _ in range(5)]
    assert min(np.diff(sizes)) < 40_000


def test_no_file_is_left_even_by_one_that_is_killed(
    tmp_path: Path, engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with open_world(load_body(default_body_path()), log=LOG, engine=engine) as world:
        world.lay_down()
        assert not list(tmp_path.iterdir())


@pytest.mark.every_python
def test_a_pose_does_not_depend_on_the_one_before(world: World) -> None:
    pose = [-25.0, 5.0, -12.0, 8.0, 0.0, 0.0, 0.0, 0.0]
    rest(world, pose)
    first = (world.up(), world.belly_ray(), world.loads())
    rest(world, [30.0, -30.0, 30.0, -30.0, 0.0, 0.0, 0.0, 0.0])
    rest(world, pose)
    assert (world.up(), world.belly_ray(), world.loads()) == first


@pytest.mark.every_python
def test_standing_on_four_legs_is_what_trigonometry_says(world: World) -> None:
    down = 30.0
    rest(world, [-down] * 4 + [0.0] * 4)
    # Foot sphere of 6 mm at 0.095 + 0.119 m from the hip, which is 42.5 mm above the belly.
    expected = (0.095 + 0.119) * math.sin(math.radians(down)) + 0.006 - 0.0425
    assert world.belly_ray() == pytest.approx(expected, abs=1e-3)
    assert world.up() == pytest.approx((0, 0, 1), abs=2e-3)
    weight = (0.6 + 4 * 0.09) * 9.81
    assert sum(world.loads()) == pytest.approx(weight, rel=0.02)
    assert all(map(touches, world.gaps()))


@pytest.mark.every_python
def test_tilt_signs(world: World) -> None:
    rest(world, [-30.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # pushes the left side up
    assert math.degrees(math.asin(world.up()[1])) > 3
    rest(world, [0.0, -30.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # pushes the nose up
    assert math.degrees(math.asin(world.up()[0])) > 3


def test_a_servo_moves_at_60_degrees_a_second(world: World) -> None:
    world.set_targets([math.radians(30)] * 8)
    world.advance_to(0.25)
    assert math.degrees(world.largest_miss()) == pytest.approx(15, abs=1)


@pytest.mark.every_python
def test_a_weak_servo_is_reported(
    tmp_path: Path, engine: str, caplog: pytest.LogCaptureFixture
) -> None:
    file = tmp_path / "weak.urdf"
    text = default_body_path().read_text(encoding="utf-8")
    file.write_text(text.replace('effort="1.412"', 'effort="0.2"'), encoding="utf-8")
    with open_world(load_body(file), log=LOG, engine=engine) as world:
        rest(world, [-30.0] * 4 + [0.0] * 4)
    assert "too weak" in caplog.text


class TippingWorld(World):
    """A servo is 1° off its target while the body tips over by 0.1°/s, until it lies on 5°."""

    def angles(self) -> tuple[float, ...]:
        return tuple(math.radians(1.0) for _ in self._body.motors)

    def close(self) -> None: ...

    def _build(self) -> None: ...

    def _pull(self) -> None: ...

    def _command(self) -> None: ...

    def _step(self) -> None: ...

    def torques(self) -> tuple[float, ...]:
        return (0.0,) * len(self.angles())

    def _pose(self) -> Pose:
        half = math.radians(min(0.1 * self.steps * STEP, 5.0)) / 2
        return Pose((0.0, 0.0, 0.0), (0.0, math.sin(half), 0.0, math.cos(half)))

    def _contacts(self) -> Iterator[tuple[str, float]]:
        yield from ()

    def _distances(self) -> Iterator[tuple[str, float]]:
        yield from ()


def test_slow_motion_is_not_rest(caplog: pytest.LogCaptureFixture) -> None:
    with TippingWorld(load_body(default_body_path()), log=LOG) as world:
        world.advance_to(49.0)
        assert not caplog.records
        world.advance_to(52.0)
    assert "rests 1.00° from its target" in caplog.text
    assert len(caplog.records) == 1


@pytest.mark.every_python
@pytest.mark.parametrize(
    "up", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0.6, 0, 0.8)]
)
def test_a_held_body_stays_as_it_is_held(world: World, up: tuple[float, float, float]) -> None:
    world.set_targets([math.radians(40)] * 4 + [math.radians(-70)] * 4)
    world.hold(2.0, up)
    world.advance_to(1.0)
    assert world.up() == pytest.approx(up, abs=1e-6)
    assert not any(world.loads())
    angles = [math.degrees(angle) for angle in world.angles()]
    assert angles == pytest.approx([40] * 4 + [-70] * 4, abs=0.1)  # the legs still move freely


@pytest.mark.parametrize("up", [(0.6, 0.0, 0.8), (0.0, -0.28, 0.96), (0.36, 0.48, 0.8)])
def test_a_leaning_body_sees_the_ground_along_its_bellys_normal(
    world: World, up: tuple[float, float, float]
) -> None:
    height, belly = 0.3, 0.085 / 2  # the belly below the body's middle, about which it turns
    world.hold(height, up)
    assert world.belly_ray() == pytest.approx((height + belly) / up[2] - belly, abs=1e-6)


def test_a_body_on_its_back_sees_no_ground(world: World) -> None:
    world.hold(0.3, (0.0, 0.0, -1.0))
    assert math.isinf(world.belly_ray())


def test_a_body_held_upright_is_as_high_as_said_and_falls_when_laid_down(world: World) -> None:
    world.hold(0.12)
    world.advance_to(0.5)
    assert world.belly_ray() == pytest.approx(0.12, abs=1e-6)
    world.lay_down()
    world.advance_to(1.0)
    assert world.belly_ray() == pytest.approx(0, abs=1e-3)


@pytest.mark.every_python
def test_a_pressed_sensor_feels_it_besides_the_ground(world: World) -> None:
    rest(world, [-30.0] * 4 + [0.0] * 4)
    before = world.loads()
    assert min(before) > 0.1
    world.press("lower_front", 2.5)
    assert world.loads() == pytest.approx([load + 2.5 * (n == 1) for n, load in enumerate(before)])
    world.press("lower_front", 0.0)
    assert world.loads() == before


def test_who_puts_the_body_elsewhere_takes_the_weights_off(world: World) -> None:
    lying = world.loads()
    world.press("lower_front", 2.5)
    world.lay_down()
    assert world.loads() == lying
    world.press("lower_front", 2.5)
    world.hold(1.0)
    assert not any(world.loads())


def test_legs_that_slew_in_the_air_are_not_weak(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    world.set_targets([math.radians(60)] * 8)
    world.advance_to(2.0)
    assert not caplog.records
