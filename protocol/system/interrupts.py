"""Ctrl-C where it has to wait."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Defers Ctrl-C until the block is over, which should be soon.

    Extension modules lose interrupts or turn them into errors of their own: Matplotlib's do both,
    and a module that is imported half may not be usable.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread is ever interrupted
        return
    met: list[int] = []
    kept = signal.signal(signal.SIGINT, lambda number, _: met.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, kept)
    if met:
        signal.raise_signal(signal.SIGINT)
