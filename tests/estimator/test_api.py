"""What a program gets from ``identify`` and ``resume``; ``docs/extending.md`` has a whole run."""

from __future__ import annotations

from concurrent.futures import Future
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from estimator import (
    BACKENDS,
    OBJECTIVES,
    RULES,
    Choice,
    EstimatorError,
    Listener,
    RunConfig,
    Situation,
    StaticsPhysics,
    identify,
    load,
    on_workers,
    resume,
)
from estimator.body.morphology import Array
from estimator.executors import ThisProcess
from estimator.readings.observation import Program
from estimator.storage.store import RunStore
from tests.estimator.model_robot import JOINTS, PROBLEM, ModelRobot, make_order, serving
from tests.estimator.outside_parts import WrongTouches


class Impatient(Listener):
    """Interrupts after the first piece of work."""

    def worked(self, work: float, what: str) -> None:
        raise KeyboardInterrupt


def asked(uri: str, folder: Path, **options: str) -> RunConfig:
    """A run of the method paper on the robot's own problem."""
    (folder / "legs.toml").write_text(PROBLEM)
    return RunConfig(
        robot=uri, problem=str(folder / "legs.toml"), method="paper", **cast(Any, options)
    )


def test_an_interrupted_run_goes_on_from_a_program(tmp_path: Path) -> None:
    run = tmp_path / "run"
    robot = ModelRobot()
    with serving(robot) as uri:
        with pytest.raises(EstimatorError, match="holds no run"):
            load(run)
        with pytest.raises(KeyboardInterrupt):
            identify(run, asked(uri, tmp_path), listener=Impatient())
        result = resume(str(run))
    population = load(str(run))
    assert population.best_body is not None
    assert population.predict((0.1,) * 4)[0].tilt.shape == (2,)
    assert (population.probability, population.attachments) == (None, ())
    assert np.unique(population.weights).size == 1
    assert len(population.observations) == 2
    assert result.complete
    assert len(robot.motions) == result.interactions == 2
    assert [leg.joint for leg in result.legs] == list(JOINTS)
    assert (run / "result.json").exists()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"population": 7}, "population\n.*must be even, not 7: members mate in pairs"),
        ({"method": "guessing"}, "method\n.*should be 'posterior' or 'paper'"),
        ({"sure": 2.0}, "sure\n.*less than or equal to 0.98"),
        ({"colour": "red"}, "colour\n.*not permitted"),
    ],
)
def test_what_no_run_can_be_asked_is_refused(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        RunConfig(robot="tcp://127.0.0.1:1", problem="parametric", **options)


class Slack(StaticsPhysics):
    """A physics of this program."""


def first(situation: Situation) -> Choice:
    """A rule of this program."""
    (program,), known = situation.random_programs(1), situation.posterior
    likely = [known.log_likelihood(felt.angles, felt).max() for felt in known.observations]
    return Choice(program=program, reason=f"its models have log-likelihoods {likely}")


def test_a_run_with_parts_of_a_program_goes_on_only_with_them(tmp_path: Path) -> None:
    run = tmp_path / "run"
    with serving(ModelRobot()) as uri:
        config = asked(uri, tmp_path, physics=BACKENDS.add(Slack), explore=RULES.add(first))
        with pytest.raises(KeyboardInterrupt):
            identify(run, config, listener=Impatient())
        BACKENDS._added.clear()  # as in a new process
        with pytest.raises(EstimatorError, match="test_api:Slack' is part of a program"):
            resume(run)
        BACKENDS.add(Slack)
        result = resume(run)
    assert (result.physics, result.explore) == (f"{__name__}:Slack", f"{__name__}:first")
    assert result.versions[result.physics] == "of the calling program"
    assert result.complete


GIVEN: object = None
AT_REST = (0.0,) * 4


def careless(situation: Situation) -> Choice:
    """A rule that gives ``GIVEN``."""
    return cast(Choice, GIVEN)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (Choice(program=(0.1, 0.2)), "must hold 4 targets, one for each joint"),
        (Choice(program=(20.0, 0, 0, 0)), r"gave 20 for joint 'left': .* rad, .* 1.0000"),
        (Choice(program=(0, float("nan"), 0, 0)), "gave nan for joint 'front'"),
        (Choice(program=cast(Program, "abcd")), "gave the program 'abcd': it must hold 4"),
        (None, "gave None: it must give a Choice"),
        (Choice(program=AT_REST, reason=cast(str, None)), "gave the reason None: it must be text"),
        (Choice(program=AT_REST, bits=cast(float, "few")), "gave 'few' bits: .* finite number"),
        (Choice(program=AT_REST, bits=float("nan")), "gave nan bits: .* finite number"),
    ],
)
def test_what_no_robot_can_perform_is_refused_before_it_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: object, sentence: str
) -> None:
    monkeypatch.setattr(f"{__name__}.GIVEN", given)
    run, robot = tmp_path / "run", ModelRobot()
    with serving(robot) as uri, pytest.raises(EstimatorError, match=sentence):
        identify(run, asked(uri, tmp_path, explore=RULES.add(careless)))
    assert not robot.motions
    with RunStore.open(run, to_write=False) as store:
        assert not store.interactions()


