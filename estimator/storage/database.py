"""The SQLite file of a run: its tables, its writer, and transactions that survive a power cut.

SQLite keeps a rollback journal rather than a write-ahead log: a closed run is then a single file
that can be copied, it also works on network file systems, and a handful of commits per second
costs nothing. ``synchronous=EXTRA`` makes each commit survive a power cut too.

The lock of a run's directory keeps other writers out, unless its file was deleted or the file
system has no locks. So each writer leaves a token of its own when it begins; a writer whose token
is no longer there commits nothing more.
"""

from __future__ import annotations

import fcntl
import os
import re
import sqlite3
import stat
import uuid
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from estimator.errors import RunDirectoryError

DATABASE: Final = "run.sqlite"

_TABLES: Final = (
    "CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT",
    """CREATE TABLE interactions (
        number INTEGER PRIMARY KEY, program TEXT NOT NULL, reason TEXT NOT NULL, bits REAL,
        request_id INTEGER, session TEXT, observation TEXT
    ) STRICT""",
    """CREATE TABLE posteriors (
        number INTEGER PRIMARY KEY, posterior TEXT NOT NULL, counters TEXT NOT NULL
    ) STRICT""",
    """CREATE TABLE generations (
        number INTEGER PRIMARY KEY, iteration INTEGER NOT NULL,
        errors TEXT NOT NULL, best TEXT NOT NULL, counters TEXT NOT NULL
    ) STRICT""",
    "CREATE TABLE checkpoint (only INTEGER PRIMARY KEY CHECK (only = 0), value TEXT NOT NULL)"
    " STRICT",
    """CREATE TABLE predictions (
        validation INTEGER, number INTEGER, program TEXT NOT NULL, readings TEXT NOT NULL,
        request_id INTEGER, session TEXT, observation TEXT,
        PRIMARY KEY (validation, number)
    ) STRICT""",
)

_NAMES: Final = [re.split(r"[ (]+", table)[2] for table in _TABLES]

_DAMAGE: Final = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError)
"""Errors that stored values raise which are not what was written."""

ADVICE: Final = {
    sqlite3.SQLITE_BUSY: (
        "Another process holds it, or its file system has no locks: then choose another disk."
    ),
    sqlite3.SQLITE_FULL: "Look whether the disk is full.",
    sqlite3.SQLITE_IOERR: "Look whether the disk is full.",
    sqlite3.SQLITE_CANTOPEN: "Look whether its directory can be written.",
    sqlite3.SQLITE_READONLY: "Look whether its directory can be written.",
}
"""What to do, by SQLite's codes for what has nothing to do with what is stored."""


def file_status(directory: Path) -> os.stat_result | None:
    """The status of the database's file; ``None`` where there is no such file.

    Raises:
        RunDirectoryError: The file cannot be seen, or not read, by this user.
    """
    path = directory / DATABASE
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            return None
        path.open("rb").close()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise RunDirectoryError(f"{directory} cannot be read: {error.strerror}.") from error
    return status


def holds_run(directory: Path) -> bool:
    """Whether a directory holds a run; it does not if a process died before it had made one.

    A damaged database counts as a run: to open it raises an error that says what is wrong.

    Raises:
        RunDirectoryError: The database cannot be seen, or not read, by this user.
    """
    path = directory / DATABASE
    if file_status(directory) is None:
        return False
    with closing(sqlite3.connect(path)) as database:
        try:
            return not is_empty(database)
        except (sqlite3.DatabaseError, UnicodeDecodeError):
            return True


class RunDatabase(sqlite3.Connection):
    """A connection to the database of a run.

    Attributes:
        directory: Run directory, for messages.
        writer: Token of this connection, if it writes.
    """

    directory = Path()
    writer: str | None = None

    def meta(self, key: str) -> str | None:
        """What the table ``meta`` has under a key; ``None``: nothing."""
        row = self.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return None if row is None else str(row[0])


