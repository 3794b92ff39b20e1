"""Poses told by readings alone, against the poses that were simulated."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from estimator.body.morphology import BASE, Base, Morphology, Part, rotation
from estimator.evaluation.truth.urdf import Urdf, read_urdf
from estimator.physics.pybullet import PyBulletPhysics
from estimator.readings.observation import Observation
from estimator.report.camera import (
    HEIGHT,
    WIDTH,
    Picture,
    reach,
    take_picture,
)
from estimator.report.scene import (
    MAIN_BODY,
    Solid,
    at_rest,
    model_links,
    robot_links,
    solids_of,
    turn_at_rest,
)
from estimator.report.shown_bodies import observation_of
from estimator.reproduction.robot_process import print_body
from tests.estimator.kinematics import tips

MakeBody = Callable[[np.random.Generator], Morphology]
HIPS = ("hip_left", "hip_front", "hip_right", "hip_back")
UP = np.array([0.0, 0.0, 1.0])


def box(turn: float = 0.0) -> Solid:
    return Solid(
        kind="box",
        size=(0.14, 0.14, 0.085),
        turn=rotation((1.0, 0.0, 0.0), turn),
        place=np.zeros(3),
        limb=MAIN_BODY,
    )


def clearance(solids: list[Solid]) -> float:
    """From the middle of the belly along its normal to the ground, m."""
    body = next(item for item in solids if item.limb == MAIN_BODY)
    normal = body.turn[:, 2]
    belly = body.place - normal * body.size[2] / 2
    return float(belly[2] / normal[2])


def test_lowest_points_of_turned_shapes() -> None:
    assert box(math.pi / 4).lowest(UP) == pytest.approx(-(0.14 + 0.085) / 2 / math.sqrt(2))
    lying = Solid(
        kind="cylinder",
        size=(0.01, 0.2),
        turn=rotation((0.0, 1.0, 0.0), math.pi / 2),
        place=np.array([0.0, 0.0, 0.5]),
        limb=0,
    )
    assert lying.lowest(UP) == pytest.approx(0.49)


@pytest.mark.parametrize("seed", range(4))
def test_a_model_lies_where_it_was_simulated_to_lie(
    seed: int, random_quadruped: MakeBody, physics: PyBulletPhysics
) -> None:
    rng = np.random.default_rng(seed)
    body, angles = random_quadruped(rng), rng.uniform(-0.5, 0.5, 4)
    readings = physics.read([(body, angles)])
    felt = observation_of(readings, 0, angles.tolist())
    solids = at_rest(solids_of(model_links(body), angles), felt)
    assert min(item.lowest(UP) for item in solids) == pytest.approx(0, abs=1e-9)
    assert clearance(solids) == pytest.approx(float(readings.clearance[0]), abs=0.002)
    low = {item.limb for item in solids if item.lowest(UP) < 0.002}
    assert low >= {leg for leg in range(4) if readings.touch[0, leg]}


def test_solids_are_where_the_kinematics_says(random_tree: MakeBody) -> None:
    body = random_tree(np.random.default_rng(3))
    angles = np.linspace(-1, 1, 8)
    solids = solids_of(model_links(body), angles)
    spheres = [(item.place, item.size[0]) for item in solids if item.kind == "sphere"]
    faces = [
        (item.place + item.turn[:, 0] * item.size[0] / 2, 0.0)
        for item in solids
        if item.kind == "box"
    ]
    for tip, part in zip(tips(body, angles), body.parts, strict=True):
        ends = faces if part.shape == "box" else spheres
        reach = [float(np.linalg.norm(middle - tip)) - radius for middle, radius in ends]
        assert min(map(abs, reach)) < 1e-9


@pytest.mark.parametrize("side", [1, -1])
def test_a_body_on_its_tail_or_nose_is_turned_as_one_that_nearly_stands_so(side: int) -> None:
    turns = [
        turn_at_rest([box()], Observation(angles=(), tilt=(0.0, side * math.radians(degrees))))
        for degrees in (90.0, 90.0 - 1e-6)
    ]
    assert turns[0] == pytest.approx(turns[1], abs=1e-7)
    assert turns[0][2] == pytest.approx(np.array([side, 0.0, 0.0]), abs=1e-9)


@pytest.mark.parametrize("main", [box(), replace(box(), kind="cylinder", size=(0.07, 0.02))])
def test_a_body_on_its_back_is_shown_on_its_back(main: Solid) -> None:
    upright = at_rest([main], Observation(angles=(), tilt=(0.0, 0.0), clearance=0.0))
    overturned = at_rest(
        [main], Observation(angles=(), tilt=(0.0, 0.0), clearance=0.2, clearance_saturated=True)
    )
    assert upright[0].turn[2, 2] == pytest.approx(1)
    assert overturned[0].turn[2, 2] == pytest.approx(-1)


@pytest.fixture(scope="module")
def urdf(tmp_path_factory: pytest.TempPathFactory) -> Urdf:
    path = tmp_path_factory.mktemp("truth") / "truth.urdf"
    path.write_text(print_body())
    return read_urdf(path)


def test_the_robot_has_the_papers_measures(urdf: Urdf) -> None:
    solids = solids_of(robot_links(urdf, HIPS, range(4)), [0.0] * 4)
    for motor, way in enumerate(([0, 1, 0], [1, 0, 0], [0, -1, 0], [-1, 0, 0])):
        leg = [item for item in solids if item.limb == motor]
        assert max(-item.lowest(-np.array(way)) for item in leg) == pytest.approx(0.07 + 0.22)


def test_a_positive_angle_lifts_the_robots_leg(urdf: Urdf) -> None:
    angles = [0.0, math.radians(30), 0.0, 0.0]
    solids = solids_of(robot_links(urdf, HIPS, range(4)), angles)
    foot = next(item for item in solids if item.limb == 1 and item.kind == "sphere")
    reach = 0.095 + 0.119
    assert foot.place.tolist() == pytest.approx(
        [0.07 + reach * math.cos(math.radians(30)), 0, reach / 2], abs=1e-6
    )


def scene(length: float) -> list[Solid]:
    """A body whose only leg points ahead, towards the camera's right."""
    part = Part(parent=BASE, mount=1, hinge=2, length=length, radius=0.01, motor=0)
    body = Morphology(base=Base(size=(0.14, 0.14, 0.085), mass=1.0), parts=(part,), density=1e3)
    return at_rest(solids_of(model_links(body), [0.3]), None)


def blue(picture: Picture) -> np.ndarray:
    """Pixels in the colour of motor 1."""
    red, green, light = (picture[..., channel].astype(int) for channel in range(3))
    pixels: np.ndarray = (light > red + 60) & (light > green + 20)
    return pixels


def test_the_same_camera_shows_a_longer_leg_longer() -> None:
    long = scene(0.3)
    radius = reach(long)
    assert radius == pytest.approx(0.07 + 0.3, abs=0.03)
    pictures = [take_picture(item, radius) for item in (scene(0.15), long)]
    assert all(picture.shape == (HEIGHT, WIDTH, 3) for picture in pictures)
    short_pixels, long_pixels = (int(np.sum(blue(picture))) for picture in pictures)
    assert long_pixels > 1.5 * short_pixels > 50
    edges = np.concatenate(
        [blue(pictures[1])[[0, -1]].ravel(), blue(pictures[1])[:, [0, -1]].ravel()]
    )
    assert not edges.any()  # all of it is in the picture


def test_pictures_repeat() -> None:
    assert np.array_equal(take_picture(scene(0.2), 0.4), take_picture(scene(0.2), 0.4))
