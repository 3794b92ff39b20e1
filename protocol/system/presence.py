"""Whether there is a file."""

from __future__ import annotations

from pathlib import Path


def may_exist(path: Path) -> bool:
    """Whether a file is there, or may be: of one that nobody lets us see, opening it says why.

    ``Path.exists`` raises there, or says no, by the version of Python.
    """
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError:
        return True
    return True
