from __future__ import annotations

import json
from pathlib import Path

import pytest

from estimator.errors import RunDirectoryError
from estimator.reproduction.runs.ledger import Ledger
from estimator.reproduction.runs.plan import Budget


def test_sessions_are_kept_with_their_times(tmp_path: Path) -> None:
    for command in ("first", "second"):
        times = iter((100.0, 100.0, 103.0, 105.0, 105.0))
        clock = times.__next__
        with Ledger(tmp_path, Budget(), command=command, jobs=2, clock=clock) as ledger:
            ledger.note()
    kept = json.loads((tmp_path / "reproduction.json").read_text())
    assert [(item["command"], item["seconds"]) for item in kept["sessions"]] == [
        ("first", 5.0),
        ("second", 5.0),
    ]
    assert kept["budget"]["physics"] == "pybullet"


def test_another_budget_needs_another_directory(tmp_path: Path) -> None:
    with Ledger(tmp_path, Budget(interactions=3), command="", jobs=1):
        pass
    with pytest.raises(RunDirectoryError, match="interactions 3, not as in the paper"):
        Ledger(tmp_path, Budget(), command="", jobs=1)


def test_two_processes_do_not_share_a_directory(tmp_path: Path) -> None:
    with (
        Ledger(tmp_path, Budget(), command="", jobs=1),
        pytest.raises(RunDirectoryError, match="Another process works on"),
    ):
        Ledger(tmp_path, Budget(), command="", jobs=1)


def test_a_file_that_is_no_ledger_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "reproduction.json").write_text("[]")
    with pytest.raises(RunDirectoryError, match="no ledger"):
        Ledger(tmp_path, Budget(), command="", jobs=1)
