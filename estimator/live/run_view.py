"""How a run stands, as its live page shows it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from estimator.body.morphology import Base, Morphology
from estimator.posterior.fitted import FittedPosterior
from estimator.readings.observation import Observation
from estimator.report.result import Result
from estimator.report.summarise import summarise
from estimator.storage.records import InteractionRecord
from estimator.storage.store import RunStore

SHOWN: Final = 24
"""Bodies that stand for all samples of a posterior, or for a population."""


class RunState(Enum):
    """Whether a run goes on."""

    GOES_ON = "goes on"
    INTERRUPTED = "interrupted"
    FINISHED = "finished"


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a run has come.

    Attributes:
        share: Of the work, 0 to 1.
        sentence: What it is at.
    """

    share: float
    sentence: str


@dataclass(frozen=True, kw_only=True)
class RunView:
    """How a run stands.

    Attributes:
        result: In numbers.
        base: The main body, which is known.
        best: The best body; ``None`` before the first interaction.
        bodies: Bodies that stand for what is believed, each as often as it is probable.
        pose: What the robot felt last.
        interactions: What it did, and why.
        wanted: How many interactions there are to be.
        progress: How far it has come.
        state: Whether it goes on.
    """

    result: Result
    base: Base
    best: Morphology | None
    bodies: tuple[Morphology, ...]
    pose: Observation | None
    interactions: tuple[InteractionRecord, ...]
    wanted: int
    progress: Progress
    state: RunState

    @classmethod
    def of(cls, store: RunStore, *, written_to: bool) -> RunView:
        """Reads it from a run.

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
            wanted=store.settings.interactions,
            progress=_progress(store, len(interactions), len(observations), result.complete),
            state=state,
        )


def _shown(fitted: FittedPosterior) -> tuple[Morphology, ...]:
    """Bodies that stand for all that is believed, in no order."""
    counts_alike = fitted.belief is None  # a population, of which each is shown once
    bodies = fitted.bodies(min(SHOWN, len(fitted)) if counts_alike else SHOWN)
    return tuple(bodies[row] for row in np.random.default_rng(0).permutation(len(bodies)))


def _progress(store: RunStore, chosen: int, performed: int, finished: bool) -> Progress:
    settings = store.settings
    wanted = settings.interactions
    if finished:
        return Progress(share=1.0, sentence=f"{performed} interactions, all of them learnt from")
    if settings.method == "posterior":
        learnt = len(store.beliefs())
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
        if settings.method == "paper":
            sentence += f", generation {step} of {settings.generations}"
    elif learnt < wanted:
        sentence = f"interaction {learnt + 1} of {wanted}: choosing a movement"
    elif settings.method == "paper" and settings.physics == settings.reference:
        sentence = "the best model is held against all readings"
    else:
        sentence = "a simulator has the last word"
    return Progress(share=share, sentence=sentence)
