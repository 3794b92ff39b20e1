"""What else is in ``/dev`` when a device file is not there, or not ours to use."""

from __future__ import annotations

import grp
import os
import re
from pathlib import Path


def others_like(path: str) -> list[str]:
    """The device files beside a path whose names differ from its own in their number alone."""
    wanted = Path(path)
    stem = wanted.name.rstrip("0123456789")
    try:
        names = os.listdir(wanted.parent)
    except OSError:
        return []
    numbers = [
        int(name[len(stem) :]) for name in names if re.fullmatch(rf"{re.escape(stem)}\d+", name)
    ]
    return [str(wanted.with_name(f"{stem}{number}")) for number in sorted(numbers)]


def group_of(path: str, usual: str) -> str:
    """The group that may use a device file; ``usual`` where that is root's, or nobody knows."""
    try:
        name = grp.getgrgid(os.stat(path).st_gid).gr_name
    except (OSError, KeyError):
        return usual
    return usual if name == "root" else name
