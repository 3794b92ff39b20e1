"""Locks that give a directory to one process at a time."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from estimator.errors import RunDirectoryError


def lock(directory: Path, name: str) -> int:
    """Takes a directory's lock, which the kernel frees when its holder dies.

    Args:
        directory: The directory; made if it is not there.
        name: Of the lock's file.

    Returns:
        A descriptor; closing it frees the lock. On a file system without locks it locks nothing.

    Raises:
        RunDirectoryError: The directory cannot be made or written, or another process has it.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunDirectoryError(f"{directory} cannot be made: {error.strerror}.") from error
    try:
        descriptor = os.open(directory / name, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise RunDirectoryError(f"{directory} cannot be written: {error.strerror}.") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise RunDirectoryError(
            f"Another process works on {directory}: let it finish or end it first."
        ) from None
    except OSError:  # a file system without locks
        return descriptor
    return descriptor


def is_locked(directory: Path, name: str) -> bool:
    """Whether a process has a directory's lock; nothing is written to find out.

    The lock is taken for an instant, shared with whoever else asks: a process that wants it at just
    that moment is refused, so this is not to be asked often.
    """
    try:
        descriptor = os.open(directory / name, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # a file system without locks
        return False
    finally:
        os.close(descriptor)
    return False
