from __future__ import annotations

import pytest

from estimator.identification.listener import Listener
from estimator.reproduction.runs.plan import Budget, topological_runs
from estimator.reproduction.runs.progress import OverallProgress, in_words

ONE, TWO = topological_runs(2, Budget())


class Heard(Listener):
    def __init__(self) -> None:
        self.total = 0.0
        self.done = 0.0
        self.said: list[str] = []

    def expect(self, work: float, done: float) -> None:
        self.total, self.done = work, done

    def worked(self, work: float, what: str) -> None:
        self.done += work

    def say(self, sentence: str) -> None:
        self.said.append(sentence)


def test_time_left_follows_the_pace_of_this_session_over_all_runs() -> None:
    now = 0.0
    heard = Heard()
    progress = OverallProgress(heard, {ONE: 100, TWO: 300}, {ONE: 50}, clock=lambda: now)
    assert (heard.total, heard.done) == (400, 50)
    assert progress.seconds_left() is None
    now = 10.0
    progress.worked(TWO, 50)
    assert progress.seconds_left() == pytest.approx(60)  # 300 left, 5 a second
    now = 20.0
    progress.ended(ONE, "fine")
    assert progress.seconds_left() == pytest.approx(50)
    assert heard.said == [f"1/2 {ONE.name}: fine; about 50 s left"]
    progress.ended(TWO, "fine")
    assert heard.done == heard.total
    assert heard.said[-1] == f"2/2 {TWO.name}: fine"


def test_more_work_than_was_expected_does_not_overflow() -> None:
    heard = Heard()
    progress = OverallProgress(heard, {ONE: 100}, {})
    progress.worked(ONE, 150)
    assert heard.done == 100


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.2, "about 1 s"), (75, "about 75 s"), (600, "about 10 min"), (7300, "about 2 h 02 min")],
)
def test_times_in_words(seconds: float, words: str) -> None:
    assert in_words(seconds) == words
