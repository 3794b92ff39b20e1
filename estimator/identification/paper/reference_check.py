"""Whatever searched, the reference back-end ranks the leading models: it simulates them again.

Of the final population the best models that differ from each other are simulated on every motor
program of the run. Both errors are kept, and the ranking is the reference's.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Final

import numpy as np

from estimator.body.morphology import Array, Morphology
from estimator.identification.paper.fit import fit_bodies
from estimator.identification.paper.objectives import Objective
from estimator.physics.base import Physics
from estimator.problem.genome import Genome
from estimator.readings.observation import Observation
from estimator.storage.records import Finish

LEADERS: Final = 10
"""Largest number of models that are simulated again; not tuned."""

SAME_LENGTH: Final = 0.005
"""Models whose parts are attached alike and whose lengths differ by less than this, m, are one."""


def finish(
    genome: Genome,
    population: Array,
    errors: Array,
    *,
    observations: Sequence[Observation],
    modalities: Sequence[str],
    physics: Physics,
    objective: Objective,
) -> Finish:
    """Simulates the leading distinct models.

    Args:
        genome: The code between genes and bodies.
        population: Genes, shape (n, genes).
        errors: Errors that the search found, shape (n,).
        observations: Observations of every interaction of the run.
        modalities: Modalities that the subjective error counts.
        physics: The reference back-end.
        objective: What the search minimised.
    """
    leaders = leading(genome, population, errors)
    bodies = genome.decode_all(population[leaders])
    simulations, steps = physics.simulations, physics.steps
    fitted = fit_bodies(bodies, observations, modalities, physics, objective)
    return Finish(
        models=tuple(leaders),
        searched=tuple(errors[leaders].tolist()),
        simulated=tuple(fitted.errors.tolist()),
        simulations=physics.simulations - simulations,
        invalid=fitted.invalid,
        steps=physics.steps - steps,
    )


def leading(genome: Genome, population: Array, errors: Array) -> list[int]:
    """Indices of the best models, none of them much like a better one; at most ``LEADERS``."""
    leaders: list[int] = []
    bodies: list[Morphology] = []
    for index in np.argsort(errors, kind="stable").tolist():
        body = genome.decode(population[index])
        if np.isfinite(errors[index]) and not any(_alike(body, better) for better in bodies):
            leaders.append(index)
            bodies.append(body)
        if len(leaders) == LEADERS:
            break
    return leaders


def pairs_turned(finish: Finish) -> tuple[int, int]:
    """Number of pairs of leading models that the two back-ends rank differently, and of all."""
    pairs = list(combinations(zip(finish.searched, finish.simulated, strict=True), 2))
    turned = sum((one[0] < two[0]) != (one[1] < two[1]) for one, two in pairs)
    return turned, len(pairs)


def _alike(one: Morphology, two: Morphology) -> bool:
    return all(
        (a.parent, a.mount, a.hinge) == (b.parent, b.mount, b.hinge)
        and abs(a.length - b.length) < SAME_LENGTH
        for a, b in zip(one.parts, two.parts, strict=True)
    )