class Nonsense(WrongTouches):
    """An objective that knows no errors."""

    def terms(self, *args: Any) -> Array:
        return np.full(super().terms(*args).shape, np.nan)


def test_an_objective_that_gives_no_errors_is_refused(tmp_path: Path) -> None:
    run = tmp_path / "run"
    with (
        serving(ModelRobot()) as uri,
        pytest.raises(EstimatorError, match=r"Nonsense gave array\(\[nan.* for 8 models"),
    ):
        identify(run, asked(uri, tmp_path, objective=OBJECTIVES.add(Nonsense)))


def test_a_rule_may_give_an_array_and_numbers_of_numpy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = Choice(program=cast(Program, np.zeros(4)), bits=cast(float, np.float32(1.5)))
    monkeypatch.setattr(f"{__name__}.GIVEN", given)
    run = tmp_path / "run"
    with serving(ModelRobot()) as uri:
        result = identify(run, asked(uri, tmp_path, explore=RULES.add(careless)))
    assert result.complete
    with RunStore.open(run, to_write=False) as store:
        assert [item.bits for item in store.interactions()] == [1.5, 1.5]


class Counting(ThisProcess):
    """An executor of this program."""

    tasks = 0

    def submit(self, *task: Any, **named: Any) -> Future[Any]:
        self.tasks += 1
        return super().submit(*task, **named)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        raise AssertionError("it is the program that closes what it opened")


def test_the_work_is_done_by_an_executor_of_the_program(tmp_path: Path) -> None:
    workers = Counting()
    executors = on_workers(workers)
    with serving(ModelRobot()) as uri:
        order = make_order(tmp_path, uri)
        here = identify(tmp_path / "here", order)
        with pytest.raises(KeyboardInterrupt):
            identify(tmp_path / "there", order, executors=executors, listener=Impatient())
        begun = workers.tasks
        there = resume(tmp_path / "there", executors=executors)
    assert 0 < begun < workers.tasks
    assert there.complete
    assert (there.legs, there.simulations_run) == (here.legs, here.simulations_run)


def test_where_the_work_is_done_is_said_once_and_by_executors(tmp_path: Path) -> None:
    config = RunConfig(robot="tcp://127.0.0.1:1", problem="parametric")
    for jobs in (1, 2):
        with pytest.raises(EstimatorError, match="give jobs or executors, not both"):
            identify(tmp_path / "run", config, jobs=jobs, executors=on_workers(Counting()))
    with pytest.raises(EstimatorError, match=r"must be estimator\.Executors, not <.*Counting"):
        identify(tmp_path / "run", config, executors=cast(Any, Counting()))
    assert not (tmp_path / "run").exists()


def test_a_senseless_number_of_jobs_leaves_no_run_behind(tmp_path: Path) -> None:
    config = RunConfig(robot="tcp://127.0.0.1:1", problem="parametric")
    with pytest.raises(EstimatorError, match="jobs must be at least 1, not 0"):
        identify(tmp_path / "run", config, jobs=0)
    assert not (tmp_path / "run").exists()
