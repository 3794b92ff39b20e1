"""Executors of this computer: results, errors, deaths and interrupts."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Executor
from functools import partial
from multiprocessing import active_children
from multiprocessing.connection import Client, Listener
from pathlib import Path

import pytest

import estimator
from estimator.errors import PhysicsError, WorkerError
from estimator.executors import ThisProcess, Threads, WorkerProcesses

TWO = partial(WorkerProcesses, 2)


class Unportable(Exception):  # noqa: N818  what matters is that it cannot be unpickled
    def __init__(self, one: int, two: int) -> None:
        super().__init__(f"{one} and {two}")


def work(task: int) -> int:
    """1, 2, 3 … are doubled; 0 and less go wrong in different ways."""
    if task == 0:
        raise PhysicsError("no such task")
    if task == -1:
        raise Unportable(1, 2)
    if task == -2:
        os._exit(1)
    return 2 * task


def append(task: list[int]) -> list[int]:
    task.append(1)
    return task


def met(address: str, task: int) -> int:
    """Says that it is at work, and returns when it is let go."""
    with Client(address) as connection:
        connection.send(os.getpid())
        connection.recv()
    return task


def hold(address: str) -> None:
    """Goes on for ever, once it has said that it is at work."""
    met(address, 0)
    threading.Event().wait()


@pytest.mark.parametrize("make", [ThisProcess, TWO])
def test_results_are_in_order_and_tasks_are_copies(make: Callable[[], Executor]) -> None:
    task: list[int] = []
    with make() as workers:
        assert list(workers.map(math.sqrt, [1.0, 4.0, 9.0])) == [1.0, 2.0, 3.0]
        assert list(workers.map(work, [])) == []
        assert workers.submit(append, task).result() == [1]
        with pytest.raises(PhysicsError, match="no such task"):
            list(workers.map(work, [1, 0, 2]))
        assert workers.submit(work, 4).result() == 8
    assert task == []
    assert not active_children()


def test_processes_start_with_the_first_tasks_and_stay() -> None:
    with Listener() as listener, TWO() as workers:
        assert not active_children()
        futures = [workers.submit(met, listener.address, task) for task in (1, 2)]
        with listener.accept() as one, listener.accept() as other:
            pids = {one.recv(), other.recv()}
            for connection in (one, other):
                connection.send("go on")
        assert [future.result() for future in futures] == [1, 2]
        assert {process.pid for process in active_children()} == pids
        assert list(workers.map(work, range(1, 20))) == [2 * task for task in range(1, 20)]
        assert {process.pid for process in active_children()} == pids


def has_loaded(module: str) -> bool:
    return module in sys.modules


def test_processes_begin_with_what_they_need() -> None:
    with WorkerProcesses(1) as workers:
        for module in ("estimator.posterior.sampling.sampler", "numba", "estimator.preloaded"):
            assert workers.submit(has_loaded, module).result(), module


def test_processes_load_it_from_where_their_parent_does(tmp_path: Path) -> None:
    """A checkout beside an installation, for one."""
    (tmp_path / "estimator").symlink_to(Path(estimator.__path__[0]))
    script = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from estimator.executors import WorkerProcesses\n"
        "with WorkerProcesses(1) as workers:\n"
        '    file = \'__import__("sys").modules["estimator.preloaded"].__file__\'\n'
        "    print(workers.submit(eval, file).result())\n"
    )
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert done.stdout.strip() == str(tmp_path / "estimator" / "preloaded.py")


def test_errors_come_back_as_they_are_or_with_their_text() -> None:
    with WorkerProcesses(1) as workers:
        with pytest.raises(PhysicsError) as caught:
            workers.submit(work, 0).result()
        assert "in work" in str(caught.value.__cause__)
        with pytest.raises(WorkerError, match="Unportable: 1 and 2"):
            workers.submit(work, -1).result()


def test_a_task_that_kills_its_process_is_given_up_and_others_are_not() -> None:
    with TWO() as workers:
        one, other, last = (workers.submit(work, task) for task in (1, -2, 3))
        assert (one.result(), last.result()) == (2, 6)
        with pytest.raises(WorkerError, match="3 worker processes died of the same work"):
            other.result()


def test_processes_that_die_idle_or_are_interrupted_cost_nothing() -> None:
    with TWO() as workers:
        assert list(workers.map(work, [1, 2])) == [2, 4]
        for process in active_children():
            process.kill()
            process.join()
        assert list(workers.map(work, [3, 4])) == [6, 8]
        pids = {process.pid for process in active_children() if process.pid}
        for pid in pids:
            os.kill(pid, signal.SIGINT)
        assert list(workers.map(work, [5, 6])) == [10, 12]
        assert {process.pid for process in active_children()} == pids


@pytest.mark.parametrize("reason", [KeyboardInterrupt, PhysicsError])
def test_an_interrupt_ends_busy_processes_and_leaves_what_waits(
    reason: type[BaseException],
) -> None:
    with Listener() as listener, pytest.raises(reason), WorkerProcesses(1) as workers:  # noqa: PT012
        workers.submit(hold, listener.address)
        waiting = workers.submit(work, 1)
        with listener.accept() as connection:
            connection.recv()
            connection.send("go on")
        raise reason
    assert waiting.cancelled()
    assert not active_children()


def die_with_processes() -> None:
    """Kills this process while some of its workers are busy and some idle."""
    with Listener() as listener:
        workers = WorkerProcesses(3)
        for _ in range(3):
            workers.submit(met, listener.address, 1)
        connections = [listener.accept() for _ in range(3)]
        connections[0].recv()
        connections[0].send("go on")
        os.kill(os.getpid(), signal.SIGKILL)


class InterruptedCondition(threading.Condition):
    """Ctrl-C is pressed just as its lock is taken."""

    def __enter__(self) -> bool:
        taken = super().__enter__()
        signal.raise_signal(signal.SIGINT)
        return taken


def test_an_interrupt_while_a_task_is_handed_over_leaves_no_lock_taken() -> None:
    with WorkerProcesses(1) as workers:
        handed_over = InterruptedCondition(threading.Lock())
        semaphore = vars(workers._idle_semaphore)
        usual, semaphore["_cond"] = semaphore["_cond"], handed_over
        with pytest.raises(KeyboardInterrupt):
            workers.submit(math.sqrt, 4.0)
        semaphore["_cond"] = usual
        assert handed_over.acquire(blocking=False)  # else all threads would wait for it
        assert workers.submit(math.sqrt, 9.0).result() == 3.0


def test_processes_end_when_their_parent_is_killed() -> None:
    """The standard library tells of the semaphores that it cleans up after it, and nobody else."""
    script = f"from {__name__} import die_with_processes; die_with_processes()"
    command = [sys.executable, "-c", script]  # whose stderr is open as long as they live
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == -signal.SIGKILL
    said = done.stderr.splitlines()
    assert not said or ("leaked semaphore" in said[0] and len(said) == 2), done.stderr


def test_there_must_be_a_worker() -> None:
    with pytest.raises(WorkerError, match="at least 1, not 0"):
        WorkerProcesses(0)


# --- threads --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("jobs", "count", "fewest"), [(1, 7, 1), (3, 7, 1), (3, 2, 1), (4, 0, 1)])
def test_every_row_is_done_once_and_results_are_in_order(
    jobs: int, count: int, fewest: int
) -> None:
    with Threads(jobs) as threads:
        pieces = threads.share_out(range, count, fewest=fewest)
    assert [row for piece in pieces for row in piece] == list(range(count))


def test_few_rows_wake_nobody() -> None:
    with Threads(2) as threads:
        names = threads.share_out(lambda *_: threading.current_thread(), 199, fewest=100)
        assert names == [threading.main_thread()]
        assert len(threads.share_out(lambda *_: threading.current_thread(), 200, fewest=100)) == 2


def test_two_threads_work_at_once() -> None:
    together = threading.Barrier(2, timeout=10)
    with Threads(2) as threads:
        assert len(threads.share_out(lambda *_: together.wait(), 2, fewest=1)) == 2


def test_an_error_arrives_and_threads_can_be_closed_twice() -> None:
    threads = Threads(2)
    with pytest.raises(ZeroDivisionError):
        threads.share_out(lambda start, _: 1 // start, 4, fewest=1)
    threads.close()
    threads.close()
    assert threads.share_out(lambda start, end: end - start, 4, fewest=1) == [2, 2]
    threads.close()
