"""How badly models fit what was observed, with a verdict as early as is exact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Bodies
from estimator.body.morphology import Array, Morphology
from estimator.errors import EstimatorError
from estimator.exploration.rules import Objective
from estimator.physics.base import ArrayPhysics, Physics, Readings, takes_arrays
from estimator.problem.genome import Genome
from estimator.readings.observation import Observation, ObservedReadings

Rows: TypeAlias = NDArray[np.intp]


@dataclass(frozen=True, kw_only=True)
class Fit:
    """How badly bodies fit observations.

    Attributes:
        errors: Of each body over all observations, shape (n,), by the objective.
        invalid: How many simulations cannot be believed.
        undecided: How many of the others have no weight.
    """

    errors: Array
    invalid: int
    undecided: int


def fit_bodies(
    bodies: Sequence[Morphology],
    observations: Sequence[Observation],
    modalities: Sequence[str],
    physics: Physics,
    objective: Objective,
) -> Fit:
    """How badly bodies fit, each simulated in all interactions."""
    targets = _Targets.of(observations, modalities, objective)
    reader = _BodyReader(bodies, physics, targets.programs)
    return targets.compare(reader, np.full(len(bodies), np.inf))


def fit_genes(
    genome: Genome,
    genes: Array,
    observations: Sequence[Observation],
    modalities: Sequence[str],
    physics: Physics,
    *,
    objective: Objective,
    limits: Array,
    foresight: ArrayPhysics | None = None,
) -> Fit:
    """How badly models fit; where an error reaches the model's limit, it is at least the limit.

    A model that the problem forbids is as bad as can be, and is not simulated.

    A model that has reached its limit in one interaction has lost, and is not simulated in the
    others. Where there is no foresight the latest interaction comes first, since the parents were
    not selected on it for as long as on the others.

    Args:
        genome: The code between genes and bodies.
        genes: Of n models, shape (n, genes).
        observations: What the robot felt.
        modalities: Modalities that count.
        physics: Predicts what models feel; it alone decides how well they fit.
        objective: What the errors of single interactions add up to.
        limits: Error at which a model has lost, shape (n,).
        foresight: Guesses which interaction a model fits worst, so that this one comes first. That
            saves simulations and changes no verdict.
    """
    allowed = ~genome.forbidden(genes)
    if not allowed.all():
        fit = fit_genes(
            genome,
            genes[allowed],
            observations,
            modalities,
            physics,
            objective=objective,
            limits=limits[allowed],
            foresight=foresight,
        )
        errors = np.full(len(genes), np.inf)
        errors[allowed] = fit.errors
        return replace(fit, errors=errors)
    targets = _Targets.of(observations, modalities, objective)
    order = None
    if foresight is not None and len(observations) > 1 and np.isfinite(limits).any():
        guesser = _ArrayReader(genome.bodies(genes), foresight, targets.programs)
        order = targets.worst_first(guesser, len(genes))
    reader: _Reader
    if takes_arrays(physics):
        reader = _ArrayReader(genome.bodies(genes), physics, targets.programs)
    else:
        reader = _BodyReader(genome.decode_all(genes), physics, targets.programs)
    return targets.compare(reader, limits, order)


class _Reader(Protocol):
    def __call__(self, models: Rows, interactions: Rows) -> Readings:
        """What some models feel, each in one of the interactions."""


@dataclass(frozen=True)
class _BodyReader:
    """Bodies one by one, for back-ends that simulate them one by one."""

    bodies: Sequence[Morphology]
    physics: Physics
    programs: Array

    def __call__(self, models: Rows, interactions: Rows) -> Readings:
        pairs = zip(models, interactions, strict=True)
        return self.physics.read([(self.bodies[row], self.programs[turn]) for row, turn in pairs])


@dataclass(frozen=True)
class _ArrayReader:
    """A whole population as arrays, for a back-end that takes them."""

    bodies: Bodies
    physics: ArrayPhysics
    programs: Array

    def __call__(self, models: Rows, interactions: Rows) -> Readings:
        return self.physics.read_bodies(self.bodies[models], self.programs[interactions])


@dataclass(frozen=True)
class _Targets:
    """What models are to feel.

    Attributes:
        observed: What the robot felt in each of k interactions.
        programs: What it did, rad, shape (k, motors).
        modalities: Modalities that count.
        objective: What the errors add up to.
    """

    observed: Sequence[ObservedReadings]
    programs: Array
    modalities: Sequence[str]
    objective: Objective

    @classmethod
    def of(
        cls, observations: Sequence[Observation], modalities: Sequence[str], objective: Objective
    ) -> _Targets:
        observed = [item.as_arrays() for item in observations]
        programs = np.array([item.angles for item in observed])
        return cls(observed, programs, modalities, objective)

    def worst_first(self, read: _Reader, count: int) -> Rows:
        """The interactions of each model, the one that it fits worst first, shape (n, k)."""
        turns = np.tile(np.arange(len(self.observed)), count)
        models = np.repeat(np.arange(count), len(self.observed))
        errors = self._errors(read(models, turns), turns).reshape(count, -1)
        return np.argsort(-errors, axis=1, kind="stable")

    def compare(self, read: _Reader, limits: Array, order: Rows | None = None) -> Fit:
        """Tries models in one interaction after the other, in some order, until they have lost."""
        count, models = len(self.observed), len(limits)
        if order is None:
            order = np.tile(np.arange(count)[::-1], (models, 1))
        errors = np.zeros((count, models))
        undecided = np.zeros(errors.shape, dtype=bool)
        alive = np.arange(models)
        invalid = 0
        for start, end in pairwise(_rounds(count)):
            if not alive.size:
                break
            rows = np.repeat(alive, end - start)
            turns = order[alive, start:end].ravel()
            readings = read(rows, turns)
            errors[turns, rows] = self._errors(readings, turns)
            undecided[turns, rows] = readings.undecided
            invalid += int(np.count_nonzero(~readings.valid))
            alive = alive[self.objective.lower_bound(errors[:, alive]) < limits[alive]]
        counted = int(np.count_nonzero(undecided & np.isfinite(errors)))
        return Fit(
            errors=self.objective.total(errors, undecided), invalid=invalid, undecided=counted
        )

    def _errors(self, readings: Readings, turns: Rows) -> Array:
        errors = np.zeros(len(turns))
        for turn in np.unique(turns):
            rows = np.flatnonzero(turns == turn)
            target = self.observed[turn]
            terms = self.objective.terms(readings[rows], target, self.modalities)
            if np.shape(terms) != rows.shape or not np.all(terms >= 0):
                raise EstimatorError(
                    f"the objective {type(self.objective).__name__} gave {terms!r} for {len(rows)} "
                    "models: it must give each an error of at least 0, infinite where the model's "
                    "reading is invalid"
                )
            errors[rows] = terms
        return errors


def _rounds(count: int) -> list[int]:
    """Where rounds of interactions start and end: the later, the more at once.

    Most models lose in the first round; those that are left will mostly have to go through all
    interactions, and larger batches are shared better among processes.
    """
    ends = [0]
    while ends[-1] < count:
        ends.append(min(2 * ends[-1] + 1, count))
    return ends
