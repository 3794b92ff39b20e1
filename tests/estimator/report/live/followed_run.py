"""A run that is followed while it goes on."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

import pytest

from estimator.identification.method import Listener
from estimator.identification.run import identify
from estimator.readings.observation import Observation
from estimator.report.live import run_view
from estimator.report.live.run_view import RunFollower, RunView
from estimator.storage.run_config import MethodName
from estimator.workplaces import IN_THIS_PROCESS
from tests.estimator.little_effort import little_effort
from tests.estimator.model_robot import ModelRobot, changed, make_order, serving, without_plots

FollowedRun: TypeAlias = tuple[Path, list[RunView]]
"""A run directory, and how the run stood whenever something had happened."""


class Following(Listener):
    """Looks at the run whenever something has happened, as another process might."""

    def __init__(self, directory: Path, *, interrupt: bool) -> None:
        self.views: list[RunView] = []
        self._follower = RunFollower(directory)
        self._interrupt = interrupt

    def chosen(self, number: int, reason: str, bits: float | None) -> None:
        self.look()

    def observed(self, number: int, observation: Observation) -> None:
        self.look()

    def worked(self, work: float, what: str) -> None:
        self.look()
        if self._interrupt:
            raise KeyboardInterrupt

    def look(self) -> None:
        """Notes how the run stands, which must be news, and then no more."""
        view = self._follower.news()
        assert view is not None
        assert self._follower.news() is None
        self.views.append(view)


def follow_run(folder: Path, method: MethodName, *, interrupt: bool = False) -> list[RunView]:
    """Identifies a robot whose four legs have unknown lengths, in ``folder / "run"``.

    Returns:
        How it stood whenever something had happened, an interruption included.
    """
    with pytest.MonkeyPatch.context() as patch, little_effort(), serving(ModelRobot()) as uri:
        patch.setattr(run_view, "_AT_LEAST", 0.0)
        patch.setattr(run_view, "_IDLE", 0)
        patch.setattr(run_view, "_SILENT", 0.0)
        order = changed(make_order(folder, uri), method=method, explore="disagreement")
        following = Following(folder / "run", interrupt=interrupt)
        try:
            identify(folder / "run", order, IN_THIS_PROCESS, following, report=without_plots)
        except KeyboardInterrupt:
            assert interrupt
            following.look()
    return following.views
