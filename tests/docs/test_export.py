"""``docs/export.md`` is true: exported bodies stand still, and the hexapod walks."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from estimator.evaluation.attachments import Comparison, Truth
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.report.export.description import Description
from estimator.report.export.formats import in_words_of, mjcf, urdf
from protocol.system.process import native_output_discarded
from robot.service.daemon import describe
from sim_robot.simulator.pc104_set import configure
from sim_robot.world.body import load_body, shipped_bodies
from sim_robot.world.sensor_noise import NoiseLevels
from tests.docs.pages import blocks, page

IN_PYBULLET, WALK = blocks(page("export"), "python")
PROBLEMS = {
    "quadruped": "topological-24",
    "tripod": "tripod",
    "biped": "biped",
    "hexapod_12": "hexapod-12",
    "hexapod_18": "hexapod-18",
}
IN_BULLET = shipped_bodies() if os.environ.get("ALL_BODIES") else ("tripod", "hexapod_12")
SECONDS = 20.0
SETTLING = 3.0  # until all joints are at their targets and the body lies
STILL = 1e-3  # m


def exported(name: str) -> Description:
    """The true body of a robot that ships, as its problem says it."""
    path = shipped_bodies()[name]
    robot = describe(configure(load_body(path), port="", levels=NoiseLevels()))
    problem = Problem.load(PROBLEMS.get(name, "topological")).for_robot(robot)
    genome = Genome(problem, problem.base(robot))
    any_body = genome.decode(genome.permitted(np.full((1, genome.size), 0.5))[0])
    truth = Truth.read(path, problem, robot)
    return in_words_of(problem, robot, Comparison(problem, genome, any_body, truth).true_body)


def poses(body: Description) -> Iterator[dict[str, float]]:
    """Flat, and as anybody might command it."""
    servos = [link.joint.name for link in body.links if link.joint.limits is not None]
    yield dict.fromkeys(servos, 0.0)
    yield dict(zip(servos, np.random.default_rng(4).uniform(-0.5, 0.5, len(servos)), strict=True))


@pytest.mark.parametrize("name", shipped_bodies())
def test_in_mujoco_it_stands_still(name: str) -> None:
    body = exported(name)
    model = mujoco.MjModel.from_xml_string(mjcf(body))
    for pose in poses(body):
        data = mujoco.MjData(model)
        for servo, angle in pose.items():
            data.ctrl[model.actuator(servo).id] = angle
        mujoco.mj_step(model, data, int(SETTLING / model.opt.timestep))
        start, farthest = data.qpos[:3].copy(), 0.0
        for servo, angle in pose.items():
            assert data.joint(servo).qpos[0] == pytest.approx(angle, abs=0.012)
        while data.time < SETTLING + SECONDS:
            mujoco.mj_step(model, data, 20)
            farthest = max(farthest, float(np.linalg.norm(data.qpos[:3] - start)))
        assert farthest < STILL


@contextmanager
def in_pybullet(body: Description, folder: Path) -> Iterator[dict[str, Any]]:
    """What the page's lines have made: ``p``, ``robot`` and ``command``."""
    (folder / "found.urdf").write_text(urdf(body), encoding="utf-8")
    made: dict[str, Any] = {}
    with native_output_discarded():
        exec(compile(IN_PYBULLET, "export.md", "exec"), made)
    try:
        yield made
    finally:
        made["p"].disconnect()


@pytest.mark.parametrize("name", IN_BULLET)
def test_in_pybullet_it_stands_still(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    body = exported(name)
    for pose in poses(body):
        with in_pybullet(body, tmp_path) as made:
            p, robot = made["p"], made["robot"]
            made["command"](pose)
            for _ in range(int(SETTLING * 240)):
                p.stepSimulation()
            start, farthest = np.array(p.getBasePositionAndOrientation(robot)[0]), 0.0
            for _ in range(int(SECONDS * 240)):
                p.stepSimulation()
                now = np.array(p.getBasePositionAndOrientation(robot)[0])
                farthest = max(farthest, float(np.linalg.norm(now - start)))
            for joint in range(p.getNumJoints(robot)):
                servo = p.getJointInfo(robot, joint)[1].decode()
                assert p.getJointState(robot, joint)[0] == pytest.approx(pose[servo], abs=0.005)
        assert farthest < STILL


def test_the_hexapod_walks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "found.xml").write_text(mjcf(exported("hexapod_12")), encoding="utf-8")
    made: dict[str, Any] = {}
    exec(compile(WALK, "export.md", "exec"), made)
    body = made["data"].body("body")
    assert body.xpos[0] > 1.0
    assert body.xmat[8] > 0.99  # upright
    assert sum(bool(line.strip()) for line in WALK.splitlines()) <= 20
