"""A child process that ends when its parent does."""

from __future__ import annotations

import ctypes
import os
from typing import Final

_PR_SET_PDEATHSIG: Final = 1  # Linux
_LIBC: Final = ctypes.CDLL(None)


def die_with(parent: int, signal_number: int) -> None:
    """Called in a child: it gets a signal as soon as its parent dies, however that happens.

    Args:
        parent: Its parent's process id.
        signal_number: The signal.
    """
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal_number)
    if os.getppid() != parent:  # which has died already
        os._exit(1)
