"""Robots that are built otherwise than their problem says: they are, and what is said of them."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from bench.power.built import BUILT, built_trials, standing_body
from bench.power.robots import Robot
from bench.power.tables import built_rows, overview, write_tables
from bench.power.trial import Figures, Step, Trial
from estimator.parameters.rows import table_of
from estimator.problem.problem import Problem
from robot.configuration.calibration_file import read_calibration
from robot.configuration.robot_config import read_config
from sim_robot.world.body import Body, load_body

as_stated = partial(standing_body, "topological")
TRIALS = {trial.name: trial for trial in built_trials(tuple(range(30)))}
AS_BUILT = TRIALS["as people build them"]


def built(robot: Robot, seed: int, folder: Path) -> Body:
    path = folder / "body.urdf"
    path.write_text(robot.body(seed), encoding="utf-8")
    return load_body(path)


def masses(body: Body) -> list[float]:
    return [link.mass for link in body.robot.links[1:]]


def test_a_robot_as_people_build_it_has_other_parts_of_the_same_lengths(tmp_path: Path) -> None:
    ratios = []
    for seed in range(40):
        stated = tmp_path / "stated.urdf"
        stated.write_text(as_stated(seed), encoding="utf-8")
        known, other = load_body(stated), built(AS_BUILT.robot, seed, tmp_path)
        ratios.append([motor.radius / 0.006 for motor in other.motors if motor.radius])
        factors = np.array(masses(other)) / np.array(masses(known))
        assert factors.max() / factors.min() < 1.1  # thicker parts are no heavier
    spread = np.log(ratios)
    assert spread.mean(axis=1).std() == pytest.approx(0.25, abs=0.08)
    assert spread.std(axis=1).mean() == pytest.approx(0.05, abs=0.02)


def test_the_daemon_of_such_a_robot_states_what_the_problem_does(tmp_path: Path) -> None:
    for name in ("as people build them", "bars of 5 mm called 7.5", "rods of 13 mm called 6"):
        trial = TRIALS[name]
        seed = trial.seeds[0]
        trial.robot.write_files(tmp_path, seed)
        config, _ = read_config(tmp_path / "robot.toml")
        radius = (
            float(Problem.parse(trial.problem, "its problem").parts[0].radius)
            if ("\n" in trial.problem)
            else 0.006
        )
        assert {joint.part_radius for joint in config.joints} == {radius}
        body = built(trial.robot, seed, tmp_path)
        assert [foot.name for foot in config.touch] == list(body.touch)
        assert all(motor.radius != radius for motor in body.motors)
    calibration = read_calibration(tmp_path / "calibration.toml", range(1, 256))
    assert len(calibration.joints) == 4


def test_heavy_legs_weigh_as_many_times_as_much(tmp_path: Path) -> None:
    robot = TRIALS["legs 3.5 times as heavy"].robot
    stated = tmp_path / "stated.urdf"
    stated.write_text(as_stated(3), encoding="utf-8")
    heavy = np.array(masses(built(robot, 3, tmp_path)))
    np.testing.assert_allclose(heavy / masses(load_body(stated)), 3.5)
    assert robot.otherwise is not None
    assert robot.otherwise.amount == pytest.approx(math.log(3.5))


@pytest.mark.parametrize("trial", TRIALS.values(), ids=TRIALS)
def test_what_is_otherwise_is_a_row_of_the_table(trial: Trial) -> None:
    true = trial.robot.otherwise
    if true is None or not true.cause:
        return
    text = trial.problem
    problem = Problem.parse(text, "") if "\n" in text else Problem.load(text)
    names = [row.name for row in table_of(problem.outlines, problem.sensors)]
    assert any(name.startswith(true.cause) for name in names)


def figures(seed: int, causes: tuple[tuple[str, float], ...], amount: float) -> Figures:
    step = Step(
        probability=0.97,
        explained=True,
        cells=12,
        leg_errors_mm=(1.0, -1.0),
        inside=(True, True),
        widths_mm=(16.0, 16.0),
        stated_widths_mm=(9.0, 9.0),
        causes=causes,
        amounts={name: (amount - 0.1, amount + 0.1) for name, _ in causes},
        cpu_seconds=20.0,
    )
    return Figures(
        seed=seed,
        cpu_seconds=20.0,
        simulations=1000,
        explained=True,
        verdict="Some body explains it.",
        cells=12,
        steps=(step,),
    )


def test_the_tables_say_whether_the_cause_was_named_and_its_amount_held(tmp_path: Path) -> None:
    trial = TRIALS["hinge of the left leg turned by 30°"]
    true, other = "hinge of leg 1 about its own length", "zero of leg 1"
    runs = [
        figures(1, ((true, 0.9),), math.radians(30)),
        figures(2, ((other, 0.5), (true, 0.4)), math.radians(20)),
        figures(3, ((true, 0.3),), math.radians(30)),  # too improbable to be said
        figures(4, ((other, 0.9),), math.radians(30)),
        figures(5, (), 0.0).model_copy(update={"steps": (), "verdict": "Refused."}),
    ]
    rows = list(built_rows([(trial, runs)]))
    assert [row[10] for row in rows] == ["yes", "yes", "no", "no", "–"]
    assert [row[11] for row in rows] == ["yes", "no", "yes", "no", "–"]
    assert {len(row) for row in rows} == {15}
    text = overview({BUILT: [(trial, runs)]}, "Made at commit 1.")
    assert "| 4 of 5 | 5 | 4 | 4 | 0 | 8 of 8 | 8.0; 4.5 | 2 of 4 | 2 of 4 | 20 |" in text
    write_tables({BUILT: [(trial, runs)]}, tmp_path, "commit 1")
    lines = (tmp_path / "built.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 6
    assert lines[1].endswith("Some body explains it.,commit 1")
