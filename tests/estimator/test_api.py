"""What a program gets from ``identify`` and ``resume``; ``docs/api.md`` has a whole run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from estimator import (
    BACKENDS,
    Choice,
    EstimatorError,
    Listener,
    Situation,
    StaticsPhysics,
    identify,
    resume,
)
from tests.estimator.model_robot import JOINTS, PROBLEM, ModelRobot, serving


class Impatient(Listener):
    """Interrupts after the first piece of work."""

    def worked(self, work: float, what: str) -> None:
        raise KeyboardInterrupt


def test_an_interrupted_run_goes_on_from_a_program(tmp_path: Path) -> None:
    (tmp_path / "legs.toml").write_text(PROBLEM)
    run, problem = tmp_path / "run", tmp_path / "legs.toml"
    robot = ModelRobot()
    with serving(robot) as uri:
        with pytest.raises(KeyboardInterrupt):
            identify(run, robot=uri, problem=problem, method="paper", listener=Impatient())
        result = resume(str(run))
    assert result.complete
    assert len(robot.motions) == result.interactions == 2
    assert [leg.joint for leg in result.legs] == list(JOINTS)
    assert (run / "result.json").exists()


class Slack(StaticsPhysics):
    """A physics of this program."""


def first(situation: Situation) -> Choice:
    """A rule of this program."""
    (program,) = situation.random_programs(1)
    error = (
        situation.objective.terms(
            situation.predict(program), situation.observations[-1].as_arrays(), situation.modalities
        )
        if situation.observations
        else np.zeros(1)
    )
    return Choice(program=program, reason=f"errs by {error.min():.1f}")


def test_a_run_with_parts_of_a_program_goes_on_only_with_them(tmp_path: Path) -> None:
    (tmp_path / "legs.toml").write_text(PROBLEM)
    run, problem = tmp_path / "run", tmp_path / "legs.toml"
    with serving(ModelRobot()) as uri:
        with pytest.raises(KeyboardInterrupt):
            identify(
                run,
                robot=uri,
                problem=problem,
                method="paper",
                physics=Slack,
                explore=first,
                listener=Impatient(),
            )
        BACKENDS._added.clear()  # as in a new process
        with pytest.raises(EstimatorError, match="test_api:Slack' is part of a program"):
            resume(run)
        with pytest.raises(EstimatorError, match=r"started with the physics .*Slack', not 'esti"):
            resume(run, physics=StaticsPhysics)
        result = resume(run, physics=Slack, explore=first)
    assert (result.physics, result.explore) == (f"{__name__}:Slack", f"{__name__}:first")
    assert result.versions[result.physics] == "of the calling program"
    assert result.complete


def test_a_senseless_number_of_jobs_leaves_no_run_behind(tmp_path: Path) -> None:
    with pytest.raises(EstimatorError, match="jobs must be at least 1, not 0"):
        identify(tmp_path / "run", robot="tcp://127.0.0.1:1", problem="parametric", jobs=0)
    assert not (tmp_path / "run").exists()
