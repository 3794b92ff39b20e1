"""Worker processes: tasks, messages, errors and deaths."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from multiprocessing import active_children

import pytest

from estimator.errors import PhysicsError, WorkerError
from estimator.parallel.worker_processes import Raised, Returned, Work, WorkerProcesses

Workers = WorkerProcesses[int, str, int]


class Unportable(Exception):  # noqa: N818  what matters is that it cannot be unpickled
    def __init__(self, one: int, two: int) -> None:
        super().__init__(f"{one} and {two}")


def work(task: int, tell: Callable[[str], None]) -> int:
    """1, 2, 3 … are doubled; 0 and less go wrong in different ways."""
    tell(f"task {task}")
    if task == 0:
        raise PhysicsError("no such task")
    if task == -1:
        raise Unportable(1, 2)
    if task == -2:
        os._exit(1)
    return 2 * task


def start() -> Work[int, str, int]:
    return work


def start_late() -> Work[int, str, int]:
    raise PhysicsError("no engine")


@pytest.fixture
def workers() -> Iterator[Workers]:
    with WorkerProcesses(start, 2) as processes:
        yield processes
    assert not active_children()


def test_results_are_in_order_and_workers_stay(workers: Workers) -> None:
    assert workers.results(range(1, 8)) == [2, 4, 6, 8, 10, 12, 14]
    pids = {worker.pid for worker in active_children()}
    assert workers.results([5]) == [10]
    assert workers.results([]) == []
    assert {worker.pid for worker in active_children()} == pids
    assert len(pids) == 2
    workers.close()
    assert not active_children()
    assert workers.results([3]) == [6]


def test_workers_may_start_before_there_is_work(workers: Workers) -> None:
    workers.start()
    pids = {worker.pid for worker in active_children()}
    assert len(pids) == 2
    assert workers.results([1, 2, 3]) == [2, 4, 6]
    assert {worker.pid for worker in active_children()} == pids


def test_messages_come_before_results(workers: Workers) -> None:
    events = list(workers.do([7]))
    assert events == [(0, "task 7"), (0, Returned(14))]


def test_errors_come_back_with_the_workers_traceback(workers: Workers) -> None:
    with pytest.raises(PhysicsError, match="no such task") as caught:
        workers.results([0])
    (note,) = caught.value.__notes__
    assert note.startswith("In a worker process:\n")
    assert "in work" in note
    with pytest.raises(WorkerError, match="Unportable: 1 and 2"):
        workers.results([-1])


def test_a_task_that_kills_its_workers_is_given_up_and_others_are_not(workers: Workers) -> None:
    last = {index: event for index, event in workers.do([1, -2, 3]) if not isinstance(event, str)}
    assert (last[0], last[2]) == (Returned(2), Returned(6))
    assert isinstance(last[1], Raised)
    assert "3 worker processes died of the same work" in str(last[1].error)


def test_a_worker_that_dies_idle_costs_nothing(workers: Workers) -> None:
    workers.results([1, 2])
    for worker in active_children():
        worker.kill()
        worker.join()
    events = list(workers.do([7]))
    assert events == [(0, "task 7"), (0, Returned(14))]


def test_breaking_off_ends_only_the_busy(workers: Workers) -> None:
    workers.results([1, 2])
    with closing(workers.do([1])) as events:
        next(events)
    assert len(active_children()) == 1


@pytest.mark.parametrize("begin", [start_late, partial(int, "no number")])
def test_what_goes_wrong_at_the_start_is_told(begin: Callable[[], Work[int, str, int]]) -> None:
    with (
        WorkerProcesses(begin, 1) as processes,
        pytest.raises((PhysicsError, ValueError), match=r"no engine|invalid literal"),
    ):
        processes.results([1])


def talk(task: int, tell: Callable[[str], None]) -> int:
    """Says as many things as the task's number."""
    for number in range(task):
        tell(f"thing {number}")
    return task


def start_talking() -> Work[int, str, int]:
    return talk


def die_with_workers() -> None:
    """Kills this process while some workers talk and others have ended, unheard."""
    workers = WorkerProcesses[int, str, int](start_talking, 8)
    workers.results([0] * 8)
    with closing(workers.do([100, 10**6] * 4)) as events:
        for _ in range(100):
            next(events)
        os.kill(os.getpid(), signal.SIGKILL)


def test_workers_of_a_process_that_is_killed_end_without_a_word() -> None:
    script = f"from {__name__} import die_with_workers; die_with_workers()"
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (-signal.SIGKILL, "")
