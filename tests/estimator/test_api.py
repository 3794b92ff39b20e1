"""What a program gets from ``identify`` and ``resume``; ``docs/api.md`` has a whole run."""

from __future__ import annotations

from pathlib import Path

import pytest

from estimator import EstimatorError, Listener, identify, resume
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


def test_a_senseless_number_of_jobs_leaves_no_run_behind(tmp_path: Path) -> None:
    with pytest.raises(EstimatorError, match="jobs must be at least 1, not 0"):
        identify(tmp_path / "run", robot="tcp://127.0.0.1:1", problem="parametric", jobs=0)
    assert not (tmp_path / "run").exists()