def connect(directory: Path) -> RunDatabase:
    """Opens the database in a directory; creates an empty one if there is none."""
    file = directory / DATABASE
    database = sqlite3.connect(file, isolation_level=None, timeout=10.0, factory=RunDatabase)
    assert isinstance(database, RunDatabase)
    database.directory = directory
    database.execute("PRAGMA journal_mode = DELETE")
    database.execute("PRAGMA synchronous = EXTRA")
    return database


def claim(database: RunDatabase) -> None:
    """Takes the run over, within a transaction: earlier writers can write to it no longer."""
    database.writer = uuid.uuid4().hex
    database.execute("INSERT OR REPLACE INTO meta VALUES ('writer', ?)", (database.writer,))


def is_empty(database: sqlite3.Connection) -> bool:
    """Whether a database has no tables."""
    return database.execute("SELECT 1 FROM sqlite_master").fetchone() is None


def make_tables(database: sqlite3.Connection) -> None:
    """Makes the tables of a run, within a transaction."""
    for statement in _TABLES:
        database.execute(statement)


def check_tables(database: sqlite3.Connection, names: Collection[str] = ()) -> None:
    """Refuses other tables than those of a run, such as a view that computes what is read from it.

    Args:
        database: Database of which nothing was read yet.
        names: Names of the tables to check; none: all, and that there are no others.

    Raises:
        ValueError: A table is not that of a run; the message says which.
    """
    ours = dict(zip(_NAMES, _TABLES, strict=True))
    rows = database.execute(
        "SELECT name, sql FROM sqlite_master WHERE name NOT LIKE 'sqlite\\_%' ESCAPE '\\'"
    )
    existing = dict(rows)
    for name in names or {*ours, *existing}:
        if existing.get(name) != ours.get(name):
            raise ValueError(f"what it holds as {name} is not the table of a run")


@contextmanager
def reading(directory: Path) -> Iterator[None]:
    """Turns errors of a database that is damaged, or cannot be read now, into one that says so.

    Raises:
        RunDirectoryError: What is there cannot be read, or is not what this program wrote.
    """
    try:
        yield
    except RunDirectoryError:
        raise
    except (sqlite3.Error, *_DAMAGE) as error:
        if code_of(error) in ADVICE:
            raise RunDirectoryError(
                f"{directory / DATABASE} cannot be read now: {error}."
            ) from error
        reason = _first_reason(error)
        raise RunDirectoryError(
            f"{directory / DATABASE} is not a run: {reason}. If it was one, it is damaged: take "
            f"back a copy of it, or delete {directory} and start the run anew."
        ) from error


def code_of(error: Exception) -> int:
    """SQLite's code of an error, without its details; 0 where the error is not SQLite's."""
    return int(getattr(error, "sqlite_errorcode", 0) & 0xFF)


def _first_reason(error: Exception) -> str:
    if isinstance(error, ValidationError):
        detail = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, detail["loc"]))
        message = detail["msg"].removeprefix("Value error, ")
        return f"{error.title}: {place}: {message}" if place else message
    return str(error).partition("\n")[0].rstrip(".")


@contextmanager
def transaction(database: RunDatabase) -> Iterator[None]:
    """Commits everything in the block together, or nothing of it.

    Within another transaction the block is a part of that one.

    Raises:
        RunDirectoryError: Another process has begun to write to the run.
    """
    is_part = database.in_transaction
    if is_part:
        yield
        return
    database.execute("BEGIN IMMEDIATE")
    try:
        _check_writer(database)
        yield
        database.execute("COMMIT")
    except BaseException:
        if database.in_transaction:  # SQLite itself has rolled back where the disk was full
            database.execute("ROLLBACK")
        raise


def _check_writer(database: RunDatabase) -> None:
    if database.writer is not None and database.meta("writer") != database.writer:
        raise RunDirectoryError(
            f"Another process has begun to write to {database.directory}, so this one ends: its "
            "lock was removed, or its file system has none. Let the other finish or end it first."
        )


def lock(directory: Path, name: str) -> int:
    """Takes a directory's lock, which the kernel frees when its holder dies.

    Args:
        directory: The directory; made if it is not there.
        name: Name of the lock's file.

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
