"""One run from start to end, on a robot of its own, from wherever it stands on disk.

What it leaves beside the usual files of a run directory is ``validation.json``, where fresh motor
programs were predicted, and ``score.json``, which is written last. A run that has all of them is
finished; what another version wrote otherwise is written again.
"""

from __future__ import annotations

from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Final

from estimator.errors import InteractionError, RunDirectoryError
from estimator.evaluation.score import score
from estimator.evaluation.validate import compare, validate
from estimator.identification.listener import Listener
from estimator.identification.run import identify, reconnect, resume
from estimator.physics.backends import IN_THIS_PROCESS, in_this_process
from estimator.physics.statics import StaticsPhysics
from estimator.report.evaluation_files import SCORE, TRUTH, VALIDATION, read_validation
from estimator.report.run_files import write_report
from estimator.reproduction.runs.plan import PlannedRun
from estimator.reproduction.runs.robot_process import RobotProcess, catch_up
from estimator.reproduction.runs.run_summary import Summary
from estimator.storage.database import holds_run
from estimator.storage.store import RunStore
from protocol.errors import RobotUnreachableError
from protocol.system.files import replace_text

_ATTEMPTS: Final = 3

_write = partial(write_report, plots=False)


def is_finished(run: PlannedRun, root: Path) -> bool:
    """Whether a run has written all its files."""
    return Summary.read(run, root).failure is None


def has_begun(run: PlannedRun, root: Path) -> bool:
    """Whether a run has a database to resume from."""
    return holds_run(run.directory(root))


def work_done(run: PlannedRun, root: Path) -> float:
    """How much of a run's search is on disk, in simulations, as the run itself counts them."""
    if not has_begun(run, root):
        return 0.0
    try:
        store = RunStore.open(run.directory(root), to_write=False)
    except RunDirectoryError:
        return 0.0
    with store:
        length = store.settings.generations + 1
        return store.settings.population * sum(
            item.iteration + 1 if item.number % length else 1 for item in store.generations()
        )


def complete_run(run: PlannedRun, root: Path, listener: Listener) -> None:
    """Begins or resumes a run, and leaves it finished.

    A robot that fails is replaced by a new one, some times.

    Args:
        run: The run.
        root: The reproduction's directory, with the truth in it.
        listener: Hears what happens.

    Raises:
        BodyschemaError: Something prevents it; the message says what.
    """
    for attempt in range(1, _ATTEMPTS + 1):
        try:
            with RobotProcess(run.seed) as robot:
                _search_and_validate(run, root, robot.uri, listener)
            break
        except (InteractionError, RobotUnreachableError) as error:
            if attempt == _ATTEMPTS:
                raise
            listener.say(f"{run.name}: {error} A new robot is started.")
    _score(run, root)


def _search_and_validate(run: PlannedRun, root: Path, uri: str, listener: Listener) -> None:
    directory, quietly = run.directory(root), _WorkOnly(listener)
    if has_begun(run, root):
        with RunStore.open(directory, to_write=False) as store:
            catch_up(store, uri)
        resume(directory, IN_THIS_PROCESS, quietly, robot=uri, report=_write)
    else:
        identify(directory, run.order(uri), IN_THIS_PROCESS, quietly, report=_write)
    if run.predicts and read_validation(directory) is None:
        _validate(run, directory, uri, listener)


class _WorkOnly(Listener):
    """Passes on only how much work is done, in simulations, and nothing that is said.

    Args:
        listener: Who is told.
        unit: Simulations in a unit of work.
    """

    def __init__(self, listener: Listener, unit: float = 1.0):
        self._listener = listener
        self._unit = unit

    def worked(self, work: float, what: str) -> None:
        self._listener.worked(work * self._unit, what)


def _validate(run: PlannedRun, directory: Path, uri: str, listener: Listener) -> None:
    with RunStore.open(directory) as store:
        made = store.validations.all()
        seen = [item.observation for item in made[-1] if item.observation] if made else []
        if made and len(seen) == len(made[-1]):  # ended just before the file was written
            validation = compare(made[-1], seen)
        else:
            with (
                closing(in_this_process(store.settings.physics, store.world)) as physics,
                closing(reconnect(store, uri, listener)) as link,
            ):
                validation = validate(
                    store,
                    physics,
                    link,
                    programs=run.predicts,
                    listener=_WorkOnly(listener, store.settings.population / 2),
                )
    replace_text(directory / VALIDATION, validation.model_dump_json(indent=2) + "\n")


def _score(run: PlannedRun, root: Path) -> None:
    directory = run.directory(root)
    with (
        RunStore.open(directory, to_write=False) as store,
        StaticsPhysics(store.world) as physics,
        closing(in_this_process(store.settings.reference, store.world)) as reference,
    ):
        run_score = score(store, root / TRUTH, physics, reference)
    replace_text(directory / SCORE, run_score.model_dump_json(indent=2) + "\n")
