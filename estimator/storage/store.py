"""A run directory that survives ``kill -9`` at any instant.

``run.sqlite`` holds everything that must survive, and ``run.lock`` is held (flock) by the process
that writes; where the lock does not keep a second writer out, the first can write no more.
``docs/formats.md`` lists the other files, which are derived and free to delete.

Two rules make the run durable. What is about to be asked of the robot is committed before the
request leaves, and what it answered is committed before anything else happens; so a restart knows
the id with which to ask for the outcome. And a generation's record and the search's state after it
go into one transaction, so that a restart finds either both or neither.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Self

import numpy as np

from estimator.body.morphology import Array
from estimator.errors import EstimatorError, PluginError, ProblemError, RunDirectoryError
from estimator.physics.base import WorldSettings
from estimator.plugins import missing
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation, Program
from estimator.storage.after_search import SearchEnd, Validations
from estimator.storage.database import (
    DATABASE,
    RunDatabase,
    check_tables,
    claim,
    connect,
    holds_run,
    is_empty,
    lock,
    make_tables,
    reading,
    transaction,
)
from estimator.storage.posteriors import ROUNDING, StoredPosterior
from estimator.storage.records import (
    Checkpoint,
    Counters,
    Generation,
    InteractionRecord,
    Ticket,
    first_id,
    performed,
)
from estimator.storage.run_config import RunSettings
from protocol.system.process import Closable
from protocol.text import command_line
from protocol.wire.capabilities import Capabilities

LOCK: Final = "run.lock"
READINGS: Final = "readings.csv"
ROBOT: Final = "robot.json"
FORMAT: Final = 6


class RunStore(Closable):
    """A run on disk; a context manager. ``create`` and ``open`` make one.

    Attributes:
        directory: The run directory.
        settings: What the run was asked to do.
        capabilities: What the robot said it is.
        client_id: The client id of the run's requests to the robot.
        search_end: What is stored at the end of the search, where that optimised a population.
        validations: What the run's models predicted of motor programs performed afterwards.
    """

    def __init__(self, directory: Path, database: RunDatabase, lock: int | None):
        self.directory = directory
        self._database = database
        self._lock = lock
        with reading(directory):
            self.settings = RunSettings.model_validate_json(self._meta("settings"))
            self.capabilities = Capabilities.from_map(json.loads(self._meta("capabilities")))
            self.client_id = str(json.loads(self._meta("client_id")))
        self._joints = len(self.capabilities.joints)
        self._problem: Problem | None = None
        self.search_end = SearchEnd(database)
        self.validations = Validations(database, self._joints)

    def __exit__(self, *raised: object) -> None:
        """Closes the run; an error that packages explain which are not installed names these.

        Raises:
            RunDirectoryError: The run was made with a package that is not installed.
        """
        super().__exit__(*raised)
        _, error, _ = raised
        reason = error.__cause__ if isinstance(error, RunDirectoryError) else error
        needs_it = isinstance(reason, (PluginError, ProblemError))
        is_stored = isinstance(reason, ValueError) and not isinstance(reason, EstimatorError)
        if needs_it or is_stored:
            packages = missing(self.settings.plugins)
            if packages:
                raise RunDirectoryError(
                    f"{self.directory} was made with {packages}, which is not installed here: "
                    f"install it ({reason})."
                )

    # --- what follows from the settings -----------------------------------------------------------

    @property
    def problem(self) -> Problem:
        """The problem that the run was started with, written out for its robot.

        Whether the robot leans in its zero pose is known from the first observation on.

        Raises:
            ProblemError: The problem's text is damaged, or of another version.
        """
        if self._problem is None:
            stated = Problem.parse(self.settings.problem_text, f"problem of {self.directory}")
            first = next(iter(self.observations()), None)
            zero_tilt = None if first is None else first.zero_tilt
            self._problem = stated.for_robot(self.capabilities, zero_tilt)
        return self._problem

    @cached_property
    def genome(self) -> Genome:
        """The genome that decodes the run's models."""
        return Genome(self.problem, self.problem.base(self.capabilities))

    @cached_property
    def world(self) -> WorldSettings:
        """The world in which the run's models are simulated."""
        world = self.problem.settings(self.capabilities)
        return replace(world, full_steps=self.settings.full_steps)

    # --- opening and closing ----------------------------------------------------------------------

    @staticmethod
    def check_free(directory: Path) -> None:
        """Makes sure that nothing in a directory, if there is one, is in the way of a new run.

        Raises:
            RunDirectoryError: The directory holds a run already, or files that a run would replace,
                or cannot be read.
        """
        if holds_run(directory):
            raise _holds_run_already(directory)
        for name in (READINGS, ROBOT):
            if (directory / name).exists():
                raise RunDirectoryError(
                    f"{directory} holds a {name} that is of no run there, and a run would replace "
                    "it: give another --out."
                )

    @classmethod
    def create(
        cls,
        directory: Path,
        settings: RunSettings,
        capabilities: Capabilities,
        client_id: str,
        *,
        fill: Callable[[Self], None] | None = None,
    ) -> Self:
        """Makes a run directory with one connection to the robot, number 0, already counted.

        Args:
            directory: The directory.
            settings: What the run is asked to do.
            capabilities: What the robot says it is.
            client_id: The client id of the run's requests to the robot.
            fill: Stores what the run holds from the first instant: it is there with that, or not.

        Raises:
            RunDirectoryError: The directory holds a run already, or files that it would replace,
                or cannot be made.
        """
        cls.check_free(directory)
        held = lock(directory, LOCK)
        database = None
        try:
            database = connect(directory)
            with transaction(database):
                if not is_empty(database):  # another process has been as quick
                    raise _holds_run_already(directory)
                make_tables(database)
                meta = {
                    "format": json.dumps(FORMAT),
                    "settings": settings.model_dump_json(),
                    "capabilities": json.dumps(capabilities.to_map()),
                    "client_id": json.dumps(client_id),
                    "connections": json.dumps(1),
                }
                database.executemany("INSERT INTO meta VALUES (?, ?)", meta.items())
                claim(database)
                store = cls(directory, database, held)
                if fill is not None:
                    fill(store)
            return store
        except BaseException:
            _close(database, held)
            raise

    @classmethod
    def open(cls, directory: Path, *, to_write: bool = True) -> Self:
        """Opens a run; ``to_write`` keeps every other writer out until ``close``.

        Raises:
            RunDirectoryError: There is no run, its format is another version's, or another process
                writes to it.
        """
        if not holds_run(directory):
            raise RunDirectoryError(
                f"{directory} holds no run: none was started there, or it was ended before it had "
                "begun. Start one with `estimator identify`."
            )
        held = lock(directory, LOCK) if to_write else None
        database = None
        try:
            with reading(directory):
                database = connect(directory)
                check_tables(database, ["meta"])
                row = database.execute("SELECT value FROM meta WHERE key = 'format'").fetchone()
                written = json.loads(row[0])
            if written != FORMAT:
                raise RunDirectoryError(
                    f"{directory} was written in run format {written}, and this version reads "
                    f"{FORMAT}: use the version of bodyschema that made it."
                )
            with reading(directory):
                check_tables(database)
            if to_write:
                with transaction(database):
                    claim(database)
            return cls(directory, database, held)
        except BaseException:
            _close(database, held)
            raise

    def close(self) -> None:
        """Closes the database and releases the lock; may be called twice."""
        _close(self._database, self._lock)
        self._lock = None

    # --- the robot --------------------------------------------------------------------------------

    def new_connection(self) -> int:
        """Counts one more connection to the robot; returns the first request id it may use."""
        with transaction(self._database):
            number = int(json.loads(self._meta("connections")))
            self._database.execute(
                "UPDATE meta SET value = ? WHERE key = 'connections'", (json.dumps(number + 1),)
            )
        return first_id(number)

    def plan(
        self, number: int, program: Program, *, reason: str = "", bits: float | None = None
    ) -> None:
        """Commits the motor program of an interaction that is still to be performed, and why."""
        with transaction(self._database):
            self._database.execute(
                "INSERT INTO interactions (number, program, reason, bits) VALUES (?, ?, ?, ?)",
                (number, json.dumps(program), reason, bits),
            )

    def ask(self, number: int, ticket: Ticket | None) -> None:
        """Commits the id under which an interaction is about to be asked for; ``None``: no id."""
        with transaction(self._database):
            self._database.execute(
                "UPDATE interactions SET request_id = ?, session = ? WHERE number = ?",
                (ticket and ticket.request_id, ticket and ticket.session, number),
            )

    def observe(self, number: int, observation: Observation) -> None:
        """Commits what an interaction returned."""
        with transaction(self._database):
            self._database.execute(
                "UPDATE interactions SET observation = ? WHERE number = ?",
                (observation.model_dump_json(), number),
            )
        if not number:
            self._problem = self.problem.for_robot(self.capabilities, observation.zero_tilt)

    def interactions(self) -> list[InteractionRecord]:
        """All interactions in order; only the last one can lack its observation."""
        with reading(self.directory):
            rows = self._database.execute(
                "SELECT reason, bits, program, request_id, session, observation FROM interactions "
                "ORDER BY number"
            )
            return [
                InteractionRecord(reason=reason, bits=bits, **performed(self._joints, *columns))
                for reason, bits, *columns in rows
            ]

    def observations(self) -> list[Observation]:
        """The observations so far, in order."""
        items = self.interactions()
        return [item.observation for item in items if item.observation is not None]

    # --- the search -------------------------------------------------------------------------------

    def save(self, generation: Generation, state: Mapping[str, Any]) -> None:
        """Commits a generation's record together with the search's state after it."""
        with transaction(self._database):
            self._database.execute(
                "INSERT INTO generations VALUES (?, ?, ?, ?, ?)",
                (
                    generation.number,
                    generation.iteration,
                    json.dumps(generation.errors),
                    json.dumps(generation.best),
                    generation.counters.model_dump_json(),
                ),
            )
            self._save_checkpoint(generation.number, state)

    def save_posterior(
        self,
        number: int,
        posterior: StoredPosterior,
        counters: Counters,
        state: Mapping[str, Any] | None,
    ) -> None:
        """Commits the posterior after an interaction, with the sampler's state.

        Args:
            number: Number of the interaction.
            posterior: Posterior; replaces what was stored of that interaction before.
            counters: Cost of the run by then.
            state: State of the sampler; ``None`` leaves the checkpoint as it is.
        """
        with transaction(self._database):
            self._database.execute(
                "INSERT OR REPLACE INTO posteriors VALUES (?, ?, ?)",
                (number, posterior.model_dump_json(round_trip=True), counters.model_dump_json()),
            )
            if state is not None:
                self._save_checkpoint(number, state)

    def _save_checkpoint(self, number: int, state: Mapping[str, Any]) -> None:
        checkpoint = json.dumps({"number": number, "state": state})
        self._database.execute("INSERT OR REPLACE INTO checkpoint VALUES (0, ?)", (checkpoint,))

    def posteriors(self) -> list[tuple[StoredPosterior, Counters]]:
        """The posterior after each interaction, with the cost of the run by then."""
        with reading(self.directory):
            rows = self._database.execute(
                "SELECT posterior, counters FROM posteriors ORDER BY number"
            )
            stored = [
                (
                    StoredPosterior.model_validate_json(posterior),
                    Counters.model_validate_json(counters),
                )
                for posterior, counters in rows
            ]
            for posterior, _ in stored:
                self.check_genes(np.array([posterior.best]))
            return stored

    def checkpoint(self) -> Checkpoint | None:
        """Latest committed state of the search or sampler; ``None`` before the first."""
        with reading(self.directory):
            row = self._database.execute("SELECT value FROM checkpoint").fetchone()
            return None if row is None else Checkpoint(**json.loads(row[0]))

    def generations(self) -> list[Generation]:
        """The records of all generations in order."""
        return self._generations("ORDER BY number")

    def latest_generation(self) -> Generation | None:
        """The record of the last generation; ``None`` before the first."""
        return next(iter(self._generations("ORDER BY number DESC LIMIT 1")), None)

    def _generations(self, clause: str) -> list[Generation]:
        with reading(self.directory):
            rows = self._database.execute(f"SELECT * FROM generations {clause}")
            return [
                Generation(
                    number=number,
                    iteration=iteration,
                    errors=tuple(map(float, json.loads(errors))),
                    best=tuple(map(float, json.loads(best))),
                    counters=Counters.model_validate_json(counters),
                )
                for number, iteration, errors, best, counters in rows
            ]

    def check_genes(self, genes: Array) -> None:
        """Refuses genes, shape (n, genes), that do not fit the run's genome.

        Raises:
            ValueError: Their number or their range is wrong.
        """
        size = self.genome.size
        if genes.shape[1:] != (size,):
            raise ValueError(f"its bodies do not have {size} genes, as the problem's do")
        if not np.all((genes >= -ROUNDING) & (genes <= 1 + ROUNDING)):
            raise ValueError("genes lie outside 0 to 1")

    @property
    def complete(self) -> bool:
        """Whether the run has come to its end: nothing is left that ``resume`` would do."""
        if self.settings.keeps_samples:
            stored = self.posteriors()
            return bool(stored) and (stored[-1][0].simulated > 0 or stored[-1][0].diagnosed)
        return self.search_end.is_reached

    # --- the database -----------------------------------------------------------------------------

    @property
    def version(self) -> int:
        """A number that changes as soon as another process begins to write to the run."""
        with reading(self.directory):
            return int(self._database.execute("PRAGMA data_version").fetchone()[0])

    def _meta(self, key: str) -> str:
        value = self._database.meta(key)
        if value is None:
            raise RunDirectoryError(f"{self.directory / DATABASE} lacks its {key}.")
        return value


def _holds_run_already(directory: Path) -> RunDirectoryError:
    resume = command_line("estimator", "resume", directory)
    return RunDirectoryError(
        f"{directory} holds a run already: go on with `{resume}`, or give another --out."
    )


def _close(database: sqlite3.Connection | None, lock: int | None) -> None:
    if database is not None:
        database.close()
    if lock is not None:
        os.close(lock)
