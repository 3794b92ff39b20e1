"""A run directory is followed while another process writes to it, and changes nothing there."""

from __future__ import annotations

import sqlite3
import threading
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from estimator.errors import RunDirectoryError
from estimator.report.live import run_view
from estimator.report.live.run_view import SHOWN, RunFollower, RunState
from estimator.storage.database import DATABASE
from estimator.storage.run_config import MethodName
from estimator.storage.store import RunStore
from tests.estimator.cli.test_command_line import unwritable
from tests.estimator.report.live.followed_run import FollowedRun, follow_run
from tests.estimator.report.made_runs import made_run


@pytest.mark.parametrize("method", ["paper", "posterior"])
def test_a_run_that_goes_on_is_shown_step_by_step(
    method: MethodName, followed: FollowedRun, tmp_path: Path
) -> None:
    directory, views = followed
    if method == "paper":
        directory, views = tmp_path / "run", follow_run(tmp_path, method)
    sentences = dict.fromkeys(view.progress.sentence.partition(",")[0] for view in views)
    ends = {
        "paper": "the best model is held against all readings",
        "posterior": "a simulator has the last word",
    }
    assert list(sentences) == [
        "interaction 1 of 2: the robot moves",
        "interaction 1 of 2: learning from it",
        "interaction 2 of 2: choosing a movement",
        "interaction 2 of 2: the robot moves",
        "interaction 2 of 2: learning from it",
        ends[method],
    ]
    assert {view.state for view in views[:-1]} == {RunState.GOES_ON}
    shares = [view.progress.share for view in views]
    assert shares == sorted(shares)
    first, last = views[0], views[-1]
    assert (first.best, first.bodies, first.pose) == (None, (), None)
    assert last.best is not None
    assert len(last.bodies) == {"paper": 8, "posterior": SHOWN}[method]
    assert last.pose is not None
    assert [item.reason[:16] for item in last.interactions] == ["its models diffe"] * 2
    follower = RunFollower(directory)
    end = follower.news()
    assert end is not None
    assert (end.state, end.progress.share) == (RunState.FINISHED, 1.0)
    assert follower.news() is None


def test_a_run_that_nobody_works_on_is_unfinished() -> None:
    with TemporaryDirectory() as name:  # pytest's own is closed to others
        folder = Path(name)
        folder.chmod(0o755)
        *views, last = follow_run(folder, "paper", interrupt=True)
        assert [view.state for view in views] == [RunState.GOES_ON] * 3
        assert last.state is RunState.INTERRUPTED  # though nothing was written since
        before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
        with unwritable(folder):
            view = RunFollower(folder / "run").news()
        assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before
    assert view is not None
    assert view.state is RunState.INTERRUPTED
    assert view.progress.share == pytest.approx(1 / 6)


def test_to_wait_for_the_writer_is_no_work_to_rest_from(tmp_path: Path) -> None:
    run = made_run(tmp_path / "run", "parametric", "paper", complete=False)
    RunFollower(run).news()  # with what libraries load late
    follower, begin = RunFollower(run), time.monotonic()
    writer = sqlite3.connect(run / DATABASE, check_same_thread=False)
    writer.execute("BEGIN EXCLUSIVE")
    threading.Timer(1.0, writer.close).start()
    assert follower.news() is not None
    assert time.monotonic() > begin + 1.0
    RunStore.open(run).close()  # which writes who has it
    while follower.news() is None:
        assert time.monotonic() < begin + 15.0


def test_a_run_that_was_away_for_a_moment_is_shown_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_view, "_AT_LEAST", 0.0)
    monkeypatch.setattr(run_view, "_IDLE", 0)
    run = made_run(tmp_path / "run", "parametric", "paper")
    follower = RunFollower(run)
    before = follower.news()
    away = run.rename(tmp_path / "away")
    with pytest.raises(RunDirectoryError, match="holds no run"):
        follower.news()
    away.rename(run)
    after = follower.news()
    assert before is not None
    assert after is not None
    assert after.state is before.state is RunState.FINISHED
    assert follower.news() is None


def test_a_damaged_run_and_none_are_sentences(tmp_path: Path) -> None:
    with pytest.raises(RunDirectoryError, match="holds no run"):
        RunFollower(tmp_path).news()
    (tmp_path / "run.sqlite").write_bytes(b"SQLite format 3\0" + bytes(5000))
    with pytest.raises(RunDirectoryError, match=r"is not a run: .* it is damaged"):
        RunFollower(tmp_path).news()
