"""Functions for programs: start and resume runs, and load what they know of the body."""

from __future__ import annotations

from pathlib import Path

from estimator.errors import EstimatorError
from estimator.identification.method import Listener
from estimator.identification.run import identify as identify_run
from estimator.identification.run import resume as resume_run
from estimator.physics.backends import on_this_computer
from estimator.posterior.fitted import FittedPosterior
from estimator.report.result import Result
from estimator.report.run_files import write_report
from estimator.storage.run_config import RunConfig
from estimator.storage.store import RunStore
from protocol.text import command_line


def identify(
    directory: Path | str,
    config: RunConfig,
    *,
    keys: Path | None = None,
    jobs: int = 1,
    listener: Listener | None = None,
) -> Result:
    """Identifies a robot: acts, senses and models, again and again.

    Args:
        directory: Run directory, which is made; its files are those of ``estimator identify``.
        config: What is asked of the run. A class or function of your own has the name that its
            registry gave it: ``RunConfig(..., physics=BACKENDS.add(MyPhysics))``.
        keys: Key directory, where the robot asks for keys.
        jobs: Processor cores. With more than 1 there are worker processes, which import the calling
            program: keep what it starts under ``if __name__ == "__main__":``.
        listener: Hears what happens; default: nobody.

    Returns:
        What ``result.json`` holds.

    Raises:
        BodyschemaError: Something prevents the run; the message says what.
    """
    with on_this_computer(jobs) as executors:
        return identify_run(
            Path(directory),
            config,
            executors,
            listener or Listener(),
            keys=keys,
            report=write_report,
        )


def resume(
    directory: Path | str,
    *,
    robot: str | None = None,
    keys: Path | None = None,
    jobs: int = 1,
    listener: Listener | None = None,
) -> Result:
    """Continues an interrupted run to its end, as if it had not been interrupted.

    Classes and functions of your own with which the run was started must be added to their
    registries before, as they were then.

    Args:
        directory: The run directory.
        robot: Where the robot is now; default: where it was.
        keys: Key directory, where the robot asks for keys; a run does not remember it.
        jobs: Processor cores, as for ``identify``; the result does not depend on them.
        listener: Hears what happens; default: nobody.

    Returns:
        What ``result.json`` holds.

    Raises:
        BodyschemaError: Something prevents the run; the message says what.
    """
    with on_this_computer(jobs) as executors:
        return resume_run(
            Path(directory),
            executors,
            listener or Listener(),
            robot=robot,
            keys=keys,
            report=write_report,
        )


def load(directory: Path | str) -> FittedPosterior:
    """Loads what a run, finished or not, knows of the robot's body.

    A physics of your own with which the run was started must be added to ``BACKENDS`` before.

    Args:
        directory: The run directory.

    Returns:
        The posterior; for a run of the method ``paper``, its population.

    Raises:
        BodyschemaError: There is no run, it is damaged, or nothing was learnt yet.
    """
    with RunStore.open(Path(directory), to_write=False) as store:
        fitted = FittedPosterior.of(store)
    if fitted is None:
        raise EstimatorError(
            f"{directory} has no model yet: go on with "
            f"`{command_line('estimator', 'resume', directory)}` first"
        )
    return fitted
