"""Poses on demand, from Python and from the command line, with a robot behind a real wire."""

from __future__ import annotations

import math
import re
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from estimator import EstimatorError, FittedPosterior, Goal, Observation, find_pose
from estimator.cli.command_line import app
from estimator.cli.use import identified
from estimator.physics.backends import BACKENDS
from estimator.physics.statics import StaticsPhysics
from estimator.storage.database import DATABASE
from estimator.storage.store import RunStore
from estimator.use.pose import SAFE, standing_on
from tests.estimator.evaluation.test_score import make_ended_run
from tests.estimator.model_robot import (
    TRUE_LENGTHS,
    ModelRobot,
    make_capabilities,
    make_posterior,
    make_problem,
    serving,
)
from tests.estimator.posterior_run import make_posterior_run

TRUTH = (np.array(TRUE_LENGTHS) - 0.05) / 0.2
SPREAD = 0.001  # m
ASKEW = math.radians(3.0)
"""How far the accelerometer of the robot behind the wire is turned, as its run has found."""


def sampled(count: int = 40, spread: float = SPREAD, reach: float = 0.2) -> FittedPosterior:
    genes = np.random.default_rng(1).normal(TRUTH, spread / 0.2, (count, 4))
    problem, capabilities = make_problem(), make_capabilities(reach)
    return make_posterior(problem, capabilities, np.clip(genes, 0, 1), best=TRUTH)


def test_what_the_robot_reads_somewhere_can_be_asked_for() -> None:
    """Readings of the true body at programs that nobody tells."""
    known, truth = sampled(), sampled(1, 0.0)
    rng, found = np.random.default_rng(2), 0
    low, high = truth.program_range.T
    for program in rng.uniform(low, high, (6, 4)):
        wanted = truth.predict(program)
        goal = Goal(
            tilt_left=wanted.tilt[0, 0],
            tilt_forward=wanted.tilt[0, 1],
            clearance=wanted.clearance[0],
            stand_on=frozenset(np.flatnonzero(wanted.touch[0]).tolist()) or None,
        )
        pose = find_pose(known, goal, rng)
        felt = truth.predict(pose.program)
        seen = Observation(
            angles=pose.program,
            touch=tuple(felt.touch[0].tolist()),
            tilt=tuple(felt.tilt[0].tolist()),
            clearance=felt.clearance[0],
        )
        assert not pose.reachable or goal.is_met_by(seen)
        found += goal.is_met_by(seen)
    assert found >= 5


def test_programs_are_made_of_steps_that_the_servos_can_take() -> None:
    known = sampled(8)
    pose = find_pose(known, Goal(clearance=0.05), np.random.default_rng(3))
    joint = known.capabilities.joints[0]
    steps = (np.array(pose.program) - joint.lower) / joint.resolution
    assert np.allclose(steps, np.round(steps), atol=1e-6)
    assert pose.margin > SAFE
    assert pose.clearance == pytest.approx(0.05, abs=0.002)


def test_a_pose_that_hardly_any_body_takes_is_not_reachable() -> None:
    """Nobody knows how to stand level on legs that may be 50 mm longer or shorter."""
    vague = sampled(40, spread=0.05)
    goal = Goal(tilt_left=0.0, tilt_forward=0.0, clearance=0.06)
    assert not find_pose(vague, goal, np.random.default_rng(4)).reachable
    assert not find_pose(sampled(), Goal(clearance=0.15), np.random.default_rng(4)).reachable


def test_the_highest_pose_is_higher_than_others() -> None:
    known = sampled(16)
    goal = Goal(tilt_left=0.0, tilt_forward=0.0, highest=True)
    pose = find_pose(known, goal, np.random.default_rng(5))
    low, high = known.program_range.T
    readings = known.predict(np.random.default_rng(6).uniform(low, high, (500, 4)))
    level = np.all(goal.misses(readings) <= 1, axis=0)
    assert pose.clearance > np.max(readings.clearance[level], initial=0.0)
    assert max(map(abs, pose.tilt)) < math.radians(0.6)


