"""Studies of runs that only count, broken off in every way."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from estimator.cluster import Cluster
from estimator.errors import PhysicsError, RunDirectoryError
from estimator.identification.method import Listener
from estimator.reproduction.harness import (
    Completed,
    Progress,
    complete,
    directory,
    in_words,
    made_by,
)
from estimator.versions import commit
from protocol.system.files import replace_text


@dataclass(frozen=True)
class Count:
    """Counts as far as its work, on disk; ``ill`` is what goes wrong on the way."""

    name: str
    work: float = 3.0
    ill: str = ""

    def do(self, root: Path, listener: Listener) -> None:
        directory(self, root).mkdir(parents=True, exist_ok=True)
        with (directory(self, root) / "turns").open("a") as turns:
            turns.write("|")
        while (number := self.work_done(root)) < self.work:
            if self.ill == "fails":
                raise PhysicsError("no engine")
            if self.ill == "dies":
                os._exit(1)
            replace_text(self.file(root), str(number + 1))
            listener.say(f"{number + 1:.0f} of {self.work:.0f} with {shared_by(root)}")
            listener.worked(1, "")

    def is_finished(self, root: Path) -> bool:
        return self.work_done(root) >= self.work

    def work_done(self, root: Path) -> float:
        return float(self.file(root).read_text()) if self.file(root).exists() else 0.0

    def sentence(self, root: Path) -> str:
        return "counted"

    def file(self, root: Path) -> Path:
        return directory(self, root) / "count"


def shared_by(root: Path) -> str:
    return (root / "shared").read_text() if (root / "shared").exists() else "nothing"


class Hearing(Listener):
    def __init__(self) -> None:
        self.said: list[str] = []
        self.total = self.done = 0.0

    def say(self, sentence: str) -> None:
        self.said.append(sentence)

    def expect(self, work: float, done: float) -> None:
        self.total, self.done = work, done

    def worked(self, work: float, what: str) -> None:
        self.done += work


def ledger(root: Path) -> Any:
    return json.loads((root / "study.json").read_text())


def begun(root: Path, *runs: Count, done: float) -> None:
    """Runs that were broken off before, at another commit."""
    for run in runs:
        directory(run, root).mkdir(parents=True)
        run.file(root).write_text(str(done))
        (directory(run, root) / "made.json").write_text('{"commits": ["commit before"]}')
    (root / "study.json").write_text('{"asked": {}}')


RUNS = (Count("a/1"), Count("a/2", ill="fails"), Count("b", ill="dies"), Count("c", work=5.0))


def test_runs_are_done_and_what_fails_is_listed_and_tried_again(tmp_path: Path) -> None:
    hearing = Hearing()
    completed = complete(tmp_path, RUNS, hearing, jobs=2, command="make counts")
    assert completed.failures.keys() == {"a/2", "b"}
    assert completed.failures["a/2"] == "no engine"
    assert "3 worker processes died" in completed.failures["b"]
    assert hearing.total == hearing.done == 14
    assert "a/1: 3 of 3 with nothing" in hearing.said
    assert any(said.startswith("4/4 ") for said in hearing.said)
    assert any(said.endswith("left") for said in hearing.said)
    assert [session["command"] for session in ledger(tmp_path)["sessions"]] == ["make counts"]

    well = [Count(run.name, run.work) for run in RUNS]
    again = complete(tmp_path, well, hearing, jobs=1, command="again")
    assert not again.failures
    assert "2 of 4 runs are finished already." in hearing.said
    assert [(one.command, one.commit) for one in again.sessions] == [
        ("make counts", commit()),
        ("again", commit()),
    ]
    assert made_by(tmp_path, well) == f"Made at {commit()}."


def test_a_run_names_every_commit_that_had_a_part_in_it(tmp_path: Path) -> None:
    one, other, fresh = Count("one"), Count("other"), Count("fresh")
    begun(tmp_path, one, done=1)
    begun(tmp_path, other, done=0)  # broken off before anything was kept
    complete(tmp_path, [one, other, fresh], Listener(), jobs=1)
    said = made_by(tmp_path, [one, other, fresh])
    assert said == (
        f"Made: 1 of 3 runs at commit before, then {commit()}; 2 of 3 runs at {commit()}."
    )
    assert made_by(tmp_path, ()) == "Made: no run."


def study(root: Path, runs: Sequence[Count] = ()) -> Completed:
    return complete(
        root, runs, Listener(), jobs=1, asked={"seeds": "all"}, shared={"shared": lambda: "x"}
    )


def test_what_does_not_belong_together_is_refused(tmp_path: Path) -> None:
    root = tmp_path / "study"
    study(root)
    with pytest.raises(RunDirectoryError, match="with seeds all, not some: give another --out"):
        complete(root, (), Listener(), jobs=1, asked={"seeds": "some"})
    (root / "shared").write_text("y")
    with pytest.raises(RunDirectoryError, match="shared is not what it would be now"):
        study(root)
    (root / "study.json").write_text("[]")
    with pytest.raises(RunDirectoryError, match="no ledger"):
        study(root)
    (root / "study.json").unlink()
    (root / "runs").mkdir()
    with pytest.raises(RunDirectoryError, match=r"another version, without study\.json"):
        study(root)


class Meddling(Listener):
    def __init__(self, root: Path) -> None:
        self._root = root

    def expect(self, work: float, done: float) -> None:
        with pytest.raises(RunDirectoryError, match="Another process works on"):
            study(self._root)


def test_two_commands_do_not_share_a_directory(tmp_path: Path) -> None:
    complete(tmp_path, (), Meddling(tmp_path), jobs=1)


LONG = Count("long", work=1e9)
PROGRAM = f"""
from pathlib import Path
from estimator.identification.method import Listener
from estimator.reproduction.harness import complete
from {__name__} import LONG
if __name__ == "__main__":
    complete(Path("."), [LONG], Listener(), jobs=1)
