"""The SQLite file of a run: its tables, and transactions that survive a power cut.

SQLite keeps a rollback journal rather than a write-ahead log: a closed run is then a single file
that can be copied, it also works on network file systems, and a handful of commits per second
costs nothing. ``synchronous=EXTRA`` makes each commit survive a power cut too.
"""

from __future__ import annotations

import os
import sqlite3
import stat
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final

from estimator.errors import RunDirectoryError

DATABASE: Final = "run.sqlite"

_TABLES: Final = (
    "CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT",
    """CREATE TABLE interactions (
        number INTEGER PRIMARY KEY, program TEXT NOT NULL, reason TEXT NOT NULL, bits REAL,
        request_id INTEGER, session TEXT, observation TEXT
    ) STRICT""",
    """CREATE TABLE beliefs (
        number INTEGER PRIMARY KEY, belief TEXT NOT NULL, counters TEXT NOT NULL
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

_DAMAGE: Final = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError)
"""What values raise that are not what was written."""


def file_status(directory: Path) -> os.stat_result | None:
    """The status of the database's file; ``None`` where there is no such file.

    Raises:
        RunDirectoryError: It cannot be seen, or not read, by this user.
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
    """Whether there is a run in a directory, which a process may have died before making.

    A damaged database counts as a run: whoever opens it says what is wrong with it.

    Raises:
        RunDirectoryError: It cannot be seen, or not read, by this user.
    """
    path = directory / DATABASE
    if file_status(directory) is None:
        return False
    with closing(sqlite3.connect(path)) as database:
        try:
            return not is_empty(database)
        except (sqlite3.DatabaseError, UnicodeDecodeError):
            return True


def connect(directory: Path) -> sqlite3.Connection:
    """Opens the database in a directory; creates an empty one if there is none."""
    database = sqlite3.connect(directory / DATABASE, isolation_level=None, timeout=10.0)
    database.execute("PRAGMA journal_mode = DELETE")
    database.execute("PRAGMA synchronous = EXTRA")
    return database


def is_empty(database: sqlite3.Connection) -> bool:
    """Whether it has no tables."""
    return database.execute("SELECT 1 FROM sqlite_master").fetchone() is None


def make_tables(database: sqlite3.Connection) -> None:
    """Makes the tables of a run, within a transaction."""
    for statement in _TABLES:
        database.execute(statement)


@contextmanager
def reading(directory: Path) -> Iterator[None]:
    """Turns errors that come of a damaged database into one with a sentence.

    Raises:
        RunDirectoryError: What is there cannot be read, or is not what this program wrote.
    """
    try:
        yield
    except RunDirectoryError:
        raise
    except (sqlite3.Error, *_DAMAGE) as error:
        reason = str(error).partition("\n")[0].rstrip(".")
        raise RunDirectoryError(
            f"{directory / DATABASE} is not a run: {reason}. If it was one, it is damaged: take "
            "back a copy of it, or start the run anew."
        ) from error


@contextmanager
def transaction(database: sqlite3.Connection) -> Iterator[None]:
    """Commits everything in the block together, or nothing of it."""
    database.execute("BEGIN IMMEDIATE")
    try:
        yield
        database.execute("COMMIT")
    except BaseException:
        if database.in_transaction:  # SQLite itself has rolled back where the disk was full
            database.execute("ROLLBACK")
        raise