def test_nobody_is_asked_for_a_clearance_that_the_sensor_cannot_tell() -> None:
    """Up to its end, where all that is higher reads alike."""
    known, rng = sampled(4, reach=0.05), np.random.default_rng(4)
    assert find_pose(known, Goal(clearance=0.048), rng).clearance == pytest.approx(0.048, abs=2e-3)
    for clearance in (0.0485, 0.4):
        with pytest.raises(EstimatorError, match=r"sensor .* ends at 50 mm.* at most 48 mm"):
            find_pose(known, Goal(clearance=clearance), rng)


@pytest.mark.parametrize(
    ("wanted", "complaint"),
    [
        ({}, "no pose is asked for"),
        ({"highest": True, "clearance": 0.1}, "give one"),
        ({"stand_on": frozenset()}, "stands on something: give .* at least one touch sensor"),
        ({"stand_on": {"hip_left"}}, r"numbers of touch sensors.*\(\{0, 3\}\), not .*hip_left"),
        ({"stand_on": "front"}, "numbers of touch sensors.*, not 'front'"),
        ({"stand_on": (True, False, False, False)}, r"numbers of touch sensors.*, not \(True, "),
        ({"stand_on": {-1}}, r"numbers of touch sensors.*, not \{-1\}"),
        ({"stand_on": 3}, "numbers of touch sensors.*, not 3"),
        ({"tilt_forward": math.nan}, "tilt_forward of a pose is a finite number, not nan"),
        ({"tilt_left": -math.inf, "highest": True}, "tilt_left of a pose .* not -inf"),
        ({"clearance": math.inf}, "clearance of a pose is a finite number, not inf"),
    ],
)
def test_goals_that_are_none(wanted: dict[str, object], complaint: str) -> None:
    with pytest.raises(EstimatorError, match=complaint):
        Goal(**wanted)  # type: ignore[arg-type]


@pytest.mark.parametrize(("feet", "lacking"), [({9}, "9"), ({0, 4, 9}, "4, 9")])
def test_a_robot_stands_on_no_sensor_that_it_lacks(feet: set[int], lacking: str) -> None:
    complaint = f"has 4 touch sensors, numbered from 0 to 3: stand_on of a pose cannot be {lacking}"
    with pytest.raises(EstimatorError, match=complaint):
        find_pose(sampled(4), Goal(stand_on=frozenset(feet)), np.random.default_rng(7))


def test_a_reading_that_was_not_taken_does_not_meet_a_goal() -> None:
    seen = Observation(angles=(0.0,), touch=(True, None), clearance=0.05)
    assert Goal(clearance=0.0505).is_met_by(seen)
    assert not Goal(clearance=0.05, tilt_left=0.0).is_met_by(seen)
    for touch, met in (((True, False), True), ((True, None), False), ((None, False), False)):
        seen = Observation(angles=(0.0,), touch=touch)
        assert Goal(stand_on=frozenset([0])).is_met_by(seen) == met


def test_legs_are_named_by_their_joints() -> None:
    known = sampled(4)
    assert standing_on(known, ["left", "ba"]) == {0, 3}
    for name in ("knee", ""):
        with pytest.raises(EstimatorError, match="left, front, right, back"):
            standing_on(known, [name])
    with pytest.raises(EstimatorError, match="several legs"):
        standing_on(known, ["t"])


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rng = np.random.default_rng(1)
    lengths = [TRUE_LENGTHS, *map(tuple, rng.normal(TRUE_LENGTHS, SPREAD, (20, 4)).tolist())]
    with make_posterior_run(tmp_path_factory.mktemp("known"), lengths, askew=ASKEW) as store:
        return store.directory


def pose(run: Path, robot: str, *options: str) -> Result:
    return CliRunner().invoke(app, ["pose", str(run), "--robot", robot, "--jobs", "1", *options])


class OwnStatics(StaticsPhysics):
    """Stands for a back-end of a package."""


