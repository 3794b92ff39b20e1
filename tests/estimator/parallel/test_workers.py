"""Work that is shared out, and what workers load before there is any."""

import math
from contextlib import closing
from functools import partial
from operator import methodcaller
from pathlib import Path

import pytest

from estimator.errors import WorkerError
from estimator.parallel.workers import LocalWorkers, ThisProcess, Workers


@pytest.mark.parametrize("open_workers", [ThisProcess, partial(LocalWorkers, 2)])
def test_results_are_in_order(open_workers: type[Workers]) -> None:
    with closing(open_workers()) as workers:
        workers.prepare(Path.cwd)
        assert workers.map(math.sqrt, [1.0, 4.0, 9.0]) == [1.0, 2.0, 3.0]


def test_what_is_prepared_is_loaded_once_in_each_worker(tmp_path: Path) -> None:
    loaded = tmp_path / "loaded"
    loaded.mkdir()
    with closing(LocalWorkers(1)) as workers:
        workers.prepare(partial((loaded / "once").mkdir))
        assert workers.map(methodcaller("exists"), [loaded / "once"]) == [True]
        assert workers.map(methodcaller("exists"), [loaded / "once", loaded]) == [True, True]


def test_what_cannot_be_loaded_is_told_with_the_first_task() -> None:
    with closing(LocalWorkers(1)) as workers:
        workers.prepare(partial(int, "no number"))
        with pytest.raises((ValueError, WorkerError), match="no number"):
            workers.map(math.sqrt, [1.0])


def test_there_must_be_a_worker() -> None:
    with pytest.raises(WorkerError, match="at least one worker process, not 0"):
        LocalWorkers(0)
