"""One run of the method posterior for all tests of the live page."""

from __future__ import annotations

import pytest

from tests.estimator.live.followed_run import FollowedRun, follow_run


@pytest.fixture(scope="package")
def followed(tmp_path_factory: pytest.TempPathFactory) -> FollowedRun:
    """A robot's four lengths, identified."""
    folder = tmp_path_factory.mktemp("followed")
    return folder / "run", follow_run(folder, "posterior")
