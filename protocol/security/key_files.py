"""Reads the files of a key directory, and refuses those that others could have written.

Whoever runs a daemon reads these files while it serves, so a read ends soon, whatever the file has
become: a pipe, a device, a hundred megabytes, a thousand opening brackets.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Collection
from pathlib import Path
from typing import Any, Final

from protocol.errors import KeysError
from protocol.text import parse_toml

MAX_SIZE: Final = 65_536
"""Longest file, bytes: more than 500 known clients."""

MAX_LINE: Final = 1024
"""Longest line, bytes: tomllib takes time and memory with the square of a dotted key's length."""


def read_toml(
    place: Path,
    *,
    owners: Collection[int] | None = None,
    closed: int = 0,
    advice: str = "",
) -> dict[str, Any]:
    """The content of a TOML file.

    Args:
        place: The file.
        owners: Ids of users who may own the file; ``None``: anybody.
        closed: Permission bits that must not be set.
        advice: How to come by the file where there is none.

    Raises:
        KeysError: It is no TOML file, too large, owned by another user, or open to others.
    """
    try:
        handle = os.open(place, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with open(handle, "rb") as file:
            state = os.fstat(handle)
            if not stat.S_ISREG(state.st_mode):
                raise KeysError(f"{place} is no regular file.")
            check_private(place, state, owners=owners, closed=closed)
            content = file.read(MAX_SIZE + 1)
    except FileNotFoundError:
        ending = f": {advice}" if advice else "."
        raise KeysError(f"{place} does not exist{ending}") from None
    except OSError as error:
        raise KeysError(f"{place} cannot be read: {error.strerror}.") from None
    if not content:  # an editor is about to write it
        raise KeysError(f"{place} is empty.")
    if len(content) > MAX_SIZE:
        raise KeysError(f"{place} has more than {MAX_SIZE} bytes; it is no file of robotd keys.")
    if max(map(len, content.splitlines())) > MAX_LINE:
        raise KeysError(f"{place} has a line of more than {MAX_LINE} bytes.")
    try:
        return parse_toml(content.decode())
    except ValueError as error:  # of TOML or of UTF-8
        raise KeysError(f"{place} is no TOML: {error}.") from None


def check_private(
    place: Path, state: os.stat_result, *, owners: Collection[int] | None, closed: int
) -> None:
    """Refuses what others own, or may read or change.

    Args:
        place: The file or directory.
        state: Result of ``os.stat`` for it.
        owners: Ids of users who may own it; ``None``: anybody.
        closed: Permission bits that must not be set.

    Raises:
        KeysError: Another user owns it, or it is open to others.
    """
    if owners is not None and state.st_uid not in owners:
        raise KeysError(
            f"{place} belongs to user {state.st_uid}, who could change whom this computer knows: "
            f"say chown {os.geteuid()} {place}"
        )
    if state.st_mode & closed:
        mode = "700" if stat.S_ISDIR(state.st_mode) else "600"
        verb = "change" if state.st_mode & closed & 0o022 else "read"
        raise KeysError(f"Others can {verb} {place}: say chmod {mode} {place}")
