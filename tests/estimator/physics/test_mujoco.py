"""MuJoCo behind the physics boundary: our own kinematics, true inertia, warnings kept to itself."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from estimator.body.morphology import Morphology
from estimator.errors import PhysicsError
from estimator.physics import mujoco as back_end
from estimator.physics.base import WorldSettings
from estimator.physics.mujoco import MuJoCoPhysics, build
from estimator.physics.statics import StaticsPhysics
from tests.estimator.kinematics import part_frames
from tests.estimator.physics.four_legs import MakeBody, legs, random_pairs, read_one

WORLD = WorldSettings()


@pytest.mark.every_python
def test_kinematics_agree_link_by_link(random_tree: MakeBody) -> None:
    rng = np.random.default_rng(3)
    for _ in range(100):
        body = random_tree(rng)
        angles = rng.uniform(-np.pi, np.pi, 8)
        model = build(mujoco, body, WORLD)
        data = mujoco.MjData(model)
        for index, (part, angle) in enumerate(
            zip(body.parts, body.part_angles(angles), strict=True)
        ):
            if part.motor is not None:
                data.joint(f"joint {index}").qpos[0] = angle
        mujoco.mj_kinematics(model, data)
        base = data.body("main body").xpos
        origins, rotations = part_frames(body, angles)
        for index in range(8):
            link = data.body(f"part {index}")
            assert link.xpos - base == pytest.approx(origins[index], abs=1e-9)
            assert link.xmat.reshape(3, 3) == pytest.approx(rotations[index], abs=1e-9)


@pytest.mark.every_python
def test_links_have_their_own_mass_and_no_more_inertia_than_they_should() -> None:
    body = legs(0.2)
    model = build(mujoco, body, WORLD)
    assert model.body_mass[2:] == pytest.approx(body.masses)
    rod = body.masses[0] * 0.2**2 / 12
    assert model.body_inertia[2:].max() == pytest.approx(rod, rel=0.05)


def test_mujoco_agrees_with_statics_where_that_is_sure(
    statics: StaticsPhysics, random_tree: MakeBody
) -> None:
    """A joint, part or sensor mistaken for another would show."""
    pairs = random_pairs(random_tree, 60, seed=5)
    sure = [pairs[row] for row in np.argsort(-statics.path_margins(pairs))[:20]]
    computed = statics.read(sure)
    with MuJoCoPhysics() as physics:
        simulated = physics.read(sure)
    assert simulated.valid.all()
    assert np.ptp(computed.tilt) > math.radians(5)  # not all of them flat
    assert np.degrees(np.abs(computed.tilt - simulated.tilt)).max() < 0.2
    assert (computed.touch == simulated.touch).mean() > 0.95


@pytest.mark.every_python
def test_a_body_that_flies_apart_is_invalid_and_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)

    def wild(engine: Any, body: Morphology, settings: WorldSettings) -> Any:
        model = build(engine, body, settings)
        model.opt.gravity[:] = math.nan
        return model

    with MuJoCoPhysics() as physics:
        monkeypatch.setattr(back_end, "build", wild)
        felt = read_one(physics, legs(0.1), 0, 0, 0, 0)
    assert not felt.valid[0]
    assert felt.joint_miss[0] == math.inf
    assert not list(tmp_path.iterdir())
    assert capfd.readouterr() == ("", "")


@pytest.mark.every_python
def test_a_body_that_the_engine_refuses_is_invalid_and_costs_no_other() -> None:
    body = legs(0.1)
    tiny = replace(body, base=replace(body.base, mass=1e-300))
    with MuJoCoPhysics() as physics:
        felt = physics.read([(tiny, np.zeros(4)), (body, np.zeros(4))])
    assert felt.valid.tolist() == [False, True]
    assert felt.joint_miss[0] == math.inf


@pytest.mark.every_python
def test_without_mujoco_a_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> Any:
        raise ModuleNotFoundError(f"No module named {name!r}")

    monkeypatch.setattr("importlib.import_module", absent)
    with pytest.raises(PhysicsError, match=r"MuJoCo cannot be imported.*pip install .*estimator\]"):
        MuJoCoPhysics()
