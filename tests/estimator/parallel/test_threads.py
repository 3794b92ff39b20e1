from __future__ import annotations

import threading

import pytest

from estimator.parallel.threads import Threads


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
