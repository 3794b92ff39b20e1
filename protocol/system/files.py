"""Files: whether there is one, and replacing one in one step."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_UNSUPPORTED = (errno.EINVAL, errno.ENOTSUP)  # some network file systems cannot sync a folder


def replace_file(
    path: Path,
    write: Callable[[Path], object],
    *,
    mode: int | None = None,
    owner: tuple[int, int] | None = None,
) -> None:
    """Replaces a file in one step: whoever looks, also after a crash, sees the old or the new one.

    The new file is written beside its place and moved there once it is on disk. Missing folders
    are made.

    Args:
        path: The file; it need not exist. A symbolic link is replaced, not followed.
        write: Writes the content to the path that it is given: an empty file with the same suffix.
        mode: Permission bits of the file, set before anything is written; ``None``: those that the
            umask leaves.
        owner: User and group of the file; ``None``: those of the process.

    Raises:
        OSError: It cannot be written; the error names what. Unless only the folder could not be
            synchronised, the old file, if any, still stands. Whatever else ``write`` raises passes
            through.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}{path.suffix}")
    try:
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
        handle = os.open(temporary, flags, 0o666 if mode is None else 0o600)
        try:
            with _named_in_errors(path):
                if mode is not None:
                    os.fchmod(handle, mode)
                if owner is not None:
                    os.fchown(handle, *owner)
                write(temporary)
                os.fsync(handle)
        finally:
            os.close(handle)
        os.replace(temporary, path)
    except BaseException:
        with suppress(OSError):
            os.unlink(temporary)
        raise
    _sync_folder(path.parent)


def replace_text(path: Path, text: str) -> None:
    """Replaces a text file, written in UTF-8, in one step; raises what ``replace_file`` does."""
    replace_file(path, lambda fresh: fresh.write_text(text, encoding="utf-8"))


def replace_bytes(path: Path, content: bytes) -> None:
    """Replaces a file in one step; raises what ``replace_file`` does."""
    replace_file(path, lambda fresh: fresh.write_bytes(content))


@contextmanager
def _named_in_errors(path: Path) -> Iterator[None]:
    """Names a file in errors that name none, as those of an open file do."""
    try:
        yield
    except OSError as error:
        if error.errno is not None and error.filename is None:
            error.filename = str(path)
        raise


def _sync_folder(folder: Path) -> None:
    """Puts names on disk: a rename could be lost with the power."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        with _named_in_errors(folder):
            os.fsync(handle)
    except OSError as error:
        if error.errno not in _UNSUPPORTED:
            raise
    finally:
        os.close(handle)


def may_exist(path: Path) -> bool:
    """Whether a file exists, or may: where that cannot be seen, opening it says why.

    ``Path.exists`` then raises or returns false, depending on the version of Python.
    """
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError:
        return True
    return True
