"""What a process holds and shares: what has to be closed, Ctrl-C, C output, sockets at a fork."""

from __future__ import annotations

import ctypes
import os
import signal
import socket
import sys
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, Self
from weakref import WeakSet


class Closable(ABC):
    """Holds threads, sockets or processes until it is closed; a context manager."""

    @abstractmethod
    def close(self) -> None:
        """Releases everything; idempotent."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Defers Ctrl-C until the block is over, which should be soon.

    Extension modules lose interrupts or turn them into errors of their own: Matplotlib's do both,
    and a module that is imported half may not be usable.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread is ever interrupted
        return
    interrupts: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
    if interrupts:
        signal.raise_signal(signal.SIGINT)


@contextmanager
def native_output_discarded() -> Iterator[None]:
    """Discards what the process, C code included, prints to standard output and error.

    Physics engines print there; file descriptors 1 and 2 lead nowhere until the block is over.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    copies = [os.dup(1), os.dup(2)]
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 1)
        os.dup2(null, 2)
        yield
    finally:
        ctypes.CDLL(None).fflush(None)  # C buffers what it prints, maybe until the process ends
        for number, copy in enumerate(copies, start=1):
            os.dup2(copy, number)
            os.close(copy)
        os.close(null)


_our_sockets: Final[WeakSet[socket.socket]] = WeakSet()


def kept_from_children(ours: socket.socket) -> socket.socket:
    """Returns the socket, now to be closed in every process that this one forks."""
    _our_sockets.add(ours)
    return ours


def _close() -> None:
    for sock in tuple(_our_sockets):
        sock.close()


os.register_at_fork(after_in_child=_close)
