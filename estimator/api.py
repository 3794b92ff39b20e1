"""Functions for programs: start and resume runs, and load what they know of the body."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from estimator.errors import EstimatorError
from estimator.identification.method import Listener
from estimator.identification.run import identify as identify_run
from estimator.identification.run import resume as resume_run
from estimator.posterior.fitted import FittedPosterior
from estimator.report.result import Result
from estimator.report.run_files import write_report
from estimator.storage.run_config import RunConfig
from estimator.storage.store import RunStore
from estimator.workplaces import Executors, on_this_computer
from protocol.text import command_line


def identify(
    directory: Path | str,
    config: RunConfig,
    *,
    keys: Path | None = None,
    jobs: int | None = None,
    executors: Executors | None = None,
    listener: Listener | None = None,
) -> Result:
    """Identifies a robot: acts, senses and models, again and again.

    Args:
        directory: Run directory, which is made; its files are those of ``estimator identify``.
        config: What is asked of the run. A class or function of your own has the name that its
            registry gave it: ``RunConfig(..., physics=BACKENDS.add(MyPhysics))``.
        keys: Key directory, where the robot asks for keys.
        jobs: Processor cores; default: 1. With more there are worker processes, which import the
            calling program: keep what it starts under ``if __name__ == "__main__":``.
        executors: Where the work is done, in place of ``jobs``; they stay open.
        listener: Hears what happens; default: nobody.

    Returns:
        What ``result.json`` holds.

    Raises:
        BodyschemaError: Something prevents the run; the message says what.
    """
    with _opened(jobs, executors) as opened:
        return identify_run(
            Path(directory),
            config,
            opened,
            listener or Listener(),
            keys=keys,
            report=write_report,
        )


def resume(
    directory: Path | str,
    *,
    robot: str | None = None,
    keys: Path | None = None,
    jobs: int | None = None,
    executors: Executors | None = None,
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
        executors: Where the work is done, in place of ``jobs``, as for ``identify``.
        listener: Hears what happens; default: nobody.

    Returns:
        What ``result.json`` holds.

    Raises:
        BodyschemaError: Something prevents the run; the message says what.
    """
    with _opened(jobs, executors) as opened:
        return resume_run(
            Path(directory),
            opened,
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


def _opened(jobs: int | None, executors: Executors | None) -> AbstractContextManager[Executors]:
    """Executors as a program asks for them; those of its own stay open."""
    if executors is None:
        return on_this_computer(1 if jobs is None else jobs)
    if jobs is not None:
        raise EstimatorError("give jobs or executors, not both: each says where the work is done")
    if not isinstance(executors, Executors):
        raise EstimatorError(
            f"executors must be estimator.Executors, not {executors!r}: estimator.on_workers makes "
            "them of an executor"
        )
    return nullcontext(executors)
