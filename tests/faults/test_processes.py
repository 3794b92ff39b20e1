"""Faults of processes, computers and cables. They run side by side, for they mostly wait."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from tests.faults.matrix import PROCESSES
from tests.faults.scenarios import SCENARIOS

_AT_ONCE = 4
"""A servo board has 0.2 s for an answer, which an emulator needs a share of a processor for."""


@pytest.fixture(scope="module")
def ends() -> Iterator[Mapping[str, Future[None]]]:
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        yield {name: pool.submit(scenario) for name, scenario in SCENARIOS.items()}


@pytest.mark.parametrize("name", PROCESSES)
def test_the_robot_survives(name: str, ends: Mapping[str, Future[None]]) -> None:
    ends[name].result()
