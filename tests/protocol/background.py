"""Calls that a test does not wait for, and the threads that clients keep."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")


def in_background(function: Callable[[], T]) -> Future[T]:
    """Calls a function in another thread; leaving a test does not wait for it."""
    pool = ThreadPoolExecutor(1)
    try:
        return pool.submit(function)
    finally:
        pool.shutdown(wait=False)


def links() -> int:
    """How many clients have an open link."""
    return sum(thread.name.startswith("link to") for thread in threading.enumerate())
