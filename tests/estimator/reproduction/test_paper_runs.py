"""One run on robots of its own, broken off wherever it can be."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from estimator.errors import RunDirectoryError
from estimator.identification.method import Listener
from estimator.readings.observation import Observation
from estimator.report.evaluations import SCORE, TRUTH, VALIDATION
from estimator.report.result import RESULT, Result
from estimator.reproduction.figure import FinishedRun
from estimator.reproduction.paper_runs import (
    PlannedRun,
    topological_runs,
)
from estimator.reproduction.robot_process import RobotProcess, catch_up
from estimator.storage.database import DATABASE, holds_run
from estimator.storage.records import Generation
from estimator.storage.store import RunStore
from tests.estimator.reproduction.conftest import TINY


class Breaking(Listener):
    """Ctrl-C after some pieces of work; never, unless told."""

    def __init__(self, after: int = -1) -> None:
        self.work = 0.0
        self._left = after

    def worked(self, work: float, what: str) -> None:
        self.work += work
        self._left -= 1
        if not self._left:
            raise KeyboardInterrupt


def history(run: PlannedRun, root: Path) -> tuple[list[Generation], list[Observation | None]]:
    """What must not depend on interruptions; wall time does."""
    with RunStore.open(run.directory(root), to_write=False) as store:
        generations = [
            Generation(
                number=item.number,
                iteration=item.iteration,
                errors=item.errors,
                best=item.best,
                counters=item.counters.model_copy(update={"wall_seconds": 0.0}),
            )
            for item in store.generations()
        ]
        felt = [item.observation for item in store.interactions()]
        felt += [item.observation for validation in store.validations.all() for item in validation]
    return generations, felt


@pytest.fixture(scope="module", autouse=True)
def few_predictions() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("estimator.reproduction.paper_runs.PREDICTIONS", 2)
        yield


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, body: str) -> Path:
    """Where a run is that nothing broke off."""
    (run,) = topological_runs(1, TINY)
    place = tmp_path_factory.mktemp("whole")
    (place / TRUTH).write_text(body)
    run.do(place, Listener())
    return place


def test_a_run_broken_off_everywhere_ends_as_one_that_never_was(
    topological: PlannedRun, root: Path, whole: Path
) -> None:
    assert topological.work_done(whole) == topological.work
    breaks, done = 0, 0.0
    while not topological.is_finished(root):
        try:
            topological.do(root, Breaking(after=breaks + 1))
        except KeyboardInterrupt:
            breaks += 1
            assert topological.work_done(root) > done
            done = topological.work_done(root)
    assert breaks == 4  # of 4 generations, then 2 predictions, twice, and 2 performances
    assert history(topological, root) == history(topological, whole)
    for name in (SCORE, VALIDATION):
        ours, theirs = (topological.directory(place) / name for place in (root, whole))
        assert ours.read_text() == theirs.read_text()
    results = [
        Result.model_validate_json((topological.directory(place) / RESULT).read_text())
        for place in (root, whole)
    ]
    assert results[0].best_models == results[1].best_models
    finished = FinishedRun.read(topological, root)
    assert len(finished.predictions) == 2
    assert len(finished.configurations_right(finished.generations[-1])) == 12


def test_what_is_damaged_or_of_another_version_is_written_again(
    topological: PlannedRun, tmp_path: Path, whole: Path
) -> None:
    root = tmp_path / "copy"
    shutil.copytree(whole, root)
    assert topological.is_finished(root)
    before = history(topological, root)
    damages = {SCORE: b'{"of": "another version"}', RESULT: b"{}", VALIDATION: b"\xff damaged"}
    for name, text in damages.items():
        file = topological.directory(root) / name
        sound = file.read_bytes()
        for content in (text, sound):
            file.write_bytes(content)
            assert topological.is_finished(root) == (content == sound), name
    for name, text in damages.items():
        (topological.directory(root) / name).write_bytes(text)
    topological.do(root, Breaking())
    assert topological.is_finished(root)
    assert history(topological, root) == before


def test_a_robot_that_feels_otherwise_is_noticed(topological: PlannedRun, root: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        topological.do(root, Breaking(after=1))
    with (
        RunStore.open(topological.directory(root), to_write=False) as store,
        RobotProcess(topological.seed + 1) as robot,
        pytest.raises(RunDirectoryError, match="does not read again"),
    ):
        catch_up(store, robot.uri)


def test_how_far_a_run_is(topological: PlannedRun, root: Path) -> None:
    assert not holds_run(topological.directory(root))
    assert topological.work_done(root) == 0
    breaking = Breaking(after=1)
    with pytest.raises(KeyboardInterrupt):
        topological.do(root, breaking)
    assert holds_run(topological.directory(root))
    assert topological.work_done(root) == breaking.work == 4


def test_of_a_run_that_cannot_be_read_nothing_is_done(topological: PlannedRun, root: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        topological.do(root, Breaking(after=1))
    file = topological.directory(root) / DATABASE
    with closing(sqlite3.connect(file, isolation_level=None)) as database:
        database.execute("UPDATE generations SET errors = '['")
    assert topological.work_done(root) == 0


def test_a_database_that_was_never_filled_is_no_beginning(
    topological: PlannedRun, root: Path
) -> None:
    directory = topological.directory(root)
    directory.mkdir(parents=True)
    sqlite3.connect(directory / DATABASE).close()
    (directory / DATABASE).touch()
    assert not holds_run(topological.directory(root))
    with pytest.raises(KeyboardInterrupt):
        topological.do(root, Breaking(after=1))
    assert holds_run(topological.directory(root))
