"""Robots under test by the conformance suite, and what became of it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from protocol.conformance.suite import CheckResult, CheckStatus
from protocol.rules.robot_interface import Robot
from tests.protocol.conformance.spoilt import Fault, SpoiltServer


@contextmanager
def serving(robot: Robot, fault: Fault | None = None, **options: Any) -> Iterator[str]:
    options = {"bind": "tcp://127.0.0.1:*", "telemetry_rate": 20.0} | options
    server = SpoiltServer(robot, fault or Fault(), **options)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield server.endpoint
    finally:
        server.close()
        thread.join()


def failures(results: list[CheckResult]) -> list[str]:
    return [
        f"{', '.join(result.check.clauses)} {result.check.title}: {result.sentence}"
        for result in results
        if result.status is CheckStatus.FAILED
    ]


def skipped(results: list[CheckResult]) -> set[str]:
    return {result.sentence for result in results if result.status is CheckStatus.SKIPPED}


def quick_clock() -> float:
    """A transport clock on which a long silence is short."""
    return time.monotonic() * 25
