"""How a run stands, as its live page shows it, read again whenever another process has written."""

from __future__ import annotations

import time
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Final

import numpy as np

from estimator.body.morphology import Base, Morphology
from estimator.errors import RunDirectoryError
from estimator.posterior.fitted import FittedPosterior
from estimator.readings.observation import Observation
from estimator.report.result import Result
from estimator.report.summarise import summarise
from estimator.storage.database import file_status, is_locked
from estimator.storage.records import InteractionRecord
from estimator.storage.store import LOCK, RunStore

SHOWN: Final = 24
"""Number of bodies that stand for all samples of a posterior, or for a population."""


class RunState(Enum):
    """Whether a run goes on, as a sentence."""

    GOES_ON = "The run goes on."
    INTERRUPTED = "The run is not finished, and nobody works on it."
    FINISHED = "The run is finished."


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a run has come.

    Attributes:
        share: Share of the work that is done, 0 to 1.
        sentence: What the run is doing.
    """

    share: float
    sentence: str


@dataclass(frozen=True, kw_only=True)
class RunView:
    """How a run stands.

    Attributes:
        result: The run in numbers.
        base: The main body, which is known.
        best: The best body; ``None`` before the first interaction.
        bodies: Bodies that stand for the posterior, each as often as it is probable.
        pose: What the robot measured last.
        interactions: What the robot did, and why.
        progress: How far the run has come.
        state: Whether the run goes on.
    """

    result: Result
    base: Base
    best: Morphology | None
    bodies: tuple[Morphology, ...]
    pose: Observation | None
    interactions: tuple[InteractionRecord, ...]
    progress: Progress
    state: RunState

    @classmethod
    def of(cls, store: RunStore, *, written_to: bool) -> RunView:
        """Reads how a run stands.

        Args:
            store: The run.
            written_to: Whether some process works on it.
        """
        interactions, result = store.interactions(), summarise(store)
        state = RunState.GOES_ON if written_to else RunState.INTERRUPTED
        if result.complete:
            state = RunState.FINISHED
        fitted = FittedPosterior.of(store)
        observations = [item.observation for item in interactions if item.observation is not None]
        return cls(
            result=result,
            base=store.problem.base(store.capabilities),
            best=None if fitted is None else fitted.best_body,
            bodies=() if fitted is None else _shown(fitted),
            pose=observations[-1] if observations else None,
            interactions=tuple(interactions),
            progress=_progress(store, len(interactions), len(observations), result.complete),
            state=state,
        )


def _shown(fitted: FittedPosterior) -> tuple[Morphology, ...]:
    """Bodies that stand for the posterior, or the population, in no order."""
    is_population = fitted.summary is None  # each member is shown once
    bodies = fitted.bodies(min(SHOWN, len(fitted)) if is_population else SHOWN)
    return tuple(bodies[row] for row in np.random.default_rng(0).permutation(len(bodies)))


def _progress(store: RunStore, chosen: int, performed: int, finished: bool) -> Progress:
    settings = store.settings
    wanted = settings.interactions
    if finished:
        return Progress(share=1.0, sentence=f"{performed} interactions, all of them learnt from")
    if settings.keeps_samples:
        learnt = len(store.posteriors())
        share = learnt / wanted
    else:
        last = store.latest_generation()
        generations = 0 if last is None else last.number + 1
        learnt, step = divmod(generations, settings.generations + 1)
        share = generations / (wanted * (settings.generations + 1))
    if chosen > performed:
        sentence = f"interaction {chosen} of {wanted}: the robot moves"
    elif performed > learnt:
        sentence = f"interaction {performed} of {wanted}: learning from it"
        if not settings.keeps_samples:
            sentence += f", generation {step} of {settings.generations}"
    elif learnt < wanted:
        sentence = f"interaction {learnt + 1} of {wanted}: choosing a movement"
    elif not settings.keeps_samples and settings.physics == settings.reference:
        sentence = "the best model is held against all readings"
    else:
        sentence = "a simulator has the last word"
    return Progress(share=share, sentence=sentence)


_AT_LEAST: Final = 0.5  # s between two readings of the run
_IDLE: Final = 20  # pause relative to the CPU time of a reading: at most 5 % of a core
_SILENT: Final = 3.0  # s between two looks, without news, whether anybody still writes


class RunFollower:
    """Reads a run again whenever it has changed. It neither writes nor keeps the writer waiting.

    Args:
        directory: The run directory.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._last_stamp: tuple[int, int] | None = None
        self._next_reading = 0.0
        self._view: RunView | None = None

    def news(self) -> RunView | None:
        """How the run stands, or ``None`` where that is known already.

        Raises:
            RunDirectoryError: There is no run, or it is damaged.
        """
        now = time.monotonic()
        if now < self._next_reading:
            return None
        self._next_reading = now + _AT_LEAST
        try:
            return self._news_at(now)
        except RunDirectoryError:
            self._last_stamp = self._view = None  # it may come back as it was
            raise

    def _news_at(self, now: float) -> RunView | None:
        stamp = self._stamp()
        is_silent = stamp == self._last_stamp
        if is_silent and (self._view is None or self._view.state is not RunState.GOES_ON):
            return None
        written_to = is_locked(self._directory, LOCK)
        if is_silent and written_to:
            self._next_reading = now + _SILENT
            return None
        used_before = time.thread_time()  # which waiting for the writer does not add to
        with RunStore.open(self._directory, to_write=False) as store:
            view = RunView.of(store, written_to=written_to)
        self._last_stamp, self._view = stamp, view
        self._next_reading = now + max(_AT_LEAST, _IDLE * (time.thread_time() - used_before))
        return view

    def _stamp(self) -> tuple[int, int]:
        """Time and size of the database's file, which change with every transaction."""
        status = file_status(self._directory)
        if status is None:
            raise RunDirectoryError(
                f"{self._directory} holds no run. Start one with `estimator identify`."
            )
        return status.st_mtime_ns, status.st_size
