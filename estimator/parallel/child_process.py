"""A child process that ends when its parent does."""

from __future__ import annotations

import ctypes
import os
from typing import Final

_PR_SET_PDEATHSIG: Final = 1  # Linux
_LIBC: Final = ctypes.CDLL(None)


def die_with(parent: int, signal_number: int) -> None:
    """Has the kernel send the calling process a signal when its parent dies; Linux only.

    Ends the process at once if the parent is dead already.

    Args:
        parent: Its parent's process id.
        signal_number: The signal.
    """
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal_number)
    if os.getppid() != parent:  # which has died already
        os._exit(1)