"""


@pytest.mark.parametrize("broken_by", [signal.SIGINT, signal.SIGKILL])
def test_what_a_broken_off_run_has_on_disk_is_kept(tmp_path: Path, broken_by: int) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    process = subprocess.Popen(
        [sys.executable, "program.py"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while LONG.work_done(tmp_path) < 5 and process.poll() is None:
        time.sleep(0.01)
    if broken_by is signal.SIGINT:
        os.killpg(process.pid, broken_by)  # as a terminal does
    else:
        process.send_signal(broken_by)
    process.communicate(timeout=120)  # returns when the last process is gone
    done = LONG.work_done(tmp_path)
    assert done >= 5
    shorter = Count("long", work=done + 2)
    hearing = Hearing()
    complete(tmp_path, [shorter], hearing, jobs=1)
    assert hearing.said[0].startswith(f"long: {done + 1:.0f} of {done + 2:.0f}")


# --- a cluster ------------------------------------------------------------------------------------


def test_on_a_cluster_runs_are_done_in_turns_without_a_shared_folder(
    tmp_path: Path, connected: Cluster
) -> None:
    hearing = Hearing()
    runs = (Count("one"), Count("other", ill="fails"))
    completed = complete(
        *(tmp_path, runs, hearing),
        jobs=1,
        cluster=connected,
        shared={"shared": lambda: "what all see"},
        turn=0.0,
    )
    assert completed.failures == {"other": "no engine"}
    assert "one: 3 of 3 with what all see" in hearing.said
    assert hearing.done == hearing.total == 6
    assert [len((directory(run, tmp_path) / "turns").read_text()) for run in runs] == [3, 1]
    assert made_by(tmp_path, runs[:1]) == f"Made at {commit()}."


# --- progress -------------------------------------------------------------------------------------


def test_time_left_follows_the_pace_of_this_session_over_all_runs() -> None:
    now = 0.0
    heard = Hearing()
    progress = Progress(heard, {"one": 100, "two": 300}, {"one": 50}, clock=lambda: now)
    assert (heard.total, heard.done) == (400, 50)
    assert progress.seconds_left() is None
    now = 10.0
    progress.stands("two", 50)
    assert progress.seconds_left() == pytest.approx(60)  # 300 left, 5 a second
    now = 20.0
    progress.ended("one", "fine")
    assert progress.seconds_left() == pytest.approx(50)
    assert heard.said == ["1/2 one: fine; about 50 s left"]
    progress.stands("two", 400)
    progress.ended("two", "fine")
    assert heard.done == heard.total
    assert heard.said[-1] == "2/2 two: fine"


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.2, "about 1 s"), (75, "about 75 s"), (600, "about 10 min"), (7300, "about 2 h 02 min")],
)
def test_times_in_words(seconds: float, words: str) -> None:
    assert in_words(seconds) == words