def test_what_is_known_of_a_run_is_predicted_by_its_physics(run: Path, tmp_path: Path) -> None:
    own = shutil.copytree(run, tmp_path / "own")
    with RunStore.open(own, to_write=False) as store:
        settings = store.settings.model_copy(update={"physics": BACKENDS.add(OwnStatics)})
    with closing(sqlite3.connect(own / DATABASE)) as database, database:
        text = settings.model_dump_json()
        database.execute("UPDATE meta SET value = ? WHERE key = 'settings'", (text,))
    for directory, physics in ((run, StaticsPhysics), (own, OwnStatics)):
        with identified(directory, 2) as (_, known):
            assert type(known.open_physics()) is physics


def test_the_robot_takes_the_pose_and_says_how_it_stands(run: Path) -> None:
    robot = ModelRobot(askew=ASKEW)
    with serving(robot) as uri:
        wanted = ("--tilt-forward", "5", "--tilt-left", "0", "--clearance", "55mm")
        planned = pose(run, uri, *wanted, "--dry-run")
        assert planned.exit_code == 0, planned.output
        assert not robot.motions
        assert pose(run, uri, *wanted).exit_code == 1  # nobody is there to be asked
        assert not robot.motions
        done = pose(run, uri, *wanted, "--yes")
    assert done.exit_code == 0, done.output
    assert len(robot.motions) == 1
    assert re.search(r"\d+% read so after it", done.stdout)
    for name, want, within in (("left side up", 0, 0.6), ("nose up", 5, 0.6), ("clearance", 55, 2)):
        (line,) = (one for one in done.stdout.splitlines() if one.startswith(name))
        numbers = [float(number) for number in re.findall(r"-?\d+\.\d", line)]
        assert numbers[0] == want
        assert numbers[2] == pytest.approx(want, abs=within)


def test_where_the_distance_sensor_ends_nobody_says_what_is_highest(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, robot=make_capabilities(0.05)) as store:
        directory = store.directory
    with serving(ModelRobot(reach=0.05)) as uri:
        done = pose(directory, uri, "--level", "--highest", "--yes")
    assert done.exit_code == 0, done.output
    (line,) = (one for one in done.stdout.splitlines() if one.startswith("clearance"))
    assert re.split(" {2,}", line)[1:] == ["highest", "at least 50.0 mm", "at least 50.0 mm"]
    assert "Note: the distance sensor ends at 50 mm, so other poses may be higher." in done.stdout


@pytest.mark.parametrize("misspecified", [0.0, 0.9])
def test_a_body_that_was_not_found_is_said_to_be_none(tmp_path: Path, misspecified: float) -> None:
    bodies = [TRUE_LENGTHS] * 3
    with make_posterior_run(tmp_path, bodies, misspecified=misspecified) as store:
        directory = store.directory
    planned = pose(directory, "tcp://127.0.0.1:1", "--clearance", "55mm", "--dry-run")
    assert planned.exit_code == 0, planned.output
    note = "Note: NO BODY THAT THIS PROBLEM ALLOWS is as probable as"
    assert planned.stdout.startswith(note) == bool(misspecified)


def test_a_population_is_no_set_of_bodies_that_the_robot_may_have(tmp_path: Path) -> None:
    with make_ended_run(tmp_path, TRUE_LENGTHS) as store:
        directory = store.directory
    for wanted, code in (("55mm", 0), ("15cm", 1)):
        planned = pose(directory, "tcp://127.0.0.1:1", "--clearance", wanted, "--dry-run")
        assert planned.exit_code == code, planned.output
        assert "f the population's models, " in planned.output
        assert "may have" not in planned.output


def test_a_goal_out_of_reach_is_a_sentence_with_what_comes_nearest(run: Path) -> None:
    robot = ModelRobot()
    with serving(robot) as uri:
        ended = pose(run, uri, "--clearance", "15cm", "--yes")
    assert ended.exit_code == 1
    assert "no motor program brings the robot there" in ended.stderr
    assert "predicted" in ended.stdout
    assert not robot.motions


@pytest.mark.parametrize(
    "options", [("--clearance", "high"), ("--level", "--tilt-left", "3"), ("--clearance", "5 ft")]
)
def test_what_cannot_be_read_is_a_usage_error(run: Path, options: tuple[str, ...]) -> None:
    assert pose(run, "tcp://127.0.0.1:1", *options).exit_code == 2
