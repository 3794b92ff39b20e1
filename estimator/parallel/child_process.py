"""Processes that work for this one: Ctrl-C is not for them, and they end when it does.

A child of ours asks the kernel to be ended (``die_with``). One that another process started for us,
as a fork server does, has to watch for itself (``end_with_parent``).
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import Final

_PR_SET_PDEATHSIG: Final = 1  # Linux
_LIBC: Final = ctypes.CDLL(None)


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Processes that are started inside inherit that Ctrl-C in a terminal does not reach them."""
    resource_tracker.ensure_running()  # its own start would unblock them
    kept = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, kept)


def die_with(parent: int, signal_number: int) -> None:
    """Called in a child: it gets a signal as soon as its parent dies, however that happens.

    Args:
        parent: Its parent's process id.
        signal_number: The signal.
    """
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal_number)
    if os.getppid() != parent:  # which has died already
        os._exit(1)


def end_with_parent() -> None:
    """Called in a child: ends it when its parent is killed; it would wait for work for ever."""
    threading.Thread(target=_follow_parent, name="follow parent", daemon=True).start()


def silence_stdout() -> None:
    """Called in a child: engines print to stdout, which is ours."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)


def _follow_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
