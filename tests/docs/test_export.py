"""``docs/after.md`` is true: exported bodies stand still, and the hexapod walks."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Iterator
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
from robot.service.daemon import describe
from sim_robot.simulator.electronics_sets import pc104
from sim_robot.world.body import load_body, shipped_bodies
from sim_robot.world.sensor_noise import NoiseLevels
from tests.docs.pages import blocks, section

IN_PYBULLET, WALK = blocks(section("after", "In a simulator"), "python")
PROBLEMS = {
    "quadruped": "topological-24",
    "plate": "tripod",
    "tripod": "tripod",
    "biped": "biped",
    "hexapod_12": "hexapod-12",
    "hexapod_18": "hexapod-18",
}
IN_BULLET = shipped_bodies() if os.environ.get("ALL_BODIES") else ("plate", "hexapod_12")
SECONDS = 20.0
SETTLING = 3.0  # until all joints are at their targets and the body lies
STILL = 1e-3  # m
ALIKE = 5e-4  # m by which heights in both engines may differ


def exported(name: str) -> Description:
    """The true body of a robot that ships, as its problem says it."""
    path = shipped_bodies()[name]
    robot = describe(pc104(load_body(path), NoiseLevels()))
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


def settled(model: mujoco.MjModel, pose: dict[str, float]) -> mujoco.MjData:
    """A body in MuJoCo that has taken a pose."""
    data = mujoco.MjData(model)
    for servo, angle in pose.items():
        data.ctrl[model.actuator(servo).id] = angle
    mujoco.mj_step(model, data, int(SETTLING / model.opt.timestep))
    return data


@pytest.mark.parametrize("name", shipped_bodies())
def test_in_mujoco_it_stands_still(name: str) -> None:
    body = exported(name)
    model = mujoco.MjModel.from_xml_string(mjcf(body))
    for pose in poses(body):
        data = settled(model, pose)
        start, farthest = data.qpos[:3].copy(), 0.0
        for servo, angle in pose.items():
            assert data.joint(servo).qpos[0] == pytest.approx(angle, abs=0.012)
        while data.time < SETTLING + SECONDS:
            mujoco.mj_step(model, data, 20)
            farthest = max(farthest, float(np.linalg.norm(data.qpos[:3] - start)))
        assert farthest < STILL


TRIAL = f"""
import json, sys
pose = json.loads(sys.argv[1])
command(pose)
for _ in range(int({SETTLING} * 240)):
    p.stepSimulation()
start, farthest = p.getBasePositionAndOrientation(robot)[0], 0.0
for _ in range(int({SECONDS} * 240)):
    p.stepSimulation()
    now = p.getBasePositionAndOrientation(robot)[0]
    farthest = max(farthest, sum((a - b) ** 2 for a, b in zip(now, start)) ** 0.5)
servos = {{p.getJointInfo(robot, j)[1].decode(): j for j in range(p.getNumJoints(robot))}}
misses = [abs(p.getJointState(robot, servos[name])[0] - angle) for name, angle in pose.items()]
print(json.dumps([farthest, max(misses), now[2]]))
"""


@pytest.mark.parametrize("name", IN_BULLET)
def test_in_pybullet_it_stands_still_and_as_high_as_in_mujoco(name: str, tmp_path: Path) -> None:
    body = exported(name)
    (tmp_path / "found.urdf").write_text(urdf(body), encoding="utf-8")
    (tmp_path / "trial.py").write_text(IN_PYBULLET + TRIAL, encoding="utf-8")
    for pose in poses(body):
        ended = subprocess.run(
            [sys.executable, "trial.py", json.dumps(pose)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
        )
        assert ended.returncode == 0, ended.stderr
        farthest, miss, height = json.loads(ended.stdout.splitlines()[-1])
        assert farthest < STILL
        assert miss < math.radians(0.3)
        in_mujoco = settled(mujoco.MjModel.from_xml_string(mjcf(body)), pose)
        assert height == pytest.approx(in_mujoco.qpos[2], abs=ALIKE)


def test_the_hexapod_walks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "found.xml").write_text(mjcf(exported("hexapod_12")), encoding="utf-8")
    made: dict[str, Any] = {}
    exec(compile(WALK, "after.md", "exec"), made)
    body = made["data"].body("body")
    assert body.xpos[0] > 1.0
    assert body.xmat[8] > 0.99  # upright
    assert sum(bool(line.strip()) for line in WALK.splitlines()) <= 20
