"""``estimator export`` on runs of both methods, and the exported body as a robot."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from bench.daemons import simulator
from estimator.cli.command_line import app
from estimator.physics.base import WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.readings.observation import by_joint_name
from estimator.storage.store import RunStore
from protocol.transport.client import RobotClient
from sim_robot.world.body import load_body
from tests.estimator.evaluation.test_score import make_run
from tests.estimator.model_robot import (
    JOINTS,
    TRUE_LENGTHS,
    make_capabilities,
    make_problem,
    true_body,
)
from tests.estimator.posterior_run import make_posterior_run

LENGTHS = ((0.17, 0.15, 0.18, 0.16), (0.18, 0.15, 0.18, 0.16), (0.17, 0.14, 0.18, 0.16))


def export(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["export", *map(str, arguments)])


@pytest.fixture
def posterior_run(tmp_path: Path) -> Path:
    with make_posterior_run(tmp_path, LENGTHS):
        return tmp_path / "posterior"


def test_the_best_body_of_a_posterior_is_a_robot(posterior_run: Path, tmp_path: Path) -> None:
    path = tmp_path / "found.urdf"
    ended = export(posterior_run, "--format", "urdf", "--out", path)
    assert ended.exit_code == 0, ended.output
    assert ended.stdout == ""
    robot, problem = make_capabilities(), make_problem()
    body = true_body(problem, robot)
    program = (0.3, -0.4, -0.2, 0.25)
    with PyBulletPhysics(WorldSettings(step=1 / 240, steps=1200)) as physics:
        read = physics.read([(body, np.array(program))])
    with (
        simulator("--body", str(path), "--noise", "none") as process,
        RobotClient(process.uri, software="test") as client,
    ):
        assert [joint.name for joint in client.capabilities.joints] == list(JOINTS)
        assert client.capabilities.base_size == robot.base_size
        client.acquire()
        reply = client.perform(by_joint_name(program, client.capabilities))
    assert reply.tilt is not None
    tilt = [math.degrees(angle) for angle in reply.tilt if angle is not None]
    assert tilt == pytest.approx(np.degrees(read.tilt[0]), abs=0.6)  # 8-bit servos
    assert reply.clearance == pytest.approx(read.clearance[0], abs=0.003)
    assert reply.touch == tuple(read.touch[0].tolist())


def test_a_package_for_ros2_is_a_folder(posterior_run: Path, tmp_path: Path) -> None:
    assert export(posterior_run, "--format", "ros2", "--out", tmp_path / "src").exit_code == 0
    (package,) = (tmp_path / "src").iterdir()
    assert package.name == "model_description"
    body = load_body(package / "urdf" / "robot.urdf")
    assert [motor.name for motor in body.motors] == list(JOINTS)
    assert not body.notes
    (tmp_path / "file").touch()
    ended = export(posterior_run, "--format", "ros2", "--out", tmp_path / "file")
    assert ended.exit_code == 1
    assert "cannot be read or written" in ended.stderr


def test_any_sample_can_be_had(posterior_run: Path) -> None:
    for sample, lengths in enumerate(LENGTHS):
        found = json.loads(
            export(posterior_run, "--format", "json", "--sample", str(sample)).stdout
        )
        assert [link["joint"]["name"] for link in found["links"]] == list(JOINTS)
        tips = [link["far"] + link["radius"] for link in found["links"]]
        assert tips == pytest.approx(lengths)


def test_a_sample_that_there_is_not_is_refused(posterior_run: Path) -> None:
    ended = export(posterior_run, "--format", "json", "--sample", "99999")
    assert ended.exit_code == 1
    assert "there is no sample 99999: choose 0 to" in ended.stderr
    assert export(posterior_run, "--format", "stl").exit_code == 2
    nowhere = export(posterior_run, "--format", "ros2")
    assert nowhere.exit_code == 2
    assert "--out" in nowhere.stderr
    folder = export(posterior_run, "--format", "json", "--out", str(posterior_run))
    assert folder.exit_code == 2
    assert "directory" in folder.stderr


@pytest.mark.parametrize("form", ["urdf", "mjcf", "json"])
def test_the_best_model_of_the_papers_method(tmp_path: Path, form: str) -> None:
    make_run(tmp_path, TRUE_LENGTHS).close()
    ended = export(tmp_path / "run", "--format", form)
    assert ended.exit_code == 0, ended.output
    if form == "urdf":
        path = tmp_path / "model.urdf"
        path.write_text(ended.stdout, encoding="utf-8")
        assert [motor.name for motor in load_body(path).motors] == list(JOINTS)
    else:
        assert all(name in ended.stdout for name in JOINTS)


def test_a_run_without_a_model_is_refused(tmp_path: Path) -> None:
    store = make_run(tmp_path, TRUE_LENGTHS)
    store.close()
    settings = store.settings
    RunStore.create(tmp_path / "empty", settings, make_capabilities(), "me").close()
    ended = export(tmp_path / "empty", "--format", "urdf")
    assert ended.exit_code == 1
    assert "has no model yet" in ended.stderr
