"""What holds for all tests."""

from __future__ import annotations

import gc
import logging
import signal
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

from robot.host.logs import LineHandler

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# A shell starts what runs in the background with Ctrl-C ignored, nohup what it runs with a closed
# terminal ignored, and children inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)

# No verdict may hang on how fast a machine is: pytest's time limit is for what hangs.
settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")


# Their tests wait for runs that are made one after the other: begun last, they end last, and alone.
# What is begun first no other worker takes over, which would start a cluster of its own.
_FIRST = (
    *("test_reproduce.py", "test_readme.py", "test_interruptions.py", "test_soak.py"),
    *("test_cluster.py", "test_runs_on_cluster.py"),
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Puts the longest files first."""
    items.sort(key=lambda item: item.path.name not in _FIRST)


def pytest_collection() -> None:
    """Nothing of what is collected is garbage."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Thousands of tests live until the end: nobody need look again whether they are garbage."""
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True)
def log_as_it_was() -> Iterator[None]:
    """A daemon's command that a test calls in this process logs to its standard error for good."""
    root = logging.getLogger()
    level = root.level
    yield
    root.setLevel(level)
    for handler in [one for one in root.handlers if isinstance(one, LineHandler)]:
        root.removeHandler(handler)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Not for the whole session: while it runs, its event loop is this thread's."""
    from tests.browser import chromium

    with chromium() as running:
        yield running
