"""The next motor program of a run, by an exploration rule."""

from __future__ import annotations

from collections.abc import Sequence

from estimator.exploration.rules import RULES
from estimator.exploration.situation import Choice, Models, Situation
from estimator.identification.paper.objectives import OBJECTIVES
from estimator.physics.base import ArrayMarginPhysics
from estimator.readings.observation import Observation
from estimator.search.randomness import Stream, generator
from estimator.storage.store import RunStore


def next_program(
    store: RunStore,
    rule: str,
    observations: Sequence[Observation],
    models: Models,
    physics: ArrayMarginPhysics,
) -> Choice:
    """What the rule chooses after these observations, the same each time.

    Args:
        store: The run's memory.
        rule: Name of the exploration rule.
        observations: Of all interactions so far.
        models: What is believed after them.
        physics: Predicts what models feel.
    """
    settings = store.settings
    situation = Situation(
        problem=store.problem,
        capabilities=store.capabilities,
        modalities=settings.modalities,
        observations=tuple(observations),
        models=models,
        objective=OBJECTIVES.load(settings.objective)(store.capabilities),
        physics=physics,
        clearance_cap=store.world.clearance_cap,
        rng=generator(settings.seed, Stream.PROGRAMS, len(observations)),
    )
    return RULES.load(rule)(situation)
