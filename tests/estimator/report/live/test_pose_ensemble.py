"""Bodies as arrays for a graphics card: what is drawn is what forward kinematics says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.body.morphology import tips
from estimator.readings.observation import Observation
from estimator.report.canvas import leg_colour
from estimator.report.live.live_page import KINDS, instances, posed
from tests.estimator.conftest import BODY, MakeBody

LEVEL = Observation(angles=(0.3, -0.2, 0.1, 0.4, 0.2, -0.5, 0.0, 0.3), tilt=(0.0, 0.0))


def test_every_part_is_drawn_where_it_is(random_tree: MakeBody) -> None:
    body = random_tree(np.random.default_rng(5))
    solids = posed(BODY, body, LEVEL)
    boxes, _, spheres = (instances([solids], kind) for kind in KINDS)
    middle = boxes.positions[0]
    assert boxes.scales[0] == pytest.approx(BODY.size)
    outermost = tips(body, LEVEL.angles) + middle
    bars = np.array([part.shape == "box" for part in body.parts])
    reached = spheres.positions[1::2] - outermost[~bars]  # from the tip to the far sphere's middle
    radii = np.array([part.radius for part in body.parts])[~bars]
    assert np.linalg.norm(reached, axis=1) == pytest.approx(radii)
    assert spheres.scales[::2] == pytest.approx(np.repeat(radii, 3).reshape(-1, 3))
    sizes = np.array([part.size for part in body.parts])[bars]
    assert boxes.scales[1:] == pytest.approx(sizes)
    reached = boxes.positions[1:] - outermost[bars]
    assert np.linalg.norm(reached, axis=1) == pytest.approx(sizes[:, 0] / 2)


def test_a_body_rests_on_the_ground_turned_as_was_felt(random_quadruped: MakeBody) -> None:
    body = random_quadruped(np.random.default_rng(1))
    pose = Observation(angles=(-0.5, 0.2, -0.5, 0.1), tilt=(0.2, -0.1))
    solids = posed(BODY, body, pose)
    assert min(solid.lowest(np.array([0.0, 0.0, 1.0])) for solid in solids) == pytest.approx(0)
    up = Rotation.from_quat(instances([solids], "box").wxyzs[0], scalar_first=True).as_matrix()[2]
    assert np.arcsin(up[[1, 0]]) == pytest.approx((0.2, -0.1))


def test_each_leg_has_its_colour(random_quadruped: MakeBody) -> None:
    body = random_quadruped(np.random.default_rng(1))
    cylinders = instances([posed(BODY, body, None)] * 3, "cylinder")
    assert cylinders.colours.shape == (3 * 8, 3)
    light = np.array([list(bytes.fromhex(leg_colour(leg)[1:])) for leg in range(4)])
    expected = np.rint(255 * (light / 255) ** 2.2)
    assert cylinders.colours[:8].tolist() == np.tile(expected, (2, 1)).astype(int).tolist()


def test_before_anything_is_known_there_is_the_main_body() -> None:
    solids = posed(BODY, None, None)
    assert [solid.kind for solid in solids] == ["box"]
    assert instances([solids], "box").positions[0] == pytest.approx((0, 0, BODY.size[2] / 2))
    assert len(instances([solids], "sphere").wxyzs) == 0
